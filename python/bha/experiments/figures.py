"""The figures of the paper that no general plot covers: tilts (Figs. 12, 13), energies (11), drift."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.plot.style import (
    COLORS,
    DASHED,
    DOTTED,
    MILLIMETRES_PER_METRE,
    PASCAL_PER_BAR,
    SOLID,
    WIDTH,
    draw,
    figure_of_size,
    legend_above,
    line_options,
    line_styles,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]


def tilt_figure(trajectories: Mapping[str, Trajectory]) -> Figure:
    """Figs. 12 and 13: pressures and lengths of section 1, and the tool, against time; line style by label."""
    styles = line_styles(list(trajectories))
    first = next(iter(trajectories.values()))
    with figure_of_size(WIDTH, 4.4) as figure:
        panels = figure.subplots(2, 2, sharex=True)
        for k, name in enumerate(first.input_names[:3]):
            # Two of the three are often equal: each line is thinner than the one below.
            draw(panels[0, 0], first.time, first.pressures[:, k] / PASCAL_PER_BAR, color=COLORS[k],
                 linewidth=2.4 - 0.8 * k, label=name)  # fmt: skip
        for label, trajectory in trajectories.items():
            for k in range(3):
                values = trajectory.lengths[:, k] * MILLIMETRES_PER_METRE
                draw(panels[0, 1], trajectory.time, values, **line_options(styles[label], COLORS[k]))
            for axes, axis in ((panels[1, 0], 0), (panels[1, 1], 2)):
                values = trajectory.head_positions[:, -1, axis] * MILLIMETRES_PER_METRE
                draw(axes, trajectory.time, values, **line_options(styles[label], COLORS[0]))
        panels[0, 0].set_title("Section 1, pressures", loc="left")
        panels[0, 0].set_ylabel("Absolute pressure [bar]")
        panels[0, 1].set_title("Section 1, bellows", loc="left")
        panels[0, 1].set_ylabel("Length [mm]")
        for axes, letter in ((panels[1, 0], "x"), (panels[1, 1], "z")):
            axes.set_title(f"Tool, {letter}", loc="left")
            axes.set_ylabel("Position [mm]")
            axes.set_xlabel("Time [s]")
            axes.set_xlim(first.time[0], first.time[-1])
        legend_above(figure, {k: line_options(s, COLORS[0]) for k, s in styles.items()}, "Bellows")
    return figure


def energy_figure(time: Array, translational: Array, rotational_bound: Array) -> Figure:
    """Fig. 11: measured translational energy and the upper bound of the rotational energy, J."""
    with figure_of_size(WIDTH, 2.6) as figure:
        axes = figure.add_subplot()
        draw(axes, time, translational, label="translational energy", **line_options(SOLID, COLORS[0], alone=True))
        draw(axes, time, rotational_bound, label="rotational energy, upper bound",
             **line_options(DOTTED, COLORS[4], alone=True))  # fmt: skip
        axes.set_xlabel("Time [s]")
        axes.set_ylabel("Energy [J]")
        axes.set_xlim(0.0, time[-1])
        axes.set_ylim(bottom=0.0)
        axes.legend(loc="upper right")
    return figure


def drift_figure(time: Array, energies: Mapping[str, Array]) -> Figure:
    """Energy above rest relative to its start, one line a force model."""
    with figure_of_size(WIDTH, 2.6) as figure:
        axes = figure.add_subplot()
        for (label, values), color, style in zip(
            energies.items(), (COLORS[4], COLORS[0]), (SOLID, DASHED), strict=False
        ):
            draw(axes, time, values, label=label, **line_options(style, color, alone=True))
        axes.set_xlabel("Time [s]")
        axes.set_ylabel("Energy above rest / its start")
        axes.set_xlim(0.0, time[-1])
        axes.set_ylim(bottom=0.0)
        axes.legend(loc="upper left")
    return figure
