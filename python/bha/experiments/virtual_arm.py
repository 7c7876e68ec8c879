"""The virtual arm that the experiments measure, with its valves and sensors.

It stands where the paper has Festo's arm, and is not the lumped model: part of every section's mass is spread along its
arc, the material creeps, the bellows differ by some per cent, chamber pressures lag behind the commanded ones, bellows
do work on their own change of length. Sensors sample every millisecond, with noise and quantisation.

Sources: (56) and thin discs for the inertias; magnitudes of creep, lag, noise and scatter are assumed, of the size that
is usual for polyamide bellows, short tubes, draw-wire and pressure sensors. Units: SI.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arm import Arm
from bha.errors import InputError
from bha.logs import Log
from bha.names import column, length_name
from bha.parameters import ForceModel
from bha.runs.input import Input
from bha.support.shown import short_repr

Array = NDArray[np.float64]

#: Sampling of the paper's measurements, s.
SAMPLING = 1e-3


@dataclass(frozen=True)
class VirtualBody:
    """In what the virtual arm differs from the lumped model.

    Attributes:
        plate_share: share of a section's mass that sits in its head plate; the rest is spread along its arc.
        slices: discs that stand for the spread mass of a section.
        creep: Maxwell branches of every bellows: share of the linear stiffness, time constant in s.
        scatter: standard deviation of the bellows' stiffness about the design's, relative.
        force_model: how its bellows act.
    """

    plate_share: float = 0.7
    slices: int = 8
    creep: Sequence[tuple[float, float]] = ((0.03, 0.2), (0.05, 4.0))
    scatter: float = 0.02
    force_model: ForceModel = "work_conjugate"


@dataclass(frozen=True)
class VirtualSensors:
    """Draw-wire and pressure sensors, and the valves. Noise is normal; values are rounded to the quantum.

    Attributes:
        length_noise: standard deviation, m.
        length_quantum: smallest step, m.
        pressure_noise: standard deviation, Pa.
        pressure_quantum: smallest step, Pa.
        pressure_lag: time constant of chamber behind commanded pressure, s.
    """

    length_noise: float = 0.2e-3
    length_quantum: float = 0.1e-3
    pressure_noise: float = 150.0
    pressure_quantum: float = 100.0
    pressure_lag: float = 0.05


@short_repr
@dataclass(frozen=True)
class Schedule:
    """What is done to the arm: pressures and forces at corner times, straight lines between them.

    Attributes:
        time: s, shape (m,), ascending; two equal times are a jump.
        pressures: commanded, Pa absolute, shape (m, inputs).
        forces: at the section heads in the base frame, N, shape (m, n, 3), or None.
    """

    time: Array
    pressures: Array
    forces: Array | None = None

    @classmethod
    def holds(cls, levels: ArrayLike, hold: float, ramp: float) -> Schedule:
        """Each row of ``levels`` (m, inputs), Pa absolute, held for ``hold`` s, with ramps of ``ramp`` s between."""
        rows = np.asarray(levels, dtype=np.float64)
        starts = np.arange(len(rows)) * (hold + ramp)
        time = np.column_stack([starts, starts + hold]).ravel()
        return cls(time, np.repeat(rows, 2, axis=0))

    @property
    def end(self) -> float:
        """Last corner, s."""
        return float(self.time[-1])


class VirtualArm:
    """The arm under measurement; its sensors' noise comes from ``seed`` and the number of the measurement."""

    def __init__(
        self, design: Arm, body: VirtualBody | None = None, sensors: VirtualSensors | None = None, *, seed: int = 2015
    ) -> None:
        """Build the arm that somebody made after the ``design``.

        Raises:
            InputError: the design has no bellows_outer_radius, or ``body`` has a value that is not allowed.
        """
        self.design = design
        self.body = body or VirtualBody()
        self.sensors = sensors or VirtualSensors()
        self.seed = seed
        if not 0.0 < self.body.plate_share <= 1.0:
            raise InputError(f"plate_share: {self.body.plate_share}; a number above 0 and not above 1 is needed")
        parameters = json.loads(design.parameters.to_core_json())
        parameters["force_model"] = self.body.force_model
        distributed = []
        scatter = np.random.default_rng([seed, 0])
        for number, (section, table) in enumerate(
            zip(design.parameters.sections, parameters["section"], strict=True), start=1
        ):
            if section.bellows_outer_radius is None:
                raise InputError(f"section {number}: bellows_outer_radius is needed for the inertia of its slices")
            radius = section.bellows_radius + section.bellows_outer_radius
            plate = self.body.plate_share * section.mass
            table["mass"] = plate
            table["inertia"] = thin_disc(plate, radius)
            spread = section.mass - plate
            distributed.append((self.body.slices if spread else 0, spread, thin_disc(spread, radius)))
            for bellows in table["bellows"]:
                factor = 1.0 + self.body.scatter * scatter.standard_normal()
                bellows["stiffness"] = [factor * k for k in bellows["stiffness"]]
        self._core = _core.VirtualArm(json.dumps(parameters), distributed, list(self.body.creep))

    def measure(self, schedule: Schedule, *, number: int, step: float = 5e-4) -> Log:
        """Do what ``schedule`` says, starting from rest, and record pressures and lengths every millisecond.

        Args:
            schedule: commanded pressures and forces; neither is in the log.
            number: of the measurement; the noise of its sensors follows from it and the arm's seed.
            step: of the integration, s.
        """
        time = SAMPLING * np.arange(round(schedule.end / SAMPLING) + 1, dtype=np.float64)
        pressures = self.chamber_pressures(schedule, time)
        forces = None
        if schedule.forces is not None:
            flat = schedule.forces.reshape(len(schedule.time), -1)
            forces = np.column_stack([np.interp(time, schedule.time, values) for values in flat.T])
        start = self._core.rest(pressures[0], None if forces is None else forces[0].reshape(-1, 3))
        still, relaxed = np.zeros_like(start), np.zeros(self._core.creep_states)
        run = self._core.run(Input(time, pressures, forces).in_core(), time, start, still, relaxed, step)
        return self.read_sensors(time, pressures, run.lengths, number)

    def chamber_pressures(self, schedule: Schedule, time: Array) -> Array:
        """Pressures in the bellows: first-order lag behind the commanded ones, Pa absolute, shape (m, inputs)."""
        commanded = np.column_stack([np.interp(time, schedule.time, values) for values in schedule.pressures.T])
        out = np.empty_like(commanded)
        out[0] = commanded[0]
        keep = float(np.exp(-SAMPLING / self.sensors.pressure_lag))
        for k in range(1, len(time)):
            middle = 0.5 * (commanded[k - 1] + commanded[k])
            out[k] = middle + keep * (out[k - 1] - middle)
        return out

    def read_sensors(self, time: Array, pressures: Array, lengths: Array, number: int) -> Log:
        """What the sensors say of true pressures (m, inputs) and lengths (m, 3n)."""
        noise = np.random.default_rng([self.seed, 1, number])
        s = self.sensors
        columns: dict[str, ArrayLike] = {column("t", "s"): time}
        for name, values in zip(self.design.inputs, pressures.T, strict=True):
            columns[column(name, "Pa")] = _sensed(values, s.pressure_noise, s.pressure_quantum, noise)
        for k, values in enumerate(lengths.T):
            name = length_name(k // 3 + 1, k % 3 + 1)
            columns[column(name, "m")] = _sensed(values, s.length_noise, s.length_quantum, noise)
        return Log.from_arrays(columns, ambient_pressure=self.design.parameters.ambient_pressure)


def thin_disc(mass: float, radius: float) -> tuple[float, float, float]:
    """Moments of inertia of a thin disc about its centre, (Jx, Jy, Jz), kg m^2."""
    lateral = mass * radius**2 / 4
    return (lateral, lateral, 2 * lateral)


def _sensed(values: Array, noise: float, quantum: float, random: np.random.Generator) -> Array:
    return np.asarray(np.round((values + noise * random.standard_normal(len(values))) / quantum) * quantum)
