"""The tables [base], [[section.arcs]] and [[section.masses]]: what is read is what is written, and faults are named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from test_parameters import HEAD, SECTION, fault, read

import bha
from bha.parameters import ArmParameters, BaseParameters, paths

BASE = """
[base]
position = [0.1, 0.2, 1.5]
rotation_deg = [0.0, 90.0, 0.0]
"""
ARCS = """
[[section.arcs]]
length = 0.25
bending = 0.4
relative_radius = 1.2

[[section.arcs]]
length = 0.75
bending = 0.6
"""
MASSES = """
[[section.masses]]
share = 0.5
mass = 0.2
offset = [0.01, 0.0, 0.0]

[[section.masses]]
share = 1
mass = 0.1
inertia = [1e-4, 1e-4, 2e-4]

[section.masses.provenance]
mass = "published"
"""
ARM = HEAD + SECTION + ARCS + MASSES + BASE


def test_written_and_read_again_is_the_same(tmp_path: Path) -> None:
    parameters = read(ARM)
    parameters.write(tmp_path / "arm.toml")
    assert ArmParameters.read(tmp_path / "arm.toml") == parameters
    assert ArmParameters.from_mapping(parameters.to_mapping()) == parameters
    core = json.loads(parameters.to_core_json())
    assert core["base"] == {"position": [0.1, 0.2, 1.5], "rotation": [0.0, np.pi / 2, 0.0]}
    assert core["section"][0]["arcs"][1] == {
        "length": 0.75,
        "bending": 0.6,
        "relative_radius": 1.0,
        "relative_area": 1.0,
    }
    assert core["section"][0]["masses"][0] == {
        "share": 0.5,
        "mass": 0.2,
        "inertia": [0, 0, 0],
        "offset": [0.01, 0, 0],
    }
    assert parameters.sections[0].total_mass == pytest.approx(0.8)


def test_values_are_stated_with_their_place() -> None:
    stated = {(v.section, v.part, v.key): v for v in read(ARM).stated_values()}
    assert stated[None, "base", "position"].unit == "m"
    assert stated[1, "arc 2", "bending"].value == 0.6
    assert stated[1, "mass 2", "mass"].provenance.status == "published"
    assert stated[1, None, "mass"].value == 0.5


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("bending = 0.6", "bending = 0.7", "section 1: arcs: the shares bending of the 2 arcs add up to 1.1; allowed"),
        ("length = 0.25", "length = 0.0", "section 1, arcs 1: length: found 0.0; allowed: a number > 0"),
        ("relative_radius = 1.2", "radius = 1.2", "section 1, arcs 1: radius: unknown key; allowed: length, bending"),
        (
            "bending = 0.4\nrelative_radius = 1.2\n\n[[section.arcs]]\nlength = 0.75\nbending = 0.6",
            "bending = -2.0\nrelative_radius = 9.0\n\n[[section.arcs]]\nlength = 0.75\nbending = 3.0",
            "the mean of relative_radius, weighted by bending, is not above 0",
        ),
        ("share = 0.5", "share = 1.5", "section 1, masses 1: share: found 1.5; allowed: a number from 0 (base) to 1"),
        ("mass = 0.2", "mass = 0.0", "section 1, masses 1: mass: found 0.0; allowed: a number > 0 (kg)"),
        ("mass = 0.1", "", "section 1, masses 2: mass: missing; allowed: a number > 0 (kg)"),
        ("rotation_deg = ", "rotation = [0.0, 0.0, 0.0]\nrotation_deg = ", "found both of rotation and rotation_deg"),
        ("[0.1, 0.2, 1.5]", "[0.1, 0.2]", "base.position: found [0.1, 0.2]; allowed: [x, y, z], numbers (m)"),
        (
            "relative_radius = 1.2",
            "relative_area = 1.2",
            'allowed: force_model = "work_conjugate", or one relative_area',
        ),
    ],
)
def test_faults_are_named(old: str, new: str, expected: str) -> None:
    assert old in ARM
    assert expected in fault(ARM.replace(old, new, 1))


def test_the_core_refuses_what_python_would() -> None:
    """Shares, areas and places are checked again where the arm is made."""
    good = json.loads(read(ARM).to_core_json())
    for change, expected in [
        ({"arcs": [{"length": 0.5, "bending": 1.0, "relative_radius": 1.0, "relative_area": 1.0}]}, "add up to 1"),
        ({"masses": [{"share": 2.0, "mass": 0.1, "inertia": [0, 0, 0], "offset": [0, 0, 0]}]}, "from 0 to 1"),
        (
            {"arcs": [a | {"relative_area": a["length"]} for a in good["section"][0]["arcs"]]},
            "work_conjugate is needed",
        ),
    ]:
        wrong = good | {"section": [good["section"][0] | change]}
        with pytest.raises(bha.errors.BhaError, match=expected):
            bha._core.Arm(json.dumps(wrong))


def test_paths() -> None:
    parameters = read(ARM)
    wanted = ("base.rotation.y", "base.position.z", "section.1.masses.2.mass", "section.1.masses.1.share")
    assert set(wanted) <= set(paths.available(parameters))
    assert paths.get_value(parameters, "base.rotation.y") == pytest.approx(np.pi / 2)
    changed = paths.with_values(parameters, dict.fromkeys(wanted, 0.3))
    assert [paths.get_value(changed, path) for path in wanted] == [0.3] * 4
    assert changed.base is not None
    assert changed.base.rotation == (0.0, 0.3, 0.0)
    assert (paths.unit_of(wanted[0]), paths.unit_of(wanted[1]), paths.unit_of(wanted[2])) == ("rad", "m", "kg")
    assert paths.get_value(read(HEAD + SECTION), "base.position.x") == 0.0
    made = paths.with_values(read(HEAD + SECTION), {"base.position.x": 0.5})
    assert made.base == BaseParameters(position=(0.5, 0.0, 0.0))


def test_base_turns_positions_back() -> None:
    base = read(ARM).base_pose
    np.testing.assert_allclose(base.rotation_matrix[:, 2], [1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(base.from_world([[0.4, 0.2, 1.5]]), [[0.0, 0.0, 0.3]], atol=1e-15)
    arm = bha.Arm(read(ARM))
    head = arm.forward_kinematics([0.2, 0.2, 0.2])[0]
    np.testing.assert_allclose(base.from_world(head), [[0.0, 0.0, 0.2]], atol=1e-15)
