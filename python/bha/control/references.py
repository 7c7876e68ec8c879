"""References: where the arm should be, period by period; jerk-limited, as lengths or from a path of the tip.

Jerk-limited motion is that of ruckig (Berscheid & Kroeger, RSS 2021; extra ``control``): time-optimal within limits of
velocity, acceleration and jerk, so that accelerations are continuous and feedback linearization can follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arrays import floats
from bha.control.limits import Limits
from bha.control.reach import comfortable_radius, warn_of_reach
from bha.errors import InputError
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from bha.arm import Arm

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Reference:
    """Where the arm should be; k rows at a constant period.

    Attributes:
        period: control period, s.
        lengths: m, shape (k, 3n).
        velocities: m/s, shape (k, 3n).
        accelerations: m/s^2, shape (k, 3n).
        tip_positions: wanted tip (head of the last section) in the base frame, m, shape (k, 3), or None.
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
        when, rows = _samples(time, lengths, "lengths")
        return cls._through(_spread(when, rows, period, smoothing), period)

    @classmethod
    def _through(cls, lengths: Floats, period: float, tip_positions: Floats | None = None) -> Reference:
        """Rates and accelerations by central differences."""
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


def hold(lengths: ArrayLike, duration: float, *, period: float = 1e-3) -> Reference:
    """The same ``lengths`` (3n,), m, for ``duration`` s.

    Raises:
        InputError: ``lengths`` is not a vector, ``duration`` is negative, ``period`` is not positive, or too many
            periods.
    """
    row = _vector(lengths, "lengths")
    if not (math.isfinite(duration) and duration >= 0):
        raise InputError(f"duration: {duration}; a number of seconds not below zero is needed")
    count = max(1, _rows(duration, period))
    still = np.zeros((count, len(row)))
    return Reference(period, np.tile(row, (count, 1)), still, still.copy())


def point_to_point(
    start: ArrayLike,
    end: ArrayLike,
    *,
    max_velocity: float = 0.2,
    max_acceleration: float = 2.0,
    max_jerk: float = 40.0,
    rest: float = 0.5,
    period: float = 1e-3,
) -> Reference:
    """From lengths ``start`` to ``end`` (3n,), all together and as fast as the limits allow, then ``rest`` s at the
    end.

    Args:
        start: m.
        end: m.
        max_velocity: of each length, m/s.
        max_acceleration: of each length, m/s^2.
        max_jerk: of each length, m/s^3.
        rest: time at the end, s.
        period: control period, s.

    Raises:
        InputError: shapes that differ, or limits that are not positive.
        MissingExtraError: ruckig is not installed.
    """
    a, b = _vector(start, "start"), _vector(end, "end")
    if a.shape != b.shape:
        raise InputError(f"end: expected shape {a.shape}, as start has, found {b.shape}")
    # Along the straight line between them; the length that has farthest to go feels the limits.
    farthest = float(np.max(np.abs(b - a), initial=0.0))
    motion = _jerk_limited(farthest, (max_velocity, max_acceleration, max_jerk), rest, period)
    way = (b - a) / farthest if farthest > 0 else np.zeros_like(a)
    along, velocity, acceleration = (np.outer(column, way) for column in motion)
    return Reference(period, a + along, velocity, acceleration)


def tip_path(
    arm: Arm,
    path: Callable[[Floats], Floats],
    length: float,
    *,
    start: ArrayLike | None = None,
    directions: ArrayLike | None = None,
    max_velocity: float = 0.4,
    max_acceleration: float = 2.0,
    max_jerk: float = 30.0,
    rest: float = 0.5,
    period: float = 1e-3,
    limits: Limits | None = None,
) -> Reference:
    """Along a path of the tip, at rest at both ends, within limits of speed, acceleration and jerk along it.

    Lengths are resolved from the tip by ``arm``'s kinematics; what the tip leaves free is used to stay near the middle
    of the lengths. A :class:`bha.errors.ReferenceWarning` says which part pressures within their limits cannot hold
    (:func:`bha.control.reachability`).

    Args:
        arm: the arm whose tip (head of the last section) is to move.
        path: positions (k, 3), m, in the base frame, at arc lengths (k,), m, along the path.
        length: arc length of the path, m.
        start: lengths (3n,) from which the first pose is sought, m; None: the middle of their ranges.
        directions: direction of the tip's z axis, the same all along, shape (3,); None: left free.
        max_velocity: m/s.
        max_acceleration: m/s^2.
        max_jerk: m/s^3.
        rest: time at the end, s.
        period: control period, s.
        limits: limits of the lengths; None: those of the parameter file.

    Raises:
        ConvergenceError: the path leaves the reach of the arm within its lengths.
        MissingExtraError: ruckig is not installed.
    """
    bounds = limits or Limits.of(arm)
    bound = (max_velocity, max_acceleration, max_jerk)
    along, _, _ = _jerk_limited(float(length), bound, rest, period)
    positions = floats(path(along), "path(along)", (len(along), 3))
    first = (bounds.shortest + bounds.longest) / 2 if start is None else _vector(start, "start")
    aim = None if directions is None else np.tile(_vector(directions, "directions"), (len(positions), 1))
    lengths = _core.resolved_motion(arm, positions, aim, first, bounds.shortest, bounds.longest)
    return warn_of_reach(arm, Reference._through(lengths, period, positions), bounds)


def tip_samples(
    arm: Arm, time: ArrayLike, positions: ArrayLike, *, period: float = 1e-3, smoothing: float = 0.06
) -> Reference:
    """Through tip positions sampled at irregular times, smoothed as :meth:`Reference.sampled` does.

    A :class:`bha.errors.ReferenceWarning` says which part is out of reach, as for :func:`tip_path`.

    Args:
        arm: the arm whose tip (head of the last section) is to move.
        time: of the samples, ascending, s, shape (k,).
        positions: in the base frame, m, shape (k, 3).
        period: control period, s.
        smoothing: over how long each row is spread, s.

    Raises:
        InputError: shapes that do not fit, times that do not ascend, numbers that are not finite.
        ConvergenceError: a position is out of the arm's reach.
    """
    when, rows = _samples(time, positions, "positions")
    tips = _spread(when, rows, period, smoothing)
    limits = Limits.of(arm)
    middle = (limits.shortest + limits.longest) / 2
    lengths = _core.resolved_motion(arm, tips, None, middle, limits.shortest, limits.longest)
    return warn_of_reach(arm, Reference._through(lengths, period, tips), limits)


def tip_line(arm: Arm, start: ArrayLike, end: ArrayLike, **options: Any) -> Reference:
    """Along a straight line of the tip from ``start`` to ``end`` (3,), m; the rest as for :func:`tip_path`."""
    a, b = _vector(start, "start"), _vector(end, "end")
    length = float(np.linalg.norm(b - a))
    if length == 0:
        raise InputError("end: the same as start; a line needs two points")
    return tip_path(arm, lambda s: a + np.outer(s / length, b - a), length, **options)


def tip_circle(
    arm: Arm, radius: float | None = None, *, height: float | None = None, turns: float = 1.0, **options: Any
) -> Reference:
    """A circle of the tip around the base's z axis, ``turns`` times; the rest as for :func:`tip_path`.

    Args:
        arm: the arm.
        radius: m; None: 0.7 of the largest at that height that pressures and lengths within their ranges can hold, and
            at most a fifth of the arm's height.
        height: z of the circle in the base frame, m; None: 5 cm less than the straight arm's at the middle of its
            lengths, for arms below half a metre a tenth less.
        turns: how often.
        options: as for :func:`tip_path`.

    Raises:
        InputError: a radius or number of turns that is not positive; no radius given, and the arm reaches no circle.
        ConvergenceError: the circle leaves the arm's reach.
    """
    for name, value in (("radius", radius), ("turns", turns), ("height", height)):
        if value is not None and not (math.isfinite(value) and (value > 0 or name == "height")):
            raise InputError(f"{name}: {value}; a positive number is needed")
    limits = options.get("limits") or Limits.of(arm)
    if height is None:
        heads, _ = arm.forward_kinematics((limits.shortest + limits.longest) / 2)
        straight = float(heads[-1, 2])
        height = straight - min(0.05, 0.1 * straight)
    z, r = height, comfortable_radius(arm, height, limits) if radius is None else float(radius)

    def path(s: Floats) -> Floats:
        angle = s / r
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full_like(angle, z)])

    return tip_path(arm, path, 2 * math.pi * r * turns, **options)


def _jerk_limited(
    distance: float, limits: tuple[float, float, float], rest: float, period: float
) -> tuple[Floats, Floats, Floats]:
    """Position, velocity and acceleration (k,) from rest at 0 to rest at ``distance``, and then ``rest`` s."""
    for name, value in zip(("max_velocity", "max_acceleration", "max_jerk", "period"), (*limits, period), strict=True):
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name}: {value}; a positive number is needed")
    if not (math.isfinite(rest) and rest >= 0):
        raise InputError(f"rest: {rest}; a number of seconds not below zero is needed")
    duration, at = _fastest(distance, limits)
    times = np.arange(_rows(duration + rest, period, math.ceil) + 1) * period
    rows = np.array([at(min(float(t), duration)) for t in times])
    return rows[:, 0], rows[:, 1], rows[:, 2]


#: Relative changes of a distance that are tried in turn: ruckig refuses some distances to the last digits.
_NUDGES = (0.0, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6)


def _fastest(
    distance: float, limits: tuple[float, float, float]
) -> tuple[float, Callable[[float], tuple[float, float, float]]]:
    """Duration, s, and (position, velocity, acceleration) at a time, of the fastest motion over ``distance``.

    Raises:
        InputError: ruckig finds none.
    """
    if distance == 0.0:
        return 0.0, lambda t: (0.0, 0.0, 0.0)
    ruckig = import_extra("ruckig", extra="control", purpose="A jerk-limited reference")
    wanted = ruckig.InputParameter(1)
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = ([value] for value in limits)
    reason = ""
    for nudge in _NUDGES:
        motion = ruckig.Trajectory(1)
        wanted.target_position = [distance * (1.0 + nudge)]
        # At the borders between its profiles ruckig throws, or finds a motion that ends elsewhere, for distances that
        # are harmless; a hair beside them it does not.
        try:
            result = ruckig.Ruckig(1).calculate(wanted, motion)
            end = motion.at_time(motion.duration)[0][0]
        except Exception as error:
            reason = f"{type(error).__name__}: {str(error).splitlines()[0]}" if str(error) else type(error).__name__
            continue
        reason = str(result)
        ok = result in (ruckig.Result.Finished, ruckig.Result.Working) and math.isfinite(motion.duration)
        if ok and abs(end - distance) <= max(2e-6 * abs(distance), 1e-12):
            return float(motion.duration), _scaled(motion, distance / end if end else 1.0)
    raise InputError(
        f"distance: {distance:g} m; no jerk-limited motion over it within max_velocity {limits[0]:g}, max_acceleration "
        f"{limits[1]:g} and max_jerk {limits[2]:g}: ruckig says {reason}. Other limits may help"
    )


def _scaled(motion: Any, scale: float) -> Callable[[float], tuple[float, float, float]]:
    """Position, velocity and acceleration of a motion of ruckig at a time, times a factor."""

    def at(t: float) -> tuple[float, float, float]:
        position, velocity, acceleration = motion.at_time(t)
        return scale * position[0], scale * velocity[0], scale * acceleration[0]

    return at


def _rows(duration: float, period: float, whole: Callable[[float], int] = round) -> int:
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


#: Most rows of a reference.
_MOST_ROWS = 1e7


def _samples(time: ArrayLike, values: ArrayLike, name: str) -> tuple[Floats, Floats]:
    """Times (k,) from 0 on and values (k, any), checked."""
    when, rows = _vector(time, "time"), floats(values, name, finite=False)
    if rows.ndim != 2 or len(rows) != len(when) or len(when) == 0:
        raise InputError(f"{name}: expected shape ({len(when)}, any), a row a time, found {rows.shape}")
    if np.any(np.diff(when) <= 0):
        raise InputError(f"time: must ascend; row {int(np.argmax(np.diff(when) <= 0)) + 1} does not")
    if not np.all(np.isfinite(rows)):
        row, column = np.argwhere(~np.isfinite(rows))[0]
        raise InputError(f"{name}: row {row}, column {column} is {rows[row, column]}; a reference needs all of them")
    return when - when[0], rows


def _spread(time: Floats, rows: Floats, period: float, smoothing: float) -> Floats:
    """Rows at every period, averaged three times over a third of ``smoothing``."""
    if not (math.isfinite(period) and period > 0):
        raise InputError(f"period: {period}; a positive number of seconds is needed")
    if not (math.isfinite(smoothing) and smoothing >= 0):
        raise InputError(f"smoothing: {smoothing}; a number of seconds not below zero is needed")
    _rows(float(time[-1]) + smoothing, period)
    half = round(smoothing / period / 6)
    at = np.arange(-3 * half, math.ceil(time[-1] / period - 1e-9) + 3 * half + 1) * period
    out = np.column_stack([np.interp(at, time, column) for column in rows.T])
    for _ in range(3):
        sums = np.cumsum(
            np.vstack([np.repeat(out[:1], half + 1, axis=0), out, np.repeat(out[-1:], half, axis=0)]), axis=0
        )
        out = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
    return np.asarray(out)


def _vector(values: ArrayLike, name: str) -> Floats:
    return floats(values, name, (None,))
