"""Whom a round of the search refits."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from bha.diagnosis.candidate import Candidate
from bha.diagnosis.catalogue import available
from bha.diagnosis.contenders import (
    asks_memory,
    memories,
    other_kinds,
    second_look,
    whole_places,
    with_laws,
    with_what_slips,
)
from bha.diagnosis.rules import Rules
from bha.diagnosis.screen import Scored
from bha.estimation.preload import with_preloads
from bha.parameters import ArmParameters

from .synthetic import one_section

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


def test_what_brought_most_is_refitted_in_every_section_and_who_comes_next() -> None:
    """Friction of a whole section: its score sees one bellows, and the section not at all."""
    ranking = [
        scored("friction", "bellows 12", 9.0),
        scored("creep", "bellows 12", 8.0),
        scored("weak_bellows", "bellows 21", 7.0),
        scored("friction", "bellows 21", 6.0),
        scored("pressure_gain", "input p23", 5.0),
        scored("friction", "section 1", 0.0),
        scored("friction", "all", 0.0),
        scored("creep", "section 2", 0.0),
    ]
    trials: Any = [SimpleNamespace(key=(s.candidate.key,), candidates=(s.candidate,)) for s in ranking[:3]]
    known = {trial.key[-1] for trial in trials}
    assert whole_places(ranking, trials, known, 1) == ranking[5:7]
    assert whole_places(ranking, trials, {*known, ("friction", "all")}, 3) == [ranking[5], ranking[7]]
    given: Any = SimpleNamespace(rules=Rules(), problem=SimpleNamespace(model=SimpleNamespace(core=CORE)))
    screening: Any = SimpleNamespace(ranking=ranking)
    assert second_look(given, screening, trials) == [*ranking[5:8], ranking[3], ranking[4]]


def test_another_law_is_always_tried() -> None:
    """The plain numbers make up for most of a wrong law: its score says little, and it costs little to try."""
    assert [kind for kind, plan in PLANS.items() if plan.is_a_law] == ["work_conjugate"]
    ranking = [scored("creep", "bellows 12", 9.0), scored("work_conjugate", "all", 0.1)]
    assert with_laws(ranking[:1], ranking, ()) == ranking
    assert with_laws(ranking, ranking, ()) == ranking
    # Beside other effects too, but not twice.
    assert with_laws(ranking[:1], ranking, [("work_conjugate", "all")]) == ranking[:1]


def test_an_arm_whose_logs_show_that_it_remembers_is_asked_the_form_of_its_memory_alone() -> None:
    plain = one_section().parameters
    banks = tuple(Candidate(PLANS["hysteresis"], "all", dict(shape)) for shape in PLANS["hysteresis"].bank)
    ranking = (scored("payload", "section 1", 9.0), *(Scored(own, 1.0, (1.0,), 0.01, 1.0) for own in banks))

    def asked(parameters: ArmParameters, ranking: Sequence[Scored], taken: int = 0) -> bool:
        given: Any = SimpleNamespace(problem=SimpleNamespace(model=SimpleNamespace(parameters=parameters)))
        current: Any = SimpleNamespace(candidates=(banks[0],) * taken)
        screening: Any = SimpleNamespace(ranking=ranking)
        return asks_memory(given, current, screening)

    remembers = with_preloads(plain)
    assert asked(remembers, ranking)
    assert not asked(plain, ranking)
    assert not asked(remembers, ranking[:1])
    assert not asked(remembers, ranking, taken=1)
    creep = scored("creep", "all", 2.0)
    slips, creeps = memories([*ranking, creep])
    assert creeps == creep
    assert slips == with_what_slips([], ranking, ())[0]
    (bank,) = with_what_slips([], ranking, ())
    assert bank.candidate.key == ("hysteresis", "all")
    assert bank.candidate.bank == PLANS["hysteresis"].bank
