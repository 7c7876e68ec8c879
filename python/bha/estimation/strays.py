"""Single readings that show something else than the arm, told by what a fitted model leaves.

Where readings are dense a spike shows by its shape (:mod:`bha.recordings.samples`). At ten readings a second an arm may
be away and home again between two of them, and only a model that has been fitted says that it was not: what it leaves
jumps at one reading of one channel and is home again. That is a stray reading where it jumps

- by many times what residuals do nearby, and what the sensor's noise does (what is told of that before a fit counts
  strays in: it is no more than what all but a tenth of the residuals say);
- further than the arm goes, as the model has it, from the reading before to the one after, or as far beyond all of that
  way, and by a quarter of it: a model that errs in time, by a lag, a dead time or its damping, errs by no more than
  that, and along it;
- in this channel alone, or while the arm stands, as the model has it: what acts on the arm moves others, too, and for
  longer than a reading.

Few strays decide a root mean square: three of 25 mm among 300 readings make 2.5 mm.
Limits: three strays among seven readings, and such as several channels have at once on the move, count as readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from bha.estimation.records import Record
from bha.recordings.noise import white_noise
from bha.recordings.samples import FEWEST_FRESH, LONE_INTERVAL, ChannelFacts

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Off the readings around it a stray is by this many times what those nearby are (median), as many noises, and as much
#: as the arm moves, as modelled, between the readings before and after.
_USUAL, _NOISES, _MOTIONS = 10.0, 10.0, 1.0
#: Part of that motion by which it lies beyond all of it, otherwise.
_BEYOND = 0.25
#: Readings whose median tells what is usual.
_NEARBY = 41
#: Share of the readings that tell noise, and how far they reach in normal deviations.
_SOUND, _REACH = 0.9, 1.645
#: Part of that by which readings around it may differ and are home, and how many of the six may be away.
_HOME, _AWAY = 0.3, 2
#: What other channels may be off at that reading, by those nearby, and as a share of what this one is; more only where
#: the arm moves by no more than this part of what the reading is off.
_OTHERS, _BESIDE, _STANDS = 6.0, 0.2, 0.25
#: Fewest readings of a channel, and share of them that may be strays; more is how the sensor is.
_FEWEST, _MOST = 40, 0.1


def without_strays(records: Sequence[Record], shown: Sequence[Array]) -> list[Record]:
    """The records with stray readings not counting, as spikes among the facts of their channels.

    Args:
        records: the records.
        shown: what a model shows of each, (rows, C); NaN where it shows nothing.
    """
    return [_marked(record, strays(record, outputs)) for record, outputs in zip(records, shown, strict=True)]


def in_words(before: Record, after: Record) -> str:
    """What was found in a record, for the notes; empty where that is nothing."""
    counts = [len(b.spikes) - len(a.spikes) for a, b in zip(before.facts, after.facts, strict=True)]
    found = [f"{count} of {fact.name}" for fact, count in zip(after.facts, counts, strict=True) if count]
    if not found:
        return ""
    return (
        f"{after.name}: single readings lie where the arm cannot have been between those before and after ("
        f"{', '.join(found)}); they do not count"
    )


def is_sparse(record: Record) -> bool:
    """Whether readings of some channel are so far apart that spikes do not show by their shape."""
    return any(fact.interval > LONE_INTERVAL for fact in record.facts)


def _marked(record: Record, stray: Mask) -> Record:
    if not np.any(stray):
        return record
    usable = record.usable & ~stray
    facts = tuple(
        _without(fact, record.time[own], values[good])
        for fact, own, values, good in zip(record.facts, stray.T, record.measured.T, usable.T, strict=True)
    )
    return replace(record, usable=usable, facts=facts)


def _without(fact: ChannelFacts, stray: Array, readings: Array) -> ChannelFacts:
    """A channel whose readings at some times are strays, with the noise of those that are left, where that is less."""
    if not len(stray):
        return fact
    noise = fact.noise
    if len(readings) >= FEWEST_FRESH:
        noise = min(noise, max(white_noise(readings), fact.quantum / np.sqrt(12.0)))
    return replace(fact, spikes=tuple(sorted({*fact.spikes, *stray.tolist()})), noise=noise)


def strays(record: Record, shown: Array) -> Mask:
    """Which readings are strays, shape (rows, C)."""
    found = np.zeros(record.usable.shape, dtype=np.bool_)
    share: Array = np.zeros(record.measured.shape)
    stands = np.zeros_like(found)
    for c, good in enumerate((record.usable & np.isfinite(shown)).T):
        rows = np.flatnonzero(good)
        if len(rows) < _FEWEST or record.facts[c].interval <= LONE_INTERVAL:
            continue
        around = _around(record.measured[rows, c] - shown[rows, c])
        off = np.abs(around.off)
        usual = median_filter(off, _NEARBY, mode="mirror")
        share[rows, c] = off / np.maximum(usual, 1e-15)
        # From the reading before, and to the one after.
        steps = np.pad(np.abs(np.diff(shown[rows, c])), 1, mode="edge")
        motion = steps[:-1] + steps[1:]
        stands[rows, c] = motion < _STANDS * off
        noise = min(float(record.noise[c]), float(np.quantile(off, _SOUND)) / _REACH)
        least = np.maximum(_USUAL * usual, _NOISES * noise)
        far = (off > least) & (off > _MOTIONS * motion)
        beyond = _beyond(shown[rows, c], around.off)
        aside = (beyond > least) & (beyond > _BEYOND * motion)
        found[rows, c] = (far | aside) & around.is_home
    moves = np.any((share > _OTHERS) & ~stands, axis=1)
    for c in range(share.shape[1]):
        others = share[:, [k for k in range(share.shape[1]) if k != c]]
        beside = others > np.maximum(_OTHERS, _BESIDE * share[:, [c]])
        found[moves & np.any(beside, axis=1), c] = False
    return np.asarray(found & (found.sum(axis=0) <= _MOST * record.usable.sum(axis=0)))


@dataclass(frozen=True)
class _Around:
    """How readings lie beside those around them.

    Attributes:
        off: from the median of the three before and the three after, shape (m,).
        is_home: whether all but two of these are near their median, and one of the two next to it is, shape (m,).
    """

    off: Array
    is_home: Mask


def _beyond(shown: Array, off: Array) -> Array:
    """How far readings that are ``off`` lie beyond the way from the reading before to the one after, as modelled."""
    ends = np.pad(shown, 1, mode="edge")
    near = np.stack([ends[:-2], shown, ends[2:]])
    read = shown + off
    return np.asarray(np.maximum(np.maximum(near.min(axis=0) - read, read - near.max(axis=0)), 0.0))


def _around(left: Array) -> _Around:
    count, places = len(left), np.array([-3, -2, -1, 1, 2, 3])
    at = np.arange(count)[:, None] + places
    others = np.where((at >= 0) & (at < count), left[np.clip(at, 0, count - 1)], np.nan)
    middle = np.nanmedian(others, axis=1)
    off = left - middle
    with np.errstate(invalid="ignore"):
        near = np.abs(others - middle[:, None]) < _HOME * np.abs(off)[:, None]
    missing = np.sum(np.isfinite(others), axis=1) - near.sum(axis=1)
    return _Around(off, (missing <= _AWAY) & np.any(near[:, 2:4], axis=1))
