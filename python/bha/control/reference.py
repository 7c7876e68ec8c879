"""A reference: where the arm should be, period by period."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.arrays import floats
from bha.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Reference:
    """Where the arm should be; k rows at a constant period.

    Attributes:
        period: control period, s.
        lengths: m, shape (k, 3n).
        velocities: m/s, shape (k, 3n).
        accelerations: m/s^2, shape (k, 3n).
        tip_positions: wanted tip (head of the last section) in the world, m, shape (k, 3), or None.
    """

    period: float
    lengths: Floats
    velocities: Floats
    accelerations: Floats
    tip_positions: Floats | None = None

    def __post_init__(self) -> None:
        """Check that the shapes fit together."""
        shape = np.shape(self.lengths)
        if len(shape) != 2 or shape[0] == 0:
            raise InputError(f"reference: lengths: expected shape (k, 3n) with k >= 1, found {shape}")
        for name in ("velocities", "accelerations"):
            if np.shape(getattr(self, name)) != shape:
                raise InputError(f"reference: {name}: expected shape {shape}, found {np.shape(getattr(self, name))}")
        if self.tip_positions is not None and np.shape(self.tip_positions) != (shape[0], 3):
            raise InputError(
                f"reference: tip_positions: expected shape {(shape[0], 3)}, found {np.shape(self.tip_positions)}"
            )
        if not (math.isfinite(self.period) and self.period > 0):
            raise InputError(f"reference: period: {self.period}; a positive number of seconds is needed")

    def __len__(self) -> int:
        """Number of periods."""
        return len(self.lengths)

    @property
    def time(self) -> Floats:
        """Time of each row, s, from 0."""
        return np.arange(len(self), dtype=np.float64) * self.period

    def rows(self) -> Floats:
        """Lengths, velocities and accelerations side by side, shape (k, 9n)."""
        return np.ascontiguousarray(np.hstack([self.lengths, self.velocities, self.accelerations]))

    @classmethod
    def sampled(
        cls, time: ArrayLike, lengths: ArrayLike, *, period: float = 1e-3, smoothing: float = 0.06
    ) -> Reference:
        """Lengths sampled at irregular times, brought to the control period and smoothed.

        Straight lines between the samples are averaged three times over a third of ``smoothing``, so that rates and
        accelerations are continuous; before and after the samples the arm rests.

        Args:
            time: of the samples, ascending, s, shape (k,).
            lengths: m, shape (k, 3n).
            period: control period, s.
            smoothing: over how long each row is spread, s; 0: not at all, accelerations are those of differences.

        Raises:
            InputError: shapes that do not fit, times that do not ascend, numbers that are not finite.
        """
        when, rows = samples(time, lengths, "lengths")
        return cls.through(spread(when, rows, period, smoothing), period)

    @classmethod
    def through(cls, lengths: Floats, period: float, tip_positions: Floats | None = None) -> Reference:
        """Lengths (k, 3n), m, a row a period; rates and accelerations by central differences."""
        if len(lengths) < 2:
            still = np.zeros_like(lengths)
            return cls(period, lengths, still, still.copy(), tip_positions)
        velocities = np.gradient(lengths, period, axis=0)
        return cls(period, lengths, velocities, np.gradient(velocities, period, axis=0), tip_positions)

    def followed_by(self, other: Reference) -> Reference:
        """This reference, then another of the same period and arm.

        Raises:
            InputError: the periods or the numbers of lengths differ.
        """
        if self.period != other.period or self.lengths.shape[1] != other.lengths.shape[1]:
            raise InputError("reference: only references of the same period and arm can follow each other")
        tips = (self.tip_positions, other.tip_positions)
        return Reference(
            self.period,
            np.vstack([self.lengths, other.lengths]),
            np.vstack([self.velocities, other.velocities]),
            np.vstack([self.accelerations, other.accelerations]),
            None if tips[0] is None or tips[1] is None else np.vstack([tips[0], tips[1]]),
        )


def samples(time: ArrayLike, values: ArrayLike, name: str) -> tuple[Floats, Floats]:
    """Times (k,) from 0 on and values (k, any), checked."""
    when, rows = vector(time, "time"), floats(values, name, finite=False)
    if rows.ndim != 2 or len(rows) != len(when) or len(when) == 0:
        raise InputError(f"{name}: expected shape ({len(when)}, any), a row a time, found {rows.shape}")
    if np.any(np.diff(when) <= 0):
        raise InputError(f"time: must ascend; row {int(np.argmax(np.diff(when) <= 0)) + 1} does not")
    if not np.all(np.isfinite(rows)):
        row, column = np.argwhere(~np.isfinite(rows))[0]
        raise InputError(f"{name}: row {row}, column {column} is {rows[row, column]}; a reference needs all of them")
    return when - when[0], rows


def spread(time: Floats, rows: Floats, period: float, smoothing: float) -> Floats:
    """Rows at every period, averaged three times over a third of ``smoothing``."""
    if not (math.isfinite(period) and period > 0):
        raise InputError(f"period: {period}; a positive number of seconds is needed")
    if not (math.isfinite(smoothing) and smoothing >= 0):
        raise InputError(f"smoothing: {smoothing}; a number of seconds not below zero is needed")
    row_count(float(time[-1]) + smoothing, period)
    half = round(smoothing / period / 6)
    at = np.arange(-3 * half, math.ceil(time[-1] / period - 1e-9) + 3 * half + 1) * period
    out = np.column_stack([np.interp(at, time, column) for column in rows.T])
    for _ in range(3):
        sums = np.cumsum(
            np.vstack([np.repeat(out[:1], half + 1, axis=0), out, np.repeat(out[-1:], half, axis=0)]), axis=0
        )
        out = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
    return np.asarray(out)


#: Most rows of a reference.
_MOST_ROWS = 1e7


def row_count(duration: float, period: float, whole: Callable[[float], int] = round) -> int:
    """Periods in ``duration``.

    Raises:
        InputError: a period that is not positive, or more periods than memory could take.
    """
    if not (math.isfinite(period) and period > 0):
        raise InputError(f"period: {period}; a positive number of seconds is needed")
    if duration / period > _MOST_ROWS:
        raise InputError(
            f"reference: {duration:g} s at a period of {period:g} s are {duration / period:.2g} rows, more than "
            f"{_MOST_ROWS:g}; a longer period, faster limits or a shorter reference"
        )
    return whole(duration / period)


def vector(values: ArrayLike, name: str) -> Floats:
    """Numbers in a row, of any count."""
    return floats(values, name, (None,))
