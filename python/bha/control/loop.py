"""Closed loops: a plant, its sensors, and a controller whose model need not be the plant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.control.controller import Controller
from bha.control.limits import Limits
from bha.control.reference import Reference
from bha.control.stepper import Stepper
from bha.errors import InputError, SimulationError
from bha.runs.trajectory import Trajectory
from bha.support.shown import short_repr

if TYPE_CHECKING:
    from bha.arm import Arm

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Sensors:
    """What the sensors add to the truth: white noise, drawn from a seed.

    Attributes:
        length_noise: standard deviation of measured lengths, m.
        pressure_noise: standard deviation of measured pressures, Pa.
        seed: of the noise; the same seed gives the same run.
    """

    length_noise: float = 0.0
    pressure_noise: float = 0.0
    seed: int = 0


@short_repr
@dataclass(frozen=True, eq=False)
class ClosedLoopRun:
    """A closed loop's record, a row a period (every ``decimation`` periods) at the moment of measurement.

    Attributes:
        trajectory: the plant's true states; its pressures are the acting ones.
        commands: commanded pressures from that moment on, Pa absolute, shape (m, inputs).
        estimated_velocities: the observer's, m/s, shape (m, 3n); NaN where the controller has none.
        at_limit: -1, 0 or 1: the input is at its lowest, between, at its highest, shape (m, inputs).
        reference: what was to be followed.
        reference_heads: heads of the reference's lengths by the plant's kinematics, m, shape (m, n, 3).
        decimation: periods between two rows.
    """

    trajectory: Trajectory
    commands: Floats
    estimated_velocities: Floats
    at_limit: NDArray[np.int8]
    reference: Reference
    reference_heads: Floats = field(repr=False)
    decimation: int = 1

    @property
    def length_error(self) -> Floats:
        """Lengths minus those of the reference, m, shape (m, 3n)."""
        return self.trajectory.lengths - self.reference.lengths[:: self.decimation][: len(self.trajectory)]

    @property
    def tip_error(self) -> Floats:
        """Distance of the tip from that of the reference, m, shape (m,)."""
        off = self.trajectory.head_positions[:, -1] - self.reference_heads[:, -1]
        return np.asarray(np.linalg.norm(off, axis=1))

    def rms_tip_error(self, start: float = 0.0) -> float:
        """Root mean square of :attr:`tip_error` from ``start`` s on, m."""
        rows = self.trajectory.time >= start
        return float(np.sqrt(np.mean(self.tip_error[rows] ** 2)))

    def saturation(self) -> dict[str, float]:
        """Part of the time that each input spent at a limit, by name; inputs that never did are left out."""
        share = np.mean(self.at_limit != 0, axis=0) if len(self.at_limit) else np.zeros(self.at_limit.shape[1])
        pairs = zip(self.trajectory.input_names, share, strict=True)
        return {name: float(part) for name, part in pairs if part > 0}


def simulate_closed_loop(
    plant: Arm,
    controller: Controller | Callable[[float, Floats], ArrayLike],
    reference: Reference,
    *,
    sensors: Sensors | None = None,
    q0: ArrayLike | None = None,
    p0: ArrayLike | None = None,
    step: float | None = None,
    decimation: int = 1,
) -> ClosedLoopRun:
    """Let a controller lead a plant along a reference.

    In each period the lengths and acting pressures are measured, the controller is asked, and its pressures are held as
    commands to the plant's pneumatics until the next. Gains that a controller chooses by itself are those for the
    reference's period.

    Args:
        plant: the arm that moves, with its pneumatics.
        controller: one of this module, or any ``controller(t, y) -> p``: time, s, measured lengths (m) then pressures
            (Pa) in one array (3n + inputs,), to commanded pressures (inputs,), Pa absolute. An exception in it comes
            back as it is.
        reference: where the arm should be; its period is the control period.
        sensors: noise; none if None.
        q0: initial lengths (3n,), m; None: at rest under ``p0``.
        p0: initial pressures (inputs,), Pa absolute; None: those under which the plant rests nearest to the reference's
            first lengths.
        step: longest step of the integration inside a period, s; None: 1 ms. A stiff plant is stepped as
            :class:`Stepper` chooses.
        decimation: periods between two rows of the record.

    Returns:
        The record.

    Raises:
        InputError: shapes that do not fit together, or pressures that are not finite.
        ConvergenceError: no rest to start from.
        SimulationError: the plant diverged, or an estimate or a command was no longer finite: the text names the
            controller and the cause, and ``error.trajectory`` holds the rows until then.
    """
    sensors = sensors or Sensors()
    coordinates, given = 3 * plant.section_count, reference.lengths.shape[1]
    if given != coordinates:
        raise InputError(f"reference: has {given} lengths, the plant {plant.name} has {coordinates}")
    if decimation < 1:
        raise InputError(f"decimation: {decimation}; at least 1 is needed")
    stepper = Stepper(plant, step)
    if p0 is None:
        rest = Limits.of(plant).rest_near(plant, reference.lengths[0])
        p0, q0 = rest.pressures, rest.lengths if q0 is None else q0
    stepper.reset(p0, q0)
    found = _core.closed_loop(
        stepper,
        controller.build(reference.period) if isinstance(controller, Controller) else controller,
        reference.rows(),
        reference.period,
        length_noise=sensors.length_noise,
        pressure_noise=sensors.pressure_noise,
        seed=sensors.seed,
        decimation=decimation,
    )
    rows, failure = len(found.lengths), found.failure
    wanted = reference.lengths[::decimation][:rows]
    run = ClosedLoopRun(
        trajectory=Trajectory(
            time=reference.time[::decimation][:rows],
            lengths=found.lengths,
            velocities=found.velocities,
            pressures=found.pressures,
            head_positions=found.head_positions.reshape(rows, plant.section_count, 3),
            input_names=plant.inputs,
            arm_name=plant.name,
            virtual_lengths=not plant.parameters.has_standard_bellows,
        ),
        commands=found.commands,
        estimated_velocities=found.estimated_velocities,
        at_limit=found.at_limit,
        reference=reference,
        reference_heads=_heads(plant, wanted),
        decimation=decimation,
    )
    if failure is not None:
        name = type(controller).__name__ if isinstance(controller, Controller) else "controller"
        time = failure.time if isinstance(failure, SimulationError) else float(rows * decimation * reference.period)
        raise SimulationError(f"{name}: {failure}", time, run.trajectory) from failure
    return run


def _heads(arm: Arm, lengths: Floats) -> Floats:
    """Heads of each row of lengths, shape (m, n, 3); rows that repeat are computed once."""
    heads = np.empty((len(lengths), arm.section_count, 3))
    for k, row in enumerate(lengths):
        same = k > 0 and np.array_equal(row, lengths[k - 1])
        heads[k] = heads[k - 1] if same else arm.forward_kinematics(row)[0]
    return heads
