from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.checkup.ranges import excursions, length_findings, pressure_findings

from .made_logs import AMBIENT, arm_of, log_of, nominal, steps

RANGES = np.array([[7e4, 2.2e5]] * 3)
COLUMNS = ("p11", "p12", "p13")
TIME = np.linspace(0.0, 10.0, 200)


def chambers(low: float, high: float) -> np.ndarray:
    """Three chambers that go between two pressures, Pa, in turn."""
    return low + (high - low) * (0.5 + 0.5 * np.sin(TIME[:, None] + np.arange(3)))


def said(pressures: np.ndarray, gauge: tuple[str, ...] = (), ambient: float = AMBIENT) -> list[bha.checkup.Finding]:  # type: ignore[name-defined]
    arm = arm_of(nominal(1)).with_changes(ambient_pressure=ambient)
    return pressure_findings(arm, RANGES, "log", COLUMNS, gauge, TIME, pressures)


def test_pressures_within_the_range_say_nothing() -> None:
    assert said(chambers(8e4, 2.1e5)) == []
    assert said(chambers(8e4, 2.1e5), gauge=COLUMNS) == []


def test_overshoot_of_a_valve_says_nothing_and_four_bar_do() -> None:
    assert said(chambers(8e4, 2.3e5)) == []
    pressures = chambers(8e4, 2.1e5)
    pressures[50:60, 0] = 4e5
    (finding,) = said(pressures)
    assert finding.severity == "warning"
    assert "p11 reaches 400 kPa at 2.513 s, permitted are 70 to 220 kPa" in finding.evidence


@pytest.mark.parametrize("ambient", [AMBIENT, 7.7e4])
def test_gauge_pressure_read_as_absolute(ambient: float) -> None:
    (finding,) = said(chambers(0.0, 1e5), ambient=ambient)
    assert (finding.severity, finding.kind) == ("fault", "gauge")
    assert "'p11 [kPa(g)]'" in finding.explanations[0].repair


def test_absolute_pressure_read_as_gauge() -> None:
    (finding,) = said(chambers(AMBIENT, 2.1e5) + AMBIENT, gauge=COLUMNS)
    assert (finding.severity, finding.kind) == ("fault", "gauge")
    assert "leave (g) out" in finding.explanations[0].repair


@pytest.mark.parametrize(
    ("ratio", "unit"), [(14.50377, "bar for psi"), (6.894757, "psi for kPa"), (1e-3, "Pa for kPa")]
)
def test_another_unit_is_named(ratio: float, unit: str) -> None:
    (finding,) = said(ratio * chambers(8e4, 2.1e5))
    assert finding.severity == "fault"
    assert any(unit in explanation.what for explanation in finding.explanations)


def test_a_vacuum_that_no_pump_makes_is_doubted_in_a_file_that_permits_everything() -> None:
    arm = arm_of(nominal(1))
    wide = np.array([[0.0, 4e5]] * 3)
    found = pressure_findings(arm, wide, "log", COLUMNS, (), TIME, chambers(0.0, 1e5))
    assert [f.kind for f in found] == ["gauge"]
    assert pressure_findings(arm, wide, "log", COLUMNS, (), TIME, chambers(3e4, 1e5)) == []


@pytest.mark.parametrize(("ratio", "unit"), [(1e3, "m for mm"), (1e-3, "mm for m"), (1e2, "m for cm")])
def test_lengths_in_another_unit(ratio: float, unit: str) -> None:
    lengths = 0.2 + 0.05 * np.sin(TIME[:, None] + np.arange(3))
    ranges = np.array([[0.1, 0.3]] * 3)
    assert length_findings(ranges, "log", ("q11", "q12", "q13"), TIME, lengths) == []
    (finding,) = length_findings(ranges, "log", ("q11", "q12", "q13"), TIME, ratio * lengths)
    assert finding.severity == "fault"
    assert unit in finding.explanations[0].what


def test_a_length_outside_is_named_with_time_value_and_range() -> None:
    lengths = np.full((len(TIME), 1), 0.2)
    lengths[100] = 0.437
    (finding,) = length_findings(np.array([[0.1, 0.3]]), "log", ("q11",), TIME, lengths)
    assert finding.severity == "warning"
    assert "q11 reaches 437 mm at 5.025 s, permitted are 100 to 300 mm" in finding.evidence


def test_missing_readings_are_no_excursions() -> None:
    values = np.array([[0.2], [np.nan], [0.2]])
    assert excursions(np.arange(3.0), values, np.array([[0.1, 0.3]]), ("q11",), "m") == []


def test_gauge_and_absolute_are_told_by_the_poses_where_the_ranges_permit_both() -> None:
    mapping = nominal(1)
    mapping["section"][0]["pressure_range"] = [5e4, 5e5]
    arm = arm_of(mapping)
    time, pressures = steps(arm_of(nominal(1)))
    log = log_of(arm, time, pressures, see="lengths", pressure_unit=("kPa(g)", lambda p: p / 1e3))
    (fault,) = bha.check(arm, log).faults
    assert fault.kind == "gauge"
    right = log_of(arm, time, pressures, see="lengths", pressure_unit=("kPa(g)", lambda p: (p - AMBIENT) / 1e3))
    assert bha.check(arm, right).faults == ()


def test_the_arms_own_ambient_pressure_counts() -> None:
    """0 kPa(g) at 3,600 m is 65 kPa: no fault of the arm's own file."""
    mapping = nominal(1)
    mapping["ambient_pressure"] = 65000.0
    mapping["section"][0]["pressure_range"] = [4e4, 1.9e5]
    arm = arm_of(mapping)
    time, pressures = steps(arm)
    log = log_of(arm, time, pressures, pressure_unit=("kPa(g)", lambda p: (p - 65000.0) / 1e3))
    assert bha.check(arm, log).faults == ()
    wrong = log_of(arm, time, pressures, pressure_unit=("kPa", lambda p: np.maximum(p - 65000.0, 5000.0) / 1e3))
    assert [f.kind for f in bha.check(arm, wrong).faults] == ["gauge"]
