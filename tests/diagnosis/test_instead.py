"""What stands in the place of a first name that is refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bha.diagnosis import instead as following
from bha.diagnosis import rivals
from bha.diagnosis.decide import GapTest, Thresholds, decide
from bha.diagnosis.describe import of_like_form
from bha.diagnosis.holdout import Prediction
from bha.diagnosis.rivals import Rival
from bha.diagnosis.rules import Rules
from bha.diagnosis.search import Search

HOSE, GAIN, LEAK, TILT = (("tool_drag", "all"), ("length_gain", "bellows 11"), ("leak", "all"), ("base_tilt", "all"))


def trial(squares: float, *keys: tuple[str, str]) -> Any:
    fit = SimpleNamespace(squares=squares, jacobian=())
    return SimpleNamespace(key=keys, candidates=keys, fit=fit, label=" and ".join(kind for kind, _ in keys))


def searched(*standing: tuple[str, str]) -> Search:
    """A search that the hose won, with which sets stand; the tilt brings too little to be asked."""
    plain = trial(100.0)
    first = [trial(10.0, HOSE), trial(20.0, GAIN), trial(30.0, LEAK), trial(90.0, TILT)]
    search = Search(plain, first[0], rivals=[first], doubtful={HOSE: 0.04})
    given: Any = SimpleNamespace(rules=Rules(), problem=None, signatures=None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(following, "prune", lambda _, search: search.doubtful.clear())
        patch.setattr(following, "forward", lambda *_: None)
        patch.setattr(following, "stands", lambda _, t: bool(t.key) and t.key[0] in standing)
        following.instead(given, search)
    return search


@pytest.mark.parametrize(
    ("standing", "best", "second"),
    [
        ((HOSE, GAIN), HOSE, False),  # what came first stands
        ((GAIN, LEAK), GAIN, True),
        ((LEAK, TILT), LEAK, True),
        ((TILT,), HOSE, False),  # too little is left: as it was
    ],
)
def test_the_next_that_stands_takes_the_place(
    standing: tuple[tuple[str, str], ...], best: tuple[str, str], second: bool
) -> None:
    search = searched(*standing)
    assert search.best.key == (best,)
    assert search.second is second
    # How likely by chance it is has been asked of what was found, and is not asked again.
    assert (HOSE in search.doubtful) is (best is HOSE)


@pytest.mark.parametrize(
    ("held_out", "best", "second"),
    [
        ({HOSE: -0.1, GAIN: 0.8, LEAK: 0.9}, GAIN, True),  # the first that is not refuted, not the best
        ({HOSE: -0.1, GAIN: -0.2, LEAK: 0.9}, LEAK, True),
        ({HOSE: 0.1, GAIN: 0.8, LEAK: 0.9}, HOSE, False),
        ({HOSE: -0.1, GAIN: -0.8, LEAK: -0.9}, HOSE, False),
    ],
)
def test_held_out_logs_refute_a_member_of_what_is_not_told_apart(
    held_out: dict[tuple[str, str], float], best: tuple[str, str], second: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = [trial(10.0, HOSE), trial(12.0, GAIN), trial(13.0, LEAK), trial(90.0, TILT)]
    for own in first:
        own.prediction = held_out.get(own.key[0], 1.0)
    plain = trial(100.0)
    plain.prediction = 0.0
    search = Search(plain, first[0], rivals=[first])
    monkeypatch.setattr(following, "bic", lambda t, *_: t.fit.squares)
    monkeypatch.setattr(following, "correlation_length", lambda *_: 1.0)
    monkeypatch.setattr(following, "stands", lambda *_: True)
    monkeypatch.setattr(following, "share_brought", lambda plain, smaller, larger, noise: larger)
    for own in first:
        own.fit.residual = None
    following.unrefuted(SimpleNamespace(rules=Rules(), problem=None, noise=1.0), search)  # type: ignore[arg-type]
    assert (search.best.key, search.second) == ((best,), second)


@pytest.mark.parametrize(
    ("second", "doubtful", "verdict"),
    [(False, {}, "named"), (True, {}, "unexplained"), (False, {GAIN: 0.03}, "unexplained")],
)
def test_held_out_logs_ask_more_of_it(second: bool, doubtful: dict[tuple[str, str], float], verdict: str) -> None:
    """Six tenths of the excess are enough for a name that stands out, too little for one in its place or by chance."""

    def predicted(square: float) -> Prediction:
        squares = np.full(10, square)
        return Prediction((), (), np.empty(0), squares, squares, np.ones(10), 0.0, ())

    plain: Any = SimpleNamespace(prediction=predicted(11.0), candidates=(), key=())
    best: Any = SimpleNamespace(prediction=predicted(5.0), candidates=(GAIN,), key=(GAIN,), label="length_gain")
    gap = GapTest(11.0, 1.0, 1.2, 3.3, significant=True)
    search = Search(plain, best, second=second, doubtful=doubtful)
    assert decide(search, gap, 1.0, Thresholds()).verdict == verdict


@pytest.mark.parametrize(("inexact", "members"), [(False, []), (True, [LEAK])])
def test_a_form_that_errs_rules_out_none_that_errs_a_little_more(inexact: bool, members: list[tuple[str, str]]) -> None:
    """Of 10 rows the gain leaves 10 beyond noise, the leak 14, the tilt 80."""
    problem: Any = SimpleNamespace(rows=10)
    gain, others = trial(20.0, GAIN), [Rival(trial(24.0, LEAK), 0, 0.0), Rival(trial(90.0, TILT), 0, 0.0)]
    search = Search(trial(100.0), gain, inexact=inexact)
    assert [r.key for r in of_like_form(search, problem, gain, others)] == members


def test_what_is_little_rules_out_none_that_leaves_hardly_more() -> None:
    """Of 100 rows the gain leaves 10 beyond noise, the leak 10.9, the tilt 12."""
    problem: Any = SimpleNamespace(rows=100)
    gain, others = trial(110.0, GAIN), [Rival(trial(110.9, LEAK), 0, 9.0), Rival(trial(112.0, TILT), 0, 9.0)]
    assert [r.key for r in of_like_form(Search(trial(300.0), gain), problem, gain, others)] == [LEAK]
    much, others = trial(140.0, GAIN), [Rival(trial(140.9, LEAK), 0, 9.0)]
    assert of_like_form(Search(trial(300.0), much), problem, much, others) == []


def test_rivals_are_sets_with_another_effect_in_whatever_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """An exchanged effect is the newest of its set: (gain, tilt) became (tilt, leak)."""
    monkeypatch.setattr(rivals, "bic", lambda t, *_: t.fit.squares)
    final = trial(20.0, GAIN, TILT)
    search = Search(trial(100.0), final)
    search.trials = [
        final,
        trial(19.0, TILT, LEAK),
        trial(25.0, TILT, GAIN),
        trial(30.0, GAIN),
        trial(21.0, LEAK, TILT),
    ]
    problem: Any = None
    first, second = (rivals.rivals_of(search, final, k, problem, 1.0) for k in (0, 1))
    assert [(r.key, r.number, r.distance) for r in first] == [(LEAK, 1, -1.0)]
    assert second == []
