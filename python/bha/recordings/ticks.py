"""Sensors that renew by a clock of their own, more slowly than the log: which rows hold a reading of theirs.

A camera of 30 Hz in a log of 200 Hz changes its value every 6 or 7 rows, or every 13, 14, 20 of them where the reading
before came out the same: on a coarse grid most do. The waits between changes are then multiples of one period to within
a row at either end, none is shorter, and some changes are of more than one step of the grid. Chance does not make that:
noise on a coarse grid changes from one row to the next as often as not, and what moves slowly over it goes one step at
a time.
Limits: periods of at least three rows; rows that are even to a fifth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

#: Least period in rows, and longest, s.
LEAST_ROWS, LONGEST = 3.0, 0.25
#: Fewest changes, fewest of them by more than a step and a half, and share of the waits that may be no multiple.
FEWEST, FEWEST_LARGE, STRAYS = 40, 10, 0.02
#: Chance at most that waits of any length come out so, over all of a log.
CHANCE = 1e-9


def ticks(time: Array, fresh: Rows, values: Array, step: float) -> Rows | None:
    """Rows with a reading of a sensor that renews more slowly than the log; None where it is not told that it does.

    Args:
        time: of the rows, s, shape (m,), ascending.
        fresh: rows in which the value changes, the first one too.
        values: shape (m,).
        step: of the grid on which values lie, 0 if none is known.
    """
    if len(fresh) < FEWEST or step <= 0.0:
        return None
    apart = np.diff(time)
    row = float(np.median(apart))
    if np.mean(np.abs(apart - row) > 0.2 * row) > STRAYS:
        return None
    waits = np.diff(time[fresh])
    period = _period(waits, row)
    if period is None or np.sum(np.abs(np.diff(values[fresh])) > 1.5 * step) < FEWEST_LARGE:
        return None
    return _between(time, fresh, period, row)


def _period(waits: Array, row: float) -> float | None:
    """The period of which all waits are multiples, s, from the shortest ones on; None where they are not."""
    shortest = float(np.quantile(waits, STRAYS))
    if not (LEAST_ROWS - 0.5) * row < shortest <= LONGEST:
        return None
    reach = 1.5 * shortest
    period = float(np.mean(waits[waits < reach]))
    while True:
        near = waits[waits < reach]
        period = float(np.sum(near) / np.sum(np.maximum(np.round(near / period), 1.0)))
        if reach > np.max(waits) or reach > 100.0 * period:
            break
        reach *= 2.0
    if period < LEAST_ROWS * row:
        return None
    missed = np.abs(waits - period * np.maximum(np.round(waits / period), 1.0))
    # Both ends fall on rows.
    odd = int(np.sum(missed > 1.01 * row))
    if odd > STRAYS * len(waits):
        return None
    by_chance = min(2.0 * 1.01 * row / period, 1.0)
    return period if by_chance ** (len(waits) - odd) < CHANCE else None


def _between(time: Array, fresh: Rows, period: float, row: float) -> Rows:
    """The changes, and between them the rows in which the same reading came again."""
    ends = np.append(time[fresh[1:]], time[-1] + row)
    rows = [fresh]
    for begin, end in zip(time[fresh], ends, strict=True):
        again = begin + period * np.arange(1, max(round((end - begin) / period), 1))
        rows.append(np.searchsorted(time, again - 0.5 * row))
    return np.unique(np.concatenate(rows))
