"""Closed loops: what each controller must do, on the plant it models and on one it does not."""

import gc
import json

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha import _core
from bha.control import (
    Controller,
    FeedbackLinearization,
    FilteredDifference,
    GravityPd,
    KalmanFilter,
    Limits,
    LinearQuadraticRegulator,
    Pid,
    Reference,
    Sensors,
    StaticModel,
    Stepper,
    hold,
    point_to_point,
    simulate_closed_loop,
    tip_circle,
)
from bha.errors import ConvergenceError, InputError, SimulationError
from bha.parameters import PneumaticsLevel

ARM = bha.robots.load("bha_nominal")
START = np.full(9, 0.19)
END = np.array([0.16, 0.20, 0.20, 0.21, 0.17, 0.19, 0.18, 0.19, 0.21])
MOVE = point_to_point(START, END, rest=0.6)


def law(name: str, arm: bha.Arm = ARM) -> Controller:
    laws: dict[str, type[Controller]] = {
        "pid": Pid,
        "gravity_pd": GravityPd,
        "static": StaticModel,
        "linearization": FeedbackLinearization,
        "lqr": LinearQuadraticRegulator,
    }
    return laws[name](arm)


# Root mean square and final tip error, mm, on the very plant that the controller models. Only the linearization knows
# the inertia: the others excite the arm's swing, which dies out with a time constant of two seconds by itself.
BOUNDS = {"pid": (50, 30), "gravity_pd": (30, 5), "static": (60, 60), "linearization": (0.05, 0.01), "lqr": (10, 1)}


@pytest.mark.parametrize("name", BOUNDS)
def test_follows_on_the_plant_it_models(name: str) -> None:
    run = simulate_closed_loop(ARM, law(name), MOVE)
    rms, last = BOUNDS[name]
    assert run.rms_tip_error() < rms * 1e-3
    assert run.tip_error[-1] < last * 1e-3
    assert run.saturation() == {}


@pytest.mark.parametrize("pneumatics", ["ideal", "lag", "full"])
@pytest.mark.parametrize("name", BOUNDS)
def test_stays_calm_on_a_plant_it_does_not_model(name: str, pneumatics: PneumaticsLevel) -> None:
    plant = other_plant().with_changes(pneumatics=pneumatics)
    calm = MOVE.followed_by(hold(END, 3.0))
    run = simulate_closed_loop(plant, law(name, ARM.with_changes(pneumatics=pneumatics)), calm, sensors=NOISE)
    assert run.rms_tip_error() < 0.05
    # Swings die out; what noise stirs up stays small.
    rates = np.abs(run.trajectory.velocities).max(axis=1)
    assert rates[-500:].max() < 0.6 * rates[:1000].max()
    assert rates[-500:].max() < 0.08


NOISE = Sensors(length_noise=1e-4, pressure_noise=100.0, seed=1)


def other_plant() -> bha.Arm:
    """Masses, stiffnesses and dampings off by 10 %, full pneumatics."""
    mapping = ARM.parameters.to_mapping()
    for section in mapping["section"]:
        section["mass"] *= 1.1
        section["stiffness"] = [0.9 * k for k in section["stiffness"]]
        section["damping"] *= 0.9
        section["bending_stiffness"] = [1.1 * k for k in section["bending_stiffness"]]
    mapping["pneumatics"]["level"] = "full"
    return bha.Arm.from_parameters(bha.parameters.ArmParameters.from_mapping(mapping))


def test_a_callable_is_the_controller_it_wraps() -> None:
    core = FeedbackLinearization(ARM).build(MOVE.period)
    rows = MOVE.rows().reshape(len(MOVE), 3, -1)

    def controller(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        return core.step(y[:9], y[9:], rows[round(t / MOVE.period)])

    found = simulate_closed_loop(ARM, controller, MOVE, sensors=NOISE)
    expected = simulate_closed_loop(ARM, FeedbackLinearization(ARM), MOVE, sensors=NOISE)
    assert np.array_equal(found.trajectory.lengths, expected.trajectory.lengths)
    assert np.array_equal(found.commands, expected.commands)
    assert np.isnan(found.estimated_velocities).all()


def test_an_exception_in_a_controller_comes_back_as_the_same_object() -> None:
    error = KeyError("mine")

    def controller(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        if t > 0.05:
            raise error
        return y[9:]

    with pytest.raises(KeyError) as caught:
        simulate_closed_loop(ARM, controller, MOVE)
    assert caught.value is error


@pytest.mark.parametrize("answer", [np.zeros(3), np.full(9, np.nan), "p", None])
def test_what_is_no_pressure_is_an_error(answer: object) -> None:
    with pytest.raises(InputError, match=r"controller\(t, y\)"):
        simulate_closed_loop(ARM, lambda t, y: answer, MOVE)  # type: ignore[arg-type,return-value]


def test_stepper_is_the_simulation() -> None:
    for level in ("ideal", "lag", "full"):
        arm = ARM.with_changes(pneumatics=level)
        rng = np.random.default_rng(3)
        p = 1.3e5 + 2e4 * rng.standard_normal((50, 9)).cumsum(axis=0) / 7
        stepper = Stepper(arm)
        stepper.reset(p[0])
        rows = [stepper.step(row, 2e-3)[:9] for row in p]
        drive = bha.Input(np.arange(50) * 2e-3, p)
        times = np.arange(51) * 2e-3
        options = bha.Options(method="rk4", step=1e-3, interpolation="hold")
        expected = bha.Simulation(arm, drive, options).advance(times)
        assert np.array(rows) == pytest.approx(expected.lengths[1:], abs=1e-9)
        assert stepper.pressures == pytest.approx(expected.pressures[-1], abs=1e-3 if level != "ideal" else 1e9)
        assert stepper.time == pytest.approx(0.1)


def test_stepper_refuses_nonsense() -> None:
    stepper = Stepper(ARM)
    with pytest.raises(InputError, match="p: expected shape"):
        stepper.step(np.zeros(3), 1e-3)
    with pytest.raises(InputError, match="dt: 0"):
        stepper.step(np.full(9, 1.2e5), 0.0)
    with pytest.raises(InputError, match="finite"):
        stepper.step(np.full(9, np.inf), 1e-3)
    with pytest.raises(SimulationError, match="the simulation stopped at t = "):
        stepper.step(np.full(9, 1e9), 1.0)
    stepper.reset()
    assert stepper.time == 0.0


def test_the_seed_decides() -> None:
    runs = [
        simulate_closed_loop(ARM, GravityPd(ARM), MOVE, sensors=Sensors(1e-4, 100.0, seed=seed)) for seed in (5, 5, 6)
    ]
    assert np.array_equal(runs[0].trajectory.lengths, runs[1].trajectory.lengths)
    assert not np.array_equal(runs[0].trajectory.lengths, runs[2].trajectory.lengths)


def test_noise_has_the_deviation_asked_for() -> None:
    seen: list[NDArray[np.float64]] = []

    def controller(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        seen.append(y)
        return p0

    rest = _core.rest_near(ARM, START, *limits())
    p0, q0 = rest.pressures, rest.lengths
    simulate_closed_loop(ARM, controller, hold(q0, 2.0), sensors=Sensors(2e-4, 150.0), q0=q0, p0=p0)
    y = np.array(seen)
    assert np.std(y[:, :9] - q0, axis=0) == pytest.approx(2e-4, rel=0.1)
    assert np.std(y[:, 9:] - p0, axis=0) == pytest.approx(150.0, rel=0.1)


def limits(arm: bha.Arm = ARM) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    found = Limits.of(arm)
    return found.low, found.high, found.preferred


@pytest.mark.parametrize("name", BOUNDS)
def test_saturates_gracefully(name: str) -> None:
    """A reference beyond the pressures and back: flagged, no windup left afterwards, nothing diverges."""
    far = END + np.array([0, 0, 0, 0, 0, 0, 0.14, 0.14, 0.14])
    out = point_to_point(START, far, max_velocity=0.6, max_acceleration=6.0, max_jerk=100.0, rest=1.0)
    back = point_to_point(far, START, max_velocity=0.6, max_acceleration=6.0, max_jerk=100.0, rest=4.0)
    run = simulate_closed_loop(ARM, law(name), out.followed_by(back))
    assert set(run.saturation()) & {"p31", "p32", "p33"}
    assert np.all(run.commands >= 0.7e5)
    assert np.all(run.commands <= 2.2e5)
    # The static model does not damp the swing that remains; its amplitude is that of letting go anywhere.
    assert run.tip_error[-100:].max() < 0.06
    assert np.abs(run.trajectory.velocities[-100:]).max() < 0.1


def test_kalman_filter_beats_differences_in_noise() -> None:
    errors = []
    for observer in (KalmanFilter(), KalmanFilter(renewal=100), FilteredDifference()):
        controller = FeedbackLinearization(ARM.with_changes(pneumatics="full"), observer=observer, bandwidth=8.0)
        run = simulate_closed_loop(ARM.with_changes(pneumatics="full"), controller, MOVE, sensors=NOISE)
        off = run.estimated_velocities - run.trajectory.velocities
        errors.append(float(np.sqrt(np.mean(off[50:] ** 2))))
    assert errors[0] < 0.5 * errors[2]
    assert errors[1] < 0.5 * errors[2]


def test_disturbance_of_the_kalman_filter_takes_a_wrong_mass_away() -> None:
    plant = other_plant().with_changes(pneumatics="ideal")
    plain, compensated = (
        simulate_closed_loop(
            plant, FeedbackLinearization(ARM, integral_rate=0.0, compensate_disturbance=c), hold(START, 1.5)
        )
        for c in (False, True)
    )
    assert compensated.tip_error[-1] < 0.05 * plain.tip_error[-1]


def test_linearization_against_differences() -> None:
    rng = np.random.default_rng(0)
    q, qd = 0.2 + 0.03 * rng.standard_normal(9), 0.1 * rng.standard_normal(9)
    p = 1.3e5 + 2e4 * rng.standard_normal(9)
    a, b = _core.linearize(ARM, q, qd, p)
    for k in range(9):
        e = np.eye(9)[k]
        by_q = (ARM.forward_dynamics(q + 1e-6 * e, qd, p) - ARM.forward_dynamics(q - 1e-6 * e, qd, p)) / 2e-6
        by_qd = (ARM.forward_dynamics(q, qd + 1e-5 * e, p) - ARM.forward_dynamics(q, qd - 1e-5 * e, p)) / 2e-5
        by_p = (ARM.forward_dynamics(q, qd, p + 10 * e) - ARM.forward_dynamics(q, qd, p - 10 * e)) / 20
        assert a[9:, k] == pytest.approx(by_q, rel=1e-5, abs=1e-3)
        assert a[9:, 9 + k] == pytest.approx(by_qd, rel=1e-5, abs=1e-4)
        assert b[9:, k] == pytest.approx(by_p, rel=1e-5, abs=1e-8)
    assert np.array_equal(a[:9], np.hstack([np.zeros((9, 9)), np.eye(9)]))


def test_regulator_against_scipy() -> None:
    linalg = pytest.importorskip("scipy.linalg")
    rest = _core.rest_near(ARM, START, *limits())
    p, q = rest.pressures, rest.lengths
    a, b = _core.linearize(ARM, q, np.zeros(9), p, 1e-3)
    c, d = _core.linearize(ARM, q, np.zeros(9), p)
    block = np.zeros((27, 27))
    block[:18] = np.hstack([c, d])
    exact = linalg.expm(1e-3 * block)
    assert a == pytest.approx(exact[:18, :18], abs=1e-12)
    assert b == pytest.approx(exact[:18, 18:], abs=1e-15)
    b = b * 1e5
    weights, prices = np.diag(np.repeat([1e4, 10.0], 9)), 0.1 * np.eye(9)
    x = linalg.solve_discrete_are(a, b, weights, prices)
    expected = np.linalg.solve(prices + b.T @ x @ b, b.T @ x @ a)
    assert _core.linear_quadratic_gain(a, b, weights, prices) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_tip_circle_is_a_circle_within_the_lengths() -> None:
    reference = tip_circle(ARM, 0.12, turns=0.5, period=5e-3)
    tips = np.array([ARM.forward_kinematics(q)[0][-1] for q in reference.lengths])
    assert np.linalg.norm(tips[:, :2], axis=1) == pytest.approx(0.12, abs=1e-7)
    assert reference.tip_positions == pytest.approx(tips, abs=1e-7)
    found = Limits.of(ARM)
    assert np.all(reference.lengths >= found.shortest)
    assert np.all(reference.lengths <= found.longest)
    # Jerk-limited: accelerations begin and end at zero and do not jump.
    assert np.abs(reference.accelerations[[0, -1]]).max() < 1e-2
    assert np.abs(np.diff(reference.accelerations, axis=0)).max() < 0.5
    assert np.gradient(reference.lengths, 5e-3, axis=0) == pytest.approx(reference.velocities)


def test_direction_of_the_tip_and_what_is_out_of_reach() -> None:
    low, high = Limits.of(ARM).shortest, Limits.of(ARM).longest
    goal = END
    heads, turns = ARM.forward_kinematics(goal)
    q = _core.resolved_motion(ARM, heads[-1:], turns[-1:, :, 2], START, low, high)[0]
    found, found_turns = ARM.forward_kinematics(q)
    assert found[-1] == pytest.approx(heads[-1], abs=1e-7)
    assert found_turns[-1, :, 2] == pytest.approx(turns[-1, :, 2], abs=1e-6)
    with pytest.raises(ConvergenceError, match="row 0: the tip"):
        _core.resolved_motion(ARM, np.array([[2.0, 0.0, 0.0]]), None, START, low, high)


def test_shared_inputs_and_four_bellows() -> None:
    """Four chambers on three inputs a section: a rank-deficient actuation, held at rest all the same."""
    arm = bha.robots.load("asu_two_section")
    found = Limits.of(arm)
    rest = _core.rest_near(arm, np.full(6, 0.09), found.low, found.high, found.preferred)
    p, q = rest.pressures, rest.lengths
    run = simulate_closed_loop(arm, FeedbackLinearization(arm), hold(q, 0.5))
    assert np.all(p >= found.low - 1e-6)
    assert np.all(p <= found.high + 1e-6)
    assert run.tip_error[-1] < 1e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", BOUNDS)
def test_random_references_neither_diverge_nor_swing_on(name: str, seed: int) -> None:
    """The long version, 200 references on 200 plants, is benches/control_stability.py."""
    reference = random_reference(seed)
    run = simulate_closed_loop(
        other_plant(), law(name, ARM.with_changes(pneumatics="full")), reference, sensors=NOISE, decimation=5
    )
    before, end = (
        float(np.sqrt(np.mean(run.trajectory.velocities[rows] ** 2))) for rows in (slice(-500, -400), slice(-100, None))
    )
    # Laws without the inertia leave the swing to the arm's own damping, time constant 2 s.
    assert end < max(0.01, 0.6 * before)
    if name == "linearization":
        assert end < 0.01
        assert run.tip_error[-1] < 0.005


def random_reference(seed: int) -> Reference:
    rng = np.random.default_rng(seed)
    found = Limits.of(ARM)
    middle, half = (found.shortest + found.longest) / 2, (found.longest - found.shortest) / 2
    a, b = middle - 0.01 + 0.4 * half * rng.uniform(-1, 1, (2, 9))
    return point_to_point(a, b, rest=3.0)


def test_nothing_is_kept_by_a_run() -> None:
    gc.collect()
    before = len(gc.get_objects())
    for _ in range(3):
        simulate_closed_loop(ARM, lambda t, y: y[9:], hold(START, 0.05))
    gc.collect()
    assert len(gc.get_objects()) - before < 200


def test_core_controller_says_what_is_wrong_with_it() -> None:
    with pytest.raises(InputError, match="unknown field"):
        _core.Controller(ARM, json.dumps({"period": 1e-3, "low": 1}))
    with pytest.raises(InputError, match="period is 0"):
        FeedbackLinearization(ARM).build(0.0)
    for observer in (
        lambda: KalmanFilter(ARM),  # type: ignore[arg-type]
        lambda: KalmanFilter(length_noise=float("nan")),
        lambda: KalmanFilter(renewal=-1),
        lambda: FilteredDifference(cutoff=-1.0),
    ):
        with pytest.raises(InputError, match=r"(KalmanFilter|FilteredDifference): (length_noise|renewal|cutoff) is "):
            observer()
    with pytest.raises(InputError, match="StaticModel: all gains and times must be finite numbers"):
        StaticModel(ARM, integral=float("nan")).build(1e-3)
    two = bha.robots.load("asu_two_section")
    with pytest.raises(InputError, match="made for 9 lengths"):
        simulate_closed_loop(two, FeedbackLinearization(ARM), hold(np.full(6, 0.09), 0.1))
