"""From which frequency on residuals are the noise of the sensors alone: there they are independent between channels.

What: the residuals of sensors of one kind, in units of each one's noise. Noise of sensors is independent between them
and alike in size; what an arm does, or what pushes it, shows in several of them together, and in some more than in
others. Bands of frequency are asked from the top down as long as both hold.
Source: likelihood ratio of independence and of equal variances, with Bartlett's corrections (Anderson, An Introduction
to Multivariate Statistical Analysis (2003), 9.2 and 10.2).
Limits: fewer than two channels tell nothing. Noise that sensors share, a shaking base, passes for motion.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.stats import bartlett, chi2

from bha.estimation.bands import frequencies

Array = NDArray[np.float64]

#: Ratio of the edges of a band, its fewest coefficients for each channel, and the lowest frequency asked, Hz.
BAND, FEWEST, LOWEST = 1.5, 4, 0.1
#: p-value below which a band is not the sensors' alone, if it is more than a trace: share of the variance that other
#: channels tell, ratio of the greatest variance to the least.
CHANCE, TRACE, UNLIKE = 1e-3, 0.05, 2.0


def sensors_alone_from(parts: Sequence[Array], sample_time: float, top: float) -> float:
    """The lowest frequency, Hz, from which to ``top`` residuals are independent and alike; ``top`` where none is.

    Args:
        parts: residuals of each log over the noise of each sensor, shape (rows, C); zero where nothing was read.
        sample_time: between rows, s.
        top: the greatest frequency that is looked at, Hz.
    """
    channels = parts[0].shape[1]
    if channels < 2:
        return top
    frequency = np.concatenate([frequencies(len(part), sample_time) for part in parts])
    values = np.concatenate([dct(part, axis=0, norm="ortho") for part in parts])
    order = np.argsort(frequency, kind="stable")
    frequency, values = frequency[order], values[order]
    lowest, end = top, int(np.searchsorted(frequency, top))
    while lowest > LOWEST:
        begin = min(int(np.searchsorted(frequency, lowest / BAND)), end - FEWEST * channels)
        if begin < 0 or not _are_independent(values[begin:end]) or not _are_alike(values[begin:end]):
            break
        lowest, end = max(LOWEST, float(frequency[begin])), begin
    return lowest


def _are_independent(values: Array) -> bool:
    """Whether the columns of (n, C) are."""
    rows, channels = values.shape
    moments = values.T @ values / rows
    sizes = np.sqrt(np.maximum(np.diag(moments), 1e-300))
    told = -float(np.linalg.slogdet(moments / np.outer(sizes, sizes))[1])
    if 1.0 - np.exp(-told / channels) < TRACE:
        return True
    statistic = (rows - (2 * channels + 11) / 6.0) * told
    return bool(chi2.sf(statistic, channels * (channels - 1) / 2) > CHANCE)


def _are_alike(values: Array) -> bool:
    """Whether the columns of (n, C) have one variance."""
    variances = np.mean(values**2, axis=0)
    if variances.max() < UNLIKE * variances.min():
        return True
    return bool(bartlett(*values.T).pvalue > CHANCE)
