"""How closed loops follow their reference: tip errors over time, which inputs were at a limit, and the tip's path."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bha.errors import InputError
from bha.plot.style import COLORS, DASH_DOTTED, DASHED, DOTTED, MILLIMETRES_PER_METRE, SOLID, draw, figure_of_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bha.control import ClosedLoopRun

#: Styles of the runs whose labels agree up to the first comma.
_STYLES = (SOLID, DASHED, DOTTED, DASH_DOTTED)
#: Least distance that is drawn, mm: below it the logarithm shows nothing but noise.
_LEAST = 0.05
#: Inputs at a limit that are named beside a bar; the others are counted.
_MOST_NAMED = 2
#: Characters of a title's line and of a label.
_TITLE_WIDTH, _LABEL_WIDTH = 105, 34
_REFERENCE = "#8C8C8C"


def plot_tracking(runs: Mapping[str, ClosedLoopRun], *, title: str | None = None) -> Figure:
    """Plot how the tip follows: its distance from the reference over time, mean and greatest, and its path.

    Above the distance, mm, logarithmic, over time; in the middle its root mean square and greatest value and which
    inputs were at a limit, for how much of the time; below the paths of the tips beside the reference's, seen from
    above (x, y) and from the side (the horizontal axis that the reference moves along most, and z).

    Labels that agree up to the first comma get one colour and differ in their line style ("full model", "full model,
    with creep").

    Args:
        runs: label to closed loop.
        title: a line above the figure; long ones are broken.

    Raises:
        InputError: no runs given.
        MissingExtraError: matplotlib is not installed.
    """
    if not runs:
        raise InputError("runs: nothing to plot; give at least one closed loop, as {label: run}")
    styles = _line_styles(list(runs))
    bars = 0.6 + 0.19 * len(runs)
    with figure_of_size(7.2, 5.9 + 0.19 * len(runs)) as figure:
        grid = figure.add_gridspec(3, 2, height_ratios=[2.2, bars, 2.9])
        above, below = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, :])
        _distances(above, runs, styles)
        _bars(below, runs, styles)
        _paths((figure.add_subplot(grid[2, 0]), figure.add_subplot(grid[2, 1])), runs, styles)
        if title is not None:
            figure.suptitle(textwrap.fill(title, _TITLE_WIDTH), x=0.01, ha="left")
    return figure


def _distances(axes: Axes, runs: Mapping[str, ClosedLoopRun], styles: dict[str, dict[str, Any]]) -> None:
    """Distance of the tip over time."""
    most = max(10 * _LEAST, *(float(run.tip_error.max()) * MILLIMETRES_PER_METRE for run in runs.values()))
    # Limits of our own: where all distances are the same, the logarithm has no range to find them from.
    axes.set_ylim(0.9 * _LEAST, 1.3 * most)
    axes.set_yscale("log")
    for label, run in runs.items():
        error = np.maximum(run.tip_error * MILLIMETRES_PER_METRE, _LEAST)
        draw(axes, run.trajectory.time, error, **styles[label], linewidth=1.1)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    axes.set_ylabel("Distance of the tip\nfrom the reference [mm]")
    axes.set_xlabel("Time [s]")
    last = max(float(run.trajectory.time[-1]) for run in runs.values())
    axes.set_xlim(0.0, last if last > 0.0 else 1.0)


def _bars(axes: Axes, runs: Mapping[str, ClosedLoopRun], styles: dict[str, dict[str, Any]]) -> None:
    """Mean and greatest distance of each run; what is said beside them gets its room from the layout."""
    means, most = [], _LEAST
    for row, (label, run) in enumerate(runs.items()):
        options = styles[label]
        rms = max(run.rms_tip_error() * MILLIMETRES_PER_METRE, _LEAST)
        greatest = max(float(run.tip_error.max()) * MILLIMETRES_PER_METRE, _LEAST)
        means.append(rms)
        most = max(most, greatest)
        axes.plot([rms, greatest], [row, row], color=options["color"], linewidth=1.0, linestyle=options["linestyle"])
        axes.plot(rms, row, "o", color=options["color"], markersize=4.5)
        axes.plot(greatest, row, "|", color=options["color"], markersize=7, markeredgewidth=1.4)
        beside: dict[str, Any] = {
            "transform": axes.get_yaxis_transform(),
            "va": "center",
            "fontsize": 6.5,
            "linespacing": 1.0,
        }
        axes.text(1.01, row, _note(run), **beside)
    if most > 10 * min(means):
        axes.set_xscale("log")
        axes.set_xlim(0.8 * min(means), 1.25 * most)
    else:
        axes.set_xlim(0.0, 1.05 * most)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.set_xlabel("Root mean square (dot), greatest distance (bar) [mm]; beside: inputs at a limit, part of the time")
    axes.set_yticks(range(len(runs)), [textwrap.shorten(label, _LABEL_WIDTH, placeholder=" ...") for label in runs])
    axes.set_ylim(len(runs) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)


def _note(run: ClosedLoopRun) -> str:
    limits = sorted(run.saturation().items(), key=lambda pair: -pair[1])
    named = ", ".join(f"{name} {share:.0%}" for name, share in limits[:_MOST_NAMED])
    rest = f", +{len(limits) - _MOST_NAMED}" if len(limits) > _MOST_NAMED else ""
    return f"{run.rms_tip_error() * MILLIMETRES_PER_METRE:.2f} mm" + (f"\n{named}{rest}" if limits else "")


def _paths(both: tuple[Axes, Axes], runs: Mapping[str, ClosedLoopRun], styles: dict[str, dict[str, Any]]) -> None:
    """Paths of the tips, seen from above and from the side, at one scale each."""
    wanted = [run.reference_heads[:, -1] * MILLIMETRES_PER_METRE for run in runs.values()]
    wide = int(np.argmax(np.max([np.ptp(path[:, :2], axis=0) for path in wanted], axis=0)))
    for axes, (across, up) in zip(both, ((0, 1), (wide, 2)), strict=True):
        drawn: set[bytes] = set()
        for path in wanted:
            # Runs mostly share their reference.
            if path.tobytes() not in drawn:
                drawn.add(path.tobytes())
                axes.plot(path[:, across], path[:, up], color=_REFERENCE, linewidth=3.0, alpha=0.5, zorder=1.9)
        for label, run in runs.items():
            tip = run.trajectory.head_positions[:, -1] * MILLIMETRES_PER_METRE
            axes.plot(tip[:, across], tip[:, up], **styles[label], linewidth=1.0)
            axes.plot(*tip[-1, [across, up]], "o", color=styles[label]["color"], markersize=3.0)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel(f"{'xyz'[across]} of the tip [mm]")
        axes.set_ylabel(f"{'xyz'[up]} of the tip [mm]")
        axes.locator_params(nbins=6)
    both[0].set_title("Path from above; broad: reference, dot: end", loc="left")
    both[1].set_title("From the side", loc="left")


def _line_styles(labels: list[str]) -> dict[str, dict[str, Any]]:
    groups: dict[str, list[str]] = {}
    for label in labels:
        groups.setdefault(label.partition(",")[0], []).append(label)
    return {
        label: {"color": COLORS[k % len(COLORS)], "linestyle": _STYLES[j % len(_STYLES)]}
        for k, members in enumerate(groups.values())
        for j, label in enumerate(members)
    }
