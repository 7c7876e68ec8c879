"""When an error is a gap."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bha.checkup.finding import Explanation, Finding
from bha.diagnosis.decide import (
    Decision,
    GapTest,
    Thresholds,
    _too_much_noise,
    allowance,
    decide,
    is_significant,
    tolerant,
    without_faults,
)
from bha.diagnosis.holdout import Prediction
from bha.diagnosis.search import Search


@pytest.mark.parametrize(
    ("mean_square", "limit", "ratio", "training", "expected"),
    [
        (1.0, 1.1, 1.0, 1.0, False),
        (3.0, 1.1, 1.7, 1.0, True),
        # More than noise by statistics, and not worth a name.
        (1.2, 1.1, 1.05, 1.0, False),
        # Held-out logs that ask for what the training logs do not tell.
        (30.0, 50.0, 5.0, 1.1, False),
        # The same, but the training logs are not described either.
        (30.0, 5e4, 5.0, 400.0, True),
        (np.inf, 1.1, np.inf, 1.0, True),
    ],
)
def test_uncertain_parameters_excuse_errors_on_held_out_logs_only(
    mean_square: float, limit: float, ratio: float, training: float, expected: bool
) -> None:
    assert is_significant(mean_square, limit, ratio, training, Thresholds()) is expected


@pytest.mark.parametrize("sizes", [[4.0], [4.0, 1.0, 0.1], [0.01] * 20, [0.0]])
def test_a_right_model_with_uncertain_parameters_is_allowed_what_it_leaves(sizes: list[float]) -> None:
    rng, rows, size = np.random.default_rng(3), 2000, len(sizes)
    turn = np.linalg.qr(rng.standard_normal((size, size)))[0]
    covariance = turn @ np.diag(sizes) @ turn.T
    # White sensitivities whose squares add up to one a row.
    spread = np.sqrt(rows) * np.linalg.qr(rng.standard_normal((rows, size)))[0]
    limits = Thresholds(model=0.0)
    expected, limit = allowance(spread.T @ spread @ covariance / rows, rows, 0.0, limits)
    draws = rng.multivariate_normal(np.zeros(size), covariance, 4000) @ spread.T + rng.standard_normal((4000, rows))
    left = np.mean(draws**2, axis=1)
    assert np.mean(left) == pytest.approx(expected, rel=0.05)
    assert np.mean(left > limit) < 0.02
    assert limit < 1.3 * np.quantile(left, 0.99)


@pytest.mark.parametrize("verdict", ["named", "unexplained", "equivalent"])
def test_what_a_check_found_is_said_with_the_verdict(verdict: str) -> None:
    fault = Finding(
        "fault", "wiring", "log", "section 1 does not bend as its chambers push by the file",
        explanations=(Explanation("tubes exchanged: p12 and p13", "rename"),),
    )  # fmt: skip
    given = Decision(verdict, "the search's own reason", 0.5)
    assert without_faults(given, []) is given
    made = without_faults(given, [fault])
    if verdict == "equivalent":
        assert made.verdict == "equivalent"
        assert made.reason.startswith("the search's own reason; but logs and file do not belong together")
        return
    assert made.verdict == "setup"
    assert made.reason.startswith("logs and file do not belong together")
    assert (
        "together: log: section 1 does not bend as its chambers push by the file (tubes exchanged: p12 and p13)"
        in made.reason
    )
    assert ("the search's own reason" in made.reason) == (verdict == "unexplained")


def test_what_does_not_matter_to_the_user_is_no_gap() -> None:
    noise = 0.3e-3
    limits = tolerant(Thresholds(), 0.4e-3, noise)
    # Errors beyond noise add to it by squares: 0.4 beside 0.3 is 0.5 mm.
    assert not is_significant(9.0, 1.1, 0.499e-3 / noise, 9.0, limits)
    assert is_significant(9.0, 1.1, 0.501e-3 / noise, 9.0, limits)
    assert tolerant(Thresholds(), 0.0, noise) == Thresholds()


@pytest.mark.parametrize(("mean_square", "said"), [(0.15, True), (0.8, False), (1.05, False)])
def test_less_than_noise_should_make_is_said(mean_square: float, said: bool) -> None:
    """Motion that passes for noise (10 Hz logs: 0.15) hides gaps of its size."""
    gap = GapTest(mean_square, 1.0, 1.1, 0.9, False)
    assert ("taken for too great" in _too_much_noise(gap, Thresholds())) is said


@pytest.mark.parametrize(("ratio", "said"), [(4.4, True), (1.1, False)])
def test_errors_far_above_the_noise_that_are_left_open_are_said_to_be(ratio: float, said: bool) -> None:
    plain = _missing(1e-3)
    search: Any = SimpleNamespace(plain=plain, best=plain)
    found = decide(search, GapTest(2.5, 1.8, 5.2, ratio, False), 1e-3 / ratio, Thresholds())
    assert found.verdict == "equivalent"
    assert ("the training logs do not tell" in found.reason) is said


def _missing(rms: float, *keys: tuple[str, str]) -> Any:
    """A model that errs by ``rms`` m on ten blocks of held-out logs."""
    squares = np.full(10, 10.0 * rms**2)
    prediction = Prediction((), (), np.empty(0), squares, squares, np.full(10, 10), rms, ())
    return SimpleNamespace(key=keys, candidates=keys, prediction=prediction, label=" and ".join(k for k, _ in keys))


@pytest.mark.parametrize(
    ("after", "kinds", "verdict"),
    [
        # Two thirds of a gap of five times the noise: one name is there, two are a form that neither has.
        (3.0, ["weak_bellows"], "named"),
        (3.0, ["weak_bellows", "payload"], "unexplained"),
        (4.0, ["weak_bellows"], "unexplained"),
        # What is left is no gap.
        (1.2, ["weak_bellows", "payload"], "named"),
    ],
)
def test_one_name_may_leave_more_than_several(after: float, kinds: list[str], verdict: str) -> None:
    best = _missing(after * 1e-3, *((kind, "section 1") for kind in kinds))
    decided = decide(Search(_missing(5e-3), best), GapTest(25.0, 1.0, 1.1, 5.0, True), 1e-3, Thresholds())
    assert decided.verdict == verdict
    assert ("what is left is 3 times the noise and not explained" in decided.reason) == (
        kinds == ["weak_bellows"] and after == 3.0
    )
