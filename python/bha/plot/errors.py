"""What is left between simulated and measured head positions, per head and axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.errors import InputError
from bha.plot.settings import GRID
from bha.plot.style import (
    COLORS,
    MILLIMETRES_PER_METRE,
    SOLID,
    draw,
    figure_of_size,
    line_options,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_errors(
    time: ArrayLike,
    errors: Mapping[str, ArrayLike],
    *,
    repeatability: float | None = None,
    title: str | None = None,
) -> Figure:
    """Plot position errors against time, a row of panels for each head and one panel for each axis, mm.

    Each panel says the root mean square of each line. Values that are NaN (no measurement there) are gaps.

    Args:
        time: s, shape (m,).
        errors: label to simulated minus measured head positions in the world, m, shape (m, n, 3).
        repeatability: how well the arm repeats itself, m; a grey band between minus and plus this value.
        title: a line above the figure.

    Raises:
        InputError: no errors given, or shapes that do not fit together.
        MissingExtraError: matplotlib is not installed.
    """
    moments = np.asarray(time, dtype=np.float64)
    if not errors:
        raise InputError("errors: nothing to plot; give at least one array, as {label: errors}")
    arrays = {label: _checked(label, array, moments) for label, array in errors.items()}
    heads = next(iter(arrays.values())).shape[1]
    if any(array.shape[1] != heads for array in arrays.values()):
        raise InputError(f"errors: different numbers of heads, {[array.shape[1] for array in arrays.values()]}")

    with figure_of_size(7.2, 1.2 + 1.7 * heads) as figure:
        grid = figure.subplots(heads, 3, sharex=True, sharey="row", squeeze=False)
        for head, row in enumerate(grid):
            for axis, axes in enumerate(row):
                if repeatability is not None:
                    band = repeatability * MILLIMETRES_PER_METRE
                    axes.axhspan(-band, band, color=GRID, linewidth=0, label=f"repeatability, ±{band:.3g} mm")
                summary = []
                for (label, array), color in zip(arrays.items(), _colors(len(arrays)), strict=True):
                    values = array[:, head, axis]
                    draw(axes, moments, values, label=label, **line_options(SOLID, color, alone=True))
                    summary.append(f"{_root_mean_square(values):.3g}")
                axes.set_title(f"Head {head + 1}, {'xyz'[axis]}: RMS {' / '.join(summary)} mm", loc="left")
                axes.set_xlim(moments[0], moments[-1])
            row[0].set_ylabel("Error [mm]")
        for axes in grid[-1]:
            axes.set_xlabel("Time [s]")
        handles, _ = grid[0, 0].get_legend_handles_labels()
        if len(handles) > 1 or title is not None:
            figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), title=title, alignment="left")
    return figure


def _checked(label: str, array: ArrayLike, time: NDArray[np.float64]) -> NDArray[np.float64]:
    values = np.asarray(array, dtype=np.float64)
    if time.ndim != 1 or len(time) == 0:
        raise InputError(f"time: expected shape (m,) with m >= 1, found {time.shape}")
    if values.ndim != 3 or values.shape[0] != len(time) or values.shape[1] == 0 or values.shape[2] != 3:
        raise InputError(f"errors of {label!r}: expected shape ({len(time)}, heads, 3), found {values.shape}")
    return values * MILLIMETRES_PER_METRE


def _root_mean_square(values: NDArray[np.float64]) -> float:
    there = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(there**2))) if len(there) else float("nan")


def _colors(count: int) -> list[str]:
    return [COLORS[index % len(COLORS)] for index in range(count)]
