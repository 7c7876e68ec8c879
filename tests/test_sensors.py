"""The tables [sensors] and [[length_sensor]] of parameter files, and the paths of their numbers."""

from __future__ import annotations

import json
import math
import pickle
from pathlib import Path

import pytest

import bha
from bha.errors import ParameterError
from bha.parameters import ArmParameters, paths

NOMINAL = (Path(bha.__file__).parent / "robots" / "bha_nominal.toml").read_text(encoding="utf-8")
SENSORS = """
[sensors]             # the camera hangs above
camera_position = [0.1, -0.2, 1.5]
camera_rotation_deg = [0.0, 30.0, 0.0]
camera_axes = ["x", "-y", "-z"]
lengths = "coordinates"

[sensors.provenance]
camera_rotation_deg = { status = "identified", ci95 = [[-1.0, 1.0], [29.0, 31.0], [-1.0, 1.0]] }
camera_position = "published"

[[length_sensor]]
name = "wire1"
angle_deg = 60.0
radius = 0.11
sections = [1, 2]
offset = 0.04         # up to the drum

[length_sensor.provenance]
angle_deg = { status = "identified", standard_error = 0.5 }

[[length_sensor]]
name = "wire 2"
angle = 1.0
radius = 0.0
sections = [3]
"""


def read(tables: str) -> ArmParameters:
    return ArmParameters.from_toml(NOMINAL + tables, origin="arm.toml")


def fault(tables: str) -> str:
    with pytest.raises(ParameterError) as caught:
        read(tables)
    return str(caught.value)


def test_written_and_read_again_is_the_same(tmp_path: Path) -> None:
    parameters = read(SENSORS)
    assert parameters.to_toml() == NOMINAL + SENSORS
    parameters.write(tmp_path / "arm.toml")
    again = ArmParameters.read(tmp_path / "arm.toml")
    assert again == parameters
    assert ArmParameters.from_mapping(parameters.to_mapping()) == parameters
    assert pickle.loads(pickle.dumps(bha.Arm(parameters))).parameters == parameters
    assert parameters.sensors is not None
    assert parameters.sensors.camera_rotation_rad == pytest.approx((0.0, math.radians(30.0), 0.0))
    assert [s.angle_rad for s in parameters.length_sensors] == pytest.approx([math.pi / 3, 1.0])
    assert [s.offset for s in parameters.length_sensors] == [0.04, 0.0]
    plain = read("")
    assert parameters != plain
    assert (plain.sensors, plain.length_sensors) == (None, ())
    assert parameters.updated({"length_sensor": [], "sensors": None}) == plain
    added = plain.updated({"sensors": {"camera_position": [0.0, 0.0, 1.0]}})
    assert added.to_toml().startswith(NOMINAL.rstrip())
    assert ArmParameters.from_toml(added.to_toml()) == added


def test_the_core_does_not_see_them() -> None:
    assert read(SENSORS).to_core_json() == read("").to_core_json()
    assert "sensor" not in json.loads(read(SENSORS).to_core_json())


def test_every_stated_value_has_its_unit_and_provenance() -> None:
    found = {
        (v.sensor, v.key): (v.value, v.unit, v.provenance.status) for v in read(SENSORS).stated_values() if v.sensor
    }
    assert found == {
        ("sensors", "camera_position"): ((0.1, -0.2, 1.5), "m", "published"),
        ("sensors", "camera_rotation_deg"): ((0.0, 30.0, 0.0), "deg", "identified"),
        ("sensors", "camera_axes"): (("x", "-y", "-z"), "", "assumed"),
        ("sensors", "lengths"): ("coordinates", "", "assumed"),
        ("length sensor wire1", "angle_deg"): (60.0, "deg", "identified"),
        ("length sensor wire1", "radius"): (0.11, "m", "assumed"),
        ("length sensor wire1", "sections"): ((1, 2), "", "assumed"),
        ("length sensor wire1", "offset"): (0.04, "m", "assumed"),
        ("length sensor wire 2", "angle"): (1.0, "rad", "assumed"),
        ("length sensor wire 2", "radius"): (0.0, "m", "assumed"),
        ("length sensor wire 2", "sections"): ((3,), "", "assumed"),
    }


FAULTS = [
    (
        '["x", "-y", "-z"]',
        '["x", "y", "-x"]',
        "camera_axes",
        "sensors.camera_axes: found ['x', 'y', '-x']; allowed: three",
    ),
    ('["x", "-y", "-z"]', '["x", "y"]', "camera_axes", "sensors.camera_axes: found ['x', 'y']; allowed: three texts"),
    ('["x", "-y", "-z"]', '["x", "y", "w"]', "camera_axes", "allowed: three texts, each of x, y, z once"),
    (
        '"coordinates"',
        '"q"',
        "lengths",
        'sensors.lengths: found "q"; allowed: "bellows" or "coordinates": what q11',
    ),
    ("[0.1, -0.2, 1.5]", "[0.1, inf, 1.5]", "camera_position", "allowed: [x, y, z], numbers (m): the origin"),
    (
        "lengths =",
        "camera_rotation = [0.0, 0.0, 0.0]\nlengths =",
        "camera_rotation_deg",
        "found both of camera_rotation",
    ),
    ("camera_position = [", "camera_positon = [", "camera_positon", "unknown key; nearest allowed: 'camera_position'"),
    (
        "sections = [1, 2]",
        "sections = [1, 4]",
        "sections = [1, 4]",
        "length_sensor 1: sections: found [1, 4]; allowed: ",
    ),
    ("sections = [1, 2]", "sections = [1, 1]", "sections = [1, 1]", "found [1, 1]; allowed: each section once"),
    ("sections = [1, 2]", "sections = [0]", "sections = [0]", "found [0]; allowed: a list of section numbers, from 1"),
    ("sections = [1, 2]", "sections = []", "sections = []", "found []; allowed: a list of section numbers, from 1"),
    ("angle_deg = 60.0\n", "", "[[length_sensor]]", "length_sensor 1: found neither of angle and angle_deg"),
    (
        "radius = 0.11",
        "radius = -0.1",
        "radius = -0.1",
        "length_sensor 1: radius: found -0.1; allowed: a number >= 0 (m)",
    ),
    ('name = "wire1"', 'name = "q14"', 'name = "q14"', 'found "q14"; allowed: a name that no one can take for another'),
    ('name = "wire1"', 'name = "P_11"', 'name = "P_11"', "(a log reads it as p11)"),
    ('name = "wire1"', 'name = "ow2"', 'name = "ow2"', "(a log reads it as ow2)"),
    ('name = "wire1"', 'name = "w [m]"', 'name = "w [m]"', "allowed: a name without blanks at its ends, brackets"),
    ('name = "wire1"', 'name = "wire 2"', 'name = "wire 2"', "length_sensor 2: name: found"),
    ("offset = 0.04 ", "ofset = 0.04 ", "ofset", "unknown key; nearest allowed: 'offset'"),
    (
        'camera_position = "published"',
        'camera_axis = "published"',
        "camera_axis",
        "there is no such value in this table",
    ),
]


@pytest.mark.parametrize(("old", "new", "at", "text"), FAULTS, ids=[f"{f[2]}-{k}" for k, f in enumerate(FAULTS)])
def test_faults_name_line_key_found_and_allowed(old: str, new: str, at: str, text: str) -> None:
    assert old in SENSORS
    tables = SENSORS.replace(old, new, 1)
    found = fault(tables)
    assert text in found
    lines = (NOMINAL + tables).split("\n")
    places = [k for k, line in enumerate(lines, start=1) if line.startswith(at)]
    assert any(found.startswith(f"arm.toml, line {k}: ") for k in places), found


def test_numbers_by_path() -> None:
    parameters = read(SENSORS)
    own = [path for path in paths.available(parameters) if paths.is_of_sensors(path)]
    assert own == [
        *(f"sensors.camera_position.{axis}" for axis in "xyz"),
        *(f"sensors.camera_rotation.{axis}" for axis in "xyz"),
        *(f"length_sensor.{k}.{name}" for k in (1, 2) for name in ("angle", "radius", "offset")),
    ]
    assert not set(own) & set(bha.parameter_names(bha.Arm(parameters)))
    for path in own:
        value = paths.get_value(parameters, path)
        changed = paths.with_values(parameters, {path: value + 0.01})
        assert paths.get_value(changed, path) == pytest.approx(value + 0.01, abs=1e-15)
        others = [other for other in paths.available(parameters) if other != path]
        before = [paths.get_value(parameters, other) for other in others]
        assert [paths.get_value(changed, other) for other in others] == pytest.approx(before, abs=1e-15)
        assert ArmParameters.from_toml(changed.to_toml()) == changed
    assert [paths.unit_of(path) for path in own[2:9]] == ["m", "rad", "rad", "rad", "rad", "m", "m"]
    assert paths.expand(parameters, "length_sensor.*.offset") == ("length_sensor.1.offset", "length_sensor.2.offset")
    for missing in ("length_sensor.3.offset", "sensors.camera_position.w", "sensors.lengths", "length_sensor.1.name"):
        with pytest.raises(ParameterError, match="no parameter"):
            paths.get_value(parameters, missing)
    with pytest.raises(ParameterError, match="radius: found -1"):
        paths.with_values(parameters, {"length_sensor.1.radius": -1.0})


def test_angles_that_change_are_stated_in_rad_with_their_provenance() -> None:
    changed = paths.with_values(read(SENSORS), {"sensors.camera_rotation.x": 0.1, "length_sensor.1.angle": 1.1})
    assert changed.sensors is not None
    assert changed.sensors.camera_rotation == pytest.approx((0.1, math.radians(30.0), 0.0))
    assert changed.sensors.camera_rotation_deg is None
    interval = changed.sensors.provenance["camera_rotation"].ci95
    assert interval is not None
    assert interval[1] == pytest.approx((math.radians(29.0), math.radians(31.0)))
    wire = changed.length_sensors[0]
    assert (wire.angle, wire.angle_deg) == (1.1, None)
    assert wire.provenance["angle"].standard_error == pytest.approx(math.radians(0.5))


def test_a_camera_that_is_not_stated_stands_in_the_base_frame_and_can_be_set() -> None:
    plain = read("")
    assert not [path for path in paths.available(plain) if paths.is_of_sensors(path)]
    assert paths.get_value(plain, "sensors.camera_position.z") == 0.0
    changed = paths.with_values(plain, {"sensors.camera_position.z": 1.2, "sensors.camera_rotation.y": 0.3})
    assert changed.sensors is not None
    assert changed.sensors.camera_position == (0.0, 0.0, 1.2)
    assert changed.sensors.camera_rotation == (0.0, 0.3, 0.0)
