"""Pictures of an identification: held-out logs, correlations; Figs. 8 to 10 of the paper's procedures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bha.identification.result import Identification
from bha.identification.statics import StiffnessFit
from bha.identification.swing import Oscillation
from bha.identification.words import spoken
from bha.plot.style import COLORS, DASHED, SOLID, draw, figure_of_size, line_options

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MM = 1e3


def plot_prediction(result: Identification, number: int) -> Figure:
    """One held-out log: measured channels, and those predicted before and after the fit, mm."""
    held = result.held_out[number]
    rec = held.after.record
    count = len(rec.channels)
    columns = 3 if count % 3 == 0 else 2
    rows = -(-count // columns)
    with figure_of_size(3.0 * columns, 1.5 * rows + 0.6) as figure:
        grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
        for place, channel in enumerate(rec.channels):
            axes = grid[place // columns][place % columns]
            draw(axes, rec.time, _MM * np.where(rec.usable[:, place], rec.measured[:, place], np.nan),
                 **line_options(SOLID, COLORS[0]), label="measured")  # fmt: skip
            for prediction, color, label in ((held.before, COLORS[2], "before"), (held.after, COLORS[1], "after")):
                if prediction.failed is None:
                    draw(
                        axes, rec.time, _MM * prediction.predicted[:, place], **line_options(DASHED, color), label=label
                    )
            axes.set_title(f"{channel}: {_MM * held.after.rms[place]:.2g} mm")
            if place // columns == rows - 1:
                axes.set_xlabel("t [s]")
            if place % columns == 0:
                axes.set_ylabel("[mm]")
        grid[0][0].legend()
        figure.suptitle(f"{rec.name}, held out")
        return figure


def plot_correlation(result: Identification) -> Figure:
    """Correlation matrix of the estimates."""
    names = [e.name for e in result.estimates]
    size = 2.0 + 0.22 * len(names)
    with figure_of_size(size + 0.8, size) as figure:
        axes = figure.subplots()
        image = axes.imshow(result.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu_r")
        axes.set_xticks(range(len(names)), names, rotation=90)
        axes.set_yticks(range(len(names)), names)
        axes.grid(False)
        figure.colorbar(image, shrink=0.7, label="correlation")
        return figure


def plot_stiffness(fit: StiffnessFit) -> Figure:
    """A law fitted to steady states: spring force over elongation (Fig. 8) or bending moment over angle (Fig. 9)."""
    longitudinal = fit.law == "longitudinal"
    with figure_of_size(3.6, 2.8) as figure:
        axes = figure.subplots()
        low, high = float(fit.abscissa.min()), float(fit.abscissa.max())
        line = np.linspace(low - 0.05 * (high - low), high + 0.05 * (high - low), 200)
        scale = _MM if longitudinal else 180.0 / np.pi
        axes.plot(scale * fit.abscissa, fit.ordinate, "o", color=COLORS[0], markersize=3, label="steady states")
        axes.plot(scale * line, fit.curve(line), color=COLORS[1], label="fit")
        axes.set_xlabel("elongation [mm]" if longitudinal else "bending angle [degrees], negative for phi = pi")
        axes.set_ylabel("spring force of one bellows [N]" if longitudinal else "bending moment [N m]")
        axes.set_title(f"section {fit.section}: {', '.join(spoken(p) for p in fit.paths)}")
        axes.legend()
        return figure


def plot_oscillation(swing: Oscillation) -> Figure:
    """A free swing and the decaying oscillation fitted to it (Fig. 10)."""
    with figure_of_size(4.2, 2.4) as figure:
        axes = figure.subplots()
        draw(axes, swing.time, _MM * swing.measured, **line_options(SOLID, COLORS[0]), label="measured")
        draw(axes, swing.time, _MM * swing.fitted, **line_options(DASHED, COLORS[1]), label="fit")
        axes.set_xlabel("t [s]")
        axes.set_ylabel(f"{swing.channel} [mm]")
        axes.set_title(f"{swing.frequency:.3g} Hz, damping ratio {100 * swing.damping_ratio:.2g} %")
        axes.legend()
        return figure
