"""Wrenches that act from outside anywhere on the arm: (17) and (28) for any point, and its counterpart for moments.

What: the generalized force Q_r = F . dr_P/dq_r + M . w_r of a force F at a point P and a moment M, with w_r the
derivative of the rotation rate by q_r' (24). The paper has forces at the centres of mass only. Frame: the world's
(the base's without a base pose), the place in the frame of the arm there. Units: N, N m. Validity: that of the
kinematics; the point moves with the arm.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from bha.errors import InputError
from bha.reference.derivatives import Transformations, position_derivative, section_part
from bha.reference.homogeneous import Array, rotation_rate
from bha.reference.parameters import Arm


@dataclasses.dataclass(frozen=True)
class Wrench:
    """A force and a moment on section ``section`` (from 1) at a point of it.

    ``fraction``: where along it, from 0 (start of its arcs) to 1 (its head, the rigid piece after the arcs included).
    ``offset`` (m): the point in the frame of the arm there. ``force`` (N) and ``moment`` (N m): in the world.
    """

    section: int
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)
    moment: tuple[float, float, float] = (0.0, 0.0, 0.0)
    fraction: float = 1.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


def generalized_wrench(arm: Arm, state: Transformations, wrench: Wrench) -> Array:
    """Equation (17) for a wrench; shape (3n,), N."""
    i = wrench.section - 1
    if not 0 <= i < arm.section_count:
        raise InputError(f"wrench: section {wrench.section}; sections 1 to {arm.section_count} exist")
    H, dH = pose_along(arm, state, i, wrench.fraction)
    dr = position_derivative(dH, np.array([*wrench.offset, 1.0]))
    w = rotation_rate(H, dH)
    Q = np.zeros(3 * arm.section_count, dtype=state.x.dtype)
    Q[: len(dH)] = dr @ np.array(wrench.force) + w @ np.array(wrench.moment)
    return Q


def pose_along(arm: Arm, state: Transformations, i: int, fraction: float) -> tuple[Array, Array]:
    """Pose (4, 4) at a fraction of section i, and its derivatives (m, 4, 4) by the coordinates up to it.

    A part of an arc of constant curvature is an arc: (9) at (u, v, l) times its share. At 1 it is the head.
    """
    if fraction == 1.0:
        return state.H[i], state.dH[i]
    L, dL, _ = section_part(arm.sections[i], state.x[i], 1, fraction, np.eye(4))
    if i == 0:
        return arm.base_pose @ L, arm.base_pose @ dL
    return state.H[i - 1] @ L, np.concatenate([state.dH[i - 1] @ L, state.H[i - 1] @ dL])
