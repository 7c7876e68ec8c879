"""Cell means and lags on a coarse grid, against fine integration."""

from __future__ import annotations

import numpy as np
import pytest

from bha.estimation.slow import lag_response


@pytest.mark.parametrize("lag", [0.02, 0.4, 5.0])
def test_a_lag_follows_a_polygon_as_fine_integration_says(lag: float) -> None:
    step, values = 0.3, np.random.default_rng(1).standard_normal((12, 2))
    fine = np.linspace(0.0, 11 * step, 11 * 20_000 + 1)
    table = np.column_stack([np.interp(fine, step * np.arange(12), column) for column in values.T])
    y = np.empty_like(table)
    y[0] = table[0]
    h = fine[1]
    for k in range(len(fine) - 1):
        y[k + 1] = y[k] + h / lag * (0.5 * (table[k] + table[k + 1]) - y[k]) / (1.0 + 0.5 * h / lag)
    assert lag_response(lag, step, values) == pytest.approx(y[::20_000], abs=1e-6)


def test_no_lag_changes_nothing_and_a_long_one_stays() -> None:
    values = np.arange(5.0)[:, None]
    assert np.array_equal(lag_response(0.0, 1.0, values), values)
    assert lag_response(1e9, 1.0, values) == pytest.approx(np.zeros((5, 1)), abs=1e-6)
