"""Pictures of an identification: held-out logs, correlations. Those of section IV: ``bha.plot.section_four``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bha.plot.style import COLORS, DASHED, SOLID, draw, figure_of_size, line_options

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bha.identification.result import Identification

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
