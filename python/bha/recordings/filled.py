"""Channels whose rows somebody has filled in: readings of a slower sensor with straight lines between them.

A log that was resampled holds few readings and many rows that lie on chords: they are no measurements, have no noise,
and cut every corner of what moves between two readings. They are told by second differences, which are nothing but
rounding within a chord and the corner at a reading. Where readings fall between rows a corner spreads over two of them;
the row next to it then stands for the reading.
Limits: rows that are even; readings that come about evenly, at least every 0.25 s: ramps and holds of a pressure are
straight, too, but not again and again for the same short time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha.support.spans import spans_of

Array = NDArray[np.float64]

#: Fewest readings.
FEWEST = 40
#: Readings come every so many rows at least, no more seldom than this, s, and nine in ten within so many usual waits.
LEAST_ROWS, LONGEST, EVENLY = 3.0, 0.25, 1.6
#: Share of rows that lie on a chord that rises or falls.
SLOPING = 0.4
#: A corner stands out of rounding by this many times, which in numbers of this size is this share at least.
CORNER, ROUNDING = 2.5, 1e-9


def filled_in(time: Array, values: Array, step: float) -> NDArray[np.intp] | None:
    """Rows that hold readings, if those between them lie on straight lines; None where they do not.

    Args:
        time: of the rows, s, shape (m,), ascending.
        values: shape (m,).
        step: of the grid on which values lie, 0 if none is known.
    """
    apart = np.diff(time)
    usual = float(np.median(apart)) if len(apart) else 0.0
    if len(values) < LEAST_ROWS * FEWEST or np.min(apart) <= 0.0 or np.max(np.abs(apart - usual)) > 0.05 * usual:
        return None
    rounding = CORNER * max(step, _decimal(values), ROUNDING * float(np.max(np.abs(values))))
    slope = np.diff(values)
    bend = np.abs(np.diff(slope))
    corner = bend > rounding
    # Rounded numbers lie on no line to the last digit: corners must be far more than their rounding.
    if not corner.any() or float(np.median(bend[corner])) < 4.0 * rounding:
        return None
    if np.mean(~corner & (np.abs(slope[1:]) > rounding)) < SLOPING:
        return None
    # Of neighbouring corners the greatest is the reading.
    rows = np.array([a + np.argmax(bend[a:b]) for a, b in spans_of(corner)], dtype=np.intp)
    return rows + 1 if len(rows) >= FEWEST and _come_evenly(np.diff(rows), usual) else None


def _decimal(values: Array) -> float:
    """The power of ten to which values were rounded; 0 if to none above a billionth."""
    for power in range(1, 10):
        scaled = values * 10.0**power
        if np.max(np.abs(scaled - np.round(scaled))) < 1e-4:
            return float(10.0**-power)
    return 0.0


def _come_evenly(waits: NDArray[np.intp], apart: float) -> bool:
    """Whether readings that many rows apart, rows ``apart`` s apart, are those of a sensor."""
    usual = float(np.median(waits))
    even = float(np.quantile(waits, 0.9)) <= EVENLY * usual + 1.0
    return even and usual >= LEAST_ROWS and usual * apart <= LONGEST
