"""Rounds of a search: whom the next one is scored by."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bha.diagnosis import forward
from bha.diagnosis import given as given_of_a_search
from bha.diagnosis.candidate import Candidate
from bha.diagnosis.catalogue import available
from bha.diagnosis.given import Given
from bha.diagnosis.refit import Trial
from bha.diagnosis.rules import Rules
from bha.diagnosis.screen import Signatures

PLAN = available(("creep",))[0]
ROWS = 1000


@pytest.mark.parametrize(("names", "mean_square", "anew"), [(0, 9.0, False), (1, 1.5, False), (1, 9.0, True)])
def test_signatures_are_made_anew_beside_effects_that_leave_a_gap(
    names: int, mean_square: float, anew: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = Candidate(PLAN, "all", {})
    before = Signatures((own, own), (((0,),), ((0,),)), np.zeros((ROWS, 1), dtype=np.float32))
    after, asked = Signatures((), (), before.table), []
    monkeypatch.setattr(given_of_a_search, "probe", lambda _p, _f, plans, *_: asked.append(plans) or after)
    problem: Any = SimpleNamespace(rows=ROWS)
    fit: Any = SimpleNamespace(squares=mean_square * ROWS)
    nothing: Any = None
    given = Given(problem, nothing, before, nothing, Rules(), 1e-4, lambda _text: None)
    found = forward.renewed(given, Trial((own,) * names, fit, nothing))
    assert found.signatures is (after if anew else before)
    assert asked == ([[PLAN]] if anew else [])
