"""Under commands a lag of the pressures and a damping of the arm are two valleys; the file may lie in the right one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main

LAG, NOISE = 0.12, 2e-4


def test_a_light_arm_behind_a_lag_is_no_damped_one(tmp_path: Path) -> None:
    measures = {"length": "150mm", "longest": "260mm", "radius": "60mm", "diameter": "60mm", "mass": "0.6kg"}
    words = [word for key, value in measures.items() for word in (f"--{key}", value)]
    assert CliRunner().invoke(main, ["new", str(tmp_path / "arm"), *words, "--pressure-max", "1bar"]).exit_code == 0
    arm = bha.Arm.load(tmp_path / "arm.toml")
    proposal = bha.excite(arm, duration=12.0, rate=50.0)
    section = arm.parameters.sections[0]
    true = arm.with_values(
        {"section.1.stiffness.1": 1.3 * section.stiffness[0], "section.1.damping": 1.8 * section.damping}
    )
    lag = {"level": "lag", "fill_time": LAG, "vent_time": LAG}
    true = true.with_parameters(true.parameters.updated({"pneumatics": lag}))
    commands = bha.Input(proposal.time, proposal.pressures, commanded=True)
    run = bha.simulate(true, commands, times=proposal.time)
    random = np.random.default_rng(5)
    tip = run.head_positions[:, 0] + NOISE * random.standard_normal((len(run), 3))
    columns = {f"pc1{k + 1} [Pa]": p for k, p in enumerate(proposal.pressures.T)}
    columns |= {f"{axis}1 [m]": values for axis, values in zip("xyz", tip.T, strict=True)}
    found = bha.identify(arm, [bha.Log.from_arrays({"t [s]": proposal.time, **columns})])
    assert found.gap < 1.15
    times = {e.path: e.value for e in found.estimates if e.path.startswith("pneumatics.")}
    assert times["pneumatics.fill_time"] == pytest.approx(LAG, rel=0.03)
    assert times["pneumatics.vent_time"] == pytest.approx(LAG, rel=0.03)
    ratio = {e.path: e.value for e in found.estimates}
    own = true.parameters.sections[0]
    assert ratio["section.1.stiffness.1"] / ratio["section.1.terminal_area"] == pytest.approx(
        own.stiffness[0] / own.terminal_area, rel=0.03
    )
