"""How closed loops follow their reference: tip errors over time, and which inputs were at a limit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bha.errors import InputError
from bha.plot.style import COLORS, DASH_DOTTED, DASHED, DOTTED, MILLIMETRES_PER_METRE, SOLID, draw, figure_of_size

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bha.control import ClosedLoopRun

#: Styles of the runs whose labels agree up to the first comma.
_STYLES = (SOLID, DASHED, DOTTED, DASH_DOTTED)
#: Least distance that is drawn, mm: below it the logarithm shows nothing but noise.
_LEAST = 0.05


def plot_tracking(runs: Mapping[str, ClosedLoopRun], *, title: str | None = None) -> Figure:
    """Plot the tip's distance from the reference, mm, logarithmic: above over time, below its mean and greatest.

    Labels that agree up to the first comma get one colour and differ in their line style ("full model", "full model,
    with creep"). Beside the lower panel stands which inputs were at a limit, and for how much of the time.

    Args:
        runs: label to closed loop.
        title: a line above the figure.

    Raises:
        InputError: no runs given.
        MissingExtraError: matplotlib is not installed.
    """
    if not runs:
        raise InputError("runs: nothing to plot; give at least one closed loop, as {label: run}")
    styles = _line_styles(list(runs))
    with figure_of_size(7.2, 3.2 + 0.19 * len(runs)) as figure:
        above, below = figure.subplots(2, 1, height_ratios=[2.4, 0.6 + 0.19 * len(runs)])
        # Limits of our own: where all distances are the same, the logarithm has no range to find them from.
        means = [max(run.rms_tip_error() * MILLIMETRES_PER_METRE, _LEAST) for run in runs.values()]
        most = max(10 * _LEAST, *(float(run.tip_error.max()) * MILLIMETRES_PER_METRE for run in runs.values()))
        above.set_ylim(0.9 * _LEAST, 1.3 * most)
        # Room for the notes on the right.
        below.set_xlim(0.8 * min(means), most * (most / min(means)) ** 0.35 * 1.5)
        above.set_yscale("log")
        below.set_xscale("log")
        for row, (label, run) in enumerate(runs.items()):
            error = run.tip_error * MILLIMETRES_PER_METRE
            options = styles[label]
            draw(above, run.trajectory.time, np.maximum(error, _LEAST), **options, linewidth=1.1)
            rms, greatest = run.rms_tip_error() * MILLIMETRES_PER_METRE, float(error.max())
            below.plot(
                [rms, greatest], [row, row], color=options["color"], linewidth=1.0, linestyle=options["linestyle"]
            )
            below.plot(rms, row, "o", color=options["color"], markersize=4.5)
            below.plot(greatest, row, "|", color=options["color"], markersize=7, markeredgewidth=1.4)
            limits = ", ".join(f"{name} {share:.1%}" for name, share in run.saturation().items())
            note = f"{rms:.2f} mm" + (f"; at a limit: {limits}" if limits else "")
            below.annotate(note, (greatest, row), xytext=(7, 0), textcoords="offset points", va="center")
        above.yaxis.set_major_formatter("{x:g}")
        above.set_ylabel("Distance of the tip\nfrom the reference [mm]")
        above.set_xlabel("Time [s]")
        above.set_xlim(0.0, max(float(run.trajectory.time[-1]) for run in runs.values()))
        below.xaxis.set_major_formatter("{x:g}")
        below.set_xlabel("Root mean square (dot) and greatest distance (bar) [mm]")
        below.set_yticks(range(len(runs)), list(runs))
        below.set_ylim(len(runs) - 0.5, -0.5)
        below.grid(axis="y", visible=False)
        if title is not None:
            figure.suptitle(title, x=0.01, ha="left")
    return figure


def _line_styles(labels: list[str]) -> dict[str, dict[str, Any]]:
    groups: dict[str, list[str]] = {}
    for label in labels:
        groups.setdefault(label.partition(",")[0], []).append(label)
    return {
        label: {"color": COLORS[k % len(COLORS)], "linestyle": _STYLES[j % len(_STYLES)]}
        for k, members in enumerate(groups.values())
        for j, label in enumerate(members)
    }
