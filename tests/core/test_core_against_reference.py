"""Core and reference share no code; they must agree at random states to 1e-10, straight ones included.

Arms as in the paper, and arms somewhere in the world whose sections are of several arcs, taper and carry masses.
"""

from __future__ import annotations

import numpy as np
import pytest
from random_arms import Array, Case, random_cases

from bha import reference as ref

#: Another seed now and then, by hand.
SEED = 20151202
TOLERANCE = 1e-10


def distance(found: Array, expected: Array) -> float:
    """Largest difference relative to the largest expected value."""
    return float(np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-12))


@pytest.fixture(scope="module", params=[False, True], ids=["as in the paper", "varied"])
def cases(request: pytest.FixtureRequest) -> list[Case]:
    return random_cases(SEED, 1000, varied=request.param)


def test_terms_and_dynamics(cases: list[Case]) -> None:
    for case in cases:
        state = (case.q, case.qd, case.p, case.f_ext)
        core, expected = case.core.dynamics_terms(*state), ref.dynamics_terms(case.reference, *state)
        qdd = ref.forward_dynamics(case.reference, *state)
        heads, expected_heads = case.core.forward_kinematics(case.q), ref.forward_kinematics(case.reference, case.q)
        energy, expected_energy = case.core.energy(case.q, case.qd), ref.energy(case.reference, case.q, case.qd)
        pairs = {
            "M": (core.inertia_matrix, expected.inertia_matrix),
            "C q'": (core.coriolis_matrix @ case.qd, expected.coriolis_matrix @ case.qd),
            "N": (core.bias_force, expected.bias_force),
            "tau": (core.actuation_force, expected.actuation_force),
            "q''": (case.core.forward_dynamics(*state), qdd),
            "tau needed": (
                case.core.inverse_dynamics(case.q, case.qd, qdd, case.f_ext),
                ref.inverse_dynamics(case.reference, case.q, case.qd, qdd, case.f_ext),
            ),
            "heads": (heads[0], expected_heads[0]),
            "orientations": (heads[1], expected_heads[1]),
            "kinetic energy": (np.array(energy.kinetic), np.array(expected_energy.kinetic)),
            "potential energy": (np.array(energy.potential), np.array(expected_energy.potential)),
        }
        for name, (found, wanted) in pairs.items():
            assert distance(found, wanted) < TOLERANCE, name


def test_actuation_matrix(cases: list[Case]) -> None:
    for case in cases[::10]:
        expected = ref.actuation_matrix(case.reference, case.q)
        assert distance(case.core.actuation_matrix(case.q), expected) < TOLERANCE


def test_reductions(cases: list[Case]) -> None:
    for case in cases[::20]:
        for rotational_energy, coriolis_forces in [(False, True), (True, False), (False, False)]:
            switches = {"rotational_energy": rotational_energy, "coriolis_forces": coriolis_forces}
            state = (case.q, case.qd, case.p, case.f_ext)
            found = case.core.with_changes(**switches).forward_dynamics(*state)
            expected = ref.forward_dynamics(case.reference.with_options(**switches), *state)
            # Without rotational energy short nearly straight sections are close to singular: both lose the same digits.
            assert distance(found, expected) < 1e-8, switches


def test_bias_force_parts_add_up(cases: list[Case]) -> None:
    for case in cases[::10]:
        parts = case.core.bias_force_parts(case.q, case.qd, case.f_ext)
        assert list(parts) == ["spring", "damping", "axial", "bending", "gravity", "external", "effects"]
        assert (
            distance(sum(parts.values(), np.zeros(len(case.q))), case.core.bias_force(case.q, case.qd, case.f_ext))
            < 1e-12
        )


def test_statics(cases: list[Case]) -> None:
    found = 0
    for case in cases[::20]:
        p = 1.05e5 + 0.1 * (case.p - 1.05e5)
        q = case.core.static_lengths(p)
        at_rest = case.core.forward_dynamics(q, np.zeros_like(q), p)
        assert np.abs(at_rest).max() < 1e-5
        decoupled = case.core.static_lengths(p, coupled=False)
        np.testing.assert_allclose(decoupled, ref.decoupled_static_lengths(case.reference, p), rtol=0, atol=1e-10)
        found += 1
    assert found == 50
