"""Parameter files and mappings beyond all measure: an error that names the key, at once."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import bha
from bha.errors import ParameterError
from bha.parameters import ArmParameters, paths

HEAD = """\
schema = "bha-arm/1"
name = "test"
gravity = [0.0, 0.0, 9.81]
ambient_pressure = 101325.0
"""
SECTION = """
[[section]]
mass = 0.5
bellows_outer_radius = 0.03
bellows_radius = 0.1
terminal_area = 0.0026
rest_length = 0.15
stiffness = [1300.0, 1500.0]
damping = 18.0
bending_stiffness = [4.0]
length_range = [0.10, 0.30]
pressure_range = [0.7e5, 2.2e5]
"""
ARM = HEAD + SECTION
CREEP = '\n[[effect]]\nkind = "creep"\nwhere = "{where}"\nstiffness = {stiffness}\ntau = 1.0\n'


def fault(text: str) -> str:
    with pytest.raises(ParameterError) as caught:
        ArmParameters.from_toml(text, origin="arm.toml")
    return str(caught.value)


def fault_of_mapping(mapping: Any) -> str:
    with pytest.raises(ParameterError) as caught:
        ArmParameters.from_mapping(mapping)
    return str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "mass = 0.5",
            f"mass = {'9' * 5000}",
            "arm.toml, line 7: mass: found a number of thousands of digits; allowed: a",
        ),
        (
            "mass = 0.5",
            "mass = 1e308",
            "line 7: section 1: mass: found 1e+308, too great to compute with (above 1e+30)",
        ),
        (
            "mass = 0.5",
            "mass = 1e-310",
            "section 1: mass: found 1e-310, too small to compute with (below 1e-30); allowed",
        ),
        ("[0.10, 0.30]", "[0.1, 1e308]", "length_range: found [0.1, 1e+308], too great to compute with"),
        ("bellows_radius = 0.1", "bellows_radius = 1e200", "section 1: bellows_radius: found 1e+200, too great"),
        ("9.81]", "-1e31]", "line 3: gravity: found [0.0, 0.0, -1e+31], too great to compute with"),
    ],
)
def test_numbers_that_cannot_be_computed_with(old: str, new: str, expected: str) -> None:
    assert old in ARM
    assert expected in fault(ARM.replace(old, new, 1))


def test_small_numbers_are_allowed_where_nothing_is_divided_by_them() -> None:
    text = ARM.replace("damping = 18.0", "damping = 1e-300").replace("9.81", "1e-300")
    assert ArmParameters.from_toml(text).sections[0].damping == 1e-300


@pytest.mark.parametrize(
    ("stiffness", "where", "expected"),
    [
        (f"1{'0' * 400}", "all", "effect 1: stiffness: found 1000"),
        ("1e300", "all", "effect 1: stiffness: found 1e+300; allowed: a finite number, at most 1e+30 in size"),
        ("1.0", f"section {'9' * 5000}", 'effect 1: where: found "section 999'),
        ("1.0", "section ١", 'effect 1: where: found "section ١"; allowed'),
        ("1.0", "bellows 1_99999", 'effect 1: where: found "bellows 1_99999"; allowed'),
    ],
)
def test_effects_beyond_all_measure(stiffness: str, where: str, expected: str) -> None:
    found = fault(ARM + CREEP.format(stiffness=stiffness, where=where))
    assert expected in found
    assert len(found) < 1000


@pytest.mark.parametrize("name", ["²", "a.b", "7", "mass.ci95", "", "x" * 5000])
def test_keys_of_provenance_of_any_spelling(name: str) -> None:
    found = fault(f'{ARM}\n[section.provenance]\n"{name}" = "assumed"\n')
    assert "section 1: provenance." in found
    assert ": there is no such value in this table; " in found
    assert len(found) < 1000


def test_keys_of_mappings_are_texts() -> None:
    mapping = ArmParameters.from_toml(ARM).to_mapping()
    assert fault_of_mapping({**mapping, 5: 1}) == "<mapping>: found the key 5; keys are texts"
    section = mapping["section"][0]
    assert "section 1: found the key None; keys are texts" in fault_of_mapping(
        {**mapping, "section": [section | {None: 1}]}
    )
    changed = section | {"provenance": {5: "assumed"}}
    assert "section 1: provenance: found the key 5; keys are" in fault_of_mapping({**mapping, "section": [changed]})
    assert "found int; expected a mapping of keys to values" in fault_of_mapping(5)
    assert 'schema: found [1]; allowed: "bha-arm/1"' in fault_of_mapping({**mapping, "schema": [1]})


@pytest.mark.parametrize("value", [10**5000, [10**5000], -(10**400)], ids=["long", "in a list", "negative"])
def test_whole_numbers_of_any_length_in_mappings(value: Any) -> None:
    mapping = ArmParameters.from_toml(ARM).to_mapping()
    assert "gravity: found " in fault_of_mapping({**mapping, "gravity": value})


def test_ten_faults_are_shown_and_the_others_counted() -> None:
    text = HEAD + "".join(f"bad{k} = 1\n" for k in range(3000)) + SECTION
    lines = fault(text).split("\n")
    assert len(lines) == 11
    assert [line.partition(": ")[0] for line in lines[:10]] == [f"arm.toml, line {5 + k}" for k in range(10)]
    assert lines[10] == "... and 2990 more"


@pytest.mark.parametrize(
    "tail",
    [
        "\nx = '''\n[" + " " * 100_000 + "\n'''\n",
        "\nx = '''\n[[" + "a " * 50_000 + "\n'''\n",
        "".join(f"\n[[section]]\nstiffness = []\nmass{k} = 1\n" for k in range(2000)),
        "".join(CREEP.format(stiffness=k + 1, where="all") for k in range(3000))
        + CREEP.format(stiffness=1, where="all"),
    ],
    ids=["blanks", "words", "sections", "effects"],
)
def test_errors_of_large_files_come_at_once(tail: str, tmp_path: Path) -> None:
    # Once these took the square or the cube of their length: minutes.
    path = tmp_path / "arm.toml"
    path.write_text(ARM + tail)
    code = (
        f"import bha\ntry:\n    bha.Arm.load({str(path)!r})\nexcept bha.ParameterError as error:\n    print('refused')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "refused\n"


def test_an_effect_given_twice_is_named_with_the_first() -> None:
    two = CREEP.format(stiffness="1.0", where="all") + CREEP.format(stiffness="2.0", where="all")
    assert len(ArmParameters.from_toml(ARM + two).effects) == 2
    found = fault(ARM + two + CREEP.format(stiffness="2", where="all"))
    assert 'effect 3: kind: "creep" at "all" is already effect 2; allowed: several with different numbers' in found
    delay = '\n[[effect]]\nkind = "delay"\nwhere = "sensors"\ntime = {time}\n'
    found = fault(ARM + delay.format(time=0.1) + two + delay.format(time=0.2))
    assert 'effect 4: kind: "delay" at "sensors" is already effect 1; allowed: one' in found


def test_files_that_are_no_parameter_files(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="cannot be read: embedded null"):
        ArmParameters.read("arm\0.toml")
    path = tmp_path / "log.csv"
    with path.open("wb") as file:
        file.truncate(17 << 20)
    with pytest.raises(ParameterError, match="is larger than 16 MiB; no parameter file is"):
        ArmParameters.read(path)


def test_a_default_of_an_effect_is_to_be_stated_first() -> None:
    parameters = bha.robots.load("bha_nominal").parameters
    effect = {"kind": "friction", "where": "all", "coulomb_force": 1.0}
    arm = parameters.updated({"effect": [effect]})
    for call in (paths.get_value, paths.expand):
        with pytest.raises(ParameterError) as caught:
            call(arm, "effect.1.presliding")
        expected = "bha_nominal: effect.1.presliding: the default, 0.0002, is not stated; state presliding in effect 1"
        assert str(caught.value).startswith(expected)
    stated = parameters.updated({"effect": [effect | {"presliding": 1e-3}]})
    assert paths.get_value(stated, "effect.1.presliding") == 1e-3


@pytest.mark.parametrize(
    "path", ["section.².mass", "section.١.mass", f"section.{'9' * 5000}.mass", "effect.².tau", "section.0.mass"]
)
def test_numbers_in_paths_are_plain_digits(path: str) -> None:
    with pytest.raises(ParameterError, match="no parameter"):
        paths.get_value(ArmParameters.from_toml(ARM), path)
