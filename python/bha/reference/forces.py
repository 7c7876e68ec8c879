"""Forces of bellows, bending, gravity and from outside, and the generalized forces they make: (25)-(35), (52), (53).

Frame and sign: bellows forces act along z of a head, positive where they lengthen the section; lengths and their rates
in m and m/s, pressures absolute in Pa. N stands on the left of (48), so a force that lengthens enters it with a minus.

``end_force`` is the paper's model: every bellows pushes head i with +F z and the head below with -F z (27). Once a
section bends, the two are not parallel, and the pair is no longer conjugate to the bellows length: springs then do work
around a closed path. ``work_conjugate`` (not in the paper) lets a bellows work against its own length, Q_ik = F_ik.
Both coincide for a straight arm of sections with equal bellows_radius; where the radii differ, (27) makes a bellows
pull at the head below at that head's radius, not at its own, and the models differ in the straight pose already. Of a
tapered section the head's radius is that of the last arc; two areas have no place in (27).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bha.reference.derivatives import Transformations
from bha.reference.homogeneous import Array, rotation_part
from bha.reference.parameters import BELLOWS_ANGLES, Arm, Section
from bha.reference.transformations import bending_coordinates_jacobian
from bha.reference.wrenches import Wrench, generalized_wrench


def actuation_bellows_forces(arm: Arm, p: Array) -> Array:
    """Equation (25): F_a = A_P (p - p_amb); shape (n, 3), N."""
    return _areas(arm) * (p.reshape(-1, 3) - arm.ambient_pressure)


def _areas(arm: Arm) -> Array:
    """A_P of every section, of one of tapered bellows the mean over its length; shape (n, 1), m^2."""
    return np.array([[section.terminal_area] for section in arm.sections])


def volume_derivatives(section: Section) -> Array:
    """dV_k/dq_r of the three bellows of a section, in tapered ones as sums over the arcs; shape (3 k, 3 r), m^2.

    V_k = sum of A_j (l_j - r_j psi_j cos(phi - a_k)), area by length beside the centre line, with the arc's shares
    l_j = lambda_j l and psi_j = beta_j psi. The virtual work of a pressure is (p - p_amb) dV.
    """
    dV_dx = np.zeros((3, 3))
    for arc in section.all_arcs:
        dV_dx[:, 0] -= arc.area * arc.radius * arc.bending * np.cos(BELLOWS_ANGLES)
        dV_dx[:, 1] -= arc.area * arc.radius * arc.bending * np.sin(BELLOWS_ANGLES)
        dV_dx[:, 2] += arc.area * arc.length
    derivatives: Array = dV_dx @ bending_coordinates_jacobian(section.bellows_radius)
    return derivatives


def spring_force(stiffness: tuple[float, ...], extension: Array) -> Array:
    """F_spr of (26), a polynomial in q - rest_length from the first power on (Fig. 8); resists the extension, N."""
    force = np.zeros_like(extension)
    for coefficient in reversed(stiffness):
        force = (force + coefficient) * extension
    return force


def spring_slope(stiffness: tuple[float, ...], extension: Array) -> Array:
    """dF_spr/dq of (26), N/m."""
    slope = np.zeros_like(extension)
    for power in range(len(stiffness), 0, -1):
        slope = slope * extension + power * stiffness[power - 1]
    return slope


def passive_bellows_forces(arm: Arm, q: Array, qd: Array) -> Array:
    """Equation (26): F_p = -F_spr(q) - d q', both resist the lengthening; shape (n, 3), N."""
    lengths, rates = q.reshape(-1, 3), qd.reshape(-1, 3)
    return np.array(
        [
            -spring_force(section.stiffness, lengths[i] - section.rest_length) - section.damping * rates[i]
            for i, section in enumerate(arm.sections)
        ]
    )


def effective_forces(F: Array) -> Array:
    """Equation (27): what the bellows of section i and of the section above do to head i; (n, 3) -> (n, 3), N."""
    F_e = F.copy()
    F_e[:-1] -= F[1:]
    return F_e


def external_forces_in_base_frame(state: Transformations, f_head: Array) -> Array:
    """Equation (28): forces (n, 3) given in the head frames, in the base frame; shape (n, 3), N."""
    return np.array([rotation_part(H) @ f for H, f in zip(state.H, f_head, strict=True)])


def generalized_bellows_force(arm: Arm, state: Transformations, F: Array) -> Array:
    """Equations (17), (29)-(32), the sum of (53a): Q_r = sum over xi, chi of (H F_e) . (dH/dq_r r_B); (3n,), N.

    F (n, 3) are bellows forces, actuation or passive. With ``work_conjugate`` Q is F itself.
    """
    if arm.force_model == "work_conjugate":
        return F.reshape(-1)
    F_e = effective_forces(F)
    Q = np.zeros(F.size, dtype=np.result_type(F, *state.H))
    for xi in range(arm.section_count):
        z = state.H[xi][:3, 2]
        for chi in range(3):
            force = F_e[xi, chi] * z  # (19), (29)
            dr_B = state.dr_B[xi][chi]
            for r in range(len(dr_B)):
                Q[r] += force @ dr_B[r]
    return Q


def bending_moment(section: Section, psi: complex, direction: tuple[complex, complex]) -> complex:
    """M_bend(psi, phi) of (33) = k1(phi) psi + k3(phi) psi^3 + k5(phi) psi^5, which straightens the section; N m.

    Linear in psi in the paper (Fig. 9), which writes a dependence on phi and gives none. Here all coefficients go
    from those in the plane phi = ``bending_plane`` to those at right angles to it as cos^2 goes to sin^2: the law of
    a linear plate, and what two pairs of opposite springs do. ``direction`` is (cos phi, sin phi).
    """
    cosine, sine = in_principal_planes(section, direction)
    pairs = zip(section.bending_stiffness, section.cross_bending_stiffness, strict=True)
    k1, k3, k5 = (cosine**2 * along + sine**2 * across for along, across in pairs)
    return k1 * psi + k3 * psi**3 + k5 * psi**5


def bending_turning_moment(section: Section, psi: complex, direction: tuple[complex, complex]) -> complex:
    """dU_bend/dphi, which turns the bending towards the plane of least stiffness; N m. Zero where all planes are alike.

    M_bend depends on phi, so that its integral over psi does too, and what has a potential has both derivatives.
    """
    cosine, sine = in_principal_planes(section, direction)
    pairs = zip(section.bending_stiffness, section.cross_bending_stiffness, strict=True)
    k1, k3, k5 = (along - across for along, across in pairs)
    slope = -2 * cosine * sine  # of cos^2; that of sin^2 is its opposite
    return slope * (k1 * psi**2 / 2 + k3 * psi**4 / 4 + k5 * psi**6 / 6)


def in_principal_planes(section: Section, direction: tuple[complex, complex]) -> tuple[complex, complex]:
    """Cosine and sine of phi - ``bending_plane``, from those of phi."""
    c, s = math.cos(section.bending_plane), math.sin(section.bending_plane)
    return c * direction[0] + s * direction[1], c * direction[1] - s * direction[0]


def bending_potential_derivative(section: Section, x: Array) -> Array:
    """Bending part of (35): dU_bend/dq_k = M_bend dpsi/dq_k + dU_bend/dphi dphi/dq_k of the section; shape (3,), N.

    U_bend is the integral of M_bend over psi: the paper's (33) adds the moment itself to the potential, which does not
    fit in units. dpsi = (u du + v dv) / psi, dphi = (u dv - v du) / psi^2; zero at the straight pose, where U_bend has
    its least or a saddle.
    """
    u, v, _ = x
    psi = np.sqrt(u * u + v * v)
    if psi == 0.0:
        return np.zeros(3, dtype=x.dtype)
    direction = (u / psi, v / psi)
    dx_dq = bending_coordinates_jacobian(section.bellows_radius)
    dpsi_dq = (u * dx_dq[0] + v * dx_dq[1]) / psi
    dphi_dq = (u * dx_dq[1] - v * dx_dq[0]) / psi**2
    moment, turning = bending_moment(section, psi, direction), bending_turning_moment(section, psi, direction)
    derivative: Array = moment * dpsi_dq + turning * dphi_dq
    return derivative


def axial_forces(arm: Arm, q: Array, qd: Array) -> Array:
    """What a sleeve or backbone does to the mean length l of its section: -F_axial(l - l_0) - d_axial l'; (n,), N.

    Not in the paper, whose sections are held by their bellows alone. F_axial is a polynomial like F_spr of (26).
    """
    lengths, rates = q.reshape(-1, 3).mean(axis=1), qd.reshape(-1, 3).mean(axis=1)
    return np.array(
        [
            -spring_force(s.axial_stiffness, lengths[i] - s.axial_rest_length) - s.axial_damping * rates[i]
            for i, s in enumerate(arm.sections)
        ]
    )


def generalized_axial_force(arm: Arm, q: Array, qd: Array) -> Array:
    """Virtual work of the axial forces: Q_k = F dl/dq_k with l = (q1 + q2 + q3) / 3 (7c); shape (3n,), N."""
    return np.repeat(axial_forces(arm, q, qd) / 3.0, 3)


def potential_derivative(arm: Arm, state: Transformations) -> Array:
    """Equations (34) and (35): dU/dq_r = sum over the masses of -m g . dr_S/dq_r, plus bending; shape (3n,), N."""
    gravity = np.array(arm.gravity)
    dU = np.zeros(3 * arm.section_count, dtype=state.x.dtype)
    for body in state.bodies:
        weight = body.mass * gravity
        for r, dr_S in enumerate(body.dr_S):
            dU[r] -= weight @ dr_S
    for xi, section in enumerate(arm.sections):
        dU[3 * xi : 3 * xi + 3] += bending_potential_derivative(section, state.x[xi])
    return dU


def generalized_external_force(arm: Arm, state: Transformations, f_ext: Array) -> Array:
    """Equation (17) for (28): Q_r = sum over xi of F_S . dr_S/dq_r, F_S (n, 3) in the world; shape (3n,), N."""
    Q = np.zeros(3 * arm.section_count, dtype=np.result_type(f_ext, state.x))
    for xi in range(arm.section_count):
        for r, dr_S in enumerate(state.dr_S[xi]):
            Q[r] += f_ext[xi] @ dr_S
    return Q


def bias_force_terms(
    arm: Arm, state: Transformations, q: Array, qd: Array, f_ext: Array | None, wrenches: Sequence[Wrench] = ()
) -> Array:
    """Equation (52): N = dU/dq - passive bellows forces - external forces, generalized; shape (3n,), N.

    Besides the paper's: axial forces of the sections, and wrenches that act anywhere from outside.
    """
    N = potential_derivative(arm, state) - generalized_bellows_force(arm, state, passive_bellows_forces(arm, q, qd))
    N -= generalized_axial_force(arm, q, qd)
    if f_ext is not None:
        N -= generalized_external_force(arm, state, f_ext)
    for wrench in wrenches:
        N -= generalized_wrench(arm, state, wrench)
    return N


def actuation_force_terms(arm: Arm, state: Transformations, p: Array) -> Array:
    """Equation (53): tau, the generalized force of the pressures; shape (3n,), N."""
    return actuation_force_above_ambient(arm, state, p - arm.ambient_pressure)


def actuation_force_above_ambient(arm: Arm, state: Transformations, p: Array) -> Array:
    """Equation (53) of pressures (3n,) above ambient, Pa; shape (3n,), N. With ``work_conjugate`` (p - p_amb) dV/dq."""
    if arm.force_model == "work_conjugate":
        return np.concatenate(
            [own @ volume_derivatives(s) for own, s in zip(p.reshape(-1, 3), arm.sections, strict=True)]
        )
    return generalized_bellows_force(arm, state, _areas(arm) * p.reshape(-1, 3))
