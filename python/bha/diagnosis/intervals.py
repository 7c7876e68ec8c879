"""Intervals and confidence by resampling blocks of the residual, and by what the logs disagree about.

Source: block bootstrap (Kunsch 1989) of the score: with the sensitivities J and the white residual r, resampled blocks
b move the estimate by H^-1 sum_b (w_b - 1) J_b^T r_b, H = J^T J + prior; refits are not needed. Real effects have other
forms than the model's, and then every sort of motion asks for other numbers, consistently, which blocks of a second do
not show. Logs differ in their motion: the cluster-robust variance H^-1 (sum_g s_g s_g^T) H^-1 G / (G - 1) with a whole
log (or a third of the only one) as cluster g, s_g = J_g^T r_g, and Student's t with G - 1 degrees (Liang and Zeger
1986; Cameron and Miller 2015) has that spread in it.
Validity: the fit is at its minimum, and blocks are longer than the residual's correlation. What a wrong form does alike
in all logs is not in the intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bha.diagnosis.fit import Fit, Problem, project_states
from bha.diagnosis.refit import Trial, correlation_length
from bha.diagnosis.where import block_edges

Array = NDArray[np.float64]

REPEATS = 1000


def coordinate_draws(problem: Problem, fit: Fit, seed: int) -> Array:
    """Bootstrap changes of the coordinates, shape (REPEATS, size)."""
    assert fit.jacobian is not None
    assert fit.state_jacobians is not None
    jacobian = project_states(problem, fit.state_jacobians, fit.jacobian)
    weights = fit.trust * np.array([c.prior_weight for c in fit.model.coordinates])
    normal = jacobian.T @ jacobian + np.diag(weights)
    normal += 1e-12 * np.trace(normal) / len(normal) * np.eye(len(normal))
    scores: list[Array] = []
    ends = [0]
    for part, whitener in zip(problem.slices(), problem.whiteners, strict=True):
        rows = jacobian[part].reshape(whitener.kept, -1, jacobian.shape[1])
        rest = fit.residual[part].reshape(whitener.kept, -1)
        scores += [np.einsum("tck,tc->k", rows[s], rest[s]) for s in block_edges(whitener.time)]
        ends.append(len(scores))
    table = np.array(scores)
    rng = np.random.default_rng([seed, 13])
    counts = rng.multinomial(len(table), np.full(len(table), 1.0 / len(table)), size=REPEATS)
    draws = np.linalg.solve(normal, ((counts - 1.0) @ table).T).T
    # Never narrower than the noise alone makes them.
    least = np.sqrt(np.diag(np.linalg.inv(normal)) * max(1.0, fit.squares / problem.rows))
    spread = np.std(draws, axis=0)
    wanted = np.maximum(least, _between_logs(table, ends, normal))
    return np.asarray(draws * np.maximum(1.0, wanted / np.maximum(spread, 1e-300)))


def _between_logs(table: Array, ends: Sequence[int], normal: Array) -> Array:
    """What the logs disagree about in each coordinate, as the standard deviation of a normal of the same 95 % width."""
    edges = list(ends) if len(ends) > 2 else [round(k * len(table) / 3) for k in range(4)]
    clusters = [table[a:b].sum(axis=0) for a, b in pairwise(edges) if b > a]
    count = len(clusters)
    if count < 2:
        return np.zeros(table.shape[1])
    moved = np.linalg.solve(normal, np.array(clusters).T)
    wide = stats.t.ppf(0.975, count - 1) / stats.norm.ppf(0.975)
    return np.asarray(wide * np.sqrt(np.sum(moved**2, axis=1) * count / (count - 1)))


def intervals(problem: Problem, fit: Fit, seed: int) -> list[tuple[float, float]]:
    """95 % interval of every coordinate's value."""
    draws = coordinate_draws(problem, fit, seed)
    result = []
    for k, coordinate in enumerate(fit.model.coordinates):
        low, high = np.quantile(draws[:, k], [0.025, 0.975])
        ends = sorted((coordinate.value(fit.x[k] + float(low)), coordinate.value(fit.x[k] + float(high))))
        result.append((ends[0], ends[1]))
    return result


def confidences(problem: Problem, trials: Sequence[Trial], seed: int) -> Array:
    """How often each trial is the best when training and held-out blocks are drawn again; shares that sum to one."""
    if len(trials) == 1:
        return np.ones(1)
    correlation = correlation_length(problem, trials[0].fit.residual)
    tables = []
    for trial in trials:
        rows: list[float] = []
        for part, whitener in zip(problem.slices(), problem.whiteners, strict=True):
            rest = trial.fit.residual[part].reshape(whitener.kept, -1)
            rows += [float(np.sum(rest[s] ** 2)) for s in block_edges(whitener.time)]
        tables.append(rows)
    table = np.array(tables)
    rng = np.random.default_rng([seed, 17])
    counts = rng.multinomial(table.shape[1], np.full(table.shape[1], 1.0 / table.shape[1]), size=REPEATS)
    sums = counts @ table.T
    effective = problem.rows / correlation
    sizes = np.array([t.size for t in trials], dtype=np.float64)
    values = effective * np.log(sums / problem.rows) + sizes * np.log(effective)
    best = np.argmin(values, axis=1)
    return np.bincount(best, minlength=len(trials)) / REPEATS
