"""``bha control``: tables, machine output, figures and files, references from logs, and what it says of wrong input."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import bha
from bha.cli import main
from bha.control import Pid, Reference, hold, simulate_closed_loop, tip_samples
from bha.errors import InputError

ARM = bha.robots.load("bha_nominal")


def control(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["control", *map(str, arguments)])


def csv(path: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path


def test_compares_controllers(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    options = ["--reference", "move", "--controller", "full", "--controller", "pid", "--pneumatics", "lag"]
    result = control("bha_nominal", *options, "--plot", tmp_path / "c.svg", "--out", tmp_path / "c.csv.gz", "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert found["model"] == found["plant"] == "bha_nominal"
    assert set(found["runs"]) == {"full", "pid"}
    assert found["runs"]["full"]["tip_error_rms"] < 0.1 * found["runs"]["pid"]["tip_error_rms"]
    assert sorted(Path(name).name for name in found["written"]) == ["c.svg", "c_full.csv.gz", "c_pid.csv.gz"]
    assert b"full" in (tmp_path / "c.svg").read_bytes()
    assert len(bha.Log.read(tmp_path / "c_full.csv.gz")) == found["periods"]

    shown = control("bha_nominal", *options)
    assert shown.exit_code == 0
    assert "reference over 1.46 s, mm" in shown.output
    assert "Greatest" in shown.output


def test_a_plant_that_diverges_is_reported(tmp_path: Path) -> None:
    running_away = ARM.with_effects([{"kind": "formula", "where": "all", "force": "c * qd", "c": 120.0}])
    plant = tmp_path / "plant.toml"
    plant.write_text(running_away.parameters.to_toml(), encoding="utf-8")
    options = ["--plant", plant, "--reference", "move", "--controller", "pid"]
    result = control("bha_nominal", *options, "--plot", tmp_path / "c.png", "--json")
    assert result.exit_code == 1
    found = json.loads(result.output)
    assert "the simulation stopped at t = " in found["runs"]["pid"]["diverged"]
    assert found["written"] == []
    assert "pid: the plant diverged: the simulation stopped at t = " in control("bha_nominal", *options).output


def test_figure_groups_labels_up_to_the_first_comma() -> None:
    plot = pytest.importorskip("bha.plot")
    pytest.importorskip("matplotlib")
    target = hold(np.full(9, 0.19), 0.1)
    run = simulate_closed_loop(ARM, Pid(ARM), target)
    figure = plot.plot_tracking({"pid": run, "full": run, "full, with creep": run}, title="t")
    above, below = figure.axes
    styles = [(line.get_color(), line.get_linestyle()) for line in above.get_lines()]
    assert styles[0][0] != styles[1][0] == styles[2][0]
    assert [style for _, style in styles] == ["-", "-", "--"]
    assert [text.get_text() for text in below.get_yticklabels()] == ["pid", "full", "full, with creep"]
    with pytest.raises(InputError, match="nothing to plot"):
        plot.plot_tracking({})


def test_references_from_logs(tmp_path: Path) -> None:
    time = np.array([0.0, 0.2, 0.5, 0.55, 1.0])
    lengths = np.linspace(0.18, 0.20, 5)[:, None] + np.linspace(0.0, 0.01, 9)
    names = [f"q{i}{k} [m]" for i in (1, 2, 3) for k in (1, 2, 3)]
    log = csv(tmp_path / "q.csv", {"t [s]": time, **dict(zip(names, lengths.T, strict=True))})
    found = json.loads(control("bha_nominal", "--reference", log, "--controller", "full", "--json").output)
    assert found["runs"]["full"]["tip_error_rms"] < 2e-3

    heads = np.array([ARM.forward_kinematics(q)[0][-1] for q in lengths])
    log = csv(tmp_path / "x.csv", {"t [s]": time, **{f"{c}3 [m]": heads[:, k] for k, c in enumerate("xyz")}})
    found = json.loads(control("bha_nominal", "--reference", log, "--controller", "full", "--json").output)
    assert found["runs"]["full"]["tip_error_rms"] < 2e-3


def test_sampled_reference_is_smooth_and_goes_through_its_ends() -> None:
    time, lengths = np.array([0.0, 0.1, 0.4]), np.array([[0.1], [0.2], [0.2]])
    found = Reference.sampled(time, lengths, period=1e-3, smoothing=0.06)
    assert found.lengths[[0, -1], 0] == pytest.approx([0.1, 0.2])
    # A ramp of 1 m/s, spread over 60 ms by three averages: a parabola's piece each, at most 1 / (0.02 s) m/s^2.
    assert found.velocities.max() == pytest.approx(1.0, rel=1e-6)
    assert np.abs(found.accelerations).max() < 1.0 / 0.02
    assert np.abs(np.diff(found.accelerations, axis=0)).max() < 5.0
    assert len(found) == 401 + 60
    plain = Reference.sampled(time, lengths, period=1e-3, smoothing=0.0)
    assert plain.lengths[:, 0] == pytest.approx(np.interp(plain.time, time, lengths[:, 0]))


@pytest.mark.parametrize(
    ("time", "rows", "expected"),
    [
        ([0.0, 0.0], [[0.1] * 9] * 2, "time: must ascend; row 1 does not"),
        ([0.0, 1.0], [[0.1] * 9], r"lengths: expected shape \(2, any\)"),
        ([0.0, 1.0], [[0.1] * 9, [np.nan] * 9], "lengths: row 1, column 0 is nan"),
    ],
)
def test_samples_that_are_none(time: list[float], rows: list[list[float]], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        Reference.sampled(time, rows)
    with pytest.raises(InputError):
        tip_samples(ARM, time, np.asarray(rows)[:, :3])


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["nofile.toml"], "nofile.toml: there is no such file"),
        (["bha_nominal", "--plant", "nofile.toml"], "nofile.toml: there is no such file"),
        (["bha_nominal", "--reference", "square"], "'square' is neither circle nor move nor a file"),
        (["bha_nominal", "--radius", "3"], "choose one within the arm's reach"),
        (["bha_nominal", "--period", "0"], "period: 0.0; a positive number is needed"),
        (["bha_nominal", "--length-noise", "-1"], "length_noise: -1"),
        (["bha_nominal", "--plant", "asu_two_section"], "reference: has 9 lengths, the plant asu_two_section has 6"),
    ],
)
def test_wrong_input_is_named(arguments: list[str], expected: str) -> None:
    result = control(*arguments, "--controller", "pid")
    assert result.exit_code == 1
    assert expected in result.output
    assert "Traceback" not in result.output


def test_logs_that_are_no_reference(tmp_path: Path) -> None:
    log = csv(tmp_path / "p.csv", {"t [s]": np.array([0.0, 1.0]), "p11 [Pa]": np.array([1e5, 1e5])})
    result = control("bha_nominal", "--reference", log)
    assert result.exit_code == 1
    assert "the positions of the last head (x3, y3, z3); found t, p11" in result.output
    log = csv(tmp_path / "q.csv", {"t [s]": np.array([0.0, 1.0]), "q11 [m]": np.array([0.2, 0.2])})
    result = control("bha_nominal", "--reference", log)
    assert result.exit_code == 1
    assert "has lengths of 1 sections, bha_nominal has 3" in result.output
