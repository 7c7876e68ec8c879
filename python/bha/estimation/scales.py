"""What residuals count in: the sensors' noise, or what the model leaves, as far as that is more; and a fit with them.

What a model lacks errs alike for seconds. How many numbers of a residual say the same decides when a search has ended
(:meth:`Policy.among`) and how much priors count beside it (:attr:`Residuals.lasting`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bha.estimation.long_run import correlation_length
from bha.estimation.problem import Point, Problem, Residuals
from bha.estimation.records import Record
from bha.estimation.solver import Interrupted, Outcome, Policy, solve

Array = NDArray[np.float64]

_MEDIAN_NORMAL = 0.6745
#: Scales that change by less than this part are settled.
_SETTLED = 0.05


def scales(problem: Problem, point: Point) -> Residuals:
    """Scale of each channel: its sensor noise, or the robust spread of its residuals where that is larger."""
    records = problem.model.records
    shown = problem.by_record(problem.model.predict(point.z, problem.windows, point.states))
    tables = [np.where(rec.usable, rec.measured - own, np.nan) for rec, own in zip(records, shown, strict=True)]
    spreads = _pooled(records, tables) if problem.residuals.pooled else [_spread(table) for table in tables]
    found = [
        np.where(left > 1.05 * rec.noise, problem.residuals.lasting * left, rec.noise)
        for rec, left in zip(records, spreads, strict=True)
    ]
    return replace(problem.residuals, scale=tuple(found))


def _spread(error: Array) -> Array:
    """Robust spread of each channel, shape (C,); 0 where nothing counts."""
    good = np.any(np.isfinite(error), axis=0)
    left = np.array([np.nanmedian(np.abs(e)) if g else 0.0 for e, g in zip(error.T, good, strict=True)])
    return np.asarray(left / _MEDIAN_NORMAL)


def _pooled(records: Sequence[Record], errors: Sequence[Array]) -> list[Array]:
    """Root mean square of all channels of a kind in all records, for each channel, shape (C,)."""
    kinds = [[output.kind for output in rec.observation.outputs] for rec in records]
    pooled: dict[str, float] = {}
    for kind in {kind for own in kinds for kind in own}:
        squares = [
            error[:, [k for k, other in enumerate(own) if other == kind]].ravel() ** 2
            for own, error in zip(kinds, errors, strict=True)
        ]
        every = np.concatenate(squares)
        pooled[kind] = float(np.sqrt(np.nanmean(every))) if np.isfinite(every).any() else 0.0
    return [np.array([pooled[kind] for kind in own]) for own in kinds]


def fit_with_scales(
    problem: Problem,
    point: Point,
    *,
    max_iterations: int,
    tolerance: float,
    damping: float = 1e-4,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Minimise while the channels' scales shrink to what the model leaves; the last search keeps them."""
    total = 0
    outcome = Outcome(point, False, "not started", 0)
    while total < max_iterations:
        before = problem.residuals.scale
        problem = problem.rescaled(scales(problem, outcome.point))
        change = max(float(np.max(np.abs(np.log(a / b)))) for a, b in zip(problem.residuals.scale, before, strict=True))
        settled = change < _SETTLED or total > max_iterations // 2
        try:
            start = problem.evaluated(outcome.point.z, outcome.point.states)
            policy = Policy(
                max_iterations=max_iterations - total if settled else min(3, max_iterations - total),
                tolerance=tolerance if settled else 1e-2,
                damping=damping,
            ).among(alike(problem, start))
            outcome = solve(problem, start, policy, progress=_shifted(progress, total))
        except Interrupted as stopped:
            raise Interrupted(replace(stopped.outcome, iterations=total + stopped.outcome.iterations)) from None
        total += max(1, outcome.iterations)
        if settled:
            break
    return replace(outcome, iterations=total)


def alike(problem: Problem, point: Point) -> float:
    """How many numbers of the residual say the same: what a model lacks errs alike for seconds; 1 if it is white.

    By this factor a standard error is larger, squared, than independent numbers would have it, and the loss has to
    fall by more to mean anything (:meth:`Policy.among`). By as much less where scales count it already
    (:attr:`Settings.lasting`): a residual that is small in its scales moves the loss by little.
    """
    if point.left is None:
        return 1.0
    columns = [left[:, c] for left in point.left for c in range(left.shape[1])]
    counted = problem.residuals.lasting > 1.0
    lengths = [correlation_length([own]) * (min(1.0, float(np.mean(own**2))) if counted else 1.0) for own in columns]
    return max(1.0, float(np.median(lengths))) if lengths else 1.0


def _shifted(progress: Callable[[int, float], None] | None, by: int) -> Callable[[int, float], None] | None:
    return None if progress is None else lambda iteration, cost: progress(iteration + by, cost)
