"""Prepare measured logs: what was measured, how noisy it is, where a sensor holds its last value or is frozen.

What: one :class:`Record` a log with the channels that a simulation can be compared with (bellows lengths, head
positions), the noise and the quantisation of every channel from the data itself, and the rows that may be used.
Source: noise from third differences (the second-order difference estimator of Gasser, Sroka and Jennen-Steinmetz 1986
taken one order higher): for white noise of variance s^2 the variance of ``y[k+3] - 3 y[k+2] + 3 y[k+1] - y[k]`` is 20
s^2, and a motion that is smooth over four samples leaves nothing in it.
Validity: sampling at some ten times the fastest motion or more; noise that is white over four samples (coloured noise
is dealt with in :mod:`bha.diagnose.noise`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.errors import InputError

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.log import Log

Array = NDArray[np.float64]

#: Variance of the third difference of white noise of variance one: 1 + 9 + 9 + 1.
THIRD_DIFFERENCE_VARIANCE = 20.0
#: Median of the square of a standard normal variable.
MEDIAN_SQUARE = 0.45493642311957283
#: Fewest different readings from which noise is estimated.
FEWEST_FRESH = 40
#: Least noise of an output that is assumed, as a share of what the outputs of its kind travel: no arm is described more
#: finely by sections of constant curvature, whatever the sensor resolves.
LEAST_NOISE_SHARE = 3e-4
#: An arm rests if no output travels by more than this share of what the outputs travel, within this time, s, under
#: pressures that have been constant for as long; sought in the first share of a log.
REST_TRAVEL, REST_TIME, REST_SHARE = 5e-3, 1.0, 0.5
#: Shortest time without change after which a channel that otherwise changes counts as frozen, s.
FROZEN_TIME = 1.0


@dataclass(frozen=True)
class ChannelFacts:
    """What is known of one channel of a log.

    Attributes:
        name: ``q11``, ``x2``, ``p13`` (see :mod:`bha.names`).
        unit: SI unit.
        noise: standard deviation of the sample-to-sample noise, in that unit.
        quantum: distance of neighbouring readings, 0 where they are not on a grid.
        held: share of rows in which the sensor repeats its last value.
        frozen: intervals ``(from, to)``, s, in which it does not change at all although it does elsewhere.
        repeat_noise: what the arm does otherwise each time, RMS over the channels of its kind, in that unit; 0 where no
            log repeats another.
    """

    name: str
    unit: str
    noise: float
    quantum: float
    held: float
    frozen: tuple[tuple[float, float], ...] = ()
    repeat_noise: float = 0.0


@dataclass(frozen=True)
class Record:
    """One log, ready for comparison with simulations.

    Attributes:
        name: file name, or a number where the log has no file.
        time: s, shape (m,), all rows of the log: the inputs are known there.
        pressures: Pa absolute, shape (m, inputs).
        forces: N, shape (m, n, 3), or None.
        rows: indices of the rows to compare, shape (k,).
        outputs: measured outputs at these rows, shape (k, channels), m.
        good: which of them count, shape (k, channels).
        channels: names of the outputs.
        facts: noise and flaws of the outputs.
        pressure_facts: noise and flaws of the inputs.
        thinning: every how many rows one is compared, after low-pass filtering.
        pressure_taps: the filter that the pressures went through, None for none; ``pressure_facts`` are from before.
    """

    name: str
    time: Array
    pressures: Array
    forces: Array | None
    rows: NDArray[np.intp]
    outputs: Array
    good: NDArray[np.bool_]
    channels: tuple[str, ...]
    facts: tuple[ChannelFacts, ...]
    pressure_facts: tuple[ChannelFacts, ...]
    thinning: int = 1
    pressure_taps: Array | None = None

    @property
    def output_time(self) -> Array:
        """Times of the compared rows, s, shape (k,)."""
        return np.asarray(self.time[self.rows])

    @property
    def sample_time(self) -> float:
        """Median distance of the compared rows, s."""
        return float(np.median(np.diff(self.output_time)))

    @property
    def noise(self) -> Array:
        """Noise of the outputs, m, shape (channels,)."""
        return np.array([fact.noise for fact in self.facts])

    @property
    def repeat_noise(self) -> Array:
        """What the arm does otherwise each time, m, shape (channels,)."""
        return np.array([fact.repeat_noise for fact in self.facts])

    @property
    def pressure_noise(self) -> Array:
        """Noise of the inputs, Pa, shape (inputs,)."""
        return np.array([fact.noise for fact in self.pressure_facts])

    def between(self, start: float, end: float) -> Record:
        """The part from ``start`` to ``end``, s."""
        keep = np.flatnonzero((self.time >= start) & (self.time <= end))
        if len(keep) == 0:
            raise InputError(f"{self.name}: no row between {start} and {end} s")
        first, last = int(keep[0]), int(keep[-1])
        inside = (self.rows >= first) & (self.rows <= last)
        return replace(
            self,
            time=self.time[first : last + 1],
            pressures=self.pressures[first : last + 1],
            forces=None if self.forces is None else self.forces[first : last + 1],
            rows=self.rows[inside] - first,
            outputs=self.outputs[inside],
            good=self.good[inside],
        )


def third_difference_noise(values: Array) -> float:
    """Standard deviation of the noise in ``values`` (m,), robust against motion and jumps in less than half of them."""
    if len(values) < 8:
        return 0.0
    differences = np.diff(values, 3)
    # Blocks that the motion dominates have large squares; the median over blocks of means ignores them.
    length = 25
    count = len(differences) // length
    if count < 4:
        return float(np.sqrt(np.median(differences**2) / MEDIAN_SQUARE / THIRD_DIFFERENCE_VARIANCE))
    means = np.mean(differences[: count * length].reshape(count, length) ** 2, axis=1)
    # The lower half of the blocks, corrected by the part of their distribution that lies there, says which blocks are
    # quiet.
    quiet = float(np.median(np.sort(means)[: max(2, count // 2)])) / lower_half_share()
    return float(np.sqrt(np.mean(means[means < 2.5 * quiet]) / THIRD_DIFFERENCE_VARIANCE)) if quiet > 0.0 else 0.0


@cache
def lower_half_share() -> float:
    """Median of the lower half of block means for pure noise, over their expectation; by a fixed random draw."""
    noise = np.random.default_rng(0).standard_normal(25 * 4000 + 3)
    means = np.mean((np.diff(noise, 3) ** 2 / THIRD_DIFFERENCE_VARIANCE)[: 25 * 4000].reshape(4000, 25), axis=1)
    return float(np.median(np.sort(means)[:2000]))


def quantum(values: Array) -> float:
    """Distance of the grid on which all ``values`` lie; 0 if none is coarser than a thousandth of their spread."""
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


def runs(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Starts and lengths of the runs of equal values."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0]))
    return starts, np.diff(np.append(starts, len(values)))


def frozen_intervals(time: Array, values: Array) -> tuple[tuple[float, float], ...]:
    """Intervals without any change that are far longer than is usual for this channel.

    A channel that is constant most of the time (a command in steps, a tank at rest) has none.
    """
    starts, lengths = runs(values)
    if len(starts) < 20:
        return ()
    usual = float(np.quantile(lengths, 0.9))
    found = []
    for k in np.flatnonzero(lengths > max(20.0, 10.0 * usual)):
        start, end = starts[k], min(starts[k] + lengths[k], len(time) - 1)
        if time[end] - time[start] > FROZEN_TIME:
            found.append((float(time[start]), float(time[end])))
    # A command repeats itself for most of the time; a sensor that freezes does so once or twice.
    return tuple(found) if 0 < len(found) <= 4 else ()


def held_share(values: Array, noise: float, step: float) -> float:
    """Share of samples that repeat the one before, beyond what quantised noise repeats by chance."""
    if len(values) < 2:
        return 0.0
    repeats = float(np.mean(np.diff(values) == 0.0))
    # Two readings on a grid of `step` agree by chance with about step / (2 sqrt(pi) noise).
    chance = min(1.0, step / (2.0 * np.sqrt(np.pi) * noise)) if noise > 0.0 else 1.0
    return repeats if step == 0.0 or repeats > 2.0 * chance + 0.1 else 0.0


def channel_facts(time: Array, name: str, unit: str, values: Array) -> ChannelFacts:
    """Noise, quantisation, sample-and-hold and frozen intervals of one channel."""
    frozen = frozen_intervals(time, values)
    live = np.ones(len(time), dtype=np.bool_)
    for start, end in frozen:
        live &= (time < start) | (time >= end)
    # In a held channel only the fresh values carry noise.
    part = values[live]
    fresh = part[np.concatenate([[True], np.diff(part) != 0.0])] if len(part) else part
    step = quantum(part)
    share = held_share(part, third_difference_noise(fresh), step)
    # A channel that hardly ever changes is a command, and its few jumps are no noise.
    noise = third_difference_noise(fresh if share > 0.0 else part) if len(fresh) >= FEWEST_FRESH else 0.0
    return ChannelFacts(name, unit, noise, step, share, frozen)


def prepare(arm: Arm, log: Log, *, commanded: bool = False, name: str | None = None) -> Record:
    """A :class:`Record` of a log.

    Args:
        arm: the arm; its inputs and sections say which columns are needed.
        log: the log.
        commanded: take the commanded pressures instead of the measured ones.
        name: what reports call it; the file name if None.

    Raises:
        LogError: a pressure of the arm is not in the log.
        InputError: the log has neither lengths nor head positions, or fewer than 50 rows.
    """
    origin = name or (log.path.name if log.path is not None else "log")
    if len(log.time) < 50:
        raise InputError(f"{origin}: {len(log.time)} rows; at least 50 are needed for a diagnosis")
    channels, columns = measured_outputs(arm, log)
    if not channels:
        raise InputError(
            f"{origin}: neither bellows lengths (q11 ...) nor head positions (x1 y1 z1 ...) of the arm were measured; "
            "a diagnosis needs one of them"
        )
    pressures = np.array(log.pressures(arm.inputs, commanded=commanded))
    outputs = np.column_stack(columns)
    facts = tuple(channel_facts(log.time, c, "m", outputs[:, k]) for k, c in enumerate(channels))
    pressure_facts = tuple(channel_facts(log.time, c, "Pa", pressures[:, k]) for k, c in enumerate(arm.inputs))
    rows = _fresh_rows(log.time, outputs, facts)
    good = np.ones((len(rows), len(channels)), dtype=np.bool_)
    for k, fact in enumerate(facts):
        for start, end in fact.frozen:
            good[(log.time[rows] > start) & (log.time[rows] <= end), k] = False
    for fact in pressure_facts:
        for start, end in fact.frozen:
            # What the arm did meanwhile is not known, and it takes a while to forget it.
            good[(log.time[rows] > start) & (log.time[rows] <= end + 1.0)] = False
    forces = log.forces
    if forces is not None and forces.shape[1] < arm.section_count:
        whole = np.zeros((len(forces), arm.section_count, 3))
        whole[:, : forces.shape[1]] = forces
        forces = whole
    return Record(
        name=origin,
        time=np.array(log.time),
        pressures=pressures,
        forces=None if forces is None or not np.any(forces) else np.array(forces),
        rows=rows,
        outputs=outputs[rows],
        good=good,
        channels=tuple(channels),
        facts=facts,
        pressure_facts=pressure_facts,
    )


def from_rest(record: Record) -> Record:
    """The record from where the arm first rests under its pressures; as it is if it does so at once, or never.

    For commanded pressures: what the chambers hold when a log begins is not known, unless the arm has come to rest.
    """
    time, outputs = record.output_time, record.outputs
    least = np.maximum(
        REST_TRAVEL * np.ptp(np.quantile(outputs, [0.02, 0.98], axis=0), axis=0).max(), 6.0 * record.noise
    )
    constant_since = time[0]
    changes = iter(record.time[1:][np.any(np.diff(record.pressures, axis=0) != 0.0, axis=1)])
    change = next(changes, np.inf)
    for row, now in enumerate(time):
        while change <= now:
            constant_since, change = change, next(changes, np.inf)
        end = int(np.searchsorted(time, now + REST_TIME))
        if end >= len(time) or now > time[0] + REST_SHARE * (time[-1] - time[0]):
            break
        # A command that has just come shows in the arm only later.
        rested = row == 0 or now - constant_since >= REST_TIME
        if rested and change > time[end] and np.all(np.ptp(outputs[row:end], axis=0) <= least):
            return record if row == 0 else record.between(float(now), float(record.time[-1]))
    return record


def measured_outputs(arm: Arm, log: Log) -> tuple[list[str], list[Array]]:
    """Names and values of the measured lengths and head positions of the arm."""
    channels: list[str] = []
    columns: list[Array] = []
    lengths, heads = log.lengths, log.head_positions
    for section in range(1, arm.section_count + 1):
        if lengths is not None and lengths.shape[1] >= 3 * section:
            for number in (1, 2, 3):
                values = lengths[:, 3 * (section - 1) + number - 1]
                if np.all(np.isfinite(values)):
                    channels.append(names.length_name(section, number))
                    columns.append(values)
    for section in range(1, arm.section_count + 1):
        if heads is not None and heads.shape[1] >= section:
            for axis, name in enumerate(names.position_names(section)):
                values = heads[:, section - 1, axis]
                if np.all(np.isfinite(values)):
                    channels.append(name)
                    columns.append(values)
    return channels, columns


def _fresh_rows(time: Array, outputs: Array, facts: Sequence[ChannelFacts]) -> NDArray[np.intp]:
    """Rows in which a sensor that holds its values has a new one; all rows where none does. Equal times count once."""
    held = [k for k, fact in enumerate(facts) if fact.held > 0.2]
    keep = np.concatenate([[True], np.diff(time) > 0.0])
    if held and len(held) == len(facts):
        keep &= np.concatenate([[True], np.any(np.diff(outputs[:, held], axis=0) != 0.0, axis=1)])
    return np.flatnonzero(keep)


def with_least_noise(records: Sequence[Record]) -> list[Record]:
    """The records with no output's noise below ``LEAST_NOISE_SHARE`` of the travel of its kind (lengths, positions)."""
    travel = {True: 0.0, False: 0.0}
    for record in records:
        spans = np.ptp(np.quantile(record.outputs, [0.02, 0.98], axis=0), axis=0)
        for channel, span in zip(record.channels, spans, strict=True):
            kind = channel.startswith("q")
            travel[kind] = max(travel[kind], float(span))
    least = {kind: LEAST_NOISE_SHARE * value for kind, value in travel.items()}
    return [
        replace(r, facts=tuple(replace(f, noise=max(f.noise, least[f.name.startswith("q")])) for f in r.facts))
        for r in records
    ]


def split(records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """Training and held-out records if the user names none: the last third of the logs, or of the only log's time."""
    if len(records) > 1:
        held = max(1, len(records) // 3)
        return list(records[:-held]), list(records[-held:])
    only = records[0]
    start, end = float(only.time[0]), float(only.time[-1])
    cut = start + (end - start) * 2.0 / 3.0
    first, last = only.between(start, cut), only.between(cut, end)
    return [replace(first, name=f"{only.name} (first two thirds)")], [replace(last, name=f"{only.name} (last third)")]
