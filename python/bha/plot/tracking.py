"""How closed loops follow their reference: tip errors over time, and which inputs were at a limit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from bha.errors import InputError
from bha.plot.style import COLORS, MILLIMETRES_PER_METRE, SOLID, draw, figure_of_size, line_options

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bha.control import ClosedLoopRun


def plot_tracking(runs: Mapping[str, ClosedLoopRun], *, title: str | None = None) -> Figure:
    """Plot the tip's distance from the reference, mm, a panel for each run, all to the same scale.

    Each panel says the root mean square and the greatest distance, and which inputs were at a limit.

    Args:
        runs: label to closed loop.
        title: a line above the figure.

    Raises:
        InputError: no runs given.
        MissingExtraError: matplotlib is not installed.
    """
    if not runs:
        raise InputError("runs: nothing to plot; give at least one closed loop, as {label: run}")
    with figure_of_size(7.2, 0.6 + 1.15 * len(runs)) as figure:
        grid = figure.subplots(len(runs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for k, (axes, (label, run)) in enumerate(zip(grid, runs.items(), strict=True)):
            error = run.tip_error * MILLIMETRES_PER_METRE
            draw(
                axes,
                run.trajectory.time,
                error,
                label=label,
                **line_options(SOLID, COLORS[k % len(COLORS)], alone=True),
            )
            rms = run.rms_tip_error() * MILLIMETRES_PER_METRE
            limits = ", ".join(f"{name} {share:.0%}" for name, share in run.saturation().items())
            note = f"; at a limit: {limits}" if limits else ""
            axes.set_title(f"{label}: RMS {rms:.2f} mm, greatest {error.max():.1f} mm{note}", loc="left")
            axes.set_ylim(bottom=0.0)
            axes.set_ylabel("[mm]")
        grid[-1].set_xlabel("Time [s]")
        grid[-1].set_xlim(0.0, max(float(run.trajectory.time[-1]) for run in runs.values()))
        if title is not None:
            figure.suptitle(title, x=0.01, ha="left")
    return figure
