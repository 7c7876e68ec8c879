"""The shipped arm with a hand: three bellows about a ball joint, behind three sections."""

from __future__ import annotations

import numpy as np

import bha

ARM = bha.robots.load("bha_hand")
AMBIENT = ARM.parameters.ambient_pressure
BARE = bha.robots.load("bha_nominal")


def hand_at(gauge: tuple[float, float, float]) -> np.ndarray:
    """Lengths of the hand's bellows at rest, m, with these gauge pressures (Pa) in them and none in the arm's."""
    pressures = np.full(len(ARM.inputs), AMBIENT)
    pressures[9:] += gauge
    return ARM.static_lengths(pressures)[9:]


def test_the_hand_turns_by_thirty_degrees_about_a_joint_that_keeps_its_length() -> None:
    radius = ARM.parameters.sections[3].bellows_radius
    a, b, c = hand_at((1e5, -0.3e5, -0.3e5))
    assert abs(b - c) < 1e-9
    assert 28.0 < np.rad2deg((2 * a - b - c) / (3 * radius)) < 33.0
    for gauge in ((1e5, -0.3e5, -0.3e5), (1e5, 1e5, 1e5)):
        assert abs(hand_at(gauge).mean() - 0.06) < 1e-3


def test_the_arm_below_the_hand_is_that_of_the_nominal_file() -> None:
    assert ARM.parameters.sections[:3] == BARE.parameters.sections


def test_what_hangs_below_stretches_the_arm() -> None:
    """The hand's weight hangs on the springs of section 3: its change over the slope of their force is the stretch."""
    with_hand, without = (arm.static_lengths(np.full(len(arm.inputs), AMBIENT))[6:9].mean() for arm in (ARM, BARE))
    section = ARM.parameters.sections[2]
    middle = 0.5 * (with_hand + without) - section.rest_length
    slope = 3 * sum((m + 1) * k * middle**m for m, k in enumerate(section.stiffness))
    assert abs((with_hand - without) * slope / (9.81 * ARM.parameters.sections[3].mass) - 1.0) < 1e-3
