"""Does what no model explains follow anything that was logged, or was the arm pushed by what no log holds?

What: an arm in a laboratory is pushed by hoses, hands, a sagging supply, all of them without a column. What that leaves
is no gap of the model, however large it is beside the noise of the sensors: no equation in what was logged explains it.
Asked is what a ridge regression of the errors on all that was logged and its past predicts on stretches that it was not
fitted to: simulated outputs, their rates, sizes and signs of rates and squares of outputs behind lags, the product of
outputs with time, pressures and their squares behind lags and oscillators. Physics that the model lacks is a function
of these; an unlogged force or pressure is not.
Validity: disturbances that are as large on the logs of the fit as on those held out. Offsets between logs are taken out
of both. A periodic force follows time: one sine a log is asked as well what it predicts of the other pieces of the log.
Noise that lets an arm ring loses its phase from piece to piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.checkup.response import Filter
from bha.diagnosis.decide import Decision
from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.holdout import Holdout, Prediction
from bha.estimation.records import Record
from bha.estimation.slow import cell_means, lag_response

Array = NDArray[np.float64]

#: Logs that last less than this together, s, tell nothing.
LEAST_TIME = 30.0
#: Length of a cell over which errors and what was logged are averaged, s.
CELL = 0.125
#: Lags of pressures, s.
LAGS = (0.0, 0.15, 0.6, 2.5)
#: Oscillators that pressures go through, for arms that ring: frequencies, Hz, and share of critical damping.
RESONANCES, DAMPING = (0.5, 1.0, 2.0, 3.5), 0.15
#: Pieces of time into which all logs are cut, each predicted from the others but for so many cells beside it: errors
#: with a memory and slow regressors would be interpolated, not predicted.
PIECES, BESIDE = 8, 20
#: Weights of the ridge, in rows; the best one counts.
WEIGHTS = tuple(np.geomspace(1e-3, 1e2, 11))
#: Pieces of a log for the sine.
QUARTERS = 4
#: Share of the errors' square that what was logged predicts at most, that a sine does, and held-out over training RMS
#: error, where nothing is missing; and the mean error of a log over the rest of its errors.
MOST_PREDICTED, MOST_PERIODIC, MOST_GROWN, MOST_OFFSET = 0.1, 0.35, 1.5, 3.0


@dataclass(frozen=True)
class Unlogged:
    """What errors follow.

    Attributes:
        predicted: share of their square, about the mean of each log, that what was logged predicts.
        periodic: the same of one frequency.
        grown: RMS error about the mean of each log on those held out, over that on those of the fit.
        offset: RMS mean error of the held-out logs over the rest.
        rms: RMS error on the held-out logs about the mean of each, m.
    """

    predicted: float
    periodic: float
    grown: float
    offset: float
    rms: float

    @property
    def is_a_disturbance(self) -> bool:
        """Whether errors follow nothing that was logged and are the same in all logs."""
        told = self.predicted >= MOST_PREDICTED or self.periodic >= MOST_PERIODIC
        return not told and self.grown < MOST_GROWN and self.offset < MOST_OFFSET

    def judge(self, decision: Decision, noise: float) -> Decision:
        """The decision; ``equivalent`` where what is unexplained is a disturbance.

        What the best effects remove of it is a part that follows what was logged.

        Args:
            decision: on the search.
            noise: RMS error of a right model on the held-out logs, m.
        """
        if decision.verdict != "unexplained" or decision.closure >= MOST_PREDICTED or not self.is_a_disturbance:
            return decision
        text = (
            f"the re-identified plain model leaves {1e3 * self.rms:.2g} mm, {self.rms / noise:.1f} times what noise "
            "alone makes, and that follows nothing that was logged: pressures, pose, rates and their past predict "
            f"{100 * self.predicted:.0f} % of it on stretches apart, and it is {self.grown:.2f} times as large on "
            "held-out logs as on those of the fit; it is what unlogged forces or pressures do"
        )
        return Decision("equivalent", text, decision.closure)


def unlogged(problem: Problem, fit: Fit, holdout: Holdout, prediction: Prediction) -> Unlogged | None:
    """What the errors of a model follow; None where it runs away, or too little was logged to say."""
    if sum(record.duration for record in (*problem.records, *holdout.problem.records)) < LEAST_TIME:
        return None
    logs = [*zip(problem.records, fit.outputs, strict=True)]
    held = [*zip(holdout.problem.records, prediction.outputs, strict=True)]
    if not all(np.all(np.isfinite(y)) for _, y in (*logs, *held)):
        return None
    before, after = (_scatter(part) for part in (logs, held))
    tables = [table for record, y in (*logs, *held) if (table := _table(record, y)) is not None]
    share = predicted_share([(errors, regressors) for errors, regressors, _ in tables])
    if share is None or before <= 0.0:
        return None
    periodic = periodic_share([(errors, step) for errors, _, step in tables])
    means = [
        np.mean((r.measured - y)[r.usable[:, c], c]) for r, y in held for c in range(y.shape[1]) if r.usable[:, c].any()
    ]
    offset = float(np.sqrt(np.mean(np.square(means)))) / max(after, 1e-12)
    return Unlogged(share, periodic, after / before, offset, after)


def _scatter(part: Sequence[tuple[Record, Array]]) -> float:
    """RMS error about the mean of each log and channel, m."""
    squares = [
        np.var((record.measured - y)[record.usable[:, c], c])
        for record, y in part
        for c in range(y.shape[1])
        if record.usable[:, c].any()
    ]
    return float(np.sqrt(np.mean(squares))) if squares else 0.0


def predicted_share(tables: Sequence[tuple[Array, Array]]) -> float | None:
    """Share of the errors' square that regressors predict on pieces of time that took no part in their fit.

    Args:
        tables: errors (g, C) and regressors (g, F) of each log, on even grids, each about its mean in the log.
    """
    rows = sum(len(errors) for errors, _ in tables)
    if rows < 4 * PIECES:
        return None
    errors, regressors = (np.concatenate([table[k] for table in tables]) for k in (0, 1))
    pieces: list[int] = []
    for own, _ in tables:
        count = max(1, round(PIECES * len(own) / rows))
        start = pieces[-1] + 1 if pieces else 0
        pieces += [start + min(count - 1, k * count // len(own)) for k in range(len(own))]
    piece = np.array(pieces)
    size = np.sqrt(np.mean(regressors**2, axis=0))
    scaled = regressors[:, size > 0.0] / size[size > 0.0]
    total = float(np.sum(errors**2))
    if total <= 0.0 or not scaled.size or piece[-1] == 0:
        return None
    left = np.zeros(len(WEIGHTS))
    for k in range(piece[-1] + 1):
        out = piece == k
        apart = ~np.convolve(out, np.ones(2 * BESIDE + 1), "same").astype(bool)
        if apart.sum() < PIECES:
            return None
        u, s, vt = np.linalg.svd(scaled[apart], full_matrices=False)
        along = u.T @ errors[apart]
        seen = scaled[out] @ vt.T
        for w, weight in enumerate(WEIGHTS):
            left[w] += float(np.sum((errors[out] - seen @ (along * (s / (s**2 + weight * len(u)))[:, None])) ** 2))
    return max(0.0, 1.0 - float(left.min()) / total)


def periodic_share(tables: Sequence[tuple[Array, float]]) -> float:
    """Share of the errors' square that the strongest frequency predicts, with its phase in each log.

    Args:
        tables: errors (g, C) of each log about their mean, and the step of its grid, s.
    """
    step = min(step for _, step in tables)
    slowest = 3.0 / min(len(errors) * own for errors, own in tables)
    frequencies = np.arange(slowest, 0.5 / step, 0.1 * slowest)
    power = np.zeros(len(frequencies))
    for errors, own in tables:
        waves = np.exp(-2j * np.pi * frequencies[:, None] * own * np.arange(len(errors)))
        power += np.sum(np.abs(waves @ (errors * np.hanning(len(errors))[:, None])) ** 2, axis=1)
    best = float(frequencies[int(np.argmax(power))]) if len(frequencies) else 0.0
    left = total = 0.0
    for errors, own in tables:
        phase = 2.0 * np.pi * best * own * np.arange(len(errors))
        wave = np.column_stack([np.sin(phase), np.cos(phase)])
        piece = np.arange(len(errors)) * QUARTERS // len(errors)
        for k in range(QUARTERS):
            out = piece == k
            told = np.linalg.lstsq(wave[~out], errors[~out], rcond=None)[0]
            left += float(np.sum((errors[out] - wave[out] @ told) ** 2))
        total += float(np.sum(errors**2))
    return max(0.0, 1.0 - left / total) if total > 0.0 else 0.0


def _table(record: Record, outputs: Array) -> tuple[Array, Array, float] | None:
    """Errors and regressors of a log in cells, each about its mean, and the cells' length, s; None for a few cells."""
    time = record.time
    count = int((time[-1] - time[0]) / max(CELL, 2.0 * record.sample_time))
    if count < 16:
        return None
    step = float(time[-1] - time[0]) / count
    errors = cell_means(time, np.where(record.usable, record.measured - outputs, np.nan), step, count)
    y = cell_means(time, outputs, step, count)
    y = (y - y.mean(axis=0)) / np.maximum(y.std(axis=0), 1e-12)
    p = cell_means(time, record.drive.pressures[record.rows], step, count)
    p = (p - p.mean(axis=0)) / np.maximum(p.std(axis=0), 1.0)
    rates = np.gradient(y, step, axis=0)
    signs = np.tanh(rates / np.maximum(0.3 * rates.std(axis=0), 1e-12))
    passed = np.linspace(-1.0, 1.0, count)[:, None]
    bent = np.column_stack([y**2, signs, np.abs(rates)])
    forces = [lag_response(lag, step, bent) for lag in LAGS[:3]]
    lagged = [lag_response(lag, step, values) for lag in LAGS for values in (p, p**2)]
    ringing = [_oscillator(frequency, step, p) for frequency in RESONANCES]
    regressors = np.nan_to_num(np.column_stack([y, rates, passed, passed * y, *forces, *lagged, *ringing]))
    good: NDArray[np.bool_] = np.all(np.isfinite(errors), axis=1)
    if good.sum() < 16:
        return None
    errors = np.where(good[:, None], errors - errors[good].mean(axis=0), 0.0)
    return errors, np.where(good[:, None], regressors - regressors[good].mean(axis=0), 0.0), step


def _oscillator(frequency: float, step: float, values: Array) -> Array:
    """What follows ``values`` (g, J) on an even grid through a damped oscillator of static gain one."""
    size = 2 * len(values)
    s = np.asarray(2j * np.pi * np.fft.rfftfreq(size, step), dtype=np.complex128)
    gain = Filter(0.0, frequency, DAMPING).gain(s)
    return np.asarray(np.fft.irfft(np.fft.rfft(values, size, axis=0) * gain[:, None], size, axis=0)[: len(values)])
