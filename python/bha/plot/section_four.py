"""Figs. 8 to 10 of the paper, of anybody's arm: spring forces, bending pressures, swings; a panel a section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.identification.stiffness import StiffnessFit
from bha.identification.swing import SwingFit, deflection
from bha.plot.style import (
    COLORS,
    DASHED,
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
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


def plot_stiffness(fits: Sequence[StiffnessFit], truth: Sequence[tuple[Array, Array]] = ()) -> Figure:
    """Fig. 8: spring force of one bellows against its length, measured points and fitted curve.

    Args:
        fits: one a section, from ``longitudinal_stiffness``.
        truth: lengths, m, and forces, N, of a curve that is known, one a section; none where nobody knows.
    """
    mm = MILLIMETRES_PER_METRE
    with figure_of_size(_width(len(fits)), 2.5) as figure:
        panels = figure.subplots(1, len(fits), sharex=True, sharey=True, squeeze=False)[0]
        for number, (axes, fit) in enumerate(zip(panels, fits, strict=True)):
            grid = np.linspace(fit.abscissa.min(), fit.abscissa.max(), 200)
            if truth:
                lengths, forces = truth[number]
                axes.plot(lengths * mm, forces, label="virtual arm", **line_options(SOLID, COLORS[0]))
            axes.plot((fit.rest_length + grid) * mm, fit.curve(grid), label="fit", **line_options(DASHED, COLORS[1]))
            _points(axes, (fit.rest_length + fit.abscissa) * mm, fit.ordinate)
            axes.set_title(f"Section {fit.section}", loc="left")
            axes.set_xlabel("Bellows length [mm]")
        panels[0].set_ylabel("Spring force [N]")
        _legend_of(figure, panels[0])
    return figure


def plot_bending(fits: Sequence[StiffnessFit], without: Mapping[int, StiffnessFit] | None = None) -> Figure:
    """Fig. 9: relative bending pressure against bending angle, points and the fitted law.

    Args:
        fits: one a section, from ``bending_stiffness``.
        without: number of a section to the same measurement on an arm without creep, drawn as crosses.
    """
    others = without or {}
    with figure_of_size(_width(len(fits)), 2.5) as figure:
        panels = figure.subplots(1, len(fits), sharex=True, sharey=True, squeeze=False)[0]
        shown = panels[0]
        for axes, fit in zip(panels, fits, strict=True):
            scale = fit.pressure_per_moment / PASCAL_PER_BAR
            grid = np.linspace(fit.abscissa.min(), fit.abscissa.max(), 100)
            axes.plot(grid, fit.curve(grid) * scale, label="line" if len(fit.coefficients) == 1 else "fit", zorder=2.2,
                      **{"linestyle": SOLID, "color": COLORS[1], "linewidth": 1.0})  # fmt: skip
            _points(axes, fit.abscissa, fit.ordinate * scale)
            if fit.section in others:
                other, shown = others[fit.section], axes
                axes.plot(other.abscissa, other.ordinate * scale, "x", markersize=3.5, color=COLORS[5],
                          markeredgewidth=0.9, linestyle="none", label="the same without creep")  # fmt: skip
            axes.set_title(f"Section {fit.section}", loc="left")
            axes.set_xlabel("Bending angle [rad]")
        panels[0].set_ylabel("Relative bending pressure [bar]")
        _legend_of(figure, shown)
    return figure


def plot_swing(fit: SwingFit, number: int = 0) -> Figure:
    """Fig. 10: one swing of a fit: the heads' deflections, the oscillation fitted to the tip's, and the model's."""
    swing, seen, model = fit.swings[number], fit.measured[number], fit.modelled[number]
    sections = swing.heads.shape[1]
    known = [k for k in range(1, sections + 1) if np.isfinite(swing.heads[:, k - 1]).any()]
    measured, fitted = np.full((len(swing.time), sections), np.nan), np.full((len(seen.time), sections), np.nan)
    modelled = np.full((len(model.time), sections), np.nan)
    for section in known:
        measured[:, section - 1] = deflection(swing.heads, section)
    fitted[:, swing.tip - 1] = seen.fitted
    # The direction's sign is that of a component, which may differ where the heads are seen in another frame.
    modelled[:, swing.tip - 1] = model.fitted * np.sign(model.fitted[0] * seen.fitted[0] or 1.0)
    lines = {"measured": (swing.time, measured), "fit": (seen.time, fitted), "model": (model.time, modelled)}
    return swing_figure(lines)


def swing_figure(
    lateral: Mapping[str, tuple[Array, Array]],
    lengths: Mapping[str, tuple[Array, Array]] | None = None,
    bellows: Sequence[int] = (),
) -> Figure:
    """Figs. 10 and 14: lateral deflection of the heads and some bellows lengths after the release.

    Args:
        lateral: label to (time, deflection of every head (m, n)); line style as in the paper by the label.
        lengths: label to (time, lengths (m, 3n)).
        bellows: indices of the lengths to show, one panel each.
    """
    styles = line_styles(list(lateral))
    alone = len(lateral) == 1
    heads = next(iter(lateral.values()))[1].shape[1]
    with figure_of_size(WIDTH, 4.2 if len(bellows) else 2.5) as figure:
        grid = figure.add_gridspec(
            1 + bool(len(bellows)), 3 * max(len(bellows), 1), height_ratios=[1.25, 1][: 1 + bool(len(bellows))]
        )
        top = figure.add_subplot(grid[0, :])
        for label, (time, deflections) in lateral.items():
            for head in range(heads):
                draw(top, time, deflections[:, head] * MILLIMETRES_PER_METRE,
                     **line_options(styles[label], COLORS[head], alone))  # fmt: skip
        top.set_ylabel("Lateral deflection x [mm]" if len(bellows) else "Lateral deflection [mm]")
        top.set_xlabel("Time [s]")
        below: list[Axes] = []
        for place, index in enumerate(bellows):
            axes = figure.add_subplot(grid[1, 3 * place : 3 * place + 3], sharey=below[0] if below else None)
            for label, (time, q) in (lengths or {}).items():
                draw(axes, time, q[:, index] * MILLIMETRES_PER_METRE,
                     **line_options(styles[label], COLORS[index // 3], alone))  # fmt: skip
            axes.set_title(f"q{index // 3 + 1}{index % 3 + 1}", loc="left")
            axes.set_xlabel("Time [s]")
            if place:
                axes.tick_params(labelleft=False)
            below.append(axes)
        if below:
            below[0].set_ylabel("Bellows length [mm]")
        for axes in (top, *below):
            axes.set_xlim(0.0, min(time[-1] for time, _ in lateral.values()))
        legend_above(figure, {k: line_options(s, COLORS[0], alone) for k, s in styles.items()}, "Section", heads)
    return figure


def _width(panels: int) -> float:
    return max(3.4, WIDTH / 3.0 * panels)


def _points(axes: Axes, x: Array, y: Array) -> None:
    axes.plot(x, y, "o", markersize=3.5, markerfacecolor="none", color=COLORS[4], markeredgewidth=0.9,
              linestyle="none", label="steady states", zorder=3)  # fmt: skip


def _legend_of(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3)
