"""Bellows of the wide world, anywhere in a section and any number of them, and the hidden forms along them.

What: the forces of all bellows added to the generalized forces that :func:`blindgen.motion.evaluate` fills. A bellows
at ``(x, y)`` of its section has the length ``l - x u - y v``. Sign: a force is positive when it pushes the ends apart;
hidden forms resist lengthening and are subtracted. Forms: springs with an optional exponential hardening ``k x0
(sinh(x/x0) - x/x0)``; creep as a spectrum of three Maxwell branches; hysteresis as a density of yields (eight
elastoplastic elements); LuGre friction; a power of the speed; damping that acts in one direction only; a weak bellows
whose weakness grows with its length; an area that saturates with pressure or grows with length; a stiffness that
drifts. Force models: ``work_conjugate`` (``Q = F db/d(u, v, l)``) and ``end_force`` (the paper's: along head i's z, at
the bellows' place of head i and, with the places scaled by the ratio of the radii, back on the head below). Limits:
within one step the path of a bellows is taken as monotone, and creep as if its rate were constant.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..hidden import maxwell_branch
from ..jit import compiled
from ..plant import H_POSITION, H_ROTATION

Array = NDArray[np.float64]

# Columns of the table of bellows, first column of each group.
B_SECTION = 0
B_X = 1
B_Y = 2
B_AREA = 3
B_REST = 4
B_STIFFNESS = 5  # three coefficients of the elongation
B_DAMPING = 8
B_INPUT = 9
B_HARDENING = 10  # stiffness and length
B_CREEP = 12  # three stiffnesses, three time constants
B_SLIP = 18  # greatest force, median yield
B_BRISTLE = 20  # Coulomb force, break-away force, Stribeck speed, presliding, micro-damping
B_POWER = 25  # factor, exponent
B_WEAK = 27  # loss of stiffness, its slope per m of elongation
B_TANH = 29  # relative change of the area, pressure scale
B_SLOPE = 31  # relative change of the area per m of elongation
B_DRIFT = 32  # final relative change of stiffness, time constant
B_ONE_SIDED = 34  # damping while the bellows shortens
B_COLUMNS = 35

# Yields over their median: eight equal parts of a lognormal density, each by its middle quantile.
SLIP_YIELDS = np.exp(0.8 * np.array([-1.534, -0.887, -0.489, -0.157, 0.157, 0.489, 0.887, 1.534]))
BRANCHES = 3
CREEP, SLIP, BRISTLE, MEMORY = 0, 3, 11, 12


@compiled
def _friction(b: Any, speed: float, stretch: float, deflection: float) -> tuple[float, float]:
    """LuGre: bristle deflection after the path ``stretch``, and the force."""
    coulomb, presliding = b[B_BRISTLE], b[B_BRISTLE + 3]
    slow = speed / b[B_BRISTLE + 2]
    steady = presliding * (coulomb + (b[B_BRISTLE + 1] - coulomb) * np.exp(-slow * slow)) / coulomb
    after = deflection
    if stretch != 0.0:
        end = steady if stretch > 0.0 else -steady
        after = end + (deflection - end) * np.exp(-abs(stretch) / steady)
    return after, coulomb / presliding * after + b[B_BRISTLE + 4] * (speed - abs(speed) * after / steady)


@compiled
def resistance(b: Any, speed: float, stretch: float, span: float, memory: Any) -> float:
    """Hidden force of one bellows against lengthening, N; hidden states were valid ``span`` and ``stretch`` ago."""
    force = 0.0
    if b[B_CREEP] != 0.0:
        for m in range(BRANCHES):
            force += maxwell_branch(memory[CREEP + m], b[B_CREEP + m], b[B_CREEP + BRANCHES + m], stretch, span)
    if b[B_SLIP] != 0.0:
        share = b[B_SLIP] / SLIP_YIELDS.shape[0]
        for m in range(SLIP_YIELDS.shape[0]):
            limit = SLIP_YIELDS[m] * b[B_SLIP + 1]
            force += share * min(max(memory[SLIP + m] + stretch, -limit), limit) / limit
    if b[B_BRISTLE] != 0.0:
        force += _friction(b, speed, stretch, memory[BRISTLE])[1]
    if b[B_POWER] != 0.0:
        force += np.sign(speed) * b[B_POWER] * abs(speed) ** b[B_POWER + 1]
    if b[B_ONE_SIDED] != 0.0 and speed < 0.0:
        force += b[B_ONE_SIDED] * speed
    return force


@compiled
def remember(table: Any, speeds: Any, stretches: Any, span: float, memory: Any) -> None:
    """Carry the hidden states of all bellows over a full step."""
    for j in range(table.shape[0]):
        b = table[j]
        if b[B_CREEP] != 0.0:
            for m in range(BRANCHES):
                memory[j, CREEP + m] = maxwell_branch(
                    memory[j, CREEP + m], b[B_CREEP + m], b[B_CREEP + BRANCHES + m], stretches[j], span
                )
        if b[B_SLIP] != 0.0:
            for m in range(SLIP_YIELDS.shape[0]):
                limit = SLIP_YIELDS[m] * b[B_SLIP + 1]
                memory[j, SLIP + m] = min(max(memory[j, SLIP + m] + stretches[j], -limit), limit)
        if b[B_BRISTLE] != 0.0:
            memory[j, BRISTLE] = _friction(b, speeds[j], stretches[j], memory[j, BRISTLE])[0]


@compiled
def bellows_force(b: Any, length: float, speed: float, gauge: float, time: float) -> float:
    """Pressure, spring and damping of one bellows, N, without the hidden forms that have a memory."""
    x = length - b[B_REST]
    spring = x * (b[B_STIFFNESS] + x * (b[B_STIFFNESS + 1] + x * b[B_STIFFNESS + 2]))
    if b[B_HARDENING] != 0.0:
        x0 = b[B_HARDENING + 1]
        spring += b[B_HARDENING] * x0 * (np.sinh(x / x0) - x / x0)
    factor = 1.0 - b[B_WEAK] * (1.0 + b[B_WEAK + 1] * x)
    if b[B_DRIFT] != 0.0:
        factor += b[B_DRIFT] * (1.0 - np.exp(-time / b[B_DRIFT + 1]))
    area = 1.0 + b[B_SLOPE] * x
    if b[B_TANH] != 0.0:
        area += b[B_TANH] * np.tanh(gauge / b[B_TANH + 1])
    return float(b[B_AREA] * area * gauge - factor * spring - b[B_DAMPING] * speed)


@compiled
def bellows_lengths(table: Any, coordinates: Any, out: Any) -> None:
    """``l - x u - y v`` of every bellows; of rates the rates."""
    for j in range(table.shape[0]):
        c = 3 * int(table[j, B_SECTION])
        out[j] = coordinates[c + 2] - table[j, B_X] * coordinates[c] - table[j, B_Y] * coordinates[c + 1]


@compiled
def _add_wrench(screw: Any, columns: int, head: Any, torque_x: float, torque_y: float, along: float, out: Any) -> None:
    """Virtual work of a torque about a head's x and y and a force along its z, on the coordinates below it."""
    p, r = H_POSITION, H_ROTATION
    x, y, z = head[p], head[p + 1], head[p + 2]
    fx, fy, fz = along * head[r + 2], along * head[r + 5], along * head[r + 8]
    tx = torque_x * head[r] + torque_y * head[r + 1]
    ty = torque_x * head[r + 3] + torque_y * head[r + 4]
    tz = torque_x * head[r + 6] + torque_y * head[r + 7]
    for c in range(columns):
        out[c] += fx * (screw[c, 0] + screw[c, 4] * z - screw[c, 5] * y)
        out[c] += fy * (screw[c, 1] + screw[c, 5] * x - screw[c, 3] * z)
        out[c] += fz * (screw[c, 2] + screw[c, 3] * y - screw[c, 4] * x)
        out[c] += screw[c, 3] * tx + screw[c, 4] * ty + screw[c, 5] * tz


@compiled
def add_bellows(
    table: Any,
    radius: Any,
    end_force: bool,
    lengths: Any,
    speeds: Any,
    pressures: Any,
    ambient: float,
    time: float,
    stretches: Any,
    span: float,
    memory: Any,
    screw: Any,
    heads: Any,
    sums: Any,
    out: Any,
) -> None:
    """Add the forces of all bellows to the generalized force ``out``.

    ``pressures`` are absolute, one an input; ``sums`` (sections, 3) is scratch; ``screw`` and ``heads`` are those that
    the equations of motion left at this state.
    """
    sums[:, :] = 0.0
    for j in range(table.shape[0]):
        b = table[j]
        gauge = pressures[int(b[B_INPUT])] - ambient
        force = bellows_force(b, lengths[j], speeds[j], gauge, time)
        force -= resistance(b, speeds[j], stretches[j], span, memory[j])
        i = int(b[B_SECTION])
        sums[i, 0] += b[B_X] * force
        sums[i, 1] += b[B_Y] * force
        sums[i, 2] += force
    for i in range(sums.shape[0]):
        if end_force:
            _add_wrench(screw, 3 * i + 3, heads[i], sums[i, 1], -sums[i, 0], sums[i, 2], out)
            if i > 0:
                back = -radius[i - 1] / radius[i]
                _add_wrench(screw, 3 * i, heads[i - 1], back * sums[i, 1], -back * sums[i, 0], -sums[i, 2], out)
        else:
            out[3 * i] -= sums[i, 0]
            out[3 * i + 1] -= sums[i, 1]
            out[3 * i + 2] += sums[i, 2]
