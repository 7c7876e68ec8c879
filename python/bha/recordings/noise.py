"""Sensor noise and quantisation of a channel from the channel itself, whatever the arm does.

Source: third differences (the second-order difference estimator of Gasser, Sroka and Jennen-Steinmetz 1986 taken one
order higher): for white noise of variance s^2 the variance of ``y[k+3] - 3 y[k+2] + 3 y[k+1] - y[k]`` is 20 s^2, and a
motion that is smooth over four samples leaves nothing in it. Where rows are few a motion is not: differences of order n
have (2n over n) s^2 of the noise, and of a motion at a fraction f of the sampling rate (2 sin(pi f))^2n, which is less
the higher the order is (1 Hz at 10 rows a second: 0.05 of its amplitude at order three, 0.0006 at order seven).
Limits: sampling at some five times the fastest motion or more; noise that is white over eight samples.
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Order of the differences, and the higher ones that are looked at: they count where they find this much less.
ORDER, HIGHER_ORDERS, LESS = 3, (5, 7), 0.8
#: Median of the square of a standard normal variable.
MEDIAN_SQUARE = 0.45493642311957283
#: First quartile of the size of a standard normal variable.
QUARTILE = 0.31863936396437514
#: Differences in a block over which squares are averaged.
_BLOCK = 25


def white_noise(values: Array) -> float:
    """Standard deviation of the noise in ``values`` (m,), robust against motion and jumps in less than half of them."""
    found = difference_noise(values, ORDER)
    for order in HIGHER_ORDERS:
        less = difference_noise(values, order)
        if 0.0 < less < LESS * found:
            found = less
    return found


def difference_noise(values: Array, order: int) -> float:
    """The same by differences of one order."""
    if len(values) < order + 5:
        return 0.0
    variance = comb(2 * order, order)
    differences = np.diff(values, order)
    # Blocks that the motion dominates have large squares; the median over blocks of means ignores them.
    count = len(differences) // _BLOCK
    if count < 4:
        return float(np.sqrt(np.median(differences**2) / MEDIAN_SQUARE / variance))
    means = np.mean(differences[: count * _BLOCK].reshape(count, _BLOCK) ** 2, axis=1)
    # The lower half of the blocks, corrected by the part of their distribution that lies there, says which blocks are
    # quiet.
    quiet = float(np.median(np.sort(means)[: max(2, count // 2)])) / lower_half_share(order)
    return float(np.sqrt(np.mean(means[means < 2.5 * quiet]) / variance)) if quiet > 0.0 else 0.0


def quiet_noise(values: Array) -> float:
    """The same where most of a channel moves: by the quarter of differences that are least; less exact by far."""
    if len(values) < ORDER + 5:
        return 0.0
    return float(np.quantile(np.abs(np.diff(values, ORDER)), 0.25) / QUARTILE / np.sqrt(comb(2 * ORDER, ORDER)))


@cache
def lower_half_share(order: int) -> float:
    """Median of the lower half of block means for pure noise, over their expectation; by a fixed random draw."""
    noise = np.random.default_rng(0).standard_normal(_BLOCK * 4000 + order)
    squares = np.diff(noise, order) ** 2 / comb(2 * order, order)
    means = np.mean(squares[: _BLOCK * 4000].reshape(4000, _BLOCK), axis=1)
    return float(np.median(np.sort(means)[:2000]))


def quantum(values: Array) -> float:
    """Distance of the grid on which all ``values`` lie; 0 if none is coarser than a ten-thousandth of their spread."""
    levels = np.unique(np.round(values, 12))
    if len(levels) < 3:
        return 0.0
    steps = np.diff(levels)
    step = float(np.min(steps[steps > 1e-11])) if np.any(steps > 1e-11) else 0.0
    spread = float(np.ptp(values))
    if step < 1e-4 * spread:
        return 0.0
    remainder = np.abs(steps / step - np.round(steps / step))
    return step if float(np.quantile(remainder, 0.99)) < 0.02 else 0.0
