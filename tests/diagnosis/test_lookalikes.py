"""Effects of a set exchanged for look-alikes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bha.diagnosis import lookalikes
from bha.diagnosis import search as searching
from bha.diagnosis.rules import Rules
from bha.diagnosis.search import Search

GAIN, FRICTION, HYSTERESIS = ("length_gain", "bellows 32"), ("friction", "bellows 22"), ("hysteresis", "bellows 22")


def trial(squares: float, *keys: tuple[str, str], bound: tuple[tuple[str, str], ...] = ()) -> Any:
    """A set whose effects sit on bounds where that is said."""
    effects = [SimpleNamespace(on_bound=lambda _, key=key: {"yield"} if key in bound else set()) for key in keys]
    model = SimpleNamespace(effects=effects, place=lambda k: slice(0, 0))
    fit = SimpleNamespace(squares=squares, x=(), model=model, residual=None)
    return SimpleNamespace(key=keys, candidates=keys, fit=fit, label=" and ".join(kind for kind, _ in keys))


@pytest.mark.parametrize(
    ("bound", "held", "exchanged"),
    [((), (), True), ((HYSTERESIS,), (), False), ((HYSTERESIS,), (FRICTION,), True)],
)
def test_a_look_alike_on_a_bound_replaces_none_that_is_not(
    bound: tuple[tuple[str, str], ...],
    held: tuple[tuple[str, str], ...],
    exchanged: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Friction begins where the range of a hysteresis ends: one at the end of it is friction."""
    found, other = trial(100.0, GAIN, FRICTION, bound=held), trial(50.0, GAIN, HYSTERESIS, bound=bound)
    only = SimpleNamespace(ranking=[])
    monkeypatch.setattr(lookalikes, "score", lambda *_: only)
    monkeypatch.setattr(lookalikes, "correlation_length", lambda *_: 1.0)
    monkeypatch.setattr(lookalikes, "bic", lambda t, *_: t.fit.squares)
    monkeypatch.setattr(lookalikes, "promising", lambda *_: [])
    monkeypatch.setattr(lookalikes, "abreast", lambda _, work, chosen, tell: [other] * (tried[-1] == FRICTION))
    tried: list[tuple[str, str]] = []

    def without(given: Any, current: Any, number: int) -> Any:
        tried.append(current.key[number])
        return SimpleNamespace(fit=None)

    monkeypatch.setattr(searching, "without", without)
    search = Search(trial(900.0), found)
    given: Any = SimpleNamespace(problem=SimpleNamespace(rows=10), rules=Rules(), signatures=None, say=lambda _: None)
    assert lookalikes.swap(given, search) is exchanged
    assert search.best is (other if exchanged else found)
    assert tried == [GAIN, FRICTION]
