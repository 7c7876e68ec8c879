"""Repeats on synthetic logs: every repeat draws other pressures, another start (15 % off in every parameter) and other
noise, identifies, and looks whether the true values lie within the 95 % intervals.

    python -m benches.identify_recovery --repeats 100                     all conditions, one section, logs of 20 s
    python -m benches.identify_recovery --condition "unlogged 5 s"        one of them
    python -m benches.identify_recovery --store FILE --table              the table of what a run has written so far
    python -m benches.identify_recovery --slow-log
    python -m benches.identify_recovery --speed

A run goes on where one with the same ``--store`` ended. Seeds below 1000 are for tuning, reports begin at 1000.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import bha
from bha.identification import Settings, default_free, identify
from bha.parameters import paths

from .logs import CONDITIONS, Condition, arm_of, noisy_log, start_of, synthetic_log
from .repeats import read, run
from .table import text


def slow_log() -> None:
    """One slow log only: what it cannot tell must be said, and must not come back with a small interval.

    Pressures creep through one slow cycle, 40 s long, so that nothing moves fast enough to show masses and dampings.
    """
    arm = arm_of(1)
    free = default_free(arm.parameters)
    time_ = np.arange(0.0, 40.0, 0.05)
    wave = np.sin(2.0 * np.pi * time_[:, None] / 40.0 + np.array([0.0, 2.1, 4.2]))
    drive = bha.Input(time_, 1.2e5 + 2e4 * wave)
    start = start_of(arm, free, 1)
    log = noisy_log(arm, drive, Condition("slow"), 1)
    result = identify(start, [log], free, settings=Settings(threads=1))
    for e in result.estimates:
        true = paths.get_value(arm.parameters, e.path)
        told = "told" if e.identified else "not told"
        print(f"{e.name:32s} true {true:9.4g} estimate {e.value:9.4g} +- {e.standard_error:8.2g}  {told}")
    for combination in result.unknown:
        print(f"not identified: {combination.text}")


def speed() -> None:
    """Time the identification of 20 parameters from 60 s at 200 Hz, with the nominal arm."""
    arm = arm_of(3)
    free = (*default_free(arm.parameters), "section.1.rest_length", "section.2.rest_length")
    log = synthetic_log(arm, Condition("speed", rate=200.0, duration=60.0), 0)
    start = start_of(arm, free, 0)
    began, cpu_began = time.perf_counter(), time.process_time()

    def tell(what: str, done: float) -> None:
        print(f"{time.perf_counter() - began:6.1f} s {100 * done:4.0f} %  {what}")

    result = identify(start, [log], free, progress=tell)
    seconds, cpu = time.perf_counter() - began, time.process_time() - cpu_began
    state = f"converged {result.converged}, {seconds:.1f} s, {cpu:.1f} s of processor time"
    print(f"{len(free)} parameters, {len(log)} rows: {state}")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [condition.name for condition in CONDITIONS]
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--condition", action="append", choices=names, help="as often as wanted; all if left out")
    parser.add_argument("--store", type=Path, help="file of the repeats, one a line; a temporary one if left out")
    parser.add_argument("--table", action="store_true", help="only the table of the store")
    parser.add_argument("--sections", type=int, default=1)
    parser.add_argument("--logs", type=int, default=1, help="logs an identification")
    parser.add_argument("--duration", type=float, help="of a log, s")
    parser.add_argument("--pressure-noise", type=float, help="Pa")
    parser.add_argument("--uncorrected", action="store_true", help="leave in what pressure noise does to the estimates")
    parser.add_argument("--speed", action="store_true", help="time the large identification instead")
    parser.add_argument("--slow-log", action="store_true", help="one slow log, which tells little")
    arguments = parser.parse_args()
    if arguments.slow_log:
        slow_log()
        return
    if arguments.speed:
        speed()
        return
    changed = {"duration": arguments.duration, "pressure_noise": arguments.pressure_noise}
    changed = {key: value for key, value in changed.items() if value is not None}
    chosen = [replace(c, **changed) for c in CONDITIONS if c.name in (arguments.condition or names)]
    store = arguments.store or Path(tempfile.mkdtemp()) / "repeats.jsonl"
    if not arguments.table:
        seeds = range(arguments.first_seed, arguments.first_seed + arguments.repeats)
        draws = 0 if arguments.uncorrected else None
        run(store, chosen, seeds, sections=arguments.sections, logs=arguments.logs, draws=draws)
    print(text(read(store)))


if __name__ == "__main__":
    main()
