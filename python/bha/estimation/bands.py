"""What the residual of a right model looks like, and the change of coordinates in which it is white.

What: a right model still differs from the logs by (1) the noise of the output sensors, perhaps coloured, and (2) the
noise of the pressure sensors, which drives the simulated arm and comes out shaped by its resonances, the same for all
outputs of a section. Both are described by one covariance matrix of the outputs per frequency band; (2) by simulating a
few draws of pressure noise. Where logs repeat each other, (3) is what the arm does otherwise each time: alike in all
bands, for a few repeats do not tell a spectrum, and no model is finer at one frequency than at another. The whitening
takes the cosine transform in time (real, orthonormal, and unlike Fourier's without a step where the log ends), divides
every band by the Cholesky factor of its covariance, drops what lies above ``top_frequency``, where no arm moves, and
transforms back: rows that are white with variance one under a right model, in fewer samples, still ordered in time.
Validity: noise that is stationary within a log; bands that are wide against the resolution of a log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct
from scipy.optimize import minimize

from bha.estimation.noise import rounding_of
from bha.estimation.records import Record

Array = NDArray[np.float64]

#: Above this no bellows arm moves by more than its noise, Hz.
TOP_FREQUENCY = 30.0
#: Above this the outputs hold no motion to speak of, so that their spectrum is that of the sensors, Hz.
QUIET_FREQUENCY = 15.0
#: Least gain of the log-likelihood at which noise counts as coloured.
COLOUR_GAIN = 15.0
#: Lowest frequency that is seen, over the corner of the colour, up to which its size is told.
CORNER = 2.0
#: Greatest correlation time of a sensor's noise, s: what is slower than 0.6 Hz is of the arm, whatever its spectrum.
SLOWEST = 0.25
#: Fewest coefficients of one log in a band.
BAND_COEFFICIENTS = 12


@dataclass(frozen=True)
class SensorNoise:
    """Noise of one output: a white part and, perhaps, a first-order one.

    Attributes:
        deviation: standard deviation of both together, m.
        share: share of the variance that is coloured.
        time: correlation time of that part, s.
    """

    deviation: float
    share: float = 0.0
    time: float = 0.0

    def density(self, frequency: Array, sample_time: float) -> Array:
        """Spectrum over that of white noise of the same variance."""
        if self.share <= 0.0:
            return np.ones_like(frequency)
        return np.asarray(1.0 - self.share + self.share * ar1_density(frequency, sample_time, self.time))


def sensor_noise(
    spectra: Array, counts: Array, frequency: Array, sample_time: float, white: float, known: Array | float = 0.0
) -> SensorNoise:
    """White or coloured noise, from the spectrum of residuals where there is nothing else, by Whittle's likelihood.

    Args:
        spectra: squares of cosine coefficients, averaged over channels and logs that share a kind of sensor, shape
            (k,), m^2.
        counts: of the coefficients that were averaged, shape (k,).
        frequency: their frequencies, Hz: only such at which the arm does not move.
        sample_time: of the sensor, s.
        white: standard deviation if the noise is white, m.
        known: what is in the spectra beside the noise of the sensors: the work of the pressure noise, m^2.
    """

    count = float(np.sum(counts))
    weights = counts / count

    # Averages over bins: the likelihood then is that of chi-squared means, whatever their number of degrees.
    def loss(x: Array) -> float:
        variance, share, time = np.exp(x[0]), 1.0 / (1.0 + np.exp(-x[1])), np.exp(x[2])
        density = variance * (1.0 - share + share * ar1_density(frequency, sample_time, time)) + known
        return float(weights @ (np.log(density) + spectra / density))

    def white_loss(x: Array) -> float:
        return loss(np.array([x[0], -50.0, np.log(sample_time)]))

    level = float(np.log(max(np.mean(spectra - known), 1e-3 * np.mean(spectra))))
    plain = float(minimize(white_loss, [level], method="Nelder-Mead").fun)
    best: tuple[float, Array] | None = None
    for start in (0.01, 0.03, 0.1, 0.3):
        found = minimize(loss, [level, 0.0, np.log(start)], method="Nelder-Mead", options={"maxiter": 400})
        if best is None or found.fun < best[0]:
            best = (float(found.fun), np.asarray(found.x))
    assert best is not None
    share, time = 1.0 / (1.0 + np.exp(-best[1][1])), float(np.exp(best[1][2]))
    deviation = float(np.exp(0.5 * best[1][0]))
    weak = 0.5 * count * (plain - best[0]) < COLOUR_GAIN or share < 0.1
    # Where only the slope above its corner is seen, size and time are not told apart.
    seen = 2.0 * np.pi * float(np.min(frequency)) * time < CORNER and time < SLOWEST
    if weak or not sample_time < time or not (seen or (time < 0.2 and deviation <= 2.0 * white)):
        return SensorNoise(white)
    return SensorNoise(deviation, float(share), time)


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of the outputs of a right model by frequency.

    Attributes:
        edges: upper edges of the bands, Hz, shape (b,), the last one is infinite.
        covariance: covariance of one cosine coefficient in each band, m^2, shape (b, channels, channels).
        sensor: standard deviation of the output sensors, m, shape (channels,).
        pressure_part: RMS of what the pressure noise does to each output, m, shape (channels,).
        repeat_part: RMS of what the arm does otherwise each time, beyond the sensors' noise, m, shape (channels,).
        colours: of each output the share of the sensor's variance that is coloured, and its correlation time, s; (0, 0)
            for white noise.
    """

    edges: Array
    covariance: Array
    sensor: Array
    pressure_part: Array
    repeat_part: Array
    colours: tuple[tuple[float, float], ...] = ()

    @property
    def floor(self) -> Array:
        """RMS error of a right model in each output, m, shape (channels,)."""
        return np.asarray(np.sqrt(self.sensor**2 + self.pressure_part**2 + self.repeat_part**2))


def band_edges(duration: float, top: float) -> Array:
    """Upper edges of the bands, Hz: a factor 1.35 apart and never narrower than ``BAND_COEFFICIENTS`` coefficients."""
    resolution = 1.0 / (2.0 * duration)
    edges = [BAND_COEFFICIENTS * resolution]
    while edges[-1] < top:
        edges.append(max(1.35 * edges[-1], edges[-1] + BAND_COEFFICIENTS * resolution))
    return np.array([*edges, np.inf])


def frequencies(rows: int, sample_time: float) -> Array:
    """Frequency of each cosine coefficient, Hz."""
    return np.arange(rows) / (2.0 * rows * sample_time)


def by_frequency(values: Array, gain: Array) -> Array:
    """Values (rows, k) with a gain on each cosine coefficient, (rows, k) or (rows, 1)."""
    return np.asarray(idct(gain * dct(values, axis=0, norm="ortho"), axis=0, norm="ortho"))


def ar1_density(frequency: Array, sample_time: float, time: float) -> Array:
    """Spectrum of a first-order process of variance one, over that of white noise of variance one."""
    keep = float(np.exp(-sample_time / time))
    cosine = np.cos(2.0 * np.pi * np.minimum(frequency, 0.5 / sample_time) * sample_time)
    return np.asarray((1.0 - keep**2) / (1.0 - 2.0 * keep * cosine + keep**2))


def noise_model(
    records: Sequence[Record],
    disturbed: Sequence[Sequence[Array]],
    sensors: Sequence[SensorNoise] | None = None,
    scatter: Array | None = None,
) -> NoiseModel:
    """The noise model from the records' sensor noise and what draws of pressure noise do to the simulated outputs.

    Args:
        records: the logs.
        disturbed: per log, per draw, the change of the outputs (rows, channels), m.
        sensors: noise of each output; white, as the records have it, if None.
        scatter: what sets logs apart for as long as they last, m, shape (channels,): all in the lowest band.
    """
    top = min(TOP_FREQUENCY, *(0.5 / record.sample_time for record in records))
    edges = band_edges(max(float(np.ptp(r.time)) for r in records), top)
    channels = len(records[0].channels)
    if sensors is None:
        sensors = [SensorNoise(float(v)) for v in np.sqrt(np.mean([r.noise**2 for r in records], axis=0))]
    sensor = np.array([s.deviation for s in sensors])
    sums, counts = np.zeros((len(edges), channels, channels)), np.zeros(len(edges))
    pressure_squares: list[Array] = []
    for record, draws in zip(records, disturbed, strict=True):
        band = np.searchsorted(edges, frequencies(len(record.rows), record.sample_time), side="right")
        for change in draws:
            coefficients = dct(change, axis=0, norm="ortho")
            for b in range(len(edges)):
                part = coefficients[band == b]
                sums[b] += part.T @ part
                counts[b] += len(part)
            pressure_squares.append(np.mean(change**2, axis=0))
    covariance = sums / np.maximum(counts, 1.0)[:, None, None]
    centres = np.sqrt(np.concatenate([[0.3 * edges[0]], edges[:-1]]) * np.where(np.isinf(edges), 2.0 * top, edges))
    sample_time = float(np.median([r.sample_time / r.thinning for r in records]))
    shape = np.stack([s.density(centres, sample_time) for s in sensors], axis=1)
    # Within the band that is left, thinning divides the variance of a coefficient.
    thinning = float(np.mean([r.thinning for r in records]))
    repeated = np.mean([r.repeat_noise**2 for r in records], axis=0)
    repeat_part = np.sqrt(np.maximum(repeated - sensor**2, 0.0))
    # What an arm does is slow and loses nothing by thinning, and so is the part of rounding that is where it stands.
    rounded = np.mean([_rounding(r) for r in records], axis=0)
    white = np.maximum(sensor**2 - rounded, 0.0)
    covariance += np.einsum("bi,ij->bij", shape * white / thinning + rounded + repeat_part**2, np.eye(channels))
    if scatter is not None:
        rows = float(np.mean([len(r.rows) for r in records]))
        covariance[0] += np.diag(scatter**2) * rows / BAND_COEFFICIENTS
        repeat_part = np.sqrt(repeat_part**2 + scatter**2)
    pressure_part = np.sqrt(np.mean(pressure_squares, axis=0)) if pressure_squares else np.zeros(channels)
    colours = tuple((s.share, s.time) for s in sensors)
    return NoiseModel(edges, covariance, sensor, pressure_part, repeat_part, colours)


def _rounding(record: Record) -> Array:
    """Variance of the part of rounding that belongs to where a channel is, m^2, shape (channels,)."""
    white = np.sqrt(np.maximum(record.noise**2 - record.quantum**2 / 12.0, 0.0))
    return rounding_of(white, record.quantum)


class Whitener:
    """Takes residuals of one log, or of a stretch of it, to rows that are white with variance one under a right model.

    One of the two whitenings (:class:`bha.estimation.innovations.Whitening`): that of noise which is stationary.
    Bands of frequency need every row: one that was not read is put on the line between the readings beside it. A zero
    there would be a spike as high as what is left, which may be a thousand times the noise, and count in all bands.
    """

    def __init__(self, record: Record, model: NoiseModel) -> None:
        """Prepare the factors for the rows of ``record``."""
        self.rows = len(record.rows)
        frequency = frequencies(self.rows, record.sample_time)
        top = min(TOP_FREQUENCY, 0.5 / record.sample_time)
        self.kept = min(self.rows, max(8, int(np.count_nonzero(frequency <= top))))
        band = np.searchsorted(model.edges, frequency[: self.kept], side="right")
        self._slices = [(b, np.flatnonzero(band == b)) for b in range(len(model.edges))]
        self._factors = [np.linalg.inv(np.linalg.cholesky(c)) for c in model.covariance]
        self._read = record.usable
        self._whole = bool(np.all(record.usable))
        start, end = float(record.time[0]), float(record.time[-1])
        #: Time of each white row, s.
        self.time = start + (np.arange(self.kept) + 0.5) / self.kept * (end - start)

    def __call__(self, values: Array) -> Array:
        """White rows of residuals, or of what is linear in them, (rows, C, ...), shape (kept, C, ...).

        What was not read does not count, whatever ``values`` have there.
        """
        shape = (self.kept, *values.shape[1:])
        values = values if self._whole else on_lines(values, self._read)
        coefficients = dct(values.reshape(self.rows, -1), axis=0, norm="ortho")[: self.kept].reshape(*shape[:2], -1)
        for b, index in self._slices:
            if len(index):
                own = slice(index[0], index[-1] + 1)
                coefficients[own] = self._factors[b] @ coefficients[own]
        return np.asarray(idct(coefficients.reshape(self.kept, -1), axis=0, norm="ortho")).reshape(shape)


def on_lines(values: Array, read: NDArray[np.bool_]) -> Array:
    """Values (rows, C, ...) with those that were not read on the line between the readings beside them.

    At either end they are the next reading's; a channel without any is as it was.
    """
    filled = values.copy()
    for channel, own in enumerate(read.T):
        rows, known = np.flatnonzero(~own), np.flatnonzero(own)
        if not len(rows) or not len(known):
            continue
        place = np.searchsorted(known, rows)
        before, after = known[np.maximum(place - 1, 0)], known[np.minimum(place, len(known) - 1)]
        share = np.clip((rows - before) / np.maximum(after - before, 1), 0.0, 1.0)
        share = share.reshape(-1, *[1] * (values.ndim - 2))
        filled[rows, channel] = (1.0 - share) * values[before, channel] + share * values[after, channel]
    return filled
