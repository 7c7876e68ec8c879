"""What holds an arm where a log begins is told by the log's first pose, and predicts what follows."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main
from bha.estimation.begin import begin
from bha.estimation.preload import of_record, typical, with_preloads
from bha.estimation.records import record
from bha.estimation.scale import default_free_of
from bha.identification import predict
from bha.logs import Log
from bha.parameters import ArmParameters
from bha.parameters.paths import get_value
from bha.recordings.beginning import NUMBERS
from bha.recordings.beginning import preloaded as preloads_of
from bha.recordings.first_command import stood_under
from bha.sweeps.members import member
from bha.sweeps.plan import make_plan

from .slow_arm import TRUE, arm_of, log_of

#: Torques that bend to x and to y, N m, and force, N: some millimetres at the head.
HELD, OTHERWISE = (0.012, -0.006, 1.2), (-0.010, 0.008, -0.6)


def preloaded(numbers: tuple[float, ...]) -> bha.Arm:
    effect = {"kind": "preload", "where": "section 1", **dict(zip(NUMBERS, numbers, strict=True))}
    return arm_of(TRUE, apart=True).with_effects([*arm_of(TRUE, apart=True).parameters.effects, effect])


def plain() -> bha.Arm:
    return bha.Arm(with_preloads(arm_of(TRUE, apart=True).parameters))


def written(log: Log, path: Path) -> None:
    units = {"t": "s", "x1": "m", "y1": "m", "z1": "m"}
    names = [f"{name} [{units.get(name, 'Pa')}]" for name in log.columns]
    table = np.column_stack([log[name] for name in log.columns])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="")


def test_first_poses_tell_preloads() -> None:
    rec = record(plain(), log_of(preloaded(HELD), 1))
    told = of_record(plain(), rec)
    assert list(told) == [f"effect.2.{name}" for name in NUMBERS]
    # The mean of four readings with 0.2 mm of noise, in what holds some millimetres.
    assert list(told.values()) == pytest.approx(HELD, rel=0.05, abs=6e-4)
    assert of_record(arm_of(TRUE, apart=True), rec) == {}


def test_a_log_is_predicted_from_its_own_first_pose() -> None:
    log = log_of(preloaded(OTHERWISE), 2)
    with_it, without = (predict(arm, [record(arm, log)])[0].head_rms[1] for arm in (plain(), arm_of(TRUE, apart=True)))
    assert without > 3e-3
    assert with_it < 6e-4


def test_where_no_log_tells_it_the_mean_counts() -> None:
    records = [record(plain(), log_of(preloaded(numbers), seed)) for seed, numbers in enumerate((HELD, OTHERWISE))]
    found = typical(plain(), records).effects[-1].parameters
    middle = np.mean([HELD, OTHERWISE], axis=0)
    assert [found[name] for name in NUMBERS] == pytest.approx(middle, rel=0.1, abs=5e-4)


def test_logs_that_begin_elsewhere_ask_for_preloads() -> None:
    guess = arm_of({"stiffness": 200.0, "terminal_area": 9e-5, "bending_stiffness": 0.2, "damping": 1.0})
    logs = [log_of(preloaded(numbers), seed, duration=20.0) for seed, numbers in enumerate((HELD, OTHERWISE), start=1)]
    records = [record(guess, log) for log in logs]
    found = begin(guess, records, default_free_of(guess.parameters, records), whole=False, splits=True)
    assert "preload" in {effect.kind for effect in found.arm.parameters.effects}
    assert found.trial.spread < 1e-3
    free = {f.path: f for f in found.free}
    # Fabric pushes with less when it is longer.
    assert {f.upper for path, f in free.items() if path.endswith(".by_length")} == {0.0}


def test_a_log_that_begins_moving_tells_none() -> None:
    log = log_of(preloaded(HELD), 1)
    # 0.1 s after a step.
    units = {"t": "s", "x1": "m", "y1": "m", "z1": "m"}
    late = Log.from_arrays({f"{name} [{units.get(name, 'Pa')}]": log[name][128:] for name in log.columns})
    rec = record(plain(), late)
    assert rec.resting is None
    assert of_record(plain(), rec) == {}
    assert record(plain(), log).between(5.0, 9.0).resting is None


def test_first_commands_are_those_that_the_arm_stood_under() -> None:
    time = np.arange(0.0, 12.0, 0.05)
    high = (time % 6.0) < 3.0
    commands = np.where(high, 5e4, 1e4)[:, None]
    # It follows within a third of a second, and stands low when the log begins.
    pose = np.zeros((len(time), 1))
    for k in range(1, len(time)):
        pose[k] = pose[k - 1] + 0.15 * ((0.1 if high[k] else 0.0) - pose[k - 1])
    drive = bha.Input(time, commands)
    found = stood_under(drive, time, pose, pose[0])
    assert found is not None
    assert found.pressures[0, 0] == 1e4
    assert np.array_equal(found.pressures[1:], commands[1:])
    # A command that ends soon after the log has begun is the one it stood under if nothing moves in between.
    late = time >= 2.5
    soon = bha.Input(time[late] - 2.5, commands[late])
    assert stood_under(soon, time[late] - 2.5, pose[late], pose[late][0]) is soon
    # Where it begins under the command that holds it nothing changes; where it never comes back nobody knows.
    assert stood_under(drive, time, pose, np.array([0.1])) is drive
    short = time < 2.5
    assert stood_under(bha.Input(time[short], commands[short]), time[short], pose[short], pose[0]) is None


def test_preloads_are_put_once() -> None:
    parameters = plain().parameters
    assert with_preloads(parameters) is parameters
    assert isinstance(parameters, ArmParameters)


def test_simulate_begins_where_the_log_does(tmp_path: Path) -> None:
    log = log_of(preloaded(OTHERWISE), 2, duration=10.0)
    written(log, tmp_path / "log.csv")
    plain().save(tmp_path / "arm.toml")
    said = CliRunner().invoke(
        main, ["simulate", str(tmp_path / "arm.toml"), "--input", str(tmp_path / "log.csv"), "--json"]
    )
    assert said.exit_code == 0, said.output
    found = json.loads(said.stdout)
    assert any("first pose" in note for note in found["notes"])
    assert max(found["output_error_rms"].values()) < 6e-4
    # In Python too, and not where somebody says from where.
    heads = np.column_stack([log[name] for name in ("x1", "y1", "z1")])
    run = bha.simulate(plain(), log, times=log["t"])
    assert np.sqrt(np.mean((run.head_positions[:, 0] - heads) ** 2)) < 6e-4
    elsewhere = bha.simulate(plain(), log, times=log["t"], q0=plain().static_lengths(log.pressures(plain().inputs)[0]))
    assert np.sqrt(np.mean((elsewhere.head_positions[:, 0] - heads) ** 2)) > 1e-3


def test_batches_begin_where_their_logs_do() -> None:
    logs = [log_of(preloaded(numbers), seed, duration=6.0) for seed, numbers in enumerate((HELD, OTHERWISE))]
    arms, times = [plain(), preloaded((0.0, 0.0, 0.0))], logs[0]["t"]
    alone = [bha.simulate(arm, log, times=times, method="rk4", step=1e-3) for arm, log in zip(arms, logs, strict=True)]
    batch = bha.simulate_batch(arms, logs, times=times, method="rk4")
    for own, lengths in zip(alone, batch.lengths, strict=True):
        np.testing.assert_allclose(lengths, own.lengths, atol=1e-9)
    # One arm in both logs is two arms; from a given pose it is the file's.
    both = bha.simulate_batch(plain(), logs, times=times, method="rk4").lengths
    np.testing.assert_allclose(both[0], alone[0].lengths, atol=1e-9)
    assert np.max(np.abs(both[1] - both[0])) > 1e-3
    x0 = np.concatenate([alone[0].lengths[0], np.zeros(3)])
    given = bha.simulate_batch(plain(), logs, x0, times=times, method="rk4").lengths
    elsewhere = bha.simulate(plain(), logs[0], q0=x0[:3], times=times, method="rk4", step=1e-3).lengths
    np.testing.assert_allclose(given[0], elsewhere, atol=1e-9)


def test_runs_of_a_sweep_begin_where_their_logs_do(tmp_path: Path) -> None:
    log = log_of(preloaded(OTHERWISE), 2, duration=3.0)
    written(log, tmp_path / "log.csv")
    plain().save(tmp_path / "arm.toml")
    spec = {
        "schema": "bha-sweep/1",
        "arm": str(tmp_path / "arm.toml"),
        "kind": "grid",
        "metrics": ["final_tip_x"],
        "input": {"logs": [str(tmp_path / "log.csv")]},
        "simulation": {"dt": 0.1, "duration": 0.2, "method": "rk4"},
        "vary": [{"what": "section.1.damping", "values": [2.0, 4.0]}],
    }
    plan = make_plan(spec)
    for k in range(2):
        arm = member(plan, plan.draws(k, 1)[0]).arm
        assert get_value(arm.parameters, "section.1.damping") == (2.0, 4.0)[k]
        to_x = get_value(arm.parameters, f"effect.{next(iter(preloads_of(arm.parameters)))}.to_x")
        assert to_x == pytest.approx(OTHERWISE[0], abs=2e-3)
    # Numbers that a sweep draws are its own.
    drawn = make_plan({**spec, "vary": [{"what": "effect.2.to_x", "values": [0.0, 0.02]}]})
    assert get_value(member(drawn, drawn.draws(1, 1)[0]).arm.parameters, "effect.2.to_x") == 0.02
