"""Which candidates a round of the search refits, where the cost has several valleys."""

import json
from types import SimpleNamespace
from typing import Any

import pytest

import bha
from bha.diagnosis import contenders, ranking
from bha.diagnosis.candidate import Candidate
from bha.diagnosis.catalogue import available
from bha.diagnosis.refit import Trial
from bha.diagnosis.rules import Rules
from bha.diagnosis.screen import Scored

PLANS = {plan.kind: plan for plan in available(None)}


def candidate(kind: str, where: str) -> Candidate:
    return Candidate(PLANS[kind], where, {})


def scored(kind: str, where: str, score: float = 1.0) -> Scored:
    return Scored(candidate(kind, where), score, (1.0,), 0.1, 1.0)


def trial(*keys: tuple[str, str], squares: float = 0.0) -> Trial:
    """A refitted set; of its fit only what the rules of the search look at."""
    fit: Any = SimpleNamespace(squares=squares, prior=0.0, trust=1.0, residual=None, model=None)
    holdout: Any = None
    return Trial(tuple(candidate(*key) for key in keys), fit, holdout)


def test_the_best_of_another_kind_from_an_earlier_round_is_tried_again() -> None:
    lag, area, bending = ("pressure_lag", "all"), ("effective_area", "all"), ("bending_nonlinear", "all")
    first_round = [trial(lag), trial(("pressure_lag", "section 1")), trial(area), trial(bending)]
    ranking = [scored("creep", "all"), scored(*bending), scored(*area), scored("effective_area", "section 1")]
    chosen = contenders.with_rivals(ranking[:1], ranking, [lag], [first_round])
    assert [s.candidate.key for s in chosen] == [("creep", "all"), area]
    # What is chosen or taken already is not chosen twice.
    assert contenders.with_rivals([scored(*area)], ranking, [lag, bending], [first_round]) == [scored(*area)]


@pytest.mark.parametrize(("wide", "expected"), [(260.0, "all"), (500.0, "section 1")])
def test_a_narrower_place_has_to_be_better_by_a_fifth_of_its_gain(
    monkeypatch: pytest.MonkeyPatch, wide: float, expected: str
) -> None:
    """Criteria: 1000 before, 200 for the narrow place, so that up to 360 the wide one counts."""
    monkeypatch.setattr(ranking, "correlation_length", lambda problem, residual: 1.0)
    monkeypatch.setattr(ranking, "bic", lambda t, problem, correlation: t.fit.squares)
    core = json.loads(bha.robots.load("bha_nominal").parameters.to_core_json())
    narrow, everywhere = (
        trial(("pressure_lag", "section 1"), squares=200.0),
        trial(("pressure_lag", "all"), squares=wide),
    )
    narrow.fit.model = SimpleNamespace(core=core)  # type: ignore[misc]
    problem: Any = None
    ordered = ranking.widest_first([narrow, everywhere], trial(squares=1000.0), problem, Rules())
    assert ordered[0].key[0][1] == expected
