"""References: jerk-limited motion over any distance, what an arm reaches of them, and the radius that suits it."""

import warnings

import numpy as np
import pytest
from stiff_arm import stiff_arm

import bha
from bha.control import Limits, Reference, hold, point_to_point, reachability, tip_circle, tip_line, tip_samples
from bha.control.reach import comfortable_radius
from bha.errors import InputError, ReferenceWarning
from bha.parameters import ArmParameters, BaseParameters

pytest.importorskip("ruckig")

NOMINAL = bha.robots.load("bha_nominal")


def planar_arm() -> bha.Arm:
    """Two bellows opposite each other, one input each, and two that share one: it bends in its x-z plane alone."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    mapping["name"] = "planar"
    mapping["section"] = mapping["section"][:1]
    section = mapping["section"][0]
    angles = ((0.0, "p11"), (180.0, "p12"), (90.0, "p13"), (270.0, "p13"))
    section["bellows"] = [{"angle_deg": angle, "input": name} for angle, name in angles]
    return bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))


@pytest.mark.parametrize("limits", [(0.2, 2.0, 40.0), (0.1, 1.0, 20.0), (0.3, 3.0, 60.0), (0.4, 4.0, 80.0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_distance_has_a_motion(limits: tuple[float, float, float], sign: float) -> None:
    """Over 2 a^3 / j^2 and its neighbours to the last digits, where ruckig throws for some."""
    velocity, acceleration, jerk = limits
    distance = 2 * acceleration**3 / jerk**2
    names = dict(zip(("max_velocity", "max_acceleration", "max_jerk"), limits, strict=True))
    start = np.full(9, 0.19)
    ends = [
        start + sign * distance,
        start + np.eye(9)[0] * sign * distance,
        start + np.eye(9)[2] * (sign * distance + 1e-17),
    ]
    ends += [np.r_[start[0] + sign * distance * (1 + k * 2.2e-16), start[1:]] for k in range(-8, 9)]
    for end in ends:
        found = point_to_point(start, end, **names, rest=0.02)
        assert found.lengths[-1] == pytest.approx(end, abs=1e-12)
        assert np.abs(found.velocities).max() <= velocity * (1 + 1e-5)
        assert np.abs(found.accelerations).max() <= acceleration * (1 + 1e-5)
    expected = 4 * acceleration / jerk
    assert len(found) == pytest.approx((expected + 0.02) / 1e-3, abs=2.5)


@pytest.mark.parametrize("distance", [0.0, 1e-15, 1e-9, 3.0])
def test_distances_beyond_the_usual(distance: float) -> None:
    found = point_to_point([0.1], [0.1 + distance])
    assert found.lengths[-1, 0] == pytest.approx(0.1 + distance, abs=1e-12)


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (lambda: hold(np.full(9, 0.19), 1.0, period=0.0), "period: 0"),
        (lambda: hold(np.full(9, 0.19), 1e12), r"1e\+15 rows, more than"),
        (lambda: point_to_point([0.1], [0.2], max_velocity=1e-9), "rows, more than"),
        (lambda: point_to_point([0.1], [0.2], rest=1e12), "rows, more than"),
        (lambda: point_to_point([0.1], [0.2], max_jerk=0.0), "max_jerk: 0"),
        (lambda: Reference.sampled([0.0, 1e12], [[0.1], [0.2]]), "rows, more than"),
        (lambda: tip_circle(NOMINAL, float("nan")), "radius: nan"),
        (lambda: tip_circle(NOMINAL, 0.1, height=float("inf")), "height: inf"),
    ],
)
def test_references_that_are_none(call: object, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        call()  # type: ignore[operator]


def test_a_reference_within_reach_is_found_so() -> None:
    reference = tip_circle(NOMINAL, 0.12, turns=0.5)
    found = reachability(NOMINAL, reference)
    assert found.complete
    assert str(found) == "all of the reference is within reach of bha_nominal"
    assert found.distance.max() < 1e-6
    limits = Limits.of(NOMINAL)
    assert np.all(found.pressures >= limits.low - 1e-6)
    assert np.all(found.pressures <= limits.high + 1e-6)


def test_the_part_out_of_reach_and_the_nearest_tip_are_named() -> None:
    """From the middle pressures to the highest and beyond: the second half is out of reach."""
    limits = Limits.of(NOMINAL)
    p = (limits.low + limits.high) / 2
    start, edge, beyond = (NOMINAL.static_lengths(p + k * (limits.high - p)) for k in (0.0, 1.0, 2.0))
    rows = np.vstack([start, edge, beyond])
    reference = Reference.sampled([0.0, 1.0, 2.0], rows, smoothing=0.0, period=0.01)
    found = reachability(NOMINAL, reference)
    assert found.reached[found.time < 0.9].all()
    assert not found.reached[found.time > 1.3].any()
    assert found.distance[-1] > 0.02
    assert found.at_limit[-1] == NOMINAL.inputs
    # The nearest is on the edge of what the pressures hold, nearer than the rest that holds the lengths best.
    nearest = np.linalg.norm(found.nearest - found.wanted, axis=1)
    assert np.all(nearest <= found.distance + 1e-9)
    text = str(found)
    assert "of the reference is out of reach of bha_nominal (1." in text
    assert "to 2 s)" in text
    assert "mm away, with" in text


def test_a_motion_that_needs_too_much_pressure_is_too_fast() -> None:
    """The same way slowly and fast; what a stiff arm's damping asks for is its damping times the speed."""
    arm = stiff_arm(damping=4000.0)
    p = np.full(6, 1.3e5)
    ends = [arm.static_lengths(p), arm.static_lengths(p + 5e3)]
    slow, fast = (point_to_point(*ends, max_velocity=v, max_acceleration=9.0, max_jerk=900.0) for v in (1e-3, 0.5))
    assert reachability(arm, slow).complete
    assert reachability(arm, slow).too_fast is None
    found = reachability(arm, fast)
    assert found.complete
    assert found.too_fast is not None
    assert "of the reference is too fast for stiff: at 0." in found.too_fast
    assert "0.7 to 2.2 bar are allowed" in found.too_fast


def test_an_arm_that_bends_in_a_plane_has_no_circle() -> None:
    arm = planar_arm()
    with pytest.raises(InputError, match=r"planar reaches no circle .* choose another reference"):
        tip_circle(arm)
    with pytest.warns(ReferenceWarning, match=r"out of reach of planar \(.*the nearest that pressures"):
        circle = tip_circle(arm, 0.03)
    found = reachability(arm, circle)
    off = np.abs(found.wanted[:, 1]) > 0.01
    assert off.any()
    assert not found.reached[off].any()
    assert np.abs(found.nearest[:, 1]).max() < 1e-6
    with pytest.warns(ReferenceWarning, match="out of reach"):
        tip_samples(arm, [0.0, 1.0], [[0.0, 0.02, 0.19], [0.0, 0.03, 0.19]])


def test_a_line_in_the_plane_is_within_reach() -> None:
    arm = planar_arm()
    limits = Limits.of(arm)
    p = (limits.low + limits.high) / 2
    ends = [arm.forward_kinematics(arm.static_lengths(p + d))[0][-1] for d in ([-5e3, 5e3, 0.0], [5e3, -5e3, 0.0])]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert reachability(arm, tip_line(arm, *ends, rest=0.1)).complete


def test_the_radius_suits_the_arm() -> None:
    limits = Limits.of(NOMINAL)
    heads, _ = NOMINAL.forward_kinematics((limits.shortest + limits.longest) / 2)
    height = float(heads[-1, 2])
    radius = comfortable_radius(NOMINAL, height - 0.05, limits)
    assert radius == pytest.approx(0.2 * height, rel=0.05)
    circle = tip_circle(NOMINAL, turns=0.25)
    assert np.hypot(*circle.tip_positions[:, :2].T) == pytest.approx(radius)
    # Weaker pressures, a smaller circle.
    middle = (limits.low + limits.high) / 2
    p = bha._core.rest_near(NOMINAL, (limits.shortest + limits.longest) / 2, limits.low, limits.high, middle).pressures
    weak = Limits(p - 1.5e4, p + 1.5e4, p, limits.shortest, limits.longest)
    assert comfortable_radius(NOMINAL, height - 0.05, weak) < 0.7 * radius
    with pytest.raises(InputError, match="has 6 lengths"):
        reachability(NOMINAL, hold(np.full(6, 0.1), 0.1))


def moved(arm: bha.Arm, position: tuple[float, float, float], rotation: tuple[float, float, float]) -> bha.Arm:
    """The arm elsewhere in the world, with gravity as it was to its base."""
    base = BaseParameters(position=position, rotation=rotation)
    gravity = base.rotation_matrix @ arm.parameters.gravity
    mapping = {**arm.parameters.to_mapping(), "gravity": gravity.tolist()}
    mapping["base"] = {"position": list(position), "rotation": list(rotation)}
    return bha.Arm(ArmParameters.from_mapping(mapping))


def test_circles_go_with_the_base() -> None:
    """Moved and turned together with gravity, an arm has the same circle, elsewhere."""
    arm = moved(NOMINAL, (0.4, -0.2, 1.1), (0.3, -0.8, 0.5))
    here, there = (tip_circle(a, turns=0.25) for a in (NOMINAL, arm))
    np.testing.assert_allclose(there.lengths, here.lengths, atol=1e-9)
    expected = arm.parameters.base_pose.in_world(here.tip_positions)
    np.testing.assert_allclose(there.tip_positions, expected, atol=1e-9)
    np.testing.assert_allclose(arm.parameters.base_pose.from_world(expected), here.tip_positions, atol=1e-12)


def test_targets_are_as_far_as_the_base_says() -> None:
    environments = pytest.importorskip("bha.environments")
    arm = moved(NOMINAL, (0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    with environments.ReachEnv(arm) as env:
        env.reset(seed=0, options={"target": (0.0, 0.0, 5.7)})
        with pytest.raises(InputError, match=r"target: 4\.3 m from the base"):
            env.reset(seed=0, options={"target": (0.0, 0.0, 0.7)})
