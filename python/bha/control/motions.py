"""Motions that make a :class:`Reference`: held, point to point, along a path of the tip; jerk-limited.

Jerk-limited motion is that of ruckig (Berscheid & Kroeger, RSS 2021; extra ``control``): time-optimal within limits of
velocity, acceleration and jerk, so that accelerations are continuous and feedback linearization can follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.arrays import floats
from bha.control.limits import Limits
from bha.control.reach import circle_around_base, comfortable_radius, straight_height, warn_of_reach
from bha.control.reference import Reference, row_count, samples, spread, vector
from bha.errors import InputError
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from bha.arm import Arm

Floats = NDArray[np.float64]


def hold(lengths: ArrayLike, duration: float, *, period: float = 1e-3) -> Reference:
    """The same ``lengths`` (3n,), m, for ``duration`` s.

    Raises:
        InputError: ``lengths`` is not a vector, ``duration`` is negative, ``period`` is not positive, or too many
            periods.
    """
    row = vector(lengths, "lengths")
    if not (math.isfinite(duration) and duration >= 0):
        raise InputError(f"duration: {duration}; a number of seconds not below zero is needed")
    count = max(1, row_count(duration, period))
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
    a, b = vector(start, "start"), vector(end, "end")
    if a.shape != b.shape:
        raise InputError(f"end: expected shape {a.shape}, as start has, found {b.shape}")
    # Along the straight line between them; the length that has farthest to go feels the limits.
    farthest = float(np.max(np.abs(b - a), initial=0.0))
    motion = _jerk_limited(farthest, (max_velocity, max_acceleration, max_jerk), rest, period)
    way = (b - a) / farthest if farthest > 0 else np.zeros_like(a)
    along, velocity, acceleration = (np.outer(column, way) for column in motion)
    return Reference(period, a + along, velocity, acceleration)


def there_and_back(arm: Arm, *, period: float = 1e-3) -> Reference:
    """A fast move of all sections out of the middle of the lengths, and back: 0.4 m/s, 4 m/s^2, 80 m/s^3.

    Raises:
        ConvergenceError: the arm rests nowhere near the ends.
        MissingExtraError: ruckig is not installed.
    """
    limits = Limits.of(arm)
    middle, half = limits.middle, (limits.longest - limits.shortest) / 2
    # A slender arm bends far for small differences of its lengths: by no more than a radian here.
    radii = np.repeat([section.bellows_radius for section in arm.parameters.sections], 3)
    bend = np.tile([-0.3, 0.15, 0.15], arm.section_count) * np.minimum(1.0, radii / (0.3 * half))
    fast = {"max_velocity": 0.4, "max_acceleration": 4.0, "max_jerk": 80.0}
    # From where the arm can rest to where it can rest: nearest to a bend that is meant for any arm.
    start, end = (
        limits.rest_near(arm, lengths).lengths for lengths in (middle - 0.1 * half, middle + (bend - 0.1) * half)
    )
    there = point_to_point(start, end, period=period, **fast)
    return there.followed_by(point_to_point(end, start, period=period, **fast))


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
        path: positions (k, 3), m, in the world, at arc lengths (k,), m, along the path.
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
    first = None if start is None else vector(start, "start")
    aim = None if directions is None else np.tile(vector(directions, "directions"), (len(positions), 1))
    lengths = bounds.resolved(arm, positions, aim, first)
    return warn_of_reach(arm, Reference.through(lengths, period, positions), bounds)


def tip_samples(
    arm: Arm, time: ArrayLike, positions: ArrayLike, *, period: float = 1e-3, smoothing: float = 0.06
) -> Reference:
    """Through tip positions sampled at irregular times, smoothed as :meth:`Reference.sampled` does.

    A :class:`bha.errors.ReferenceWarning` says which part is out of reach, as for :func:`tip_path`.

    Args:
        arm: the arm whose tip (head of the last section) is to move.
        time: of the samples, ascending, s, shape (k,).
        positions: in the world, m, shape (k, 3).
        period: control period, s.
        smoothing: over how long each row is spread, s.

    Raises:
        InputError: shapes that do not fit, times that do not ascend, numbers that are not finite.
        ConvergenceError: a position is out of the arm's reach.
    """
    when, rows = samples(time, positions, "positions")
    tips = spread(when, rows, period, smoothing)
    limits = Limits.of(arm)
    lengths = limits.resolved(arm, tips)
    return warn_of_reach(arm, Reference.through(lengths, period, tips), limits)


def tip_line(arm: Arm, start: ArrayLike, end: ArrayLike, **options: Any) -> Reference:
    """Along a straight line of the tip from ``start`` to ``end`` (3,), m; the rest as for :func:`tip_path`."""
    a, b = vector(start, "start"), vector(end, "end")
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
        height: of the circle along that axis from the base, m; None: 5 cm less than the straight arm's at the middle of
            its lengths, for arms below half a metre a tenth less.
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
        straight = straight_height(arm, limits)
        height = straight - min(0.05, 0.1 * straight)
    z, r = height, comfortable_radius(arm, height, limits) if radius is None else float(radius)

    def path(s: Floats) -> Floats:
        return circle_around_base(arm, r, z, s / r)

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
    times = np.arange(row_count(duration + rest, period, math.ceil) + 1) * period
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
