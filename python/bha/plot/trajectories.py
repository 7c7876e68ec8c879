"""Pressures, bellows lengths and tool position against time, several trajectories over one another (paper, Fig. 12)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bha import names
from bha.plot.style import (
    COLORS,
    MILLIMETRES_PER_METRE,
    PASCAL_PER_BAR,
    SOLID,
    check_trajectories,
    draw,
    figure_of_size,
    line_options,
    line_styles,
)
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

    from bha.runs.trajectory import Trajectory


def plot_trajectories(trajectories: Trajectory | Mapping[str, Trajectory], *, title: str | None = None) -> Figure:
    """Plot trajectories over one another like Fig. 12 of the paper.

    Top: absolute pressure of each input, bar; where all trajectories have the same pressures they are drawn once.
    Middle: bellows lengths, mm. Both have one panel for each section (pressures one for all where the names of the
    inputs are not numbered by sections). Bottom: position of the last head in the world, mm. Colour tells the
    bellows, line style the trajectory: "measured" solid, "full" dotted, "reduced" dashed, as in the paper, others the
    next free. What is NaN throughout (a measurement without lengths, say) is left out.

    Args:
        trajectories: one, or label to trajectory; all with the same number of sections.
        title: a line above the figure.

    Raises:
        InputError: no trajectory, one without rows, or different numbers of sections.
        MissingExtraError: matplotlib is not installed.
    """
    if not isinstance(trajectories, Mapping):
        trajectories = {trajectories.arm_name or "trajectory": trajectories}
    first = check_trajectories(trajectories)
    sections = first.section_count
    styles = line_styles(list(trajectories))
    alone = len(set(map(str, styles.values()))) == 1
    groups = _inputs_by_panel(trajectories, sections)

    with figure_of_size(max(7.2, 2.3 * sections), 6.2) as figure:
        # 3n columns, so that n panels of 3 and 3 panels of n fill the same width.
        grid = figure.add_gridspec(3, 3 * sections)
        wide = "All inputs" in groups
        pressure_axes = _row(figure, [grid[0, :]] if wide else [grid[0, 3 * i : 3 * i + 3] for i in range(sections)])
        length_axes = _row(figure, [grid[1, 3 * i : 3 * i + 3] for i in range(sections)])
        position_axes = [figure.add_subplot(grid[2, i * sections : (i + 1) * sections]) for i in range(3)]

        numbered = "Bellows" if wide else "Bellows, input"
        shown = _with_different_pressures(trajectories)
        for axes, (heading, inputs) in zip(pressure_axes, groups.items(), strict=True):
            for label, trajectory in shown.items():
                _draw_pressures(axes, trajectory, inputs, styles[label] if len(shown) > 1 else SOLID)
            axes.set_title(heading, loc="left")
            if wide or len(inputs) > 3:
                _legend_of_inputs(axes, inputs)
        pressure_axes[0].set_ylabel("Pressure [bar]")

        for section, axes in enumerate(length_axes):
            for label, trajectory in trajectories.items():
                for bellows in range(3):
                    values = trajectory.lengths[:, 3 * section + bellows] * MILLIMETRES_PER_METRE
                    draw(axes, trajectory.time, values, **line_options(styles[label], COLORS[bellows], alone))
            axes.set_title(f"Section {section + 1}", loc="left")
        length_axes[0].set_ylabel("Bellows length [mm]")

        for axis, axes in zip("xyz", position_axes, strict=True):
            for label, trajectory in trajectories.items():
                values = trajectory.head_positions[:, -1, "xyz".index(axis)] * MILLIMETRES_PER_METRE
                draw(axes, trajectory.time, values, **line_options(styles[label], COLORS[0], alone))
            axes.set_title(f"Tool, {axis}", loc="left")
            axes.set_xlabel("Time [s]")
        position_axes[0].set_ylabel("Position [mm]")
        _same_scale(position_axes)

        for axes in (*pressure_axes, *length_axes, *position_axes):
            axes.set_xlim(first.time[0], max(trajectory.time[-1] for trajectory in trajectories.values()))
        _legend(
            figure, {label: line_options(style, COLORS[0], alone) for label, style in styles.items()}, numbered, title
        )
    return figure


def _row(figure: Figure, places: list[SubplotSpec]) -> list[Axes]:
    """Panels beside one another that share their scale, so that they can be compared; numbers at the first one only."""
    first = figure.add_subplot(places[0])
    others = [figure.add_subplot(place, sharey=first) for place in places[1:]]
    for axes in others:
        axes.tick_params(labelleft=False)
    return [first, *others]


def _inputs_by_panel(trajectories: Mapping[str, Trajectory], sections: int) -> dict[str, list[str]]:
    """Heading of a pressure panel to its inputs: grouped by the first number of their names, or all in one panel.

    The headings name the inputs, not a section: which input feeds which section is for the arm to say.
    """
    every = list(dict.fromkeys(name for trajectory in trajectories.values() for name in trajectory.input_names))
    groups: dict[int | None, list[str]] = {}
    for name in every:
        groups.setdefault(names.section_of_pressure(name), []).append(name)
    if None in groups or len(groups) != sections:
        return {"All inputs": every}
    return {(", ".join(group) if len(group) < 5 else f"{group[0]} to {group[-1]}"): group for group in groups.values()}


def _with_different_pressures(trajectories: Mapping[str, Trajectory]) -> dict[str, Trajectory]:
    """Those whose pressures differ from the ones before; models under test usually share the measured pressures."""
    shown: dict[str, Trajectory] = {}
    for label, trajectory in trajectories.items():
        if not any(_same_pressures(trajectory, other) for other in shown.values()):
            shown[label] = trajectory
    return shown


def _same_pressures(one: Trajectory, other: Trajectory) -> bool:
    if one.input_names != other.input_names:
        return False
    if len(one) == len(other) and np.array_equal(one.time, other.time):
        return np.array_equal(one.pressures, other.pressures, equal_nan=True)
    pairs = zip(one.pressures.T, other.pressures.T, strict=True)
    return all(np.allclose(np.interp(one.time, other.time, b), a, rtol=1e-6, equal_nan=True) for a, b in pairs)


def _draw_pressures(axes: Axes, trajectory: Trajectory, inputs: list[str], style: Any) -> None:
    """Inputs are often under one pressure: each line is thinner than the one below, so that all of them show."""
    for order, name in enumerate(inputs):
        if name in trajectory.input_names:
            values = trajectory.pressures[:, trajectory.input_names.index(name)] / PASCAL_PER_BAR
            width = 0.8 + 2.4 * (len(inputs) - 1 - order) / max(len(inputs) - 1, 1)
            line = {"linewidth": width, "color": COLORS[order % len(COLORS)], "zorder": 2 + 0.01 * order}
            draw(axes, trajectory.time, values, linestyle=style, **line)


def _same_scale(row: list[Axes]) -> None:
    """The same millimetres per inch in all panels, each about its own middle: small motions must look small."""
    limits = [axes.get_ylim() for axes in row]
    span = max(high - low for low, high in limits)
    for axes, (low, high) in zip(row, limits, strict=True):
        axes.set_ylim((low + high - span) / 2, (low + high + span) / 2)


def _legend(figure: Figure, styles: Mapping[str, Mapping[str, Any]], numbered: str, title: str | None) -> None:
    """One legend above all panels: line styles of the trajectories, then colours by number."""
    lines = import_extra("matplotlib.lines", extra="plot", purpose="Plotting")
    handles = [lines.Line2D([], [], label=label, **options) for label, options in styles.items()]
    handles += [
        lines.Line2D([], [], color=COLORS[order], linewidth=3, solid_capstyle="butt", label=label)
        for order, label in enumerate((f"{numbered} 1", "2", "3"))
    ]
    figure.legend(
        handles=handles,
        loc="outside upper left",
        ncols=min(len(handles), 7),
        columnspacing=1.6,
        title=title,
        alignment="left",
    )


def _legend_of_inputs(axes: Axes, inputs: list[str]) -> None:
    lines = import_extra("matplotlib.lines", extra="plot", purpose="Plotting")
    colors = [COLORS[order % len(COLORS)] for order in range(len(inputs))]
    handles = [lines.Line2D([], [], color=color, label=name) for name, color in zip(inputs, colors, strict=True)]
    # On the line of the panel's heading, at its right end: beside the panel it would make all panels narrow.
    axes.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 0.98),
        ncols=min(len(inputs), 10),
        handlelength=1.0,
        columnspacing=0.9,
        borderaxespad=0.0,
    )
