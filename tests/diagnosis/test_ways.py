"""A lag of commands that is several times longer one way than the other is a finding; one that is not, is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bha
from bha.diagnosis.model import plain_model
from bha.diagnosis.valves import coordinates_of, lags_of, with_valves
from bha.diagnosis.ways import alike

from .synthetic import one_section
from .test_valves import commanded_log


def test_commands_that_vent_slower_than_they_fill_are_named(tmp_path: Path) -> None:
    arm, times = one_section(), {"fill": 0.1, "vent": 0.4}
    slow = arm.with_effects([{"kind": "pressure_lag", "where": "all", **times}])
    logs = [commanded_log(slow, seed) for seed in range(3)]
    off = one_section({"stiffness": 0.85, "damping": 1.3, "mass": 1.1})
    found = bha.diagnose(off, logs[:2], logs[2:], kinds=("creep",), pressures="commanded", out=tmp_path, report=False)
    assert found.verdict == "named", found.reason
    # The file has it once, in its stages.
    written = bha.Arm.load(tmp_path / "arm_diagnosed.toml").parameters.effects
    assert [(e.kind, e.where) for e in written] == [("pressure_lag", "all"), ("delay", "all"), ("pressure_lag", "all")]
    assert written[0].parameters["vent"] == pytest.approx(times["vent"], rel=0.05)
    (lag,) = found.missing
    assert lag.kind == "pressure_lag"
    assert lag.gap_removed > 0.9
    for name, true in times.items():
        low, high = lag.parameters[name].ci95 or (np.nan, np.nan)
        assert low < true < high
    # Before: with one time for both ways.
    assert found.gap.before > 3.0 * found.gap.after
    assert "one time when filling" in found.reason


def test_alike_both_ways_is_one_time_of_all_stages_in_the_middle() -> None:
    arm = with_valves(one_section())
    model = plain_model(arm, more=coordinates_of(arm.parameters))
    fill, vent = lags_of(model)
    x = np.zeros(model.size)
    x[fill], x[vent] = model.plain[fill].coordinate(0.1), model.plain[vent].coordinate(0.4)
    other, moved = alike(model, x)
    assert other.size == model.size - 1
    both = [own for own in other.plain if own.name == model.plain[fill].name]
    assert both[0].members == ("effect.1.fill", "effect.1.vent")
    assert both[0].value(float(moved[fill])) == pytest.approx(0.2)
