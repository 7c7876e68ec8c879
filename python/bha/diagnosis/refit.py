"""Refits: candidates together with the plain parameters, by simulation, compared by an information criterion.

Source: Schwarz 1978 with the effective sample size of the residual's memory (:mod:`bha.diagnosis.memory`): numbers that
err together count once.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.candidate import Candidate
from bha.diagnosis.fit import (
    Fit,
    Problem,
    as_measured,
    columns,
    evaluate,
    improve,
    restarted,
    state_columns,
    weighted,
    with_sensitivities,
)
from bha.diagnosis.given import Given
from bha.diagnosis.holdout import Holdout, Prediction
from bha.diagnosis.memory import by_log, numbers_per_independent
from bha.diagnosis.model import of_sensors
from bha.diagnosis.slowness import LAG, better_way
from bha.diagnosis.valves import is_of_valves
from bha.errors import ConvergenceError
from bha.estimation.integration import resolved
from bha.estimation.terms import EffectTerm, number_of
from bha.recordings.beginning import preloaded
from bha.recordings.strained import KIND as MEMORY

Array = NDArray[np.float64]

#: Most steps of a refit, how often it may renew its sensitivities, and from which gain on it goes on, as a share of the
#: cost: to its end, since what a refit stopped short of would look for another name.
ITERATIONS, RENEWALS, TOLERANCE = 40, 12, 2e-3
#: The same gain where no other name is looked for in what is left, of all but the best of a round.
COARSE_TOLERANCE = 2e-2
#: Greatest step of a refit, in plausible distances: of numbers in which the outputs are smooth, and of the shapes of
#: effects (a wall's place, a yield), where a far step ends in a valley beside.
GREATEST_STEP, GREATEST_OF_SHAPES = 3.0, 1.0
#: Share of what its score promises below which a refit is stuck where the plain numbers have made up for the effect: a
#: damping of 5 deviations, of which a bending damping beside it is to take over a part (docs/decisions/0019).
STUCK = 0.25
#: Cost of a new effect's start over that without it from which it begins with less, and the shares that are tried.
WORSE, LESS = 1.2, (0.3, 0.1, 0.03, 0.01, 0.003)


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


def added(
    given: Given,
    start: Trial,
    candidate: Candidate,
    strengths: Sequence[float],
    promised: float = 0.0,
    *,
    anew: bool = False,
) -> Trial | None:
    """``start`` refitted with one more effect; None if that diverges.

    Args:
        given: what the search is given.
        start: the set to begin with, with its sensitivities.
        candidate: the effect that is new.
        strengths: its expected strengths.
        promised: drop of the sum of squares by its score. Where a fit brings far less it is stuck, and begins once more
            at the file's values.
        anew: whether ``start`` has other numbers than those with which its set was found.
    """
    problem, begin = given.problem, start.fit
    candidates = (*start.candidates, candidate)
    term, own = candidate.term(strengths, given.ranges)
    strong = candidate.kind == MEMORY and bool(preloaded(begin.model.parameters))
    if strong:
        # From as much as is expected: where logs begin, little is strained to its limit and tells nothing of more.
        typical = {s.name: s.typical for s in candidate.plan.strengths}
        own = [
            c.coordinate(typical[number_of(c)]) if number_of(c) in typical else v
            for c, v in zip(term.coordinates, own, strict=True)
        ]
    model = begin.model.with_effects([*begin.model.effects, term])
    x = np.concatenate([begin.x, np.array(own, dtype=np.float64)])
    old = len(begin.x)
    # Strengths start at zero: the step has to do for those that are expected.
    expected = np.where((x == 0.0) & (np.arange(len(x)) >= old), 1.0, x)
    model = resolved(model, expected, begin.states, problem.misfit(begin))
    fit = evaluate(problem, model, x, begin.states, begin.trust)
    if candidate.plan.begin is not None:
        fit = _gently(given, fit, start, candidate, strengths)
    if not np.isfinite(fit.cost):
        return None
    name = f"added {[c.name for c in candidates]}{' anew' if anew else ''}"
    known = stored(problem, fit, name)
    fit = known or fit
    assert begin.jacobian is not None
    if strong:
        # Beside much of it the plain numbers do something else than without any.
        fit = weighted(problem, with_sensitivities(problem, fit))
    else:
        jacobian = np.concatenate([begin.jacobian, columns(problem, fit, range(old, model.size))], axis=1)
        # What the new effect remembers of the motion before a log is a state of its own.
        more = remembers_more(problem, fit, begin)
        by_states = state_columns(problem, fit) if more else begin.state_jacobians
        fit = weighted(problem, replace(fit, jacobian=jacobian, state_jacobians=by_states))
    if not known:
        tolerance = TOLERANCE if given.rules.thorough else COARSE_TOLERANCE
        ends = []
        with suppress(ConvergenceError):
            ends.append(to_its_end(problem, fit, tolerance=tolerance))
        stuck = not ends or begin.squares - ends[0].squares < STUCK * promised
        if candidate.plan.is_a_law or stuck:
            with suppress(ConvergenceError):
                ends.append(to_its_end(problem, _as_filed(problem, fit), tolerance=tolerance))
        if not ends:
            return None
        fit = min(ends, key=lambda end: end.cost)
        store(problem, fit, name)
    acting, fit = without_idle(candidates, fit)
    return Trial(acting, fit, given.holdout)


def remembers_more(problem: Problem, fit: Fit, before: Fit) -> bool:
    """Whether a fit has memories of what was before its logs that another one of them has not."""
    return any(np.any(fit.model.memories(w) & ~before.model.memories(w)) for w in problem.windows)


def _gently(given: Given, fit: Fit, start: Trial, candidate: Candidate, strengths: Sequence[float]) -> Fit:
    """``fit``, where a new effect begins with what is expected of it, or with as much less as makes it no worse.

    What is expected holds for little, and together with other plain parameters: a stiff hose alone holds the arm fast.
    """
    own = fit.model.place(-1)
    for share in LESS:
        if fit.cost <= WORSE * start.fit.cost:
            break
        term, values = candidate.term([share * strength for strength in strengths], given.ranges)
        x = fit.x.copy()
        x[own] = [
            ours.coordinate(theirs.value(value))
            for ours, theirs, value in zip(fit.model.coordinates[own], term.coordinates, values, strict=True)
        ]
        fewer = evaluate(given.problem, fit.model, x, fit.states, fit.trust)
        if fewer.cost < fit.cost or not np.isfinite(fit.cost):
            fit = fewer
    return fit


def _as_filed(problem: Problem, fit: Fit) -> Fit:
    """The fit with the arm's numbers as its file has them; with its sensitivities.

    Where the plain numbers need not make up for anything any more they are far from where they were.

    Raises:
        ConvergenceError: it diverges.
    """
    kept = [of_sensors(c) or is_of_valves(c) for c in fit.model.plain]
    x = np.where(kept, fit.x[: len(kept)], 0.0)
    filed = evaluate(problem, fit.model, np.concatenate([x, fit.x[len(kept) :]]), fit.states, fit.trust)
    return weighted(problem, with_sensitivities(problem, filed))


def to_its_end(problem: Problem, fit: Fit, tolerance: float = TOLERANCE) -> Fit:
    """The fit, gone on from where it is until nothing is left to gain; ``fit`` with its sensitivities.

    Outputs are far from linear in the shapes of effects: effects that have some have their sensitivities taken anew in
    every step.

    Raises:
        ConvergenceError: the start diverges.
    """
    limit = np.full(fit.model.size, GREATEST_STEP)
    renew: list[int] = []
    for number in range(len(fit.model.effects)):
        own = range(*fit.model.place(number).indices(fit.model.size))
        # Strengths have no prior, but for few.
        shapes = [k for k in own if fit.model.coordinates[k].prior_weight > 0.0]
        limit[shapes] = GREATEST_OF_SHAPES
        renew += own if shapes else []
    return improve(
        problem, fit, iterations=ITERATIONS, renew=renew, renewals=RENEWALS, tolerance=tolerance, limit=limit
    )


def refined(given: Given, trial: Trial, *, anew: bool = False) -> Trial:
    """The trial, fitted to its end at a step that resolves what was found, with sensitivities of its own.

    Where the cost has several valleys the others are tried from here, and not for every candidate: what is best of its
    round in the valley of the plain fit is what a search goes on with. ``anew`` as in :func:`added`.
    """
    problem, fit = given.problem, trial.fit
    name = f"refined {[c.name for c in trial.candidates]}{' anew' if anew else ''}"
    # What was found may be stiffer than what was expected.
    model = resolved(fit.model, fit.x, fit.states, problem.misfit(fit))
    if model.integration.finer != fit.model.integration.finer:
        fit = evaluate(problem, model, fit.x, fit.states, fit.trust)
    known = stored(problem, fit, name)
    fit = with_sensitivities(problem, known or fit)
    if known is None:
        fit = restarted(problem, to_its_end(problem, fit, tolerance=0.5 * TOLERANCE))
        if trial.candidates[-1].kind == LAG:
            fit = better_way(problem, fit)
        fit = as_measured(problem, fit)
        store(problem, fit, name)
    candidates, fit = without_idle(trial.candidates, fit)
    return Trial(candidates, fit, given.holdout)


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


def evaluated_without(given: Given, trial: Trial, index: int) -> Fit:
    """The fit of a trial without its effect ``index``, its other numbers as they are; infinite cost if it diverges."""
    smaller = drop(trial.fit, index)
    fit = evaluate(given.problem, smaller.model, smaller.x, smaller.states, smaller.trust)
    return replace(fit, jacobian=smaller.jacobian, state_jacobians=smaller.state_jacobians)


def without(given: Given, trial: Trial, index: int) -> Trial | None:
    """The trial refitted without its effect ``index``; None if that diverges."""
    problem, fit = given.problem, evaluated_without(given, trial, index)
    if not np.isfinite(fit.cost):
        return None
    try:
        fit = improve(problem, fit, iterations=ITERATIONS, renewals=RENEWALS, tolerance=TOLERANCE, limit=GREATEST_STEP)
    except ConvergenceError:
        return None
    fit = restarted(problem, fit)
    rest = tuple(c for k, c in enumerate(trial.candidates) if k != index)
    return Trial(rest, fit, given.holdout)
