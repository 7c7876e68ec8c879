"""Pose of one section and its first and second derivatives by the bellows lengths, equations (9), (66) and (68).

What: the paper differentiates (9) by (phi, kappa, l) and (7) by q and multiplies. Near the straight section that chain
cannot be computed: dphi/dq grows like 1/kappa, d2phi/dq2 like 1/kappa^2, and their products have to cancel to the
finite derivative of the pose; (7b) itself loses twice as many digits as kappa is small; and below the switch to (11)
the bent directions would have no derivative at all. Here the same map is written in x = (u, v, l) with
u = psi cos(phi) and v = psi sin(phi), which is linear in q, so that d2x/dq2 = 0 in (68) and every derivative exists at
the straight pose. The tests hold the result against (7), (9) and (11) in :mod:`bha.reference.kinematics`.

The pose (9) in x is the rotation about w = (-v, u, 0) (Rodrigues) and the arc that goes with it:

    H = I + a(s) A + b(s) B,     s = psi^2 = u^2 + v^2,     a = sin(psi)/psi,     b = (1 - cos psi)/psi^2
    A = [[ 0,  0, u, 0  ],       B = [[-u^2, -u v,  0,  l u],
         [ 0,  0, v, 0  ],            [-u v, -v^2,  0,  l v],
         [-u, -v, 0, l  ],            [ 0,    0,   -s,  0  ],
         [ 0,  0, 0, 0  ]]            [ 0,    0,    0,  0  ]]

A is linear and B quadratic in x, so the product rule is all there is to it. A section of several arcs is a product of
such poses, each at its shares of x. Frame: base of the section, z along the straight section. Units: m, rad. Validity:
constant curvature within an arc, any psi.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from bha.reference.homogeneous import Array
from bha.reference.parameters import BELLOWS_ANGLES, Section

# A function of s and its first two derivatives, numbers of the sort that the lengths are of.
_Jet = tuple[Any, Any, Any]

# Below this s the closed forms of a'', b'' lose digits by cancellation and the power series has not yet any to lose.
_SERIES_LIMIT = 1.0
_SERIES_COEFFICIENTS = {
    first: tuple((-1.0) ** k / math.factorial(2 * k + first) for k in range(11)) for first in (1, 2)
}


def _constant_derivatives() -> tuple[Array, Array]:
    """First derivatives of A, shape (3, 4, 4), and second derivatives of B, shape (3, 3, 4, 4), by x = (u, v, l)."""
    u, v, length = 0, 1, 2
    dA = np.zeros((3, 4, 4))
    dA[u, 0, 2], dA[u, 2, 0] = 1.0, -1.0
    dA[v, 1, 2], dA[v, 2, 1] = 1.0, -1.0
    dA[length, 2, 3] = 1.0
    d2B = np.zeros((3, 3, 4, 4))
    d2B[u, u, 0, 0] = d2B[v, v, 1, 1] = -2.0
    d2B[u, u, 2, 2] = d2B[v, v, 2, 2] = -2.0
    d2B[u, v, 0, 1] = d2B[u, v, 1, 0] = d2B[v, u, 0, 1] = d2B[v, u, 1, 0] = -1.0
    d2B[u, length, 0, 3] = d2B[length, u, 0, 3] = 1.0
    d2B[v, length, 1, 3] = d2B[length, v, 1, 3] = 1.0
    return dA, d2B


_DA, _D2B = _constant_derivatives()
_DS2 = np.diag([2.0, 2.0, 0.0])  # second derivatives of s by x


@lru_cache(maxsize=256)
def bending_coordinates_jacobian(bellows_radius: float) -> Array:
    """Return d(u, v, l)/dq of a section, constant; shape (3, 3), rows u, v (rad/m) and l; read-only."""
    slope = -2.0 / (3.0 * bellows_radius)
    jacobian = np.array([slope * np.cos(BELLOWS_ANGLES), slope * np.sin(BELLOWS_ANGLES), np.full(3, 1.0 / 3.0)])
    jacobian.setflags(write=False)
    return jacobian


def bending_coordinates(lengths: Array, bellows_radius: float) -> Array:
    """Return (u, v, l) = (psi cos phi, psi sin phi, l) of a section, equations (7) and (3) in linear form; shape (3,).

    Written with differences of lengths, so that equal lengths give exactly u = v = 0.
    """
    q1, q2, q3 = lengths
    return np.array(
        [
            ((q2 - q1) + (q3 - q1)) / (3.0 * bellows_radius),
            (q3 - q2) / (math.sqrt(3.0) * bellows_radius),
            (q1 + q2 + q3) / 3.0,
        ]
    )


def arc_functions(s: Any) -> tuple[_Jet, _Jet]:
    """Return a = sin(psi)/psi and b = (1 - cos psi)/psi^2 of s = psi^2, each with its first two derivatives by s."""
    if abs(s) < _SERIES_LIMIT:
        return _power_series(s, 1), _power_series(s, 2)
    psi = np.sqrt(s)
    a = np.sin(psi) / psi
    b = (1.0 - np.cos(psi)) / s
    # From d(cos psi)/ds = -a/2 and the derivatives of s b = 1 - cos(psi) and psi a = sin(psi).
    da = (np.cos(psi) - a) / (2.0 * s)
    db = (a / 2.0 - b) / s
    d2a = -(a / 2.0 + 3.0 * da) / (2.0 * s)
    d2b = (da / 2.0 - 2.0 * db) / s
    return (a, da, d2a), (b, db, d2b)


def _power_series(s: Any, first: int) -> _Jet:
    """Return the sum of (-s)^k / (2k + first)! and its first two derivatives by s."""
    value = d1 = d2 = 0.0
    for k, coefficient in enumerate(_SERIES_COEFFICIENTS[first]):
        value += coefficient * s**k
        if k >= 1:
            d1 += coefficient * k * s ** (k - 1)
        if k >= 2:
            d2 += coefficient * k * (k - 1) * s ** (k - 2)
    return value, d1, d2


def arc_pose(x: Array, order: int) -> tuple[Array, Array | None, Array | None]:
    """Pose (9) of an arc in x = (u, v, l) and its derivatives by x up to ``order`` (0, 1 or 2).

    Returns H (4, 4), dH/dx (3, 4, 4) and d2H/dx2 (3, 3, 4, 4), with None for what was not asked for.
    """
    u, v, _ = x
    s = u * u + v * v
    (a, a_s, a_ss), (b, b_s, b_ss) = arc_functions(s)
    A = np.tensordot(x, _DA, 1)
    dB = np.tensordot(x, _D2B, 1)
    B = np.tensordot(x, dB, 1) / 2.0
    H = np.eye(4) + a * A + b * B
    if order == 0:
        return H, None, None

    ds = np.array([2.0 * u, 2.0 * v, 0.0])
    da, db = a_s * ds, b_s * ds
    dH = _outer(da, A) + a * _DA + _outer(db, B) + b * dB
    if order == 1:
        return H, dH, None

    ds_ds = np.multiply.outer(ds, ds)
    d2a, d2b = a_ss * ds_ds + a_s * _DS2, b_ss * ds_ds + b_s * _DS2
    mixed = _outer(da, _DA) + _outer(db, dB)
    d2H = _outer(d2a, A) + mixed + mixed.swapaxes(0, 1) + _outer(d2b, B) + b * _D2B
    return H, dH, d2H


def _outer(left: Array, right: Array) -> Array:
    product: Array = np.multiply.outer(left, right)
    return product


def arcs_pose(section: Section, x: Array, order: int, share: float = 1.0) -> tuple[Array, Array | None, Array | None]:
    """Pose (8) at a ``share`` of a section's length from its base on, and its derivatives by x up to ``order``.

    The arcs stand in a row. Arc j has the shares (b_j u, b_j v, l_j l) of x, and that in which the share ends a part of
    these: a part of an arc is an arc. Returns H (4, 4), dH/dx (3, 4, 4) and d2H/dx2 (3, 3, 4, 4), with None for what
    was not asked for.
    """
    H, dH, d2H = np.eye(4), np.zeros((3, 4, 4)), np.zeros((3, 3, 4, 4))
    start = 0.0
    for arc in section.all_arcs:
        part = min(max((share - start) / arc.length, 0.0), 1.0)
        start += arc.length
        shares = part * np.array([arc.bending, arc.bending, arc.length])
        A, dA, d2A = arc_pose(shares * x, order)
        if d2A is not None and dA is not None:
            d2A = np.multiply.outer(shares, shares)[:, :, None, None] * d2A
            mixed = dH[:, None] @ (shares[:, None, None] * dA)[None, :]
            d2H = d2H @ A + mixed + mixed.swapaxes(0, 1) + H @ d2A
        if dA is not None:
            dH = dH @ A + H @ (shares[:, None, None] * dA)
        H = H @ A
    return H, dH if order >= 1 else None, d2H if order == 2 else None


def local_transformation(section: Section, arc: Array, end: Array) -> Array:
    """Pose at the ``end`` (4, 4) of a section's arcs in the head frame below; shape (4, 4)."""
    return section.base_piece @ arc @ end


def local_first_derivatives(section: Section, dH_dx: Array, end: Array) -> Array:
    """Equation (66): dH/dq_k = sum_a dH/dx_a dx_a/dq_k; shape (3, 4, 4), first axis k."""
    dx_dq = bending_coordinates_jacobian(section.bellows_radius)
    dH_dq = np.tensordot(dx_dq, dH_dx, axes=(0, 0))
    return section.base_piece @ dH_dq @ end


def local_second_derivatives(section: Section, d2H_dx2: Array, end: Array) -> Array:
    """Equation (68): d2H/dq_j dq_k = sum_ab d2H/dx_a dx_b dx_a/dq_j dx_b/dq_k; shape (3, 3, 4, 4), first axes j, k.

    The paper's second sum, over dH/dx_a d2x_a/dq_j dq_k, is zero because x is linear in q.
    """
    dx_dq = bending_coordinates_jacobian(section.bellows_radius)
    d2H_dx_dq = np.tensordot(dx_dq, d2H_dx2, axes=(0, 1))  # first axes k, a
    d2H_dq2 = np.tensordot(dx_dq, d2H_dx_dq, axes=(0, 1))  # first axes j, k
    return section.base_piece @ d2H_dq2 @ end
