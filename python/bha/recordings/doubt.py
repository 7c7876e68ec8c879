"""What the readings of a pressure cannot know of it between them, and how large that is.

A curve through readings that are far apart misses what a pressure does meanwhile: at 10 Hz a whole step, of which only
is known that it came within the last 0.1 s. That is no noise of the sensor and no fault of the arm, but it drives the
arm and not the model. How large it is the readings say themselves: each of them is left out and predicted from its
neighbours, which are twice as far apart; and from twice that distance; the ratio of the two errors (2 to the order of
the interpolation for smooth pressures, the root of two for jumps) takes it to the readings as they are. Where it is
large is told by the errors at both ends of an interval. Between two readings the error is taken as a bump 4 s (1 - s).
Source: for jumps at any time within an interval both size and place are exact; else leave-one-out cross-validation
(Stone, Journal of the Royal Statistical Society B 36 (1974) 111-147) with Richardson's extrapolation.
Limits: a pressure that does the same between all readings (a sine at their rate) is not seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: A curve through values at knots: ``interpolant(at, knots, values)``.
Interpolant = Callable[[Array, Array, Array], Array]

#: Fewest readings that are judged.
FEWEST = 40
#: Variance of the error of a left-out reading by the noise of all, over that noise's.
NOISE_SHARE = 1.6
#: The errors of left-out readings must have this many times the variance that noise gives them.
STANDS_OUT = 2.0
#: Ratio of errors at doubled distances: that of jumps, and that of cubics.
LEAST_RATIO, GREATEST_RATIO = np.sqrt(2.0), 16.0
#: An interval this many times as long as usual is a gap, of which more is said elsewhere.
GAP = 2.5
#: What a bump of height one is at both ends, as samples there that have its area.
AT_ENDS = 1.0 / 3.0


@dataclass(frozen=True)
class Doubt:
    """Intervals between readings of one pressure in which it may be another than the curve through them.

    Attributes:
        first: sample at which each interval begins, shape (k,).
        last: sample at which it ends.
        scale: standard deviation of the height of the bump between them, Pa.
    """

    first: NDArray[np.intp]
    last: NDArray[np.intp]
    scale: Array

    @property
    def any(self) -> bool:
        """Whether there is any."""
        return bool(len(self.scale))

    def drawn(self, time: Array, rng: np.random.Generator) -> Array:
        """What the pressure may be besides the curve, at the samples' ``time``, s, shape (m,)."""
        error = np.zeros(len(time))
        heights = self.scale * rng.standard_normal(len(self.scale))
        inner = self.last - self.first > 1
        for place in (self.first, self.last):
            # No sample between: the same area at both ends.
            np.add.at(error, place[~inner], AT_ENDS * heights[~inner])
        for a, b, height in zip(self.first[inner], self.last[inner], heights[inner], strict=True):
            s = (time[a + 1 : b] - time[a]) / max(time[b] - time[a], 1e-12)
            error[a + 1 : b] += 4.0 * height * s * (1.0 - s)
        return error

    def between(self, first: int, last: int) -> Doubt:
        """That of the samples ``first`` to ``last``, inclusive, counted from ``first``."""
        kept = (self.first >= first) & (self.last <= last)
        return replace(self, first=self.first[kept] - first, last=self.last[kept] - first, scale=self.scale[kept])


NOTHING = Doubt(np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp), np.empty(0))


def doubt(time: Array, knots: Array, values: Array, noise: float, interpolant: Interpolant) -> Doubt:
    """What readings leave open; nothing where it does not stand out of their noise.

    Args:
        time: of the samples that drive the arm, s, shape (m,), ascending.
        knots: times of the readings, s, shape (k,), ascending.
        values: readings, Pa, shape (k,).
        noise: their standard deviation, Pa.
        interpolant: by which the samples follow from the readings.
    """
    if len(knots) < FEWEST:
        return NOTHING
    noisy = NOISE_SHARE * noise**2
    near = left_out(knots, values, 2, interpolant)
    square = float(np.mean(near**2))
    if square <= STANDS_OUT * noisy or square == 0.0:
        return NOTHING
    square -= noisy
    wide = max(float(np.mean(left_out(knots, values, 4, interpolant) ** 2)) - noisy, 0.0)
    ratio = float(np.clip(np.sqrt(wide / square), LEAST_RATIO, GREATEST_RATIO))
    own = np.sqrt(np.maximum(near**2 - noisy, 0.0))
    # Of a jump both ends of its interval, and no other's, are far off.
    local = np.sqrt(own[:-1] * own[1:])
    steps = np.diff(knots)
    local[steps > GAP * np.median(steps)] = 0.0
    total = float(np.mean(local**2))
    if total == 0.0:
        return NOTHING
    scale = local * np.sqrt(square / total) / ratio
    first, last = (np.searchsorted(time, ends) for ends in (knots[:-1], knots[1:]))
    kept = (scale > 0.0) & (last > first) & (last < len(time))
    return Doubt(first[kept], last[kept], scale[kept])


def left_out(knots: Array, values: Array, apart: int, interpolant: Interpolant) -> Array:
    """Errors of readings predicted by others of which there is one every ``apart``, shape (k,); 0 near both ends."""
    error = np.zeros(len(knots))
    middle = apart // 2
    for phase in range(apart):
        kept = np.arange(phase, len(knots), apart)
        asked = kept[:-1] + middle
        error[asked] = values[asked] - interpolant(knots[asked], knots[kept], values[kept])
    return error
