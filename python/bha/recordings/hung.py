"""Outputs that hang at the end of a log, while pressures that have moved the arm all along go on.

What hangs within a log comes back with a jump (:mod:`bha.recordings.together`); at its end there is none. The pressures
tell: for as long as the outputs stand, each other stretch of the log in which a pressure went as far has moved them.
Limits: an arm that rests against a stop at the very end of its log, and nowhere else, passes for one that hangs.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from bha.recordings.samples import Span

Array = NDArray[np.float64]

#: How long pressures must be otherwise than where the standstill begins, s: any arm has set out by then
#: (:mod:`bha.recordings.frozen`).
SHORTEST = 0.5
#: How many other stretches must have moved the arm, one of them by the same pressure, each with this share of the push.
_FEWEST, _SHARE = 4, 0.5
#: Stretches begin this many times in one; those that overlap count once.
_SHIFTS = 8


def hangs_from(
    time: Array, outputs: Array, pressures: Array, least: Array, stopped: Collection[Span] = ()
) -> int | None:
    """The first row of the standstill that ends the log, if it is a sensor's and not the arm's.

    Args:
        time: of the rows, s, shape (m,).
        outputs: all measured ones, shape (m, C); NaN where nothing was read.
        pressures: of all inputs, Pa, shape (m, inputs).
        least: what a change of each pressure must be to be one, Pa, shape (inputs,).
        stopped: spans in which outputs are known to hang, s: they tell nothing of the arm.
    """
    changed = np.flatnonzero(np.any(np.diff(outputs, axis=0) != 0.0, axis=1))
    if not len(changed):
        return None
    first = int(changed[-1]) + 1
    away = np.flatnonzero(np.any(np.abs(pressures[first:] - pressures[first]) > least, axis=1))
    if not len(away) or not np.all(np.isfinite(outputs[first])):
        return None
    # The rest before that may be the arm's.
    pushed_from = first + max(int(away[0]) - 1, 0)
    length = float(time[-1] - time[pushed_from])
    if length < SHORTEST:
        return None
    pushed = _push(time, pressures, least, pushed_from, len(time))
    far = _SHARE * float(np.max(pushed))
    strongest = pushed >= far
    moved, by_the_same, free = 0, False, float(time[0])
    for start in np.arange(time[0], time[first] - length, length / _SHIFTS):
        begin, end = np.searchsorted(time, [start, start + length])
        if any(a < time[end - 1] and time[begin] < b for a, b in stopped):
            continue
        as_far = _push(time, pressures, least, begin, end) >= far
        if not np.any(as_far):
            continue
        if not np.any(np.diff(outputs[begin:end], axis=0) != 0.0):
            return None
        by_the_same |= bool(np.any(as_far & strongest))
        if start >= free:
            moved, free = moved + 1, start + length
    return first if moved >= _FEWEST and by_the_same else None


def _push(time: Array, pressures: Array, least: Array, first: int, last: int) -> Array:
    """For how long each pressure was how far from where a stretch of rows begins, Pa s, shape (inputs,)."""
    away = np.maximum(np.abs(pressures[first:last] - pressures[first]) - least, 0.0)
    return np.asarray(np.trapezoid(away, time[first:last], axis=0))
