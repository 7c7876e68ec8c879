"""Which trial of a round comes first: by the criterion, and where that is no difference by something better."""

from __future__ import annotations

from collections.abc import Callable

from bha.diagnosis.crossing import crossed
from bha.diagnosis.fit import Problem
from bha.diagnosis.given import Given
from bha.diagnosis.places import members
from bha.diagnosis.refit import Trial, bic, correlation_length
from bha.diagnosis.rules import Rules


def by_criterion(trials: list[Trial], problem: Problem) -> list[Trial]:
    """The trials, that of the lowest criterion first."""
    if not trials:
        return trials
    correlation = correlation_length(problem, min(trials, key=lambda t: t.fit.squares).fit.residual)
    return sorted(trials, key=lambda t: bic(t, problem, correlation))


def in_order(given: Given, current: Trial, trust: float, trials: list[Trial]) -> list[Trial]:
    """The trials of a round, beside whose effects those of ``current`` stand already, the best first.

    ``trust`` is the weight of the priors where logs are left out, see :func:`bha.diagnosis.crossing.crossed`.
    """
    problem, rules = given.problem, given.rules
    trials = best_predicting_first(by_criterion(trials, problem), problem, rules, trust)
    trials = off_bounds_first(trials, current, problem, rules)
    return widest_first(trials, current, problem, rules) if problem.restarts and trials else trials


def best_predicting_first(trials: list[Trial], problem: Problem, rules: Rules, trust: float) -> list[Trial]:
    """The same trials, the first one exchanged for one that is even with it and predicts left-out logs better.

    The criterion counts numbers, and between one of one number and one of two it decides by how many of the residual's
    are independent, which is known to a factor.
    """
    if len(trials) < 2:
        return trials
    correlation = correlation_length(problem, min(trials, key=lambda t: t.fit.squares).fit.residual)
    least = bic(trials[0], problem, correlation)
    even = [t for t in trials if bic(t, problem, correlation) - least < rules.even and t.fit.jacobian is not None]
    if len(even) < 2:
        return trials
    chosen = min(even, key=lambda t: crossed(problem, t.fit, trust))
    return [chosen, *(t for t in trials if t is not chosen)]


def off_bounds_first(trials: list[Trial], current: Trial, problem: Problem, rules: Rules) -> list[Trial]:
    """The same trials, the first one, if it sits on a bound, exchanged for one that does not and is nearly as good."""
    if not trials or not on_bound(trials[0]):
        return trials
    correlation = correlation_length(problem, trials[0].fit.residual)
    before = bic(current, problem, correlation)
    needed = rules.bound * (before - bic(trials[0], problem, correlation))
    return _first(trials, lambda t: not on_bound(t) and before - bic(t, problem, correlation) >= needed)


def on_bound(trial: Trial, number: int = -1) -> bool:
    """Whether the newest effect of a trial has a number on a bound: then it is not this kind, or not here."""
    model = trial.fit.model
    return bool(model.effects[number].on_bound(trial.fit.x[model.place(number)]))


def widest_first(trials: list[Trial], current: Trial, problem: Problem, rules: Rules) -> list[Trial]:
    """The same trials, the first one exchanged for one of its kind in a wider place where that is hardly worse.

    Where the cost has several valleys a small difference of the criterion is one of valleys, not of places.
    """
    best = trials[0]
    correlation = correlation_length(problem, best.fit.residual)
    before, least = bic(current, problem, correlation), bic(best, problem, correlation)
    limit = least + rules.narrow * max(0.0, before - least)
    core = best.fit.model.core
    place = set(members(best.key[-1][1], best.candidates[-1].plan.parts, core))

    def wanted(trial: Trial) -> bool:
        kind, where = trial.key[-1]
        wider = kind == best.key[-1][0] and place < set(members(where, trial.candidates[-1].plan.parts, core))
        return wider and bic(trial, problem, correlation) < limit

    return _first(trials, wanted)


def _first(trials: list[Trial], wanted: Callable[[Trial], bool]) -> list[Trial]:
    """The same trials, the first of the others that is ``wanted`` in front."""
    chosen = next((t for t in trials[1:] if wanted(t)), trials[0])
    return [chosen, *(t for t in trials if t is not chosen)]
