"""The arm as Python has it: files, copies with changes, pickles; and the arms that come with the package."""

import copy
import json
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import bha.robots
from bha import _core
from bha.arm import Arm
from bha.errors import InputError, ParameterError
from bha.parameters import ArmParameters

SHARED = Path(__file__).parents[2] / "shared"


def test_names() -> None:
    assert set(bha.robots.names()) >= {"asu_two_section", "bha_nominal"}
    with pytest.raises(
        ParameterError, match=r"no arm 'bha_nominl' comes with this package; nearest allowed: 'bha_nominal'"
    ):
        bha.robots.load("bha_nominl")


@pytest.mark.parametrize("name", bha.robots.names())
def test_arms_that_come_with_the_package(name: str) -> None:
    arm = bha.robots.load(name)
    assert arm.name == name
    values = list(arm.parameters.stated_values())
    published = {value.key for value in values if value.provenance.status == "published"}
    assert published, "every arm that ships has something that is known"
    assert "stiffness" not in published
    q = np.repeat([0.5 * sum(section.length_range) for section in arm.parameters.sections], 3)
    positions, _ = arm.forward_kinematics(q)
    offsets = sum(section.base_offset + section.head_offset for section in arm.parameters.sections)
    np.testing.assert_allclose(positions[-1], [0, 0, q[::3].sum() + offsets], atol=1e-12)


def test_nominal_arm_has_nine_inputs_and_published_radii_and_lengths() -> None:
    arm = bha.robots.load("bha_nominal")
    assert (arm.section_count, len(arm.inputs)) == (3, 9)
    published = {(v.section, v.key) for v in arm.parameters.stated_values() if v.provenance.status == "published"}
    assert published == {(section, key) for section in (1, 2, 3) for key in ("bellows_radius", "length_range")}


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the nominal parameter file")
def test_nominal_arm_is_the_one_of_the_parameter_file() -> None:
    shared = json.loads(Arm.load(SHARED / "bha_nominal.toml").parameters.to_core_json())
    shipped = json.loads(bha.robots.load("bha_nominal").parameters.to_core_json())
    assert shipped.pop("pneumatics")["level"] == "ideal"  # said in the file that ships, and the same as not saying it
    assert shared == shipped


def test_input_1_of_the_real_arm_bends_it_to_positive_x_and_input_3_only_lengthens_it() -> None:
    arm = bha.robots.load("asu_two_section")
    assert arm.inputs == ("p21", "p22", "p23", "p11", "p12", "p13")
    ambient = arm.parameters.ambient_pressure

    def head(**gauge: float) -> np.ndarray:
        p = np.array([ambient + gauge.get(name, 0.0) for name in arm.inputs])
        return arm.forward_kinematics(arm.static_lengths(p))[0][-1]

    rest = head()
    np.testing.assert_allclose(rest[:2], 0.0, atol=1e-9)
    assert head(p21=50e3, p11=50e3)[0] > 0.05
    assert head(p22=50e3, p12=50e3)[0] < -0.05
    both = head(p23=50e3, p13=50e3)
    np.testing.assert_allclose(both[:2], 0.0, atol=1e-9)
    assert both[2] > rest[2] + 0.01


def test_an_arm_is_its_parameters(tmp_path: Path) -> None:
    arm = bha.robots.load("bha_nominal")
    arm.save(tmp_path / "arm.toml")
    q = np.linspace(0.12, 0.28, 9)
    expected = arm.forward_kinematics(q)[0]
    for other in (Arm.load(tmp_path / "arm.toml"), pickle.loads(pickle.dumps(arm)), copy.deepcopy(arm)):
        assert other == arm
        assert hash(other) == hash(arm)
        assert type(other) is Arm
        np.testing.assert_array_equal(other.forward_kinematics(q)[0], expected)
    assert arm != bha.robots.load("asu_two_section")
    assert arm != "bha_nominal"
    assert repr(arm) == "<Arm 'bha_nominal': 3 sections, 9 inputs, end_force>"


def test_with_changes_makes_a_new_arm() -> None:
    arm = bha.robots.load("bha_nominal")
    changed = arm.with_changes(force_model="work_conjugate", rotational_energy=False, gravity=np.array([9.81, 0, 0]))
    assert changed.parameters.force_model == "work_conjugate"
    assert changed.parameters.rotational_energy is False
    assert changed.parameters.coriolis_forces is True
    assert changed.parameters.gravity == (9.81, 0.0, 0.0)
    assert changed.parameters.sections == arm.parameters.sections
    assert arm.parameters.force_model == "end_force"
    q, zero = np.linspace(0.12, 0.28, 9), np.zeros(9)
    bias = [a.dynamics_terms(q, zero, np.full(9, 101325.0)).bias_force for a in (arm, changed)]
    assert np.abs(bias[0] - bias[1]).max() > 0.1
    with pytest.raises(
        ParameterError, match='bha_nominal: force_model: found "x"; allowed: "end_force" or "work_conjugate"'
    ):
        arm.with_changes(force_model="x")  # type: ignore[arg-type]


def test_numerical_methods_are_those_of_the_core() -> None:
    for name in ("forward_kinematics", "dynamics_terms", "forward_dynamics", "inverse_dynamics", "energy"):
        assert getattr(Arm, name) is getattr(_core.Arm, name)


def test_values_change_by_path_and_by_pattern() -> None:
    arm = bha.robots.load("bha_nominal")
    changed = arm.with_values({"section.*.mass": 0.5, "section.2.mass": np.float32(0.25), "gravity.x": 1})
    assert [section.mass for section in changed.parameters.sections] == [0.5, 0.25, 0.5]
    assert changed.parameters.gravity == (1.0, 0.0, 9.81)
    assert [section.mass for section in arm.parameters.sections] == [0.75, 0.6, 0.45]
    one = arm.with_values({"section.1.bellows.3.rest_length": 0.2, "section.1.stiffness.2": 0.0})
    assert one.parameters.sections[0].resolved_bellows(1)[2].rest_length == 0.2
    assert one.parameters.sections[0].stiffness == (1300.0, 0.0, 12000.0)
    assert arm.with_values({}) == arm
    assert arm.with_values({"section.1.mass": 0.75}) == arm
    q = np.full(9, 0.19)
    np.testing.assert_array_equal(
        arm.with_values({"section.1.mass": 0.8}).inertia_matrix(q),
        Arm(arm.parameters.updated(_with_mass(arm.parameters, 0.8))).inertia_matrix(q),
    )


def _with_mass(parameters: ArmParameters, mass: float) -> dict[str, object]:
    sections = parameters.to_mapping()["section"]
    sections[0]["mass"] = mass
    return {"section": sections}


@pytest.mark.parametrize(
    ("values", "error", "text"),
    [
        ({"section.1.mas": 1.0}, ParameterError, "no parameter 'section.1.mas'; nearest allowed: 'section.1.mass'"),
        ({"section.4.*": 1.0}, ParameterError, "no parameter matches 'section.4.*'; nearest allowed"),
        ({"section.*.mas": 1.0}, ParameterError, "no parameter matches 'section.*.mas'; nearest allowed"),
        ({"section.1.mass": -1.0}, ParameterError, "section 1: mass: found -1.0; allowed: a number > 0"),
        ({"section.1.mass": "0.8"}, InputError, "section.1.mass: a number is needed; found texts"),
        ({"section.1.mass": None}, InputError, "section.1.mass: a number is needed; found objects"),
        ({"section.1.mass": True}, InputError, "section.1.mass: a number is needed; found truth values"),
        ({"section.1.mass": [0.8, 0.9]}, InputError, "section.1.mass: expected shape (), found [2]"),
        ({"section.1.mass": float("nan")}, InputError, "section.1.mass: NaN; a finite number is needed"),
        ({1: 0.8}, InputError, "values: 1 is no path; a text such as 'section.1.mass'"),
        ([("section.1.mass", 0.8)], InputError, "values: list; a mapping from paths to numbers is needed"),
    ],
)
def test_values_that_cannot_be_set(values: dict[str, float], error: type[Exception], text: str) -> None:
    with pytest.raises(error) as caught:
        bha.robots.load("bha_nominal").with_values(values)
    assert text in str(caught.value)


def test_a_changed_value_does_not_keep_what_was_said_of_another() -> None:
    """Neither its provenance nor, without saying of which value it is, the comment beside it in the file."""
    text = bha.robots.load("bha_nominal").parameters.to_toml()
    text = text.replace("mass = 0.75", "mass = 0.75  # kitchen scale", 1)
    text = text.replace("damping = 18.0", "damping = 18.0  # N s/m", 1).replace(
        "[section.provenance]", '[section.provenance]\nmass = "identified"', 1
    )
    arm = Arm(ArmParameters.from_toml(text))
    assert arm.parameters.sections[0].provenance["mass"].status == "identified"
    changed = arm.with_values({"section.1.mass": 0.8, "section.2.bellows_radius": 0.1})
    first, second = changed.parameters.sections[:2]
    assert "mass" not in first.provenance
    assert set(first.provenance) == set(arm.parameters.sections[0].provenance) - {"mass"}
    assert "bellows_radius" not in second.provenance
    assert "mass = 0.8  # kitchen scale (said of 0.75)\n" in changed.parameters.to_toml()
    again = changed.with_values({"section.1.mass": 0.9, "section.1.damping": 20.0}).parameters
    assert "damping = 20.0  # N s/m\n" in again.to_toml()
    assert "mass = 0.9  # kitchen scale (said of 0.75)\n" in again.to_toml()
    assert ArmParameters.from_toml(again.to_toml()) == again
    same = arm.with_values({"section.1.mass": 0.75})
    assert same.parameters.to_toml() == text


class Tagged(Arm):
    """An arm with more to it, made in another way."""

    __slots__ = ("__dict__", "tag")
    tag: str
    history: list[int]

    def __new__(cls, parameters: ArmParameters, tag: str) -> "Tagged":
        arm = super().__new__(cls, parameters)
        arm.tag, arm.history = tag, [1]
        return arm

    def __init__(self, parameters: ArmParameters, tag: str) -> None:
        """Nothing is left to do."""


@pytest.mark.parametrize(
    "made",
    [
        lambda arm: pickle.loads(pickle.dumps(arm)),
        copy.copy,
        copy.deepcopy,
        lambda arm: arm.with_changes(gravity=(0.0, 0.0, 9.0)),
        lambda arm: arm.with_effects([]),
        lambda arm: arm.with_values({"section.1.mass": 0.8}),
        lambda arm: arm.with_parameters(arm.parameters),
    ],
)
def test_subclasses_keep_what_is_theirs(made: Callable[[Tagged], Tagged]) -> None:
    arm = Tagged(bha.robots.load("bha_nominal").parameters, "left")
    arm.forward_dynamics_derivatives(np.full(9, 0.19), np.zeros(9), np.full(9, 1e5), parameters=["section.1.mass"])
    found = made(arm)
    assert type(found) is Tagged
    assert (found.tag, found.history) == ("left", [1])
    assert found.forward_kinematics(np.full(9, 0.19))[0].shape == (3, 3)
