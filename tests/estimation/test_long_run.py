"""Standard errors from residuals that last, against means of first-order processes."""

from __future__ import annotations

import numpy as np
import pytest

from bha.estimation.long_run import long_run


def covered(time: float, rows: int, logs: int, draws: int = 400) -> float:
    """Part of draws in which the 95 % interval of a mean holds it; correlation time in rows."""
    random = np.random.default_rng(7)
    keep = np.exp(-1.0 / time)
    kick = np.sqrt(1.0 - keep**2) * random.standard_normal((draws, logs, rows))
    values = np.empty_like(kick)
    values[..., 0] = random.standard_normal((draws, logs))
    for k in range(1, rows):
        values[..., k] = keep * values[..., k - 1] + kick[..., k]
    hits = 0
    for draw in values:
        mean = draw.mean()
        left = [(row - mean)[:, None] for row in draw]
        found = long_run([(own, own, 0.01) for own in left])
        error = found.widening * np.sqrt(found.covariance[0, 0]) / (logs * rows)
        hits += abs(mean) < 1.96 * error
    return hits / draws


@pytest.mark.parametrize(
    ("time", "rows", "logs", "least"),
    [(0.5, 400, 1, 0.92), (10.0, 400, 1, 0.90), (10.0, 200, 2, 0.92), (30, 400, 1, 0.85)],
)
def test_intervals_hold(time: float, rows: int, logs: int, least: float) -> None:
    """With kernels of four autocorrelation lengths and normal points it was 92, 85, 87 and 75 %."""
    assert least <= covered(time, rows, logs) <= 0.99


def test_white_residuals_are_not_widened() -> None:
    """Four rows of a thousand."""
    left = np.random.default_rng(3).standard_normal((1000, 2))
    found = long_run([(left, left, 0.01)])
    assert found.widening < 1.1
    assert found.seconds < 0.03
    np.testing.assert_allclose(np.diag(found.covariance), 1000.0, rtol=0.25)
