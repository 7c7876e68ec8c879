"""The last stage of a joint fit: the noises with the parameters; whether it is wanted, and whether its fit is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bha.errors import ConvergenceError
from bha.estimation.disturbed import Disturbed, fit_with_noise
from bha.estimation.pace import Pace
from bha.estimation.pressure_noise import is_noisy, without_pressure_noise
from bha.estimation.problem import Point, Problem
from bha.estimation.records import Record
from bha.estimation.settings import Settings
from bha.estimation.solver import Outcome
from bha.estimation.stages import TOLERANCE, stage_problem, wants_noises

#: Windows in which noises are estimated last at least this long, s, and no longer than logs.
_NOISE_WINDOW = 30.0
#: Variance of a coordinate above which output error does not tell a parameter: one half.
_TOLD = 0.25


def with_noises(problem: Problem, outcome: Outcome, settings: Settings, pace: Pace) -> Disturbed | None:
    """The last stage, in windows as long as what is slow; None where it is not wanted, or its simulations fail."""
    # It begins near a minimum.
    if not (wants_noises(problem.model, settings) and outcome.converged):
        return None
    assert settings.windows is not None
    pace.last("noises")
    length = None if settings.windows[-1] is None else max(settings.windows[-1], _NOISE_WINDOW)
    point = outcome.point
    try:
        long = stage_problem(problem.model, point.z, problem.prior, length, settings)
        start = Point(point.z, long.guesses)
        if not np.isfinite(long.evaluated(start.z, start.states).cost):
            # An arm near the edge of stability is followed in short windows only.
            long, start = problem, point
        found = fit_with_noise(long, start, max_iterations=settings.max_iterations, tolerance=TOLERANCE)
        return found if _tells(problem, outcome, found, settings) else None
    except (ConvergenceError, np.linalg.LinAlgError):
        return None


def _tells(problem: Problem, outcome: Outcome, found: Disturbed, settings: Settings) -> bool:
    """Whether output error tells every parameter, under as much noise of the logged pressures as there may be.

    Where that noise passes for excitation, innovations take it for knowledge. What differences of readings say of it
    would not do for sparse logs: at 10 Hz they take motion for noise, of the input that moves least the least.
    """
    most = found.most_logged()
    records = tuple(
        rec.with_pressure_noise(most * np.minimum(rec.pressure_noise, _least(rec))) for rec in problem.model.records
    )
    problem = replace(problem, model=replace(problem.model, records=records))
    if not (settings.draws and is_noisy(problem)):
        return True
    known = without_pressure_noise(problem, outcome, seed=settings.seed, draws=settings.draws)[2].information
    values, vectors = np.linalg.eigh(0.5 * (known + known.T))
    return bool(np.all(np.sum(vectors**2 / np.maximum(values, 1e-12 * values[-1]), axis=1) <= _TOLD))


def _least(rec: Record) -> float:
    """Least noise of a logged pressure that has some, Pa: the inputs of an arm have sensors of one sort."""
    noisy = rec.pressure_noise[rec.pressure_noise > 0.0]
    return float(np.min(noisy)) if len(noisy) else 0.0
