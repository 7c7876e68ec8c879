"""Usable stretches of logs, found in the logs themselves: steady states, and swings after a lost contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.estimation.records import Record
from bha.support.shown import short_repr
from bha.support.spans import spans_of

Array = NDArray[np.float64]

#: Mean square distance from the middle, in sensor noises, below which an arm is at rest, and over how long to either
#: side, s.
_QUIET, _QUIET_SECONDS = 2.0, 0.06


@dataclass(frozen=True)
class Stretch:
    """Rows ``first`` to ``last`` (exclusive) of a record.

    Attributes:
        record: name of the record.
        first: first row.
        last: row after the last one.
        start: time of the first row, s.
        end: time of the last row, s.
    """

    record: str
    first: int
    last: int
    start: float
    end: float


@short_repr
@dataclass(frozen=True)
class SteadyState:
    """Means over a stretch in which nothing moved.

    Attributes:
        stretch: where.
        pressures: of each input, Pa absolute, shape (inputs,).
        channels: of each channel of the record, m, shape (C,).
        forces: external force at each section's centre of mass, N, shape (n, 3), zero where none was logged.
        drift: largest change of a channel over the stretch, m (creep, mostly).
    """

    stretch: Stretch
    pressures: Array
    channels: Array
    forces: Array
    drift: float


def stretch_of(rec: Record, first: int, last: int) -> Stretch:
    """The rows ``first`` to ``last`` (exclusive) of a record."""
    return Stretch(rec.name, first, last, float(rec.time[first]), float(rec.time[last - 1]))


def stretch_between(rec: Record, start: float, end: float) -> Stretch:
    """The rows of a record after ``start`` s and up to ``end`` s.

    Raises:
        InputError: there are none.
    """
    first, last = (int(np.searchsorted(rec.time, time, side="right")) for time in (start, end))
    if first >= last:
        raise InputError(
            f"{rec.name}: no row between {start:g} and {end:g} s; it lasts from {rec.time[0]:g} to {rec.time[-1]:g} s"
        )
    return stretch_of(rec, first, last)


def steady_state(arm: Arm, rec: Record, stretch: Stretch) -> SteadyState:
    """Means of a record over a stretch; NaN for a channel of which no row counts."""
    rows = slice(stretch.first, stretch.last)
    drive = rec.drive
    pressures = np.array([np.interp(rec.time[rows], drive.time, p).mean() for p in drive.pressures.T])
    table, usable = rec.measured[rows], rec.usable[rows]
    tenth = max(1, len(table) // 10)
    drift = _means(table[-tenth:], usable[-tenth:]) - _means(table[:tenth], usable[:tenth])
    size = float(np.nanmax(np.abs(drift))) if np.isfinite(drift).any() else float("nan")
    return SteadyState(stretch, pressures, _means(table, usable), _mean_forces(arm, rec, stretch), size)


def steady_states(
    arm: Arm,
    rec: Record,
    *,
    shortest: float = 0.5,
    speed: float = 2e-3,
    pressure_speed: float = 2e3,
) -> list[SteadyState]:
    """Steady states of a record: stretches in which neither pressures nor channels change faster than a limit.

    Args:
        arm: says how many sections there are.
        rec: the record.
        shortest: shortest stretch, s.
        speed: fastest change of a channel that still is steady, m/s; sensor noise is allowed for.
        pressure_speed: fastest change of a pressure, Pa/s.
    """
    span = shortest / 2.0
    pressures = np.column_stack([np.interp(rec.time, rec.drive.time, p) for p in rec.drive.pressures.T])
    measured, still = _between_readings(rec, span)
    for table, limit, noise in ((measured, speed, rec.noise), (pressures, pressure_speed, rec.pressure_noise)):
        slope, error = _slopes(rec.time, table, span, noise)
        still &= np.all(np.abs(slope) <= limit + 3.0 * error, axis=1)
    found = []
    for first, last in spans_of(still):
        if rec.time[last - 1] - rec.time[first] >= shortest:
            found.append(steady_state(arm, rec, stretch_of(rec, first, last)))
    return found


def swings(rec: Record, *, shortest: float = 1.0, pressure_change: float = 3e3, smallest: float = 6.0) -> list[Stretch]:
    """Free swings of a record: the arm oscillates and dies out while pressures and external forces stay the same.

    Args:
        rec: the record.
        shortest: shortest swing, s.
        pressure_change: largest change of a pressure within a swing, Pa; sensor noise is allowed for.
        smallest: smallest first amplitude, in sensor noises.
    """
    forces = rec.drive.forces
    quiet = np.ones(len(rec), dtype=bool)
    pressures = np.column_stack([np.interp(rec.time, rec.drive.time, p) for p in rec.drive.pressures.T])
    if forces is not None:
        flat = forces.reshape(len(forces), -1)
        at_rows = np.column_stack([np.interp(rec.time, rec.drive.time, f) for f in flat.T])
        quiet &= np.all(np.abs(at_rows) < 0.02 * max(float(np.abs(flat).max()), 1e-9), axis=1)
    slope, error = _slopes(rec.time, pressures, 0.1, rec.pressure_noise)
    quiet &= np.all(np.abs(slope) <= 5.0 * pressure_change + 4.0 * error, axis=1)
    found = []
    for first, last in spans_of(quiet):
        span = slice(first, last)
        if rec.time[last - 1] - rec.time[first] < shortest:
            continue
        if np.any(np.ptp(pressures[span], axis=0) > pressure_change + 10.0 * rec.pressure_noise):
            continue
        begin = first + _release(rec, first, last)
        if rec.time[last - 1] - rec.time[begin] < shortest:
            continue
        # What follows long after the swing is noise and creep, and would hide that it died out.
        end = max(_last_motion(rec, begin, last), int(np.searchsorted(rec.time, rec.time[begin] + shortest)) + 1)
        end = min(end, last)
        amplitude = np.nanmax(np.abs(rec.measured[begin:end] - _middle(rec, begin, last)), axis=0)
        if np.any(amplitude > smallest * rec.noise) and _dies_out(rec, begin, end):
            found.append(stretch_of(rec, begin, end))
    return found


def _middle(rec: Record, first: int, last: int) -> Array:
    """What the channels swing about: their medians over the last half."""
    return np.asarray(np.nanmedian(rec.measured[(first + last) // 2 : last], axis=0))


def _last_motion(rec: Record, first: int, last: int) -> int:
    """The row after which the channels stay within their noise."""
    away = ((rec.measured[first:last] - _middle(rec, first, last)) / rec.noise) ** 2
    total = np.concatenate([[0.0], np.cumsum(np.nanmean(away, axis=1))])
    time = rec.time[first:last]
    low, high = (np.searchsorted(time, time + d) for d in (-_QUIET_SECONDS, _QUIET_SECONDS))
    moving = np.flatnonzero((total[high] - total[low]) > _QUIET * (high - low))
    return first + (int(moving[-1]) + 1 if len(moving) else 0)


def _release(rec: Record, first: int, last: int) -> int:
    """Rows from ``first`` to where the swing begins: the largest speed of any channel."""
    speed, _ = _slopes(rec.time[first:last], rec.measured[first:last], 0.03, rec.noise)
    total = np.sum((speed / rec.noise) ** 2, axis=1)
    return int(np.argmax(total > 0.5 * total.max()))


def _dies_out(rec: Record, first: int, last: int) -> bool:
    """Whether the motion of the last third is smaller than that of the first third."""
    third = (last - first) // 3
    if third < 4:
        return False
    early = np.nanstd(rec.measured[first : first + third], axis=0) / rec.noise
    late = np.nanstd(rec.measured[last - third : last], axis=0) / rec.noise
    return bool(np.linalg.norm(late) < 0.7 * np.linalg.norm(early))


def _slopes(time: Array, table: Array, span: float, noise: Array) -> tuple[Array, Array]:
    """Slope of each channel at each row over ``span`` s to either side, and its standard error from noise."""
    sums = [np.concatenate([np.zeros((1, table.shape[1])), np.cumsum(np.nan_to_num(table), axis=0)])]
    sums.append(
        np.concatenate([np.zeros((1, table.shape[1])), np.cumsum(np.nan_to_num(table) * time[:, None], axis=0)])
    )
    t1 = np.concatenate([[0.0], np.cumsum(time)])
    t2 = np.concatenate([[0.0], np.cumsum(time**2)])
    low = np.searchsorted(time, time - span)
    high = np.searchsorted(time, time + span, side="right")
    count = np.maximum(high - low, 1).astype(float)
    mean_t = (t1[high] - t1[low]) / count
    spread = np.maximum((t2[high] - t2[low]) - count * mean_t**2, 1e-12)
    mean_y = (sums[0][high] - sums[0][low]) / count[:, None]
    mixed = (sums[1][high] - sums[1][low]) - count[:, None] * mean_t[:, None] * mean_y
    return mixed / spread[:, None], noise[None, :] / np.sqrt(spread)[:, None]


def _between_readings(rec: Record, longest: float) -> tuple[Array, NDArray[np.bool_]]:
    """Measurements with straight lines between those that count, and the rows not in a gap longer than ``longest`` s.

    Channels that renew seldom have readings in some rows only: what lies between them is no motion.
    """
    measured, covered = rec.measured.copy(), np.ones(len(rec), dtype=np.bool_)
    for c, good in enumerate(rec.usable.T):
        places = np.flatnonzero(good)
        if not len(places):
            return measured, np.zeros_like(covered)
        times = rec.time[places]
        measured[:, c] = np.interp(rec.time, times, rec.measured[places, c])
        before = np.clip(np.searchsorted(times, rec.time, side="right") - 1, 0, len(times) - 1)
        after = np.clip(np.searchsorted(times, rec.time), 0, len(times) - 1)
        covered &= (times[after] - times[before] <= longest) & (rec.time >= times[0]) & (rec.time <= times[-1])
    return measured, covered


def _means(table: Array, usable: NDArray[np.bool_]) -> Array:
    """Mean of each column over the rows that count; NaN where none does."""
    count = usable.sum(axis=0)
    total = np.where(usable, table, 0.0).sum(axis=0)
    return np.asarray(np.divide(total, count, out=np.full(table.shape[1], np.nan), where=count > 0))


def _mean_forces(arm: Arm, rec: Record, stretch: Stretch) -> Array:
    forces = rec.drive.forces
    if forces is None:
        return np.zeros((arm.section_count, 3))
    inside = (rec.drive.time >= stretch.start) & (rec.drive.time <= stretch.end)
    return np.asarray(np.mean(forces.reshape(len(forces), -1, 3)[inside], axis=0))
