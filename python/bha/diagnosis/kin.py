"""Slip of another kind in the place of the one that was found, begun where that ended.

Friction is hysteresis of so small a yield that a bellows slips before it has moved, with a bump where it breaks away.
What sticks is far from smooth: a fit of one begun at the plain numbers, which have made up for it, ends in a chatter of
its own; one begun with what the other has found ends beside it, and the logs say which it is.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from bha.diagnosis.candidate import Candidate
from bha.diagnosis.fit import evaluate, weighted, with_sensitivities
from bha.diagnosis.given import Given
from bha.diagnosis.plan import Numbers, together
from bha.diagnosis.refit import Trial, to_its_end
from bha.errors import ConvergenceError
from bha.estimation.integration import resolved
from bha.estimation.terms import number_of

#: Greatest yield, m, of what may be friction: three times the motion that friction has before it slips, at most.
SMALL_YIELD = 3e-3
#: Motion before friction slips, m, at most; its force over that of slipping to begin with.
_PRESLIDING, _STATIC = 9e-4, 1.05
#: Least yield of a hysteresis to begin with, m.
_YIELD = 1e-3


def _as_friction(numbers: Numbers) -> Numbers | None:
    if numbers["yield"] > SMALL_YIELD:
        return None
    presliding = min(numbers["yield"], _PRESLIDING)
    return {"coulomb_force": numbers["amplitude"], "presliding": presliding, "static_ratio": _STATIC}


def _as_hysteresis(numbers: Numbers) -> Numbers | None:
    return {"amplitude": numbers["coulomb_force"], "yield": max(numbers["presliding"], _YIELD)}


#: The kin of a kind, and its numbers from those that were found; None where it cannot be.
OTHER: dict[str, tuple[str, Callable[[Numbers], Numbers | None]]] = {
    "hysteresis": ("friction", _as_friction),
    "friction": ("hysteresis", _as_hysteresis),
}


def as_kin(given: Given, found: Trial) -> Trial | None:
    """The set with the kin of its newest effect in its place; None where it has none, or that diverges."""
    candidate, fit = found.candidates[-1], found.fit
    if candidate.kind not in OTHER:
        return None
    kind, numbers_of = OTHER[candidate.kind]
    other = _candidate(given, kind, candidate.where)
    own = fit.model.place(-1)
    elements = fit.model.effects[-1].elements([float(v) for v in fit.x[own]])
    numbers = numbers_of(together(elements, candidate.plan.adding))
    if other is None or numbers is None:
        return None
    problem = given.problem
    term, start = other.term([numbers[s.name] for s in other.plan.strengths], given.ranges)
    begin = [
        c.coordinate(numbers[number_of(c)]) if number_of(c) in numbers else v
        for c, v in zip(term.coordinates, start, strict=True)
    ]
    x = np.concatenate([fit.x[: own.start], begin])
    model = resolved(fit.model.with_effects([*fit.model.effects[:-1], term]), x, fit.states, problem.misfit(fit))
    changed = evaluate(problem, model, x, fit.states, fit.trust)
    with suppress(ConvergenceError):
        ended = to_its_end(problem, weighted(problem, with_sensitivities(problem, changed)))
        return Trial((*found.candidates[:-1], other), ended, found.holdout)
    return None


def _candidate(given: Given, kind: str, where: str) -> Candidate | None:
    """The first candidate of a kind in a place that is one element."""
    own = (c for c in given.signatures.candidates if c.key == (kind, where) and not c.bank)
    return next(own, None)
