"""Figures: what they show, not how they look; and that they leave the caller's settings alone."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bha.errors import InputError, MissingExtraError
from bha.plot import plot_errors, plot_shape, plot_trajectories, write_figure
from bha.plot.style import DASHED, DOTTED, MOST_POINTS, SOLID, line_styles
from bha.runs.trajectory import Trajectory

matplotlib = pytest.importorskip("matplotlib")

INPUTS = ("p11", "p12", "p13", "p21", "p22", "p23")


def make(offset: float = 0.0, rows: int = 50, **change: Any) -> Trajectory:
    wave = np.sin(np.arange(rows))[:, None]
    fields: dict[str, Any] = {
        "time": np.linspace(0.0, 5.0, rows),
        "lengths": 0.2 + offset + 0.01 * wave * np.arange(1, 7),
        "velocities": np.zeros((rows, 6)),
        "pressures": 1e5 + 1e4 * wave * np.arange(1, 7),
        "head_positions": np.tile(np.array([[0.0, 0.1, 0.2], [0.3, 0.4, 0.5]]) + offset, (rows, 1, 1)),
        "input_names": INPUTS,
    }
    return Trajectory(**(fields | change))


def test_panels_show_bar_and_millimetres() -> None:
    measured, full = make(0.001), make()
    figure = plot_trajectories({"measured": measured, "full model": full})
    pressures, lengths, tool = figure.axes[0:2], figure.axes[2:4], figure.axes[4:7]
    assert [axes.get_title(loc="left") for axes in lengths] == ["Section 1", "Section 2"]
    assert [axes.get_title(loc="left") for axes in pressures] == ["p11, p12, p13", "p21, p22, p23"]
    assert pressures[0].get_ylabel() == "Pressure [bar]"
    np.testing.assert_allclose(pressures[1].lines[2].get_ydata(), full.pressures[:, 5] / 1e5)
    assert [len(axes.lines) for axes in pressures] == [3, 3]  # equal pressures are drawn once
    assert lengths[0].get_ylabel() == "Bellows length [mm]"
    np.testing.assert_allclose(lengths[1].lines[1].get_ydata(), measured.lengths[:, 4] * 1e3)
    np.testing.assert_allclose(lengths[1].lines[4].get_ydata(), full.lengths[:, 4] * 1e3)
    assert [np.unique(axes.lines[1].get_ydata()).round(9).tolist() for axes in tool] == [[300.0], [400.0], [500.0]]
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["measured", "full model", "Bellows, input 1", "2", "3"]


def test_inputs_without_a_section_share_a_panel_that_names_them() -> None:
    names = ("left", "right", "both", "p21", "p22", "p23")
    figure = plot_trajectories({"run": make(input_names=names)})
    assert figure.axes[0].get_title(loc="left") == "All inputs"
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == list(names)


def test_different_pressures_are_all_drawn() -> None:
    higher = make(pressures=np.full((50, 6), 2e5))
    assert len(plot_trajectories({"a": make(), "b": higher}).axes[0].lines) == 6
    longer = make(rows=3, pressures=np.full((3, 6), 2e5))
    assert len(plot_trajectories({"a": higher, "b": longer}).axes[0].lines) == 3


def test_the_papers_line_styles() -> None:
    assert line_styles(["reduced model", "full", "Measured"]) == {
        "reduced model": DASHED,
        "full": DOTTED,
        "Measured": SOLID,
    }
    assert line_styles(["one", "reduced", "two"]) == {"one": SOLID, "reduced": DASHED, "two": DOTTED}


def test_long_lines_are_thinned_but_keep_their_peak() -> None:
    rows = 10 * MOST_POINTS
    lengths = np.full((rows, 6), 0.2)
    lengths[12345, 0] = 0.3
    figure = plot_trajectories(
        {"run": make(rows=rows, lengths=lengths), "none": make(rows=rows, lengths=np.full((rows, 6), np.nan))}
    )
    line, empty = figure.axes[2].lines[0], figure.axes[2].lines[3]
    assert len(line.get_xdata()) <= MOST_POINTS
    assert np.max(line.get_ydata()) == pytest.approx(300.0)
    assert np.all(np.isnan(empty.get_ydata()))


def test_errors_are_in_millimetres_with_their_root_mean_square() -> None:
    errors = np.full((4, 2, 3), 0.003)
    errors[1, 0, 0] = np.nan
    errors[:, 1, 2] = [0.0, 0.0, 0.0, 0.01]
    figure = plot_errors(np.arange(4.0), {"full": errors}, repeatability=0.0026)
    assert figure.axes[0].get_title(loc="left") == "Head 1, x: RMS 3 mm"
    assert figure.axes[5].get_title(loc="left") == "Head 2, z: RMS 5 mm"
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["repeatability, ±2.6 mm", "full"]


@pytest.mark.parametrize("view", ["projections", "space"])
def test_shapes_hang(view: Any) -> None:
    backbone = np.linspace(0, 1, 5)[:, None] * [0.1, 0.0, 0.9]
    figure = plot_shape([0.0, 1.5], [backbone, 0.5 * backbone], [backbone[-1:], 0.5 * backbone[-1:]], view=view)
    axes = figure.axes[0]
    low, high = axes.get_ylim() if view == "projections" else axes.get_zlim()
    assert low > high  # z downwards
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["t = 0 s", "t = 1.5 s"]
    if view == "projections":
        np.testing.assert_allclose(axes.lines[0].get_xydata()[-1], [100.0, 900.0])


@pytest.mark.parametrize("view", ["projections", "space"])
def test_the_base_is_drawn_where_it_stands(view: Any) -> None:
    backbone = np.array([0.4, 0.0, 1.0]) + np.linspace(0, 1, 5)[:, None] * [0.1, 0.0, -0.5]
    (mark,) = [line for line in plot_shape([0.0], [backbone], view=view).axes[0].lines if line.get_marker() == "s"]
    found = mark.get_xydata()[0] if view == "projections" else [data[0] for data in mark.get_data_3d()]
    np.testing.assert_allclose(found, [400.0, 1000.0] if view == "projections" else [400.0, 0.0, 1000.0])


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_the_same_figure_gives_the_same_bytes_and_settings_stay(tmp_path: Path, kind: str) -> None:
    before = dict(matplotlib.rcParams)
    loaded = "matplotlib.pyplot" in sys.modules
    for name in ("a", "b"):
        write_figure(plot_trajectories({"measured": make(), "full": make(0.001)}), tmp_path / f"{name}.{kind}")
    assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    assert dict(matplotlib.rcParams) == before
    assert ("matplotlib.pyplot" in sys.modules) == loaded
    with pytest.raises(InputError, match=r"figures are written as \.pdf, \.svg or \.png"):
        write_figure(plot_trajectories({"measured": make()}), tmp_path / "a.bmp")


def test_wrong_input_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="nothing to plot"):
        plot_trajectories({})
    with pytest.raises(InputError, match="'b' has no rows"):
        plot_trajectories({"a": make(), "b": make()[:0]})
    with pytest.raises(InputError, match=r"errors of 'a': expected shape \(4, heads, 3\), found \(4, 3\)"):
        plot_errors(np.arange(4.0), {"a": np.zeros((4, 3))})
    with pytest.raises(InputError, match=r"backbones: expected shape \(1, points, 3\), found \(5, 3\)"):
        plot_shape([0.0], np.zeros((5, 3)))
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"Plotting needs matplotlib.*pip install 'bha\[plot\]'"):
        plot_trajectories({"a": make()})


def test_errors_of_a_sensor_read_rarely_are_dots() -> None:
    time = np.arange(100) / 100.0
    errors = np.full((100, 1, 3), np.nan)
    errors[::5] = 1e-3
    for axes in plot_errors(time, {"simulated minus measured": errors}).axes:
        line, dots = axes.lines
        assert dots.get_marker() == "."
        assert len(dots.get_xdata()) == 20
        assert dots.get_color() == line.get_color()
