"""The times of a run's rows, and whether there is room for so many."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.arrays import floats
from bha.errors import InputError
from bha.runs.input import Input

#: Longest distance of the rows that a simulation writes unasked, s: what shows the motion between sparse samples.
ROW_DISTANCE = 0.01


def output_times(
    drive: Input, dt: float | None, t_end: float | None = None, *, row_bytes: int = 8
) -> NDArray[np.float64]:
    """Times of the output rows, from the first sample to ``t_end`` (the last).

    Every ``dt`` s; if None at the samples, with as many rows between two that are far apart as make it 100 Hz.

    Args:
        drive: the input.
        dt: distance of the rows, s, or None.
        t_end: end, s, or None.
        row_bytes: memory that a row will take.

    Raises:
        InputError: ``dt`` or ``t_end`` is not allowed, or the rows would not fit into memory.
    """
    time = floats(drive.time, "time", (None,))
    if len(time) == 0:
        raise InputError("the input has no samples; at least one is needed")
    if not np.isfinite(time).all():
        raise InputError("the input's times are not all finite numbers")
    start, end = float(time[0]), float(time[-1] if t_end is None else t_end)
    if not np.isfinite(end):
        raise InputError(f"t_end: {end}; a finite time is needed")
    if end < start:
        raise InputError(f"t_end: {end} s lies before the first sample at {start} s")
    if dt is None:
        kept = time[time <= end]
        kept = kept[np.concatenate([[True], np.diff(kept) != 0.0])]
        kept = kept if kept[-1] == end else np.append(kept, end)
        gaps = np.maximum(np.diff(kept), 0.0)
        pieces = np.maximum(np.ceil(gaps / ROW_DISTANCE * (1.0 - 1e-6)), 1.0)
        check_room(
            float(pieces.sum()) + 1.0,
            row_bytes,
            "rows at 100 Hz; is the time in another unit than seconds? Else give dt or times.",
        )
        return _divided(kept, pieces.astype(np.int64))
    if not np.isfinite(dt) or dt <= 0:
        raise InputError(f"dt: {dt}; a positive number of seconds is needed")
    rows = (end - start) / dt + 1.0
    check_room(rows, row_bytes, f"rows by dt = {dt:g} s; a longer one is needed.")
    return np.asarray(start + dt * np.arange(int(np.floor(rows + 1e-9))), dtype=np.float64)


def _divided(time: NDArray[np.float64], pieces: NDArray[np.int64]) -> NDArray[np.float64]:
    """``time`` with the way from each to the next one in so many equal ``pieces``."""
    if len(time) == 1 or pieces.max() == 1:
        return time
    first = np.repeat(np.arange(len(pieces)), pieces)
    within = np.arange(len(first)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    rows = time[first] + (time[first + 1] - time[first]) * (within / pieces[first])
    return np.append(rows, time[-1])


def given_times(times: ArrayLike) -> NDArray[np.float64]:
    """Times of rows that a caller gave, s, shape (rows,), ascending.

    Raises:
        InputError: another shape, no row, a time that is not finite, times that do not ascend.
    """
    try:
        rows = np.array(times, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"times: numbers of seconds are needed; {error}") from None
    if rows.ndim != 1 or len(rows) == 0:
        raise InputError(f"times: shape {rows.shape}; one row at least and one dimension are needed")
    if not np.isfinite(rows).all():
        raise InputError(f"times: element {int(np.argmin(np.isfinite(rows)))} is not a finite number")
    if (np.diff(rows) < 0).any():
        k = int(np.argmax(np.diff(rows) < 0)) + 1
        raise InputError(f"times: they must ascend; element {k} is {rows[k]} s after {rows[k - 1]} s")
    return rows


def check_room(count: float, size: int, what: str) -> None:
    """Refuse ``count`` pieces of ``size`` bytes that would fill more than half of this computer's memory.

    Raises:
        InputError: there are more of them than fit.
    """
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # a system that does not say
        memory = 8 << 30
    most = memory // 2 // size
    if not count <= most:
        raise InputError(f"{count:.3g} {what} At most {most:.3g} of them fit into half of this computer's memory")
