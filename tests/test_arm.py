"""The arm as Python has it: files, copies with changes, pickles; and the arms that come with the package."""

import copy
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import bha.robots
from bha import _core
from bha.arm import Arm
from bha.errors import ParameterError

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
