"""Sets that differ from one in one effect: what a search has tried in the place of each."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from bha.diagnosis.fit import Problem
from bha.diagnosis.refit import Trial, bic
from bha.diagnosis.search import Search


@dataclass(frozen=True)
class Rival:
    """A trial with another effect in the place of one of the final set's, the rest being the same in any order.

    Attributes:
        trial: the trial.
        number: of that effect among its own.
        distance: of its criterion from that of the final set.
    """

    trial: Trial
    number: int
    distance: float

    @property
    def key(self) -> tuple[str, str]:
        """Kind and place of that effect."""
        return self.trial.key[self.number]


def rivals_of(state: Search, final: Trial, number: int, problem: Problem, correlation: float) -> list[Rival]:
    """Trials that differ from the final one in that effect only, the best first."""
    mine = bic(final, problem, correlation)
    rest = Counter(final.key[:number] + final.key[number + 1 :])
    found: dict[tuple[str, str], Rival] = {}
    for trial in state.trials:
        more = Counter(trial.key) - rest
        if len(trial.key) == len(final.key) and more.total() == 1 and (key := next(iter(more))) != final.key[number]:
            # The newest of elements of one kind in one place is the one beyond the rest.
            place = len(trial.key) - 1 - trial.key[::-1].index(key)
            rival = Rival(trial, place, bic(trial, problem, correlation) - mine)
            if key not in found or rival.distance < found[key].distance:
                found[key] = rival
    return sorted(found.values(), key=lambda r: r.distance)
