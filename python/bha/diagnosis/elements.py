"""Second branches and stages of what was named, finer banks: names stay, their form comes nearer to the arm's."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from bha.diagnosis.candidate import Candidate
from bha.diagnosis.crossing import crossed, share_of_excess
from bha.diagnosis.fit import with_sensitivities
from bha.diagnosis.given import Given
from bha.diagnosis.refit import Trial, added, drop
from bha.diagnosis.rules import NOISE_LEFT
from bha.diagnosis.screen import score
from bha.diagnosis.search import Search, by_chance, gain


def with_elements(given: Given, search: Search) -> bool:
    """Further elements of the effects of the best set, where they are needed; whether some were.

    Not where the cost has several valleys: there another stage is a way into one of them.
    """
    problem, rules, trust = given.problem, given.rules, search.plain.fit.trust
    before = search.best
    for key in () if problem.restarts else before.key:
        current = search.best
        candidate = current.candidates[current.key.index(key)]
        if current.fit.squares / problem.rows < NOISE_LEFT:
            break
        if candidate.plan.further is None:
            continue
        given.say(f"further elements of {candidate.kind} at {candidate.where}")
        begin = with_sensitivities(problem, current.fit)
        screening = score(problem, begin, given.signatures)
        own = crossed(problem, begin, trust)
        for start, further, strengths in enlarged(replace(current, fit=begin), key):
            trial = added(given, start, further, strengths)
            if trial is None:
                continue
            chance = screening.chance(gain(current, trial))
            left, gained = current.fit.squares - problem.rows, current.fit.squares - trial.fit.squares
            if chance > rules.chance or gained < rules.element * left:
                continue
            if share_of_excess(own, own, crossed(problem, trial.fit, trust)) >= rules.element:
                search.notes.append(f"further elements of {candidate.kind} at {candidate.where}: {by_chance(chance)}")
                search.best = trial
                break
    return search.best is not before


def enlarged(trial: Trial, key: tuple[str, str]) -> Iterator[tuple[Trial, Candidate, list[float]]]:
    """From where an effect gets more elements: what stays, what comes to it, and the strengths to expect of that.

    Beside one element comes another; in the place of a bank one with elements between its elements as well.
    """
    number = trial.key.index(key)
    candidate, model = trial.candidates[number], trial.fit.model
    elements = model.effects[number].elements([float(v) for v in trial.fit.x[model.place(number)]])
    plan = candidate.plan
    if candidate.bank:
        (strength,) = (s.name for s in plan.strengths)
        finer = candidate.finer()
        rest = tuple(c for k, c in enumerate(trial.candidates) if k != number)
        share = sum(e[strength] for e in elements) / len(finer.bank)
        yield replace(trial, candidates=rest, fit=drop(trial.fit, number)), finer, [share] * len(finer.bank)
        return
    assert plan.further is not None
    for shape in plan.further(elements[0]):
        strengths = [0.3 * elements[0][s.name] for s in plan.strengths] or [1.0] * len(plan.probed(shape))
        yield trial, Candidate(plan, candidate.where, shape), strengths
