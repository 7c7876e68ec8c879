"""What a fit leaves: size beside the sensor noise, whiteness, and whether it still knows the inputs.

For an output-error fit whiteness is the lesser test (a slightly wrong model colours residuals for ever); that residuals
do not follow the pressures is the greater one (Ljung 1999, section 16.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.estimation.long_run import correlation_length
from bha.estimation.records import Record, Window

Array = NDArray[np.float64]

_LAGS = 25
_INPUT_LAGS = 12


@dataclass(frozen=True)
class ChannelResidual:
    """One channel of one record.

    Attributes:
        record: name of the record.
        channel: name of the channel, ``q11`` or ``x1``.
        rms: root mean square of what the fit leaves, m.
        noise: standard deviation of the sensor noise, m.
        correlation_time: time over which it stays correlated, s; the rows' interval for white residuals.
        white: whether no autocorrelation is left (Box-Pierce over 25 lags at 1 %).
        follows: the pressure input that it follows most.
        follows_by: the largest correlation with that input over lags from 0 to 1 s, between 0 and 1.
    """

    record: str
    channel: str
    rms: float
    noise: float
    correlation_time: float
    white: bool
    follows: str
    follows_by: float


def channel_residuals(
    records: Sequence[Record], pieces: Sequence[Window], errors: Sequence[Array], inputs: Sequence[str]
) -> list[ChannelResidual]:
    """Judge the errors (measured minus predicted, m, (rows, C); NaN where not counted) of windows, per channel."""
    found = []
    for number, rec in enumerate(records):
        mine = [(w, e) for w, e in zip(pieces, errors, strict=True) if w.record == number]
        interval = rec.duration / max(len(rec) - 1, 1)
        pressures = np.column_stack([np.interp(rec.time, rec.drive.time, p) for p in rec.drive.pressures.T])
        for c, channel in enumerate(rec.channels):
            series = [np.nan_to_num(e[:, c]) for _, e in mine]
            size = np.concatenate([e[:, c] for _, e in mine]) if mine else np.zeros(0)
            size = size[np.isfinite(size)]
            if not len(size):
                continue
            follows, by = _strongest_input(pressures, mine, c, inputs, interval)
            found.append(
                ChannelResidual(
                    record=rec.name,
                    channel=channel,
                    rms=float(np.sqrt(np.mean(size**2))),
                    noise=float(rec.noise[c]),
                    correlation_time=correlation_length(series) * interval,
                    white=_is_white(series),
                    follows=follows,
                    follows_by=by,
                )
            )
    return found


def _is_white(series: Sequence[Array]) -> bool:
    """Box and Pierce (1970) over the joined windows."""
    total, count, products = 0.0, 0, np.zeros(_LAGS)
    for values in series:
        centered = values - values.mean()
        total += float(centered @ centered)
        count += len(values)
        for lag in range(1, min(_LAGS, len(values) - 1) + 1):
            products[lag - 1] += centered[lag:] @ centered[:-lag]
    if total == 0.0:
        return True
    statistic = count * float(np.sum((products / total) ** 2))
    # 99 % point of chi-squared with 25 degrees of freedom.
    return statistic < 44.31


def _strongest_input(
    pressures: Array, mine: Sequence[tuple[Window, Array]], channel: int, inputs: Sequence[str], interval: float
) -> tuple[str, float]:
    """The input that a channel's errors follow most and the correlation with it, over lags from 0 to 1 s.

    Args:
        pressures: at the rows of the record, Pa, shape (rows, inputs).
        mine: windows of the record and errors in them, (rows, C).
        channel: which of the C channels.
        inputs: their names.
        interval: between rows, s.
    """
    greatest = min(1.0 / interval, len(pressures) - 1.0) if interval > 0 else 0.0
    best = ("", 0.0)
    for lag in np.unique(np.linspace(0, greatest, _INPUT_LAGS).astype(int)):
        mixed, own, other = np.zeros(len(inputs)), 0.0, np.zeros(len(inputs))
        for window, errors in mine:
            good = np.isfinite(errors[:, channel])
            if not good.any():
                continue
            rows = np.maximum(np.arange(window.first, window.last) - lag, 0)[good]
            error = errors[good, channel] - errors[good, channel].mean()
            pressure = pressures[rows] - pressures[rows].mean(axis=0)
            mixed += error @ pressure
            own += float(error @ error)
            other += np.sum(pressure**2, axis=0)
        if own > 0.0:
            correlations = np.abs(mixed) / np.sqrt(np.where(other > 0.0, own * other, np.inf))
            strongest = int(np.argmax(correlations))
            if correlations[strongest] > best[1]:
                best = (inputs[strongest], float(correlations[strongest]))
    return best
