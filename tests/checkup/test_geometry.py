from __future__ import annotations

from typing import Any

import pytest

import bha
from bha.checkup.geometry import geometry_findings

from .made_logs import arm_of, log_of, nominal, steps


@pytest.mark.parametrize("name", bha.robots.names())
def test_shipped_arms_are_plausible(name: str) -> None:
    assert geometry_findings(bha.robots.load(name)) == []


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"bellows_radius": 40.0}, "bellows_radius = 0.04"),
        ({"bellows_outer_radius": 30.0}, "bellows_outer_radius = 0.03"),
        ({"rest_length": 150.0}, "rest_length = 0.15"),
        ({"length_range": [100.0, 300.0]}, "length_range = [0.1, 0.3]"),
        ({"mass": 750.0}, "mass = 0.75"),
        ({"terminal_area": 2600.0}, "terminal_area = 0.0026"),
        ({"terminal_area": 26.0}, "terminal_area = 0.0026"),
        ({"pressure_range": [0.7, 2.2]}, "pressure_range = [70000, 220000]"),
        ({"pressure_range": [70.0, 220.0]}, "pressure_range = [70000, 220000]"),
    ],
)
def test_another_unit_is_a_fault_with_the_line_to_write(change: dict[str, Any], line: str) -> None:
    mapping = nominal(1)
    mapping["section"][0].update(change)
    faults = [f for f in geometry_findings(arm_of(mapping)) if f.severity == "fault"]
    assert len(faults) == 1
    assert faults[0].explanations[0].repair.startswith(line)


@pytest.mark.parametrize(
    "change",
    [
        {"mass": 0.75e-3},
        {"terminal_area": 2.6e-7},
        {"stiffness": [1.3]},
        {"stiffness": [0.0]},
        {"gravity": [0.0, 0.0, 98.1]},
    ],
)
def test_numbers_that_do_not_go_together_are_warnings(change: dict[str, Any]) -> None:
    mapping = nominal(1)
    (mapping if "gravity" in change else mapping["section"][0]).update(change)
    found = geometry_findings(arm_of(mapping))
    assert found
    assert {f.severity for f in found} == {"warning"}


def test_an_arm_without_weight_or_air_is_no_fault() -> None:
    mapping = nominal(1)
    mapping["gravity"] = [0.0, 0.0, 0.0]
    mapping["ambient_pressure"] = 0.0
    assert all(f.severity == "note" for f in geometry_findings(arm_of(mapping)))


def test_with_a_wrong_file_motions_are_not_judged() -> None:
    arm = arm_of(nominal(1))
    mapping = nominal(1)
    mapping["section"][0]["bellows_radius"] = 100.0
    mapping["section"][0]["inertia"] = [0.005, 0.005, 0.006]
    found = bha.check(arm_of(mapping), log_of(arm, *steps(arm), see="heads"))
    assert [f.kind for f in found.faults] == ["geometry"]
    assert any("before the file's numbers are right" in text for text in found.untold)
