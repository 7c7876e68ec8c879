"""Refits: candidates together with the plain parameters, by simulation, compared by an information criterion.

Source: Schwarz 1978 with the effective sample size of the residual's memory (:mod:`bha.diagnosis.memory`): numbers that
err together count once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.candidate import Candidate, Ranges
from bha.diagnosis.fit import Fit, Problem, columns, evaluate, improve, restarted, weighted
from bha.diagnosis.holdout import Holdout, Prediction
from bha.diagnosis.memory import by_log, numbers_per_independent
from bha.diagnosis.slowness import LAG, better_way
from bha.errors import ConvergenceError
from bha.estimation.integration import resolved
from bha.estimation.terms import EffectTerm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """A refitted model.

    Attributes:
        candidates: its effects, in the order of the model.
        fit: the fit.
        holdout: the held-out logs.
    """

    candidates: tuple[Candidate, ...]
    fit: Fit
    holdout: Holdout

    @cached_property
    def prediction(self) -> Prediction:
        """The held-out logs under it: made when first asked for, since no search decides by it."""
        return self.holdout.predict(self.fit.model, self.fit.x)

    @property
    def key(self) -> tuple[tuple[str, str], ...]:
        """Kinds and places."""
        return tuple(c.key for c in self.candidates)

    @property
    def label(self) -> str:
        """``creep at section 1 and delay at all``; several elements of an effect once."""
        return " and ".join(f"{kind} at {where}" for kind, where in dict.fromkeys(self.key))

    @property
    def size(self) -> int:
        """Numbers of its effects."""
        return sum(c.size for c in self.candidates)


def correlation_length(problem: Problem, white: Array) -> float:
    """By how much the numbers of the white residual err together: numbers per independent one, at least one."""
    return numbers_per_independent(*by_log(problem, white))


def criterion(squares: float, size: int, rows: int, correlation: float) -> float:
    """Bayesian information criterion of a model with ``size`` numbers more than the plain one."""
    effective = rows / correlation
    return float(effective * np.log(squares / rows) + size * np.log(effective))


def bic(trial: Trial, problem: Problem, correlation: float) -> float:
    """The criterion of a trial; its prior counts as data."""
    penalty = trial.fit.prior * trial.fit.trust
    return criterion(trial.fit.squares + penalty, trial.size, problem.rows, correlation)


def stored(problem: Problem, start: Fit, name: str) -> Fit | None:
    """The finished fit of that name, without sensitivities, if the cache has it."""
    found = problem.cache.get(name, {"x": start.x.shape, "states": np.shape(start.states)})
    if found is None:
        return None
    fit = evaluate(problem, start.model, found["x"], list(found["states"]), start.trust)
    return fit if np.isfinite(fit.cost) else None


def store(problem: Problem, fit: Fit, name: str) -> None:
    """Keep a finished fit."""
    problem.cache.put(name, x=fit.x, states=np.array(fit.states))


def refit(
    problem: Problem,
    holdout: Holdout,
    start: Fit,
    candidates: Sequence[Candidate],
    strengths: Sequence[Sequence[float]],
    ranges: Ranges,
    *,
    kept: int,
    iterations: int = 12,
    renewals: int = 1,
) -> Trial | None:
    """Refit with the effects ``candidates``, the first ``kept`` of which are already in ``start``; None if it diverges.

    Args:
        problem: training logs.
        holdout: held-out logs.
        start: where to start, with sensitivities.
        candidates: all effects of the new model.
        strengths: expected strengths of the effects that are new.
        ranges: ranges of the numbers.
        kept: number of effects that ``start`` already has.
        iterations: most steps.
        renewals: how often all sensitivities are renewed.
    """
    made = [c.term(s, ranges) for c, s in zip(candidates[kept:], strengths, strict=True)]
    model = start.model.with_effects([*start.model.effects[:kept], *(term for term, _ in made)])
    old = start.model.with_effects(start.model.effects[:kept]).size
    x = np.concatenate([start.x[:old], *(np.array(begin, dtype=np.float64) for _, begin in made)])
    # Strengths start at zero: the step has to do for those that are expected.
    expected = np.where((x == 0.0) & (np.arange(len(x)) >= old), 1.0, x)
    model = resolved(model, expected, start.states, problem.misfit(start))
    fit = evaluate(problem, model, x, start.states, start.trust)
    if not np.isfinite(fit.cost):
        return None
    name = f"refit {[c.name for c in candidates]} {kept} {renewals}"
    known = stored(problem, fit, name)
    fit = known or fit
    new = list(range(old, model.size))
    assert start.jacobian is not None
    jacobian = np.concatenate([start.jacobian[:, :old], columns(problem, fit, new)], axis=1)
    fit = weighted(problem, replace(fit, jacobian=jacobian, state_jacobians=start.state_jacobians))
    effect_coordinates = list(range(len(model.plain), model.size))
    if not known:
        try:
            fit = improve(
                problem,
                fit,
                iterations=iterations,
                renew=effect_coordinates,
                renewals=renewals,
                tolerance=2e-3,
                limit=1.0,
            )
        except ConvergenceError:
            return None
        fit = restarted(problem, fit)
        if any(c.kind == LAG for c in candidates[kept:]):
            fit = better_way(problem, fit)
        store(problem, fit, name)
    acting, fit = without_idle(candidates, fit)
    return Trial(acting, fit, holdout)


def without_idle(candidates: Sequence[Candidate], fit: Fit) -> tuple[tuple[Candidate, ...], Fit]:
    """The same fit without the elements of banks that have come out as nothing; a bank keeps one in any case."""
    acting: list[Candidate] = []
    terms: list[EffectTerm] = []
    kept = list(range(len(fit.model.plain)))
    for number, (candidate, term) in enumerate(zip(candidates, fit.model.effects, strict=True)):
        place = fit.model.place(number)
        own = list(range(place.start, place.stop))
        if candidate.bank:
            strengths = [c.value(float(v)) for c, v in zip(term.coordinates, fit.x[place], strict=True)]
            which = [k for k, strength in enumerate(strengths) if strength] or [0]
            candidate, term = candidate.only(which), term.only(which)  # noqa: PLW2901
            own = [own[k] for k in which]
        acting.append(candidate)
        terms.append(term)
        kept += own
    if len(kept) == fit.model.size:
        return tuple(candidates), fit
    jacobian = None if fit.jacobian is None else fit.jacobian[:, kept]
    return tuple(acting), replace(fit, model=fit.model.with_effects(terms), x=fit.x[kept], jacobian=jacobian)


def drop(start: Fit, index: int) -> Fit:
    """``start`` without its effect ``index``: not fitted again, and without outputs of its own."""
    model = start.model.with_effects([e for k, e in enumerate(start.model.effects) if k != index])
    gone = start.model.place(index)
    keep = [k for k in range(start.model.size) if not gone.start <= k < gone.stop]
    jacobian = None if start.jacobian is None else start.jacobian[:, keep]
    return replace(start, model=model, x=start.x[keep], jacobian=jacobian)


def without(problem: Problem, holdout: Holdout, trial: Trial, index: int, *, iterations: int = 6) -> Trial | None:
    """The trial refitted without its effect ``index``; None if that diverges."""
    smaller = drop(trial.fit, index)
    fit = evaluate(problem, smaller.model, smaller.x, smaller.states, smaller.trust)
    if not np.isfinite(fit.cost):
        return None
    fit = replace(fit, jacobian=smaller.jacobian, state_jacobians=smaller.state_jacobians)
    renew = list(range(len(fit.model.plain), fit.model.size))
    try:
        fit = improve(problem, fit, iterations=iterations, renew=renew, renewals=2, tolerance=2e-3, limit=1.0)
    except ConvergenceError:
        return None
    fit = restarted(problem, fit)
    rest = tuple(c for k, c in enumerate(trial.candidates) if k != index)
    return Trial(rest, fit, holdout)
