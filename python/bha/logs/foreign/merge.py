"""One table of series that have clocks or rates of their own; nothing is resampled.

There is a row for each moment at which anything was measured. What drives the arm must be known there: a command holds
its last value; measured pressures and forces lie on the straight line between their samples, as all readers of a log
take them anyway. Everything else has a gap, NaN, unless it was measured just then.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.errors import LogError
from bha.logs.foreign.series import Array, Said, Series
from bha.logs.headings import named

_HELD, _BETWEEN = ("commanded_pressure",), ("pressure", "force")


def is_drive(heading: str) -> bool:
    """Whether a column drives the arm, so that it must be known in every row."""
    return _kind(heading) in (*_HELD, *_BETWEEN)


def _kind(heading: str) -> str | None:
    quantity = names.quantity(named(heading)[0])
    return None if quantity is None else quantity.kind


def merged(origin: str, series: Sequence[Series], said: Said) -> tuple[dict[str, Array], bool]:
    """The table of some series by heading, the time first, and whether it has gaps that the series do not have.

    Whole nanoseconds count from the first row on.

    Raises:
        LogError: no moment at which all pressures are known.
    """
    series = _together(series)
    if len(series) == 1:
        (only,) = series
        return {names.column(names.TIME, "s"): _seconds(only.time, said), **only.columns}, False
    time, places = _union([s.time for s in series])
    first, last = _known(origin, series, time, said)
    kept = slice(int(np.searchsorted(time, first, "left")), int(np.searchsorted(time, last, "right")))
    rows = np.arange(len(time))[kept]
    columns: dict[str, Array] = {}
    gaps = False
    for one, place in zip(series, places, strict=True):
        at_row = np.full(len(time), -1)
        at_row[place] = np.arange(len(place))
        held = np.maximum.accumulate(at_row)[kept]
        exact = at_row[kept]
        for heading, values in one.columns.items():
            kind = _kind(heading)
            if kind in _HELD:
                columns[heading] = values[held]
            elif kind in _BETWEEN:
                columns[heading] = np.interp(time[kept] - time[0], one.time - time[0], values)
            else:
                columns[heading] = np.where(exact >= 0, values[exact], np.nan)
                gaps |= bool((exact < 0).any())
    rates = ", ".join(f"{one.source} ({len(one.time)})" for one in series[:6])
    text = f"{len(series)} series with times of their own became {len(rows)} rows: {rates}"
    for kinds, how in ((_BETWEEN, "lie on straight lines between their samples"), (_HELD, "hold their last values")):
        listed = [named(h)[0] for one in series for h in one.columns if _kind(h) in kinds]
        if listed:
            text += f"; {', '.join(listed[:6])}{' ...' if len(listed) > 6 else ''} {how}"
    said.notes.append(text + ("; everything else has gaps where it was not measured" if gaps else ""))
    ordered = {h: columns[h] for one in series for h in one.columns}
    return {names.column(names.TIME, "s"): _seconds(time[kept], said), **ordered}, gaps


def _together(series: Sequence[Series]) -> list[Series]:
    """Series with the very same times become one."""
    found: list[Series] = []
    for one in series:
        for place, other in enumerate(found):
            if np.array_equal(one.time, other.time):
                found[place] = Series(f"{other.source}, {one.source}", other.time, {**other.columns, **one.columns})
                break
        else:
            found.append(one)
    return found


def _seconds(time: NDArray[Any], said: Said) -> Array:
    if time.dtype.kind != "i":
        return np.asarray(time, dtype=np.float64)
    start = datetime.fromtimestamp(int(time[0]) // 1_000_000_000, UTC)
    said.notes.append(f"t = 0 is {start:%Y-%m-%d %H:%M:%S}.{int(time[0]) % 1_000_000_000:09d} UTC, {int(time[0])} ns")
    return np.asarray((time - time[0]) / 1e9)


def _union(times: Sequence[NDArray[Any]]) -> tuple[NDArray[Any], list[NDArray[np.intp]]]:
    """All times in order, and where those of each series are among them; what repeats in a series repeats there."""
    counted = [np.arange(len(t)) - np.searchsorted(t, t, "left") for t in times]
    everything = np.concatenate(times)
    repeats = np.concatenate(counted)
    order = np.lexsort((repeats, everything))
    fresh = np.ones(len(order), dtype=bool)
    ordered_time, ordered_repeat = everything[order], repeats[order]
    fresh[1:] = (ordered_time[1:] != ordered_time[:-1]) | (ordered_repeat[1:] != ordered_repeat[:-1])
    row_of = np.empty(len(order), dtype=np.intp)
    row_of[order] = np.cumsum(fresh) - 1
    bounds = np.cumsum([0, *map(len, times)])
    return ordered_time[fresh], [row_of[a:b] for a, b in pairwise(bounds)]


def _known(origin: str, series: Sequence[Series], time: NDArray[Any], said: Said) -> tuple[Any, Any]:
    """First and last moment at which all that is held is known.

    A command holds until the next one; nothing is known of a pressure after its last measurement.
    """
    drives = [one for one in series if any(map(is_drive, one.columns))]
    if not drives:
        return time[0], time[-1]
    first = max(one.time[0] for one in drives)
    read = [one.time[-1] for one in drives if any(_kind(heading) in _BETWEEN for heading in one.columns)]
    last = min([*read, time[-1]])
    if first > last:
        raise LogError(
            f"{origin}: {' and '.join(one.source for one in drives)} were never measured together; were their clocks "
            "set alike?"
        )
    before, after = int((time < first).sum()), int((time > last).sum())
    if before or after:
        said.notes.append(
            f"{before} rows before and {after} after the time in which all pressures and forces are known were left out"
        )
    return first, last
