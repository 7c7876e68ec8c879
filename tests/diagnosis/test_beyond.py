"""Effects that the logs ask for less than none of."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bha.diagnosis import beyond
from bha.diagnosis.candidate import Candidate, core_ranges
from bha.diagnosis.catalogue import available
from bha.diagnosis.rules import Rules
from bha.diagnosis.screen import Signatures
from bha.diagnosis.search import Search

PLANS = {plan.kind: plan for plan in available(None)}


@pytest.mark.parametrize(
    ("fill", "asked", "chance", "stays"),
    [
        (1e-4, -5.0, 0.005, False),
        # Away from the bound the fit has found what it is; at it the logs may ask for more, for little less, or for
        # what chance brings.
        (0.02, -5.0, 0.005, True),
        (1e-4, 5.0, 0.005, True),
        (1e-4, -1.0, 0.005, True),
        (1e-4, -5.0, 0.2, True),
    ],
)
def test_a_lag_that_would_have_to_fill_before_it_is_told_is_none(
    fill: float, asked: float, chance: float, stays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The residual's square is 100, the signature of filling 1: 5 of it are 25 % of the square, 1 is 1 %."""
    candidate = Candidate(PLANS["pressure_lag"], "all", {"tau": 0.04})
    term, start = candidate.term([1.0, 1.0], core_ranges())
    x = np.array(
        [c.coordinate(fill) if c.path.endswith("fill") else v for c, v in zip(term.coordinates, start, strict=True)]
    )
    model = SimpleNamespace(effects=[term], place=lambda index: slice(0, len(x)))
    lag: Any = SimpleNamespace(
        key=(candidate.key,), candidates=(candidate,), fit=SimpleNamespace(model=model, x=x, jacobian=x)
    )
    screening = SimpleNamespace(
        inner=np.array([asked, 0.0]), gram=np.eye(2), total=100.0, chance=lambda gain: chance if gain > 0.0 else 1.0
    )
    monkeypatch.setattr(beyond, "score", lambda problem, fit, signatures: screening)
    signatures = Signatures((candidate,), (((0,), (1,)),), np.empty((0, 2), dtype=np.float32))
    plain: Any = SimpleNamespace(key=(), candidates=(), fit=lag.fit)
    search = Search(plain, lag)
    beyond.refute(SimpleNamespace(problem=None, rules=Rules(), signatures=signatures), search)  # type: ignore[arg-type]
    assert (search.best is lag) is stays
    assert bool(search.notes) is not stays
