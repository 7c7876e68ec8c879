"""Formulas of the hidden physics inside the plant: every one other than the form a diagnosis would naturally try.

What: resistances along a bellows, factors on spring and area, torques on the bending coordinates, forces at the heads.
Forms: two-branch Maxwell creep; Maxwell slip with five elements (rate-independent); LuGre friction with Stribeck curve;
damping with the power 1.7 of the speed; bending damping that grows with the bend; sinh-hardening in bending; area that
saturates with pressure as tanh; a weak bellows whose weakness depends on its length; Hertz contact with damping; hose
as spring and damper to an anchor, and air drag. Sources: Canudas de Wit et al. (1995) for LuGre, Al-Bender et al.
(2005) for Maxwell slip, Hunt and Crossley (1975) for the contact.
Signs: resistances are positive when they resist lengthening; forces at heads are in the base frame.
Hidden states are advanced exactly along the path since the last full step (return mapping), so that stiff bristles
and short relaxation times never limit the step. Limits: the path within one step of 0.25 ms is taken as monotone.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import compiled

Array = NDArray[np.float64]

SLIP_YIELD = np.array([0.2, 0.5, 1.0, 1.7, 2.6])
SLIP_SHARE = np.array([0.15, 0.25, 0.30, 0.20, 0.10])
# Memory of one bellows: two creep forces, five spring deflections, one bristle deflection.
CREEP, SLIP, BRISTLE, MEMORY = 0, 2, 7, 8
AIR_DRAG_LIMIT = 1e-12

# Columns of Hidden.bellows, first column of each group. Plain arrays, not tuples of many: numba counts references per
# array.
B_CREEP = 0  # k_a, tau_a, k_b, tau_b
B_SLIP = 4  # greatest force N, yield m
B_BRISTLE = 6  # Coulomb force, break-away force, Stribeck speed, deflection at Coulomb force, micro-damping
B_POWER = 11  # factor and exponent of the power damping
B_WEAK = 13  # loss of stiffness, its slope per m of elongation
B_AREA = 15  # tanh factor, pressure scale, slope per m of elongation
B_DRIFT = 18  # final relative change of stiffness, time constant
B_COLUMNS = 20

# Columns of Hidden.sections.
S_BENDING_DAMPING = 0  # N m s, growth with psi^2
S_BENDING_EXPONENTIAL = 2  # N m, scale of psi
S_COUPLING = 4  # spring and damping between the bends of section i and i + 1
S_CHIRAL = 6  # twist coupling u_i v_{i+1} - v_i u_{i+1}
S_PAYLOAD = 7  # mass and its place in the head frame
S_TORSION = 11  # twist per length, constant twist
S_SPLIT = 13  # share of the bend in the first half of the arc
S_PERIODIC = 14  # force, frequency, phase, direction angle
S_CONTACT = 18  # normal, offset, Hertz stiffness, damping
S_COLUMNS = 24

# Places in Hidden.whole.
W_GRAVITY = 0  # true free fall, tilt included
W_TOOL = 3  # anchor, hose stiffness, hose damping, air drag
W_PLACES = 9


class Hidden(NamedTuple):
    """Parameters of the hidden physics; all zero (split 0.5) means the plain arm."""

    bellows: Array  # (3n, B_COLUMNS)
    sections: Array  # (n, S_COLUMNS)
    whole: Array  # (W_PLACES,)

    def copy(self) -> "Hidden":
        """An independent copy."""
        return Hidden(self.bellows.copy(), self.sections.copy(), self.whole.copy())


def no_hidden(sections: int, gravity: Array) -> Hidden:
    """The plain arm."""
    hidden = Hidden(np.zeros((3 * sections, B_COLUMNS)), np.zeros((sections, S_COLUMNS)), np.zeros(W_PLACES))
    hidden.sections[:, S_SPLIT] = 0.5
    hidden.whole[:3] = gravity
    return hidden


@compiled
def maxwell_branch(force: float, stiffness: float, tau: float, stretch: float, span: float) -> float:
    """Maxwell branch after ``span``, exact for a constant rate."""
    if span <= 0.0:
        return force
    x = span / tau
    keep = np.exp(-x)
    # (1 - exp(-x)) / x without cancellation for the short spans of one step
    mean = 1.0 - x * (0.5 - x / 6.0) if x < 1e-4 else (1.0 - keep) / x
    return float(force * keep + stiffness * stretch * mean)


@compiled
def _bristle(hb: Any, j: int, speed: float, stretch: float, deflection: float) -> tuple[float, float]:
    """Bristle deflection after the path ``stretch`` and the steady deflection at this speed."""
    coulomb = hb[j, B_BRISTLE]
    slow = speed / hb[j, B_BRISTLE + 2]
    level = coulomb + (hb[j, B_BRISTLE + 1] - coulomb) * np.exp(-slow * slow)
    steady = level * hb[j, B_BRISTLE + 3] / coulomb
    if stretch == 0.0:
        return deflection, steady
    end = steady if stretch > 0.0 else -steady
    return end + (deflection - end) * np.exp(-abs(stretch) / steady), steady


@compiled
def bellows_resistance(hb: Any, j: int, speed: float, stretch: float, span: float, memory: Any) -> float:
    """Hidden force of bellows ``j`` against lengthening, N."""
    force = 0.0
    if hb[j, B_CREEP] != 0.0 or hb[j, B_CREEP + 2] != 0.0:
        force += maxwell_branch(memory[j, CREEP], hb[j, B_CREEP], hb[j, B_CREEP + 1], stretch, span)
        force += maxwell_branch(memory[j, CREEP + 1], hb[j, B_CREEP + 2], hb[j, B_CREEP + 3], stretch, span)
    if hb[j, B_SLIP] != 0.0:
        for m in range(SLIP_YIELD.shape[0]):
            limit = SLIP_YIELD[m] * hb[j, B_SLIP + 1]
            deflection = min(max(memory[j, SLIP + m] + stretch, -limit), limit)
            force += hb[j, B_SLIP] * SLIP_SHARE[m] * deflection / limit
    if hb[j, B_BRISTLE] != 0.0:
        deflection, steady = _bristle(hb, j, speed, stretch, memory[j, BRISTLE])
        force += hb[j, B_BRISTLE] / hb[j, B_BRISTLE + 3] * deflection
        force += hb[j, B_BRISTLE + 4] * (speed - abs(speed) * deflection / steady)
    if hb[j, B_POWER] != 0.0:
        force += np.sign(speed) * hb[j, B_POWER] * abs(speed) ** hb[j, B_POWER + 1]
    return force


@compiled
def advance_memory(hb: Any, speeds: Any, stretch: Any, span: float, memory: Any) -> None:
    """Carry the hidden states over a full step."""
    for j in range(stretch.shape[0]):
        if hb[j, B_CREEP] != 0.0 or hb[j, B_CREEP + 2] != 0.0:
            for m in range(2):
                memory[j, CREEP + m] = maxwell_branch(
                    memory[j, CREEP + m], hb[j, B_CREEP + 2 * m], hb[j, B_CREEP + 2 * m + 1], stretch[j], span
                )
        if hb[j, B_SLIP] != 0.0:
            for m in range(SLIP_YIELD.shape[0]):
                limit = SLIP_YIELD[m] * hb[j, B_SLIP + 1]
                memory[j, SLIP + m] = min(max(memory[j, SLIP + m] + stretch[j], -limit), limit)
        if hb[j, B_BRISTLE] != 0.0:
            deflection, _ = _bristle(hb, j, speeds[j], stretch[j], memory[j, BRISTLE])
            memory[j, BRISTLE] = deflection


@compiled
def spring_factor(hb: Any, j: int, elongation: float, time: float) -> float:
    """Factor on the spring force of bellows ``j``."""
    factor = 1.0
    if hb[j, B_WEAK] != 0.0:
        factor -= hb[j, B_WEAK] * (1.0 + hb[j, B_WEAK + 1] * elongation)
    if hb[j, B_DRIFT] != 0.0:
        factor += hb[j, B_DRIFT] * (1.0 - np.exp(-time / hb[j, B_DRIFT + 1]))
    return factor


@compiled
def area_factor(hb: Any, j: int, elongation: float, gauge: float) -> float:
    """Factor on the effective area of bellows ``j``."""
    factor = 1.0
    if hb[j, B_AREA] != 0.0:
        factor += hb[j, B_AREA] * np.tanh(gauge / hb[j, B_AREA + 1])
    if hb[j, B_AREA + 2] != 0.0:
        factor += hb[j, B_AREA + 2] * elongation
    return factor


@compiled
def bending_resistance(hs: Any, coordinates: Any, rates: Any, force: Any) -> None:
    """Subtract the hidden torques on the bending coordinates from the generalized force."""
    n = hs.shape[0]
    for i in range(n):
        c = 3 * i
        u, v = coordinates[c], coordinates[c + 1]
        du, dv = rates[c], rates[c + 1]
        if hs[i, S_BENDING_DAMPING] != 0.0:
            factor = hs[i, S_BENDING_DAMPING] * (1.0 + hs[i, S_BENDING_DAMPING + 1] * (u * u + v * v))
            force[c] -= factor * du
            force[c + 1] -= factor * dv
        if hs[i, S_BENDING_EXPONENTIAL] != 0.0:
            scale = hs[i, S_BENDING_EXPONENTIAL + 1]
            x = np.sqrt(u * u + v * v) / scale
            over = x * x * (1.0 / 6.0 + x * x / 120.0) if x < 1e-2 else np.sinh(x) / x - 1.0
            force[c] -= hs[i, S_BENDING_EXPONENTIAL] * over * u
            force[c + 1] -= hs[i, S_BENDING_EXPONENTIAL] * over * v
        if i + 1 < n:
            if hs[i, S_COUPLING] != 0.0 or hs[i, S_COUPLING + 1] != 0.0:
                for k in range(2):
                    torque = hs[i, S_COUPLING] * (coordinates[c + k] - coordinates[c + 3 + k])
                    torque += hs[i, S_COUPLING + 1] * (rates[c + k] - rates[c + 3 + k])
                    force[c + k] -= torque
                    force[c + 3 + k] += torque
            if hs[i, S_CHIRAL] != 0.0:
                force[c] -= hs[i, S_CHIRAL] * coordinates[c + 4]
                force[c + 1] += hs[i, S_CHIRAL] * coordinates[c + 3]
                force[c + 3] += hs[i, S_CHIRAL] * v
                force[c + 4] -= hs[i, S_CHIRAL] * u


@compiled
def contact_force(
    hs: Any, i: int, x: float, y: float, z: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float]:
    """One-sided wall against head ``i``: Hertz stiffness, Hunt-Crossley damping, never pulling."""
    stiffness = hs[i, S_CONTACT + 4]
    if stiffness == 0.0:
        return 0.0, 0.0, 0.0
    nx, ny, nz = hs[i, S_CONTACT], hs[i, S_CONTACT + 1], hs[i, S_CONTACT + 2]
    depth = nx * x + ny * y + nz * z - hs[i, S_CONTACT + 3]
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    speed = nx * vx + ny * vy + nz * vz
    push = stiffness * depth * np.sqrt(depth) * max(0.0, 1.0 + hs[i, S_CONTACT + 5] * speed)
    return -push * nx, -push * ny, -push * nz


@compiled
def tool_force(whole: Any, x: float, y: float, z: float, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """Hose to an anchor and air drag at the last head."""
    speed = np.sqrt(vx * vx + vy * vy + vz * vz + AIR_DRAG_LIMIT)
    drag = whole[W_TOOL + 4] + whole[W_TOOL + 5] * speed
    return (
        -whole[W_TOOL + 3] * (x - whole[W_TOOL]) - drag * vx,
        -whole[W_TOOL + 3] * (y - whole[W_TOOL + 1]) - drag * vy,
        -whole[W_TOOL + 3] * (z - whole[W_TOOL + 2]) - drag * vz,
    )
