"""Derivatives of concatenated homogeneous transformations: (14), (19)-(21) and the appendices (63)-(73).

What: poses of all heads and of the masses along the sections in the world, their first and second derivatives by the
bellows lengths, and their time derivatives. The paper writes each derivative as one product over all sections; the
products share all their factors but one or two, so each head's derivatives are made from those of the head below,
"computing reoccurring terms only once" (section III-E). Frame: the world's, which is the base's unless the arm has a
base pose (12). Units: m, m/s, and 1/m per derivative.

Layout: lists over the heads i = 0..n-1. Derivatives of head i have one first axis (or two) of length m = 3(i + 1), one
entry for each coordinate q_j of the sections up to i. What (67) and (69) set to zero, derivatives by coordinates of
sections above i, is not stored; that is also the start index (51) of every sum.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from bha.reference.arguments import vector
from bha.reference.homogeneous import Array
from bha.reference.kinematics import chain
from bha.reference.parameters import Arm, Section
from bha.reference.transformations import (
    arcs_pose,
    bending_coordinates,
    local_first_derivatives,
    local_second_derivatives,
    local_transformation,
)


@dataclasses.dataclass(frozen=True)
class Body:
    """A rigid body with mass: a head, or one of the masses along a section, which moves with the same coordinates.

    ``r_S`` (4,) and ``inertia_tensor`` (3, 3) are fixed in the body's frame; ``H`` (4, 4), ``dH`` (m, 4, 4) with
    m = 3 (section + 1) are its pose and the derivatives by q, ``H_dot``, ``dH_dot`` their time derivatives.
    """

    section: int
    mass: float
    r_S: Array  # noqa: N815
    inertia_tensor: Array
    H: Array
    dH: Array  # noqa: N815
    H_dot: Array | None
    dH_dot: Array | None  # noqa: N815

    @property
    def dr_S(self) -> Array:
        """Derivatives (20) of the centre of mass; shape (m, 3)."""
        return position_derivative(self.dH, self.r_S)


@dataclasses.dataclass(frozen=True)
class Transformations:
    """The recurring terms of one state: everything the equations of motion need of the kinematics.

    ``x`` (n, 3) are (u, v, l) of the sections. ``H[i]`` (4, 4), ``dH[i]`` (m, 4, 4) are pose of head i and its
    derivatives by q. ``dr_S[i]`` (m, 3) are the derivatives of the centre of mass, ``dr_B[i]`` (3, m, 3) those of the
    three points where the bellows meet the head (empty with ``work_conjugate``, which does not use them). ``H_dot[i]``
    (4, 4) and ``dH_dot[i]`` (m, 4, 4) are the time derivatives of H and dH, None where they were not asked for.
    ``bodies`` are all that has mass, in any order.
    """

    x: Array
    H: list[Array]
    dH: list[Array]  # noqa: N815  (the paper's H)
    dr_S: list[Array]  # noqa: N815
    dr_B: list[Array]  # noqa: N815
    bodies: list[Body]
    H_dot: list[Array] | None = None
    dH_dot: list[Array] | None = None  # noqa: N815


def transformations(arm: Arm, q: Array, qd: Array | None = None) -> Transformations:
    """Evaluate poses and first derivatives at q and, where qd is given, their time derivatives (second derivatives).

    Args:
        arm: the arm.
        q: bellows lengths, (3n,), m.
        qd: their rates, (3n,), m/s; None skips every second derivative, as the reduction (60) allows.
    """
    order = 1 if qd is None else 2
    x, L, dL, d2L = section_derivatives(arm, q, order)
    H = chain(L)
    dH = first_derivatives(H, L, dL)
    dr_S = [position_derivative(dH_i, s.homogeneous_center_of_mass) for s, dH_i in zip(arm.sections, dH, strict=True)]
    dr_B = []
    if arm.force_model == "end_force":
        for section, dH_i in zip(arm.sections, dH, strict=True):
            dr_B.append(np.array([position_derivative(dH_i, r_B) for r_B in section.homogeneous_contact_points]))
    if qd is None:
        heads = [_head(arm, i, H[i], dH[i], None, None) for i in range(arm.section_count)]
        return Transformations(x, H, dH, dr_S, dr_B, heads + masses_along(arm, x, H, dH, None, None))
    d2H = second_derivatives(H, dH, L, dL, d2L)
    H_dot, dH_dot = time_derivative(dH, qd), time_derivative_of_first(d2H, qd)
    heads = [_head(arm, i, H[i], dH[i], H_dot[i], dH_dot[i]) for i in range(arm.section_count)]
    return Transformations(x, H, dH, dr_S, dr_B, heads + masses_along(arm, x, H, dH, d2H, qd), H_dot, dH_dot)


def _head(arm: Arm, i: int, H: Array, dH: Array, H_dot: Array | None, dH_dot: Array | None) -> Body:
    section = arm.sections[i]
    r_S, J = section.homogeneous_center_of_mass, section.inertia_tensor
    return Body(i, section.mass, r_S, J, H, dH, H_dot, dH_dot)


def masses_along(
    arm: Arm, x: Array, H: list[Array], dH: list[Array], d2H: list[Array] | None, qd: Array | None
) -> list[Body]:
    """The masses along the sections, by (67) and (69) as the heads: each ends a chain whose other poses are heads'.

    ``d2H`` and ``qd`` are None where no time derivatives are wanted.
    """
    bodies = []
    for i, section in enumerate(arm.sections):
        for mass in section.masses:
            L, dL, d2L = section_part(section, x[i], 1 if qd is None else 2, mass.share, np.eye(4))
            if i == 0:
                L, dL, d2L = arm.base_pose @ L, arm.base_pose @ dL, None if d2L is None else arm.base_pose @ d2L
            own_H = L if i == 0 else H[i - 1] @ L
            own_dH = dL if i == 0 else np.concatenate([dH[i - 1] @ L, H[i - 1] @ dL])
            H_dot = dH_dot = None
            if qd is not None and d2H is not None and d2L is not None:
                own_d2H = d2L if i == 0 else second_derivative(H[i - 1], dH[i - 1], d2H[i - 1], L, dL, d2L)
                H_dot, dH_dot = time_derivative([own_dH], qd)[0], time_derivative_of_first([own_d2H], qd)[0]
            r_S, J = np.array([*mass.offset, 1.0]), np.diag(mass.inertia)
            bodies.append(Body(i, mass.mass, r_S, J, own_H, own_dH, H_dot, dH_dot))
    return bodies


def section_part(section: Section, x: Array, order: int, share: float, end: Array) -> tuple[Array, Array, Array | None]:
    """L (4, 4), dL/dq (3, 4, 4) and, for ``order`` 2, d2L/dq2 (3, 3, 4, 4) of a section up to a share of its arcs.

    ``end`` (4, 4) is the rigid piece behind that. The pose is that in the frame of the head below.
    """
    arc, d_arc, d2_arc = arcs_pose(section, x, max(order, 1), share)
    assert d_arc is not None
    return (
        local_transformation(section, arc, end),
        local_first_derivatives(section, d_arc, end),
        None if d2_arc is None else local_second_derivatives(section, d2_arc, end),
    )


def section_derivatives(arm: Arm, q: Array, order: int) -> tuple[Array, list[Array], list[Array], list[Array]]:
    """Equations (9), (66), (68) of all sections: x (n, 3) and lists of L (4, 4), dL (3, 4, 4), d2L (3, 3, 4, 4).

    L_i is the pose of head i in the frame of the head below, L_0 that in the world: base pose (12) and first section.
    Lists of derivatives above ``order`` are empty.
    """
    x, L, dL, d2L = [], [], [], []
    before = arm.base_pose
    for section, lengths in zip(arm.sections, np.reshape(q, (arm.section_count, 3)), strict=True):
        x.append(bending_coordinates(lengths, section.bellows_radius))
        local, d_local, d2_local = section_part(section, x[-1], order, 1.0, section.head_piece)
        L.append(before @ local)
        if order >= 1:
            dL.append(before @ d_local)
        if d2_local is not None:
            d2L.append(before @ d2_local)
        before = np.eye(4)
    return np.array(x), L, dL, d2L


def first_derivatives(H: list[Array], L: list[Array], dL: list[Array]) -> list[Array]:
    """Equation (67): dH_i/dq_j = H_(base of j) dL_j/dq_j L_(j+1) ... L_i; list of (m, 4, 4)."""
    dH = [dL[0]]
    for i in range(1, len(L)):
        dH.append(np.concatenate([dH[i - 1] @ L[i], H[i - 1] @ dL[i]]))
    return dH


def second_derivatives(
    H: list[Array], dH: list[Array], L: list[Array], dL: list[Array], d2L: list[Array]
) -> list[Array]:
    """Equation (69): d2H_i/dq_j dq_k, two sections once or one section twice; list of (m, m, 4, 4)."""
    d2H = [d2L[0]]
    for i in range(1, len(L)):
        d2H.append(second_derivative(H[i - 1], dH[i - 1], d2H[i - 1], L[i], dL[i], d2L[i]))
    return d2H


def second_derivative(H: Array, dH: Array, d2H: Array, L: Array, dL: Array, d2L: Array) -> Array:
    """Second derivatives (m + 3, m + 3, 4, 4) of H L, of which H (4, 4) has m coordinates and L three of its own."""
    m = len(dH)
    product = np.empty((m + 3, m + 3, 4, 4), dtype=d2L.dtype)
    product[:m, :m] = d2H @ L
    product[:m, m:] = dH[:, None] @ dL[None, :]
    product[m:, :m] = product[:m, m:].swapaxes(0, 1)
    product[m:, m:] = H @ d2L
    return product


def time_derivative(dH: list[Array], qd: Array) -> list[Array]:
    """Equation (70): H_i' = sum_j dH_i/dq_j q_j'; list of (4, 4)."""
    return [np.tensordot(qd[: len(dH_i)], dH_i, 1) for dH_i in dH]


def time_derivative_of_first(d2H: list[Array], qd: Array) -> list[Array]:
    """Equations (71) and (72): dH_i'/dq_j = d/dt dH_i/dq_j = sum_k d2H_i/dq_k dq_j q_k'; list of (m, 4, 4)."""
    return [np.tensordot(qd[: len(d2H_i)], d2H_i, 1) for d2H_i in d2H]


def second_time_derivative(dH: list[Array], dH_dot: list[Array], qd: Array, qdd: Array) -> list[Array]:
    """Equation (73): H_i'' = sum_j dH_i/dq_j q_j'' + sum_j d/dt(dH_i/dq_j) q_j'; list of (4, 4)."""
    return [
        np.tensordot(qdd[: len(dH_i)], dH_i, 1) + np.tensordot(qd[: len(dH_i)], dH_dot_i, 1)
        for dH_i, dH_dot_i in zip(dH, dH_dot, strict=True)
    ]


def position(H: Array, r: Array) -> Array:
    """Equation (19): a point r (4,) of the head frame in the base frame; shape (3,), m."""
    return (H @ r)[:3]


def position_derivative(dH: Array, r: Array) -> Array:
    """Equations (20), (21) and (64), (65): derivative of a point r (4,) that is fixed in the head frame.

    dH is the derivative of the pose by whatever is wanted: H' gives the velocity (21), dH/dq_j the partial derivative
    (20), which by (63) is also the partial derivative of the velocity by q_j'. Shape (..., 4, 4) -> (..., 3).
    """
    return (dH @ r)[..., :3]


def forward_kinematics(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Equation (14): head positions (n, 3) in m and rotations (n, 3, 3) in the world, without a switch."""
    _, L, _, _ = section_derivatives(arm, vector(arm, "q", q), 0)
    H = np.array(chain(L))
    return H[:, :3, 3], H[:, :3, :3]
