"""Whether an arm can be where a reference wants it: the static model turned round within the limits of the pressures.

At each row looked at the pressures are found that hold the reference's lengths best, and where the arm then rests.
Where its tip is farther from the reference's than a tolerance, the row is out of reach, and the tip is led as near to
it as pressures within the limits can (projected Levenberg-Marquardt steps on the rests).
Whether the motion there is also slow enough is another question: the inverse dynamics say which pressures it needs.
Limits: rows in between are not looked at; a path nearby with other lengths may be reachable; lags are not counted.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.control.limits import Limits
from bha.control.reference import Reference
from bha.errors import BhaError, InputError, ReferenceWarning
from bha.support.spans import spans_of

if TYPE_CHECKING:
    from bha.arm import Arm

Floats = NDArray[np.float64]

#: Rows of a reference that are looked at.
_ROWS = 48
#: Distance that still counts as reached, of the arm's height at the middle of its lengths.
_TOLERANCE = 0.005
#: Part of the largest circle within reach that is taken where no radius is given, and most of the arm's height.
_COMFORT, _MOST_RADIUS = 0.7, 0.2
_ANGLES = 16
#: Part of its range by which the pressure that a motion needs may lie beyond.
_SLACK = 0.05
_ITERATIONS = 12


@dataclass(frozen=True, eq=False)
class Reachability:
    """What of a reference an arm can reach at rest; made by :func:`reachability`.

    Attributes:
        arm: the arm.
        time: of the rows looked at, s, shape (k,).
        wanted: tips that the reference wants, m, shape (k, 3).
        held: tips where the arm rests under the pressures that hold the reference's lengths best, m, shape (k, 3); NaN
            where it has no rest.
        nearest: nearest tips that pressures within the limits hold, as far as found, m, shape (k, 3).
        pressures: those pressures, Pa absolute, shape (k, inputs).
        at_limit: names of the inputs at a limit in each row.
        needed: pressures that the motion needs by the inverse dynamics, limits or not, Pa absolute, shape (k, inputs).
        limits: the limits.
        tolerance: distance that counts as reached, m.
    """

    arm: Arm
    time: Floats
    wanted: Floats
    held: Floats
    nearest: Floats
    pressures: Floats
    at_limit: tuple[tuple[str, ...], ...]
    needed: Floats
    limits: Limits
    tolerance: float

    @property
    def distance(self) -> Floats:
        """Distance of the tips held from those wanted, m, shape (k,); infinite where there is no rest."""
        return np.asarray(np.nan_to_num(np.linalg.norm(self.held - self.wanted, axis=1), nan=np.inf))

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Which rows are within reach, shape (k,)."""
        return self.distance <= self.tolerance

    @property
    def complete(self) -> bool:
        """Whether all are."""
        return bool(np.all(self.reached))

    @property
    def too_fast(self) -> str | None:
        """What the motion asks of the pressures where the arm could rest but not follow; None where it could follow."""
        span = self.limits.high - self.limits.low
        beyond = np.maximum(self.limits.low - self.needed, self.needed - self.limits.high) / span
        beyond[~self.reached] = 0.0
        fast = beyond.max(axis=1) > _SLACK
        if not fast.any():
            return None
        row, k = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        needed, low, high = (1e-5 * float(p) for p in (self.needed[row, k], self.limits.low[k], self.limits.high[k]))
        return (
            f"{np.mean(fast):.0%} of the reference is too fast for {self.arm.name}: at {self.time[row]:.3g} s the "
            f"motion needs {needed:.3g} bar in {self.arm.inputs[k]}, {low:.3g} to {high:.3g} bar are allowed; lead it "
            "more slowly"
        )

    def __str__(self) -> str:
        """Which part is out of reach, and what is nearest."""
        out = ~self.reached
        if not out.any():
            return f"all of the reference is within reach of {self.arm.name}"
        off = np.nan_to_num(np.linalg.norm(self.nearest - self.wanted, axis=1), nan=np.inf)
        worst = int(np.argmax(np.where(out, off, -1.0)))
        wanted, near = _millimetres(self.wanted[worst]), _millimetres(self.nearest[worst])
        parts = "; ".join(f"{a:.3g} to {b:.3g} s" for a, b in self._stretches())
        text = f"{np.mean(out):.0%} of the reference is out of reach of {self.arm.name} ({parts}): at "
        text += f"{self.time[worst]:.3g} s "
        if not np.all(np.isfinite(self.nearest[worst])):
            return text + f"the tip shall be at {wanted} mm, and no rest is found under any pressures near it"
        if off[worst] <= self.tolerance:
            return text + (
                f"the tip could be at {wanted} mm, but no pressures within pressure_range hold the lengths that the "
                f"reference has there; at rest it is {1e3 * self.distance[worst]:.1f} mm away"
            )
        limits = ", ".join(self.at_limit[worst])
        return text + (
            f"the tip shall be at {wanted} mm, the nearest that pressures within pressure_range hold is {near} mm, "
            f"{1e3 * off[worst]:.1f} mm away" + (f", with {limits} at a limit" if limits else "")
        )

    def _stretches(self) -> list[tuple[float, float]]:
        """First and last time of each stretch out of reach, the three longest."""
        pairs = [(float(self.time[a]), float(self.time[b - 1])) for a, b in spans_of(~self.reached)]
        return sorted(sorted(pairs, key=lambda pair: pair[0] - pair[1])[:3])


def reachability(arm: Arm, reference: Reference, *, limits: Limits | None = None, rows: int = _ROWS) -> Reachability:
    """What of ``reference`` ``arm`` can reach at rest with pressures within ``limits`` (those of its file if None).

    Args:
        arm: the arm.
        reference: where it should be.
        limits: limits of the pressures.
        rows: how many rows are looked at, evenly over the reference, first and last included.

    Raises:
        InputError: the reference is not for this arm.
    """
    count = 3 * arm.section_count
    if reference.lengths.shape[1] != count:
        raise InputError(f"reference: has {reference.lengths.shape[1]} lengths, the arm {arm.name} has {count}")
    bounds = limits or Limits.of(arm)
    chosen = np.unique(np.linspace(0, len(reference) - 1, max(2, min(rows, len(reference)))).round().astype(int))
    tolerance = _TOLERANCE * _height(arm, bounds)
    wanted = np.array([_tip(arm, reference.lengths[k]) for k in chosen])
    held, nearest = np.full((len(chosen), 3), np.nan), np.full((len(chosen), 3), np.nan)
    pressures = np.full((len(chosen), len(arm.inputs)), np.nan)
    for row, k in enumerate(chosen):
        rest = _hold(arm, reference.lengths[k], bounds)
        if rest is None:
            continue
        p, q = rest
        held[row] = nearest[row] = _tip(arm, q)
        if np.linalg.norm(held[row] - wanted[row]) > tolerance:
            p, nearest[row] = _approach(arm, p, q, wanted[row], bounds)
        pressures[row] = p
    names = tuple(_at_limit(arm, p, bounds) for p in pressures)
    needed = np.array([_needed(arm, reference, k) for k in chosen])
    return Reachability(arm, reference.time[chosen], wanted, held, nearest, pressures, names, needed, bounds, tolerance)


def warn_of_reach(arm: Arm, reference: Reference, limits: Limits | None) -> Reference:
    """The reference, with a :class:`bha.errors.ReferenceWarning` where a part of it is out of reach."""
    found = reachability(arm, reference, limits=limits)
    if not found.complete:
        warnings.warn(str(found), ReferenceWarning, stacklevel=4)
    return reference


def straight_height(arm: Arm, limits: Limits) -> float:
    """How far along the base's axis the tip of the straight arm is at the middle of its lengths, m."""
    return float(arm.parameters.base_pose.from_world(_tip(arm, limits.middle))[2])


def circle_around_base(arm: Arm, radius: float, height: float, angles: Floats) -> Floats:
    """Points of a circle around the base's axis, ``height`` along it, at ``angles`` (k,), rad: world, m, (k, 3)."""
    points = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full_like(angles, height)])
    return arm.parameters.base_pose.in_world(points)


def comfortable_radius(arm: Arm, height: float, limits: Limits) -> float:
    """Radius of a circle of the tip around the base's axis, at ``height`` along it, that keeps well within reach, m.

    It is 0.7 of the largest, and at most a fifth of the arm's height.

    Raises:
        InputError: no circle around the base's axis is within reach; the text says where the arm cannot go.
    """
    tolerance = _TOLERANCE * _height(arm, limits)
    most = _MOST_RADIUS * _height(arm, limits)
    angles = np.linspace(0, 2 * np.pi, _ANGLES, endpoint=False)
    trouble = ""

    def reached(radius: float) -> bool:
        nonlocal trouble
        tips = circle_around_base(arm, radius, height, angles)
        try:
            lengths = limits.resolved(arm, tips)
        except BhaError as error:
            trouble = str(error)
            return False
        for tip, q, angle in zip(tips, lengths, np.degrees(angles), strict=True):
            rest = _hold(arm, q, limits)
            off = np.inf if rest is None else float(np.linalg.norm(_tip(arm, rest[1]) - tip))
            if off > tolerance:
                trouble = (
                    f"at {angle:.0f} degrees around the axis, {_millimetres(tip)} mm, the arm rests {1e3 * off:.1f} mm "
                    "away under the pressures within pressure_range that hold it best"
                )
                return False
        return True

    smallest = 4 * tolerance
    if not reached(smallest):
        raise InputError(
            f"radius: {arm.name} reaches no circle of its tip around the base's axis at z = {1e3 * height:.0f} mm, not "
            f"even one of {1e3 * smallest:.0f} mm: {trouble}; choose another reference (a move, a line, a file), or "
            "give a radius"
        )
    low, high = smallest, most / _COMFORT
    if reached(high):
        low = high
    while high - low > 0.02 * high:
        radius = (low + high) / 2
        low, high = (radius, high) if reached(radius) else (low, radius)
    # Two digits: a radius that can be said and given again.
    return float(f"{_COMFORT * low:.1e}")


def _hold(arm: Arm, lengths: Floats, limits: Limits) -> tuple[Floats, Floats] | None:
    """Pressures within the limits that hold lengths best, and where the arm then rests; None if nowhere."""
    try:
        rest = limits.rest_near(arm, lengths)
    except BhaError:
        return None
    return rest.pressures, rest.lengths


def _needed(arm: Arm, reference: Reference, row: int) -> Floats:
    """Pressures that a row's motion needs, Pa absolute."""
    q = reference.lengths[row]
    force = arm.inverse_dynamics(q, reference.velocities[row], reference.accelerations[row])
    pressures = np.linalg.lstsq(arm.actuation_matrix(q), force, rcond=None)[0]
    return np.asarray(arm.parameters.ambient_pressure + pressures)


def _approach(arm: Arm, p: Floats, q: Floats, wanted: Floats, limits: Limits) -> tuple[Floats, Floats]:
    """Pressures within the limits whose rest has its tip nearest to ``wanted``, from (p, q) on, and that tip."""
    span = limits.high - limits.low
    tip, damping = _tip(arm, q), 1e-3
    for _ in range(_ITERATIONS):
        m = len(q)
        a, b = arm.linearize(q, np.zeros(m), p)
        by_length = np.column_stack([(_tip(arm, q + 1e-6 * e) - tip) / 1e-6 for e in np.eye(m)])
        slope = -by_length @ np.linalg.lstsq(a[m:, :m], b[m:], rcond=None)[0] * span
        free = np.ones(len(p), dtype=bool)
        pull = slope.T @ (wanted - tip)
        free[(p <= limits.low + 1e-9 * span) & (pull < 0)] = False
        free[(p >= limits.high - 1e-9 * span) & (pull > 0)] = False
        if not free.any():
            break
        part = slope[:, free]
        normal = part.T @ part
        step = np.zeros(len(p))
        step[free] = np.linalg.solve(normal + damping * np.trace(normal) * np.eye(len(normal)), pull[free])
        trial = np.clip(p + span * step, limits.low, limits.high)
        try:
            rest = arm.static_lengths(trial)
        except BhaError:
            damping *= 10
            continue
        moved = _tip(arm, rest)
        if np.linalg.norm(moved - wanted) < np.linalg.norm(tip - wanted):
            done = np.linalg.norm(moved - tip) < 1e-6
            p, q, tip, damping = trial, rest, moved, damping / 5
            if done:
                break
        else:
            damping *= 10
    return p, tip


def _at_limit(arm: Arm, p: Floats, limits: Limits) -> tuple[str, ...]:
    near = 1e-6 * (limits.high - limits.low)
    flags = (p <= limits.low + near) | (p >= limits.high - near)
    return tuple(name for name, flag in zip(arm.inputs, flags, strict=True) if flag)


def _tip(arm: Arm, lengths: Floats) -> Floats:
    return np.asarray(arm.forward_kinematics(lengths)[0][-1])


def _height(arm: Arm, limits: Limits) -> float:
    """Height of the straight arm at the middle of its lengths, m."""
    return abs(straight_height(arm, limits))


def _millimetres(point: Floats) -> str:
    return "(" + ", ".join(f"{1e3 * x:.0f}" for x in point) + ")"
