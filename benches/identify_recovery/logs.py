"""Synthetic logs of an arm under everything that noise can be: each condition is one thing besides the usual.

The usual: draw wires with 0.3 mm of white noise read in steps of 0.1 mm, measured pressures with 150 Pa of white noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import bha
from bha.identification import excite
from bha.logs import Log
from bha.names import length_name
from bha.parameters import ArmParameters, paths

Array = NDArray[np.float64]

#: Step of the integrator that makes the logs, s.
STEP = 1e-3
#: Standard deviation of the logarithm by which every free parameter is off at the start.
START = 0.15


@dataclass(frozen=True)
class Condition:
    """How logs are made.

    Attributes:
        name: what the table calls it.
        rate: rows a second.
        duration: of a log, s.
        noise: of the draw wires, m.
        colour: correlation time of that noise, s; 0 for white noise.
        quantum: step of the draw wires' readings, m.
        pressure_noise: white noise of the measured pressures, Pa.
        sensor_rate: readings of the wires a second, held between; 0 for one in every row.
        unlogged: standard deviation of a pressure that acts in each chamber and is in no log, Pa.
        unlogged_time: its correlation time, s (Ornstein and Uhlenbeck).
    """

    name: str
    rate: float = 100.0
    duration: float = 20.0
    noise: float = 3e-4
    colour: float = 0.0
    quantum: float = 1e-4
    pressure_noise: float = 150.0
    sensor_rate: float = 0.0
    unlogged: float = 0.0
    unlogged_time: float = 1.0


#: What identification is judged under.
CONDITIONS = (
    Condition("sensor noise"),
    Condition("colour", colour=0.1),
    Condition("quantised", quantum=1e-3, noise=1e-4),
    Condition("10 Hz", rate=10.0),
    Condition("1000 Hz", rate=1000.0, quantum=1e-3, noise=5e-5),
    Condition("held", rate=200.0, sensor_rate=30.0),
    Condition("unlogged 0.1 s", unlogged=1500.0, unlogged_time=0.1),
    Condition("unlogged 5 s", unlogged=1500.0, unlogged_time=5.0),
)


def arm_of(sections: int) -> bha.Arm:
    """The first sections of the nominal arm."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    mapping["section"] = mapping["section"][:sections]
    return bha.Arm(ArmParameters.from_mapping(mapping))


def start_of(arm: bha.Arm, free: tuple[str, ...], seed: int) -> bha.Arm:
    """The arm with every free parameter 15 % off, standard deviation."""
    factors = np.exp(START * np.random.default_rng([8, seed]).standard_normal(len(free)))
    values = {p: f * paths.get_value(arm.parameters, p) for p, f in zip(free, factors, strict=True)}
    return bha.Arm(paths.with_values(arm.parameters, values))


def synthetic_log(arm: bha.Arm, condition: Condition, seed: int) -> Log:
    """A log of the simulated arm under a proposed excitation."""
    highest = min(3.0, 0.2 * condition.rate)
    proposal = excite(
        arm,
        duration=condition.duration,
        rate=condition.rate,
        highest_frequency=highest,
        free=["section.1.mass"],
        seed=seed,
    )
    return noisy_log(arm, bha.Input(proposal.time, proposal.pressures), condition, seed)


def noisy_log(arm: bha.Arm, drive: bha.Input, condition: Condition, seed: int) -> Log:
    """What is measured of the simulated arm."""
    random = np.random.default_rng([7, seed])
    acting = _with_unlogged(drive, condition, np.random.default_rng([9, seed]))
    run = bha.simulate(arm, acting, times=drive.time, method="rk4", step=STEP)
    columns: dict[str, Array] = {"t [s]": drive.time}
    for name, p in zip(arm.inputs, drive.pressures.T, strict=True):
        columns[f"{name} [Pa]"] = p + condition.pressure_noise * random.standard_normal(len(p))
    reading = _readings(drive.time, condition)
    for k, lengths in enumerate(run.lengths.T):
        noisy = lengths + condition.noise * _coloured(random, drive.time, condition.colour)
        read = condition.quantum * np.round(noisy / condition.quantum) if condition.quantum else noisy
        columns[f"{length_name(k // 3 + 1, k % 3 + 1)} [m]"] = read[reading]
    return Log.from_arrays(columns)


def _with_unlogged(drive: bha.Input, condition: Condition, random: np.random.Generator) -> bha.Input:
    """The pressures that act: those of ``drive`` and, at a hundred hertz at least, what no log has."""
    if not condition.unlogged:
        return drive
    interval = min(0.01, 0.1 * condition.unlogged_time, float(np.median(np.diff(drive.time))))
    time = np.arange(drive.time[0], drive.time[-1] + interval, interval)
    pressures = np.column_stack([np.interp(time, drive.time, p) for p in drive.pressures.T])
    unlogged = [_coloured(random, time, condition.unlogged_time) for _ in pressures.T]
    return bha.Input(time, pressures + condition.unlogged * np.column_stack(unlogged))


def _coloured(random: np.random.Generator, time: Array, correlation: float) -> Array:
    """A first-order process of variance one at even times; white noise for a correlation time of 0."""
    white = random.standard_normal(len(time))
    if not correlation:
        return white
    keep = float(np.exp(-(time[1] - time[0]) / correlation))
    found = white.copy()
    for k in range(1, len(found)):
        found[k] = keep * found[k - 1] + np.sqrt(1.0 - keep**2) * white[k]
    return found


def _readings(time: Array, condition: Condition) -> NDArray[np.int64]:
    """The row whose reading each row shows."""
    rows = np.arange(len(time))
    if not condition.sensor_rate:
        return rows
    number = np.floor((time - time[0]) * condition.sensor_rate + 1e-9)
    first = np.concatenate([[True], np.diff(number) > 0.0])
    return np.maximum.accumulate(np.where(first, rows, 0))
