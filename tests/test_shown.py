"""How objects show themselves: in a line, in notebooks, as tables of pandas; and figures that notebooks show."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pickle
import pkgutil
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

import bha
from bha.errors import InputError, MissingExtraError
from bha.support.shown import MOST_ROWS, html_table, short_repr


class Cells(HTMLParser):
    """The texts of a table's cells, row by row, and all text; fails at tags left open."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.texts: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self._open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)
        if self._open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


def shown(thing: Any) -> Cells:
    return Cells(thing._repr_html_())


def arm() -> bha.Arm:
    return bha.robots.load("asu_two_section")


def run() -> bha.Trajectory:
    time = np.linspace(0.0, 0.1, 11)
    return bha.simulate(arm(), bha.Input(time, 1.2e5 + 1e4 * time[:, None] * np.arange(6)), times=time)


def test_tables_are_escaped_and_cut() -> None:
    cells = Cells(html_table("<b>&", ["a<"], [["<script>"], [None], [True], [1.23456789], [np.float64(np.nan)], [7]]))
    assert cells.texts[0] == "<b>&"
    assert [row[0] for row in cells.rows] == ["a<", "<script>", "", "yes", "1.2346", "", "7"]
    many = Cells(html_table("t", ["n"], [[k] for k in range(MOST_ROWS + 5)], notes=["<i>"]))
    assert len(many.rows) == MOST_ROWS + 1
    assert many.texts[-2:] == ["and 5 more", "<i>"]
    assert Cells(html_table("nothing", ["n"], [])).rows == []


def test_an_arm_shows_its_sections() -> None:
    cells = shown(arm())
    assert cells.texts[0] == "Arm asu_two_section, end_force, pneumatics ideal"
    assert cells.rows[1] == [
        "1",
        "0.29",
        "0.082",
        "4",
        "p21, p22, p23",
        "0.0215",
        "0.04 to 0.14",
        "1.0132e+05 to 2.06e+05",
    ]
    creeping = arm().with_effects([{"kind": "bending_damping", "where": "section 1", "damping": 0.1}])
    assert shown(creeping).texts[-1] == "effect: bending_damping at section 1"


def test_a_log_shows_its_columns() -> None:
    log = bha.Log.from_arrays({"t [s]": [0.0, 1.0], "x1 [mm]": [1.0, np.nan], "mode <3>": [5.0, 6.0]}, missing=True)
    cells = shown(log)
    assert cells.texts[0] == "Log <arrays>: 2 rows, 0 to 1 s"
    assert cells.rows[1:] == [
        ["t", "s", "0", "1", ""],
        ["x1", "m", "0.001", "0.001", "1"],
        ["mode <3>", "", "5", "6", ""],
    ]


def test_a_trajectory_shows_what_its_columns_do() -> None:
    trajectory = run()
    cells = shown(trajectory)
    assert cells.texts[0] == "Trajectory of asu_two_section: 11 rows, 0 to 0.1 s"
    assert len(cells.rows) == len(trajectory.columns())
    row = next(row for row in cells.rows if row[0] == "p13 [Pa]")
    assert row[1:] == ["1.2e+05", "1.2e+05", "1.25e+05", "1.25e+05"] or row[2] == "1.2e+05"
    assert shown(trajectory[:0]).rows == []


def test_recordings_and_checkups_show_themselves() -> None:
    time = np.linspace(0.0, 4.0, 401)
    given = arm()
    pressures = 1.2e5 + 3e4 * np.sin(3.0 * time)[:, None] * np.linspace(0.3, 1.0, 6)
    moved = bha.simulate(given, bha.Input(time, pressures), times=time)
    columns = {"t [s]": time} | {f"{n} [Pa]": pressures[:, k] for k, n in enumerate(given.inputs)}
    columns |= {f"{axis}{s + 1} [m]": moved.head_positions[:, s, k] for s in (0, 1) for k, axis in enumerate("xyz")}
    log = bha.Log.from_arrays(columns)
    recording = bha.Recording(given, log, warn=False)
    assert [row[0] for row in shown(recording).rows[1:]] == [*given.inputs, "x1", "y1", "z1", "x2", "y2", "z2"]
    checkup = bha.check(given, log)
    assert shown(checkup).texts[0] == repr(checkup)
    assert len(shown(checkup).rows) == (len(checkup.findings) + 1 if checkup.findings else 0)


def test_public_classes_show_arrays_by_their_shapes() -> None:
    """No dataclass that a package exports writes its arrays out; the reference stands alone and may."""
    faults, seen = [], 0
    for module in pkgutil.walk_packages(bha.__path__, "bha."):
        if module.name.startswith("bha.reference") or module.name.endswith(("__main__", "_core")):
            continue
        package = importlib.import_module(module.name)
        for name in getattr(package, "__all__", []):
            found = getattr(package, name)
            if not (inspect.isclass(found) and dataclasses.is_dataclass(found)):
                continue
            arrays = [f.name for f in dataclasses.fields(found) if "NDArray" in str(f.type) or str(f.type) == "Array"]
            generated = found.__repr__.__code__.co_filename in ("<string>", dataclasses.__file__)
            seen += bool(arrays)
            if arrays and generated:
                faults.append(f"{found.__qualname__}: {', '.join(arrays)}")
    assert seen > 10
    assert faults == []


def test_arrays_in_a_line() -> None:
    drive = bha.Input(np.zeros(100), np.zeros((100, 9)))
    assert repr(drive) == (
        "Input(time=<array (100,)>, pressures=<array (100, 9)>, forces=None, commanded=True, "
        "interpolation='linear', wrenches=())"
    )

    @short_repr
    @dataclasses.dataclass
    class Small:
        point: Any
        hidden: int = dataclasses.field(default=0, repr=False)

    assert repr(Small(np.array([1.0, 2.0]))).endswith("Small(point=[1.0, 2.0])")


def test_logs_and_trajectories_as_pandas_and_back() -> None:
    pandas = pytest.importorskip("pandas")
    log = bha.Log.from_arrays({"t [s]": [0.0, 0.1], "p11 [kPa(g)]": [0.0, 5.0], "x1 [mm]": [1.0, 2.0], "word": [1, 2]})
    frame = log.to_pandas()
    assert frame.index.name == "t [s]"
    assert list(frame.columns) == ["p11 [Pa]", "x1 [m]", "word"]
    again = bha.Log.from_frame(frame)
    for name in log.columns:
        np.testing.assert_array_equal(again[name], log[name])
    frame.iloc[0, 0] = 0.0
    assert log["p11"][0] == 101325.0  # a copy

    trajectory = run()
    table = trajectory.to_pandas()
    assert isinstance(table, pandas.DataFrame)
    assert [table.index.name, *table.columns] == trajectory.columns()
    np.testing.assert_array_equal(table["qv11 [m]"], trajectory.lengths[:, 0])
    written = bha.Log.from_frame(table)
    np.testing.assert_array_equal(written["p21"], trajectory.pressures[:, trajectory.input_names.index("p21")])


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_tables_of_other_libraries_become_logs(library: str) -> None:
    made = pytest.importorskip(library).DataFrame(
        {"t [s]": [0.0, 0.1, 0.2], "p11 [bar(g)]": [0, 1, 2], "x1 [mm]": [1.0, None, 3.0], "note": ["a", "b", "c"]}
    )
    for log in (bha.Log.from_frame(made, missing=True), bha.Log.from_arrays(made, missing=True)):
        np.testing.assert_allclose(log["p11"], 101325.0 + 1e5 * np.arange(3))
        np.testing.assert_array_equal(log["x1"], [1e-3, np.nan, 3e-3])
        assert "note" in log.ignored


def test_without_pandas_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'bha\[pandas\]'"):
        run().to_pandas()


def test_figures_are_pictures_in_notebooks() -> None:
    pytest.importorskip("matplotlib")
    from bha.plot import plot_gap, plot_poses, plot_trajectories  # noqa: PLC0415

    trajectory = run()
    figure = plot_trajectories(trajectory)
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
    assert pickle.loads(pickle.dumps(figure))._repr_png_() == figure._repr_png_()  # type: ignore[attr-defined]

    poses = plot_poses(arm(), trajectory, times=[0.0, 0.1], view="xz")
    assert poses._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
    last = arm().shape(trajectory.lengths[-1]) * 1e3
    backbones = [line for line in poses.axes[0].lines if line.get_linestyle() == "-"]
    assert len(backbones) == 2
    np.testing.assert_allclose(np.asarray(backbones[1].get_xydata()), last[:, [0, 2]])
    assert plot_poses(arm(), trajectory).axes[0].get_xlabel() == "x [mm]"
    assert plot_poses(arm(), trajectory, view="space").axes[0].get_xlabel() == "x [mm]"
    with pytest.raises(InputError, match="has 2 sections; bha_nominal has 3"):
        plot_poses(bha.robots.load("bha_nominal"), trajectory)
    with pytest.raises(InputError, match="expected"):
        plot_poses(arm(), trajectory, view="xy")  # type: ignore[arg-type]
    columns = {"t [s]": trajectory.time} | {
        f"{n} [Pa]": trajectory.pressures[:, k] for k, n in enumerate(trajectory.input_names)
    }
    blind = bha.Recording(arm(), bha.Log.from_arrays(columns), warn=False)
    with pytest.raises(InputError, match="no head"):
        plot_gap(blind, trajectory)


def test_plots_draw_into_given_axes_and_leave_their_settings() -> None:
    figures = pytest.importorskip("matplotlib.figure")
    from bha.plot import plot_gap, plot_poses  # noqa: PLC0415

    given, trajectory = arm(), run()
    columns = {"t [s]": trajectory.time} | {
        f"{n} [Pa]": trajectory.pressures[:, k] for k, n in enumerate(trajectory.input_names)
    }
    shift = np.array([0.003, 0.0, 0.004])
    columns |= {f"{axis}2 [m]": trajectory.head_positions[:, 1, k] + shift[k] for k, axis in enumerate("xyz")}
    recording = bha.Recording(given, bha.Log.from_arrays(columns), warn=False)
    figure = figures.Figure()
    left, right = figure.subplots(1, 2)
    assert plot_gap(recording, {"full": trajectory}, axes=left) is figure
    assert plot_poses(given, trajectory, view="yz", axes=right) is figure
    (line,) = left.lines
    np.testing.assert_allclose(line.get_ydata(), 5.0, rtol=1e-6)
    assert line.get_label() == "full, head 2: 5 mm RMS"
    assert right.get_xlabel() == "y [mm]"
    assert right.yaxis_inverted()  # the arm hangs
    with pytest.raises(InputError, match="Axes of matplotlib"):
        plot_gap(recording, trajectory, axes=figure)
    with pytest.raises(InputError, match="a figure of its own"):
        plot_poses(given, trajectory, axes=left)
    with pytest.raises(InputError, match="nothing to plot"):
        plot_gap(recording, {})
