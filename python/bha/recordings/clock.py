"""Times of a log's rows: how far apart they are, and what a coarse timer made of them.

A logger that samples evenly but stamps its rows with a timer of 15.6 ms (the usual one of Windows) writes times on the
grid of that timer, several rows at one time. The rows themselves are even: their times follow from their number.

Stamps may also scatter about even times, because whoever writes them is kept waiting, while the samples are even; or
the samples scatter as their stamps say. What was measured tells: by the right times it is smoother. Each reading is
predicted by the cubic through the two before and the two after it (Lagrange), once by the stamps and once by even
times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Fewest rows and fewest grid steps from which a timer is told.
_FEWEST = 50
#: A timer's grid must hold this share of the times, to this part of its step.
_GRID_SHARE, _GRID_PART = 0.999, 0.02
#: Rows are even if a straight line misses their stamps by no more than this many ticks: a stamp is off by one at most.
_MOST_OFF = 1.05
#: Stamps scatter if steps do by this share of their mean, and rows are none the fewer if none is further from its even
#: time than this share of a step.
_SCATTER, _FARTHEST = 0.03, 0.75
#: Even times are right if by stamps readings are missed by this many times as much, in mean square.
_SMOOTHER = 1.2
#: Rows of outputs, or of commands alone, further apart than this, or a first row beyond this time, s, are doubted: the
#: year 5138 by the clock of 1970. So are rows closer together than any logger's of an arm.
SLOW, SLOW_COMMANDS, FAR, FAST = 5.0, 300.0, 1e11, 1e-5
#: A gap is this many usual intervals long.
_GAP = 10.0


@dataclass(frozen=True)
class ClockFacts:
    """What is known of the times of a log.

    Attributes:
        rows: number of rows.
        interval: median time between two rows, s; after mending, where the timer was coarse.
        duration: from the first row to the last, s.
        tick: step of the timer that stamped evenly sampled rows, s; 0 where stamps are as fine as the rows.
        repeats: share of rows with the time of the row before, as the file has them.
        scatter: standard deviation of stamps about the even times that were taken instead, s; 0 where none were.
        gaps: spans ``(from, to)``, s, without rows, ten times as long as usual or longer.
    """

    rows: int
    interval: float
    duration: float
    tick: float
    repeats: float
    gaps: tuple[tuple[float, float], ...]
    scatter: float = 0.0


def mended(time: Array, measured: Array | None = None) -> tuple[Array, ClockFacts]:
    """The times of the rows, s, shape (m,), with what a timer did to them taken out, and what was found.

    ``measured`` (m, C), NaN where missing, tells whether stamps that scatter are the times of the samples.
    """
    repeats = float(np.mean(np.diff(time) <= 0.0)) if len(time) > 1 else 0.0
    tick = _tick(time)
    if tick > 0.0:
        time = _even(time, tick)
    scatter = 0.0
    if tick == 0.0 and measured is not None and (even := _smoother(time, measured)) is not None:
        scatter = float(np.std(time - even))
        time = even
    steps = np.diff(time)
    forward = steps[steps > 0.0]
    interval = float(np.median(forward)) if len(forward) else 0.0
    wide = np.flatnonzero(steps > _GAP * interval) if interval > 0.0 else np.empty(0, dtype=np.intp)
    gaps = tuple((float(time[k]), float(time[k + 1])) for k in wide)
    return time, ClockFacts(len(time), interval, float(time[-1] - time[0]), tick, repeats, gaps, scatter)


def later(time: Array) -> NDArray[np.bool_]:
    """Rows that are later than the row before, and the first one, shape (m,): knots of a curve."""
    return np.diff(time, prepend=-np.inf) > 0.0


def doubt(facts: ClockFacts, first: float, *, measured: bool) -> str | None:
    """A text where times cannot well be seconds: rows of a log in ms or us under ``t [s]``, or in hours."""
    if facts.rows < 3:
        return None
    if facts.interval == 0.0:
        return _in_no_time(facts.rows, first)
    # A log of commands alone may have a row at each change only.
    slow = facts.interval >= (SLOW if measured else SLOW_COMMANDS)
    if not (slow or facts.interval < FAST or abs(first) >= FAR):
        return None
    apart = f"rows are {facts.interval:.4g} s apart and begin at {first:.6g} s"
    unit = "min" if facts.interval < FAST else "ms"
    return f"{apart}: is the time in another unit? Then write it in the heading, as in 't [{unit}]'"


def follows_no_motion(facts: ClockFacts, first: float) -> str | None:
    """Why rows tell nothing of how an arm moves; None where they may.

    Args:
        facts: of the times.
        first: time of the first row, s.
    """
    if facts.interval == 0.0:
        return "there is one row alone; a log has many" if facts.rows == 1 else _in_no_time(facts.rows, first)
    if FAST <= facts.interval <= SLOW:
        return None
    unit = "min" if facts.interval < FAST else "ms"
    return (
        f"rows are {facts.interval:.4g} s apart; those that follow an arm's motion are {FAST:g} to {SLOW:g} s apart: "
        f"is the time in another unit than its heading says? Then write it there, as in 't [{unit}]'"
    )


def _in_no_time(rows: int, first: float) -> str:
    return f"all {rows} rows are at {first:.6g} s: nothing moves in no time; write the time of each row"


def _tick(time: Array) -> float:
    """Step of the timer, s, if rows that are even lie on a grid coarser than half of their distance; else 0."""
    steps = np.diff(time)
    forward = steps[steps > 0.0]
    if len(time) < _FEWEST or len(forward) < _FEWEST:
        return 0.0
    tick = float(np.min(forward))
    if tick <= 0.0:
        return 0.0
    tick = float(np.median(forward[forward < 1.5 * tick]))
    whole = np.abs(forward / tick - np.round(forward / tick)) < _GRID_PART
    mean = (time[-1] - time[0]) / (len(time) - 1)
    # Even stamps are on a grid too: theirs. A timer shows by steps of several kinds.
    uneven = np.ptp(np.round(steps / tick)) >= 1.0 and float(np.std(steps)) > 0.1 * mean
    if float(np.mean(whole)) < _GRID_SHARE or tick < 0.5 * mean or not uneven:
        return 0.0
    line = np.polyval(np.polyfit(np.arange(len(time)), time, 1), np.arange(len(time)))
    return tick if float(np.ptp(time - line)) <= 2.0 * _MOST_OFF * tick else 0.0


def _even(time: Array, tick: float) -> Array:
    """Even times of rows that a timer stamped with the last tick before them: the line that no stamp is ahead of."""
    row = np.arange(len(time), dtype=np.float64)
    slope, offset = np.polyfit(row, time, 1)
    # A stamp is late by between nothing and one tick, half a tick in the mean.
    return np.asarray(offset + 0.5 * tick + slope * row)


def _smoother(time: Array, measured: Array) -> Array | None:
    """Even times of rows whose stamps scatter, where what was measured is smoother by them; else None."""
    steps = np.diff(time)
    if len(time) < _FEWEST or np.min(steps) <= 0.0:
        return None
    mean = float((time[-1] - time[0]) / len(steps))
    even: Array = np.polyval(np.polyfit(np.arange(len(time)), time, 1), np.arange(len(time))).astype(np.float64)
    if float(np.std(steps)) < _SCATTER * mean or float(np.max(np.abs(time - even))) > _FARTHEST * mean:
        return None
    ratios = []
    for column in measured.T:
        if np.all(np.isfinite(column)) and np.any(np.diff(column)):
            by_even = _missed(even, column)
            ratios.append(_missed(time, column) / by_even if by_even > 0.0 else 1.0)
    return even if ratios and float(np.exp(np.mean(np.log(np.maximum(ratios, 1e-9))))) > _SMOOTHER else None


def _missed(time: Array, values: Array) -> float:
    """Mean square by which readings are missed by cubics through their neighbours, in units of white noise."""
    at = time[2:-2]
    near = [(time[k : len(time) - 4 + k], values[k : len(time) - 4 + k]) for k in (0, 1, 3, 4)]
    predicted, gain = np.zeros(len(at)), np.ones(len(at))
    for j, (own, value) in enumerate(near):
        weight = np.ones(len(at))
        for k, (other, _) in enumerate(near):
            if k != j:
                weight = weight * (at - other) / (own - other)
        predicted += weight * value
        gain += weight**2
    return float(np.mean((values[2:-2] - predicted) ** 2 / gain))
