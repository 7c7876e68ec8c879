"""Measured pressures without the noise that stands out of them: the best guess of what acted.

What: Wiener's filter of each channel and log, its spectrum less that of white noise over its spectrum, in bands of
frequency; where a spectrum is noise alone nothing is left of it, and where it stands far out of it all is. Pressures
that stand still for a while have another spectrum than those that move: what is faster than ``SLOW`` is kept as far as
it has, over ``WINDOW`` s around, more of a square than noise has.
Why: a model that is driven by noise swings with it, where the arm did not, and a fit damps the swing: five times the
damping, from logs whose pressures hardly move at the frequency at which the arm rings (errors in variables; a guess
that errs independently of itself has no such bias, Berkson 1950). Effects that feed on noise, dead bands, would too.
Source: Wiener, *Extrapolation, Interpolation, and Smoothing of Stationary Time Series* (1949); spectral subtraction;
the second step is Lee's, IEEE Trans. Pattern Anal. Mach. Intell. 2(2) (1980) 165-168, in time.
Noise that differences of neighbouring readings tell is motion where readings are few: no more counts than the upper
half of frequencies holds.
Validity: regular sampling, white noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.ndimage import uniform_filter1d

from bha.estimation.bands import by_frequency, frequencies
from bha.estimation.records import Record

Array = NDArray[np.float64]

#: Width of the bands in which spectra are averaged, Hz, and fewest coefficients of one.
BIN, FEWEST = 0.5, 20
#: Power over that of noise up to which a band holds nothing else, and from which on it is left as it is.
NOISE_ALONE, FAR_OUT = 1.5, 10.0
#: What is slower than this frequency stays, Hz; over how long what is faster is judged, s, and by how many times the
#: square of noise it must have to be any of it.
SLOW, WINDOW, MUCH = 0.7, 1.0, 2.0
#: By how much of a log its slope at an end is told, s, and by how many rows at least.
END, FEWEST_AT_END = 0.2, 3
#: Fewest rows of a log, and by which part of it the distance of two may differ from the others.
FEWEST_ROWS, REGULAR = 200, 0.02
#: Distance of readings, in steps between rows, from which on rows between them are made up.
FAR_APART = 1.5


def smoothed(records: Sequence[Record]) -> list[Record]:
    """The records with their pressures filtered, and what was kept; as they are where that is not told.

    Commands are what was commanded, rounded or not.
    """
    return [record if record.drive.commanded else _smoothed(record) for record in records]


def errors_left(noise: Array, record: Record) -> Array:
    """What is left of noise of a record's pressures, Pa, shape (samples, inputs), once they have been filtered.

    A best guess of a signal of power S in noise of power N errs by S N / (S + N): of noise the part that was kept.
    """
    if record.pressure_kept is None:
        return noise
    # What stood in the chambers before a log was not read.
    own = record.alone.drive.time
    left = _passed(noise[record.before :], _step(own), *map(np.sqrt, record.pressure_kept))
    return np.concatenate([np.zeros((record.before, noise.shape[1])), left])


def _smoothed(record: Record) -> Record:
    time, pressures = record.drive.time, record.drive.pressures
    step = _step(time)
    regular = len(time) >= FEWEST_ROWS and not np.any(np.abs(np.diff(time) - step) > REGULAR * step)
    # Between readings that are far apart there is a curve, and no noise of its own.
    dense = all(fact.interval < FAR_APART * step for fact in record.pressure_facts)
    if not regular or not dense or not np.any(record.pressure_noise > 0.0):
        return record
    width = max(BIN, FEWEST * 0.5 / (step * len(time)))
    bands = (frequencies(len(time), step) / width).astype(int)
    counts = np.bincount(bands)
    # A slope at an end would be a kink of the cosines, and stand in all of them.
    sloped = _sloped(time, pressures)
    level = pressures - sloped
    power = [np.bincount(bands, weights=own**2) / counts for own in dct(level.T, norm="ortho")]
    # No band has less than the noise.
    most = [float(np.median(own[len(own) // 2 :])) for own in power]
    noise = np.minimum(record.pressure_noise, np.sqrt(most))
    gain = np.column_stack([_kept(own, deviation)[bands] for own, deviation in zip(power, noise, strict=True)])
    fast = _fast(len(time), step)[:, None]
    share = _share(by_frequency(level, fast * gain), noise**2 * np.mean((fast * gain) ** 2, axis=0), step)
    found = replace(record.with_pressure_noise(noise), pressure_kept=(gain, share))
    return replace(found, drive=record.driven_by(sloped + _passed(level, step, gain, share)))


def _passed(values: Array, step: float, gain: Array, share: Array) -> Array:
    """``values`` (rows, k) with a gain at each frequency, and a share of what is fast at each row, both (rows, k)."""
    fast = by_frequency(values, _fast(len(values), step)[:, None] * gain)
    return np.asarray(by_frequency(values, gain) + (share - 1.0) * fast)


def _fast(rows: int, step: float) -> Array:
    """Part of each cosine coefficient that is fast, shape (rows,)."""
    ratio = (frequencies(rows, step) / SLOW) ** 4
    return np.asarray(ratio / (1.0 + ratio))


def _share(fast: Array, noise: Array, step: float) -> Array:
    """What is kept of what is fast, at each row, shape (rows, k), of which noise has the square ``noise``, (k,)."""
    square = uniform_filter1d(fast**2, max(1, round(WINDOW / step)), axis=0, mode="reflect")
    kept = (1.0 - MUCH * noise / np.maximum(square, 1e-300)) / (1.0 - MUCH / FAR_OUT)
    return np.asarray(np.clip(kept, 0.0, 1.0))


def _step(time: Array) -> float:
    return float(np.median(np.diff(time)))


def _sloped(time: Array, values: Array) -> Array:
    """Parabolas with the slopes that values (rows, k) have at both ends, by lines through ``END`` s of them."""
    since, whole = time - time[0], float(time[-1] - time[0])
    rows = max(FEWEST_AT_END, round(END / _step(time)))
    first, last = (np.polyfit(since[own], values[own], 1)[0] for own in (slice(rows), slice(-rows, None)))
    return np.asarray(np.outer(since, first) + np.outer(0.5 * since**2 / whole, last - first))


def _kept(power: Array, noise: float) -> Array:
    """What is kept of the cosine coefficients of a channel in each band, of which ``power`` is the mean square."""
    if noise <= 0.0:
        return np.ones(len(power))
    above = power / noise**2
    kept = np.where(above > NOISE_ALONE, 1.0 - 1.0 / np.maximum(above, 1.0), 0.0)
    kept[above > FAR_OUT] = 1.0
    # The slowest band has the means of what stands still.
    kept[0] = 1.0
    return np.asarray(kept)
