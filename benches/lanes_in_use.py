"""Identification and diagnosis as they are, and with every simulation alone: what lanes are worth in use.

Both sides in one process, on one thread, in seconds of processor time; the results must be the same.

    python -m benches.lanes_in_use --identify
    python -m benches.lanes_in_use --diagnose
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any
from unittest.mock import patch

import bha
from bha import _core
from bha.identification import Settings, default_free, identify

from .identify_recovery.logs import Condition, arm_of, start_of, synthetic_log

BLIND = Path(__file__).parent / "blind"
SIDES = ("scalar", _core.instruction_sets()[-1])


def forced(instruction_set: str) -> Any:
    """A context in which all batches run with one instruction set."""
    simulate_batch = _core.simulate_batch

    @wraps(simulate_batch)
    def run(*arguments: Any, **options: Any) -> Any:
        return simulate_batch(*arguments, **{**options, "instruction_set": instruction_set})

    return patch.object(_core, "simulate_batch", run)


def identification() -> Callable[[], str]:
    """The parameters that are free by default, of the nominal arm, from 20 s at 200 Hz."""
    arm = arm_of(3)
    free = default_free(arm.parameters)
    log = synthetic_log(arm, Condition("lanes", rate=200.0), 0)
    start = start_of(arm, free, 0)

    def run() -> str:
        first = identify(start, [log], free, settings=Settings(threads=1)).estimates[0]
        return f"{first.path} {first.value:.9g}"

    return run


def diagnosis() -> Callable[[], str]:
    """A hidden weak bellows, with 20 s of logs for training."""
    sys.path.insert(0, str(BLIND))
    from blindgen import make_case  # noqa: PLC0415  (not part of the package)

    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "case"
        make_case(7, "weak_bellows", "bellows 22", 1.0, "standard", case, duration_factor=0.2)
        arm = bha.Arm.load(case / "arm.toml")
        train = [bha.Log.read(case / f"train_{name}.csv") for name in ("steps", "multisine", "release")]
        held = [bha.Log.read(case / f"holdout_{k}.csv") for k in (1, 2)]

    def run() -> str:
        found = bha.diagnose(arm, train, held, threads=1)
        return f"{found.verdict}, " + ", ".join(f"{e.kind} at {e.where}" for e in found.effects)

    return run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--identify", action="store_true")
    parser.add_argument("--diagnose", action="store_true")
    arguments = parser.parse_args()
    works = {"identification": identification} if arguments.identify else {}
    works |= {"diagnosis": diagnosis} if arguments.diagnose else {}
    for name, prepare in works.items():
        work = prepare()
        for side in SIDES:
            begin = time.process_time()
            with forced(side):
                result = work()
            print(f"{name}, {side}: {time.process_time() - begin:.1f} s ({result})", flush=True)


if __name__ == "__main__":
    main()
