"""A search for effects on its way: what it has found so far, and how likely that is by chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from bha.diagnosis.fit import Problem
from bha.diagnosis.given import Given
from bha.diagnosis.refit import Trial, without
from bha.diagnosis.screen import Screening, Signatures, score


class OutOfTime(Exception):  # noqa: N818  (no error: a search that ends as it was told to)
    """The time of a search is over; its text says what was about to be examined."""


@dataclass
class Search:
    """What a search has found so far; filled as it goes on, so that an interrupted one leaves it.

    Attributes:
        plain: the plain model.
        best: the best set so far.
        screening: the screening of the plain residual.
        trials: all refitted sets.
        rivals: for every round its trials with one more effect than before, best first.
        notes: what was decided and why.
        whole: the set that was last pruned.
        smaller: that set without each of its effects.
        doubtful: effects that stay if the held-out logs confirm them, with how likely they are by chance.
        chosen: the best set before further elements of its effects were sought: what rivals are compared with.
        settled: the best set that was not only collected: the first single effect, later what pruning has left.
        second: whether what came first was refused, and the best set stands in its place.
        inexact: whether what the best set leaves is a gap that follows something that was logged: it has not the arm's
            form.
        unexamined: where the time was over, what the search was about to examine; empty where it was not.
        complete: whether the search came to its end.
    """

    plain: Trial
    best: Trial
    screening: Screening | None = None
    trials: list[Trial] = field(default_factory=list)
    rivals: list[list[Trial]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    whole: Trial | None = None
    smaller: dict[tuple[str, str], Trial] = field(default_factory=dict)
    doubtful: dict[tuple[str, str], float] = field(default_factory=dict)
    chosen: Trial | None = None
    settled: Trial | None = None
    second: bool = False
    inexact: bool = False
    unexamined: str = ""
    complete: bool = False

    def settle(self) -> None:
        """Keep the best set as what is answered if the search comes to no end."""
        self.settled = self.best

    def in_sessions(self) -> Search:
        """The same with the errors of all sets on the held-out logs counted beyond what sets sessions apart."""
        known: dict[int, Trial] = {}

        def moved(trial: Trial) -> Trial:
            return known.setdefault(id(trial), replace(trial, holdout=holdout))

        plain = self.plain
        holdout = plain.holdout.in_sessions(plain.fit, plain.prediction.states)
        return replace(
            self,
            plain=moved(self.plain),
            best=moved(self.best),
            trials=[moved(t) for t in self.trials],
            rivals=[[moved(t) for t in own] for own in self.rivals],
            whole=self.whole and moved(self.whole),
            smaller={key: moved(t) for key, t in self.smaller.items()},
            chosen=self.chosen and moved(self.chosen),
            settled=self.settled and moved(self.settled),
        )

    def on_their_days(self) -> tuple[Search, str]:
        """A search that has only its plain model, with held-out logs as their days were, and these in words."""
        holdout = self.plain.holdout.on_their_days(self.plain.fit, self.plain.prediction.states)
        plain = replace(self.plain, holdout=holdout)
        return replace(self, plain=plain, best=plain), "; ".join(day.text for day in holdout.days or ())

    def without(self, given: Given, number: int) -> Trial | None:
        """The best set refitted without one of its effects, unless pruning has done that; None if it diverges."""
        known = self.smaller.get(self.best.key[number]) if self.whole is self.best else None
        return known or without(given, self.best, number)

    def fitted(self, keys: Sequence[tuple[str, str]]) -> Trial | None:
        """The best trial with these effects that has been fitted to its end, in any order; None for none."""
        own = [t for t in self.trials if sorted(t.key) == sorted(keys) and t.fit.jacobian is not None]
        return min(own, key=lambda t: t.fit.cost) if own else None


def gain(smaller: Trial, larger: Trial) -> float:
    """Drop of the sum of squares from one set to another; their priors count as data."""
    before, after = (t.fit.squares + t.fit.prior * t.fit.trust for t in (smaller, larger))
    return before - after


def told(problem: Problem, signatures: Signatures, rival: Trial, chosen: Trial) -> float:
    """How likely the chosen set were so much better by chance, were its rival right: p-value over all candidates."""
    return score(problem, rival.fit, signatures).chance(gain(rival, chosen))


def by_chance(chance: float) -> str:
    """A p-value in words."""
    return f"the best of all candidates brings as much by chance with p = {chance:.3f}"
