"""Equations of motion M(q) q'' + C(q, q') q' + N(q, q') = tau(q, p) (48) and their matrices: (49)-(51), (58)-(61).

What: inertia and Coriolis matrix entry by entry, as sums over the masses (one a section in the paper, more where they
lie along a section), and the dense solution of (48). Frame: that of the heads' poses. Units: q in m, so M and C are in
kg and kg/s, N and tau in N. Sign: N stands on the left side of (48). Validity: masses and inertia tensors fixed in the
heads' frames or in those of the centre line at their shares of its length, massless bellows, constant curvature of
each arc.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from bha.reference.arguments import external, vector
from bha.reference.derivatives import Transformations, position_derivative, transformations
from bha.reference.forces import actuation_force_above_ambient, actuation_force_terms, bias_force_terms
from bha.reference.homogeneous import Array, inertia_in_base_frame, rate_operator, rotation_part, rotation_rate
from bha.reference.parameters import Arm
from bha.reference.wrenches import Wrench


@dataclasses.dataclass(frozen=True)
class DynamicsTerms:
    """The terms of (48) at one state.

    ``inertia_matrix`` M and ``coriolis_matrix`` C (3n, 3n), ``bias_force`` N and ``actuation_force`` tau (3n,).
    """

    inertia_matrix: Array
    coriolis_matrix: Array
    bias_force: Array
    actuation_force: Array


@dataclasses.dataclass(frozen=True)
class MassTerms:
    """Recurring terms of (49) and (50) for one mass, which moves with section ``section``; m rows, one per coordinate.

    ``dr`` (m, 3): dr_S/dq_j. ``w`` (m, 3): Gamma(dR/dq_j R^T), the derivative of the rotation rate by q_j'.
    ``Jw`` (m, 3): J w_j. ``dr_dot`` (m, 3): d/dt dr_S/dq_j. ``Jw_dot`` (m, 3): J dw_j/dt + omega x (J w_j).
    Rotational terms are None without rotational energy, the time derivatives without Coriolis forces.
    """

    section: int
    mass: float
    dr: Array
    w: Array | None
    Jw: Array | None
    dr_dot: Array | None
    Jw_dot: Array | None


def mass_terms(arm: Arm, state: Transformations) -> list[MassTerms]:
    """Evaluate what (49) and (50) use again and again, for every mass; only what the arm's switches leave in."""
    terms = []
    for body in state.bodies:
        H, dH = body.H, body.dH
        w = Jw = dr_dot = Jw_dot = None
        if arm.rotational_energy:
            J = inertia_in_base_frame(H, body.inertia_tensor)
            w = rotation_rate(H, dH)
            Jw = w @ J
        if body.H_dot is not None and body.dH_dot is not None:
            dr_dot = position_derivative(body.dH_dot, body.r_S)
            if w is not None and Jw is not None:
                R, R_dot = rotation_part(H), rotation_part(body.H_dot)
                # d/dt of Gamma(dR/dq_j R^T): Gamma is linear, the product rule is all.
                w_dot = rate_operator(rotation_part(body.dH_dot) @ R.T + rotation_part(dH) @ R_dot.T)
                omega_cross = R_dot @ R.T  # [omega]x, (23)
                Jw_dot = w_dot @ J + Jw @ omega_cross.T
        terms.append(MassTerms(body.section, body.mass, body.dr_S, w, Jw, dr_dot, Jw_dot))
    return terms


def start_section(row: int, column: int) -> int:
    """Equation (51): the lowest section whose mass moves with both coordinates; counted from 0."""
    return max(row, column) // 3


def inertia_matrix_from(terms: list[MassTerms]) -> Array:
    """Equation (49), and (58) where the rotational terms are left out: M, shape (3n, 3n), kg."""
    M = _zeros(terms)
    for r in range(len(M)):
        for c in range(r + 1):
            for body in terms:
                if body.section < start_section(r, c):
                    continue
                M[r, c] += body.mass * (body.dr[c] @ body.dr[r])
                if body.w is not None and body.Jw is not None:
                    M[r, c] += body.w[r] @ body.Jw[c]
            M[c, r] = M[r, c]
    return M


def _zeros(terms: list[MassTerms]) -> Array:
    """A matrix (3n, 3n) of zeros, of the terms' sort of number."""
    size = max(len(body.dr) for body in terms)
    rates = terms[0].dr if terms[0].dr_dot is None else terms[0].dr_dot
    return np.zeros((size, size), dtype=np.result_type(terms[0].dr, rates))


def coriolis_matrix_from(terms: list[MassTerms]) -> Array:
    """Equation (50), and (59) where the rotational terms are left out: C, shape (3n, 3n), kg/s.

    Translational part as in the paper, m (d/dt dr_S/dq_c) . (dr_S/dq_r). The rotational part of (50) is not legible in
    the text we have; here w_r . (J dw_c/dt + omega x (J w_c)), for which C q' is that of the Euler-Lagrange equations
    and dM/dt - 2C is skew-symmetric. Zero where the terms carry no time derivatives (60).
    """
    C = _zeros(terms)
    for r in range(len(C)):
        for c in range(len(C)):
            for body in terms:
                if body.section < start_section(r, c):
                    continue
                if body.dr_dot is not None:
                    C[r, c] += body.mass * (body.dr_dot[c] @ body.dr[r])
                if body.w is not None and body.Jw_dot is not None:
                    C[r, c] += body.w[r] @ body.Jw_dot[c]
    return C


def inertia_matrix(arm: Arm, q: Array) -> Array:
    """M(q) of (48) by (49), or (58) without rotational energy; (3n,) m -> (3n, 3n) kg, symmetric positive definite."""
    return inertia_matrix_from(mass_terms(arm, transformations(arm, vector(arm, "q", q))))


def coriolis_matrix(arm: Arm, q: Array, qd: Array) -> Array:
    """C(q, q') of (48) by (50), (59) or (60), after the arm's switches; (3n,) m, (3n,) m/s -> (3n, 3n) kg/s.

    dM/dt - 2C is skew-symmetric. Zero where the arm leaves Coriolis forces out.
    """
    q, qd = vector(arm, "q", q), vector(arm, "qd", qd)
    if not arm.coriolis_forces:
        return np.zeros((len(q), len(q)))
    return coriolis_matrix_from(mass_terms(arm, transformations(arm, q, qd)))


def bias_force(arm: Arm, q: Array, qd: Array, f_ext: Array | None = None, wrenches: Sequence[Wrench] = ()) -> Array:
    """N(q, q') of (48) by (52): springs, damping, bending, gravity and external forces; (3n,), N.

    ``f_ext`` (n, 3): force at each section's centre of mass in the world, N; ``wrenches``: others, anywhere.
    """
    q, qd = vector(arm, "q", q), vector(arm, "qd", qd)
    return bias_force_terms(arm, transformations(arm, q), q, qd, external(arm, f_ext), wrenches)


def actuation_force(arm: Arm, q: Array, p: Array) -> Array:
    """tau(q, p) of (48) by (53); lengths (3n,) m and absolute pressures (3n,) Pa -> (3n,) N."""
    return actuation_force_terms(arm, transformations(arm, vector(arm, "q", q)), vector(arm, "p", p))


def actuation_matrix(arm: Arm, q: Array) -> Array:
    """d tau/dp, (3n, 3n), N/Pa: the columns of (53), which is linear in p - p_amb."""
    state = transformations(arm, vector(arm, "q", q))
    # 1 Pa above ambient in one bellows after the other.
    columns = [actuation_force_above_ambient(arm, state, p) for p in np.eye(3 * arm.section_count)]
    return np.stack(columns, axis=1)


def dynamics_terms(
    arm: Arm, q: Array, qd: Array, p: Array, f_ext: Array | None = None, wrenches: Sequence[Wrench] = ()
) -> DynamicsTerms:
    """M, C, N and tau of (48) at one state, with the kinematics computed once; see the functions of each."""
    q, qd, p = vector(arm, "q", q), vector(arm, "qd", qd), vector(arm, "p", p)
    state = transformations(arm, q, qd if arm.coriolis_forces else None)
    terms = mass_terms(arm, state)
    M = inertia_matrix_from(terms)
    return DynamicsTerms(
        inertia_matrix=M,
        coriolis_matrix=coriolis_matrix_from(terms) if arm.coriolis_forces else np.zeros_like(M),
        bias_force=bias_force_terms(arm, state, q, qd, external(arm, f_ext), wrenches),
        actuation_force=actuation_force_terms(arm, state, p),
    )


def forward_dynamics(
    arm: Arm, q: Array, qd: Array, p: Array, f_ext: Array | None = None, wrenches: Sequence[Wrench] = ()
) -> Array:
    """q'' of (48), or of (61) without Coriolis forces, by a dense solution; (3n,), m/s^2.

    Raises numpy.linalg.LinAlgError where M is singular.
    """
    terms = dynamics_terms(arm, q, qd, p, f_ext, wrenches)
    force = terms.actuation_force - terms.bias_force
    if arm.coriolis_forces:
        force -= terms.coriolis_matrix @ qd
    qdd: Array = np.asarray(np.linalg.solve(terms.inertia_matrix, force))
    return qdd


def inverse_dynamics(
    arm: Arm, q: Array, qd: Array, qdd: Array, f_ext: Array | None = None, wrenches: Sequence[Wrench] = ()
) -> Array:
    """tau of (48) that gives the accelerations qdd (3n,) m/s^2; (3n,), N."""
    q, qd, qdd = vector(arm, "q", q), vector(arm, "qd", qd), vector(arm, "qdd", qdd)
    state = transformations(arm, q, qd if arm.coriolis_forces else None)
    terms = mass_terms(arm, state)
    tau = inertia_matrix_from(terms) @ qdd + bias_force_terms(arm, state, q, qd, external(arm, f_ext), wrenches)
    if arm.coriolis_forces:
        tau += coriolis_matrix_from(terms) @ qd
    return tau
