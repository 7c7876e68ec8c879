"""Stiff arms by default settings, and clocks that start anywhere."""

from __future__ import annotations

import signal
import threading

import numpy as np
import pytest
from random_arms import Array

import bha
from bha.parameters import ArmParameters

NOMINAL = bha.robots.load("bha_nominal")
DAMPED = bha.robots.load("asu_two_section")
STIFF = {name: bha.robots.load(f"asu_two_section_{name}") for name in ("january", "april")}
LIGHT = {
    "schema": "bha-arm/1",
    "name": "light",
    "gravity": [0.0, 0.0, 9.81],
    "ambient_pressure": 101325.0,
    "section": [
        {
            "mass": 0.43,
            "center_of_mass": [0.0, 0.0, 0.0],
            "bellows_radius": 0.04,
            "bellows_outer_radius": 0.02,
            "terminal_area": 2e-4,
            "rest_length": 0.29,
            "stiffness": [50.0],
            "damping": 3.0,
            "bending_stiffness": [0.15],
            "length_range": [0.15, 0.6],
            "pressure_range": [101325.0, 131325.0],
            "bellows": [{"angle_deg": 90.0 * k, "input": f"p1{k + 1}"} for k in range(4)],
        }
    ],
}
VALVES = bha.robots.parameters("bha_nominal").to_mapping()["pneumatics"]


def light(level: str = "ideal") -> bha.Arm:
    return bha.Arm(ArmParameters.from_mapping({**LIGHT, "pneumatics": {**VALVES, "level": level}}))


def driven(arm: bha.Arm, end: float = 1.0, span: float = 2e4, seed: int = 3) -> bha.Input:
    """Samples of 100 Hz: sines with the noise of sensors, and a jump."""
    t = np.arange(0.0, end, 0.01)
    n = len(arm.inputs)
    p = 1.05e5 + span * (0.5 - 0.5 * np.cos(np.multiply.outer(t, 2.0 + np.arange(n))))
    p[len(t) // 2 :, 0] += 0.1 * span
    return bha.Input(t, p + np.random.default_rng(seed).normal(0.0, 50.0, p.shape))


def tight(arm: bha.Arm, drive: bha.Input, **options: object) -> bha.Trajectory:
    chosen = bha.Options("rodas4", rtol=1e-9, atol=1e-11, **options)  # type: ignore[arg-type]
    return bha.simulate(arm, drive, options=chosen)


def test_the_method_suits_the_arm() -> None:
    for arm in (NOMINAL, DAMPED, light()):
        assert bha.Simulation(arm, driven(arm, span=5e3)).method == "dopri5"
    for arm in STIFF.values():
        assert bha.Simulation(arm, driven(arm)).method == "rodas4"
    for name in ("dopri5", "rodas4", "rk4", "ros2"):
        options = bha.Options(name)  # type: ignore[arg-type]
        assert bha.Simulation(STIFF["april"], driven(STIFF["april"]), options).method == name


@pytest.mark.parametrize("name", STIFF)
def test_stiff_arms_by_default_settings(name: str) -> None:
    """As exact as asked for, against a tight run and another method, in few steps."""
    arm = STIFF[name]
    drive = driven(arm)
    run, exact = bha.simulate(arm, drive), tight(arm, drive)
    other = bha.simulate(arm, drive, method="ros2", step=2e-5)
    np.testing.assert_allclose(exact.lengths, other.lengths, rtol=0, atol=2e-8)
    np.testing.assert_allclose(run.lengths, exact.lengths, rtol=0, atol=2e-7)
    np.testing.assert_allclose(run.velocities, exact.velocities, rtol=0, atol=2e-5)
    assert run.statistics["steps"] < 500


@pytest.mark.parametrize("level", ["ideal", "lag", "full"])
def test_a_light_arm_with_pneumatics(level: str) -> None:
    arm = light(level)
    drive = driven(arm, span=1e4)
    run = bha.simulate(arm, drive)
    fine = bha.simulate(arm, drive, options=bha.Options("rk4", step=1e-4))
    np.testing.assert_allclose(run.lengths, fine.lengths, rtol=0, atol=2e-5 if level == "full" else 2e-6)
    np.testing.assert_allclose(run.pressures, fine.pressures, rtol=0, atol=50.0 if level == "full" else 1.0)


EFFECTS = {
    "friction": [{"kind": "friction", "where": "all", "coulomb_force": 2.0}],
    "hysteresis": [{"kind": "hysteresis", "where": "all", "amplitude": 3.0, "yield": 2e-3}],
    "creep": [{"kind": "creep", "where": "all", "stiffness": 400.0, "tau": 0.3}],
    "lag and delay": [
        {"kind": "delay", "where": "all", "time": 0.013},
        {"kind": "pressure_lag", "where": "all", "fill": 0.05, "vent": 0.1},
    ],
}


@pytest.mark.parametrize("effects", EFFECTS)
def test_hidden_states_of_stiff_arms(effects: str) -> None:
    """They are advanced beside the integrator, by its steps."""
    arm = DAMPED.with_effects(EFFECTS[effects])
    drive = driven(arm)
    run = bha.simulate(arm, drive, method="rodas4")
    fine = bha.simulate(arm, drive, options=bha.Options("rk4", step=1e-4))
    travel = np.ptp(fine.lengths, axis=0).max()
    assert np.abs(run.lengths - fine.lengths).max() < 2e-3 * travel


@pytest.mark.parametrize("method", ["auto", "rodas4", "rk4", "ros2"])
@pytest.mark.parametrize("epoch", [1.7e9, 1.7e12, -5.0])
def test_time_counts_from_the_first_sample(method: str, epoch: float) -> None:
    """A clock that starts elsewhere, be it so far off that it has few digits left, changes nothing."""
    time = epoch + np.arange(40) * 0.025
    p = driven(NOMINAL, 0.4).pressures
    options = bha.Options(method)  # type: ignore[arg-type]
    there = bha.simulate(NOMINAL, bha.Input(time, p), times=time, options=options)
    here = bha.simulate(NOMINAL, bha.Input(time - time[0], p), times=time - time[0], options=options)
    np.testing.assert_array_equal(there.time, time)
    np.testing.assert_allclose(there.lengths, here.lengths, rtol=0, atol=1e-12)
    batch = bha.simulate_batch(NOMINAL, bha.Input(time, p), times=time, method=method)  # type: ignore[arg-type]
    np.testing.assert_allclose(batch.lengths[0], here.lengths, rtol=0, atol=1e-7)


def test_errors_and_formulas_keep_the_callers_clock() -> None:
    formula = [{"kind": "formula", "where": "all", "force": "5 * tanh(9 * (t - 1000.2))"}]
    arm = NOMINAL.with_effects(formula)
    zero = NOMINAL.with_effects([{**formula[0], "force": "5 * tanh(9 * (t - 0.2))"}])
    drive = driven(arm, 0.5)
    later = bha.Input(drive.time + 1000.0, drive.pressures)
    q0 = NOMINAL.static_lengths(drive.pressures[0])
    found = bha.simulate(arm, later, q0=q0)
    np.testing.assert_allclose(found.lengths, bha.simulate(zero, drive, q0=q0).lengths, rtol=0, atol=2e-6)
    with pytest.raises(bha.SimulationError) as caught:
        bha.simulate(arm, later, q0=q0, options=bha.Options(max_steps=20))
    assert 1000.0 < caught.value.time < 1000.5


@pytest.mark.parametrize("name", [*STIFF, "damped"])
def test_a_step_beyond_the_stable_one_is_named(name: str) -> None:
    """In single runs and in batches: the number, and the way out; a sound step is not accused."""
    arm = STIFF.get(name, DAMPED)
    drive = driven(arm)
    text = r"step of 5\.00e-3 s, which is longer than rk4 is stable with .* \(about [0-9.]+e-[0-9] s\).*\"rodas4\""
    with pytest.raises(bha.SimulationError, match=text):
        bha.simulate(arm, drive, method="rk4", step=5e-3)
    batch = bha.simulate_batch(arm, [drive] * 3, times=[0.0, 0.9], method="rk4", step=5e-3)
    assert all("longer than rk4 is stable" in str(failure) for failure in batch.failures)
    assert np.isnan(batch.lengths[:, 1]).all()
    soft = NOMINAL.with_effects([{"kind": "bending_nonlinear", "where": "all", "cubic_stiffness": -900.0}])
    with pytest.raises(bha.SimulationError) as caught:
        bha.simulate(soft, driven(soft, 3.0, 8e4), method="rk4", step=1e-3)
    assert "stable" not in str(caught.value)


def test_rows_show_the_motion() -> None:
    """At the samples, and between sparse ones at 100 Hz at least; dense samples stay as they are."""
    sparse = bha.Input(np.array([0.0, 0.005, 1.0, 1.0, 1.025]), np.full((5, 9), 1.1e5))
    rows = bha.simulate(NOMINAL, sparse).time
    assert set(sparse.time) <= set(rows)
    assert np.diff(rows).max() <= 0.01 + 1e-9
    # A jump is one row.
    assert len(rows) == 1 + 1 + 100 + 3
    dense = bha.Input(np.arange(300) * 1e-3, np.full((300, 9), 1.1e5))
    np.testing.assert_array_equal(bha.simulate(NOMINAL, dense).time, dense.time)
    np.testing.assert_array_equal(bha.simulate(NOMINAL, dense, times=[0.1, 0.1, 0.25]).time, [0.1, 0.1, 0.25])


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"dt": 1e-12}, "rows by dt = 1e-12 s; a longer one is needed. At most"),
        ({"dt": float("nan")}, "dt: nan; a positive number"),
        ({"dt": 0.0}, "dt: 0.0; a positive number"),
        ({"t_end": float("inf")}, "t_end: inf; a finite time"),
        ({"t_end": -1.0}, "t_end: -1.0 s lies before the first sample"),
        ({"times": [0.0, 0.2, 0.1]}, "times: they must ascend; element 2 is 0.1 s after 0.2 s"),
        ({"times": [0.0, float("inf")]}, "times: element 1 is not a finite number"),
        ({"times": [-0.1, 0.0]}, "times: they must ascend and not lie before 0 s"),
        ({"times": []}, "times: shape .*; one row at least"),
        ({"times": ["now"]}, "times: numbers of seconds are needed"),
        ({"times": [0.0], "dt": 0.1}, "times: give them without dt"),
    ],
)
def test_output_orders_that_are_not_allowed(arguments: dict[str, object], text: str) -> None:
    with pytest.raises(bha.InputError, match=text):
        bha.simulate(NOMINAL, driven(NOMINAL), **arguments)  # type: ignore[arg-type]


def test_a_clock_in_nanoseconds_is_asked_about() -> None:
    """16 years at 100 Hz, or samples 10^7 s apart."""
    time = 1.7e18 + 1e7 * np.arange(1000)
    with pytest.raises(bha.InputError, match=r"rows at 100 Hz; is the time in another unit than seconds\? .* At most"):
        bha.simulate(NOMINAL, bha.Input(time, np.full((1000, 9), 1.1e5)))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"method": "euler"}, '"auto", "dopri5", "rodas4", "rk4", "ros2" are allowed'),
        ({"interpolation": "cubic"}, '"linear" or "hold" are allowed'),
        ({"max_steps": 0}, "max_steps: 0; at least 1"),
        ({"max_steps": 2.5}, "options: .*; see bha.Options"),
        ({"step": "1 ms"}, "options: .*; see bha.Options"),
        ({"atol": -1.0}, "atol: -1; a positive number"),
    ],
)
def test_options_are_looked_at_when_made(arguments: dict[str, object], text: str) -> None:
    with pytest.raises(bha.InputError, match=text):
        bha.Options(**arguments)  # type: ignore[arg-type]


def test_sensitivities_of_a_stiff_arm() -> None:
    """By the implicit method, against differences of runs that take the same steps."""
    arm = STIFF["april"]
    drive = driven(arm, 0.3)
    x0 = np.concatenate([arm.static_lengths(drive.pressures[0]), np.zeros(6)])
    times = np.array([0.0, 0.1, 0.25])
    found = bha.sensitivities(arm, drive, x0, times=times, parameters=["section.1.damping"], initial_state=False)
    damping = arm.parameters.sections[0].damping

    def with_damping(factor: float) -> bha.Arm:
        return bha.Arm(bha.parameters.paths.with_values(arm.parameters, {"section.1.damping": factor * damping}))

    pair = [with_damping(1.0 + 1e-3), with_damping(1.0 - 1e-3)]
    ends = bha.simulate_batch(pair, drive, x0, times=times, shared_steps=True).lengths
    differences: Array = (ends[0] - ends[1]) / (2e-3 * damping)
    by_parameter = found.by_parameters[:, :6, 0]
    assert np.abs(by_parameter).max() > 1e-9
    np.testing.assert_allclose(by_parameter, differences, rtol=0, atol=1e-3 * np.abs(differences).max())


@pytest.mark.parametrize("method", ["dopri5", "rodas4", "rk4", "ros2"])
def test_a_run_answers_to_ctrl_c(method: str) -> None:
    """One that would take minutes ends, by the signal, in any method."""
    still = np.full((2, 9), 1.1e5)
    drive = bha.Input(np.array([0.0, 1e7]), np.add(still, [[0.0], [1e3]]))
    options = bha.Options(method, step=1e-4, max_step=1e-4)  # type: ignore[arg-type]
    timer = threading.Timer(0.1, lambda: signal.raise_signal(signal.SIGINT))
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            bha.simulate(NOMINAL, drive, times=[0.0, 1e7], options=options)
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, handler)
