"""What follows something that was logged, and what does not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bha.diagnosis.decide import Decision
from bha.diagnosis.unlogged import CELL, Unlogged, periodic_share, predicted_share

Array = NDArray[np.float64]


def wandering(random: np.random.Generator, rows: int, columns: int, time: float) -> Array:
    """Ornstein-Uhlenbeck noise of unit size with a correlation time, s."""
    kept = np.exp(-CELL / time)
    made = np.empty((rows, columns))
    made[0] = random.standard_normal(columns)
    for k in range(1, rows):
        made[k] = kept * made[k - 1] + np.sqrt(1.0 - kept**2) * random.standard_normal(columns)
    return made


def about_mean(table: Array) -> Array:
    return np.asarray(table - table.mean(axis=0))


@pytest.mark.parametrize("time", [0.3, 1.0])
def test_noise_with_a_memory_follows_nothing_however_many_regressors_there_are(time: float) -> None:
    found = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        tables = [
            (about_mean(wandering(random, 200, 6, time)), about_mean(wandering(random, 200, 80, 1.0))) for _ in range(2)
        ]
        found.append(predicted_share(tables) or 0.0)
    assert np.mean(np.array(found) < 0.1) >= 0.9


def test_what_depends_on_a_regressor_is_found_below_a_disturbance() -> None:
    for seed in range(10):
        random = np.random.default_rng(seed)
        tables = []
        for _ in range(2):
            regressors = about_mean(wandering(random, 200, 80, 1.0))
            # As much as a gap of 1.2 times the disturbance leaves.
            errors = wandering(random, 200, 6, 1.0) + 0.66 * regressors[:, :6]
            tables.append((about_mean(errors), regressors))
        share = predicted_share(tables)
        assert share is not None
        assert share > 0.1


def test_a_sine_keeps_its_phase_and_ringing_does_not() -> None:
    random = np.random.default_rng(3)
    time = CELL * np.arange(200)
    sines = [np.sin(2 * np.pi * 0.83 * time + phase)[:, None] * [1.0, 0.5] for phase in (0.3, 2.0)]
    noisy = [(about_mean(sine + 0.4 * random.standard_normal(sine.shape)), CELL) for sine in sines]
    assert periodic_share(noisy) > 0.5
    ringing = []
    for _ in range(2):
        own, damping = 2 * np.pi * 0.83, 0.05
        y, rate, made = np.zeros(2), np.zeros(2), []
        for _ in time:
            for _ in range(10):
                rate += CELL / 10 * (-2 * damping * own * rate - own**2 * y) + random.standard_normal(2)
                y += CELL / 10 * rate
            made.append(y.copy())
        ringing.append((about_mean(np.array(made)), CELL))
    assert periodic_share(ringing) < 0.3


def test_a_log_far_beside_the_others_is_no_disturbance() -> None:
    given = Decision("unexplained", "the search's own", 0.0)
    assert Unlogged(0.0, 0.0, 1.0, 8.0, 2e-3).judge(given, 5e-4) is given


@pytest.mark.parametrize(
    ("predicted", "periodic", "grown", "verdict", "closure", "expected"),
    [
        (0.02, 0.1, 1.1, "unexplained", 0.0, "equivalent"),
        (0.3, 0.1, 1.1, "unexplained", 0.0, "unexplained"),  # it follows what was logged
        (0.02, 0.5, 1.1, "unexplained", 0.0, "unexplained"),  # a periodic force
        (0.02, 0.1, 3.0, "unexplained", 0.0, "unexplained"),  # the fit knew more of its own logs
        (0.02, 0.1, 1.1, "unexplained", 0.4, "unexplained"),  # effects remove a part of it
        (0.02, 0.1, 1.1, "named", 0.9, "named"),
    ],
)
def test_what_follows_nothing_is_no_gap_of_the_model(
    predicted: float, periodic: float, grown: float, verdict: str, closure: float, expected: str
) -> None:
    given = Decision(verdict, "the search's own", closure)
    made = Unlogged(predicted, periodic, grown, 1.0, 2e-3).judge(given, 5e-4)
    assert made.verdict == expected
    assert ("unlogged forces or pressures" in made.reason) == (expected == "equivalent")
