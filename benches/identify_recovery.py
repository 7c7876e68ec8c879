"""Does identification find what is there, and does it know how well? Repeats on synthetic logs with realistic noise.

Every repeat draws other pressures, another start (15 % off in every parameter) and other noise, fits, and looks whether
the true values lie within the 95 % intervals. Wanted: 90 to 99 % of them for parameters that are well known (standard
error below 5 %), and a mean error below 1 %.

    python -m benches.identify_recovery --repeats 100
    python -m benches.identify_recovery --slow-log
    python -m benches.identify_recovery --speed
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import bha
from bha.identification import Settings, default_free, excite, identify, record, refine
from bha.logs import Log
from bha.names import length_name
from bha.parameters import ArmParameters, paths

Array = NDArray[np.float64]

NOISE = 3e-4  # of the draw wires, m
QUANTUM = 1e-4  # of the draw wires, m
PRESSURE_NOISE = 150.0  # Pa


@dataclass(frozen=True)
class Case:
    """An arm, and how its logs are made."""

    arm: bha.Arm
    duration: float
    rate: float
    pressure_noise: float = PRESSURE_NOISE


def arm_of(sections: int) -> bha.Arm:
    """The first sections of the nominal arm."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    mapping["section"] = mapping["section"][:sections]
    return bha.Arm(ArmParameters.from_mapping(mapping))


def synthetic_log(case: Case, seed: int) -> Log:
    """A log of the simulated arm: proposed excitation, draw-wire noise and quantisation, pressure noise."""
    proposal = excite(case.arm, duration=case.duration, rate=case.rate, seed=seed, free=["section.1.mass"])
    drive = bha.Input(proposal.time, proposal.pressures)
    return noisy_log(case.arm, drive, seed, case.pressure_noise)


def noisy_log(arm: bha.Arm, drive: bha.Input, seed: int, pressure_noise: float = PRESSURE_NOISE) -> Log:
    """What is measured of the simulated arm."""
    run = bha.simulate(arm, drive, times=drive.time, method="rk4", step=1e-3)
    random = np.random.default_rng([7, seed])
    columns: dict[str, Array] = {"t [s]": drive.time}
    for name, p in zip(arm.inputs, drive.pressures.T, strict=True):
        columns[f"{name} [Pa]"] = p + pressure_noise * random.standard_normal(len(p))
    for k, lengths in enumerate(run.lengths.T):
        noisy = lengths + NOISE * random.standard_normal(len(lengths))
        columns[f"{length_name(k // 3 + 1, k % 3 + 1)} [m]"] = QUANTUM * np.round(noisy / QUANTUM)
    return Log.from_arrays(columns)


def start_of(arm: bha.Arm, free: tuple[str, ...], seed: int) -> bha.Arm:
    """The arm with every free parameter 15 % off, standard deviation."""
    factors = np.exp(0.15 * np.random.default_rng([8, seed]).standard_normal(len(free)))
    values = {p: f * paths.get_value(arm.parameters, p) for p, f in zip(free, factors, strict=True)}
    return bha.Arm(paths.with_values(arm.parameters, values))


def recover(case: Case, repeats: int, settings: Settings) -> None:
    """Print coverage and bias of every parameter."""
    free = default_free(case.arm.parameters)
    true = np.array([paths.get_value(case.arm.parameters, p) for p in free])
    values, inside, errors, converged = [], [], [], 0
    began = time.perf_counter()
    for seed in range(repeats):
        start = start_of(case.arm, free, seed)
        fit = refine(start, [record(start, synthetic_log(case, seed))], free, settings)
        converged += fit.outcome.converged
        values.append(fit.values)
        errors.append(fit.standard_errors)
        inside.append((fit.intervals[:, 0] <= true) & (true <= fit.intervals[:, 1]))
    print(f"{repeats} repeats, {converged} converged, {(time.perf_counter() - began) / repeats:.1f} s each")
    print(f"{'parameter':32s} {'true':>10s} {'std.error %':>12s} {'bias %':>8s} {'+-':>6s} {'in 95 %':>8s}")
    relative = np.array(values) / true - 1.0
    for k, path in enumerate(free):
        spread = 100 * relative[:, k].std(ddof=1) / np.sqrt(repeats) if repeats > 1 else float("nan")
        known = 100 * np.median(np.array(errors)[:, k]) / true[k]
        covered = 100 * np.mean(np.array(inside)[:, k])
        print(
            f"{path:32s} {true[k]:10.4g} {known:12.2f} {100 * relative[:, k].mean():8.2f} {spread:6.2f} {covered:8.0f}"
        )
    print(f"all parameters together: {100 * np.mean(inside):.1f} % of intervals hold the true value")


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
    result = identify(start, [noisy_log(arm, drive, 1)], free, settings=Settings(threads=1))
    for e in result.estimates:
        true = paths.get_value(arm.parameters, e.path)
        told = "told" if e.identified else "not told"
        print(f"{e.name:32s} true {true:9.4g} estimate {e.value:9.4g} +- {e.standard_error:8.2g}  {told}")
    for combination in result.unknown:
        print(f"not identified: {combination.text}")


def speed() -> None:
    """Time the identification of 20 parameters from 60 s at 200 Hz, with the nominal arm."""
    case = Case(arm_of(3), 60.0, 200.0)
    free = (*default_free(case.arm.parameters), "section.1.rest_length", "section.2.rest_length")
    log = synthetic_log(case, 0)
    start = start_of(case.arm, free, 0)
    began, cpu_began = time.perf_counter(), time.process_time()

    def tell(text: str, done: float) -> None:
        print(f"{time.perf_counter() - began:6.1f} s {100 * done:4.0f} %  {text}")

    result = identify(start, [log], free, progress=tell)
    seconds, cpu = time.perf_counter() - began, time.process_time() - cpu_began
    state = f"converged {result.converged}, {seconds:.1f} s, {cpu:.1f} s of processor time"
    print(f"{len(free)} parameters, {len(log)} rows: {state}")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--sections", type=int, default=1)
    parser.add_argument("--duration", type=float, default=12.0)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--pressure-noise", type=float, default=PRESSURE_NOISE, help="Pa")
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
    case = Case(arm_of(arguments.sections), arguments.duration, arguments.rate, arguments.pressure_noise)
    settings = Settings(windows=(0.75, 6.0), threads=1, draws=0 if arguments.uncorrected else Settings().draws)
    recover(case, arguments.repeats, settings)


if __name__ == "__main__":
    main()
