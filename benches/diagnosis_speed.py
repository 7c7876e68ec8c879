"""One diagnosis with and without the processor's lanes: ``python benches/diagnosis_speed.py``.

A case of ``benches/blind`` at full size: 60 s of training logs at 200 Hz, three sections, all candidates. Both runs see
the same logs, in one process; answers agree as far as rounding does not decide between two steps of a fit.
"""

from __future__ import annotations

import functools
import sys
import tempfile
import time
from pathlib import Path

import click

import bha
from bha import _core

sys.path.insert(0, str(Path(__file__).parent / "blind"))
from blindgen import make_case

SEED, KIND, WHERE = 7, "weak_bellows", "bellows 22"


@click.command(help=__doc__)
@click.option("--threads", default=2, show_default=True)
@click.option("--kind", default=KIND, show_default=True)
@click.option("--where", default=WHERE, show_default=True)
def main(threads: int, kind: str, where: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "case"
        make_case(SEED, kind, where, 1.0, "standard", case)
        arm = bha.Arm.load(case / "arm.toml")
        train = [bha.Log.read(case / f"train_{name}.csv") for name in ("steps", "multisine", "release")]
        held = [bha.Log.read(case / f"holdout_{k}.csv") for k in (1, 2)]
    simulate_batch = _core.simulate_batch
    widest = _core.instruction_sets()[-1]
    seconds = {}
    for instruction_set in (widest, "scalar"):
        _core.simulate_batch = functools.partial(simulate_batch, instruction_set=instruction_set)
        begin = time.perf_counter()
        found = bha.diagnose(arm, train, held, threads=threads)
        seconds[instruction_set] = time.perf_counter() - begin
        names = ", ".join(f"{e.kind} at {e.where}" for e in found.effects) or found.verdict
        print(f"{instruction_set}: {seconds[instruction_set]:.1f} s, {names}", flush=True)
    print(f"ratio {seconds['scalar'] / seconds[widest]:.2f}, {threads} threads")


if __name__ == "__main__":
    main()
