"""Outputs at common rows, where sensors that hold renew at different moments.

Four encoders that are read in turn renew at rows of their own: hardly any row holds a fresh reading of all. What needs
all outputs at once (a pose, a filter over rows) takes them at rows as far apart as the slowest sensor renews, each from
a curve through its own readings.
Limits: motion that is slow beside the slowest sensor's rate; a curve between readings averages their noise somewhat.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bha.recordings.clock import later
from bha.recordings.interpolation import akima
from bha.recordings.samples import ChannelFacts

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]

#: Share of readings that rows must hold on average to be common ones.
COMMON = 0.9
#: Between two readings further apart than this many usual intervals nothing was measured.
LONGEST_GAP = 1.6


def aligned(time: Array, measured: Array, usable: Mask, facts: Sequence[ChannelFacts]) -> tuple[Rows, Array, Mask]:
    """Rows (k,), outputs there (k, C), and which of them count; rows in which readings stand, where these are common.

    Args:
        time: of all rows, s, shape (m,).
        measured: outputs, shape (m, C).
        usable: which of them are readings, shape (m, C).
        facts: of the outputs.
    """
    forward = later(time)
    if not measured.shape[1]:
        rows = np.flatnonzero(forward)
        return rows, measured[rows], usable[rows]
    any_of_them = np.flatnonzero(np.any(usable, axis=1) & forward)
    filled = measured.copy()
    for column, good in zip(filled.T, usable.T, strict=True):
        if good.any() and not good.all():
            column[~good] = np.interp(time[~good], time[good], column[good])
    held = [k for k, fact in enumerate(facts) if fact.held > 0.0]
    if not held or not len(any_of_them) or float(np.mean(usable[any_of_them])) >= COMMON:
        return any_of_them, filled[any_of_them], usable[any_of_them]
    slowest = max(held, key=lambda k: facts[k].interval)
    rows = _as_often(time, np.flatnonzero(usable[:, slowest] & forward), facts[slowest].interval)
    good = np.zeros((len(rows), measured.shape[1]), dtype=np.bool_)
    values = filled[rows]
    for k, fact in enumerate(facts):
        own = np.flatnonzero(usable[:, k] & forward)
        if len(own) < 3:
            continue
        at = time[own]
        values[:, k] = np.where(usable[rows, k], measured[rows, k], akima(time[rows], at, measured[own, k]))
        after = np.clip(np.searchsorted(at, time[rows]), 1, len(own) - 1)
        inside = (time[rows] >= at[0]) & (time[rows] <= at[-1])
        good[:, k] = usable[rows, k] | (inside & (at[after] - at[after - 1] <= LONGEST_GAP * fact.interval))
    return rows, values, good


def _as_often(time: Array, readings: Rows, interval: float) -> Rows:
    """The rows of some readings, and as many where they leave gaps."""
    more = [readings]
    for k in np.flatnonzero(np.diff(time[readings]) > LONGEST_GAP * interval):
        inside = np.arange(time[readings[k]] + interval, time[readings[k + 1]] - 0.5 * interval, interval)
        more.append(np.searchsorted(time, inside))
    return np.unique(np.concatenate(more))
