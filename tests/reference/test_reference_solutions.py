"""Statics and time integration of the reference model."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from reference_states import random_state
from scipy.integrate import solve_ivp

from bha import reference as ref
from bha.errors import ConvergenceError, InputError, SimulationError


@pytest.fixture
def nominal(arms: dict[str, ref.Arm]) -> ref.Arm:
    return arms["bha_nominal"]


@pytest.fixture
def one_section(arms: dict[str, ref.Arm]) -> ref.Arm:
    return arms["random_1"]


@pytest.mark.parametrize("force_model", ["end_force", "work_conjugate"])
@pytest.mark.parametrize("seed", range(3))
def test_static_coupled(nominal: ref.Arm, force_model: str, seed: int) -> None:
    arm = nominal.with_options(force_model=force_model)
    rng = np.random.default_rng(seed)
    p, f_ext = rng.uniform(1.0e5, 1.5e5, 9), rng.normal(0.0, 0.5, (3, 3))
    q = ref.static_lengths(arm, p, f_ext)
    np.testing.assert_allclose(ref.static_residual(arm, q, p, f_ext), 0.0, atol=1e-7)
    # A pose held by its pressures does not accelerate.
    np.testing.assert_allclose(ref.forward_dynamics(arm, q, np.zeros(9), p, f_ext), 0.0, atol=1e-3)


def test_static_models_agree_where_nothing_couples(nominal: ref.Arm) -> None:
    """Equal pressures, no gravity: straight sections, each bellows against its own spring."""
    arm = dataclasses.replace(nominal, gravity=(0.0, 0.0, 0.0))
    p = np.repeat([1.1e5, 1.3e5, 1.2e5], 3)
    decoupled = ref.decoupled_static_lengths(arm, p)
    np.testing.assert_allclose(ref.static_lengths(arm, p, q_start=decoupled + 0.01), decoupled, rtol=1e-9)
    np.testing.assert_allclose(ref.decoupled_static_lengths(arm, np.full(9, arm.ambient_pressure)), 0.15, rtol=1e-12)


def test_static_models_say_when_there_is_no_pose(nominal: ref.Arm) -> None:
    softening = dataclasses.replace(nominal.sections[0], stiffness=(100.0, -1000.0))
    sections = (softening, *nominal.sections[1:])
    arm = dataclasses.replace(nominal, sections=sections, force_model="work_conjugate")
    with pytest.raises(ConvergenceError, match="section 1 cannot balance"):
        ref.decoupled_static_lengths(arm, np.full(9, 2.0e5))
    with pytest.raises(ConvergenceError, match="no pose found"):
        ref.static_lengths(arm, np.full(9, 2.0e5), q_start=np.full(9, 0.15))


def swing(arm: ref.Arm) -> tuple[np.ndarray, np.ndarray, ref.simulation.PressureFunction]:
    start = random_state(arm.section_count, 11)
    q0 = np.clip(start.q, 0.15, 0.2)

    def pressure(t: float) -> np.ndarray:
        return arm.ambient_pressure + 2e4 * np.sin(20 * t + np.arange(3 * arm.section_count))

    return q0, 0.1 * start.qd, pressure


def test_rk4_has_order_four_and_agrees_with_dop853(one_section: ref.Arm) -> None:
    arm = one_section
    q0, qd0, pressure = swing(arm)
    f = ref.right_hand_side(arm, pressure)
    end = 0.05
    exact = solve_ivp(f, (0.0, end), np.concatenate([q0, qd0]), method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    errors = []
    for n in (20, 40):
        run = ref.simulate_rk4(arm, q0, qd0, pressure, end / n, n)
        assert run.t.shape == (n + 1,)
        assert run.q.shape == run.qd.shape == (n + 1, 3)
        errors.append(np.max(np.abs(np.concatenate([run.q[-1], run.qd[-1]]) - exact)))
    assert errors[1] < 1e-5
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)


def test_energy_is_kept_without_damping_and_pressure(one_section: ref.Arm) -> None:
    section = dataclasses.replace(one_section.sections[0], damping=0.0)
    arm = dataclasses.replace(one_section, sections=(section,), force_model="work_conjugate")
    q0, qd0, _ = swing(arm)
    run = ref.simulate_rk4(arm, q0, qd0, lambda _: np.full(3, arm.ambient_pressure), 5e-4, 200)
    energies = [ref.energy(arm, q, qd).total for q, qd in zip(run.q, run.qd, strict=True)]
    assert np.ptp(energies) < 1e-6 * ref.energy(arm, q0, qd0).kinetic + 1e-6 * abs(energies[0])
    assert np.ptp(run.q[:, 0]) > 1e-3


def test_external_force_enters_the_simulation(one_section: ref.Arm) -> None:
    q0, qd0, pressure = swing(one_section)
    force = np.array([[1.0, -2.0, 0.5]])
    run = ref.simulate_rk4(one_section, q0, qd0, pressure, 1e-6, 1, lambda _: force)
    expected = ref.forward_dynamics(one_section, q0, qd0, pressure(0.0), force)
    np.testing.assert_allclose((run.qd[1] - qd0) / 1e-6, expected, rtol=1e-3)


def test_divergence_ends_in_an_error_that_keeps_the_trajectory(one_section: ref.Arm) -> None:
    q0, qd0, pressure = swing(one_section)
    with pytest.raises(SimulationError, match="diverged after t = ") as caught:
        ref.simulate_rk4(one_section, q0, qd0, pressure, 0.5, 100)
    kept = caught.value.trajectory
    assert kept.t[-1] == caught.value.time
    assert 1 <= len(kept.t) < 100
    assert np.isfinite(kept.q).all()


def test_wrong_steps_are_refused(one_section: ref.Arm) -> None:
    q0, qd0, pressure = swing(one_section)
    with pytest.raises(InputError, match="dt, n_steps"):
        ref.simulate_rk4(one_section, q0, qd0, pressure, 0.0, 10)
    with pytest.raises(InputError, match="q0: found shape"):
        ref.simulate_rk4(one_section, q0[:2], qd0, pressure, 1e-3, 10)
