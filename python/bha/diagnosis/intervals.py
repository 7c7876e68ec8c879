"""Intervals and confidence from what is left: its memory, and what the logs disagree about.

What: four answers to how far a number may be off. The widest of the first three counts, and the fourth is added to its
square.

1. The noise alone: H^-1, with the sensitivities J and H = J^T J + prior.
2. A residual like the one that is left, drawn anew (:mod:`bha.diagnosis.memory`): H^-1 J^T S J H^-1, S its covariance
   over time and channels. What a model lacks is slow, and errs in all channels together; blocks of a second would take
   it for many independent errors.
3. Logs left out in turn (:mod:`bha.diagnosis.crossing`): the variance of the jackknife with a whole log, or a long
   block where logs are few, as cluster, and Student's t with one degree less than there are clusters. Where an effect
   has another form than the arm's, every sort of motion asks for another number.
4. What the catalogue could still add: where a candidate explains some of what is left, and chance is no good reason,
   the number moves by so much with it in the model. What a wrong form does alike in all logs shows here, and only here.

Source: sandwich covariance with a spectral estimate, Priestley 1981 and Newey and West 1987; the cluster jackknife CV3,
of the cluster-robust estimates the one that holds with few clusters, MacKinnon, Nielsen and Webb 2023.
Validity: the fit is at its minimum, and the catalogue has something like what the model lacks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bha.diagnosis.crossing import FEWEST_BLOCKS, groups, without_groups
from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.information import information
from bha.diagnosis.memory import draws_like
from bha.diagnosis.refit import Trial, correlation_length, criterion
from bha.diagnosis.rules import NOISE_LEFT
from bha.diagnosis.screen import Signatures, score
from bha.diagnosis.where import BLOCK_TIME, block_edges
from bha.estimation.terms import number_of

Array = NDArray[np.float64]

#: Draws of the residual, and of the coordinates.
RESIDUALS, REPEATS = 400, 1000
#: Candidates that may be what a model lacks: least share of what the best explains of the rest, and greatest
#: probability that this is chance.
RIVAL, CHANCE = 0.5, 0.2
#: Share of the excess error on held-out logs from which on these say that there is some of what removes it.
NEARLY_ALL = 0.9


def coordinate_draws(
    problem: Problem, fit: Fit, seed: int, form: Array | float = 0.0, *, between_logs: bool = True
) -> Array:
    """Draws of the change of the coordinates that the data leave open, shape (REPEATS, size).

    ``form`` is what the form of the model leaves open, one standard deviation, see :func:`form_deviation`;
    ``between_logs`` whether what the logs disagree about counts.
    """
    known = information(problem, fit)
    rng = np.random.default_rng([seed, 13])
    scores = known.jacobian.T @ draws_like(problem, fit.residual, RESIDUALS, rng)
    moved = np.linalg.solve(known.normal, scores)
    covariance = moved @ moved.T / RESIDUALS
    noise = np.diag(known.covariance) * max(1.0, fit.squares / problem.rows)
    wanted = np.sqrt(np.maximum(noise, _between_logs(problem, fit) ** 2 if between_logs else 0.0))
    spread = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = rng.standard_normal((REPEATS, len(spread))) @ root.T
    return np.asarray(draws * np.hypot(np.maximum(spread, wanted), form))


def is_told(trial: Trial, draws: Array) -> bool:
    """Whether the strengths of some effect of a set are told from none, at 95 %: one of them, or all together.

    What could be nothing, as far as the logs and what else may be missing say, is no name. Of two strengths that do
    nearly the same neither may be told, and yet not both be none. A set without strengths (lags, dead bands), or with
    one of which more does hardly more (a wall's stiffness), is told.

    Args:
        trial: the set, fitted.
        draws: what the logs and the form leave open of its coordinates, shape (REPEATS, size).
    """
    uncertainty = intervals(trial.fit, draws)
    model, x = trial.fit.model, trial.fit.x
    found = []
    for number, candidate in enumerate(trial.candidates):
        names = {strength.name for strength in candidate.plan.strengths if not strength.hard}
        place = model.place(number)
        own = [k for k in range(place.start, place.stop) if number_of(model.coordinates[k]) in names]
        if own:
            found.append(any(not low <= 0.0 <= high for low, high in (uncertainty[k] for k in own)))
        if len(own) > 1:
            spread = np.cov(draws[:, own], rowvar=False)
            away = float(x[own] @ np.linalg.pinv(spread, rcond=1e-10, hermitian=True) @ x[own])
            found.append(away > float(stats.chi2.ppf(0.95, len(own))))
    return not found or any(found)


def is_there(problem: Problem, trial: Trial, form: Array, seed: int, *, closure: float) -> bool:
    """Whether there is some of what a set names, by the noise and by ``form``, see :func:`form_deviation`.

    What the logs of the fit disagree about counts, too, unless held-out logs say that there is: the set removes nearly
    all of the excess error there, as ``closure`` says.
    """
    draws = coordinate_draws(problem, trial.fit, seed, form, between_logs=closure < NEARLY_ALL)
    return is_told(trial, draws)


def form_deviation(problem: Problem, fit: Fit, signatures: Signatures, seed: int) -> Array:
    """How far each coordinate moves with one more candidate in the model, the farthest of those that may be there.

    That is what explains at least ``RIVAL`` of what the best does, unless chance explains that as well, by an amount
    that an arm may have, and lowers the criterion: a hose of six numbers explains a little of anything.
    """
    found = np.zeros(fit.model.size)
    if fit.squares < NOISE_LEFT * problem.rows:
        # Nothing is missing.
        return found
    screening = score(problem, fit, signatures, seed)
    known = information(problem, fit)
    if not screening.ranking or screening.chance(screening.ranking[0].score) > CHANCE:
        return found
    correlation = correlation_length(problem, fit.residual)
    columns = dict(zip((id(c) for c in signatures.candidates), signatures.columns, strict=True))
    for scored in screening.ranking:
        if scored.score < RIVAL * screening.ranking[0].score:
            break
        larger = criterion(screening.total - scored.score, len(scored.strengths), problem.rows, correlation)
        if larger >= criterion(screening.total, 0, problem.rows, correlation):
            continue
        own = columns.get(id(scored.candidate))
        # Of a bank each element stands in the ranking itself.
        if own is None or not scored.candidate.plan.is_plausible(scored.strengths, scored.candidate.shape):
            continue
        change = sum(
            strength * signatures.table[:, list(parts)].sum(axis=1, dtype=np.float64)
            for strength, parts in zip(scored.strengths, own, strict=True)
        )
        white = known.beyond(np.asarray(change)[:, None])[:, 0]
        found = np.maximum(found, np.abs(np.linalg.solve(known.normal, known.jacobian.T @ white)))
    return found


def _between_logs(problem: Problem, fit: Fit) -> Array:
    """What the logs disagree about in each coordinate, as the standard deviation of a normal of the same 95 % width."""
    moved = np.array(without_groups(problem, fit, groups(problem))) - fit.x
    count = len(moved)
    wide = stats.t.ppf(0.975, count - 1) / stats.norm.ppf(0.975)
    return np.asarray(wide * np.sqrt(np.sum(moved**2, axis=0) * (count - 1) / count))


def intervals(fit: Fit, draws: Array) -> list[tuple[float, float]]:
    """95 % interval of every coordinate's value, from draws of their changes."""
    result = []
    for k, coordinate in enumerate(fit.model.coordinates):
        low, high = np.quantile(draws[:, k], [0.025, 0.975])
        ends = sorted((coordinate.value(fit.x[k] + float(low)), coordinate.value(fit.x[k] + float(high))))
        result.append((ends[0], ends[1]))
    return result


def confidences(problem: Problem, trials: Sequence[Trial], seed: int) -> Array:
    """How often each trial is the best when training blocks are drawn again; shares that sum to one.

    Blocks are as long as the residual remembers, but a few to a log: shorter ones would pass for independent evidence.
    """
    if len(trials) == 1:
        return np.ones(1)
    correlation = correlation_length(problem, trials[0].fit.residual)
    tables = []
    for trial in trials:
        rows: list[float] = []
        for part, whitener in zip(problem.slices(), problem.whiteners, strict=True):
            rest = trial.fit.residual[part].reshape(whitener.kept, -1)
            span, step = float(np.ptp(whitener.time)), float(whitener.time[1] - whitener.time[0])
            block = min(max(BLOCK_TIME, correlation * step), span / FEWEST_BLOCKS)
            rows += [float(np.sum(rest[s] ** 2)) for s in block_edges(whitener.time, block)]
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
