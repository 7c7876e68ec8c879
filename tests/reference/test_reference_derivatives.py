"""Every derivative function against central differences of what it differentiates, through the straight pose too."""

from __future__ import annotations

import numpy as np
from reference_states import State, central_difference, rate

from bha import reference as ref
from bha.reference import derivatives as d
from bha.reference.homogeneous import rate_operator, rotation_part, rotation_rate
from bha.reference.transformations import arc_pose, bending_coordinates


def all_derivatives(arm: ref.Arm, q: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    _, L, dL, d2L = d.section_derivatives(arm, q, 2)
    H = d.chain(L)
    dH = d.first_derivatives(H, L, dL)
    return H, dH, d.second_derivatives(H, dH, L, dL, d2L)


def test_arc_in_its_own_coordinates(arm: ref.Arm, state: State) -> None:
    step = 1e-3
    x = bending_coordinates(state.q[:3], arm.sections[0].bellows_radius)
    _, dH, d2H = arc_pose(x, 2)
    np.testing.assert_allclose(dH, central_difference(lambda y: arc_pose(y, 0)[0], x, step), atol=1e-11)
    np.testing.assert_allclose(d2H, central_difference(lambda y: arc_pose(y, 1)[1], x, step), atol=1e-11)


def test_section_derivatives(arm: ref.Arm, state: State) -> None:
    _, L, dL, d2L = d.section_derivatives(arm, state.q, 2)
    for i in range(3):

        def pose(lengths: np.ndarray, i: int = i) -> np.ndarray:
            q = state.q.copy()
            q[3 * i : 3 * i + 3] = lengths
            return d.section_derivatives(arm, q, 0)[1][i]

        def first(lengths: np.ndarray, i: int = i) -> np.ndarray:
            q = state.q.copy()
            q[3 * i : 3 * i + 3] = lengths
            return d.section_derivatives(arm, q, 1)[2][i]

        lengths = state.q[3 * i : 3 * i + 3]
        assert L[i].shape == (4, 4)
        np.testing.assert_allclose(dL[i], central_difference(pose, lengths), atol=1e-9)  # (66)
        np.testing.assert_allclose(d2L[i], central_difference(first, lengths), atol=1e-8)  # (68)


def test_global_derivatives(arm: ref.Arm, state: State) -> None:
    _, dH, d2H = all_derivatives(arm, state.q)
    for i in range(3):
        m = 3 * (i + 1)
        assert dH[i].shape == (m, 4, 4)
        assert d2H[i].shape == (m, m, 4, 4)
        first = central_difference(lambda q, i=i: all_derivatives(arm, q)[0][i], state.q)
        np.testing.assert_allclose(dH[i], first[:m], atol=1e-9)  # (67)
        np.testing.assert_allclose(first[m:], 0.0, atol=0.0)  # (67), coordinates above
        second = central_difference(lambda q, i=i: all_derivatives(arm, q)[1][i], state.q)
        np.testing.assert_allclose(d2H[i], second[:m], atol=1e-7)  # (69)
        np.testing.assert_allclose(d2H[i], d2H[i].swapaxes(0, 1), atol=1e-12)


def test_time_derivatives(arm: ref.Arm, state: State) -> None:
    q, qd, qdd = state.q, state.qd, state.qdd
    _, dH, d2H = all_derivatives(arm, q)
    H_dot = d.time_derivative(dH, qd)
    dH_dot = d.time_derivative_of_first(d2H, qd)
    H_ddot = d.second_time_derivative(dH, dH_dot, qd, qdd)

    def velocity(t: float) -> list[np.ndarray]:
        return d.time_derivative(all_derivatives(arm, q + qd * t + qdd * t**2 / 2)[1], qd + qdd * t)

    for i in range(3):
        poses = rate(lambda t, i=i: all_derivatives(arm, q + qd * t)[0][i])
        np.testing.assert_allclose(H_dot[i], poses, atol=1e-9)  # (70)
        firsts = rate(lambda t, i=i: all_derivatives(arm, q + qd * t)[1][i])
        np.testing.assert_allclose(dH_dot[i], firsts, atol=1e-8)  # (72)
        np.testing.assert_allclose(H_ddot[i], rate(lambda t, i=i: velocity(t)[i]), atol=1e-8)  # (73)


def test_partial_derivative_of_the_rate_by_lengths(arm: ref.Arm, state: State) -> None:
    qd = state.qd
    _, _, d2H = all_derivatives(arm, state.q)
    dH_dot = d.time_derivative_of_first(d2H, qd)
    for i in range(3):
        by_q = central_difference(lambda q, i=i: d.time_derivative(all_derivatives(arm, q)[1], qd)[i], state.q)
        np.testing.assert_allclose(dH_dot[i], by_q[: 3 * i + 3], atol=1e-8)  # (71)


def test_identity_of_the_derivatives_by_lengths_and_by_rates(arm: ref.Arm, state: State) -> None:
    """(40) and (63): dH/dq_j = dH'/dq_j', and the same for a point and for the rotation rate."""
    _, dH, _ = all_derivatives(arm, state.q)
    for i, section in enumerate(arm.sections):
        by_rate = central_difference(lambda qd, i=i: d.time_derivative(dH, qd)[i], state.qd, step=0.1)
        m = 3 * i + 3
        np.testing.assert_allclose(dH[i], by_rate[:m], atol=1e-12)
        r = section.homogeneous_center_of_mass
        np.testing.assert_allclose(d.position_derivative(dH[i], r), d.position_derivative(by_rate[:m], r), atol=1e-12)


def test_rotation_rate_is_the_axial_vector(arm: ref.Arm, state: State) -> None:
    """(23), (24): R' R^T is [w]x, and it moves every vector of the head with w x r."""
    kin = d.transformations(arm, state.q, state.qd)
    assert kin.H_dot is not None
    for H, H_dot in zip(kin.H, kin.H_dot, strict=True):
        w = rotation_rate(H, H_dot)
        skew = rotation_part(H_dot) @ rotation_part(H).T
        np.testing.assert_allclose(skew, -skew.T, atol=1e-13)
        vector = np.array([0.3, -0.2, 0.7])
        np.testing.assert_allclose(skew @ vector, np.cross(w, vector), atol=1e-13)
    np.testing.assert_array_equal(rate_operator(np.array([[0, -3, 2], [3, 0, -1], [-2, 1, 0]])), [1, 2, 3])
