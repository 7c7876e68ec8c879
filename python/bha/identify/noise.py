"""Sensor noise of a channel from the channel itself, whatever the arm does.

Third differences of a signal sampled well above its bandwidth hold next to nothing of the motion and all of the white
noise: y_k - 3 y_(k-1) + 3 y_(k-2) - y_(k-3) has variance 20 sigma^2. The median of squares is used, so that jumps of a
stepped signal do not count. Sensors that hold their last value between renewals are thinned to the renewals first.

Limits: white noise and, where samples are irregular, a signal that is nearly linear over four samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Median of a squared standard normal variable.
_MEDIAN_CHI2 = 0.454936
_MIN_SAMPLES = 8


def noise_deviation(values: Array) -> float:
    """Standard deviation of the white noise in one channel, shape (m,); NaN where it cannot be told.

    A quantised channel that mostly stands still gets at least the deviation of its quantisation, step / sqrt(12).
    """
    values = values[np.isfinite(values)]
    step = resolution(values)
    floor = step / np.sqrt(12.0)
    renewed = values if len(values) < 2 else values[np.concatenate([[True], np.diff(values) != 0.0])]
    # A channel that holds its value over most samples is renewed at the changes; one that is quantised is not.
    held = len(renewed) < 0.7 * len(values) and step < 1e-3 * (np.ptp(values) or 1.0)
    used = renewed if held else values
    if len(used) < _MIN_SAMPLES:
        return float("nan") if floor == 0.0 else float(floor)
    third = np.diff(used, n=3)
    estimate = np.sqrt(np.median(third**2) / _MEDIAN_CHI2 / 20.0)
    return float(max(estimate, floor))


def resolution(values: Array) -> float:
    """Smallest step between two different values of a channel, 0 if it never changes."""
    distinct = np.unique(values)
    if len(distinct) < 2:
        return 0.0
    gaps = np.diff(distinct)
    # Steps below rounding of the file's digits are not steps.
    gaps = gaps[gaps > 1e-9 * max(abs(distinct[0]), abs(distinct[-1]), 1e-12)]
    return float(gaps.min()) if len(gaps) else 0.0


def noise_deviations(table: Array) -> Array:
    """:func:`noise_deviation` of every column, shape (columns,)."""
    return np.array([noise_deviation(column) for column in table.T])
