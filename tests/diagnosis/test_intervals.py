"""Intervals: what the logs disagree about is in them."""

from __future__ import annotations

import numpy as np
import pytest

from bha.diagnosis.intervals import _between_logs


def test_logs_that_ask_for_different_numbers_widen_the_interval() -> None:
    # Two logs of two blocks whose scores pull one coordinate by +6 and -6, in units of its curvature 3: each by itself
    # would move it by 2. With one degree of freedom Student's 95 % is 12.706 standard errors of sqrt(2 * (2^2 + 2^2)).
    table = np.array([[2.0], [4.0], [-3.0], [-3.0]])
    found = _between_logs(table, [0, 2, 4], np.array([[3.0]]))
    assert found[0] == pytest.approx(12.7062 / 1.95996 * np.sqrt(2 * (4.0 + 4.0)), rel=1e-4)


def test_logs_that_agree_add_nothing() -> None:
    table = np.array([[2.0], [-2.0], [3.0], [-3.0]])
    assert _between_logs(table, [0, 2, 4], np.array([[3.0]]))[0] == 0.0


def test_the_only_log_is_compared_in_thirds() -> None:
    rng = np.random.default_rng(1)
    table = rng.standard_normal((30, 2))
    table -= table.mean(axis=0)
    found = _between_logs(table, [0, 30], np.eye(2))
    thirds = table.reshape(3, 10, 2).sum(axis=1)
    np.testing.assert_allclose(found, 4.30265 / 1.95996 * np.sqrt(1.5 * np.sum(thirds**2, axis=0)), rtol=1e-4)
