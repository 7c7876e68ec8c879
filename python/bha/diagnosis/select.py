"""Which effects: forward by training score, swaps among look-alikes, backward by prediction of logs that are left out.

What: the search over sets of effects, on training logs; held-out logs only refute in the end. An effect is real where
the best of all candidates in all places would hardly bring as much by chance (:mod:`bha.diagnosis.screen`), and it
matters where it helps to predict training logs from the others (:mod:`bha.diagnosis.crossing`). The steps are those of
:mod:`bha.diagnosis.forward`, :mod:`bha.diagnosis.prune`, :mod:`bha.diagnosis.lookalikes`,
:mod:`bha.diagnosis.instead`, :mod:`bha.diagnosis.beyond` and :mod:`bha.diagnosis.elements`.
Source: family-wise error rates by the distribution of the greatest score, Westfall and Young 1993; Schwarz 1978; rules
as measured on simulated arms (docs/explanation/diagnosis.md).
"""

from __future__ import annotations

from bha.diagnosis.beyond import refute
from bha.diagnosis.company import complete
from bha.diagnosis.elements import with_elements
from bha.diagnosis.forward import forward
from bha.diagnosis.given import Given
from bha.diagnosis.instead import instead, unrefuted
from bha.diagnosis.lookalikes import swap
from bha.diagnosis.prune import certify, prune
from bha.diagnosis.refit import Trial, bic, correlation_length
from bha.diagnosis.search import OutOfTime, Search


def search(given: Given, state: Search) -> Search:
    """Search for the set of effects; interrupted, or out of time, it returns what it has, marked as incomplete.

    What it has then is what has been settled: sets are collected before what is needless in them is dropped.
    """
    try:
        forward(given, state)
        # What is needless goes first: swaps are only worth their time among what stays.
        prune(given, state)
        state.settle()
        if swap(given, state):
            prune(given, state)
        state.settle()
        again(given, state)
        instead(given, state)
        state.settle()
        certify(given, state)
        unrefuted(given, state)
        refute(given, state)
        complete(given, state)
        state.chosen = state.best
        if given.rules.thorough and with_elements(given, state):
            # What stood in for the form of another is needed no more.
            prune(given, state)
        state.complete = True
    except KeyboardInterrupt:
        state.best = state.settled or state.best
        state.notes.append("interrupted: the search is not complete")
    except OutOfTime as late:
        state.best = state.settled or state.best
        state.unexamined = str(late)
        state.notes.append(f"out of time before: {late}; what would have come after it was not examined")
    return state


def again(given: Given, state: Search) -> None:
    """Begin once more from the best of another kind of the first round where the set that was found leaves a gap.

    Of two strong effects a third that has a little of both may come first, and hide them from then on. Where little is
    left only one that brought nearly as much is worth another search.
    """
    problem, rules = given.problem, given.rules
    excess = max(0.0, state.plain.fit.squares - problem.rows)
    found = state.best
    gap = found.fit.squares / problem.rows >= rules.shows**2
    if not state.rivals or not found.candidates or not gap:
        return
    much = found.fit.squares - problem.rows > rules.open * excess
    start = _other_beginning(state, found, rules.refined if much else rules.nearly)
    if start is None:
        return
    state.best = start
    state.notes.append(f"a gap is left: once more from {start.label}")
    forward(given, state)
    prune(given, state)
    correlation = correlation_length(problem, found.fit.residual)
    if bic(found, problem, correlation) - bic(state.best, problem, correlation) > rules.swap:
        state.notes.append(f"{state.best.label} in place of {found.label}")
        return
    state.best = found
    prune(given, state)


def _other_beginning(state: Search, found: Trial, refined: float) -> Trial | None:
    """The best trial of the first round whose kind is not among those found and that brings nearly as much."""
    kinds = {kind for kind, _ in found.key}
    first = state.rivals[0]
    most = max(state.plain.fit.squares - t.fit.squares for t in first)
    others = [t for t in first if t.key[-1][0] not in kinds and t.fit.jacobian is not None]
    return next((t for t in others if state.plain.fit.squares - t.fit.squares > refined * most), None)
