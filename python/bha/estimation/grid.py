"""Simulation on an even grid of the integrator's own steps, and rows of a log interpolated from it.

Steps of an integrator end on every output. Outputs at the rows of a log would make the step as short as the sampling
interval, and windows with irregular rows could not share the lanes of a batch. Each window is therefore simulated at
multiples of the step after its start, and its rows are read off by polynomials of degree 5 through six grid points
around each (exact on the grid, error about h^6 / 200 of the sixth derivative; choosing the step accounts for it). Where
all rows are such multiples, these alone are put out; where rows are far apart, the points around them alone.

A step looks at the pressures at its ends and its middle only. Where a log has more samples than that, pressures are
averaged over half a step first: left alone, every sample between would be lost and the noise of the others would count
in full.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.runs.input import Input

Array = NDArray[np.float64]

_POINTS = 6
#: Rows this near to a point of the grid are on it, in steps.
_ON_GRID = 1e-6
#: Means that differ from a sample by this part are it.
_HELD = 1e-9
#: Share of the points up to which those that no row needs are left out: windows with the same points share lanes.
_FEW = 0.5
#: Parts of the first step that a graded start begins with.
_PARTS = 2.0 ** -np.arange(6.0, -1.0, -1.0)


@dataclass(frozen=True)
class Grid:
    """Those of even times from which some rows follow.

    Attributes:
        start: where the grid begins, s.
        time: of its points that are put out, s, shape (g,).
        first: the first of the six points of each row, shape (rows,); the row's own where ``weights`` is None.
        weights: of those points, shape (rows, 6); None where every row is a point.
    """

    start: float
    time: Array
    first: NDArray[np.int64]
    weights: Array | None

    def at_rows(self, table: Array) -> Array:
        """Values at the rows out of values on the grid, shape (..., g, C) to (..., rows, C)."""
        if self.weights is None:
            return np.asarray(table[..., self.first, :])
        total = np.zeros((*table.shape[:-2], len(self.first), table.shape[-1]))
        for k in range(_POINTS):
            total += self.weights[:, k, None] * table[..., self.first + k, :]
        return total


def grid_of(rows: Array, step: float, *, start: float | None = None) -> Grid:
    """The grid with a step, s, from ``start`` (the first of some rows) to the last; rows are ascending times, s."""
    begin = float(rows[0]) if start is None else start
    place = (rows - begin) / step
    whole = np.round(place)
    if np.all(np.abs(place - whole) < _ON_GRID) and np.all(np.diff(whole) > 0.0):
        return Grid(begin, begin + step * whole, np.arange(len(rows)), None)
    count = max(int(np.ceil(place[-1] - 1e-9)) + 1, _POINTS)
    first = np.clip(np.floor(place).astype(np.int64) - _POINTS // 2 + 1, 0, count - _POINTS)
    local = place - first
    nodes = np.arange(_POINTS, dtype=np.float64)
    weights = np.ones((len(rows), _POINTS))
    for k in range(_POINTS):
        for other in range(_POINTS):
            if other != k:
                weights[:, k] *= (local - nodes[other]) / (nodes[k] - nodes[other])
    used = np.unique(first[:, None] + np.arange(_POINTS))
    if len(used) > _FEW * count:
        used = np.arange(count)
    time = np.asarray(begin + step * used, dtype=np.float64)
    # Six points that follow each other are all among those that are used.
    return Grid(begin, time, np.searchsorted(used, first), weights)


def graded(grid: Grid, step: float) -> tuple[Array, NDArray[np.intp]]:
    """Times of a grid with ever longer parts of its first step, s, and where the grid's own are among them.

    Free rates at the start of a stiff arm die away within a part of a step, and leave it where they have brought it.
    Long steps of an implicit method bring it elsewhere, and what follows is off for as long as the arm is slow.
    """
    time = np.union1d(grid.time, grid.start + step * _PARTS)
    # Times that differ by rounding are one.
    time = time[np.append(True, np.diff(time) > _ON_GRID * step)]
    return time, np.searchsorted(time, grid.time - _ON_GRID * step)


def averaged(drive: Input, step: float) -> Input:
    """The input with pressures and forces averaged over half a step, where its samples lie closer together."""
    time = np.asarray(drive.time, dtype=np.float64)
    half = 0.5 * step
    if len(time) < 2 or np.median(np.diff(time)) > 0.75 * half:
        return drive
    even = time[0] + half * np.arange(int(np.floor((time[-1] - time[0]) / half)) + 1)
    even = np.append(even, time[-1]) if even[-1] < time[-1] else even
    forces = None
    if drive.force_rows is not None:
        forces = _means(time, drive.force_rows, even, half).reshape(len(even), -1, 3)
    means = _means(time, drive.pressures, even, half)
    # What is held stays the same number: where numbers differ by rounding an input bends, and steps end.
    held = drive.pressures[np.clip(np.searchsorted(time, even, side="right") - 1, 0, len(time) - 1)]
    pressures = np.where(np.abs(means - held) <= _HELD * np.abs(held), held, means)
    return replace(drive, time=even, pressures=pressures, forces=forces)


def _means(time: Array, table: Array, centers: Array, width: float) -> Array:
    """Means of polygons through samples over ``width`` about each center, cut at the ends."""
    slopes = np.diff(table, axis=0) * 0.5
    steps = np.diff(time)[:, None]
    integral = np.vstack([np.zeros((1, table.shape[1])), np.cumsum((table[:-1] + slopes) * steps, axis=0)])

    def until(t: Array) -> Array:
        k = np.clip(np.searchsorted(time, t, side="right") - 1, 0, len(time) - 2)
        gap = time[k + 1] - time[k]
        share = np.divide(t - time[k], gap, out=np.zeros_like(t), where=gap > 0)[:, None]
        rise = table[k + 1] - table[k]
        return np.asarray(integral[k] + (t - time[k])[:, None] * (table[k] + 0.5 * share * rise))

    low, high = (np.clip(centers + d, time[0], time[-1]) for d in (-0.5 * width, 0.5 * width))
    return np.asarray((until(high) - until(low)) / (high - low)[:, None])
