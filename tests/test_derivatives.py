"""Derivatives against differences of order 8, over states, parameters, effects and trajectories."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha import _core
from bha.arm.derivatives import difference_arms
from bha.parameters import paths

Array = NDArray[np.float64]


def difference(f: Callable[[float], Array], reach: float) -> Array:
    weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    terms = [w * (f((k + 1) * reach) - f(-(k + 1) * reach)) for k, w in enumerate(weights)]
    return np.asarray(sum(terms[1:], terms[0])) / reach


def states(arm: bha.Arm, count: int) -> list[tuple[Array, Array, Array]]:
    rng = np.random.default_rng(11)
    n, m = 3 * arm.section_count, len(arm.inputs)
    return [
        (
            rng.uniform(0.12, 0.28, n),
            rng.choice([-1.0, 1.0], n) * rng.uniform(0.05, 0.4, n),  # away from the kinks of one-sided laws
            rng.uniform(0.8e5, 2e5, m),
        )
        for _ in range(count)
    ] + [(np.full(n, 0.2), np.zeros(n), np.full(m, 1.2e5))]


EFFECTS = (
    {"kind": "quadratic_damping", "where": "section 2", "damping": 20.0},
    {"kind": "base_tilt", "where": "all", "about_x": 0.1, "about_y": -0.05},
    {"kind": "bending_damping", "where": "section 2", "damping": 0.1},
)


def arms() -> dict[str, bha.Arm]:
    nominal = bha.robots.load("bha_nominal")
    return {
        "nominal": nominal,
        "work_conjugate": nominal.with_changes(force_model="work_conjugate", gravity=(1.0, 2.0, 9.0)),
        "reduced": nominal.with_changes(rotational_energy=False, coriolis_forces=False),
        "effects": nominal.with_effects(EFFECTS),
    }


@pytest.mark.parametrize("name", list(arms()))
def test_by_state_and_pressure(name: str) -> None:
    arm = arms()[name]
    n = 3 * arm.section_count
    for q, qd, p in states(arm, 3):
        found = arm.forward_dynamics_derivatives(q, qd, p)
        acceleration = arm.forward_dynamics(q, qd, p)
        size = np.abs(acceleration).max()
        np.testing.assert_allclose(found.acceleration, acceleration, rtol=0, atol=1e-11 * size)
        whole = np.concatenate([q, qd, p])
        if name == "effects" and not qd.any():
            # |q'| q' has no third derivative at rest, so differences of order 8 are wrong there; its first one is 0.
            plain = arms()["nominal"].with_effects([e for e in EFFECTS if e["kind"] != "quadratic_damping"])
            at_rest = plain.forward_dynamics_derivatives(q, qd, p)
            np.testing.assert_allclose(found.by_velocities, at_rest.by_velocities, rtol=1e-12)
            continue

        def along(k: int, reach: float, whole: Array = whole) -> Array:
            unit = np.eye(len(whole))[k]

            def at(h: float) -> Array:
                x = whole + h * unit
                return arm.forward_dynamics(x[:n], x[n : 2 * n], x[2 * n :])

            return difference(at, reach)

        blocks = ((found.by_lengths, 0, 1e-3), (found.by_velocities, n, 1e-2), (found.by_pressures, 2 * n, 1e4))
        for block, first, reach in blocks:
            expected = np.column_stack([along(first + k, reach) for k in range(block.shape[1])])
            rounding = 1e-13 * size / reach
            np.testing.assert_allclose(block, expected, rtol=0, atol=1e-9 * np.abs(block).max() + rounding)


#: More than one pass takes; all of them move every arm above.
SOME_PARAMETERS = ("gravity.x", "gravity.z", "section.1.mass", "section.1.stiffness.1", "section.2.head_offset")
SOME_PARAMETERS += ("section.2.damping", "section.2.center_of_mass.x", "section.3.terminal_area")
SOME_PARAMETERS += ("section.3.base_offset", "section.3.bending_stiffness.1", "section.3.stiffness.2")


@pytest.mark.parametrize("instruction_set", [s for s in _core.instruction_sets() if s != "scalar"])
@pytest.mark.parametrize("name", list(arms()))
def test_the_same_with_every_instruction_set(name: str, instruction_set: str) -> None:
    arm = arms()[name].with_effects(
        [*arms()[name].parameters.effects, {"kind": "pressure_gain", "where": "all", "gain": 0.02}]
    )
    differences = [difference_arms(arm.parameters, path, arm.with_parameters) for path in SOME_PARAMETERS]
    scalar = _core.Differentiator(arm, differences, "scalar")
    in_lanes = _core.Differentiator(arm, differences, instruction_set)
    rng = np.random.default_rng(4)
    for q, qd, p in states(arm, 2):
        f_ext = rng.uniform(-1.0, 1.0, (arm.section_count, 3))
        lanes, alone = in_lanes(q, qd, p, f_ext), scalar(q, qd, p, f_ext)
        for found, expected in ((lanes.acceleration, alone.acceleration), (lanes.rows, alone.rows)):
            size = np.abs(expected).max(axis=-1, keepdims=True)
            assert (np.abs(found - expected) <= 1e-12 * size).all()


@pytest.mark.parametrize("name", ["nominal", "effects"])
def test_by_every_parameter(name: str) -> None:
    """Differences with another step than the package's own; those of order 8 agree to rounding."""
    arm = arms()[name]
    names = bha.parameter_names(arm)
    assert "section.2.mass" in names
    assert "gravity.x" in names
    q, qd, p = states(arm, 1)[0]
    found = arm.forward_dynamics_derivatives(q, qd, p, parameters=names)
    assert found.by_parameters.shape == (len(q), len(names))
    for k, path in enumerate(names):
        value = paths.get_value(arm.parameters, path)
        if value == 0.0 and not path.startswith("gravity"):
            continue  # at the end of its range: one-sided, tested by its continuity below

        def at(h: float, path: str = path, value: float = value) -> Array:
            return bha.Arm(paths.with_values(arm.parameters, {path: value + h})).forward_dynamics(q, qd, p)

        reach = 5e-3 * abs(value) or 1e-2
        expected = difference(at, reach)
        rounding = 1e-14 * np.abs(found.acceleration).max() / reach
        tolerance = 1e-8 * np.abs(expected).max() + 100.0 * rounding
        np.testing.assert_allclose(found.by_parameters[:, k], expected, rtol=0, atol=tolerance, err_msg=path)


def test_at_the_end_of_a_range(nominal: bha.Arm) -> None:
    """A damping of zero has a derivative to one side: the same as that just above."""
    path = "section.1.damping"
    q, qd, p = states(nominal, 1)[0]

    def derivative(value: float) -> Array:
        arm = bha.Arm(paths.with_values(nominal.parameters, {path: value}))
        return arm.forward_dynamics_derivatives(q, qd, p, parameters=[path]).by_parameters[:, 0]

    np.testing.assert_allclose(derivative(0.0), derivative(1.0), rtol=1e-7)


def test_linearize(nominal: bha.Arm) -> None:
    q, qd, p = states(nominal, 1)[0]
    a, b = nominal.linearize(q, qd, p)
    found = nominal.forward_dynamics_derivatives(q, qd, p)
    n = len(q)
    np.testing.assert_array_equal(a[:n], np.hstack([np.zeros((n, n)), np.eye(n)]))
    np.testing.assert_array_equal(a[n:], np.hstack([found.by_lengths, found.by_velocities]))
    np.testing.assert_array_equal(b, np.vstack([np.zeros((n, len(p))), found.by_pressures]))
    rest = nominal.static_lengths(p)
    a, _ = nominal.linearize(rest, np.zeros(n), p)
    assert np.linalg.eigvals(a).real.max() < 0.0


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_sensitivities_of_a_trajectory(nominal: bha.Arm, method: str) -> None:
    rng = np.random.default_rng(2)
    pressures = 101_325.0 + rng.uniform(0.0, 0.6e5, (5, len(nominal.inputs)))
    drive = bha.Input(np.linspace(0.0, 0.2, 5), pressures)
    n = 3 * nominal.section_count
    x0 = np.concatenate([nominal.static_lengths(pressures[0]), rng.uniform(-0.1, 0.1, n)])
    times = np.array([0.0, 0.05, 0.2])
    # Adaptive steps change with the parameters: tight, so that the trajectory does not.
    options = bha.Options(method=method, step=2e-3, rtol=1e-11, atol=1e-13)  # type: ignore[arg-type]
    names = ("section.2.mass", "section.1.stiffness.1", "gravity.x", "section.3.bellows_radius")
    by_x = rng.normal(size=(2 * n, len(names))) * 1e-3
    found = bha.sensitivities(nominal, drive, x0, times=times, parameters=names, x0_by_parameters=by_x, options=options)
    assert found.by_initial_state.shape == (3, 2 * n, 2 * n)
    np.testing.assert_array_equal(found.by_initial_state[0], np.eye(2 * n))

    def run(arm: bha.Arm, x: Array) -> Array:
        rows = bha.Simulation(arm, drive, options, q0=x[:n], qd0=x[n:]).advance(times)
        return np.hstack([rows.lengths, rows.velocities])

    # At these tolerances the step sizes of dopri5 are chosen by rounding, which is another over dual numbers.
    same, tolerance = (1e-11, 1e-8) if method == "rk4" else (1e-9, 1e-6)
    np.testing.assert_allclose(found.states, run(nominal, x0), rtol=0, atol=same)
    for k in (0, 4, n + 1, 2 * n - 1):
        unit = np.eye(2 * n)[k]
        expected = difference(lambda h, e=unit: run(nominal, x0 + h * e), 1e-3)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found.by_initial_state[:, :, k], expected, rtol=0, atol=tolerance * scale)
    for k, path in enumerate(names):
        value = paths.get_value(nominal.parameters, path)

        def at(h: float, k: int = k, path: str = path, value: float = value) -> Array:
            arm = bha.Arm(paths.with_values(nominal.parameters, {path: value + h}))
            return run(arm, x0 + h * by_x[:, k])

        expected = difference(at, 4e-3 * abs(value) or 1e-2)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found.by_parameters[:, :, k], expected, rtol=0, atol=tolerance * scale, err_msg=path)


def test_wrong_arguments(nominal: bha.Arm) -> None:
    q, qd, p = states(nominal, 1)[0]
    with pytest.raises(bha.ParameterError, match=r"no parameter 'section\.2\.mas'"):
        nominal.forward_dynamics_derivatives(q, qd, p, parameters=["section.2.mas"])
    with pytest.raises(bha.InputError, match="q: expected shape"):
        nominal.forward_dynamics_derivatives(q[1:], qd, p)
    drive = bha.Input.constant(p, 1.0)
    with pytest.raises(bha.InputError, match="x0_by_parameters: expected shape"):
        bha.sensitivities(nominal, drive, np.hstack([q, qd]), times=[0.1], x0_by_parameters=np.zeros((2, 2)))
    with pytest.raises(bha.InputError, match="output times must ascend"):
        bha.sensitivities(nominal, drive, np.hstack([q, qd]), times=[0.1, 0.0])


@pytest.fixture(scope="module")
def nominal() -> bha.Arm:
    return bha.robots.load("bha_nominal")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_child_has_threads_of_its_own(in_child: Callable[[Callable[[], bytes]], bytes]) -> None:
    arm = bha.robots.load("bha_nominal")
    source, x0 = bha.Input.constant(np.full(9, 1.2e5), 0.1), np.r_[np.full(9, 0.19), np.zeros(9)]

    def derivatives() -> NDArray[np.float64]:
        found = bha.sensitivities(arm, source, x0, times=[0.0, 0.1], parameters=["section.1.mass"])
        return found.by_parameters

    before = derivatives()
    assert in_child(lambda: derivatives().tobytes()) == before.tobytes()
