"""Parameter files: what is read is what is written; faults are named with file, line, key, found and allowed."""

import json
import math
import pickle
import tomllib
from pathlib import Path
from typing import Any

import pytest

from bha.errors import InputError, ParameterError, ParameterWarning
from bha.parameters import ArmParameters

HEAD = """\
schema = "bha-arm/1"
name = "test"
gravity = [0.0, 0.0, 9.81]
ambient_pressure = 101325.0
"""
SECTION = """
[[section]]
mass = 0.5
inertia = [2e-3, 2e-3, 3e-3]
bellows_radius = 0.1
terminal_area = 0.0026
rest_length = 0.15
stiffness = [1300.0, 1500.0]
damping = 18.0
bending_stiffness = [4.0]
length_range = [0.10, 0.30]
pressure_range = [0.7e5, 2.2e5]
"""
ARM = HEAD + SECTION + SECTION.replace("0.5", "0.4")
FOUR_BELLOWS = """
[[section.bellows]]
angle_deg = 180.0
input = "p11"

[[section.bellows]]
angle = 0.0
radius = 0.05
stiffness = [10.0]

[[section.bellows]]
angle_deg = 90.0
input = "p13"
terminal_area = 0.001

[[section.bellows]]
angle_deg = 270.0
input = "p13"
damping = 1.0
rest_length = 0.2
"""
PROVENANCE = """
[section.provenance]
mass = { status = "identified", ci95 = [0.4, 0.6], standard_error = 0.05, logs = [{ name = "a.csv", sha256 = "HASH" }] }
inertia = "published"
stiffness = { status = "identified", ci95 = [[1.0, 2.0], [3.0, 4.0]], standard_error = [0.5, 0.25] }
""".replace("HASH", "0123456789abcdef" * 4)


def read(text: str) -> ArmParameters:
    return ArmParameters.from_toml(text, origin="arm.toml")


def fault(text: str) -> str:
    with pytest.raises(ParameterError) as caught:
        read(text)
    return str(caught.value)


def core(parameters: ArmParameters) -> Any:
    return json.loads(parameters.to_core_json())


def test_core_json_is_complete_and_says_what_the_file_says() -> None:
    found = core(read(ARM))
    sections = found.pop("section")
    assert found == {
        "name": "test",
        "gravity": [0, 0, 9.81],
        "ambient_pressure": 101325,
        "force_model": "end_force",
        "rotational_energy": True,
        "coriolis_forces": True,
        "inputs": ["p11", "p12", "p13", "p21", "p22", "p23"],
        "effect": [],
    }
    assert [section["mass"] for section in sections] == [0.5, 0.4]
    bellows = sections[1].pop("bellows")
    assert sections[1] == {
        "mass": 0.4,
        "inertia": [2e-3, 2e-3, 3e-3],
        "center_of_mass": [0, 0, 0],
        "force_point": None,
        "bellows_radius": 0.1,
        "base_offset": 0,
        "head_offset": 0,
        "bending_stiffness": [4, 0, 0],
        "length_range": [0.1, 0.3],
    }
    assert [b["angle"] for b in bellows] == pytest.approx([0, 2 * math.pi / 3, 4 * math.pi / 3], abs=1e-15)
    assert [b["input"] for b in bellows] == [3, 4, 5]
    assert bellows[0] == {
        "angle": 0,
        "radius": 0.1,
        "terminal_area": 0.0026,
        "rest_length": 0.15,
        "stiffness": [1300, 1500],
        "damping": 18,
        "input": 3,
    }


def test_bellows_inherit_from_their_section_and_share_inputs() -> None:
    parameters = read(HEAD + SECTION + FOUR_BELLOWS)
    assert parameters.inputs == ("p11", "p12", "p13")
    a, b, c, d = core(parameters)["section"][0]["bellows"]
    assert [a["input"], b["input"], c["input"], d["input"]] == [0, 1, 2, 2]
    assert [a["angle"], b["angle"], c["angle"], d["angle"]] == pytest.approx([math.pi, 0, math.pi / 2, 1.5 * math.pi])
    assert [a["radius"], b["radius"]] == [0.1, 0.05]
    assert [a["stiffness"], b["stiffness"]] == [[1300, 1500], [10]]
    assert [b["terminal_area"], c["terminal_area"]] == [0.0026, 0.001]
    assert [c["damping"], d["damping"]] == [18, 1]
    assert [c["rest_length"], d["rest_length"]] == [0.15, 0.2]


def test_inertia_left_out_is_that_of_equation_56() -> None:
    text = ARM.replace("inertia = [2e-3, 2e-3, 3e-3]", "bellows_outer_radius = 0.03", 1)
    lateral = 0.25 * 0.5 * 0.13**2 + 0.5 * 0.2**2 / 12
    assert core(read(text))["section"][0]["inertia"] == pytest.approx([lateral, lateral, 0.5 * 0.5 * 0.13**2])


def test_input_names_keep_numbers_of_two_digits_apart() -> None:
    names = read(HEAD + SECTION * 11).inputs
    assert names[24:] == ("p91", "p92", "p93", "p10_1", "p10_2", "p10_3", "p11_1", "p11_2", "p11_3")
    assert len(set(names)) == 33
    many = "".join(f"\n[[section.bellows]]\nangle_deg = {30 * k}\n" for k in range(12))
    assert read(HEAD + SECTION + many).inputs[-4:] == ("p19", "p1_10", "p1_11", "p1_12")


@pytest.mark.parametrize("tail", ["", PROVENANCE, FOUR_BELLOWS, PROVENANCE + FOUR_BELLOWS])
def test_written_and_read_again_is_the_same(tail: str, tmp_path: Path) -> None:
    text = HEAD + '# a comment\n[provenance]\ngravity = "published"\n' + SECTION + tail + SECTION
    parameters = read(text)
    parameters.write(tmp_path / "arm.toml")
    assert (tmp_path / "arm.toml").read_text() == text
    assert ArmParameters.read(tmp_path / "arm.toml") == parameters
    without_text = ArmParameters.from_mapping(parameters.to_mapping())
    assert without_text == parameters
    assert tomllib.loads(without_text.to_toml()) == parameters.to_mapping()
    assert read(without_text.to_toml()) == parameters
    copy = pickle.loads(pickle.dumps(parameters))
    assert copy == parameters
    assert hash(copy) == hash(parameters)
    assert copy.to_toml() == text


def test_changes_keep_comments_order_and_the_spelling_of_numbers() -> None:
    parameters = read(ARM.replace("damping = 18.0", "damping = 18.0  # a guess", 1))
    sections = parameters.to_mapping()["section"]
    sections[0]["damping"] = 17.5
    sections[0]["provenance"] = {
        "damping": {"status": "identified", "ci95": [17.0, 18.0], "logs": [{"name": "a.csv", "sha256": "0" * 64}]}
    }
    changed = parameters.updated({"section": sections, "force_model": "work_conjugate"})
    written = changed.to_toml()
    assert "damping = 17.5  # a guess" in written
    assert "pressure_range = [0.7e5, 2.2e5]" in written
    places = [written.index(text) for text in ("name =", "gravity =", "force_model =", "[[section]]")]
    assert places == sorted(places)
    assert read(written) == changed
    assert changed != parameters
    assert changed.sections[0].provenance["damping"].ci95 == (17.0, 18.0)


def test_a_different_number_of_sections_is_written_too() -> None:
    parameters = read(ARM)
    shorter = parameters.updated({"section": parameters.to_mapping()["section"][:1]})
    assert read(shorter.to_toml()) == shorter
    assert len(shorter.sections) == 1


def test_provenance_is_assumed_where_nothing_is_said() -> None:
    values = {(v.section, v.key): v for v in read(HEAD + SECTION + PROVENANCE + SECTION).stated_values()}
    assert values[1, "inertia"].provenance.status == "published"
    assert values[1, "damping"].provenance.status == "assumed"
    assert values[1, "mass"].provenance.ci95 == (0.4, 0.6)
    assert values[1, "mass"].unit == "kg"
    assert values[2, "mass"].provenance.status == "assumed"
    assert values[None, "gravity"].value == (0.0, 0.0, 9.81)


FAULTS = [
    ("mass = 0.5", "mass = -0.5", "arm.toml, line 7: section 1: mass: found -0.5; allowed: a number > 0 (kg)"),
    ("mass = 0.4", "mass = nan", "arm.toml, line 19: section 2: mass: found nan; allowed: a number > 0 (kg)"),
    ("mass = 0.4", "mass = inf", "arm.toml, line 19: section 2: mass: found inf; allowed: a number > 0 (kg)"),
    ("mass = 0.4", 'mass = "0.4"', 'arm.toml, line 19: section 2: mass: found "0.4"; allowed: a number > 0 (kg)'),
    ("mass = 0.4", "mass = true", "arm.toml, line 19: section 2: mass: found true; allowed: a number > 0 (kg)"),
    ("mass = 0.4", f"mass = 1{'0' * 400}", "section 2: mass: found 1000"),
    ("mass = 0.4", "", "arm.toml, line 18: section 2: mass: missing; allowed: a number > 0 (kg)"),
    ("mass = 0.5", "mas = 0.5", "arm.toml, line 7: section 1: mas: unknown key; nearest allowed: 'mass'"),
    ("mass = 0.5", "mass = 0.5\nmass = 0.6", "arm.toml, line 8: mass is given twice; remove one of the two"),
    ("[0.0, 0.0, 9.81]", "[0.0, 9.81]", "line 3: gravity: found [0.0, 9.81]; allowed: [x, y, z], numbers (m/s^2)"),
    ("[1300.0, 1500.0]", "[]", "arm.toml, line 12: section 1: stiffness: found []; allowed: 1 to 8 numbers"),
    (
        "[1300.0, 1500.0]",
        "[1, 2, 3, 4, 5, 6, 7, 8, 9]",
        "stiffness: found [1, 2, 3, 4, 5, 6, 7, 8, 9]; allowed: 1 to 8",
    ),
    ("[1300.0, 1500.0]", "[1.0, nan]", "section 1: stiffness: found [1.0, nan]; allowed: 1 to 8 numbers"),
    ("[4.0]", "[4, 1, 1, 1]", "bending_stiffness: found [4, 1, 1, 1]; allowed: [k1], [k1, k3] or [k1, k3, k5]"),
    ("[0.10, 0.30]", "[0.3, 0.1]", "length_range: found [0.3, 0.1]: the range is empty, 0.3 is not below 0.1; allowed"),
    ("[0.7e5, 2.2e5]", "[2e5, 1e5]", "section 1: pressure_range: found [200000.0, 100000.0]: the range is empty"),
    ("inertia = [2e-3, 2e-3, 3e-3]", "", "inertia: missing; give inertia, or bellows_outer_radius so that (56)"),
    ("[2e-3, 2e-3, 3e-3]", "[-1, 1, 1]", "section 1: inertia: found [-1, 1, 1]; allowed: [Jx, Jy, Jz], numbers >= 0"),
    ('"test"', '"test"\nforce_model = "x"', 'force_model: found "x"; allowed: "end_force" or "work_conjugate"'),
    ('"test"', '"test"\ncoriolis_forces = 1', "arm.toml, line 3: coriolis_forces: found 1; allowed: true or false"),
    ('"test"', '"test"\ngravty = 1', "arm.toml, line 3: gravty: unknown key; nearest allowed: 'gravity'"),
    ('"test"', '"test"\nwheel = []', "arm.toml, line 3: wheel: unknown key; allowed: schema, name, gravity"),
    ('name = "test"', "name = 7", "arm.toml, line 2: name: found 7; allowed: a text of 1 to 200 characters"),
    ("bha-arm/1", "bha-arm/2", 'arm.toml: schema: found "bha-arm/2"; allowed: "bha-arm/1"'),
    ('schema = "bha-arm/1"', "", "arm.toml: schema: missing; a parameter file of an arm begins with: schema ="),
    ("gravity = [", "gravity = [[", "arm.toml: not a TOML file: Unclosed array (at line 4"),
]


@pytest.mark.parametrize(("old", "new", "expected"), FAULTS)
def test_faults_are_named(old: str, new: str, expected: str) -> None:
    assert old in ARM
    assert expected in fault(ARM.replace(old, new, 1))


BELLOWS_FAULTS = [
    ("damping = 1.0", "damping = -1.0", "section 1, bellows 4: damping: found -1.0; allowed: a number >= 0 (N s/m)"),
    ("damping = 1.0", "dampng = 1.0", "section 1, bellows 4: dampng: unknown key; nearest allowed: 'damping'"),
    ("angle = 0.0\n", "", "section 1, bellows 2: found neither of angle and angle_deg; allowed: exactly one of them"),
    (
        "angle = 0.0\n",
        "angle = 0.0\nangle_deg = 0\n",
        "bellows 2: found both of angle and angle_deg; allowed: exactly one",
    ),
    ('input = "p11"', 'input = "valve"', 'section 1, bellows 1: input: found "valve"; allowed: the name of a pressure'),
    ("stiffness = [10.0]", "stiffness = 10.0", "section 1, bellows 2: stiffness: found 10.0; allowed: 1 to 8 numbers"),
]


@pytest.mark.parametrize(("old", "new", "expected"), BELLOWS_FAULTS)
def test_faults_of_bellows_are_named(old: str, new: str, expected: str) -> None:
    assert old in FOUR_BELLOWS
    text = HEAD + SECTION + FOUR_BELLOWS.replace(old, new, 1)
    found = fault(text)
    assert expected in found
    if new:
        line = next(n for n, line in enumerate(text.split("\n"), start=1) if line == new.split("\n", maxsplit=1)[0])
        assert f"arm.toml, line {line if 'bellows 2: found' not in found else line - 1}: " in found


PROVENANCE_FAULTS = [
    (
        '"published"',
        '"guessed"',
        'section 1: provenance.inertia.status: found "guessed"; allowed: one of "published", "',
    ),
    (
        '"published"',
        "7",
        'section 1: provenance.inertia: found 7; allowed: one of "published", "measured", "assumed", "identified", or',
    ),
    ("inertia =", "inertja =", "provenance.inertja: there is no such value in this table; nearest allowed: 'inertia'"),
    ("[0.4, 0.6]", "[[0.4, 0.6]]", "provenance.mass.ci95: found a list of 1; allowed: a single one, as the value has"),
    ("[0.4, 0.6]", "[0.6, 0.4]", "section 1: provenance.mass.ci95: found [0.6, 0.4]"),
    (
        "[0.5, 0.25]",
        "0.5",
        "provenance.stiffness.standard_error: found a single one; allowed: a list of 2, as the value",
    ),
    ("0123", "xyz", "section 1: provenance.mass.logs"),
    (
        "standard_error = 0.05",
        "standard_eror = 0.05",
        "mass.standard_eror: unknown key; nearest allowed: 'standard_error'",
    ),
]


@pytest.mark.parametrize(("old", "new", "expected"), PROVENANCE_FAULTS)
def test_faults_of_provenance_are_named(old: str, new: str, expected: str) -> None:
    assert old in PROVENANCE
    assert expected in fault(HEAD + SECTION + PROVENANCE.replace(old, new, 1))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (HEAD + "section = []", "section: found []; allowed: one [[section]] table, in double brackets, per section"),
        (HEAD, "section: missing; allowed: one [[section]] table"),
        (HEAD + SECTION.replace("[[section]]", "[section]"), "section: found a table; allowed: one [[section]] table"),
        (HEAD + SECTION + "bellows = []", "section 1: bellows: found []; allowed: 1 to 12"),
        (
            HEAD + SECTION + "\n[[section.bellows]]\nangle = 1\n" * 13,
            "bellows: found a list of 13 tables; allowed: 1 to 12",
        ),
        ("x = " + "[" * 5000, "arm.toml: not a TOML file: nested too deeply"),
        ("", "arm.toml: schema: missing"),
    ],
)
def test_faults_of_structure_are_named(text: str, expected: str) -> None:
    assert expected in fault(text)


def test_every_fault_is_listed() -> None:
    text = fault(ARM.replace("mass = 0.5", "mass = -1").replace("damping", "dampping"))
    assert text.count("\n") == 4
    assert "section 1: mass: found -1" in text
    assert text.count("nearest allowed: 'damping'") == 2


@pytest.mark.parametrize(
    ("layout", "held"),
    [
        ([(0, 0.1), (180, 0.1)], False),
        ([(0, 0.1), (180, 0.05), (0, 0.02)], False),
        ([(0, 0.1), (0, 0.1), (0, 0.1)], False),
        ([(0, 0.0)], False),
        ([(0, 0.1), (180, 0.1), (90, 0.1)], True),
        ([(0, 0.0), (0, 0.1), (90, 0.1)], True),
    ],
)
def test_a_layout_that_leaves_a_direction_free_is_an_error(layout: list[tuple[float, float]], held: bool) -> None:
    bellows = "".join(f"\n[[section.bellows]]\nangle_deg = {angle}\nradius = {radius}\n" for angle, radius in layout)
    assert read(HEAD + SECTION + bellows), "a bending stiffness holds every direction"
    free = HEAD + SECTION.replace("bending_stiffness = [4.0]", "bending_stiffness = [0.0]") + bellows
    if held:
        assert read(free)
    else:
        assert f"section 1: bellows: the {len(layout)} bellows leave the section free to bend" in fault(free)


def test_impossible_inertia_is_warned_of() -> None:
    with pytest.warns(
        ParameterWarning, match=r"arm.toml: section 1: inertia: found \[0.002, 0.002, 0.005\], which no rig"
    ):
        read(ARM.replace("3e-3", "5e-3", 1))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"missing.toml: there is no such file"):
        ArmParameters.read(tmp_path / "missing.toml")
    with pytest.raises(ParameterError, match=r"is a folder; name a parameter file"):
        ArmParameters.read(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\x00\xff\xfe")
    with pytest.raises(ParameterError, match=r"binary.toml: not a TOML file: byte 1 is not UTF-8 text; save it"):
        ArmParameters.read(tmp_path / "binary.toml")
    (tmp_path / "log.csv").write_text("t [s],p11 [Pa]\n0,1\n")
    with pytest.raises(ParameterError, match=r"log.csv: not a TOML file: .*; name a file that ends with .toml"):
        ArmParameters.read(tmp_path / "log.csv")
    with pytest.raises(InputError, match=r"the folder .* does not exist"):
        read(ARM).write(tmp_path / "nowhere" / "arm.toml")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["binary.toml", "log.csv"]


def test_windows_line_ends_and_byte_order_mark(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_bytes(b"\xef\xbb\xbf" + ARM.replace("\n", "\r\n").encode())
    parameters = ArmParameters.read(tmp_path / "arm.toml")
    assert parameters == read(ARM)
    assert read(parameters.to_toml()) == parameters
