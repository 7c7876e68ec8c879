"""The memory of a residual: its spectrum across channels, how many independent numbers it holds, and draws like it.

What: cosine coefficients of the rows of every log, their covariance across channels in bands of frequency. What errs
slowly, or in all channels together, is few independent numbers however many rows there are.
Source: spectra averaged over bands of frequency and over logs, Priestley, Spectral Analysis and Time Series (1981), ch.
6; effective sample size as variance over spectrum at zero, Thiebaux and Zwiers 1984; its extension over channels is the
participation ratio of the spectral matrix.
Validity: a residual that is stationary within its logs. What is slower than a log passes for as slow as that log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from bha.diagnosis.fit import Problem
from bha.estimation.bands import frequencies

Array = NDArray[np.float64]

#: Ratio of the upper edges of two bands; the first bands hold one or two coefficients of the longest log.
BAND_RATIO = 1.4
#: Fewest coefficients that tell a spectrum near zero.
FEWEST_COEFFICIENTS = 8
#: Fewest coefficients beside their means that tell how logs err from one to the next.
FEWEST_BESIDE_MEANS = 4
#: The spectrum counts as flat near zero as long as twice as wide a band holds at least this share of its density.
FLAT = 0.8


@dataclass(frozen=True)
class Memory:
    """Covariance of the white residual across channels by frequency; the unit matrix everywhere for white noise.

    Attributes:
        edges: upper edges of the bands, Hz, shape (b,), the last one is infinite.
        covariance: of one cosine coefficient, shape (b, channels, channels).
        beside: number of coefficients that tell the covariance of the means of logs, where these are none of them.
    """

    edges: Array
    covariance: Array
    beside: int | None = None

    def draws(self, lengths: Sequence[int], steps: Sequence[float], count: int, rng: np.random.Generator) -> Array:
        """Residuals like this one, all logs of each in one column, shape (rows, count).

        Args:
            lengths: rows of each log.
            steps: between its rows, s.
            count: of the draws.
            rng: where they come from.
        """
        values, vectors = np.linalg.eigh(self.covariance)
        roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        parts = []
        for length, step in zip(lengths, steps, strict=True):
            band = np.searchsorted(self.edges, frequencies(length, step), side="right")
            standard = rng.standard_normal((count, length, self.covariance.shape[1]))
            if self.beside is not None:
                # A covariance that few coefficients tell is uncertain: Student's t.
                standard[:, 0] *= np.sqrt(self.beside / rng.chisquare(self.beside, (count, 1)))
            coefficients = np.einsum("nkj,kij->nki", standard, roots[band], optimize=True)
            parts.append(idct(coefficients, axis=1, norm="ortho").reshape(count, -1))
        return np.asarray(np.concatenate(parts, axis=1).T)


def memory(parts: Sequence[Array], steps: Sequence[float], *, means: bool = True) -> Memory:
    """The memory of a residual.

    Args:
        parts: white residual of each log, shape (rows, channels).
        steps: between the rows of each log, s.
        means: whether the mean of each log is one of the numbers that tell it. A cause that acts always shows in means
            most of all, and hides behind a memory that has them; without them the lowest band is as the coefficients
            beside them have it.
    """
    resolution = min(0.5 / (len(part) * step) for part, step in zip(parts, steps, strict=True))
    top = max(0.5 / step for step in steps)
    edges = [1.5 * resolution]
    while edges[-1] < top:
        edges.append(max(BAND_RATIO * edges[-1], edges[-1] + 1.0 * resolution))
    bands = np.array([*edges[:-1], np.inf])
    channels = parts[0].shape[1]
    first = 0 if means else 1
    sums, counts = np.zeros((len(bands), channels, channels)), np.zeros(len(bands))
    for part, step in zip(parts, steps, strict=True):
        coefficients = dct(part, axis=0, norm="ortho")[first:]
        band = np.searchsorted(bands, frequencies(len(part), step)[first:], side="right")
        for b in np.unique(band):
            own = coefficients[band == b]
            sums[b] += own.T @ own
            counts[b] += len(own)
    # Short logs have no coefficients in some bands: those of the next band that has.
    filled = np.flatnonzero(counts)
    nearest = filled[np.argmin(np.abs(np.arange(len(bands))[:, None] - filled), axis=1)]
    covariance = sums[nearest] / counts[nearest, None, None]
    if means:
        return Memory(bands, covariance)
    near = int(np.searchsorted(np.cumsum(counts), FEWEST_BESIDE_MEANS)) + 1
    beside = int(np.sum(counts[:near]))
    covariance[0] = np.sum(sums[:near], axis=0) / max(beside, 1)
    return Memory(bands, covariance, beside)


def by_log(problem: Problem, white: Array) -> tuple[list[Array], list[float]]:
    """The rows of each log, shape (rows, channels), and the time between them, s."""
    parts = [
        white[part].reshape(whitener.kept, -1)
        for part, whitener in zip(problem.slices(), problem.whiteners, strict=True)
    ]
    steps = [float(whitener.time[1] - whitener.time[0]) for whitener in problem.whiteners]
    return parts, steps


def draws_like(problem: Problem, white: Array, count: int, rng: np.random.Generator, *, means: bool = True) -> Array:
    """Draws of residuals of all logs that have the memory of ``white``, shape (rows, count); ``means`` as there."""
    parts, steps = by_log(problem, white)
    return memory(parts, steps, means=means).draws([len(part) for part in parts], steps, count, rng)


def numbers_per_independent(parts: Sequence[Array], steps: Sequence[float]) -> float:
    """By how much the numbers of a residual err together: numbers per independent one, at least one.

    Over time and channels, all logs together. Of one channel alone this is its integrated autocorrelation length, which
    :func:`bha.estimation.long_run.correlation_length` takes from the log's own lags: less biased where an error lasts
    for a tenth of a log, and wider. Why both are kept is in docs/decisions/0004-the-house.md.

    Args:
        parts: white residual of each log, shape (rows, channels); a mean other than zero is part of the error.
        steps: between the rows of each log, s.
    """
    total = sum(float(np.sum(part**2)) for part in parts)
    count = sum(part.size for part in parts)
    if total <= 0.0:
        return 1.0
    coefficients = np.concatenate([dct(part, axis=0, norm="ortho") for part in parts])
    order = np.argsort(
        np.concatenate([frequencies(len(part), step) for part, step in zip(parts, steps, strict=True)]), kind="stable"
    )
    coefficients = coefficients[order]
    size = min(len(coefficients), max(FEWEST_COEFFICIENTS, 2 * len(parts)))
    power = np.sum(coefficients**2, axis=1)
    while 2 * size <= len(coefficients) and np.mean(power[: 2 * size]) >= FLAT * np.mean(power[:size]):
        size *= 2
    near_zero = coefficients[:size].T @ coefficients[:size] / size
    trace, channels = float(np.trace(near_zero)), near_zero.shape[0]
    # The sum of squares of a sampled covariance is too great by the square of its trace over its degrees of freedom.
    squares = (float(np.sum(near_zero**2)) - trace**2 / size) * size / (size + 1.0)
    together = max(squares, trace**2 / channels) / max(trace, 1e-300)
    return float(max(1.0, together / (total / count)))
