"""Stability margins: the linear loop against the core's own closed loops, and the gains chosen by it."""

import numpy as np
import pytest

import bha
from bha.control import (
    Controller,
    FeedbackLinearization,
    FilteredDifference,
    GravityPd,
    KalmanFilter,
    LinearQuadraticRegulator,
    Pid,
    Sensors,
    StaticModel,
    hold,
    linear_loop,
    simulate_closed_loop,
)
from bha.control.margins import largest_gain
from bha.errors import InputError
from bha.parameters import ArmParameters, PneumaticsLevel

ARM = bha.robots.load("bha_nominal")
MIDDLE = np.full(9, 0.2)
NOISE = Sensors(length_noise=1e-4, pressure_noise=100.0, seed=2)


def laws(arm: bha.Arm) -> dict[str, Controller]:
    return {
        "pid": Pid(arm),
        "pid with a Kalman filter": Pid(arm, observer=KalmanFilter()),
        "gravity_pd": GravityPd(arm),
        "gravity_pd with differences": GravityPd(arm, proportional=0.2, derivative=0.01, observer=FilteredDifference()),
        "linearization": FeedbackLinearization(arm),
        "linearization, disturbance compensated": FeedbackLinearization(arm, compensate_disturbance=True),
        "linearization at the measured state": FeedbackLinearization(arm, at="measured", bandwidth=20.0),
        "lqr": LinearQuadraticRegulator(arm),
    }


def moving(controller: Controller, plant: bha.Arm, time: float) -> float:
    """Root mean square of the rates from half of ``time`` s on, m/s."""
    run = simulate_closed_loop(plant, controller, hold(MIDDLE, time), sensors=NOISE)
    rates = run.trajectory.velocities[len(run.trajectory) // 2 :]
    return float(np.sqrt(np.mean(np.square(rates))))


@pytest.mark.parametrize("level", ["ideal", "lag"])
@pytest.mark.parametrize("name", laws(ARM))
def test_noise_moves_the_arm_as_the_linear_loop_says(name: str, level: PneumaticsLevel) -> None:
    arm = even_lag(level)
    controller = laws(arm)[name]
    expected = linear_loop(controller, pose=MIDDLE).rate_noise(NOISE)
    # Of some thousand independent samples; what is slow has fewer.
    assert moving(controller, arm, 4.0) == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("name", ["pid", "gravity_pd", "linearization", "lqr"])
def test_noise_behind_valves(name: str) -> None:
    """Chamber, spool and pressure controller; without the dead band, which the linear loop takes as compensated."""
    mapping = ARM.parameters.to_mapping()
    mapping["pneumatics"] |= {"level": "full", "spool_dead_band": 0.0}
    arm = bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))
    controller = laws(arm)[name]
    expected = linear_loop(controller, pose=MIDDLE).rate_noise(NOISE)
    assert moving(controller, arm, 4.0) == pytest.approx(expected, rel=0.15)


def even_lag(level: PneumaticsLevel) -> bha.Arm:
    """The nominal arm with the same time constant for filling and venting: the lag is linear."""
    mapping = ARM.parameters.to_mapping()
    mapping["pneumatics"] |= {"level": level, "fill_time": 0.02, "vent_time": 0.02}
    return bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))


@pytest.mark.parametrize("level", ["lag", "full"])
def test_swings_where_the_linear_loop_says(level: PneumaticsLevel) -> None:
    arm = even_lag(level)

    def controller(derivative: float) -> GravityPd:
        return GravityPd(arm, proportional=0.3, integral=0.5, derivative=derivative)

    low, high = 0.02, 1.0
    while high / low > 1.01:
        middle = (low * high) ** 0.5
        stable = linear_loop(controller(middle), pose=MIDDLE).stable
        low, high = (middle, high) if stable else (low, middle)
    below, above = moving(controller(0.75 * low), arm, 1.0), moving(controller(1.25 * low), arm, 1.0)
    assert below < 0.02
    assert above > 5 * below


# No pneumatics are given for the two-section arm.
@pytest.mark.parametrize("law", [GravityPd, FeedbackLinearization])
@pytest.mark.parametrize(
    ("name", "level"),
    [("bha_nominal", "ideal"), ("bha_nominal", "lag"), ("bha_nominal", "full"), ("asu_two_section", "ideal")],
)
def test_gains_chosen_keep_to_their_margin(
    name: str, law: type[GravityPd | FeedbackLinearization], level: PneumaticsLevel
) -> None:
    arm = bha.robots.load(name)
    loop = linear_loop(law(arm.with_changes(pneumatics=level) if level != "ideal" else arm))
    assert loop.stable
    assert loop.sensitivity_peak <= 2.0


def test_gains_given_are_taken() -> None:
    law = GravityPd(ARM.with_changes(pneumatics="full"), proportional=1.0, integral=2.0, derivative=0.06)
    assert law.gains == (1.0, 2.0, 0.06)
    # Those whose limit cycle at 63 Hz the bench found: hardly a margin there.
    loop = linear_loop(law)
    assert loop.sensitivity_peak > 10
    assert loop.frequencies[loop.sensitivity.argmax()] == pytest.approx(63, abs=5)
    assert FeedbackLinearization(ARM, bandwidth=20.0, damping_ratio=1.0).gains == (400.0, 5.0, 40.0)


def test_a_wrong_plant_and_another_pose() -> None:
    stiffer = ARM.parameters.to_mapping()
    for section in stiffer["section"]:
        section["stiffness"] = [1.1 * k for k in section["stiffness"]]
    plant = bha.Arm.from_parameters(ArmParameters.from_mapping(stiffer))
    plant = plant.with_changes(pneumatics="full")
    law = FeedbackLinearization(ARM.with_changes(pneumatics="full"))
    peaks = [
        linear_loop(law, arm, pose=pose).sensitivity_peak for arm in (None, plant) for pose in (None, MIDDLE - 0.02)
    ]
    assert len({round(peak, 6) for peak in peaks}) == 4
    assert max(peaks) < 1.6


def test_an_unstable_loop_has_no_margin() -> None:
    loop = linear_loop(StaticModel(ARM, proportional=-2.0))
    assert not loop.stable
    assert loop.sensitivity_peak == float("inf")
    assert loop.rate_noise(NOISE) == float("inf")


def test_refuses_a_pose_of_another_arm() -> None:
    with pytest.raises(InputError, match="q: expected shape"):
        linear_loop(GravityPd(ARM), pose=np.zeros(6))


@pytest.mark.parametrize("limit", [2.0, 1.0, 0.7, 0.031])
def test_largest_gain(limit: float) -> None:
    found = largest_gain(lambda factor: 1.0 / max(1e-9, 1.0 - factor / (2 * limit)), 2.0)
    assert min(limit, 1.0) / 1.03 < found <= min(limit, 1.0)


def test_largest_gain_where_there_is_none() -> None:
    assert largest_gain(lambda factor: 9.0, 2.0) == 0.01
