"""The figures of the paper that no general plot covers: fits (Figs. 8, 9), swings (10, 14), energies (11), drift."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.experiments.procedures import BendingFit, StiffnessFit
from bha.plot.style import (
    COLORS,
    DASHED,
    DOTTED,
    MILLIMETRES_PER_METRE,
    PASCAL_PER_BAR,
    SOLID,
    draw,
    figure_of_size,
    line_options,
    line_styles,
)
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]
WIDTH = 7.2


def stiffness_figure(fits: Sequence[StiffnessFit], truth: Sequence[tuple[Array, Array]]) -> Figure:
    """Fig. 8: spring force of one bellows against its length, measured points and fitted curve, a panel a section."""
    with figure_of_size(WIDTH, 2.5) as figure:
        panels = figure.subplots(1, len(fits), sharex=True, sharey=True, squeeze=False)[0]
        for number, (axes, fit, (lengths, forces)) in enumerate(zip(panels, fits, truth, strict=True), start=1):
            grid = np.linspace(fit.lengths.min(), fit.lengths.max(), 200)
            mm = MILLIMETRES_PER_METRE
            axes.plot(lengths * mm, forces, label="virtual arm", **line_options(SOLID, COLORS[0]))
            axes.plot(grid * mm, fit.curve(grid), label="fit", **line_options(DASHED, COLORS[1]))
            axes.plot(fit.lengths * mm, fit.forces, "o", markersize=3.5, markerfacecolor="none", color=COLORS[4],
                      markeredgewidth=0.9, linestyle="none", label="steady states", zorder=3)  # fmt: skip
            axes.set_title(f"Section {number}", loc="left")
            axes.set_xlabel("Bellows length [mm]")
        panels[0].set_ylabel("Spring force [N]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
    return figure


def bending_figure(fits: Sequence[BendingFit], ideal: Mapping[int, BendingFit]) -> Figure:
    """Fig. 9: relative bending pressure against bending angle, points and line, a panel a section.

    ``ideal``: section index to the same measurement on an arm without creep.
    """
    with figure_of_size(WIDTH, 2.5) as figure:
        panels = figure.subplots(1, len(fits), sharex=True, sharey=True, squeeze=False)[0]
        for index, (axes, fit) in enumerate(zip(panels, fits, strict=True)):
            scale = fit.pressure_per_moment / PASCAL_PER_BAR
            order = np.linspace(fit.angles.min(), fit.angles.max(), 2)
            axes.plot(order, (fit.stiffness * order + fit.offset) * scale, label="line", zorder=2.2,
                      **{"linestyle": SOLID, "color": COLORS[1], "linewidth": 1.0})  # fmt: skip
            axes.plot(fit.angles, fit.moments * scale, "o", markersize=3.5, markerfacecolor="none", color=COLORS[4],
                      markeredgewidth=0.9, linestyle="none", label="steady states", zorder=3)  # fmt: skip
            if index in ideal:
                axes.plot(ideal[index].angles, ideal[index].moments * scale, "x", markersize=3.5, color=COLORS[5],
                          markeredgewidth=0.9, linestyle="none", label="the same without creep")  # fmt: skip
            axes.set_title(f"Section {index + 1}", loc="left")
            axes.set_xlabel("Bending angle [rad]")
        panels[0].set_ylabel("Relative bending pressure [bar]")
        handles, labels = panels[min(ideal, default=0)].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
    return figure


def swing_figure(
    lateral: Mapping[str, tuple[Array, Array]], lengths: Mapping[str, tuple[Array, Array]], bellows: Sequence[int]
) -> Figure:
    """Figs. 10 and 14: lateral deflection of the heads and some bellows lengths after the release.

    Args:
        lateral: label to (time, deflection x of every head (m, n)); line style as in the paper by the label.
        lengths: label to (time, lengths (m, 3n)).
        bellows: indices of the lengths to show, one panel each.
    """
    styles = line_styles(list(lateral))
    alone = len(lateral) == 1
    heads = next(iter(lateral.values()))[1].shape[1]
    with figure_of_size(WIDTH, 4.2) as figure:
        grid = figure.add_gridspec(2, 3 * len(bellows) if len(bellows) else 3, height_ratios=[1.25, 1])
        top = figure.add_subplot(grid[0, :])
        for label, (time, deflection) in lateral.items():
            for head in range(heads):
                draw(top, time, deflection[:, head] * MILLIMETRES_PER_METRE,
                     **line_options(styles[label], COLORS[head], alone))  # fmt: skip
        top.set_ylabel("Lateral deflection x [mm]")
        top.set_xlabel("Time [s]")
        below: list[Axes] = []
        for place, index in enumerate(bellows):
            axes = figure.add_subplot(grid[1, 3 * place : 3 * place + 3], sharey=below[0] if below else None)
            for label, (time, q) in lengths.items():
                draw(axes, time, q[:, index] * MILLIMETRES_PER_METRE,
                     **line_options(styles[label], COLORS[index // 3], alone))  # fmt: skip
            axes.set_title(f"q{index // 3 + 1}{index % 3 + 1}", loc="left")
            axes.set_xlabel("Time [s]")
            if place:
                axes.tick_params(labelleft=False)
            below.append(axes)
        below[0].set_ylabel("Bellows length [mm]")
        for axes in (top, *below):
            axes.set_xlim(0.0, min(time[-1] for time, _ in lateral.values()))
        _legend(figure, {k: line_options(s, COLORS[0], alone) for k, s in styles.items()}, "Section")
    return figure


def _legend(figure: Figure, styles: Mapping[str, Mapping[str, Any]], numbered: str) -> None:
    """Above all panels: line styles by label, then the colours by number."""
    lines = import_extra("matplotlib.lines", extra="plot", purpose="Plotting")
    handles = [lines.Line2D([], [], label=label, **options) for label, options in styles.items()]
    handles += [
        lines.Line2D([], [], color=COLORS[k], linewidth=3, solid_capstyle="butt", label=label)
        for k, label in enumerate((f"{numbered} 1", "2", "3"))
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)


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
        _legend(figure, {k: line_options(s, COLORS[0]) for k, s in styles.items()}, "Bellows")
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
