"""Arms made of values are those of the description at these values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha.arm.variants import Variants
from bha.estimation.free import resolve, with_values
from bha.parameters import ArmParameters, paths

Array = NDArray[np.float64]


def without_inertia() -> bha.Arm:
    """The nominal arm, its moments of inertia left to (56)."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    sections = [{k: v for k, v in s.items() if k not in ("inertia", "provenance")} for s in mapping["section"]]
    mapping = {k: v for k, v in mapping.items() if k != "provenance"} | {"section": sections}
    return bha.Arm(ArmParameters.from_mapping(mapping))


ARM = without_inertia()
FREE = (
    "section.1.mass",
    "section.*.mass",
    "section.2.inertia.*",
    "section.1.stiffness.2",
    "section.2.damping",
    "section.3.bellows.2.rest_length",
    "section.3.rest_length",
    "gravity.x",
    "section.2.center_of_mass.z",
    "sensors.camera_position.x",
)


def at_work(arm: Any, rng: np.random.Generator) -> Array:
    """Accelerations of an arm at some states."""
    states = rng.uniform(size=(3, 3 * 9))
    return np.array([arm.forward_dynamics(0.2 + 0.05 * s[:9], 0.1 * s[9:18], 1e5 * (1.0 + s[18:])) for s in states])


def variants_of(free: tuple[str, ...]) -> tuple[Variants, Array, Any]:
    coordinates = resolve(ARM.parameters, free)

    def describe(values: Array) -> Mapping[str, Any]:
        return with_values(ARM.parameters, coordinates, values).to_core()

    start = np.array([c.value(0.0) for c in coordinates])
    return Variants(describe, start, [c.scale for c in coordinates]), start, coordinates


def test_arms_of_values_are_those_of_the_file_with_these_values() -> None:
    """A mass alone and one factor on all of them, moments of inertia that follow the mass and have a factor too."""
    rng = np.random.default_rng(1)
    variants, start, coordinates = variants_of(FREE)
    assert variants.computed
    for _ in range(4):
        values = start * rng.uniform(0.5, 2.0, len(start)) + 0.01 * rng.standard_normal(len(start))
        direct = bha.Arm(with_values(ARM.parameters, coordinates, values))
        seed = int(rng.integers(1000))
        found, wanted = (at_work(arm, np.random.default_rng(seed)) for arm in (variants.arm(values), direct))
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)


def test_values_that_act_on_no_motion_make_no_other_arm() -> None:
    variants, start, _ = variants_of(FREE)
    camera, center = 0.1 * np.eye(len(start))[[-1, -2]]
    assert variants.arm(start + camera) is variants.arm(start)
    assert variants.arm(start + center) is not variants.arm(start)


def test_numbers_that_follow_in_curves_are_asked_for() -> None:
    """Moments of inertia by (56) go with the square of the outer radius."""
    variants, start, coordinates = variants_of(("section.1.bellows_outer_radius", "section.1.mass"))
    assert not variants.computed
    values = 1.3 * start
    direct = bha.Arm(with_values(ARM.parameters, coordinates, values))
    found, wanted = (at_work(arm, np.random.default_rng(2)) for arm in (variants.arm(values), direct))
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("free", [("section.1.mass", "section.2.damping"), ("section.1.bellows_outer_radius",)])
def test_effects_beside_have_numbers_of_their_own(free: tuple[str, ...]) -> None:
    variants, start, coordinates = variants_of(free)
    effects = [{"kind": "payload", "where": "section 3", "parameters": {"mass": 0.0, "z": 0.0}}]
    found = at_work(variants.beside(effects).arm(1.1 * start, [{"mass": 0.2, "z": 0.05}]), np.random.default_rng(3))
    table = {"kind": "payload", "where": "section 3", "mass": 0.2, "z": 0.05}
    direct = bha.Arm(with_values(ARM.parameters, coordinates, 1.1 * start)).with_effects([table])
    np.testing.assert_allclose(found, at_work(direct, np.random.default_rng(3)), rtol=1e-9)
    # The others have none.
    plain = bha.Arm(with_values(ARM.parameters, coordinates, start))
    np.testing.assert_array_equal(
        at_work(variants.arm(start), np.random.default_rng(3)), at_work(plain, np.random.default_rng(3))
    )


def test_values_of_no_arm_are_an_error() -> None:
    variants, start, _ = variants_of(("section.1.mass", "section.2.damping"))
    with pytest.raises(bha.ParameterError, match="section 1"):
        variants.arm(start * [-1.0, 1.0])
    with pytest.raises(bha.InputError, match="finite"):
        variants.arm(start * [np.nan, 1.0])
    assert paths.get_value(ARM.parameters, "section.1.mass") == start[0]


@pytest.mark.parametrize("time", [0.05, 0.1, 0.2, 0.3, 0.7])
def test_what_comes_down_to_nothing_is_nothing(time: float) -> None:
    """A dead time of 0, as a bound has it: 0.2 less 0.2 in computed steps is -1e-16, which no arm has."""
    parameters = ARM.with_effects([{"kind": "delay", "where": "all", "time": time}]).parameters
    (own,) = resolve(parameters, ("effect.1.time",))

    def describe(values: Array) -> Mapping[str, Any]:
        return with_values(parameters, (own,), values).to_core()

    variants = Variants(describe, [time], [0.1])
    assert variants.computed
    variants.arm(np.array([0.0]))
