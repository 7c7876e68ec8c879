"""Measured pressures without the noise above what a chamber can do.

What: a zero-phase low-pass filter whose cut-off is where the spectra of the logged pressures sink to their noise, the
same for all channels and logs. The arm hardly follows noise that fast; effects that feed on it (dead bands) would.
Validity: regular sampling. Steps that fill the whole spectrum leave the logs as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.signal import firwin

from bha.estimation.bands import frequencies
from bha.estimation.records import Record

Array = NDArray[np.float64]

#: Width of the bins in which spectra are averaged, Hz.
BIN = 1.0
#: Power over that of noise from which on a bin holds pressure.
ABOVE_NOISE = 2.0
#: Cut-off over the highest frequency that holds pressure, and the least cut-off, Hz.
MARGIN, LEAST_CUT = 1.4, 10.0
#: Greatest cut-off as a share of the sampling rate: above it a filter gains nothing.
MOST_SHARE = 0.3


def smoothed(records: Sequence[Record]) -> list[Record]:
    """The records with their pressures filtered, and the filter's taps; as they are where that gains nothing."""
    tops = [_highest_frequency(record) for record in records]
    if any(top is None for top in tops):
        return list(records)
    cut = max(LEAST_CUT, MARGIN * max(float(top) for top in tops if top is not None))
    result = []
    for record in records:
        step = float(np.median(np.diff(record.drive.time)))
        if cut * step > MOST_SHARE:
            return list(records)
        taps = firwin(2 * round(1.6 / (cut * step)) + 1, 2.0 * cut * step)
        if len(taps) > len(record.drive.time) // 4:
            return list(records)
        result.append(
            replace(record, drive=record.driven_by(filtered(record.drive.pressures, taps)), pressure_taps=taps)
        )
    return result


def filtered(values: Array, taps: Array) -> Array:
    """``values`` (rows, k) through a symmetric filter; both ends are continued point-symmetrically."""
    half = len(taps) // 2
    padded = np.pad(values, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    return np.column_stack([np.convolve(column, taps, mode="valid") for column in padded.T])


def _highest_frequency(record: Record) -> float | None:
    """Highest frequency at which some pressure stands out of its noise, Hz; None where that cannot be said."""
    steps = np.diff(record.drive.time)
    step = float(np.median(steps))
    if np.any(record.pressure_noise <= 0.0) or np.any(np.abs(steps - step) > 0.02 * step) or len(steps) < 200:
        return None
    power = (dct(record.drive.pressures, axis=0, norm="ortho") / record.pressure_noise) ** 2
    frequency = frequencies(len(record.drive.time), step)
    bins = (frequency / BIN).astype(int)
    count = np.bincount(bins)
    highest = 0.0
    for column in power.T:
        mean = np.bincount(bins, weights=column) / count
        above = np.flatnonzero(mean > ABOVE_NOISE)
        if len(above):
            highest = max(highest, (float(above[-1]) + 1.0) * BIN)
    return highest
