"""Measured pressures that stand still although the arm shows that they do not.

A pressure that stands exactly still for seconds may be a steady one on a coarse grid, or a logger that has stopped. The
arm tells: under steady pressures its motion dies out, or creeps ever more slowly; where it sets out anew, some pressure
has changed that the log does not show. Commands stand still as long as they like and are never frozen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha.recordings.samples import Span, standstills

Array = NDArray[np.float64]

#: Shortest standstill that is looked at, s.
SHORTEST = 1.0
#: Over which speeds are taken, s, and how long after the last change the arm may still set out, s.
_WINDOW, _RESPONSE = 0.5, 0.5
#: A new motion is this many times as fast as what came before it, and travels this share of all that the arm does.
_FASTER, _TRAVEL = 1.5, 0.05
#: How many noises a motion must travel to be one.
_NOISES = 8.0


def frozen_spans(time: Array, pressures: Array, output_time: Array, outputs: Array, noise: Array) -> tuple[Span, ...]:
    """Spans, s, in which no pressure changes and the arm sets out anew.

    Args:
        time: of the pressures, s, shape (m,).
        pressures: all measured inputs, Pa, shape (m, inputs).
        output_time: of the outputs, s, shape (k,).
        outputs: what was measured of the arm, shape (k, C); NaN where nothing counts.
        noise: of each output, shape (C,).
    """
    known = np.any(np.isfinite(outputs), axis=0)
    outputs, noise = outputs[:, known], noise[known]
    if not outputs.size:
        return ()
    travel = np.nanquantile(outputs, 0.98, axis=0) - np.nanquantile(outputs, 0.02, axis=0)
    least = np.maximum(_TRAVEL * float(np.nanmax(travel)), _NOISES * noise)
    found = []
    for first, last in standstills(time, pressures, SHORTEST):
        inside = (output_time > time[first] + _RESPONSE) & (output_time <= time[last - 1])
        if _sets_out(output_time[inside], outputs[inside], least):
            found.append((float(time[first]), float(time[last - 1])))
    return tuple(found)


def _sets_out(time: Array, outputs: Array, least: Array) -> bool:
    """Whether some output travels further in a later window than in an earlier one, by more than a motion's least."""
    if len(time) < 4:
        return False
    count = int((time[-1] - time[0]) / _WINDOW)
    if count < 2:
        return False
    place = np.minimum(((time - time[0]) / _WINDOW).astype(np.intp), count - 1)
    spans = np.zeros((count, outputs.shape[1]))
    for k in range(count):
        part = outputs[place == k]
        if len(part) and np.any(np.isfinite(part)):
            low = np.min(np.where(np.isnan(part), np.inf, part), axis=0)
            high = np.max(np.where(np.isnan(part), -np.inf, part), axis=0)
            spans[k] = np.where(high >= low, high - low, 0.0)
    calmest = np.minimum.accumulate(spans, axis=0)[:-1]
    later = spans[1:]
    return bool(np.any((later > _FASTER * calmest + least) & (later > least)))
