"""Keys of what holds a section beside its bellows: stated, checked, named by paths, written back."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import bha
from bha.errors import ParameterError
from bha.identification.words import spoken
from bha.parameters import ArmParameters, paths

PLAIN = """\
schema = "bha-arm/1"
name = "one"
gravity = [0.0, 0.0, 9.81]
ambient_pressure = 101325.0

[[section]]
mass = 0.4
bellows_radius = 0.05
bellows_outer_radius = 0.02
terminal_area = 0.001
rest_length = 0.2
stiffness = [150.0]
damping = 4.0
bending_stiffness = [0.2]
length_range = [0.15, 0.25]
pressure_range = [0.9e5, 2.0e5]
"""
HELD = (
    PLAIN
    + """\
cross_bending_stiffness = [0.6, 0.1]
bending_plane_deg = 30.0   # of the seam
axial_stiffness = [8000.0, 0.0, 1e5]
axial_damping = 12.0

[section.provenance]
bending_plane_deg = { status = "identified", ci95 = [28.0, 32.0] }
axial_stiffness = "published"
"""
)


def read(text: str) -> ArmParameters:
    return ArmParameters.from_toml(text, origin="one.toml")


def test_the_core_gets_what_is_stated_and_nothing_else() -> None:
    plain = json.loads(read(PLAIN).to_core_json())["section"][0]
    assert not {"cross_bending_stiffness", "bending_plane", "axial"} & plain.keys()
    held = json.loads(read(HELD).to_core_json())["section"][0]
    assert held["cross_bending_stiffness"] == [0.6, 0.1, 0.0]
    assert held["bending_plane"] == pytest.approx(math.pi / 6)
    assert held["axial"] == {"stiffness": [8000.0, 0.0, 1e5], "rest_length": 0.2, "damping": 12.0}
    damped = json.loads(read(PLAIN + "axial_damping = 3.0\naxial_rest_length = 0.21").to_core_json())["section"][0]
    assert damped["axial"] == {"stiffness": [0.0], "rest_length": 0.21, "damping": 3.0}


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("bending_plane = 0.5", "bending_plane: says nothing without cross_bending_stiffness"),
        (
            "cross_bending_stiffness = [1.0]\nbending_plane = 0.1\nbending_plane_deg = 3.0",
            "found both of bending_plane",
        ),
        ("cross_bending_stiffness = []", "cross_bending_stiffness: found []; allowed: [k1], [k1, k3] or"),
        ("cross_bending_stiffness = [1.0, 2.0, 3.0, 4.0]", "cross_bending_stiffness: found [1.0, 2.0, 3.0, 4.0]"),
        ("axial_stiffness = []", "axial_stiffness: found []; allowed: 1 to 8 numbers"),
        ("axial_stiffness = [nan]", "axial_stiffness: found [nan]"),
        ("axial_rest_length = 0.0", "axial_rest_length: found 0.0; allowed: a number > 0 (m)"),
        ("axial_damping = -1.0", "axial_damping: found -1.0; allowed: a number >= 0"),
        ("axial_stifness = [1.0]", "nearest allowed: 'axial_stiffness'"),
    ],
)
def test_faults_name_the_key(lines: str, said: str) -> None:
    with pytest.raises(ParameterError) as fault:
        read(PLAIN + lines)
    assert said in str(fault.value)
    assert "one.toml" in str(fault.value)


def test_a_layout_may_be_held_by_them() -> None:
    """Two bellows in a line leave a plane and, one bellows alone, lengthening to what else holds."""
    flat = PLAIN.replace("bending_stiffness = [0.2]", "bending_stiffness = [0.0]")
    pair = "\n[[section.bellows]]\nangle_deg = 0.0\n[[section.bellows]]\nangle_deg = 180.0\n"
    with pytest.raises(ParameterError, match="free to bend"):
        read(flat + pair)
    read(flat + "cross_bending_stiffness = [0.5]\n" + pair)
    with pytest.raises(ParameterError, match="free to bend"):
        # Stiff in the plane that the bellows hold already.
        read(flat + "cross_bending_stiffness = [0.5]\nbending_plane_deg = 90.0\n" + pair)


def test_paths_name_their_numbers() -> None:
    held, plain = read(HELD), read(PLAIN)
    wanted = {
        "section.1.cross_bending_stiffness.1": 0.6,
        "section.1.cross_bending_stiffness.2": 0.1,
        "section.1.bending_plane": math.pi / 6,
        "section.1.axial_stiffness.1": 8000.0,
        "section.1.axial_stiffness.3": 1e5,
        "section.1.axial_rest_length": 0.2,
        "section.1.axial_damping": 12.0,
    }
    assert set(wanted) <= set(paths.available(held))
    assert not set(wanted) & set(paths.available(plain))
    for path, value in wanted.items():
        assert paths.get_value(held, path) == pytest.approx(value)
        assert paths.get_value(paths.with_values(held, {path: 1.25 * value}), path) == pytest.approx(1.25 * value)
    # Where they are not stated they follow others, until they are set.
    assert paths.get_value(plain, "section.1.cross_bending_stiffness.1") == 0.2
    assert paths.get_value(plain, "section.1.axial_stiffness.1") == 0.0
    assert paths.get_value(plain, "section.1.axial_rest_length") == 0.2
    set_once = paths.with_values(plain, {"section.1.axial_stiffness.2": 500.0})
    assert set_once.sections[0].axial_stiffness == (0.0, 500.0)
    with pytest.raises(ParameterError, match="says nothing without cross_bending_stiffness"):
        paths.with_values(plain, {"section.1.bending_plane": 0.3})
    both = paths.with_values(plain, {"section.1.cross_bending_stiffness.1": 0.5, "section.1.bending_plane": 0.3})
    assert both.sections[0].bending_plane_rad == 0.3
    assert [paths.unit_of(p) for p in wanted] == ["N m", "N m", "rad", "N/m", "N/m^3", "m", "N s/m"]
    assert spoken("section.1.axial_stiffness.1") == "linear axial stiffness of section 1"
    assert spoken("section.1.cross_bending_stiffness.2") == "cubic cross bending stiffness of section 1"


def test_an_angle_in_degrees_is_set_in_radians_with_its_provenance() -> None:
    turned = paths.with_values(read(HELD), {"section.1.bending_plane": 0.5})
    section = turned.sections[0]
    assert (section.bending_plane, section.bending_plane_deg) == (0.5, None)
    assert section.provenance["bending_plane"].ci95 == pytest.approx((math.radians(28.0), math.radians(32.0)))
    assert ArmParameters.from_toml(turned.to_toml()) == turned


def test_derivatives_by_numbers_that_the_file_does_not_state() -> None:
    arm = bha.Arm.from_parameters(read(PLAIN))
    names = ("section.1.axial_stiffness.1", "section.1.cross_bending_stiffness.1", "section.1.mass")
    q, qd, p = np.array([0.21, 0.19, 0.23]), np.array([0.1, -0.2, 0.05]), np.full(3, 1.2e5)
    found = arm.forward_dynamics_derivatives(q, qd, p, parameters=names).by_parameters
    for k, (name, h) in enumerate(zip(names, (1e-2, 1e-5, 1e-5), strict=True)):
        value = paths.get_value(arm.parameters, name)
        ends = [arm.with_values({name: value + d}).forward_dynamics(q, qd, p) for d in (h, -h)]
        np.testing.assert_allclose(found[:, k], (ends[0] - ends[1]) / (2 * h), rtol=1e-6, atol=1e-9)


def test_a_virtual_arm_refuses_them() -> None:
    from bha import _core  # noqa: PLC0415

    parameters = read(HELD)
    with pytest.raises(bha.InputError, match="section 1 states"):
        _core.VirtualArm(parameters.to_core_json(), [(0, 0.0, (0.0, 0.0, 0.0))], [])
