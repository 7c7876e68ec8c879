"""Repairs made by machine: after them the logs and the file belong together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bha
from bha.checkup import Checkup, check_recordings, repaired
from bha.errors import InputError, LogError
from bha.recordings import recordings

from .made_logs import arm_of, log_of, nominal, steps, turned


def mended(arm: bha.Arm, *logs: bha.Log) -> Checkup:
    made = recordings(arm, logs, warn=False)
    assert check_recordings(arm, made).faults
    found = repaired(arm, made)
    assert not found.faults, str(found)
    assert found.repairs
    return found


def test_two_tubes_exchanged_are_exchanged_back() -> None:
    arm = arm_of(nominal(2))
    time, pressures = steps(arm)
    log = log_of(arm, time, pressures, feeds=(0, 1, 2, 4, 3, 5))
    found = mended(arm, log)
    assert found.arm == arm
    np.testing.assert_array_equal(found.recordings[0].log["p21"], log["p22"])
    np.testing.assert_array_equal(found.recordings[0].log["p22"], log["p21"])
    assert found.recordings[0].log.sha256 == log.sha256


def test_only_the_log_at_fault_is_changed() -> None:
    arm = arm_of(nominal(2))
    logs = []
    for seed, feeds in ((1, None), (2, (0, 1, 2, 4, 3, 5)), (3, None)):
        time, pressures = steps(arm, seed=seed)
        logs.append(log_of(arm, time, pressures, feeds=feeds, seed=seed))
    made = [bha.Recording(arm, log, name=f"log {k}", warn=False) for k, log in enumerate(logs)]
    found = repaired(arm, made)
    assert not found.faults
    assert found.repairs[0].startswith("repaired, log 1: ")
    changed = [found.recordings[k].log != logs[k] for k in range(3)]
    assert changed == [False, True, False]


def test_a_section_at_another_azimuth_is_turned_in_the_arm() -> None:
    filed, plant = arm_of(nominal(1)), arm_of(turned(nominal(1), 1, 90.0))
    time, pressures = steps(filed)
    found = mended(filed, log_of(plant, time, pressures))
    angles = [b.angle for b in found.arm.parameters.sections[0].resolved_bellows(1)]
    assert np.degrees(angles) % 360.0 == pytest.approx([90.0, 210.0, 330.0], abs=5.0)


def test_a_camera_that_is_turned_is_turned_in_the_arm() -> None:
    arm = arm_of(nominal(2))
    time, pressures = steps(arm)

    def quarter(heads: np.ndarray) -> np.ndarray:
        return np.stack([heads[..., 1], -heads[..., 0], heads[..., 2]], axis=-1)

    found = mended(arm, log_of(arm, time, pressures, heads=quarter))
    assert found.arm.parameters.sensors is not None
    assert found.arm.parameters.sensors.camera_axes != ("x", "y", "z")


def test_gauge_pressures_without_g_become_gauge_pressures() -> None:
    arm = arm_of(nominal(1))
    time, pressures = steps(arm)
    pressures = np.maximum(pressures, 103e3)  # or the heading would be an error at once
    log = log_of(arm, time, pressures, pressure_unit=("kPa", lambda p: 1e-3 * (p - 101325.0)))
    found = mended(arm, log)
    read = found.recordings[0].log
    assert set(read.gauge_columns) == {"p11", "p12", "p13"}
    np.testing.assert_allclose(read["p11"], pressures[:, 0], atol=1e-6)


def test_the_sign_of_gravity_is_turned_in_the_arm() -> None:
    arm = arm_of(nominal(3))
    filed = arm.with_changes(gravity=[0.0, 0.0, -9.81])
    found = mended(filed, log_of(arm, *steps(arm), see="lengths", noise=3e-4))
    assert found.arm.parameters.gravity == (0.0, 0.0, 9.81)


def test_identify_and_diagnose_go_on_with_the_repair(tmp_path: Path) -> None:
    arm = arm_of(nominal(1))
    time, pressures = steps(arm, duration=6.0)
    swapped = log_of(arm, time, pressures, feeds=(1, 0, 2))
    result = bha.identify(arm, [swapped], ["section.1.mass"], repair=True)
    assert any(note.startswith("repaired, ") for note in result.notes)
    assert result.converged
    with pytest.warns(bha.LogWarning):
        as_it_is = bha.identify(arm, [swapped], ["section.1.mass"])
    assert "do not belong together" in as_it_is.notes[0]
    assert "tubes exchanged: p11 and p12" in as_it_is.notes[0]
    found = bha.diagnose(arm, [swapped], kinds=("weak_bellows",), repair=True)
    assert any(text.startswith("repaired, ") for text in found.setup)
    assert found.verdict == "equivalent"


def test_headings_restated() -> None:
    log = bha.Log.from_arrays({"t [s]": [0.0, 1.0], "p11 [kPa(g)]": [0.0, 50.0], "p12 [kPa]": [100.0, 120.0]})
    other = log.restated({"p11": "p12", "p12": "p11"})
    assert other["p12"].tolist() == log["p11"].tolist()
    assert other.gauge_columns == ("p12",)
    assert log.restated(gauge={"p11": False})["p11"].tolist() == [0.0, 50e3]
    # Ten times as much above ambient.
    assert log.restated(factors={"p11": 10.0})["p11"] == pytest.approx([101325.0, 601325.0])
    with pytest.raises(InputError, match="p13"):
        log.restated({"p13": "p11"})
    with pytest.raises(InputError, match="each name once"):
        log.restated({"p11": "p12"})
    low = bha.Log.from_arrays({"t [s]": [0.0, 1.0], "p11 [kPa(g)]": [-20.0, 50.0]})
    with pytest.raises(LogError, match="below vacuum"):
        low.restated(gauge={"p11": False})
