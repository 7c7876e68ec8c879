"""Effects of a set of several exchanged for look-alikes where that lowers the criterion."""

from __future__ import annotations

from functools import partial

from bha.diagnosis.abreast import abreast
from bha.diagnosis.contenders import promising
from bha.diagnosis.given import Given
from bha.diagnosis.ranking import on_bound
from bha.diagnosis.refit import Trial, added, bic, correlation_length
from bha.diagnosis.screen import Scored, score
from bha.diagnosis.search import Search


def swap(given: Given, search: Search) -> bool:
    """Exchange each effect of a set of several for its best look-alike; whether one was exchanged."""
    problem, rules, swapped = given.problem, given.rules, False
    for k in range(len(search.best.candidates)):
        if len(search.best.candidates) < 2:
            break
        current = search.best
        given.say(f"look-alikes of {current.key[k][0]} at {current.key[k][1]}")
        smaller = search.without(given, k)
        if smaller is None:
            continue
        ranking = score(problem, smaller.fit, given.signatures).ranking
        correlation = correlation_length(problem, current.fit.residual)
        own = max((scored.score for scored in ranking if scored.candidate.key == current.key[k]), default=0.0)
        chosen = [
            s for s in promising(ranking, current.key, 2, 1, problem.rows / correlation) if s.score >= rules.like * own
        ]
        held = on_bound(current, k)
        trials = abreast(problem, partial(_beside, given, smaller), chosen, lambda _: None)
        for trial in trials:
            if trial is None:
                continue
            search.trials.append(trial)
            if on_bound(trial) and not held:
                # It is not this kind: friction begins where the range of a hysteresis ends.
                continue
            if bic(current, problem, correlation) - bic(trial, problem, correlation) > rules.swap:
                search.notes.append(f"{trial.label} in place of {current.label}")
                search.best = current = trial
                swapped = True
    return swapped


def _beside(given: Given, smaller: Trial, scored: Scored) -> Trial | None:
    return added(given, smaller, scored.candidate, scored.strengths)
