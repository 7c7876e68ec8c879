"""Any arm by default settings: steps that are stable, observers of stiff models, and causes that are named."""

import copy
import os
import pickle
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from numpy.typing import NDArray
from stiff_arm import stiff_arm

import bha
from bha.control import (
    Controller,
    FeedbackLinearization,
    FilteredDifference,
    GravityPd,
    KalmanFilter,
    LinearQuadraticRegulator,
    Pid,
    Reference,
    StaticModel,
    Stepper,
    hold,
    linear_loop,
    point_to_point,
    simulate_closed_loop,
)
from bha.control.stepper import plan_steps, stable_step
from bha.errors import InputError, SimulationError

NOMINAL = bha.robots.load("bha_nominal")
STIFF = stiff_arm()


@pytest.mark.parametrize("name", bha.robots.names())
def test_stable_step_is_the_edge_of_the_explicit_method(name: str) -> None:
    """Half of it keeps to the implicit method's motion; twice the limit leaves it."""
    arm = bha.robots.load(name)
    p = np.full(len(arm.inputs), 1.2e5)
    step = stable_step(arm, p)
    q = arm.static_lengths(p)
    a, _ = arm.linearize(q, np.zeros_like(q), p)
    fastest = np.abs(np.linalg.eigvals(a)).max()
    assert 1.9 < step * fastest < 2.1 or step * fastest == pytest.approx(0.7 * 2.8, rel=0.15)
    with pytest.raises(InputError, match=r'step: .* rk4 is stable with this arm for steps up to .* "ros2"'):
        plan_steps(arm, method="rk4", step=3.5 / fastest)
    assert plan_steps(arm, method="rk4", step=1.0 / fastest) == ("rk4", pytest.approx(1.0 / fastest))


def test_the_method_follows_from_the_arm() -> None:
    assert plan_steps(NOMINAL) == ("rk4", 1e-3)
    assert plan_steps(STIFF) == ("ros2", 5e-4)
    assert plan_steps(STIFF, step=1e-7) == ("rk4", 1e-7)
    assert plan_steps(STIFF, method="rk4")[1] < 5e-5
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="step: "):
            plan_steps(NOMINAL, step=bad)
    with pytest.raises(InputError, match='"rk4" or "ros2"'):
        Stepper(NOMINAL, method="symplectic_euler")  # type: ignore[arg-type]


def test_a_stepper_of_a_stiff_arm_is_its_simulation() -> None:
    rng = np.random.default_rng(1)
    p = 1.2e5 + 2e4 * rng.uniform(-1, 1, (20, 6))
    stepper = Stepper(STIFF)
    assert stepper.method == "ros2"
    stepper.reset(p[0])
    rows = [stepper.step(row, 0.05)[:6] for row in p]
    drive = bha.Input(np.arange(20) * 0.05, p)
    times = np.arange(21) * 0.05
    tight = bha.Options(method="ros2", step=1e-4, interpolation="hold")
    expected = bha.Simulation(STIFF, drive, tight).advance(times)
    assert np.ptp(expected.lengths, axis=0).max() > 1e-3
    assert np.array(rows) == pytest.approx(expected.lengths[1:], abs=2e-6)


def moved(arm: bha.Arm, controller: Controller, rest: float, period: float = 1e-3) -> tuple[float, float, float]:
    """How far the length with the longest way went in the end, and should have gone, m; and the tip error then, m."""
    p = np.full(len(arm.inputs), 1.2e5)
    start = arm.static_lengths(p)
    end = arm.static_lengths(p + np.where(np.arange(len(p)) == 0, 1e4, 0.0))
    limits = {"max_velocity": 0.05, "max_acceleration": 0.5, "max_jerk": 10.0}
    run = simulate_closed_loop(arm, controller, point_to_point(start, end, **limits, rest=rest, period=period))
    assert np.all(np.isfinite(run.estimated_velocities))
    k = int(np.argmax(np.abs(end - start)))
    went = run.trajectory.lengths[-1] - run.trajectory.lengths[0]
    return float(went[k]), float((end - start)[k]), float(run.tip_error[-1])


@pytest.mark.parametrize("arm", [STIFF, bha.robots.load("asu_two_section_january")], ids=["made", "january"])
def test_controllers_lead_a_stiff_arm(arm: bha.Arm) -> None:
    """By default settings. The linearization knows the damping; the static model waits for it."""
    far, wanted, left = moved(arm, FeedbackLinearization(arm), 1.0)
    assert far == pytest.approx(wanted, rel=0.05)
    assert left < 3e-4
    far, wanted, _ = moved(arm, StaticModel(arm), 1.0)
    assert 0.4 < far / wanted < 1.1
    far, wanted, _ = moved(arm, StaticModel(arm), 40.0, period=0.01)
    assert far == pytest.approx(wanted, rel=0.1)
    for law in (GravityPd(arm), LinearQuadraticRegulator(arm)):
        far, wanted, _ = moved(arm, law, 1.0)
        assert 0.5 < far / wanted < 1.2


def test_the_filter_of_a_stiff_model_sees_what_differences_see() -> None:
    """Rates of the two observers agree where neither sensors nor model are wrong."""
    seen = []
    for observer in (KalmanFilter(), FilteredDifference(cutoff=2000.0)):
        p = np.full(6, 1.2e5)
        start, end = STIFF.static_lengths(p), STIFF.static_lengths(p + np.array([2e4, 0, 0, 0, 0, 0]))
        reference = point_to_point(start, end, max_velocity=0.05, max_acceleration=0.5, max_jerk=10.0)
        run = simulate_closed_loop(STIFF, FeedbackLinearization(STIFF, observer=observer, bandwidth=5.0), reference)
        off = run.estimated_velocities[20:] - run.trajectory.velocities[20:]
        seen.append(float(np.abs(off).max()) / float(np.abs(run.trajectory.velocities).max()))
    assert max(seen) < 0.1, seen
    assert linear_loop(StaticModel(STIFF)).stable


@pytest.mark.parametrize("law", [GravityPd, FeedbackLinearization, LinearQuadraticRegulator, StaticModel])
def test_gains_are_those_of_the_period(law: type[Controller]) -> None:
    """At 20 ms the gains for 1 ms make the arm swing without end."""
    start, end = np.full(9, 0.19), np.array([0.16, 0.20, 0.20, 0.21, 0.17, 0.19, 0.18, 0.19, 0.21])
    reference = point_to_point(start, end, period=0.02, rest=3.0)
    run = simulate_closed_loop(NOMINAL, law(NOMINAL), reference)
    assert np.all(np.isfinite(run.estimated_velocities))
    assert np.all(np.ptp(run.commands, axis=0) > 0)
    assert np.abs(np.diff(run.commands, axis=0)).max(axis=1).min() > 0
    rates = np.abs(run.trajectory.velocities).max(axis=1)
    assert rates[-20:].max() < 0.7 * rates.max()
    assert linear_loop(law(NOMINAL), period=0.02).stable


def test_what_is_not_finite_is_named_with_its_cause_and_its_controller() -> None:
    still = hold(np.full(9, 0.2), 0.5)
    beyond = Reference(still.period, still.lengths, 1e200 * np.tile([1, -1, 0.5], (len(still), 3)), still.accelerations)
    with pytest.raises(SimulationError, match=r"^FeedbackLinearization: at t = 0 s the force .* reference") as caught:
        simulate_closed_loop(NOMINAL, FeedbackLinearization(NOMINAL), beyond, p0=np.full(9, 1.2e5))
    assert len(caught.value.trajectory) == 0
    assert isinstance(caught.value.__cause__, bha.ConvergenceError)

    fleeing = NOMINAL.with_effects([{"kind": "formula", "where": "all", "force": "c * qd", "c": 120.0}])
    with pytest.raises(SimulationError, match=r"^Pid: the simulation stopped at t = "):
        simulate_closed_loop(fleeing, Pid(NOMINAL), hold(np.full(9, 0.2), 2.0))


@pytest.mark.parametrize(("law", "cause"), [(Pid, "the measured lengths"), (StaticModel, "FilteredDifference")])
def test_an_estimate_that_is_not_finite_is_refused(law: type[Controller], cause: str) -> None:
    core = law(NOMINAL).build(1e-3)
    target = np.vstack([np.full(9, 0.19), np.zeros((2, 9))])
    core.step(np.full(9, 0.19), np.full(9, 1.2e5), target)
    with pytest.raises(bha.ConvergenceError, match=f"at t = .* the observer's estimate is no longer finite: .*{cause}"):
        core.step(np.full(9, 1e308), np.full(9, 1.2e5), target)


HIDDEN = [
    {"kind": "creep", "where": "all", "stiffness": 200.0, "tau": 0.8},
    {"kind": "delay", "where": "sensors", "time": 0.013},
    {"kind": "length_offset", "where": "bellows 11", "offset": 0.02},
]
CHAIN = [
    {"kind": "pressure_lag", "where": "all", "fill": 0.1, "vent": 0.05},
    {"kind": "delay", "where": "all", "time": 0.02},
]


@pytest.mark.parametrize("level", ["ideal", "lag", "full"])
@pytest.mark.parametrize("effects", [[], HIDDEN, CHAIN], ids=["plain", "hidden", "chain"])
def test_a_stepper_copies_and_pickles_as_it_stands(level: bha.parameters.PneumaticsLevel, effects: list[dict]) -> None:
    arm = NOMINAL.with_changes(pneumatics=level).with_effects(effects)
    rng = np.random.default_rng(7)
    plant = Stepper(arm)
    plant.reset(np.full(9, 1.2e5))
    for p in 1.2e5 + 2e4 * rng.uniform(-1, 1, (20, 9)):
        plant.step(p, 4e-3)
    twins = [copy.deepcopy(plant), pickle.loads(pickle.dumps(plant))]
    assert all(twin.time == plant.time for twin in twins)
    assert all(np.array_equal(twin.measured_lengths, plant.measured_lengths) for twin in twins)
    for p in 1.2e5 + 2e4 * rng.uniform(-1, 1, (20, 9)):
        rows = [one.step(p, 4e-3) for one in (plant, *twins)]
        assert rows[1] == pytest.approx(rows[0], rel=1e-12)
        assert np.array_equal(rows[1], rows[2])
    with pytest.raises(InputError, match="state: it does not fit this arm"):
        plant._resume(np.zeros(5))


def test_what_a_stepper_returns_is_measured() -> None:
    arm = NOMINAL.with_effects(HIDDEN[1:])
    p = np.full(9, 1.2e5)
    truth = arm.static_lengths(p)
    plant = Stepper(arm)
    first = plant.reset(p)
    assert first[0] == pytest.approx(truth[0] + 0.02)
    assert first[1:9] == pytest.approx(truth[1:])
    assert plant.lengths == pytest.approx(truth)
    # 13 ms behind: of a ramp by held commands the sensors have the length of 13 periods before.
    rows = [plant.lengths]
    for k in range(40):
        y = plant.step(p + 500.0 * k, 1e-3)
        rows.append(plant.lengths)
    assert y[1:9] == pytest.approx(rows[-14][1:], abs=1e-7)
    assert plant.measured_lengths == pytest.approx(y[:9])
    seen: list[NDArray[np.float64]] = []

    def controller(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        seen.append(y)
        return p

    simulate_closed_loop(arm, controller, hold(truth, 0.01), p0=p)
    assert seen[0] == pytest.approx(first)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="signals and processes as on Unix")
@pytest.mark.parametrize(
    "call",
    [
        "Stepper(arm).step(np.full(9, 1.2e5), 1e6)",
        "simulate_closed_loop(arm, Pid(arm), hold(np.full(9, 0.19), 1e6, period=1e5))",
        "simulate_closed_loop(arm, lambda t, y: y[9:], hold(np.full(9, 0.19), 1e6, period=1e5))",
        "ReachEnv(period=1e6).step(np.zeros(9))",
        "ReachVectorEnv(300, period=1e5, threads=2).step(np.zeros((300, 9)))",
        "ReachVectorEnv(300, period=1e5, threads=1, method='symplectic_euler').step(np.zeros((300, 9)))",
    ],
)
def test_long_periods_answer_to_ctrl_c(call: str) -> None:
    pytest.importorskip("gymnasium")
    code = f"""
        import os, subprocess, numpy as np, bha
        from bha.control import *
        from bha.environments import ReachEnv, ReachVectorEnv
        arm = bha.robots.load("bha_nominal")
        subprocess.Popen(["sh", "-c", f"sleep 0.7; kill -INT {{os.getpid()}}"])
        try:
            {call}
        except KeyboardInterrupt:
            print("interrupted")
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout.strip() == "interrupted", done.stderr
