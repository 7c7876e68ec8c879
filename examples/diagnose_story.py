"""The story in small: logs of an arm with something hidden in it, the gap, its name, the gap after.

The logs come from ``benches/blind``, a simulator written apart from the package, from a fixed seed; the diagnosis sees
the logs and a parameter file that is off by 10 to 15 %. Run it with ``make demo`` or
``python examples/diagnose_story.py --out out``.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import bha

ROOT = Path(__file__).resolve().parent.parent
SEED, KIND, WHERE = 7, "weak_bellows", "bellows 22"
#: Factor on the length of the logs: 60 s of training logs take too long for a demonstration.
DURATION = 0.4


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"))
    options = parser.parse_args()
    case, result = options.out / "story_case", options.out / "diagnosis"
    begin = time.perf_counter()
    sys.path.insert(0, str(ROOT / "benches" / "blind"))
    from blindgen import make_case  # noqa: PLC0415  (not part of the package)

    print("An arm with something hidden in it: five logs and a parameter file that is off by 10 to 15 %.")
    make_case(SEED, KIND, WHERE, 1.0, "standard", case, duration_factor=DURATION)
    print(f"  written to {case} ({time.perf_counter() - begin:.0f} s)")
    arm = bha.Arm.load(case / "arm.toml")
    train = [bha.Log.read(case / f"train_{name}.csv") for name in ("steps", "multisine", "release")]
    held = [bha.Log.read(case / f"holdout_{k}.csv") for k in (1, 2)]
    last = ""

    def tell(stage: str, share: float | None) -> None:
        nonlocal last
        if stage != last:
            print(f"  [{time.perf_counter() - begin:4.0f} s] {stage}")
            last = stage

    found = bha.diagnose(arm, train, held, out=result, progress=tell)
    gap = found.gap
    print(f"Gap on logs that took no part: {1e3 * gap.before:.2f} mm, noise {1e3 * gap.noise:.2f} mm.")
    print(f"Verdict: {found.verdict}. {found.reason}.")
    for effect in found.effects:
        numbers = ", ".join(f"{name} = {n.value:.3g} {n.unit}" for name, n in effect.parameters.items())
        print(f"  {effect.kind} at {effect.where}: {numbers}")
    print(f"Gap after: {1e3 * gap.after:.2f} mm.")
    sealed = case.with_name(case.name + ".sealed")
    answer = json.loads(next(sealed.rglob("answer.json")).read_text(encoding="utf-8"))
    hidden = ", ".join(f"{e['kind']} at {e['where']}" for e in answer["effects"])
    print(f"The sealed answer: {hidden}.")
    print(f"Report: {result / 'report.html'}")


if __name__ == "__main__":
    main()
