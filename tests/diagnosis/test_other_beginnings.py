"""Where a search begins beside the plain fit: at plausible numbers, at what a kin has found, and in wider company."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bha.diagnosis import company, rivals, workflow
from bha.diagnosis.candidate import Candidate
from bha.diagnosis.catalogue import available
from bha.diagnosis.company import complete
from bha.diagnosis.fit import evaluate, with_sensitivities
from bha.diagnosis.given import Given
from bha.diagnosis.kin import as_kin
from bha.diagnosis.plausible import ASTRAY, plausible
from bha.diagnosis.refit import Trial, added
from bha.diagnosis.rules import Rules
from bha.diagnosis.screen import Scored
from bha.diagnosis.search import Search
from bha.recordings import recordings

from .synthetic import make_logs, one_section

PLANS = {plan.kind: plan for plan in available(None)}
DURATIONS = (4.0, 4.0)


def searched(
    monkeypatch: pytest.MonkeyPatch, hidden: list[dict[str, Any]], kinds: tuple[str, ...], work: Callable[..., Any]
) -> Any:
    """What ``work`` makes of what a search is given."""
    found: list[Any] = []

    def search(given: Given, state: Search) -> Search:
        found.append(work(given, state))
        return state

    monkeypatch.setattr(workflow, "search", search)
    logs = make_logs(one_section(), hidden, seed=3, durations=DURATIONS)
    workflow.run(recordings(one_section(), logs[:1]), recordings(one_section(), logs[1:]), kinds=kinds)
    return found[0]


def test_friction_is_fitted_from_what_a_hysteresis_has_found(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = {"coulomb_force": 2.0, "presliding": 6e-4, "static_ratio": 1.3}
    hidden = [{"kind": "friction", "where": "all", "parameters": {**numbers, "stribeck_velocity": 0.01}}]

    def work(given: Given, state: Search) -> tuple[Trial, Trial | None, Trial | None, Trial | None]:
        slip = Candidate(PLANS["hysteresis"], "all", {"yield": 2e-3})
        found = added(given, state.plain, slip, (2.0,))
        assert found is not None
        kin = as_kin(given, found)
        assert kin is not None
        return found, kin, as_kin(given, kin), as_kin(given, _of_yield(found, 0.02))

    found, kin, back, far = searched(monkeypatch, hidden, ("hysteresis", "friction"), work)
    assert kin.key == (("friction", "all"),)
    assert kin.fit.cost < found.fit.cost
    assert _values(kin)[0] == pytest.approx(2.0, rel=0.1)
    assert back.key == (("hysteresis", "all"),)
    assert far is None  # no friction moves by 20 mm before it slips


def _values(trial: Trial) -> list[float]:
    model = trial.fit.model
    own = model.place(-1)
    return [c.value(float(v)) for c, v in zip(model.coordinates[own], trial.fit.x[own], strict=True)]


def _of_yield(trial: Trial, value: float) -> Trial:
    """The trial with its yield at some value."""
    model, x = trial.fit.model, trial.fit.x.copy()
    own = range(*model.place(-1).indices(model.size))
    k = next(k for k in own if model.coordinates[k].path.endswith("yield"))
    x[k] = model.coordinates[k].coordinate(value)
    return replace(trial, fit=replace(trial.fit, x=x))


def test_a_plain_fit_that_went_astray_is_fitted_with_plausible_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    def work(given: Given, state: Search) -> tuple[Trial | None, Trial | None, int]:
        plain, problem = state.plain, given.problem
        damping = next(k for k, c in enumerate(plain.fit.model.plain) if c.path.endswith("damping"))
        x = plain.fit.x.copy()
        x[damping] = np.log(3.0 * ASTRAY) / plain.fit.model.plain[damping].scale
        far = with_sensitivities(problem, evaluate(problem, plain.fit.model, x, plain.fit.states))
        kept = plausible(given, replace(plain, fit=far))
        assert kept is not None
        assert kept.fit.model.plain == plain.fit.model.plain  # the priors are as they were
        return plausible(given, plain), kept, damping

    hidden = [{"kind": "weak_bellows", "where": "bellows 12", "parameters": {"change": -0.1}}]
    none, kept, damping = searched(monkeypatch, hidden, ("weak_bellows",), work)
    assert none is None
    assert abs(kept.fit.x[damping]) < 0.5
    assert kept.fit.jacobian is not None


def scored(kind: str, where: str, share: float) -> Scored:
    return Scored(Candidate(PLANS[kind], where, {}), share, (1.0,), share / 100.0, 1.0)


@pytest.mark.parametrize("crowded", [True, False])
def test_where_many_kinds_do_alike_those_that_promised_little_are_asked(
    crowded: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sensor's offset among weights and tilts that none of the logs tells from another."""
    costs = {"payload": 0.0, "base_tilt": 1.0, "creep": 2.0, "weak_bellows": 90.0, "pressure_offset": 3.0, "leak": 80.0}

    def trial(kind: str, where: str) -> Any:
        return SimpleNamespace(key=((kind, where),), label=f"{kind} at {where}", fit=SimpleNamespace(residual=None))

    asked: list[tuple[str, str]] = []

    def refit(_given: Any, _start: Any, candidate: Candidate, _strengths: Any) -> Any:
        asked.append(candidate.key)
        return trial(*candidate.key)

    monkeypatch.setattr(company, "added", refit)
    monkeypatch.setattr(company, "abreast", lambda _, work, chosen, tell: [work(s) for s in chosen])
    monkeypatch.setattr(company, "correlation_length", lambda *_: 1.0)
    monkeypatch.setattr(rivals, "bic", lambda t, *_: costs[t.key[-1][0]])
    ranking = [scored("pressure_offset", f"input p1{k}", 4.0 - k) for k in (3, 1, 2)] + [scored("leak", "all", 0.5)]
    best = trial("payload", "section 1")
    tried = [best, trial("base_tilt", "all"), trial("weak_bellows", "bellows 12")]
    if crowded:
        tried.append(trial("creep", "all"))
    search: Any = SimpleNamespace(
        best=best, plain=SimpleNamespace(), screening=SimpleNamespace(ranking=ranking), trials=tried, notes=[]
    )
    given: Any = SimpleNamespace(problem=None, rules=Rules(), signatures=None, say=lambda _: None)
    complete(given, search)
    if not crowded:
        assert not asked
        return
    # First one place of each kind, then other places of those that do as well.
    assert asked[:2] == [("pressure_offset", "input p13"), ("leak", "all")]
    assert set(asked[2:]) == {("pressure_offset", "input p11"), ("pressure_offset", "input p12")}
    assert "pressure_offset at input p12" in search.notes[0]
    assert "leak" not in search.notes[0]
