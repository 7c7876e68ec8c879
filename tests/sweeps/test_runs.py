"""Runs: each as simulated alone, whatever the threads and partitions; those that fail keep their place."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
import bha.sweeps
from bha.parameters.paths import with_values
from bha.sweeps.execute import on_this_computer

from .small_sweeps import PRESSURES, assert_same, one_section, rows, spec, write_log

pytest.importorskip("pyarrow")


def alone(arm: bha.Arm, drive: bha.Input, dt: float, **state: Any) -> bha.Trajectory:
    return bha.simulate(arm, drive, dt=dt, method="rk4", step=5e-3, **state)


def check(found: dict[str, Any], k: int, run: bha.Trajectory) -> None:
    tip = run.head_positions[:, -1]
    distance = np.sqrt(((tip - tip[0]) ** 2).sum(axis=1))
    expected = {
        "final_tip_displacement": distance[-1],
        "max_tip_displacement": max(distance),
        "peak_rate": np.abs(run.velocities).max(),
    }
    for name, value in expected.items():
        np.testing.assert_allclose(found[name][k], value, rtol=1e-9, atol=1e-14, err_msg=f"run {k}, {name}")


def test_runs_are_as_simulated_alone(tmp_path: Path) -> None:
    """Parameters, groups, amplitude, offset, initial pressures, lengths and rates, put together by hand."""
    vary = [
        {"what": "section.1.mass", "distribution": "normal", "mean": 0.75, "standard_deviation": 0.05},
        {"what": "section.*.damping", "relative": True, "distribution": "uniform", "low": 0.5, "high": 2.0},
        {"what": "input.amplitude", "distribution": "uniform", "low": 0.5, "high": 1.5},
        {"what": "input.amplitude.p12", "distribution": "uniform", "low": 0.5, "high": 1.5},
        {"what": "input.offset.p13", "distribution": "uniform", "low": -1e4, "high": 1e4},
        {"what": "initial.offset.p11", "distribution": "uniform", "low": -1e4, "high": 1e4},
        {"what": "initial.offset.q12", "distribution": "uniform", "low": -1e-3, "high": 1e-3},
        {"what": "initial.offset.qd13", "distribution": "uniform", "low": -0.1, "high": 0.1},
    ]
    start = [1.4e5, 1.0e5, 1.0e5]
    out = tmp_path / "out"
    mapping = spec(tmp_path, runs=70, vary=vary)
    summary = bha.sweep(mapping, out, threads=2)
    assert summary.complete
    assert summary.statuses["ok"] == summary.done == 70
    found, draws, base = rows(out), bha.sweeps.draw(mapping, 0, 70), one_section()
    for column, variable in enumerate(vary):
        np.testing.assert_array_equal(found[variable["what"]], draws[:, column])
    for k in (0, 1, 63, 64, 69):
        mass, damping, amplitude, amplitude2, offset, pressure, length, rate = draws[k]
        changes = {"section.1.mass": mass, "section.1.damping": 18.0 * damping}
        arm = bha.Arm(with_values(base.parameters, changes))
        p = 101_325.0 + amplitude * np.array([1, amplitude2, 1]) * (np.array(PRESSURES) - 101_325.0)
        p[2] += offset
        q0 = arm.static_lengths([start[0] + pressure, *start[1:]]) + np.array([0.0, length, 0.0])
        check(found, k, alone(arm, bha.Input.constant(p, 0.02), 0.005, q0=q0, qd0=[0, 0, rate]))


def test_the_numbers_do_not_depend_on_threads_and_partitions(tmp_path: Path) -> None:
    tables = []
    for number, (threads, size) in enumerate([(1, 64), (2, 64), (2, 128), (1, 1024)]):
        bha.sweep(spec(tmp_path, partition_size=size), tmp_path / str(number), threads=threads)
        tables.append(bha.sweeps.read(tmp_path / str(number)))
    assert tables[0].column("run").to_pylist() == list(range(200))
    for table in tables[1:]:
        assert_same(table, tables[0])


def test_choice_among_logs(tmp_path: Path) -> None:
    """Logs of different lengths, starting at 2 s; each run lasts as long as its log."""
    paths = [str(tmp_path / name) for name in ("long.csv", "short.csv")]
    logs = [write_log(Path(path), duration, seed=0) for path, duration in zip(paths, (0.05, 0.03), strict=True)]
    vary = [{"what": "input.log", "distribution": "choice"}]
    out = tmp_path / "out"
    options = {"method": "rk4", "step": 5e-3, "dt": 0.01}
    mapping = spec(tmp_path, runs=20, vary=vary, input={"logs": paths}, initial=None, simulation=options)
    bha.sweep(mapping, out)
    found = rows(out)
    assert set(found["input.log"]) == set(paths)
    arm = one_section()
    for k in range(20):
        log = logs[paths.index(found["input.log"][k])]
        check(found, k, alone(arm, bha.Recording(arm, log).drive, 0.01))


def test_measured_pressures_act_as_they_are(tmp_path: Path) -> None:
    """An arm with pneumatics delays commands, not what was measured in the bellows."""
    path = tmp_path / "run.csv"
    log = write_log(path, 0.05, 0)
    arm_file = tmp_path / "lagging.toml"
    lag = {"level": "lag", "fill_time": 0.03, "vent_time": 0.05}
    bha.Arm(one_section().parameters.updated({"pneumatics": lag})).save(arm_file)
    vary = [{"what": "input.offset", "distribution": "choice", "values": [0.0]}]
    options = {"method": "rk4", "step": 5e-3, "dt": 0.01}
    mapping = spec(
        tmp_path, runs=1, arm=str(arm_file), vary=vary, input={"logs": [str(path)]}, initial=None, simulation=options
    )
    bha.sweep(mapping, tmp_path / "out")
    arm = one_section()
    check(rows(tmp_path / "out"), 0, alone(arm, bha.Recording(arm, log).drive, 0.01))


def test_failures_keep_their_place_and_say_why(tmp_path: Path) -> None:
    vary = [
        {"what": "section.1.mass", "values": [0.75, -1.0]},
        {"what": "initial.offset.qd11", "values": [0.0, 60.0]},
        {"what": "initial.offset.p11", "values": [0.0, -2e5, 1e12]},
    ]
    initial = {"pressures": [1.4e5, 1.0e5, 1.0e5]}
    mapping = spec(tmp_path, kind="grid", runs=None, seed=None, vary=vary, initial=initial)
    mapping["simulation"]["duration"] = 0.1
    summary = bha.sweep(mapping, tmp_path / "out")
    found = rows(tmp_path / "out")
    expected = ["ok", "not_allowed", "no_rest", "diverged", "not_allowed", "no_rest", *["not_allowed"] * 6]
    assert list(found["status"]) == expected
    assert summary.statuses == {"ok": 1, "diverged": 1, "no_rest": 2, "not_allowed": 8}
    assert summary.metrics["peak_rate"][1].count == 1
    good = np.array(expected) == "ok"
    for name in mapping["metrics"]:
        assert np.array_equal(np.isfinite(found[name]), good)
    assert [reason is None for reason in found["reason"]] == list(good)
    assert "the initial state has -60000 Pa at p11; allowed: a number >= 0" in found["reason"][1]
    assert "mass" in found["reason"][6]
    assert np.array_equal(np.isfinite(found["failure_time"]), np.array(expected) == "diverged")
    assert 0.0 <= found["failure_time"][3] <= 0.1


def test_a_failing_neighbour_changes_nothing(tmp_path: Path) -> None:
    """The draws of two sweeps are the same in all runs but those that fail in one of them."""
    plain = {"what": "section.1.mass", "distribution": "choice", "values": [0.75, 0.8, 0.7]}
    bha.sweep(spec(tmp_path, runs=64, vary=[plain]), tmp_path / "good")
    bha.sweep(spec(tmp_path, runs=64, vary=[{**plain, "values": [0.75, 0.8, -1.0]}]), tmp_path / "bad")
    good, bad = rows(tmp_path / "good"), rows(tmp_path / "bad")
    ok = bad["status"] == "ok"
    assert 0 < ok.sum() < 64
    np.testing.assert_array_equal(ok, good["section.1.mass"] != 0.7)
    np.testing.assert_allclose(bad["peak_rate"][ok], good["peak_rate"][ok], rtol=1e-12)


def test_effects_vary(tmp_path: Path) -> None:
    arm = one_section().with_effects([{"kind": "payload", "where": "section 1", "mass": 0.1}])
    arm.save(tmp_path / "loaded.toml")
    vary = [{"what": "effect.1.mass", "values": [0.0, 0.3]}]
    mapping = spec(tmp_path, arm=str(tmp_path / "loaded.toml"), kind="grid", runs=None, seed=None, vary=vary)
    bha.sweep(mapping, tmp_path / "out")
    found = rows(tmp_path / "out")
    for k, mass in enumerate((0.0, 0.3)):
        loaded = one_section().with_effects([{"kind": "payload", "where": "section 1", "mass": mass}])
        q0 = loaded.static_lengths([1.4e5, 1.0e5, 1.0e5])
        check(found, k, alone(loaded, bha.Input.constant(PRESSURES, 0.02), 0.005, q0=q0))


def test_only_a_few_groups_are_under_way(tmp_path: Path) -> None:
    """However many partitions are wanted: that is what bounds the memory."""
    plan = bha.sweeps.make_plan(spec(tmp_path, runs=10**9))
    asked: list[int] = []

    def wanted() -> Iterator[int]:
        for partition in range(plan.partitions):
            asked.append(partition)
            yield partition

    tables = on_this_computer(plan, wanted(), 2, lambda _: None)
    for _ in range(3):
        next(tables)
    tables.close()
    assert len(asked) <= 8


def test_long_runs_go_in_smaller_groups(tmp_path: Path) -> None:
    plan = bha.sweeps.make_plan(spec(tmp_path, simulation={"duration": 1000.0, "dt": 0.01}))
    assert len(plan.times[0]) == 100_001
    assert plan.group == 4
