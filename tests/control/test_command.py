"""``bha control``: tables, machine output, figures and files, references from logs, and what it says of wrong input."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from stiff_arm import stiff_arm

import bha
from bha.cli import main
from bha.control import GravityPd, Pid, Reference, StaticModel, hold, point_to_point, simulate_closed_loop, tip_samples
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


def write(arm: bha.Arm, path: Path) -> Path:
    path.write_text(arm.parameters.to_toml(), encoding="utf-8")
    return path


def test_one_that_fails_does_not_end_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither where it comes apart on the way nor where it cannot be made."""
    from bha.cli import control as command  # noqa: PLC0415

    def unmade(arm: bha.Arm) -> GravityPd:
        raise bha.errors.ConvergenceError("no rest near the middle of the lengths")

    wild = lambda arm: GravityPd(arm, proportional=1e150, integral=1e200, derivative=1e150)  # noqa: E731
    monkeypatch.setitem(command.CONTROLLERS, "gravity_pd", wild)
    monkeypatch.setitem(command.CONTROLLERS, "lqr", unmade)
    options = ["--reference", "move", "--period", "0.004"]
    for name in ("gravity_pd", "lqr", "full"):
        options += ["--controller", name]
    result = control("bha_nominal", *options, "--json")
    assert result.exit_code == 1
    found = json.loads(result.output)["runs"]
    assert found["full"]["tip_error_rms"] < 1e-3
    assert "no longer finite" in found["gravity_pd"]["failed"]
    assert found["lqr"]["failed"] == "no rest near the middle of the lengths"
    shown = control("bha_nominal", *options)
    assert shown.exit_code == 1
    assert "gravity_pd: failed: at t = " in shown.output
    assert "lqr: failed: no rest near the middle of the lengths" in shown.output
    assert "full" in shown.output


def test_a_stiff_arm_by_default_settings(tmp_path: Path) -> None:
    arm = stiff_arm()
    path = write(arm, tmp_path / "stiff.toml")
    ends = [arm.static_lengths(np.full(6, p)) for p in (1.3e5, 1.4e5)]
    names = [f"q{i}{k} [m]" for i in (1, 2) for k in (1, 2, 3)]
    log = csv(tmp_path / "q.csv", {"t [s]": np.array([0.0, 4.0]), **dict(zip(names, np.transpose(ends), strict=True))})
    options = ["--reference", log, "--period", "0.01", "--length-noise", "0", "--pressure-noise", "0"]
    result = control(path, *options, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)
    assert found["out_of_reach"] is None
    assert found["too_fast"] is None
    assert len(found["runs"]) == 6
    far = np.linalg.norm(np.subtract(*(arm.forward_kinematics(q)[0][-1] for q in ends)))
    assert far > 5e-3
    assert found["runs"]["full"]["tip_error_max"] < 0.05 * far
    assert found["runs"]["gravity_pd"]["tip_error_max"] < 0.5 * far


def test_a_reference_with_missing_samples_where_they_are_allowed(tmp_path: Path) -> None:
    arm = stiff_arm()
    path = write(arm, tmp_path / "stiff.toml")
    lengths = np.array([arm.static_lengths(np.full(6, p)) for p in np.linspace(1.3e5, 1.4e5, 5)])
    lengths[2, 1] = np.nan
    names = [f"q{i}{k} [m]" for i in (1, 2) for k in (1, 2, 3)]
    columns = {"t [s]": np.linspace(0.0, 4.0, 5), **dict(zip(names, lengths.T, strict=True))}
    options = ["--reference", csv(tmp_path / "q.csv", columns), "--period", "0.01", "--controller", "full"]
    assert control(path, *options).exit_code != 0
    result = control(path, *options, "--missing", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.output)["out_of_reach"] is None


def test_what_is_out_of_reach_is_said(tmp_path: Path) -> None:
    """An arm that bends in a plane, on a circle."""
    pytest.importorskip("matplotlib")
    options = ["--controller", "static", "--radius", "0.02", "--speed", "0.2", "--period", "0.005"]
    shown = control("asu_two_section_january", *options)
    assert shown.exit_code == 0
    assert "warning: " in shown.output
    assert "of the reference is out of reach of asu_two_section_january" in shown.output
    assert "the nearest that pressures within pressure_range hold" in shown.output
    found = json.loads(control("asu_two_section_january", *options, "--json").output)
    assert 0.3 < found["reachable"] < 0.8
    assert found["farthest_at_rest"] > 0.01
    assert "out of reach" in found["out_of_reach"]
    without = control("asu_two_section_january", "--controller", "static")
    assert without.exit_code == 1
    assert "reaches no circle of its tip" in without.output
    move = control("asu_two_section_january", "--controller", "full", "--reference", "move", "--period", "0.005")
    assert move.exit_code == 0
    assert "out of reach" not in move.output
    assert "% of the reference is too fast for asu_two_section_january: at 0." in move.output


def test_texts_stay_within_the_figure() -> None:
    plot = pytest.importorskip("bha.plot")
    agg = pytest.importorskip("matplotlib.backends.backend_agg")
    far = point_to_point(np.full(9, 0.19), np.full(9, 0.38))
    run = simulate_closed_loop(ARM, StaticModel(ARM), far)
    assert len(run.saturation()) > 4
    runs = dict.fromkeys(("pid", "linearization, reduced model, with creep and with all else", "static"), run)
    figure = plot.plot_tracking(runs, title="an arm with a long name, led by the model of another " * 4)
    canvas = agg.FigureCanvasAgg(figure)
    canvas.draw()
    whole = figure.bbox
    texts = [text for axes in figure.axes for text in [*axes.texts, *axes.get_yticklabels(), *axes.get_xticklabels()]]
    labels = [label for axes in figure.axes for label in (axes.xaxis.label, axes.yaxis.label, axes.title)]
    for text in [*texts, *labels, *figure.texts]:
        box = text.get_window_extent(canvas.get_renderer())
        if text.get_visible() and text.get_text() and box.width > 0:
            assert box.x0 >= whole.x0 - 1, text.get_text()
            assert box.x1 <= whole.x1 + 1, text.get_text()


def test_figure_groups_labels_up_to_the_first_comma() -> None:
    plot = pytest.importorskip("bha.plot")
    pytest.importorskip("matplotlib")
    target = hold(np.full(9, 0.19), 0.1)
    run = simulate_closed_loop(ARM, Pid(ARM), target)
    figure = plot.plot_tracking({"pid": run, "full": run, "full, with creep": run}, title="t")
    above, below, *paths = figure.axes
    styles = [(line.get_color(), line.get_linestyle()) for line in above.get_lines()]
    assert styles[0][0] != styles[1][0] == styles[2][0]
    assert [style for _, style in styles] == ["-", "-", "--"]
    assert [text.get_text() for text in below.get_yticklabels()] == ["pid", "full", "full, with creep"]
    assert [axes.get_xlabel()[0] for axes in paths] == ["x", "x"]
    assert [axes.get_ylabel()[0] for axes in paths] == ["y", "z"]
    # The reference once, since all share it, and a path and its end for each run.
    assert [len(axes.get_lines()) for axes in paths] == [1 + 2 * 3] * 2
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


def test_three_lengths_of_an_arm_of_four_bellows_are_coordinates(tmp_path: Path) -> None:
    """Files written before coordinates had names of their own; a reference can mean nothing else."""
    arm = bha.robots.load("asu_two_section_january")
    rest = arm.static_lengths(np.full(len(arm.inputs), 1.2e5))
    time = np.linspace(0.0, 0.3, 31)
    old, new = (
        csv(tmp_path / f"{sort}.csv", {"t [s]": time} | {
            f"{sort}{i}{k} [m]": np.full(31, rest[3 * i + k - 4]) for i in (1, 2) for k in (1, 2, 3)
        })
        for sort in ("q", "qv")
    )  # fmt: skip
    found = [control("asu_two_section_january", "--reference", path, "--controller", "static") for path in (old, new)]
    assert [result.exit_code for result in found] == [0, 0], found[0].output
    assert "q11, q12, q13, q21, q22, q23 are read as the wanted coordinates" in found[0].output
    assert "name them qv11" in found[0].output
    assert "warning" not in found[1].output
    assert found[0].output.split("\n", 1)[1] == found[1].output


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
    assert "needs the lengths of all sections of bha_nominal (q11 to q33" in result.output
