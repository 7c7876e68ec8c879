"""Properties of the equations of motion, and each term against what it is derived from: T, U and virtual work."""

from __future__ import annotations

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from reference_states import State, central_difference, random_state, rate

import bha.reference
from bha import reference as ref
from bha.errors import InputError
from bha.reference import derivatives, dynamics, forces

ALL_SWITCHES = [(True, True), (True, False), (False, True), (False, False)]


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


@pytest.mark.parametrize("rotational_energy", [True, False])
def test_coriolis_matrix(arm: ref.Arm, state: State, rotational_energy: bool) -> None:
    arm = arm.with_options(rotational_energy=rotational_energy)
    q, qd = state.q, state.qd
    C = ref.coriolis_matrix(arm, q, qd)
    M_dot = rate(lambda t: ref.inertia_matrix(arm, q + qd * t))
    skew = M_dot - 2 * C
    scale = np.max(np.abs(C))
    np.testing.assert_allclose(skew, -skew.T, atol=1e-8 * scale)
    # Lagrange: C q' = dM/dt q' - dT/dq.
    dT = central_difference(lambda y: ref.energy(arm, y, qd).kinetic, q)
    assert relative(C @ qd, M_dot @ qd - dT) < 1e-8


def test_inertia_matrix_is_the_hessian_of_the_kinetic_energy(arm: ref.Arm, state: State) -> None:
    M = ref.inertia_matrix(arm, state.q)
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M).min() > 0
    assert ref.energy(arm, state.q, state.qd).kinetic == pytest.approx(state.qd @ M @ state.qd / 2, rel=1e-13)
    gradient = central_difference(lambda qd: np.array(ref.energy(arm, state.q, qd).kinetic), state.qd, step=0.1)
    np.testing.assert_allclose(M @ state.qd, gradient, rtol=1e-9, atol=1e-10)


def test_bias_force_of_gravity_and_bending_is_the_gradient_of_the_potential(arm: ref.Arm, state: State) -> None:
    kin = derivatives.transformations(arm, state.q)

    def potential(q: np.ndarray) -> np.ndarray:
        energy = ref.energy(arm, q, np.zeros(9))
        return np.array(energy.potential_gravity + energy.potential_bending)

    found = forces.potential_derivative(arm, kin)
    np.testing.assert_allclose(found, central_difference(potential, state.q), atol=1e-8)


def test_springs_derive_from_their_potential_with_work_conjugate(arm: ref.Arm, state: State) -> None:
    arm = arm.with_options(force_model="work_conjugate")
    found = ref.bias_force(arm, state.q, np.zeros(9))
    gradient = central_difference(lambda q: np.array(ref.energy(arm, q, np.zeros(9)).potential), state.q)
    np.testing.assert_allclose(found, gradient, rtol=1e-8, atol=1e-8)


def test_end_forces_do_the_virtual_work_of_forces_at_the_contact_points(arm: ref.Arm, state: State) -> None:
    """(17), (27), (53): F z_i at the contact points of head i, -F z_(i-1) at those of the head below."""
    F = np.random.default_rng(3).normal(0.0, 50.0, (3, 3))
    _, rotations = ref.forward_kinematics(arm, state.q)

    def contact_points(q: np.ndarray) -> np.ndarray:
        positions, turned = ref.forward_kinematics(arm, q)
        local = np.array([section.homogeneous_contact_points[:, :3] for section in arm.sections])
        return positions[:, None] + np.einsum("iab,ikb->ika", turned, local)

    dr = central_difference(contact_points, state.q)
    expected = np.zeros(9)
    for i in range(3):
        z = rotations[i, :, 2]
        for k in range(3):
            net = F[i, k] - (F[i + 1, k] if i < 2 else 0.0)
            expected += net * dr[:, i, k] @ z
    found = forces.generalized_bellows_force(arm, derivatives.transformations(arm, state.q), F)
    np.testing.assert_allclose(found, expected, atol=1e-7)


def test_force_models_coincide_at_the_straight_pose(arms: dict[str, ref.Arm]) -> None:
    """Where all radii are equal; otherwise (27) puts the force of a bellows at the radius of the head below."""
    tapered = arms["random_3"]
    sections = tuple(dataclasses.replace(section, bellows_radius=0.09) for section in tapered.sections)
    cylindrical = dataclasses.replace(tapered, sections=sections)
    q, p = np.repeat([0.15, 0.2, 0.25], 3), random_state(3, 5).p
    difference = {}
    for name, arm in (("tapered", tapered), ("cylindrical", cylindrical)):
        other = arm.with_options(force_model="work_conjugate")
        difference[name] = np.abs(ref.actuation_force(arm, q, p) - ref.actuation_force(other, q, p)).reshape(3, 3)
    assert difference["cylindrical"].max() < 1e-11
    assert difference["tapered"][:2].max() > 1.0
    assert difference["tapered"][2].max() < 1e-11


@pytest.mark.parametrize("force_model", ["end_force", "work_conjugate"])
def test_actuation_matrix(arm: ref.Arm, state: State, force_model: str) -> None:
    arm = arm.with_options(force_model=force_model)
    expected = ref.actuation_matrix(arm, state.q) @ (state.p - arm.ambient_pressure)
    np.testing.assert_allclose(ref.actuation_force(arm, state.q, state.p), expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize(("rotational_energy", "coriolis_forces"), ALL_SWITCHES)
def test_inverse_dynamics_undoes_forward_dynamics(
    arm: ref.Arm, state: State, rotational_energy: bool, coriolis_forces: bool
) -> None:
    arm = arm.with_options(rotational_energy=rotational_energy, coriolis_forces=coriolis_forces)
    qdd = ref.forward_dynamics(arm, state.q, state.qd, state.p, state.f_ext)
    tau = ref.inverse_dynamics(arm, state.q, state.qd, qdd, state.f_ext)
    assert relative(tau, ref.actuation_force(arm, state.q, state.p)) < 1e-10


def test_power_balance_with_work_conjugate(arm: ref.Arm, state: State) -> None:
    arm = arm.with_options(force_model="work_conjugate")
    q, qd = state.q, state.qd
    qdd = ref.forward_dynamics(arm, q, qd, state.p, state.f_ext)
    change = rate(lambda t: np.array(ref.energy(arm, q + qd * t, qd + qdd * t).total))
    pressure_power = forces.actuation_bellows_forces(arm, state.p).reshape(-1) @ qd
    dissipation = sum(
        s.damping * float(qd[3 * i : 3 * i + 3] @ qd[3 * i : 3 * i + 3]) for i, s in enumerate(arm.sections)
    )
    H_dot = derivatives.transformations(arm, q, qd).H_dot
    assert H_dot is not None
    velocities = [
        derivatives.position_derivative(h, s.homogeneous_center_of_mass)
        for h, s in zip(H_dot, arm.sections, strict=True)
    ]
    external_power = float(np.sum(state.f_ext * velocities))
    assert change == pytest.approx(pressure_power + external_power - dissipation, rel=1e-7)


def test_external_forces_in_head_frames(arm: ref.Arm, state: State) -> None:
    """(28)."""
    _, rotations = ref.forward_kinematics(arm, state.q)
    turned = forces.external_forces_in_base_frame(derivatives.transformations(arm, state.q), state.f_ext)
    np.testing.assert_allclose(turned, np.einsum("nij,nj->ni", rotations, state.f_ext), atol=1e-14)


def test_planar_state_stays_planar(arms: dict[str, ref.Arm]) -> None:
    rng = np.random.default_rng(7)

    def mirrored(low: float, high: float) -> np.ndarray:
        values = rng.uniform(low, high, (3, 3))
        values[:, 2] = values[:, 1]
        return values.reshape(-1)

    q, qd, p = mirrored(0.1, 0.3), mirrored(-0.3, 0.3), mirrored(0.7e5, 2.2e5)
    qdd = ref.forward_dynamics(arms["bha_nominal"], q, qd, p).reshape(3, 3)
    np.testing.assert_allclose(qdd[:, 1], qdd[:, 2], rtol=1e-10)


def test_shared_kinematics_and_single_functions_agree(arm: ref.Arm, state: State) -> None:
    terms = ref.dynamics_terms(arm, state.q, state.qd, state.p, state.f_ext)
    np.testing.assert_array_equal(terms.inertia_matrix, ref.inertia_matrix(arm, state.q))
    np.testing.assert_array_equal(terms.coriolis_matrix, ref.coriolis_matrix(arm, state.q, state.qd))
    np.testing.assert_array_equal(terms.bias_force, ref.bias_force(arm, state.q, state.qd, state.f_ext))
    np.testing.assert_array_equal(terms.actuation_force, ref.actuation_force(arm, state.q, state.p))


def test_matrix_form_of_the_sums(arm: ref.Arm, state: State) -> None:
    """(49)-(51) entry by entry are sums of m J^T J over the sections."""
    kin = derivatives.transformations(arm, state.q, state.qd)
    M, C = np.zeros((9, 9)), np.zeros((9, 9))
    for terms in dynamics.mass_terms(arm, kin):
        m = len(terms.dr)
        assert terms.w is not None
        M[:m, :m] += terms.mass * terms.dr @ terms.dr.T + terms.w @ terms.Jw.T
        C[:m, :m] += terms.mass * terms.dr @ terms.dr_dot.T + terms.w @ terms.Jw_dot.T
    np.testing.assert_allclose(ref.inertia_matrix(arm, state.q), M, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(ref.coriolis_matrix(arm, state.q, state.qd), C, rtol=1e-12, atol=1e-12)


def test_reductions_skip_the_work_they_save(arm: ref.Arm, state: State, monkeypatch: pytest.MonkeyPatch) -> None:
    def not_wanted(*_: object) -> None:
        raise AssertionError("a reduced model computed what it leaves out")

    reduced = arm.with_options(rotational_energy=False, coriolis_forces=False)
    expected = ref.forward_dynamics(reduced, state.q, state.qd, state.p)
    monkeypatch.setattr(derivatives, "second_derivatives", not_wanted)
    monkeypatch.setattr(derivatives, "local_second_derivatives", not_wanted)
    monkeypatch.setattr(dynamics, "rotation_rate", not_wanted)
    monkeypatch.setattr(dynamics, "coriolis_matrix_from", not_wanted)
    np.testing.assert_array_equal(ref.forward_dynamics(reduced, state.q, state.qd, state.p), expected)
    assert not ref.coriolis_matrix(reduced, state.q, state.qd).any()
    with pytest.raises(AssertionError, match="leaves out"):
        ref.forward_dynamics(arm, state.q, state.qd, state.p)


def test_rotational_energy_switch(arm: ref.Arm, state: State) -> None:
    full = ref.energy(arm, state.q, state.qd)
    reduced = ref.energy(arm.with_options(rotational_energy=False), state.q, state.qd)
    assert full.kinetic_rotational > 0
    assert reduced.kinetic_rotational == 0
    assert reduced.total == pytest.approx(full.total - full.kinetic_rotational, rel=1e-14)


def test_bad_arguments_are_named(arm: ref.Arm, state: State) -> None:
    with pytest.raises(InputError, match=r"q: found shape \(8,\), needed is \(9,\)"):
        ref.inertia_matrix(arm, state.q[:8])
    with pytest.raises(InputError, match="qd: found values that are not finite"):
        ref.forward_dynamics(arm, state.q, np.full(9, np.nan), state.p)
    with pytest.raises(InputError, match=r"f_ext: found shape \(9,\), needed is \(3, 3\)"):
        ref.bias_force(arm, state.q, state.qd, np.zeros(9))


def test_shares_nothing_with_the_compiled_model() -> None:
    allowed = {"bha.errors", "bha.reference"}
    for path in Path(bha.reference.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, path
                names = [node.module or ""]
            for name in names:
                if name.split(".")[0] == "bha":
                    assert ".".join(name.split(".")[:2]) in allowed, f"{path.name} imports {name}"
