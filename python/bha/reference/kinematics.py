"""Forward kinematics as the paper writes it: bellows lengths -> arc (phi, kappa, l) -> pose, equations (3) to (14).

Frame: base frame, z along the straight arm; a positive bend leans towards the direction phi. Units: m, rad, 1/m.
Validity: constant curvature within each arc of a section (one arc unless the arm says otherwise), no twist,
q1 + q2 + q3 > 0.

These functions keep the paper's switch to the straight section (11) at a curvature of 1e-6 and with it the paper's
error of about l * kappa * l / 2 just below the switch. The dynamics need derivatives on both sides of it and use
:mod:`bha.reference.transformations`, which is the same map without the switch.
"""

from __future__ import annotations

import math

import numpy as np

from bha.reference.arguments import vector
from bha.reference.homogeneous import Array, along_z
from bha.reference.parameters import Arm, Section

STRAIGHT_CURVATURE = 1e-6  # 1/m, the paper's switching boundary (section VI)


def specific_mapping(lengths: Array, bellows_radius: float) -> tuple[float, float, float]:
    """Equation (7): (phi, kappa, l) of a section from its three bellows lengths; rad, 1/m, m.

    phi is in (-pi, pi] and is 0 for the straight section, where the paper leaves it undefined.
    """
    q1, q2, q3 = (float(length) for length in lengths)
    phi = math.atan2(math.sqrt(3.0) * (q3 - q2), q2 + q3 - 2.0 * q1)  # (7a)
    # Rounding can push the sum of squares of equal lengths a little below zero.
    squares = max(q1**2 + q2**2 + q3**2 - q1 * q2 - q2 * q3 - q1 * q3, 0.0)
    kappa = 2.0 * math.sqrt(squares) / ((q1 + q2 + q3) * bellows_radius)  # (7b)
    length = (q1 + q2 + q3) / 3.0  # (7c)
    return phi, kappa, length


def bending_angle(kappa: float, length: float) -> float:
    """Equation (3): psi = kappa l, rad."""
    return kappa * length


def general_mapping(phi: float, kappa: float, length: float) -> Array:
    """Equations (9) and (10): pose of the head in the frame of the section's base for kappa > 0; shape (4, 4)."""
    c_phi, s_phi = math.cos(phi), math.sin(phi)  # (10a)
    c_kl, s_kl = math.cos(kappa * length), math.sin(kappa * length)  # (10b)
    return np.array(
        [
            [c_phi**2 * (c_kl - 1) + 1, s_phi * c_phi * (c_kl - 1), c_phi * s_kl, c_phi * (1 - c_kl) / kappa],
            [s_phi * c_phi * (c_kl - 1), c_phi**2 * (1 - c_kl) + c_kl, s_phi * s_kl, s_phi * (1 - c_kl) / kappa],
            [-c_phi * s_kl, -s_phi * s_kl, c_kl, s_kl / kappa],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def straight_mapping(length: float) -> Array:
    """Equation (11): pose of the head of a straight section; shape (4, 4)."""
    return along_z(length)


def switched_section_pose(section: Section, lengths: Array) -> Array:
    """Pose of a head in its base frame by (7), then (9) or (11) as the paper switches; shape (4, 4).

    The rigid pieces ``base_offset`` and ``head_offset`` (not in the paper) stand before and after the arc. Of several
    arcs each has its share of the length and, in the one plane, of the bending angle (3).
    """
    phi, kappa, length = specific_mapping(lengths, section.bellows_radius)
    pose = section.base_piece
    for arc in section.all_arcs:
        own_length, own_kappa = arc.length * length, arc.bending / arc.length * kappa
        straight = abs(own_kappa) < STRAIGHT_CURVATURE
        pose = pose @ (straight_mapping(own_length) if straight else general_mapping(phi, own_kappa, own_length))
    return pose @ section.head_piece


def chain(local_poses: list[Array]) -> list[Array]:
    """Equations (13) and (14): poses of all heads in the world from the poses in the frame of the head below.

    The first of these is already in the world: it begins with the base's pose (12).
    """
    poses = [local_poses[0]]
    for local in local_poses[1:]:
        poses.append(poses[-1] @ local)
    return poses


def switched_forward_kinematics(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Head positions (n, 3) in m and rotations (n, 3, 3) by (7), (9), (11) and (14), with the paper's switch."""
    lengths = vector(arm, "q", q).reshape(arm.section_count, 3)
    local = [switched_section_pose(s, q_i) for s, q_i in zip(arm.sections, lengths, strict=True)]
    poses = np.array(chain([arm.base_pose @ local[0], *local[1:]]))
    return poses[:, :3, 3], poses[:, :3, :3]
