"""Records on a coarse even grid, and what lags: a slow arm stands, for the most part, where its pressures hold it.

What: cell means of pressures and channels on an even grid; the response of a first-order lag on that grid. A lag of the
pressures and an overdamped arm both let a channel follow its resting value x as tau y' = x - y; the means of a cell
pass through the same lag as what they are means of.
Between points of the grid x is a straight line, for which the response is exact:

    y_{k+1} = a y_k + (1 - a) x_k + (1 - (1 - a) tau / h) (x_{k+1} - x_k),    a = exp(-h / tau).

Limits: the lag begins in equilibrium with the first value; an arm that swings is not followed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.estimation.records import Record
from bha.recordings import Output

Array = NDArray[np.float64]

#: A lag shorter than this part of the grid's step shows nothing on it.
_SHORTEST_LAG = 1e-3
#: What is left of a value that is lost in rounding.
_NEGLIGIBLE = 1e-18


@dataclass(frozen=True)
class SlowRecord:
    """Cell means of a record on an even grid of g points.

    Attributes:
        record: the record.
        outputs: the C channels compared: lengths and positions.
        step: of the grid, s.
        pressures: Pa, shape (g, inputs).
        forces: external forces, N, shape (g, n, 3), or None.
        measured: channels, shape (g, C); NaN where no row counts.
    """

    record: Record
    outputs: tuple[Output, ...]
    step: float
    pressures: Array
    forces: Array | None
    measured: Array


def slow_record(rec: Record, step: float) -> SlowRecord:
    """The cell means of a record's lengths and positions on a grid of about ``step`` s."""
    kept = [k for k, output in enumerate(rec.observation.outputs) if output.kind != "orientation"]
    count = max(2, round(rec.duration / step))
    width = rec.duration / count
    measured = cell_means(rec.time, np.where(rec.usable, rec.measured, np.nan)[:, kept], width, count)
    drive = rec.drive
    # Inputs may be sampled less densely than the grid: they are read at points within the cells.
    inside = rec.time[0] + width * (np.arange(4 * count) + 0.5) / 4.0
    pressures = _read(drive.time, drive.pressures, inside, held=drive.interpolation == "hold")
    forces = None
    if drive.forces is not None:
        flat = drive.forces.reshape(len(drive.time), -1)
        forces = _read(drive.time, flat, inside).reshape(count, 4, -1, 3).mean(axis=1)
    outputs = tuple(rec.observation.outputs[k] for k in kept)
    return SlowRecord(rec, outputs, width, pressures.reshape(count, 4, -1).mean(axis=1), forces, measured)


def lag_response(lag: float, step: float, values: Array) -> Array:
    """What follows ``values`` (g, ...) on an even grid through a first-order lag, s; at rest at the first of them."""
    if lag <= _SHORTEST_LAG * step:
        return values
    a = math.exp(-step / lag)
    rising = 1.0 - (1.0 - a) * lag / step
    change = (1.0 - a) * (values[:-1] - values[0]) + rising * np.diff(values, axis=0)
    # Sums over ever longer stretches: each pass doubles how far back a row has looked.
    reach, kept = 1, a
    while reach < len(change) and kept > _NEGLIGIBLE:
        change[reach:] += kept * change[:-reach]
        reach, kept = 2 * reach, kept * kept
    return np.concatenate([values[:1], values[0] + change])


def cell_means(time: Array, table: Array, width: float, count: int) -> Array:
    """Means of the rows of each cell, channel by channel; NaN for none."""
    cell = np.minimum(((time - time[0]) / width).astype(np.int64), count - 1)
    found = np.full((count, table.shape[1]), np.nan)
    for c, column in enumerate(table.T):
        good = np.isfinite(column)
        number = np.bincount(cell[good], minlength=count)
        total = np.bincount(cell[good], weights=column[good], minlength=count)
        np.divide(total, number, out=found[:, c], where=number > 0)
    return found


def _read(time: Array, table: Array, at: Array, *, held: bool = False) -> Array:
    """Samples read at times, straight between them or held."""
    if held:
        return np.asarray(table[np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)])
    return np.column_stack([np.interp(at, time, column) for column in table.T])
