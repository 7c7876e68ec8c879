"""The true arm as a whole: plant, hidden physics, pressure path and length sensors; and one log from it.

The pressure path turns the logged chamber pressure into the one that acts: sensor error taken off, dead time, dead
band, lag. Sensor errors are defined by the reading: ``reading = ambient + (1 + gain)(p - ambient) + offset``;
likewise for the lengths ``reading = (1 + gain) q + offset``. The lag is two first-order stages in a row (80 and 20 %
of the time constant), with one time constant for filling and another for venting; the dead band is a play operator.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .hidden import Hidden, no_hidden
from .integrate import STEP, State, run, settle
from .jit import compiled
from .plant import Plant

Array = NDArray[np.float64]

SAMPLE_TIME = 5e-3
LAG_SHARE = 0.8


@dataclass
class PressurePath:
    """Hidden effects between the logged pressure and the acting one; arrays over inputs."""

    gain: Array
    offset: Array
    delay: Array
    band: Array
    tau_fill: Array
    tau_vent: Array


@dataclass
class LengthSensors:
    """Hidden errors of the length sensors; arrays over bellows, one common delay."""

    gain: Array
    offset: Array
    delay: float = 0.0


@dataclass
class Truth:
    """Everything that produces a log, noise aside."""

    plant: Plant
    hidden: Hidden
    path: PressurePath
    sensors: LengthSensors

    def copy(self) -> "Truth":
        """An independent copy, to install an effect in."""
        path = PressurePath(*(x.copy() for x in vars(self.path).values()))
        sensors = LengthSensors(self.sensors.gain.copy(), self.sensors.offset.copy(), self.sensors.delay)
        return Truth(self.plant.copy(), self.hidden.copy(), path, sensors)


def plain_truth(plant: Plant, gravity: Array) -> Truth:
    """The arm without any hidden effect."""
    n = plant.sections.shape[0]
    d = 3 * n
    return Truth(
        plant,
        no_hidden(n, gravity),
        PressurePath(*(np.zeros(d) for _ in range(6))),
        LengthSensors(np.zeros(d), np.zeros(d)),
    )


@compiled
def _band_and_lag(pressure: Any, band: float, tau_fill: float, tau_vent: float, dt: float) -> None:
    """Play of half-width ``band``, then the two-stage lag, in place."""
    x = pressure[0]
    first = pressure[0]
    second = pressure[0]
    for k in range(pressure.shape[0]):
        x = min(max(x, pressure[k] - band), pressure[k] + band)
        if tau_fill > 0.0:
            tau = tau_fill if x > first else tau_vent
            first = x + (first - x) * np.exp(-dt / (LAG_SHARE * tau))
            tau = tau_fill if first > second else tau_vent
            second = first + (second - first) * np.exp(-dt / ((1.0 - LAG_SHARE) * tau))
        else:
            second = x
        pressure[k] = second


def acting_pressure(path: PressurePath, ambient: float, logged: Array, dt: float) -> Array:
    """Pressure that acts in the bellows, from the logged one on the same grid of spacing ``dt``."""
    out = ambient + (logged - ambient - path.offset) / (1.0 + path.gain)
    for j in range(logged.shape[1]):
        if path.delay[j] > 0.0:
            times = np.arange(logged.shape[0]) * dt
            out[:, j] = np.interp(times - path.delay[j], times, out[:, j])
        if path.band[j] > 0.0 or path.tau_fill[j] > 0.0:
            column = np.ascontiguousarray(out[:, j])
            _band_and_lag(column, path.band[j], path.tau_fill[j], path.tau_vent[j], dt)
            out[:, j] = column
    return out


@dataclass
class Excitation:
    """Chamber pressures (absolute) and tip force on a grid of half steps of ``step``; the first ``lead`` seconds
    come before the log.
    """

    pressure: Array
    force: Array
    lead: float
    step: float = STEP

    def coarse(self, factor: int) -> "Excitation":
        """The same with a step ``factor`` times longer."""
        return Excitation(self.pressure[::factor].copy(), self.force[::factor].copy(), self.lead, self.step * factor)


@dataclass
class CleanLog:
    """Noise-free samples at 200 Hz from the log's first moment on, and the state there."""

    pressure: Array
    force: Array
    lengths: Array
    heads: Array
    rates: Array
    start: State


def simulate_log(truth: Truth, excitation: Excitation, campaign_time: float = 0.0) -> CleanLog:
    """One log: to rest at the first pressure, through the lead, then the samples. Raises DivergedError."""
    step, dt = excitation.step, 0.5 * excitation.step
    stride = round(SAMPLE_TIME / step)
    acting = acting_pressure(truth.path, truth.plant.ambient_pressure, excitation.pressure, dt)
    state = State.at_rest(truth.plant, np.full(acting.shape[1], 0.17), campaign_time - excitation.lead)
    settle(truth.plant, truth.hidden, state, acting[0], max(1e-3, step))
    state.memory[:] = 0.0
    lead = 2 * round((excitation.lead - truth.sensors.delay) / step)
    first = 2 * round(excitation.lead / step)
    if lead > 0:
        run(
            truth.plant,
            truth.hidden,
            state,
            acting[: lead + 1],
            excitation.force[: lead + 1],
            step=step,
            stride=lead // 2,
        )
    start = state.copy()
    rows = excitation.pressure.shape[0] - first
    end = lead + rows
    lengths, heads, rates = run(
        truth.plant, truth.hidden, state, acting[lead:end], excitation.force[lead:end], step=step, stride=stride
    )
    lengths = (1.0 + truth.sensors.gain) * lengths + truth.sensors.offset
    sampled = slice(first, None, 2 * stride)
    count = lengths.shape[0]
    return CleanLog(
        excitation.pressure[sampled][:count].copy(),
        excitation.force[sampled][:count].copy(),
        lengths,
        heads,
        rates,
        start,
    )


def replay(
    truth: Truth, excitation: Excitation, pressure: Array, force: Array, start: State, campaign_time: float = 0.0
) -> tuple[Array, Array]:
    """Lengths (as read) and head positions from logged samples, linear in between, from the true start: no model can do
    better.

    ``excitation`` gives the step and, before the first sample, the true pressure, so that lags and dead times start
    right.
    """
    step = excitation.step
    per = round(2 * SAMPLE_TIME / step)
    fine = np.arange((pressure.shape[0] - 1) * per + 1) / per
    grid = np.arange(pressure.shape[0])
    p = np.stack([np.interp(fine, grid, pressure[:, j]) for j in range(pressure.shape[1])], axis=1)
    f = np.stack([np.interp(fine, grid, force[:, k]) for k in range(3)], axis=1)
    first = 2 * round(excitation.lead / step)
    begin = 2 * round((excitation.lead - truth.sensors.delay) / step)
    p = np.concatenate([excitation.pressure[:first], p])
    f = np.concatenate([excitation.force[:first], f])
    state = start.copy()
    state.time = campaign_time
    end = begin + fine.shape[0]
    acting = acting_pressure(truth.path, truth.plant.ambient_pressure, p, 0.5 * step)
    lengths, heads, _ = run(
        truth.plant, truth.hidden, state, acting[begin:end], f[begin:end], step=step, stride=per // 2
    )
    return (1.0 + truth.sensors.gain) * lengths + truth.sensors.offset, heads
