"""Reading of arm files by the reference model: defaults, (56), (57), and errors that name file and key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bha import reference as ref
from bha.errors import ParameterError
from bha.reference.parameters import cylinder_inertia, inertia_upper_bound

INERTIA = "inertia = [0.005668750000000001, 0.005668750000000001, 0.006337500000000001]"


@pytest.fixture
def text(oracle: dict[str, Any]) -> str:
    return str(oracle["arms"]["bha_nominal"])


def test_values(text: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(text, encoding="utf-8")
    arm = ref.load_arm(path)
    assert arm == ref.parse_arm(text)
    assert arm.section_count == 3
    assert arm.gravity == (0.0, 0.0, 9.81)
    assert arm.sections[1].stiffness == (1050.0, 1200.0, 10000.0)
    assert arm.sections[2].base_offset == 0.0
    assert (arm.force_model, arm.rotational_energy, arm.coriolis_forces) == ("end_force", True, True)


def test_missing_inertia_is_that_of_a_cylinder(text: str) -> None:
    # The nominal arm's inertia was computed by (56).
    assert INERTIA in text
    found = ref.parse_arm(text.replace(INERTIA, "")).sections[0].inertia
    assert found == pytest.approx(ref.parse_arm(text).sections[0].inertia, rel=1e-14)


def test_upper_bound_of_the_inertia() -> None:
    J_x, J_y, J_z = inertia_upper_bound(0.75, 0.1, 0.03, 0.3)
    assert J_x == J_y == pytest.approx(0.75 * 0.0169 / 2 + 0.75 * 0.09 / 12)
    assert J_z == pytest.approx(2 * cylinder_inertia(0.75, 0.1, 0.03, 0.2)[2])


def test_offsets_and_switches(text: str) -> None:
    text = text.replace("[[section]]", "rotational_energy = false\ncoriolis_forces = false\n[[section]]", 1)
    text = text.replace("mass = 0.75", "mass = 0.75\nbase_offset = 0.01\nhead_offset = 0.02")
    arm = ref.parse_arm(text)
    assert (arm.rotational_energy, arm.coriolis_forces) == (False, False)
    assert (arm.sections[0].base_offset, arm.sections[0].head_offset) == (0.01, 0.02)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bha-arm/1", "bha-arm/2", r"arm: schema: found 'bha-arm/2', allowed is 'bha-arm/1'"),
        ("end_force", "both", "force_model: found 'both', allowed are end_force, work_conjugate"),
        ("mass = 0.6\n", "", "arm: section 2: mass: missing"),
        ("mass = 0.6\n", "mass = -0.6\n", "section 2: mass: found -0.6, needed is a number above 0"),
        ("mass = 0.6\n", "mass = nan\n", "section 2: mass: found nan, needed is a finite number"),
        ("mass = 0.6\n", "mass = true\n", "section 2: mass: found True"),
        ("gravity = [0.0, 0.0, 9.81]", "gravity = [9.81]", r"gravity: found \[9.81\], needed is a list of 3 numbers"),
        ("damping = 14.0", "dampnig = 14.0", "section 2: damping: missing"),
        ("damping = 14.0", "damping = 14.0\ndampnig = 1.0", "section 2: dampnig: unknown key"),
        (
            "pressure_range = [0.7e5, 2.2e5]",
            "pressure_range = [0.7e5, 2.2e5]\n[[section.bellows]]\nangle = 0.0",
            "section 1: bellows: the reference model",
        ),
        ("[[section]]", "effects = 1\n[[section]]", "arm: effects: the reference model"),
        ("stiffness = [750.0, 900.0, 7000.0]", "stiffness = []", r"stiffness: found \[\], needed is a list of 1 to 12"),
        ("length_range = [0.10, 0.30]", "length_range = [0.3, 0.1]", "length_range: found"),
        ("[[section]]", "[section]]", "arm: not valid TOML"),
    ],
)
def test_errors(text: str, old: str, new: str, message: str) -> None:
    assert old in text
    with pytest.raises(ParameterError, match=message):
        ref.parse_arm(text.replace(old, new, 1))


def test_unknown_force_model_and_empty_arm_in_code(text: str) -> None:
    with pytest.raises(ParameterError, match="force_model"):
        ref.parse_arm(text).with_options(force_model="other")
    with pytest.raises(ParameterError, match="section: found none"):
        ref.Arm(sections=(), gravity=(0.0, 0.0, 9.81), ambient_pressure=101325.0)
