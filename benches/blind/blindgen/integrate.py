"""The generator's integrator: RK4 at a fixed step, exact updates of hidden states, inputs on a half-step grid.

State: arc coordinates and their rates; sampled output: bellows lengths and head positions. The run stops, with the
index of the sample, when the state is no longer finite or a bellows leaves the range of lengths that make sense.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .hidden import MEMORY, Hidden, advance_memory
from .jit import compiled
from .motion import evaluate
from .plant import P_RADIUS, Plant, Work, arc_coordinates, bellows_lengths, make_work, solve_acceleration

Array = NDArray[np.float64]

STEP = 2.5e-4
SHORTEST, LONGEST = 0.02, 0.50


@compiled
def _run(  # noqa: PLR0912
    plant: Plant,
    hidden: Hidden,
    work: Work,
    coordinates: Any,
    rates: Any,
    memory: Any,
    pressures: Any,
    forces: Any,
    start: float,
    step: float,
    steps: int,
    stride: int,
    settle_rate: float,
    lengths_out: Any,
    heads_out: Any,
    rates_out: Any,
) -> int:
    d = coordinates.shape[0]
    n = d // 3
    x = np.empty(d)
    v = np.empty(d)
    a = np.empty(d)
    sum_x = np.empty(d)
    sum_v = np.empty(d)
    lengths = np.empty(d)
    length_rates = np.empty(d)
    begin = np.empty(d)
    stretch = np.zeros(d)
    no_head_force = np.zeros((n, 3))
    radius = plant.sections[:, P_RADIUS].copy()
    hidden_bellows = hidden.bellows
    head = work.head
    sample = 0
    for index in range(steps + 1):
        bellows_lengths(radius, coordinates, begin)
        for c in range(d):
            if not (SHORTEST < begin[c] < LONGEST):
                return sample
        x[:] = coordinates
        v[:] = rates
        for stage in range(4):
            half = 0 if stage == 0 else (2 if stage == 3 else 1)
            weight = 1.0 / 6.0 if half != 1 else 1.0 / 3.0
            bellows_lengths(radius, x, lengths)
            bellows_lengths(radius, v, length_rates)
            for c in range(d):
                stretch[c] = lengths[c] - begin[c]
            row = min(2 * index + half, pressures.shape[0] - 1)
            evaluate(
                plant,
                hidden,
                work,
                x,
                v,
                pressures[row],
                forces[row],
                no_head_force,
                start + (index + 0.5 * half) * step,
                lengths,
                length_rates,
                stretch,
                0.5 * half * step,
                memory,
            )
            if stage == 0 and index % stride == 0:
                for c in range(d):
                    lengths_out[sample, c] = begin[c]
                    rates_out[sample, c] = length_rates[c]
                for i in range(n):
                    for k in range(3):
                        heads_out[sample, 3 * i + k] = head[i, k]
                sample += 1
                if index == steps:
                    return sample
            solve_acceleration(work, settle_rate, v, a)
            if stage == 0:
                for c in range(d):
                    sum_x[c] = weight * v[c]
                    sum_v[c] = weight * a[c]
            else:
                for c in range(d):
                    sum_x[c] += weight * v[c]
                    sum_v[c] += weight * a[c]
            reach = 0.5 * step if stage < 2 else step
            for c in range(d):
                x[c] = coordinates[c] + reach * v[c]
                v[c] = rates[c] + reach * a[c]
        for c in range(d):
            coordinates[c] += step * sum_x[c]
            rates[c] += step * sum_v[c]
        bellows_lengths(radius, coordinates, lengths)
        bellows_lengths(radius, rates, length_rates)
        for c in range(d):
            stretch[c] = lengths[c] - begin[c]
        advance_memory(hidden_bellows, length_rates, stretch, step, memory)
    return sample


class DivergedError(RuntimeError):
    """The true arm left the range of lengths that make sense."""


class State:
    """State of the true arm: arc coordinates, their rates, hidden states, and the time."""

    def __init__(self, coordinates: Array, rates: Array, memory: Array, time: float = 0.0) -> None:
        self.coordinates = coordinates
        self.rates = rates
        self.memory = memory
        self.time = time

    @classmethod
    def at_rest(cls, plant: Plant, lengths: Array, time: float = 0.0) -> "State":
        """State at rest at the given bellows lengths, hidden states relaxed."""
        coordinates = np.zeros(lengths.shape[0])
        arc_coordinates(plant.radius, np.asarray(lengths, dtype=np.float64), coordinates)
        return cls(coordinates, np.zeros_like(coordinates), np.zeros((lengths.shape[0], MEMORY)), time)

    def copy(self) -> "State":
        """An independent copy."""
        return State(self.coordinates.copy(), self.rates.copy(), self.memory.copy(), self.time)


def run(
    plant: Plant,
    hidden: Hidden,
    state: State,
    pressures: Array,
    forces: Array | None = None,
    *,
    step: float = STEP,
    stride: int = 20,
    settle_rate: float = 0.0,
) -> tuple[Array, Array, Array]:
    """Integrate over the half-step grid of ``pressures`` (2 steps + 1, 3n) and move ``state`` to its end.

    Returns lengths (samples, 3n), head positions (samples, 3n) and length rates (samples, 3n), every ``stride`` steps.
    Raises DivergedError when a bellows leaves 0.02 to 0.50 m.
    """
    steps = (pressures.shape[0] - 1) // 2
    d = state.coordinates.shape[0]
    samples = steps // stride + 1
    if forces is None:
        forces = np.zeros((pressures.shape[0], 3))
    # One memory layout only: another one would be compiled anew.
    pressures, forces = np.ascontiguousarray(pressures), np.ascontiguousarray(forces)
    lengths, heads, rates = np.empty((samples, d)), np.empty((samples, d)), np.empty((samples, d))
    # The last evaluation only reads out the final sample; a whole number of strides keeps it on the grid.
    steps = (samples - 1) * stride
    done = _run(
        plant,
        hidden,
        make_work(d // 3),
        state.coordinates,
        state.rates,
        state.memory,
        pressures,
        forces,
        state.time,
        step,
        steps,
        stride,
        settle_rate,
        lengths,
        heads,
        rates,
    )
    state.time += steps * step
    if done < samples:
        raise DivergedError(f"the true arm left {SHORTEST} to {LONGEST} m at {done * stride * step:.3f} s of the run")
    return lengths, heads, rates


def settle(plant: Plant, hidden: Hidden, state: State, pressure: Array, step: float = 1e-3) -> None:
    """Move ``state`` to rest under constant pressure, by 3 s of integration with strong extra damping."""
    duration = 3.0
    time = state.time
    rows = 2 * int(duration / step) + 1
    run(plant, hidden, state, np.tile(pressure, (rows, 1)), step=step, stride=rows // 2, settle_rate=15.0)
    state.rates[:] = 0.0
    state.time = time
