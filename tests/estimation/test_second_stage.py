"""Valves of two stages under commands: both times and the dead time come back, and their sum is the common lag."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.estimation.lags import common_times, second_stage, with_lag
from bha.estimation.records import record
from bha.estimation.refinement import refine
from bha.estimation.settings import Settings
from bha.parameters import ArmParameters

FIRST, SECOND, LATE, NOISE = 0.12, 0.04, 0.05, 1e-4


def valveless() -> ArmParameters:
    mapping = bha.robots.load("bha_nominal").parameters.to_mapping()
    return ArmParameters.from_mapping({**mapping, "section": mapping["section"][:1]})


def log_of(arm: bha.Arm) -> bha.Log:
    """Commands held for 0.8 s with all lengths, 100 Hz."""
    time = np.arange(0.0, 8.0, 0.01)
    levels = np.random.default_rng(7).uniform(1.1e5, 1.6e5, (11, 3))
    drive = bha.Input(time, levels[np.floor(time / 0.8 + 1e-9).astype(int)], commanded=True, interpolation="hold")
    lengths = bha.simulate(arm, drive, times=time, method="rk4", step=1e-3).lengths
    lengths = lengths + NOISE * np.random.default_rng(8).standard_normal(lengths.shape)
    columns = {f"pc{name[1:]} [Pa]": p for name, p in zip(arm.inputs, drive.pressures.T, strict=True)}
    columns |= {f"q1{k + 1} [m]": q for k, q in enumerate(lengths.T)}
    return bha.Log.from_arrays({"t [s]": time, **columns})


def test_two_stages_and_a_dead_time_are_told_apart() -> None:
    plain = valveless()
    true = bha.Arm(
        plain.updated(
            {
                "pneumatics": {"level": "lag", "fill_time": FIRST, "vent_time": FIRST},
                "effect": [
                    {"kind": "delay", "where": "all", "time": LATE},
                    {"kind": "pressure_lag", "where": "all", "fill": SECOND, "vent": SECOND},
                ],
            }
        )
    )
    rec = record(bha.Arm(plain), log_of(true), pressures="commanded")
    arm, free = with_lag(bha.Arm(plain), [rec], second=True)
    assert [f.path for f in free][2:] == ["effect.1.time", "effect.2.*"]
    found = refine(arm, [rec], free, Settings(windows=(None,), step=5e-3)).arm
    pneumatics = found.parameters.pneumatics
    assert pneumatics is not None
    assert pneumatics.fill_time == pytest.approx(FIRST, rel=0.05)
    assert pneumatics.vent_time == pytest.approx(FIRST, rel=0.05)
    assert second_stage(found.parameters) == pytest.approx(SECOND, rel=0.1)
    assert found.parameters.effects[0].parameters["time"] == pytest.approx(LATE, abs=3e-3)
    time = common_times(found, np.full(3, 1.3e5))[0]
    assert time.lag == pytest.approx(FIRST + SECOND, rel=0.03)
    # A file that says a stage of its own keeps it.
    assert len(with_lag(found, [rec], second=True)[1]) == 2
