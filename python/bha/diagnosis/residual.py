"""What is left after the last model: is it white, and what does it follow?"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bha.diagnosis.holdout import Holdout
from bha.diagnosis.refit import Trial, correlation_length
from bha.diagnosis.where import block_edges

Array = NDArray[np.float64]

#: Power of a spectral line over its surroundings: resonances that noise excites stay below it.
LINE = 80.0


def describe_residual(holdout: Holdout, best: Trial, plain: Trial, seed: int) -> dict[str, Any]:
    """Whiteness, strongest line of the spectrum, and what the residual of the best model correlates with."""
    del seed
    problem = holdout.problem
    white = best.prediction.white
    if not np.all(np.isfinite(white)):
        return {"mean_square": None, "correlation_rows": None, "follows": [], "line": None}
    return {
        "mean_square": best.prediction.mean_square,
        "mean_square_plain": plain.prediction.mean_square,
        "correlation_rows": correlation_length(problem, white),
        "line": _line(holdout, best),
        "follows": _follows(holdout, best),
    }


def _line(holdout: Holdout, best: Trial) -> dict[str, Any] | None:
    """The strongest narrow line in the spectrum of the residual, if one stands out."""
    power: Array | None = None
    grid = np.linspace(0.2, 12.0, 600)
    for record, y in zip(holdout.problem.records, best.prediction.outputs, strict=True):
        rest = record.outputs - y
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


def _follows(holdout: Holdout, best: Trial) -> list[dict[str, Any]]:
    """Rank correlations of the residual (block means) with pose, speed, pressure and time, the strongest first."""
    rows: dict[str, list[float]] = {}
    target: dict[str, list[float]] = {}
    channels = holdout.problem.records[0].channels
    for record, y in zip(holdout.problem.records, best.prediction.outputs, strict=True):
        rest = record.outputs - y
        speed = np.gradient(record.outputs, record.output_time, axis=0)
        pressure = record.pressures[record.rows]
        for s in block_edges(record.output_time, 0.5):
            for k, name in enumerate(channels):
                target.setdefault(name, []).append(float(np.mean(rest[s, k])))
                rows.setdefault(name, []).append(float(np.mean(record.outputs[s, k])))
                rows.setdefault(f"d{name}/dt", []).append(float(np.mean(speed[s, k])))
            for k, fact in enumerate(record.pressure_facts):
                rows.setdefault(fact.name, []).append(float(np.mean(pressure[s, k])))
            rows.setdefault("time", []).append(float(np.mean(record.output_time[s])))
    found = []
    for output, values in target.items():
        for cause, regressor in rows.items():
            if np.ptp(regressor) == 0.0 or np.ptp(values) == 0.0:
                continue
            test = stats.spearmanr(values, regressor)
            found.append(
                {"output": output, "with": cause, "correlation": float(test.statistic), "p_value": float(test.pvalue)}
            )
    found.sort(key=lambda f: -abs(float(str(f["correlation"]))))
    return found[:10]
