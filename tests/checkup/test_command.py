from __future__ import annotations

import json
import os
import warnings
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.checkup.facts import facts_of
from bha.cli import main
from bha.plot import plot_checkup

from .made_logs import arm_of, log_of, nominal, steps


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An arm's file, a right log and one with two tubes exchanged."""
    made = tmp_path_factory.mktemp("check")
    arm = arm_of(nominal(2))
    arm.save(made / "arm.toml")
    log_of(arm, *steps(arm)).write(made / "right.csv")
    log_of(arm, *steps(arm, seed=1), feeds=[1, 0, 2, 3, 4, 5]).write(made / "wrong.csv")
    return made


def run(*arguments: object) -> str:
    done = CliRunner().invoke(main, ["check", *map(str, arguments)])
    assert done.exit_code == 0, done.output
    return done.output


def test_the_command_says_that_nothing_is_found(folder: Path) -> None:
    said = run(folder / "arm.toml", folder / "right.csv")
    assert "0 faults, 0 warnings, 0 notes" in said
    assert "nothing found" in said or "not told" in said
    assert "q23" in said


def test_what_a_machine_can_mend_is_mended_before_the_check(folder: Path) -> None:
    said = run(folder / "arm.toml", folder / "wrong.csv", "--repair")
    assert "0 faults" in said
    assert "repaired, all logs: tubes exchanged: p11 and p12" in said.replace("wrong.csv", "all logs")
    assert json.loads(run(folder / "arm.toml", folder / "wrong.csv", "--repair", "--json"))["repaired"]


def test_the_command_names_the_fault_and_the_line(folder: Path) -> None:
    said = run(folder / "arm.toml", folder / "wrong.csv")
    assert "1 fault, 0 warnings" in said
    assert "tubes exchanged: p11 and p12" in said
    assert "repair: in the log's heading rename p11 to p12, p12 to p11" in said


def test_machines_get_the_same(folder: Path) -> None:
    found = json.loads(run(folder / "arm.toml", folder / "wrong.csv", "--json"))
    assert found["faults"] == 1
    assert found["findings"][0]["explanations"][0]["what"] == "tubes exchanged: p11 and p12"
    assert [channel["name"] for channel in found["logs"][0]["channels"]][:3] == ["p11", "p12", "p13"]


def test_a_picture_is_written_whole(folder: Path, tmp_path: Path) -> None:
    said = run(folder / "arm.toml", folder / "wrong.csv", folder / "right.csv", "--plot", tmp_path / "seen.png")
    assert "seen.png" in said
    assert (tmp_path / "seen.png").read_bytes().startswith(b"\x89PNG")


def test_the_picture_names_axes_and_units(folder: Path) -> None:
    figure = plot_checkup(bha.check(bha.Arm.load(folder / "arm.toml"), folder / "wrong.csv"))
    labels = {axes.get_ylabel() for axes in figure.axes}
    assert {"Pressure [kPa]", "Length [mm]", "Head position [mm]"} <= labels
    assert any("Time [s]" in axes.get_xlabel() for axes in figure.axes)


def test_warnings_repeat_faults_and_leave_notes_out(folder: Path) -> None:
    arm = bha.Arm.load(folder / "arm.toml")
    with pytest.warns(bha.LogWarning, match="tubes exchanged: p11 and p12"):
        bha.check(arm, folder / "wrong.csv").warn()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bha.check(arm, folder / "right.csv").warn()


def test_facts_count_steps_rates_and_steady_stretches() -> None:
    arm = arm_of(nominal(1))
    time = np.arange(1001) / 50.0
    pressures = np.full((1001, 3), 1.2e5)
    pressures[200:500, 0] = 1.6e5
    pressures[700:, 1] = 1.5e5
    log = log_of(arm, time, pressures, see="lengths", noise=2e-4, hold=5)
    facts = facts_of(bha.Recording(arm, log, warn=False))
    by_name = {channel.name: channel for channel in facts.channels}
    assert [by_name[name].steps for name in ("p11", "p12", "p13")] == [2, 1, 0]
    assert by_name["q11"].rate == pytest.approx(10.0, rel=0.05)
    assert by_name["q11"].held == pytest.approx(0.8, abs=0.02)
    assert facts.rate == pytest.approx(50.0)
    assert any(start < 2.0 and end > 3.0 for start, end in facts.steady)
    assert not any(start < 4.1 < end for start, end in facts.steady)


def test_lost_readings_and_unused_columns_are_findings() -> None:
    arm = arm_of(nominal(1))
    whole = log_of(arm, *steps(arm), see="both")
    columns = {f"{name} [{whole.units[name]}]": np.array(whole[name]) for name in whole.columns}
    columns["q11 [m]"][300:360] = columns["q11 [m]"][300]
    columns["x1 [m]"][[500, 501]] += 0.3
    columns["wire7 [mm]"] = np.arange(len(whole.time), dtype=float)
    found = bha.check(arm, bha.Log.from_arrays(columns))
    assert found.faults == ()
    texts = " ".join(f.what for f in found.findings)
    assert "q11 stands still from 6.02 s to 7.2 s" in texts
    assert "wire7" in texts
    assert any("x1 jumps away and back" in flaw for flaw in found.logs[0].flaws)


def test_a_log_with_pressures_only_is_checked_for_what_it_has() -> None:
    arm = arm_of(nominal(1))
    time, pressures = steps(arm)
    log = bha.Log.from_arrays({"t [s]": time} | {f"p1{k + 1} [Pa]": pressures[:, k] for k in range(3)})
    found = bha.check(arm, log)
    assert found.faults == ()
    assert found.untold == ("neither lengths nor heads are measured: nothing but pressures is checked",)


REAL = Path(os.environ.get("BHA_REAL_ARM_LOGS", "nowhere"))


@pytest.mark.skipif(not REAL.is_dir(), reason="set BHA_REAL_ARM_LOGS to the folder of the real arm's logs")
@pytest.mark.parametrize(("name", "pattern"), [("january", "jan*.csv"), ("april", "apr*.csv")])
@pytest.mark.parametrize("sort", ["measured", "commanded"])
def test_nothing_is_found_falsely_on_the_real_arm(name: str, pattern: str, sort: bha.recordings.PressureSort) -> None:  # type: ignore[name-defined]
    arm = bha.robots.load(f"asu_two_section_{name}")
    logs = sorted(REAL.glob(pattern))
    assert logs
    assert bha.check(arm, logs, pressures=sort).faults == ()
    for log in logs:
        assert bha.check(arm, log, pressures=sort).faults == ()


@pytest.mark.skipif(not REAL.is_dir(), reason="set BHA_REAL_ARM_LOGS to the folder of the real arm's logs")
def test_exchanged_tubes_of_the_real_arm_are_found() -> None:
    arm = bha.robots.load("asu_two_section_january")
    log = bha.Log.read(REAL / "jan10_right_1.csv")
    columns = {"t [s]": np.array(log.time)}
    swapped = {"p11": "p12", "p12": "p11"}
    for name in (*arm.inputs, "x1", "y1", "z1", "x2", "y2", "z2"):
        columns[f"{name} [{log.units[name]}]"] = np.array(log[swapped.get(name, name)])
    found = bha.check(arm, bha.Log.from_arrays(columns))
    assert any(e.what == "tubes exchanged: p11 and p12" for f in found.faults for e in f.explanations)


def test_flaws_have_times_since_the_start_and_each_channel_once() -> None:
    arm = arm_of(nominal(1))
    whole = log_of(arm, *steps(arm), see="both")
    columns = {f"{name} [{whole.units[name]}]": np.array(whole[name]) for name in whole.columns}
    columns["t [s]"] = columns["t [s]"] + 1.78e9
    for first in (200, 300):
        columns["q11 [m]"][first : first + 60] = columns["q11 [m]"][first]
    columns["x1 [m]"][[500, 501]] += 0.3
    columns["y1 [m]"][[400, 401, 600, 601]] += 0.3
    (facts,) = bha.check(arm, bha.Log.from_arrays(columns)).logs
    texts = "; ".join(facts.flaws)
    assert "e+09" not in texts
    assert "q11, q11" not in texts
    assert "q11 stands still from 4.02 s after its start to 5.2 s after its start" in texts
    assert "1 times" not in texts
    assert "jumps away and back" in texts
