"""Poses that pressures hold, in one call, and how they move with the arm."""

import numpy as np
import pytest

import bha
from bha import _core
from bha.parameters import paths

RNG = np.random.default_rng(5)
ARM = bha.robots.load("bha_nominal")
PRESSURES = ARM.parameters.ambient_pressure + RNG.uniform(0.0, 8e4, (12, len(ARM.inputs)))
FORCES = RNG.uniform(-3.0, 3.0, (12, ARM.section_count, 3))
FLAT = FORCES.reshape(12, -1)


def one_by_one(arm: bha.Arm) -> np.ndarray:
    """What the search for single poses finds."""
    pairs = zip(PRESSURES, FORCES, strict=True)
    return np.array([arm.static_lengths(pressures, forces) for pressures, forces in pairs])


def test_many_poses_are_those_found_one_by_one() -> None:
    np.testing.assert_allclose(_core.held_poses(ARM, PRESSURES, FLAT), one_by_one(ARM), rtol=0.0, atol=1e-10)


@pytest.mark.parametrize(
    ("path", "effect"),
    [("section.1.mass", False), ("section.2.stiffness.1", False), ("section.3.terminal_area", False), ("gain", True)],
)
def test_poses_move_with_the_arm_as_their_difference_quotients(path: str, effect: bool) -> None:
    gain = {"kind": "pressure_gain", "where": "input p21", "gain": 0.1}
    parameters = ARM.parameters.updated({"effect": [gain]}) if effect else ARM.parameters
    own = "effect.1.gain" if effect else path
    start = paths.get_value(parameters, own)
    arm, more, less = (bha.Arm(paths.with_values(parameters, {own: start * (1.0 + h)})) for h in (0.0, 1e-4, -1e-4))
    held = _core.held_poses(arm, PRESSURES, FLAT)
    moved = _core.moved_poses(arm, [more, less], PRESSURES, held, FLAT)
    slope = (one_by_one(more) - one_by_one(less)) / 2e-4
    np.testing.assert_allclose((moved[0] - moved[1]) / 2e-4, slope, rtol=0.0, atol=1e-5 * np.abs(slope).max())
    assert np.abs(slope).max() > 1e-4


def test_a_row_that_nothing_holds_is_no_pose_and_leaves_the_others() -> None:
    pressures = PRESSURES.copy()
    pressures[4] = 1e9
    found = _core.held_poses(ARM, pressures, FLAT, np.full((12, 3 * ARM.section_count), np.nan))
    assert np.isnan(found[4]).all()
    rest = np.arange(12) != 4
    np.testing.assert_allclose(found[rest], one_by_one(ARM)[rest], rtol=0.0, atol=1e-10)
    assert np.isnan(_core.moved_poses(ARM, [ARM], pressures, found, FLAT)[0, 4]).all()


def test_arms_that_do_not_fit_together_are_said() -> None:
    other = bha.robots.load("asu_two_section")
    with pytest.raises(bha.InputError, match="as many sections and inputs"):
        _core.moved_poses(ARM, [other], PRESSURES, one_by_one(ARM))
    with pytest.raises(bha.InputError, match="forces"):
        _core.held_poses(ARM, PRESSURES, FLAT[:3])
