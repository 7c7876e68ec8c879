"""What a right model would leave, told by what a fit leaves: noise of the sensors, and what noise of pressures does.

Noise of pressures is told by differences of neighbouring readings, which at ten rows a second are motion: several times
too much. Near a resonance that makes millimetres, and true effects pass for noise. What noise does to an arm is part of
what a fit leaves, which bounds it from above in every band of frequency (:class:`Bound`); where physics that is missing
fills a band, it stays too great there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.interpolate import CubicSpline

from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.rules import MATERIAL
from bha.diagnosis.smoothing import errors_left
from bha.estimation.alone import sensors_alone_from
from bha.estimation.bands import (
    BAND_COEFFICIENTS,
    QUIET_FREQUENCY,
    SensorNoise,
    band_edges,
    by_frequency,
    frequencies,
    on_lines,
    sensor_noise,
)
from bha.estimation.records import Record
from bha.estimation.steady import steady_noise

Array = NDArray[np.float64]

#: Draws of pressure noise per log for the noise model.
DRAWS = 3
#: Greatest frequency that is looked at for colour, times the time between rows, and the edges of bins up to there.
TOP_SHARE, BINS = 0.47, 60


def disturbed_outputs(problem: Problem, fit: Fit, seed: int) -> list[list[Array]]:
    """What draws of pressure noise do to the outputs of each log."""
    rng = np.random.default_rng([seed, 71])
    records, runs = problem.records, []
    for run in fit.model.on(problem.records).runs(fit.x, fit.states):
        record = run.record
        if not record.has_unsure_pressures:
            continue
        for _ in range(DRAWS):
            noise = errors_left(record.pressure_errors(rng), record)
            runs.append(replace(run, drive=record.driven_by(record.drive.pressures + noise)))
    outputs = iter(fit.model.integration.run(runs))
    result: list[list[Array]] = []
    for record, y in zip(records, fit.outputs, strict=True):
        draws: list[Array] = []
        if record.has_unsure_pressures:
            draws = [np.nan_to_num(next(outputs) - y) for _ in range(DRAWS)]
        result.append(draws)
    return result


def _left(record: Record, shown: Array) -> Array:
    """What a model leaves of a record whose outputs it shows, shape (rows, C), on lines where nothing was read."""
    return on_lines(np.where(record.usable, record.measured - shown, 0.0), record.usable)


def mean_white_square(problem: Problem, changes: Sequence[Sequence[Array]]) -> float:
    """Mean square of the white rows of draws of changes of each log's outputs; 0 where there are none."""
    squares = [np.mean(w(y) ** 2) for w, draws in zip(problem.whiteners, changes, strict=True) for y in draws]
    return float(np.mean(squares)) if squares else 0.0


def _add_to_bins(sums: Array, counts: Array, edges: Array, frequency: Array, power: Array) -> None:
    place = np.searchsorted(edges, frequency) - 1
    inside = (place >= 0) & (place < len(sums))
    np.add.at(sums, place[inside], power[inside])
    np.add.at(counts, place[inside], 1.0)


def sensors_of(
    full: Sequence[Record], thin: Sequence[Record], outputs: Sequence[Array], disturbed: Sequence[Sequence[Array]]
) -> list[SensorNoise]:
    """Noise of each output, coloured where the spectrum above the arm's motion says so; alike for one kind of sensor.

    The residual is taken at all rows of the logs, the simulation interpolated between its own: it is smooth.

    Args:
        full: the logs.
        thin: those whose rows the fit compares.
        outputs: of the fit on them.
        disturbed: what draws of pressure noise do to these.
    """
    white = np.sqrt(np.mean([r.noise**2 for r in full], axis=0))
    result = [SensorNoise(float(v)) for v in white]
    sample_time = float(np.median([r.sample_time for r in full]))
    is_length = full[0].observation.is_length
    for group in (np.flatnonzero(is_length), np.flatnonzero(~is_length)):
        if not len(group):
            continue
        left = [
            _left(record, CubicSpline(thinned.time, y)(record.time))[:, group]
            for record, thinned, y in zip(full, thin, outputs, strict=True)
        ]
        made = [[change[:, group] / white[group] for change in changes] for changes in disturbed]
        found = steady_noise(full, left, white[group])
        if found is None:
            found = _coloured([error / white[group] for error in left], sample_time, thin, made)
        if found is not None:
            for k in group:
                result[k] = replace(found, deviation=float(white[k]) * found.deviation)
    return result


def _is_of_the_model(noise: SensorNoise, left: Sequence[Array], made: Sequence[Sequence[Array]]) -> bool:
    """Whether residuals are so much more than this noise and what pressures make that its colour is a slope of theirs.

    What a model lacks is slow, and its spectrum falls as that of coloured noise does. Where there is none of it, all
    that is left is noise.
    """
    squares = float(np.mean([np.mean(error**2) for error in left]))
    of_pressures = [float(np.mean(change**2)) for changes in made for change in changes]
    known = noise.deviation**2 + (float(np.mean(of_pressures)) if of_pressures else 0.0)
    return squares > MATERIAL**2 * known


def _coloured(
    left: Sequence[Array], sample_time: float, thin: Sequence[Record], made: Sequence[Sequence[Array]]
) -> SensorNoise | None:
    """Noise of sensors of one kind, in units of their own, from where they are alone; None where that is nowhere.

    Args:
        left: residuals of each log, shape (rows, C).
        sample_time: between their rows, s.
        thin: the logs whose rows the fit compares.
        made: what draws of pressure noise make of these.
    """
    top = TOP_SHARE / sample_time
    for low in sorted({sensors_alone_from(left, sample_time, top), QUIET_FREQUENCY}):
        if top < 2.0 * low:
            break
        found = _above(low, top, left, sample_time, thin, made)
        if found.share > 0.0:
            return None if _is_of_the_model(found, left, made) else found
    return None


def _above(
    low: float,
    top: float,
    left: Sequence[Array],
    sample_time: float,
    thin: Sequence[Record],
    made: Sequence[Sequence[Array]],
) -> SensorNoise:
    """The same from the spectrum between two frequencies, Hz."""
    edges = np.geomspace(low, top, BINS) if low < QUIET_FREQUENCY else np.linspace(low, top, BINS)
    centres = 0.5 * (edges[1:] + edges[:-1])
    sums, counts = np.zeros(len(centres)), np.zeros(len(centres))
    for error in left:
        _add_to_bins(sums, counts, edges, frequencies(len(error), sample_time), _power(error))
    known, draws = np.zeros(len(centres)), np.zeros(len(centres))
    for thinned, changes in zip(thin, made, strict=True):
        for change in changes:
            # A coefficient of thinned rows holds less of the same spectrum.
            power = thinned.thinning * _power(change)
            _add_to_bins(known, draws, edges, frequencies(len(change), thinned.sample_time), power)
    told = counts > 0.0
    spectra, beside = sums[told] / counts[told], (known / np.maximum(draws, 1.0))[told]
    return sensor_noise(spectra, counts[told] * left[0].shape[1], centres[told], sample_time, 1.0, beside)


@dataclass(frozen=True)
class Bound:
    """What noise of pressures makes of outputs, bounded by what a fit leaves.

    Attributes:
        edges: upper edges of bands of frequency, Hz, shape (b,), the last one infinite.
        factors: on what it makes there, at most one, shape (b,).
    """

    edges: Array
    factors: Array

    @property
    def least(self) -> float:
        """The least factor."""
        return float(np.min(self.factors))

    def __call__(self, changes: Sequence[Array], record: Record) -> list[Array]:
        """Changes (rows, C) of a record's outputs that noise may make, of those that it would."""
        if self.least == 1.0 or not changes:
            return list(changes)
        band = np.searchsorted(self.edges, frequencies(len(record), record.sample_time), side="right")
        factor = self.factors[band][:, None]
        return [by_frequency(change, factor) for change in changes]


def bound_of(records: Sequence[Record], outputs: Sequence[Array], disturbed: Sequence[Sequence[Array]]) -> Bound:
    """The bound from the outputs of a fit and, per log and draw, what pressure noise changes of them, (rows, C)."""
    edges = band_edges(max(float(np.ptp(r.time)) for r in records), QUIET_FREQUENCY)
    left, made, counts = (np.zeros(len(edges)) for _ in range(3))
    for record, shown, draws in zip(records, outputs, disturbed, strict=True):
        if draws:
            band = np.searchsorted(edges, frequencies(len(record), record.sample_time), side="right")
            np.add.at(left, band, _power(_left(record, shown)))
            np.add.at(made, band, np.mean([_power(change) for change in draws], axis=0))
            np.add.at(counts, band, 1.0)
    # Above the last edge no arm moves; a band holds its power to within a deviation of the square root of 2 over n.
    told = (counts >= BAND_COEFFICIENTS) & (made > 0.0) & np.isfinite(edges)
    most = np.ones(len(edges))
    most[told] = left[told] / made[told] * (1.0 + np.sqrt(2.0 / counts[told]))
    return Bound(edges, np.sqrt(np.minimum(1.0, most)))


def _power(table: Array) -> Array:
    """Mean square of the cosine coefficients over the channels, shape (rows,)."""
    return np.asarray(np.mean(dct(table, axis=0, norm="ortho") ** 2, axis=1))
