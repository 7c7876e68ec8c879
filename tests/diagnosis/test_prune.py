"""What held-out logs refute."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bha.diagnosis import prune as pruning
from bha.diagnosis.holdout import Prediction
from bha.diagnosis.prune import certify, prune
from bha.diagnosis.rules import Rules
from bha.diagnosis.search import Search

CREEP, HYSTERESIS = ("creep", "all"), ("hysteresis", "all")


def trial(rms: float, *keys: tuple[str, str]) -> Any:
    """A set of effects that errs by ``rms`` mm on ten blocks of held-out logs."""
    squares = np.full(10, 10.0 * (1e-3 * rms) ** 2)
    prediction = Prediction((), (), np.empty(0), squares, squares, np.full(10, 10), 0.0, ())
    return SimpleNamespace(key=keys, candidates=keys, prediction=prediction)


def searched(best: Any, smaller: dict[tuple[str, str], Any], plain: Any) -> Search:
    return Search(plain, best, whole=best, smaller=smaller)


@pytest.mark.parametrize(("without_hysteresis", "kept"), [(1.5, [CREEP]), (3.0, [CREEP, HYSTERESIS])])
def test_a_name_without_which_held_out_logs_are_predicted_better_is_none(
    without_hysteresis: float, kept: list[tuple[str, str]]
) -> None:
    plain, creep = trial(5.0), trial(without_hysteresis, CREEP)
    best = trial(2.0, CREEP, HYSTERESIS)
    search = searched(best, {CREEP: trial(4.0, HYSTERESIS), HYSTERESIS: creep}, plain)
    given: Any = SimpleNamespace(rules=Rules(), noise=1e-4, say=lambda text: None)
    if kept == [CREEP]:
        # Alone it stays: of one effect the closure decides.
        creep.candidates = ()
    certify(given, search)
    assert search.best is (creep if kept == [CREEP] else best)


@pytest.mark.parametrize(("after", "stays"), [(4.9, False), (2.0, True)])
def test_an_effect_that_may_be_there_by_chance_stays_if_held_out_logs_confirm_it(after: float, stays: bool) -> None:
    plain, best = trial(5.0), trial(after, CREEP)
    search = searched(best, {CREEP: plain}, plain)
    search.doubtful[CREEP] = 0.04
    given: Any = SimpleNamespace(rules=Rules(), noise=1e-4, say=lambda text: None)
    certify(given, search)
    assert search.best is (best if stays else plain)


@pytest.mark.parametrize(("without", "stays"), [(1.5, False), (2.0, True)])
def test_a_further_name_answers_a_gap_of_its_own(without: float, stays: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Mean squares of left-out logs: 10 plain, 1 with both; 1.3 times the error is 1.69 times the square."""
    squares = {(): 10.0, (CREEP,): without, (HYSTERESIS,): 8.0, (CREEP, HYSTERESIS): 1.0}
    trials: dict[Any, Any] = {
        keys: SimpleNamespace(key=keys, candidates=keys, fit=SimpleNamespace(trust=1.0, squares=1e4 * value, own=value))
        for keys, value in squares.items()
    }
    for own in trials.values():
        own.fit.prior = 0.0
    monkeypatch.setattr(pruning, "crossed", lambda problem, fit, trust: fit.own)
    never = SimpleNamespace(chance=lambda gain: 0.001)
    monkeypatch.setattr(pruning, "score", lambda problem, fit, signatures: never)
    smaller = {keys: {key: trials[tuple(k for k in keys if k != key)] for key in keys} for keys in squares}
    monkeypatch.setattr(pruning, "_each_without", lambda given, search: smaller[search.best.key])
    search = Search(trials[()], trials[CREEP, HYSTERESIS], screening=never)  # type: ignore[arg-type]
    given = SimpleNamespace(problem=SimpleNamespace(rows=1e4), rules=Rules(), signatures=None)
    prune(given, search)  # type: ignore[arg-type]
    assert search.best.key == ((CREEP, HYSTERESIS) if stays else (CREEP,))


@pytest.mark.parametrize(("left_out", "stays"), [(4.9, True), (5.1, True), (11.0, True)])
def test_left_out_logs_that_say_nothing_leave_a_name_to_the_held_out_ones(
    left_out: float, stays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plain model misses left-out logs by 10 in mean square, one with the name by about five times its own 1."""
    fits = {
        keys: SimpleNamespace(trust=1.0, prior=0.0, squares=1e4 * own, own=out)
        for keys, own, out in (((), 10.0, 10.0), ((CREEP,), 1.0, left_out))
    }
    plain, best = (SimpleNamespace(key=keys, candidates=keys, fit=fit) for keys, fit in fits.items())
    monkeypatch.setattr(pruning, "crossed", lambda problem, fit, trust: fit.own)
    never = SimpleNamespace(chance=lambda gain: 0.001)
    monkeypatch.setattr(pruning, "_each_without", lambda given, search: {CREEP: plain} if search.best is best else {})
    search = Search(plain, best, screening=never)  # type: ignore[arg-type]
    given = SimpleNamespace(problem=SimpleNamespace(rows=1e4), rules=Rules(), signatures=None)
    prune(given, search)  # type: ignore[arg-type]
    assert (search.best is best) == stays
    assert search.doubtful == ({} if left_out < Rules().told else {CREEP: 0.001})


def test_a_further_effect_shows_or_takes_all_that_is_left() -> None:
    rules = Rules()
    assert rules.enough(10.0, 1.0) == pytest.approx(10.0 * (1.0 - 1.3**-2))
    assert rules.enough(1.75, 1.0) == pytest.approx(0.85 * 0.75)
    # What is no gap needs no further name.
    assert rules.enough(1.5, 1.0) == pytest.approx(1.5 * (1.0 - 1.3**-2))


@pytest.mark.parametrize(("dropped", "anew"), [(2.0, True), (20.0, False)])
def test_a_set_without_an_effect_is_fitted_anew_where_an_earlier_round_ended_in_another_valley(
    dropped: float, anew: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lag of nothing beside a delay: the delay alone had ended at 10, and costs 2 as it stands in the set."""
    earlier, again = (SimpleNamespace(key=(CREEP,), fit=SimpleNamespace(cost=c, jacobian=())) for c in (10.0, 1.5))
    monkeypatch.setattr(pruning, "evaluated_without", lambda *_: SimpleNamespace(cost=dropped))
    monkeypatch.setattr(pruning, "without", lambda *_: again)
    monkeypatch.setattr(pruning, "abreast", lambda problem, work, numbers, say: [work(k) for k in numbers])
    best: Any = SimpleNamespace(key=(CREEP, HYSTERESIS))
    search = Search(trial(5.0), best, trials=[earlier])  # type: ignore[list-item]
    given: Any = SimpleNamespace(problem=None, say=lambda text: None)
    smaller = pruning._each_without(given, search)
    assert smaller[HYSTERESIS] is (again if anew else earlier)
