"""Runs of the wide world's arm: what moves, what drives it, its state, rest under constant pressures, and simulation.

The loop itself is compiled: :mod:`.stepping`. Which of its two methods serves an arm is chosen once, from its rates at
the straight arm.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..hidden import MEMORY as OLD_MEMORY
from ..hidden import Hidden
from ..plant import P_BENDING, Plant, make_work
from .bellows import (
    B_BRISTLE,
    B_CREEP,
    B_DAMPING,
    B_INPUT,
    B_ONE_SIDED,
    B_REST,
    B_SECTION,
    B_SLIP,
    B_STIFFNESS,
    B_X,
    B_Y,
    BRANCHES,
    MEMORY,
    SLIP_YIELDS,
    bellows_lengths,
)
from .stepping import advance, forces

Array = NDArray[np.float64]

STEP = 5e-4
HEAD_COLUMNS = 12  # position, rotation by rows
# RK4 is stable up to 2.78 on the negative axis; above this share of it the implicit method is taken.
EXPLICIT_LIMIT = 1.6


class Arm(NamedTuple):
    """What moves: mechanics without bellows, hidden mechanics, the bellows, and the force model."""

    plant: Plant
    hidden: Hidden
    table: Array  # (bellows, B_COLUMNS)
    ambient: float
    end_force: bool

    def copy(self) -> "Arm":
        """An independent copy."""
        return self._replace(plant=self.plant.copy(), hidden=self.hidden.copy(), table=self.table.copy())


class Lag(NamedTuple):
    """Hidden lag of every input: time constants for filling and venting, power of the relative length in them."""

    fill: Array
    vent: Array
    power: Array


def no_lag(inputs: int) -> Lag:
    """No lag at any input."""
    return Lag(np.zeros(inputs), np.zeros(inputs), np.zeros(inputs))


@dataclass
class State:
    """State of the arm: coordinates ``(u, v, l)``, their rates, hidden states, lagging pressures, and the time."""

    coordinates: Array
    rates: Array
    memory: Array
    chamber: Array
    time: float = 0.0

    def copy(self) -> "State":
        """An independent copy."""
        return State(
            self.coordinates.copy(), self.rates.copy(), self.memory.copy(), self.chamber.copy(), float(self.time)
        )


@dataclass
class Drive:
    """What drives a run, on the grid of steps: pressures before the hidden lag, pressures added behind it (unlogged),
    forces at the heads in their frames (unlogged).
    """

    pressure: Array  # (rows, inputs)
    ripple: Array | None = None  # (rows, inputs)
    force: Array | None = None  # (rows, 3 n)
    step: float = field(default=STEP)

    def part(self, first: int, last: int) -> "Drive":
        """Rows ``first`` to ``last``, both included."""
        rows = slice(first, last + 1)
        return Drive(
            self.pressure[rows],
            None if self.ripple is None else self.ripple[rows],
            None if self.force is None else self.force[rows],
            self.step,
        )

    def coarse(self, factor: int) -> "Drive":
        """The same with a step ``factor`` times longer; its last rows may be lost."""
        rows = slice(None, None, factor)
        return Drive(
            self.pressure[rows],
            None if self.ripple is None else self.ripple[rows],
            None if self.force is None else self.force[rows],
            self.step * factor,
        )


class DivergedError(RuntimeError):
    """The true arm left the range of poses that make sense, or finds no rest."""


def linear_parts(arm: Arm) -> tuple[Array, Array]:
    """Stiffness and damping matrices of bellows, hidden forms and bending at rest lengths, on ``(u, v, l)``."""
    d = 3 * arm.plant.sections.shape[0]
    stiffness, damping = np.zeros((d, d)), np.zeros((d, d))
    for b in arm.table:
        c = 3 * int(b[B_SECTION])
        along = np.zeros(d)
        along[c : c + 3] = -b[B_X], -b[B_Y], 1.0
        k, loss = b[B_STIFFNESS], b[B_DAMPING] + 0.5 * b[B_ONE_SIDED]
        k += np.sum(b[B_CREEP : B_CREEP + BRANCHES])
        if b[B_SLIP]:
            k += b[B_SLIP] / b[B_SLIP + 1] * float(np.mean(1.0 / SLIP_YIELDS))
        if b[B_BRISTLE]:
            k += b[B_BRISTLE] / b[B_BRISTLE + 3]
        stiffness += k * np.outer(along, along)
        damping += loss * np.outer(along, along)
    for i, section in enumerate(arm.plant.sections):
        for c in (3 * i, 3 * i + 1):
            stiffness[c, c] += section[P_BENDING]
            damping[c, c] += arm.hidden.sections[i, 0]
    return stiffness, damping


class Simulator:
    """Runs of one arm; chooses its method once."""

    def __init__(self, arm: Arm, lag: Lag | None = None) -> None:
        """Linearize at the straight arm at rest lengths."""
        self.arm = arm
        self.lag = no_lag(int(arm.table[:, B_INPUT].max()) + 1) if lag is None else lag
        self.work = make_work(arm.plant.sections.shape[0])
        self.stiffness, self.damping = linear_parts(arm)
        d = self.stiffness.shape[0]
        straight = np.zeros(d)
        straight[2::3] = [
            float(np.mean(arm.table[arm.table[:, B_SECTION] == i, B_REST])) for i in range(arm.plant.sections.shape[0])
        ]
        self.straight = straight
        self._evaluate(straight, np.zeros(d), np.full(len(self.lag.fill), arm.ambient))
        mass = self.work.matrix.copy()
        self.rate = float(np.abs(np.linalg.eigvals(np.linalg.solve(mass, self.damping))).max())
        self.fastest = float(np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(mass, self.stiffness))).max()))

    def explicit(self, step: float) -> bool:
        """Whether RK4 is safe at this step."""
        return step * max(self.rate, self.fastest) < EXPLICIT_LIMIT

    def _evaluate(self, x: Array, v: Array, pressure: Array) -> Array:
        """Sum of all forces at rest in every hidden sense; leaves the inertia matrix in ``work``."""
        arm, work, d = self.arm, self.work, x.shape[0]
        begin = np.empty(arm.table.shape[0])
        bellows_lengths(arm.table, x, begin)
        nb = begin.shape[0]
        forces(
            arm.plant, arm.hidden, work, arm.table, arm.plant.radius, arm.ambient, arm.end_force, x, v, pressure,
            np.zeros((d // 3, 3)), 0.0, begin, 0.0, np.zeros((nb, MEMORY)),
            (np.zeros(d), np.zeros(3), np.zeros((d, OLD_MEMORY)), np.zeros((d // 3, 3))),
            (np.empty(nb), np.empty(nb), np.empty(nb)),
        )  # fmt: skip
        return np.asarray(work.force - work.bias)

    def rest(self, pressure: Array, time: float = 0.0) -> State:
        """State of rest under constant acting pressures, hidden states relaxed. Raises DivergedError."""
        x = self.straight.copy()
        still = np.zeros_like(x)
        scale = np.tile([1.0, 1.0, 0.1], x.shape[0] // 3)
        ambient = np.full_like(pressure, self.arm.ambient)
        for share in np.linspace(0.0, 1.0, 6):
            p = ambient + share * (pressure - ambient)
            for _ in range(60):
                force = self._evaluate(x, still, p)
                slope = np.empty((x.shape[0], x.shape[0]))
                for c in range(x.shape[0]):
                    moved = x.copy()
                    moved[c] += 1e-6 * scale[c]
                    slope[:, c] = (self._evaluate(moved, still, p) - force) / (1e-6 * scale[c])
                change = np.linalg.solve(slope, -force)
                change *= 0.3 / max(0.3, float(np.abs(change / scale).max()))
                x += change
                if float(np.abs(change / scale).max()) < 1e-9:
                    break
            else:
                raise DivergedError("the true arm finds no rest")
        return State(x, still, np.zeros((self.arm.table.shape[0], MEMORY)), pressure.copy(), time)

    def run(self, state: State, drive: Drive, stride: int = 2) -> tuple[Array, Array]:
        """Integrate over the grid of ``drive`` and move ``state`` to its end.

        Returns coordinates (samples, 3n) and heads (samples, n, 12: position, rotation by rows), every ``stride``
        steps from the first on. Raises DivergedError.
        """
        steps = (drive.pressure.shape[0] - 1) // stride * stride
        samples = steps // stride + 1
        n = self.arm.plant.sections.shape[0]
        states, heads = np.empty((samples, 3 * n)), np.empty((samples, n, HEAD_COLUMNS))
        nothing = np.zeros((0, 1))
        arm = self.arm
        done = advance(
            arm.plant,
            arm.hidden,
            self.work,
            arm.table,
            arm.ambient,
            arm.end_force,
            self.lag,
            state.coordinates,
            state.rates,
            state.memory,
            state.chamber,
            np.ascontiguousarray(drive.pressure[: steps + 1]),
            nothing if drive.ripple is None else np.ascontiguousarray(drive.ripple[: steps + 1]),
            nothing if drive.force is None else np.ascontiguousarray(drive.force[: steps + 1]),
            state.time,
            drive.step,
            stride,
            not self.explicit(drive.step),
            self.stiffness,
            self.damping,
            states,
            heads,
        )
        state.time += steps * drive.step
        if done < samples:
            raise DivergedError(f"the true arm left the poses that make sense after {done * stride * drive.step:.3f} s")
        return states, heads
