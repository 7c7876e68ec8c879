"""What the channels of a log tell of each other: a logger, or a camera, that has stopped holds all of them at once.

One channel that repeats its reading for a while may do so by chance, or since its grid is coarse; that all do so in the
same rows, to the last digit, noise does not bring about.
Limits: channels whose noise is finer than their grid stand still whenever the arm does, and tell nothing of the kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bha.recordings.noise import quiet_noise
from bha.recordings.samples import COARSE, DROPOUT_SECONDS, QUIET, REPEAT_CHANCE, ChannelFacts, judge
from bha.recordings.ticks import CHANCE, STRAYS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Judged = tuple[ChannelFacts, Mask]

#: More repeats than this share of the rows are how the log is.
_MOST = 0.5
#: Channels of one sensor renew as often, to this share.
_SAME = 0.1


def on_one_clock(time: Array, values: Array, judged: Sequence[Judged]) -> list[Judged]:
    """The same where a coarse channel changes in nothing but rows of a slower sensor: it is one of its channels.

    One that moves little, or hardly more than a step at a time, does not tell by itself that it has a clock.

    Args:
        time: of the rows, s, shape (m,).
        values: of all channels of a log, shape (m, C).
        judged: what :func:`bha.recordings.samples.judge` says of each.
    """
    found = list(judged)
    for rows, channels in _slower(time, judged):
        interval = judged[channels[0]][0].interval
        # Where a reading came again its row is known to one.
        near = np.zeros(len(time), dtype=np.bool_)
        for beside in (-1, 0, 1):
            near[np.clip(rows + beside, 0, len(time) - 1)] = True
        for k, (facts, _) in enumerate(judged):
            if facts.held > 0.0 or facts.filled or facts.quantum == 0.0 or not np.all(np.isfinite(values[:, k])):
                continue
            changed = np.flatnonzero(np.diff(values[:, k]) != 0.0) + 1
            if np.mean(near) ** len(changed) > CHANCE or np.mean(near[changed]) < 1.0 - STRAYS:
                continue
            own, place = rows.copy(), np.searchsorted(rows, changed - 1)
            own[np.minimum(place, len(rows) - 1)] = changed
            own = np.unique(own)
            fact, usable = judge(time[own], facts.name, facts.unit, values[own, k])
            mask = np.zeros(len(time), dtype=np.bool_)
            mask[own] = usable
            found[k] = replace(fact, held=1.0 - len(own) / len(time), interval=interval), mask
    return found


def stopped_together(time: Array, values: Array, judged: Sequence[Judged]) -> list[Judged]:
    """The same facts and masks where a coarse channel has stopped together with all others: a logger, no sensor.

    Which rest before belongs to it the others tell: it begins where the last of them changed.

    Args:
        time: of the rows, s, shape (m,).
        values: of all channels of a log, shape (m, C).
        judged: what :func:`judge` says of each.
    """
    found = list(judged)
    dense = [facts.dropouts for facts, _ in judged if facts.quantum > 0.0 and not facts.held]
    sensors = [(np.arange(len(time)), list(range(len(judged))), dense)]
    for rows, channels in _slower(time, judged):
        sensors.append((rows, channels, [judged[k][0].dropouts for k in channels if judged[k][0].quantum > 0.0]))
    for rows, channels, dropouts in sensors:
        seen = values[rows][:, channels]
        for end in sorted({end for own in dropouts for _, end in own}):
            last = int(np.searchsorted(time, end))
            before = seen[: np.searchsorted(rows, last)]
            changed = np.flatnonzero(np.any(np.diff(before, axis=0) != 0.0, axis=1))
            first = int(rows[changed[-1] + 1]) if len(changed) else 0
            if time[last] - time[first] <= DROPOUT_SECONDS:
                continue
            for k in channels:
                # What a slower sensor holds is no rest in every row.
                if judged[k][0].held == 0.0 or len(rows) < len(time):
                    found[k] = _rested(found[k], time, values[:, k], rows[rows <= first], end)
                found[k] = stopped_between(found[k], time, first, last)
    return found


def held_together(time: Array, values: Array, judged: Sequence[Judged]) -> list[Judged]:
    """The same where fine channels repeat themselves in the same rows, more often than noise does by chance.

    How often one repeats itself by chance is counted in the rows in which others do not.

    Args:
        time: of the rows, s, shape (m,).
        values: of all channels of a log, shape (m, C).
        judged: what :func:`bha.recordings.samples.judge` says of each.
    """
    own = [facts.held > 0.0 or facts.filled for facts, _ in judged]
    fine = [not slow and _is_fine(facts, c) for slow, (facts, _), c in zip(own, judged, values.T, strict=True)]
    found = list(judged)
    for first, last in _standstills(time, values, fine):
        found = [stopped_between(channel, time, first, last) for channel in found]
    for rows, channels in _slower(time, judged):
        seen = values[rows][:, channels]
        fine = [_is_fine(judged[k][0], column) for k, column in zip(channels, seen.T, strict=True)]
        ends = np.append(rows, len(time))
        for first, last in _standstills(time[rows], seen, fine):
            for k in channels:
                found[k] = stopped_between(found[k], time, int(rows[first]), int(ends[last]))
    return found


def _standstills(time: Array, values: Array, fine: Sequence[bool]) -> list[tuple[int, int]]:
    """Rows ``(first, last)`` in which no channel changes, for longer than those that are ``fine`` do by chance."""
    if np.count_nonzero(fine) < 2:
        return []
    repeats = np.diff(values, axis=0) == 0.0
    all_at_once = np.all(repeats, axis=1)
    apart = ~all_at_once
    if np.mean(all_at_once) > _MOST:
        return []
    chance = (1.0 + np.sum(repeats[apart][:, np.array(fine, np.bool_)], axis=0)) / (1.0 + np.sum(apart))
    needed = np.log(REPEAT_CHANCE / len(time)) / float(np.sum(np.log(np.minimum(chance, 1.0 - 1e-9))))
    edges = np.concatenate([[0], np.flatnonzero(apart) + 1, [len(time)]])
    return [
        (int(first), int(last))
        for first, last in pairwise(edges)
        if last - first - 1 >= max(1.0, needed) and time[min(last, len(time) - 1)] - time[first] > DROPOUT_SECONDS
    ]


def _slower(time: Array, judged: Sequence[Judged]) -> list[tuple[NDArray[np.intp], list[int]]]:
    """The sensors that renew more slowly than the log by a clock of their own: rows of each, and its channels."""
    sensors: list[list[int]] = []
    for k, (facts, _) in enumerate(judged):
        if facts.held > 0.0 and not facts.filled:
            alike = (s for s in sensors if abs(judged[s[0]][0].interval - facts.interval) < _SAME * facts.interval)
            same = next(alike, None)
            if same is None:
                sensors.append([k])
            else:
                same.append(k)
    found = []
    for channels in sensors:
        rows = np.flatnonzero(np.any([judged[k][1] for k in channels], axis=0))
        # Where the reading came again one channel may have it a row beside the others.
        apart = np.diff(time[rows], prepend=-np.inf) > 0.5 * judged[channels[0]][0].interval
        if len(rows) > 1:
            found.append((rows[apart], channels))
    return found


def _rested(channel: Judged, time: Array, values: Array, rows: NDArray[np.intp], end: float) -> Judged:
    """A channel without its own dropouts that last to ``end``: in ``rows`` it has rested, and that counts."""
    facts, mask = channel
    starts = [start for start, own in facts.dropouts if own == end]
    if not starts:
        return channel
    rest = np.zeros(len(time), dtype=np.bool_)
    rest[rows] = (time[rows] >= min(starts)) & np.isfinite(values[rows])
    return replace(facts, dropouts=tuple(d for d in facts.dropouts if d[1] != end)), mask | rest


def stopped_between(channel: Judged, time: Array, first: int, last: int) -> Judged:
    """A channel that has stopped from row ``first`` to before row ``last``: its first reading counts, repeats do not.

    Dropouts of its own that this overlaps are one with it.
    """
    facts, mask = channel
    usable = mask.copy()
    usable[first + 1 : last] = False
    start, end = float(time[min(first + 1, last - 1)]), float(time[min(last, len(time) - 1)])
    one = [(a, b) for a, b in facts.dropouts if a <= end and start <= b]
    others = [span for span in facts.dropouts if span not in one]
    whole = min([start, *(a for a, _ in one)]), max([end, *(b for _, b in one)])
    return replace(facts, dropouts=tuple(sorted([*others, whole]))), usable


def _is_fine(facts: ChannelFacts, values: Array) -> bool:
    """Whether a channel has noise that its grid shows, even where the arm stands."""
    known = values[np.isfinite(values)]
    if not len(known):
        return False
    return quiet_noise(known) >= max(facts.quantum / COARSE, QUIET * float(np.ptp(known)), 1e-300)
