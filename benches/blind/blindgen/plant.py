"""Parameters and scratch arrays of the true arm, its linear coordinates, and the solution for the accelerations.

The parameters travel as a few plain arrays with named columns: compiled code counts references per array, and tuples
of many arrays cost more than the mechanics. Coordinates ``s = (u_1, v_1, l_1, u_2, ...)`` are linear in the bellows
lengths.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arc import ARC_ROWS
from .jit import compiled

Array = NDArray[np.float64]

# Columns of Plant.sections, first column of each group.
P_MASS = 0
P_INERTIA = 1
P_CENTER = 4
P_RADIUS = 7
P_AREA = 8
P_REST = 9
P_STIFFNESS = 10  # three coefficients of the elongation
P_DAMPING = 13
P_BENDING = 14  # moment k1 psi + k3 psi^3
P_HARDENING = 16  # stiffness N/m and length m of an exponential hardening k x0 (sinh(x/x0) - x/x0)
P_SLICED = 18  # share of the mass that sits on the slices instead of the head
P_COLUMNS = 19

# Columns of Work.head.
H_POSITION = 0
H_VELOCITY = 3
H_ROTATION = 6
H_COLUMNS = 15


class Plant(NamedTuple):
    """Parameters of the plain arm."""

    sections: Array  # (n, P_COLUMNS)
    slices: Array  # (m, 2) places as fractions of the arc, and shares
    ambient_pressure: float
    work_conjugate: bool

    @property
    def radius(self) -> Array:
        """Bellows radius per section, m."""
        return self.sections[:, P_RADIUS].copy()

    def copy(self) -> "Plant":
        """An independent copy."""
        return self._replace(sections=self.sections.copy(), slices=self.slices.copy())


class Work(NamedTuple):
    """Scratch arrays, allocated once per simulation."""

    arc: Array  # (ARC_ROWS, 3)
    screw: Array  # (3n, 6) e and w of each coordinate about the base origin
    column: Array  # (3n, 3) Jacobian of the point at hand
    matrix: Array  # (3n, 3n) inertia matrix
    bias: Array  # (3n,) velocity-product forces
    force: Array  # (3n,) all other generalized forces
    head: Array  # (n, H_COLUMNS)
    axes: Array  # (2, 3, 3) rotation of the frame at hand, and the next one
    bellows: Array  # (n + 1, 3) bellows forces, last row zero


def make_work(sections: int) -> Work:
    """Scratch arrays for an arm of ``sections`` sections."""
    n, d = sections, 3 * sections
    shapes = ((ARC_ROWS, 3), (d, 6), (d, 3), (d, d), (d,), (d,), (n, H_COLUMNS), (2, 3, 3), (n + 1, 3))
    return Work(*(np.zeros(shape) for shape in shapes))


@compiled
def bellows_lengths(radius: Array, coordinates: Array, out: Array) -> None:
    """``q_k = l - r (u cos a_k + v sin a_k)``, a_k = 0, 120, 240 degrees."""
    h = 0.5 * np.sqrt(3.0)
    for i in range(radius.shape[0]):
        u, v, length = coordinates[3 * i], coordinates[3 * i + 1], coordinates[3 * i + 2]
        r = radius[i]
        out[3 * i] = length - r * u
        out[3 * i + 1] = length + r * (0.5 * u - h * v)
        out[3 * i + 2] = length + r * (0.5 * u + h * v)


@compiled
def arc_coordinates(radius: Array, lengths: Array, out: Array) -> None:
    """Inverse of :func:`bellows_lengths`."""
    for i in range(radius.shape[0]):
        a, b, c = lengths[3 * i], lengths[3 * i + 1], lengths[3 * i + 2]
        out[3 * i] = (b + c - 2.0 * a) / (3.0 * radius[i])
        out[3 * i + 1] = (c - b) / (np.sqrt(3.0) * radius[i])
        out[3 * i + 2] = (a + b + c) / 3.0


@compiled
def solve_acceleration(work: Work, settle_rate: float, rates: Array, out: Array) -> None:
    """``M^-1 (Q - h) - settle_rate s'`` by Cholesky; the last term only serves to find rest."""
    a = work.matrix
    d = out.shape[0]
    for j in range(d):
        total = a[j, j]
        for k in range(j):
            total -= a[j, k] * a[j, k]
        pivot = np.sqrt(total)
        a[j, j] = pivot
        inverse = 1.0 / pivot
        for i in range(j + 1, d):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = total * inverse
    for i in range(d):
        total = work.force[i] - work.bias[i]
        for k in range(i):
            total -= a[i, k] * out[k]
        out[i] = total / a[i, i]
    for i in range(d - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, d):
            total -= a[k, i] * out[k]
        out[i] = total / a[i, i]
    for i in range(d):
        out[i] -= settle_rate * rates[i]
