"""How far heads are from where they were measured, over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from bha.errors import InputError
from bha.plot.style import COLORS, MILLIMETRES_PER_METRE, axes_of_size, draw, line_styles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bha.recordings import Recording
    from bha.runs.trajectory import Trajectory


def plot_gap(
    recording: Recording,
    trajectories: Trajectory | Mapping[str, Trajectory],
    *,
    axes: Axes | None = None,
    title: str | None = None,
) -> Figure:
    """Plot the distance of each head of simulations from where a log has measured it, mm; RMS in the legend.

    Colour tells the head, line style the simulation. Where a head was not measured in all of its axes is a gap.

    Args:
        recording: arm and log, :class:`bha.Recording`.
        trajectories: a simulation of this drive, or several by label.
        axes: the caller's axes, to be drawn into.
        title: a line above.

    Returns:
        The figure, that of ``axes`` where given.

    Raises:
        InputError: the log has measured no head, or there is no trajectory.
        MissingExtraError: matplotlib is not installed.
    """
    runs = trajectories if isinstance(trajectories, Mapping) else {"": trajectories}
    columns = {
        head: [k for k, o in enumerate(recording.outputs) if o.kind == "position" and o.section == head]
        for head in range(1, recording.arm.section_count + 1)
    }
    columns = {head: places for head, places in columns.items() if places}
    if not columns:
        raise InputError(f"{recording.name}: has measured no head; a gap needs columns x1, y1, z1 of a log")
    if not runs:
        raise InputError("nothing to plot: give at least one trajectory")
    styles = line_styles(list(runs))
    with axes_of_size(axes, 6.4, 3.0) as panel:
        for label, run in runs.items():
            errors = recording.errors(run)
            for head, places in columns.items():
                distance = np.linalg.norm(errors[:, places], axis=1) * MILLIMETRES_PER_METRE
                there = distance[np.isfinite(distance)]
                rms = f"{np.sqrt(np.mean(there**2)):.3g} mm RMS" if len(there) else "not measured here"
                name = ", ".join(filter(None, (label, f"head {head}")))
                options = {"color": COLORS[head % len(COLORS)], "linestyle": styles[label]}
                draw(panel, run.time, distance, label=f"{name}: {rms}", **options)
        panel.set_xlabel("Time [s]")
        panel.set_ylabel("Distance from measured [mm]")
        panel.set_ylim(bottom=0.0)
        panel.legend()
        if title is not None:
            panel.set_title(title, loc="left")
        figure = panel.get_figure(root=True)
        assert figure is not None
        return figure
