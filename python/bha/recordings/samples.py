"""What the samples of one channel are worth: fresh, held, frozen, dropped out, spike.

A sensor that renews more slowly than the log holds its last value: the repeats are no measurements. One that stops for
a while (a marker lost, a bus that hangs) holds it too, for far longer than it usually does: a dropout. One that jumps
away and comes back within a few rows shows something else than the arm (a marker taken for another): a spike.

Which repeats come from holding and which from a coarse grid is told by the large changes: a value that has moved by
many grid steps has done so in one row only if the rows before were held.
Limits: spikes of at most three readings, small ones of one; of channels so coarse that they stand still whenever the
arm does, dropouts of dense readings alone, and only such as end in a jump.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bha.recordings.filled import filled_in
from bha.recordings.noise import quantum, white_noise
from bha.recordings.ticks import ticks

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Span = tuple[float, float]

#: Fewest fresh readings from which noise is estimated.
FEWEST_FRESH = 40
#: Chance, over a whole log, that noise repeats itself to the last digit as often as what is called a dropout.
REPEAT_CHANCE = 1e-6
#: A reading that is held is held this many times longer than usual, and this long, s, to be a dropout.
DROPOUT_TIMES, DROPOUT_SECONDS = 5.0, 0.1
#: A channel whose grid is this many times its noise stands still whenever what it measures does: nothing is told then.
COARSE = 2.0
#: So does one without noise (a simulated or filtered one): less than this share of what it travels.
QUIET = 1e-6
#: Readings that a spike lasts at the most, and how many typical changes (and noises) it jumps, both ways.
SPIKE_READINGS, SPIKE_CHANGES, SPIKE_NOISES = 3, 8.0, 12.0
#: Least spike as a share of all that the channel travels: a smaller one does no harm.
SPIKE_TRAVEL = 0.05
#: Of a channel that renews at least every so many seconds a single reading that comes home again is a spike already if
#: the cubic through its four neighbours misses it by this many of the typical misses nearby and this many noises.
LONE_INTERVAL, LONE_MISSES, LONE_NOISES = 0.025, 12.0, 12.0
#: Share of the readings nearby that must be left without those that several such readings touch.
LONE_LEFT = 0.25
#: Share of the log that may be spikes; more is no spike but how the channel is.
MOST_SPIKES = 0.02
#: A sensor that holds its reading does so for no longer than this, usually, s.
LONGEST_HOLD = 0.25
#: A coarse channel that has stopped goes on with so many steps of its grid at once, so many times what comes in one of
#: the rows after.
JUMP_STEPS, JUMP_TIMES, _AFTER = 3, 1.9, 5
#: The same of readings as far apart as those of a camera, s: between two of them no chamber fills.
CAMERA_INTERVAL, CAMERA_JUMP_TIMES = 0.04, 3.8
#: Fewest changes from which holding is told, and share of the largest changes that are looked at.
_FEWEST_CHANGES, _LARGEST = 10, 0.3


@dataclass(frozen=True)
class ChannelFacts:
    """What is known of one channel of a log.

    Attributes:
        name: ``q11``, ``x2``, ``p13``, or that of a wire.
        unit: SI unit, empty for plain numbers.
        noise: standard deviation of the noise from reading to reading, in that unit; 0 where the channel does not tell.
        quantum: distance of neighbouring readings, 0 where they are not on a grid.
        held: share of rows in which the sensor repeats its last reading, or that are filled in between two.
        interval: usual time between two readings, s.
        frozen: spans ``(from, to)``, s, in which it stands still although what it measures does not.
        dropouts: spans, s, in which its last reading is held far longer than usual.
        spikes: times, s, of readings that jump away and come back.
        missing: share of rows without a value where one was due: between readings further apart than usual.
        repeat_noise: what the arm does otherwise each time, RMS over the channels of its kind, in that unit; 0 where no
            log repeats another.
        filled: whether rows between readings were filled in by straight lines.
        curved: whether a curve through readings, one a row, tells left-out ones better than straight lines (pressures).
    """

    name: str
    unit: str
    noise: float
    quantum: float
    held: float
    interval: float = 0.0
    frozen: tuple[Span, ...] = ()
    dropouts: tuple[Span, ...] = ()
    spikes: tuple[float, ...] = ()
    missing: float = 0.0
    repeat_noise: float = 0.0
    filled: bool = False
    curved: bool = False


def changes(values: Array) -> Mask:
    """Rows whose value differs from that of the row before; the first row too."""
    return np.concatenate([[True], np.diff(values) != 0.0])


def is_held(time: Array, fresh: NDArray[np.intp], values: Array, step: float) -> bool:
    """Whether repeats come from a sensor that renews more slowly than the log, and not from a coarse grid.

    Args:
        time: of the rows, s, shape (m,).
        fresh: rows in which the value changes.
        values: all values, shape (m,).
        step: of the grid on which they lie, 0 if they lie on none.
    """
    if len(fresh) < _FEWEST_CHANGES or len(fresh) > 0.9 * len(values):
        return False
    jumps = np.abs(np.diff(values[fresh]))
    before = np.diff(fresh)
    large = np.argsort(jumps)[-max(_FEWEST_CHANGES, int(_LARGEST * len(jumps))) :]
    # A slow motion over a coarse grid changes evenly too, but by one step at a time.
    if step > 0.0 and float(np.median(jumps[large])) < 2.5 * step:
        return False
    # How long the reading had been held before each large change: a sensor that holds renews after several rows, and
    # soon. What stands still for longer and then jumps is a pressure in steps.
    waits, rows = np.diff(time[fresh])[large], before[large]
    usual = float(np.median(waits))
    soon = usual <= LONGEST_HOLD and float(np.quantile(waits, 0.95)) <= 3.0 * usual + float(np.median(np.diff(time)))
    return bool(soon and np.quantile(rows, 0.25) >= 2)


def _missed(time: Array, present: Mask) -> float:
    """The share of rows in which a reading is missing, not just not due: a channel may be read less often than others.

    Due is one where the readings before and after are more than one and a half times as far apart as usual.
    """
    at = time[present]
    between = np.diff(at)
    due = 1.5 * float(np.median(between))
    before = np.clip(np.searchsorted(at, time, "right") - 1, 0, len(at) - 2)
    apart = np.maximum(between[before], np.maximum(at[0] - time, time - at[-1]))
    return float(np.mean(~present & (apart > due)))


def judge(time: Array, name: str, unit: str, values: Array, *, measured: bool = True) -> tuple[ChannelFacts, Mask]:
    """Facts of one channel and which rows hold a reading that counts, shape (m,).

    Args:
        time: of the rows, s, shape (m,).
        name: of the channel.
        unit: its SI unit.
        values: shape (m,); NaN where missing.
        measured: whether it was measured; what is commanded may stand still as long as it likes.
    """
    present = np.isfinite(values)
    rows = np.flatnonzero(present)
    if len(rows) < 2:
        return ChannelFacts(name, unit, 0.0, 0.0, 0.0, missing=float(np.mean(~present))), present
    given, at = values[rows], time[rows]
    new = changes(given)
    fresh = np.flatnonzero(new)
    step = quantum(given[fresh])
    renewed = ticks(at, fresh, given, step) if measured else None
    if renewed is not None:
        # From here on the channel is what it is at its own clock.
        rows, given, at = rows[renewed], given[renewed], at[renewed]
        fresh = np.flatnonzero(changes(given))
    held = measured and renewed is None and is_held(at, fresh, given, step)
    readings = fresh if held else np.arange(len(given))
    chords = filled_in(at, given, step) if measured and renewed is None and not held else None
    if chords is not None:
        readings = chords
    dropped: list[tuple[int, int]] = []
    if measured and chords is None:
        coarse = not held and unit != "Pa" and white_noise(given) < step / COARSE
        dropped = _stopped(at, given, fresh, step) if coarse else _dropouts(at, given, fresh, held=held, step=step)
    lost = np.zeros(len(given), dtype=np.bool_)
    for first, last in dropped:
        lost[first:last] = True
    held_share = 1.0 - len(readings) / int(np.sum(present))
    readings = readings[~lost[readings]]
    noise = white_noise(given[readings]) if len(readings) >= FEWEST_FRESH else 0.0
    spikes = np.empty(0, dtype=np.intp)
    if measured:
        least = max(noise, step / np.sqrt(12.0))
        spikes = _spikes(given[readings], least)
        if unit != "Pa":
            # What has mass has no kinks; a valve makes them.
            spikes = np.union1d(spikes, _lone_spikes(at[readings], given[readings], least))
    spike_rows = readings[spikes]
    good = np.zeros(len(given), dtype=np.bool_)
    good[readings] = True
    good[spike_rows] = False
    if len(spikes) and len(readings) - len(spikes) >= FEWEST_FRESH:
        noise = white_noise(np.delete(given[readings], spikes))
    if not measured and len(fresh) < 0.5 * len(given):
        noise = 0.0  # the few jumps of a command in steps are no noise
    usable = np.zeros(len(values), dtype=np.bool_)
    usable[rows[good]] = True
    facts = ChannelFacts(
        name=name,
        unit=unit,
        noise=noise,
        quantum=step,
        held=held_share,
        interval=_usual_wait(at[readings], ticking=renewed is not None),
        dropouts=tuple((float(at[a]), float(at[min(b, len(at) - 1)])) for a, b in dropped),
        spikes=tuple(float(t) for t in at[spike_rows]),
        missing=_missed(time, present),
        filled=chords is not None,
    )
    return facts, usable


def _usual_wait(time: Array, *, ticking: bool) -> float:
    """The usual time between two readings, s; 0 for less than two.

    The median, and of a clock the mean of those about it: a camera of 30 Hz in rows of 200 Hz waits for six rows or
    for seven.
    """
    waits = np.diff(time)
    if not len(waits):
        return 0.0
    middle = float(np.median(waits))
    return float(np.mean(waits[np.abs(waits - middle) <= 0.5 * middle])) if ticking else middle


def with_frozen(facts: ChannelFacts, frozen: tuple[Span, ...]) -> ChannelFacts:
    """The facts with spans in which the channel is frozen; a dropout within one is part of it."""
    outside = [d for d in facts.dropouts if not any(a <= d[0] and d[1] <= b for a, b in frozen)]
    return replace(facts, frozen=frozen, dropouts=tuple(outside))


def standstills(time: Array, table: Array, longer_than: float) -> list[tuple[int, int]]:
    """Runs of rows ``(first, last)`` in which no column of ``table`` (m, k) changes, longer than some seconds."""
    moved = np.any(np.diff(table, axis=0) != 0.0, axis=1)
    edges = np.concatenate([[0], np.flatnonzero(moved) + 1, [len(time)]])
    return [(int(a), int(b)) for a, b in pairwise(edges) if time[b - 1] - time[a] > longer_than]


def _dropouts(time: Array, values: Array, fresh: NDArray[np.intp], *, held: bool, step: float) -> list[tuple[int, int]]:
    """Rows ``(first, last)`` of repeats that go on for far longer than the channel usually repeats itself.

    The first repeat counts, the reading that is held does not.
    """
    noise = white_noise(values[fresh])
    if len(fresh) < _FEWEST_CHANGES or noise < max(step / COARSE, QUIET * float(np.ptp(values))):
        return []
    ends = np.append(fresh[1:], len(values))
    lengths = ends - fresh
    spans = time[np.minimum(ends, len(time) - 1)] - time[fresh]
    if held:
        usual = float(np.quantile(lengths, 0.9))
        suspect = (lengths > DROPOUT_TIMES * usual) & (spans > DROPOUT_SECONDS)
    else:
        usual = float(np.median(lengths))
        repeats = _chance_of_repeat(lengths)
        needed = np.log(REPEAT_CHANCE / len(values)) / np.log(repeats) if repeats > 0.0 else 2.0
        suspect = (lengths - 1 > max(needed, DROPOUT_TIMES * usual)) & (spans > DROPOUT_SECONDS)
    # A channel that does so again and again is one that changes when it likes.
    found = np.flatnonzero(suspect)
    if np.sum(lengths[found]) > 0.5 * len(values):
        return []
    return [(int(fresh[k]) + 1, int(ends[k])) for k in found]


def _stopped(time: Array, values: Array, fresh: NDArray[np.intp], step: float) -> list[tuple[int, int]]:
    """Rows ``(first, last)`` of standstills of a coarse channel that end in a jump after which it goes on as slowly.

    What has mass sets out by one step of a grid after the other, where readings are dense.
    """
    interval = float(np.median(np.diff(time)))
    if step <= 0.0 or len(fresh) < _FEWEST_CHANGES or interval > CAMERA_INTERVAL:
        return []
    times = JUMP_TIMES if interval <= LONE_INTERVAL else CAMERA_JUMP_TIMES
    size = np.append(np.abs(np.diff(values)), np.zeros(_AFTER))
    found = []
    for begin, end in pairwise(fresh):
        jump, goes_on = size[end - 1], float(np.max(size[end : end + _AFTER]))
        stood = time[end] - time[begin] > DROPOUT_SECONDS
        if stood and jump > (JUMP_STEPS - 0.5) * step and jump > times * goes_on:
            found.append((int(begin) + 1, int(end)))
    return found


def _chance_of_repeat(lengths: NDArray[np.intp]) -> float:
    """Share of readings that repeat the one before by chance; the longest runs, which may be dropouts, left out."""
    kept = lengths[lengths <= max(2.0, 20.0 * float(np.median(lengths)))]
    return float(1.0 - len(kept) / np.sum(kept)) if np.sum(kept) > 0 else 0.0


def _spikes(values: Array, noise: float) -> NDArray[np.intp]:
    """Places of readings that jump away and come back within a few readings."""
    count = len(values)
    if count < 4 * SPIKE_READINGS + 8:
        return np.empty(0, dtype=np.intp)
    step = np.abs(np.diff(values))
    # The typical change nearby: medians over blocks, the greater one of neighbours, so that fast motion is no spike.
    size = 20
    blocks = -(-count // size)
    padded = np.full(blocks * size, step[-1])
    padded[: count - 1] = step
    typical = np.quantile(padded.reshape(blocks, size), 0.75, axis=1)
    travel = float(np.subtract(*np.quantile(values, [0.98, 0.02])))
    floor = max(SPIKE_NOISES * noise, SPIKE_TRAVEL * travel)
    least = np.maximum(SPIKE_CHANGES * _greatest_nearby(typical, size)[:count], floor)
    found = np.zeros(count, dtype=np.bool_)
    signed = np.diff(values)
    for k in np.flatnonzero(step > least[:-1]):
        for length in range(1, SPIKE_READINGS + 1):
            back = k + length
            if back >= count - 1:
                break
            away, home = signed[k], values[back + 1] - values[k]
            inside = values[k + 1 : back + 1] - values[k]
            # All readings in between are away, and the one after is home again.
            if np.all(np.abs(inside) > least[k]) and np.all(inside * away > 0.0) and abs(home) < 0.3 * abs(away):
                found[k + 1 : back + 1] = True
                break
    return np.flatnonzero(found) if np.mean(found) <= MOST_SPIKES else np.empty(0, dtype=np.intp)


def _lone_spikes(time: Array, values: Array, noise: float) -> NDArray[np.intp]:
    """Places of single readings that lie off their neighbours, which go on as if nothing had been.

    No arm is away and home again from one reading to the next but one, where readings are dense; in slow logs a single
    overshoot may be one.
    """
    count = len(values)
    if count < FEWEST_FRESH or float(np.median(np.diff(time))) > LONE_INTERVAL:
        return np.empty(0, dtype=np.intp)
    # The cubic through the two before and the two after; of white noise it misses by sqrt(70) / 6 standard deviations.
    missed = np.zeros(count)
    missed[2:-2] = values[2:-2] - (4.0 * (values[1:-3] + values[3:-1]) - values[:-4] - values[4:]) / 6.0
    size = np.abs(missed)
    floor = LONE_NOISES * np.sqrt(70.0) / 6.0 * noise
    if noise <= 0.0 or not np.any(size > floor):
        return np.empty(0, dtype=np.intp)
    step = np.diff(values)
    inner = np.flatnonzero(size > floor)
    # Home again: from the reading before to the one after it goes on as it did and does.
    going_on = step[inner - 2] + step[inner + 1]
    inner = inner[np.abs(values[inner + 1] - values[inner - 1] - going_on) < 0.4 * size[inner]]
    # Between its neighbours lies what an arm that sets out does; what travels all along goes on as fast.
    beyond = np.minimum(np.abs(step[inner - 1]), np.abs(step[inner])) > 0.25 * size[inner]
    as_fast = np.abs(step[inner + 1] - step[inner - 2]) < 2.0 * size[inner]
    inner = inner[as_fast | (beyond & (step[inner - 1] * step[inner] < 0.0))]
    places = inner[size[inner] > LONE_MISSES * _typical_nearby(size, inner)[inner]]
    return places if len(places) <= MOST_SPIKES * count else np.empty(0, dtype=np.intp)


def _typical_nearby(misses: Array, suspects: NDArray[np.intp]) -> Array:
    """The typical miss near each reading: medians over blocks, the greatest of neighbours.

    What suspects have their neighbours miss is left out where something else is left of a block: several spikes in
    one would pass for a fast motion.
    """
    count, block = len(misses), 20
    blocks = -(-count // block)
    touched = np.zeros(count, dtype=np.bool_)
    for beside in range(-2, 3):
        touched[np.clip(suspects + beside, 0, count - 1)] = True
    padded = np.pad(misses, (0, blocks * block - count), mode="edge").reshape(blocks, block)
    out = np.pad(touched, (0, blocks * block - count), mode="edge").reshape(blocks, block)
    out &= out.mean(axis=1, keepdims=True) <= 1.0 - LONE_LEFT
    typical = np.nanmedian(np.where(out, np.nan, padded), axis=1)
    return _greatest_nearby(typical, block)[:count]


def _greatest_nearby(typical: Array, block: int) -> Array:
    """What is typical of blocks of so many readings, or of a neighbour where that is more, for each reading."""
    return np.repeat(np.maximum(typical, np.maximum(np.roll(typical, 1), np.roll(typical, -1))), block)
