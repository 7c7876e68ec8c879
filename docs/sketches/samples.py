"""What may be the matter with samples of a log, and which of them count."""

from __future__ import annotations

import numpy as np

from bha.plot import write_figure
from bha.plot.style import COLORS, figure_of_size

TIME = np.arange(24.0)
TRUE = 0.5 + 0.35 * np.sin(0.27 * TIME)
NOISE = np.random.default_rng(3).normal(scale=0.012, size=24)
GREY = "#B0B0B0"


def held(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.repeat(values[::4], 4), TIME % 4 == 0


def filled(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.interp(TIME, TIME[::6], values[::6]), TIME % 6 == 0


def dropout(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    lost = (TIME > 8) & (TIME < 17)
    return np.where(lost, values[8], values), ~lost


def spike(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    at = TIME == 13
    return np.where(at, values + 0.55, values), ~at


def missing(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    gone = (TIME == 5) | (TIME == 6) | (TIME == 15)
    return np.where(gone, np.nan, values), ~gone


def step(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.round(values / 0.12) * 0.12, np.ones(24, dtype=bool)


PANELS = {
    "held: a slow sensor": held,
    "filled in: resampled": filled,
    "dropout": dropout,
    "spike": spike,
    "missing": missing,
    "step: a coarse grid": step,
}

with figure_of_size(5.4, 3.4) as figure:
    panels = figure.subplots(2, 3, sharex=True, sharey=True)
    for axes, (title, fault) in zip(panels.flat, PANELS.items(), strict=True):
        values, counts = fault(TRUE + NOISE)
        axes.plot(TIME, TRUE, color=GREY, linewidth=1.2)
        axes.plot(TIME[~counts], values[~counts], "x", color=COLORS[4], markersize=4.5)
        axes.plot(TIME[counts], values[counts], "o", color=COLORS[1], markersize=3.5)
        axes.set_title(title, fontsize=9)
        axes.tick_params(labelleft=False, labelbottom=False)
        axes.set_ylim(0, 1.2)
    write_figure(figure, "samples.svg")
