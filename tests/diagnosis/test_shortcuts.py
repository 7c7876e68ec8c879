"""Probes without effects in the core give what the core's effects give."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis.preparation import prepare
from bha.diagnosis.shortcuts import PressureProbe, acting_pressures, length_change
from bha.recordings import Recording

from .synthetic import make_logs, one_section

CASES: list[tuple[str, dict[str, float]]] = [
    ("pressure_lag", {"fill": 0.05, "vent": 0.15}),
    ("delay", {"time": 0.02}),
    ("valve_dead_band", {"band": 1500.0}),
    ("pressure_offset", {"offset": 700.0}),
    ("pressure_gain", {"gain": 0.04}),
    ("leak", {"drop": 2e3}),
]


@pytest.mark.parametrize(("kind", "numbers"), CASES, ids=[kind for kind, _ in CASES])
def test_changed_inputs_act_as_the_effect_does(kind: str, numbers: dict[str, Any]) -> None:
    arm = one_section()
    (log,) = make_logs(arm, [], durations=(3.0,), pressure_noise=0.0)
    record = prepare(Recording(arm, log))
    (changed,) = acting_pressures(record, [PressureProbe(kind, (1,), numbers)], 101325.0)
    options = bha.Options(method="rk4", step=2.5e-3)
    drive = bha.Input(record.drive.time, record.drive.pressures)
    hidden = arm.with_effects([{"kind": kind, "where": "input p12", **numbers}])
    effect = bha.simulate(hidden, drive, options=options)
    shortcut = bha.simulate(arm, bha.Input(record.drive.time, changed), options=options)
    plain = bha.simulate(arm, drive, options=options)
    size = np.abs(effect.lengths - plain.lengths).max()
    assert size > 1e-4
    assert np.abs(effect.lengths - shortcut.lengths).max() < 0.03 * size


@pytest.mark.parametrize(
    ("kind", "number", "value", "tolerance"),
    [
        ("length_offset", "offset", 1e-3, 1e-9),
        ("length_gain", "gain", 0.02, 1e-9),
        ("wire_backlash", "play", 5e-4, 0.1),
    ],
)
def test_changed_outputs_are_what_the_sensor_reads(kind: str, number: str, value: float, tolerance: float) -> None:
    arm = one_section()
    (log,) = make_logs(arm, [], durations=(3.0,), pressure_noise=0.0)
    record = prepare(Recording(arm, log))
    drive = bha.Input(record.drive.time, record.drive.pressures)
    options = bha.Options(method="rk4", step=2.5e-3)
    plain = bha.simulate(arm, drive, times=record.time, options=options).lengths
    sensed = arm.with_effects([{"kind": kind, "where": "bellows 12", number: value}])
    read = bha.simulate(sensed, drive, times=record.time, options=options).measured_lengths
    assert read is not None
    outputs = np.zeros((len(record.time), len(record.channels)))
    column = record.channels.index("q12")
    outputs[:, column] = plain[:, 1]
    change = value * length_change(kind, "q12", record, outputs, value)[:, column]
    # Samples alone do not see where the length turns between two of them.
    np.testing.assert_allclose(change, (read - plain)[:, 1], atol=tolerance * np.abs(read - plain).max())
    assert not np.any(length_change(kind, "q99", record, outputs, value))


def test_no_probe_leaves_less_than_vacuum() -> None:
    """A fit may have emptied a chamber before a log; a greater gain would take it below nothing."""
    (log,) = make_logs(one_section(), [], durations=(1.0,), pressure_noise=0.0)
    record = prepare(Recording(one_section(), log))
    empty = record.driven_by(np.zeros_like(record.drive.pressures))
    record = replace(record, drive=empty)
    probes = [
        PressureProbe("pressure_gain", (0,), {"gain": 0.01}),
        PressureProbe("pressure_offset", (1,), {"offset": -9.0}),
    ]
    for acting in acting_pressures(record, probes, 101325.0):
        assert acting.min() == 0.0
