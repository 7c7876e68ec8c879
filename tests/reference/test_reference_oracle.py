"""The reference against values from automatic differentiation of T, U and the virtual work (70 states, 5 arms)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bha import reference as ref

TOLERANCE = 1e-9
CASES = range(70)


def assert_close(found: Any, expected: Any) -> None:
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=TOLERANCE * np.max(np.abs(expected)))


def case_of(oracle: dict[str, Any], arms: dict[str, ref.Arm], index: int) -> tuple[ref.Arm, dict[str, Any]]:
    case = oracle["cases"][index]
    values = {key: np.array(case[key]) for key in ("q", "qd", "p")}
    _, rotations = ref.forward_kinematics(arms[case["arm"]], values["q"])
    # The oracle gives external forces in the head frames.
    values["f_ext"] = np.einsum("nij,nj->ni", rotations, np.array(case["f_ext"]))
    return arms[case["arm"]], case | values


def test_every_oracle_case_is_tested(oracle: dict[str, Any]) -> None:
    assert len(oracle["cases"]) == len(CASES)


@pytest.mark.parametrize("index", CASES)
def test_terms_and_accelerations(oracle: dict[str, Any], arms: dict[str, ref.Arm], index: int) -> None:
    arm, case = case_of(oracle, arms, index)
    state = case["q"], case["qd"], case["p"], case["f_ext"]
    for force_model in ("end_force", "work_conjugate"):
        model = arm.with_options(force_model=force_model)
        terms = ref.dynamics_terms(model, *state)
        assert_close(terms.inertia_matrix, case["M"])
        assert_close(terms.coriolis_matrix @ case["qd"], case["C_qd"])
        assert_close(terms.bias_force, case["N"][force_model])
        assert_close(terms.actuation_force, case["tau"][force_model])
        assert_close(ref.forward_dynamics(model, *state), case["qdd"][force_model])


@pytest.mark.parametrize("index", CASES)
def test_reduced_model(oracle: dict[str, Any], arms: dict[str, ref.Arm], index: int) -> None:
    arm, case = case_of(oracle, arms, index)
    reduced = arm.with_options(rotational_energy=False, coriolis_forces=False)
    assert_close(ref.inertia_matrix(reduced, case["q"]), case["M_translational"])
    qdd = ref.forward_dynamics(reduced, case["q"], case["qd"], case["p"], case["f_ext"])
    assert_close(qdd, case["qdd_reduced"]["end_force"])


@pytest.mark.parametrize("index", CASES)
def test_energies_and_poses(oracle: dict[str, Any], arms: dict[str, ref.Arm], index: int) -> None:
    arm, case = case_of(oracle, arms, index)
    energy = ref.energy(arm, case["q"], case["qd"])
    assert_close(energy.kinetic_translational, case["kinetic_translational"])
    assert_close(energy.kinetic_rotational, case["kinetic_rotational"])
    assert_close(energy.total, case["energy"])
    positions, rotations = ref.forward_kinematics(arm, case["q"])
    assert_close(positions, case["head_positions"])
    assert_close(rotations, case["head_rotations"])
