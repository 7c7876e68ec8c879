"""The loop over time of the wide world's arm, compiled: RK4 where it rings, a linearly implicit step where damping
outweighs mass.

The implicit method is ROS2 of Verwer et al. (1999), second order for any approximation of the Jacobian and L-stable
with a good one: here ``v' = M^-1 (f - D v - K s)`` with the damping and stiffness of the bellows and of bending, so
that a step of half a millisecond serves an arm whose damping would ask an explicit method for microseconds. Its error
on a motion of time constant T is of the order of (step/T)^2.

Inputs lie on the grid of steps, linear in between. A hidden lag of the pressures is advanced here, because its time
constant follows the volume of the bellows: exact for a pressure that changes in a straight line.
"""

from typing import Any

import numpy as np

from ..hidden import MEMORY as OLD_MEMORY
from ..jit import compiled
from ..motion import evaluate
from ..plant import P_RADIUS
from .bellows import B_INPUT, B_REST, add_bellows, bellows_lengths, remember

GAMMA = 1.0 - np.sqrt(0.5)
SHORTEST, LONGEST = 0.02, 1.5
WIDEST = 3.0


@compiled
def forces(
    plant: Any,
    hidden: Any,
    work: Any,
    table: Any,
    radius: Any,
    ambient: float,
    end_force: bool,
    x: Any,
    v: Any,
    pressure: Any,
    head_force: Any,
    time: float,
    begin: Any,
    span: float,
    memory: Any,
    zeros: Any,
    scratch: Any,
) -> None:
    """Inertia matrix, velocity-product forces and all other forces into ``work`` at the state ``(x, v)``."""
    no_pressure, no_force, no_memory, sums = zeros
    lengths, speeds, stretches = scratch
    evaluate(
        plant, hidden, work, x, v, no_pressure, no_force, head_force, time,
        no_pressure, no_pressure, no_pressure, 0.0, no_memory,
    )  # fmt: skip
    bellows_lengths(table, x, lengths)
    bellows_lengths(table, v, speeds)
    for j in range(lengths.shape[0]):
        stretches[j] = lengths[j] - begin[j]
    add_bellows(
        table, radius, end_force, lengths, speeds, pressure, ambient, time, stretches, span, memory,
        work.screw, work.head, sums, work.force,
    )  # fmt: skip


@compiled
def _factor(a: Any) -> None:
    """Cholesky in the lower triangle, in place."""
    for j in range(a.shape[0]):
        total = a[j, j]
        for k in range(j):
            total -= a[j, k] * a[j, k]
        pivot = np.sqrt(total)
        a[j, j] = pivot
        for i in range(j + 1, a.shape[0]):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = total / pivot


@compiled
def _solve(a: Any, b: Any) -> None:
    """Solve with a factor of :func:`_factor`, in place."""
    d = b.shape[0]
    for i in range(d):
        total = b[i]
        for k in range(i):
            total -= a[i, k] * b[k]
        b[i] = total / a[i, i]
    for i in range(d - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, d):
            total -= a[k, i] * b[k]
        b[i] = total / a[i, i]


@compiled
def _relax(before: float, start: float, end: float, span: float, tau: float) -> float:
    """First-order lag over ``span`` under an input that runs straight from ``start`` to ``end``."""
    slope = (end - start) / span
    return float(end - slope * tau + (before - start + slope * tau) * np.exp(-span / tau))


@compiled
def advance(  # noqa: PLR0912, PLR0915 - one loop; compiled code in one piece is faster
    plant: Any,
    hidden: Any,
    work: Any,
    table: Any,
    ambient: float,
    end_force: bool,
    lag: Any,
    x: Any,
    v: Any,
    memory: Any,
    chamber: Any,
    pressures: Any,
    ripple: Any,
    force: Any,
    start: float,
    step: float,
    stride: int,
    implicit: bool,
    stiffness: Any,
    damping: Any,
    states_out: Any,
    heads_out: Any,
) -> int:
    d = x.shape[0]
    n = d // 3
    nb = table.shape[0]
    inputs = pressures.shape[1]
    steps = pressures.shape[0] - 1
    radius = plant.sections[:, P_RADIUS].copy()
    zeros = (np.zeros(d), np.zeros(3), np.zeros((d, OLD_MEMORY)), np.zeros((n, 3)))
    scratch = (np.empty(nb), np.empty(nb), np.empty(nb))
    begin = np.empty(nb)
    moved = np.empty(nb)
    speeds = np.empty(nb)
    acting = np.empty((3, inputs))
    pushes = np.zeros((3, n, 3))
    later = np.empty(inputs)
    relative = np.empty(inputs)
    share = np.empty(inputs)
    rippled = ripple.shape[0] > 0
    forced = force.shape[0] > 0
    xs, vs, a, sum_x, sum_v = np.empty(d), np.empty(d), np.empty(d), np.empty(d), np.empty(d)
    k1x, k1v, rs = np.empty(d), np.empty(d), np.empty(d)
    mass, system = np.empty((d, d)), np.empty((d, d))
    fill, vent, power = lag
    lagging = False
    for j in range(inputs):
        lagging = lagging or fill[j] > 0.0
    sample = 0
    for index in range(steps + 1):
        time = start + index * step
        now, then = index, min(index + 1, steps)
        bellows_lengths(table, x, begin)
        for j in range(nb):
            if not (SHORTEST < begin[j] < LONGEST):
                return sample
        for i in range(n):
            if x[3 * i] * x[3 * i] + x[3 * i + 1] * x[3 * i + 1] > WIDEST * WIDEST:
                return sample
        if lagging:
            relative[:] = 0.0
            share[:] = 0.0
            for j in range(nb):
                relative[int(table[j, B_INPUT])] += begin[j] / table[j, B_REST]
                share[int(table[j, B_INPUT])] += 1.0
        for j in range(inputs):
            u0, u1 = pressures[now, j], pressures[then, j]
            if fill[j] > 0.0:
                tau = fill[j] if u1 > chamber[j] else vent[j]
                tau *= (relative[j] / share[j]) ** power[j]
                middle = _relax(chamber[j], u0, 0.5 * (u0 + u1), 0.5 * step, tau)
                later[j] = _relax(chamber[j], u0, u1, step, tau)
                acting[0, j], acting[1, j], acting[2, j] = chamber[j], middle, later[j]
            else:
                acting[0, j], acting[1, j], acting[2, j] = u0, 0.5 * (u0 + u1), u1
                later[j] = u1
            if rippled:
                r0, r1 = ripple[now, j], ripple[then, j]
                acting[0, j] += r0
                acting[1, j] += 0.5 * (r0 + r1)
                acting[2, j] += r1
        if forced:
            for i in range(n):
                for k in range(3):
                    f0, f1 = force[now, 3 * i + k], force[then, 3 * i + k]
                    pushes[0, i, k], pushes[1, i, k], pushes[2, i, k] = f0, 0.5 * (f0 + f1), f1
        forces(
            plant, hidden, work, table, radius, ambient, end_force, x, v, acting[0], pushes[0], time, begin, 0.0,
            memory, zeros, scratch,
        )  # fmt: skip
        if index % stride == 0:
            for c in range(d):
                states_out[sample, c] = x[c]
            for i in range(n):
                for k in range(3):
                    heads_out[sample, i, k] = work.head[i, k]
                for k in range(9):
                    heads_out[sample, i, 3 + k] = work.head[i, 6 + k]
            sample += 1
        if index == steps:
            return sample
        if implicit:
            # Stage 1: (M + g h D + g^2 h^2 K) kv = f - g h K v.
            for c in range(d):
                k1v[c] = work.force[c] - work.bias[c]
                for k in range(d):
                    k1v[c] -= GAMMA * step * stiffness[c, k] * v[k]
                    mass[c, k] = work.matrix[c, k]
                    system[c, k] = mass[c, k] + GAMMA * step * (damping[c, k] + GAMMA * step * stiffness[c, k])
            _factor(system)
            _solve(system, k1v)
            for c in range(d):
                k1x[c] = v[c] + GAMMA * step * k1v[c]
                xs[c] = x[c] + step * k1x[c]
                vs[c] = v[c] + step * k1v[c]
            forces(
                plant, hidden, work, table, radius, ambient, end_force, xs, vs, acting[2], pushes[2], time + step,
                begin, step, memory, zeros, scratch,
            )  # fmt: skip
            for c in range(d):
                a[c] = work.force[c] - work.bias[c]
            _factor(work.matrix)
            _solve(work.matrix, a)
            for c in range(d):
                a[c] -= 2.0 * k1v[c]
                rs[c] = vs[c] - 2.0 * k1x[c]
            for c in range(d):
                sum_v[c] = 0.0
                for k in range(d):
                    sum_v[c] += mass[c, k] * a[k] - GAMMA * step * stiffness[c, k] * rs[k]
            _solve(system, sum_v)
            for c in range(d):
                x[c] += step * (1.5 * k1x[c] + 0.5 * (rs[c] + GAMMA * step * sum_v[c]))
                v[c] += step * (1.5 * k1v[c] + 0.5 * sum_v[c])
        else:
            xs[:] = x
            vs[:] = v
            for stage in range(4):
                half = 0 if stage == 0 else (2 if stage == 3 else 1)
                if stage > 0:
                    forces(
                        plant, hidden, work, table, radius, ambient, end_force, xs, vs, acting[half], pushes[half],
                        time + 0.5 * half * step, begin, 0.5 * half * step, memory, zeros, scratch,
                    )  # fmt: skip
                for c in range(d):
                    a[c] = work.force[c] - work.bias[c]
                _factor(work.matrix)
                _solve(work.matrix, a)
                weight = 1.0 / 6.0 if half != 1 else 1.0 / 3.0
                reach = 0.5 * step if stage < 2 else step
                for c in range(d):
                    if stage == 0:
                        sum_x[c] = weight * vs[c]
                        sum_v[c] = weight * a[c]
                    else:
                        sum_x[c] += weight * vs[c]
                        sum_v[c] += weight * a[c]
                    xs[c] = x[c] + reach * vs[c]
                    vs[c] = v[c] + reach * a[c]
            for c in range(d):
                x[c] += step * sum_x[c]
                v[c] += step * sum_v[c]
        bellows_lengths(table, x, moved)
        bellows_lengths(table, v, speeds)
        for j in range(nb):
            moved[j] -= begin[j]
        remember(table, speeds, moved, step, memory)
        for j in range(inputs):
            chamber[j] = later[j]
    return sample
