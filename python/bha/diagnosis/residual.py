"""What is left after the last model: is it white, what does its spectrum look like, and what does it follow?"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal, stats

from bha.diagnosis.holdout import Holdout
from bha.diagnosis.refit import Trial, correlation_length
from bha.diagnosis.where import block_edges
from bha.estimation.bands import NoiseModel, on_lines

Array = NDArray[np.float64]

#: Frequencies of the spectra that are kept, at the most.
SPECTRUM_POINTS = 80
#: Share of the band of rows that is kept where they were thinned.
THINNED_BAND = 0.65
#: Least travel of a regressor, over the noise of the output it is of, from which a correlation with it means something.
LEAST_TRAVEL = 0.5
#: Power of a spectral line over its surroundings: resonances that noise excites stay below it.
LINE = 80.0


def describe_residual(holdout: Holdout, best: Trial, plain: Trial, noise: NoiseModel) -> dict[str, Any]:
    """Whiteness, spectra, strongest line, and what the residual of the best model correlates with."""
    problem = holdout.problem
    white = best.prediction.white
    if not np.all(np.isfinite(white)):
        return {"mean_square": None, "correlation_rows": None, "follows": [], "line": None, "spectrum": None}
    return {
        "mean_square": best.prediction.mean_square,
        "mean_square_plain": plain.prediction.mean_square,
        "correlation_rows": correlation_length(problem, white),
        "line": _line(holdout, best),
        "spectrum": _spectra(holdout, best, plain, noise),
        "follows": _follows(holdout, best),
    }


def _line(holdout: Holdout, best: Trial) -> dict[str, Any] | None:
    """The strongest narrow line in the spectrum of the residual, if one stands out."""
    power: Array | None = None
    grid = np.linspace(0.2, 12.0, 600)
    for record, y in zip(holdout.problem.records, best.prediction.outputs, strict=True):
        rest = record.measured - y
        rest = (rest - rest.mean(axis=0)) * np.hanning(len(rest))[:, None]
        spectrum = np.abs(np.fft.rfft(rest, 4 * len(rest), axis=0)) ** 2
        frequency = np.fft.rfftfreq(4 * len(rest), record.sample_time)
        total = np.interp(grid, frequency, spectrum.sum(axis=1))
        power = total if power is None else power + total
    assert power is not None
    peak = int(np.argmax(power))
    around = np.median(power[max(0, peak - 60) : peak + 60])
    if power[peak] == 0.0 or power[peak] < LINE * around:
        return None
    return {"frequency": float(grid[peak]), "over_surroundings": float(power[peak] / around)}


def _spectra(holdout: Holdout, best: Trial, plain: Trial, noise: NoiseModel) -> dict[str, list[float]] | None:
    """One-sided densities of the errors on the held-out logs, m^2/Hz, means over outputs: Welch's (1967) averages.

    ``noise`` is what a right model would leave: an orthonormal cosine coefficient of variance v is a density of 2 v dt.
    """
    records = holdout.problem.records
    rows = min(len(r.rows) for r in records)
    length = max(8, min(rows, 2 * SPECTRUM_POINTS))
    found: dict[str, list[Array]] = {"before": [], "after": []}
    weights = []
    frequency = np.empty(0)
    for k, record in enumerate(records):
        weights.append(float(len(record.rows)))
        for name, trial in (("before", plain), ("after", best)):
            rest = np.where(record.usable, record.measured - trial.prediction.outputs[k], 0.0)
            rest = on_lines(rest, record.usable)
            frequency, density = _welch(rest, 1.0 / record.sample_time, length)
            found[name].append(density.mean(axis=1))
    sample_time = float(np.median([r.sample_time for r in records]))
    # The mean of a segment was taken away; rows that were thinned hold nothing above what their filter lets through.
    thinned = any(r.thinning > 1 for r in records)
    keep = (frequency > 0.0) & (frequency <= (THINNED_BAND if thinned else 1.0) * 0.5 / sample_time)
    if not np.any(keep):
        return None
    band = np.searchsorted(noise.edges, frequency, side="right")
    floor = 2.0 * sample_time * np.mean([np.diag(c) for c in noise.covariance], axis=1)[band]
    before, after = (np.average(found[name], axis=0, weights=weights) for name in ("before", "after"))
    return {
        "frequency": frequency[keep].tolist(),
        "before": before[keep].tolist(),
        "after": after[keep].tolist(),
        "noise": floor[keep].tolist(),
    }


def _welch(values: Array, rate: float, length: int) -> tuple[Array, Array]:
    """Frequencies, Hz, and densities of the columns of ``values``, per Hz."""
    frequency, density = signal.welch(values, rate, nperseg=min(length, len(values)), axis=0)
    return np.asarray(frequency, dtype=np.float64), np.asarray(density, dtype=np.float64)


def _follows(holdout: Holdout, best: Trial) -> list[dict[str, Any]]:
    """Rank correlations of the residual (block means) with pose, speed, pressure and time, the strongest first.

    Pose and speed are those simulated: the measured ones share their noise with the residual, and an output that does
    not move would follow itself.
    """
    rows: dict[str, list[float]] = {}
    target: dict[str, list[float]] = {}
    channels = holdout.problem.records[0].channels
    for record, y in zip(holdout.problem.records, best.prediction.outputs, strict=True):
        rest = record.measured - y
        speed = np.gradient(y, record.time, axis=0)
        pressure = record.drive.pressures[record.rows]
        for s in block_edges(record.time, 0.5):
            for k, name in enumerate(channels):
                target.setdefault(name, []).append(float(np.mean(rest[s, k])))
                rows.setdefault(name, []).append(float(np.mean(y[s, k])))
                rows.setdefault(f"d{name}/dt", []).append(float(np.mean(speed[s, k])))
            for k, fact in enumerate(record.pressure_facts):
                rows.setdefault(fact.name, []).append(float(np.mean(pressure[s, k])))
            rows.setdefault("time", []).append(float(np.mean(record.time[s])))
    moves = {
        name: float(np.ptp(rows[name])) > LEAST_TRAVEL * float(np.median([r.noise[k] for r in holdout.problem.records]))
        for k, name in enumerate(channels)
    }
    found = []
    for output, values in target.items():
        for cause, regressor in rows.items():
            still = not moves.get(cause.removeprefix("d").removesuffix("/dt"), True)
            if still or np.ptp(regressor) == 0.0 or np.ptp(values) == 0.0:
                continue
            test = stats.spearmanr(values, regressor)
            found.append(
                {"output": output, "with": cause, "correlation": float(test.statistic), "p_value": float(test.pvalue)}
            )
    found.sort(key=lambda f: -abs(float(str(f["correlation"]))))
    return found[:10]
