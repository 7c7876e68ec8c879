"""Whom a round of the search refits."""

from __future__ import annotations

from bha.diagnosis.candidate import Candidate
from bha.diagnosis.catalogue import available
from bha.diagnosis.contenders import other_kinds
from bha.diagnosis.screen import Scored

CORE = {
    "section": [{"bellows": [{"input": 3 * i + k} for k in range(3)]} for i in range(2)],
    "inputs": ["p11", "p12", "p13", "p21", "p22", "p23"],
}
PLANS = {plan.kind: plan for plan in available(None)}


def scored(kind: str, where: str, score: float) -> Scored:
    return Scored(Candidate(PLANS[kind], where, {}), score, (1.0,), score / 100.0, 1.0)


def test_other_kinds_in_the_place_of_the_best_are_refitted_too() -> None:
    ranking = [
        scored("weak_bellows", "bellows 12", 9.0),
        scored("creep", "bellows 13", 8.0),
        scored("creep", "section 1", 7.0),
        scored("creep", "bellows 12", 6.0),
        scored("creep", "bellows 12", 5.0),  # another shape of it
        scored("friction", "bellows 12", 4.0),
        scored("hysteresis", "bellows 12", 0.0),  # promises nothing
    ]
    known = {("weak_bellows", "bellows 12"), ("friction", "bellows 12")}
    found = other_kinds(ranking, ranking[0].candidate, known, CORE, 4)
    assert found == [ranking[3]]
    assert other_kinds(ranking, ranking[2].candidate, (), CORE, 4) == [ranking[2]]
    assert other_kinds(ranking, ranking[0].candidate, (), CORE, 2) == [ranking[0], ranking[3]]
