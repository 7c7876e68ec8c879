"""Noise of the outputs where pressures stand still: what an arm at rest shows is its sensors' noise, whatever its rate.

Noise from differences of neighbouring readings (:mod:`bha.recordings.noise`) misses what is slow: of first-order noise
with a correlation time of 0.1 s, read at 10 Hz, two thirds of the variance. Spectra above the arm's motion need rows at
64 Hz and more. Where no pressure has changed for a while nothing is left in the residual of a model but noise, an
offset, and what creeps; both are taken off as parabolas, and what they take with them is accounted for.
Source: restricted maximum likelihood (Patterson and Thompson, Biometrika 58 (1971) 545-554) of white and first-order
noise together, from stretches of two seconds.
Limits: what shakes the arm without being logged counts as noise, too, if it looks like first-order noise; vibrations,
swings that die out and lags of seconds are told from it by their spectrum or by dying out, and are left as they are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from bha.estimation.bands import COLOUR_GAIN, SensorNoise
from bha.estimation.records import Record
from bha.support.spans import spans_of

Array = NDArray[np.float64]

#: Pressures stand still if none has moved by more than this many noises and this share of its travel for this long, s.
STILL_NOISES, STILL_SHARE, STILL_TIME = 8.0, 0.005, 1.0
#: Fewest logs that begin alike, and how far apart their pressures may be, as a share of what they travel.
FEWEST_STARTS, SAME_SHARE = 3, 0.01
#: Length of a stretch, s, least distance of its rows, s, and their least number.
STRETCH, APART, FEWEST_ROWS = 2.0, 0.05, 12
#: Fewest stretches.
FEWEST = 8
#: Shares of coloured variance and correlation times, s, that are tried.
SHARES, TIMES = np.linspace(0.1, 1.0, 10), np.geomspace(0.03, 2.0, 13)
#: Variance in the first half of the stretches over that in the second from which on something is dying out.
DYING = 1.6
#: Greatest excess of a spectral coefficient over that of the noise found, beyond four standard deviations: above it the
#: noise is none of first order.
MISFIT = 0.6


def steady_noise(records: Sequence[Record], residuals: Sequence[Array], white: Array) -> SensorNoise | None:
    """Noise of outputs of one kind, in units of ``white``; None where it is white or the logs do not tell.

    Args:
        records: the logs.
        residuals: measured less simulated outputs of that kind in the rows of each, m, shape (rows, k).
        white: standard deviation of the noise of each by differences, m, shape (k,).
    """
    step = float(np.median([r.sample_time for r in records]))
    every = max(1, round(APART / step))
    count = round(STRETCH / (every * step))
    if count < FEWEST_ROWS:
        return None
    found = [_stretches(record, error / white, every, count) for record, error in zip(records, residuals, strict=True)]
    table = np.concatenate(found)
    if len(table) < FEWEST * residuals[0].shape[1]:
        return None
    return _fitted(table, every * step)


def start_scatter(records: Sequence[Record]) -> Array | None:
    """How far apart the poses are in which logs begin under the same still pressures, m, shape (channels,).

    Nothing a model of the arm knows sets them apart. Alike for all lengths and for all positions; None where fewer than
    ``FEWEST_STARTS`` logs begin alike.
    """
    begun: list[tuple[Array, Array, Array]] = []
    for record in records:
        end = record.drive.time[0] + STILL_TIME
        rows = record.time <= end
        given = record.drive.pressures[record.drive.time <= end]
        least = STILL_NOISES * record.pressure_noise + STILL_SHARE * np.ptp(record.drive.pressures, axis=0)
        if np.count_nonzero(rows) >= 3 and np.all(np.ptp(given, axis=0) <= least) and np.all(record.usable[rows]):
            noise = record.noise**2 / np.count_nonzero(rows)
            begun.append((np.mean(given, axis=0), np.mean(record.measured[rows], axis=0), noise))
    if not begun:
        return None
    first = begun[0][0]
    apart = SAME_SHARE * np.max([np.ptp(r.drive.pressures, axis=0) for r in records], axis=0)
    alike = [(pose, noise) for given, pose, noise in begun if np.all(np.abs(given - first) <= apart)]
    if len(alike) < FEWEST_STARTS:
        return None
    poses, noises = (np.array(part) for part in zip(*alike, strict=True))
    squares = np.maximum(np.var(poses, axis=0, ddof=1) - np.mean(noises, axis=0), 0.0)
    lengths = records[0].observation.is_length
    pooled = {kind: float(np.sqrt(np.mean(squares[lengths == kind]))) for kind in np.unique(lengths)}
    return np.array([pooled[kind] for kind in lengths])


def still(record: Record) -> NDArray[np.bool_]:
    """Which compared rows come after pressures have stood still for a while, shape (k,)."""
    time, pressures = record.drive.time, record.drive.pressures
    step = float(np.median(np.diff(time)))
    size = max(2, round(STILL_TIME / step) + 1)
    origin = (size - 1) // 2  # the window ends at its row
    span = maximum_filter1d(pressures, size, axis=0, origin=origin) - minimum_filter1d(
        pressures, size, axis=0, origin=origin
    )
    least = STILL_NOISES * record.pressure_noise + STILL_SHARE * np.ptp(pressures, axis=0)
    quiet = np.all(span <= least, axis=1)
    quiet[:size] = False
    return np.asarray(quiet[record.rows])


def _stretches(record: Record, error: Array, every: int, count: int) -> Array:
    """Errors in stretches of still pressures, one a stretch and channel, shape (stretches, count)."""
    good = still(record) & np.all(record.usable, axis=1) & np.all(np.isfinite(error), axis=1)
    even = np.concatenate([[False], np.diff(record.time) < 1.5 * record.sample_time])
    rows = []
    for first, last in spans_of(good):
        for start in range(first, last - every * (count - 1), every * count):
            picked = np.arange(start, start + every * count, every)
            if np.all(even[start + 1 : picked[-1] + 1]):
                rows.append(error[picked])
    return np.concatenate([part.T for part in rows]) if rows else np.empty((0, count))


def _fitted(table: Array, step: float) -> SensorNoise | None:
    count = table.shape[1]
    # What is orthogonal to parabolas.
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, count), 3), mode="complete")[0][:, 3:]
    seen = table @ basis
    free = seen.shape[1]
    half = table @ basis @ basis.T
    early, late = (float(np.mean(part**2)) for part in (half[:, : count // 2], half[:, count // 2 :]))
    if early > DYING * late:
        return None
    lags = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) * step

    def judged(share: float, time: float) -> tuple[float, float, Array]:
        covariance = basis.T @ ((1.0 - share) * np.eye(count) + share * np.exp(-lags / time)) @ basis
        factor = np.linalg.cholesky(covariance)
        variance = float(np.mean(np.linalg.solve(factor, seen.T) ** 2))
        loss = np.log(variance) + 2.0 * float(np.mean(np.log(np.diag(factor))))
        return loss, variance, variance * covariance

    plain = judged(0.0, 1.0)
    tried = [
        (judged(float(share), float(time)), share, time) for share in SHARES for time in TIMES if time > 0.3 * step
    ]
    (loss, variance, covariance), share, time = min(tried, key=lambda entry: entry[0][0])
    if 0.5 * len(table) * free * (plain[0] - loss) < COLOUR_GAIN:
        return None
    turned = dct(basis.T, axis=1, norm="ortho")
    power = np.mean((seen @ turned) ** 2, axis=0)[3:]
    expected = np.einsum("ik,ij,jk->k", turned, covariance, turned)[3:]
    if np.max(power / expected) > 1.0 + 4.0 * np.sqrt(2.0 / len(table)) + MISFIT:
        return None
    return SensorNoise(float(np.sqrt(variance)), float(share), float(time))
