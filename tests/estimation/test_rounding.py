"""What rounding adds on average, against readings that are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from bha.estimation.rounding import Rounding, logarithm

STEP, OFFSET = 1e-3, 2.3e-4


def rounding(white: float, shaken: float = 0.0) -> Rounding:
    """Of one channel."""
    return Rounding(np.array([STEP]), np.array([OFFSET]), np.array([white]), np.array([shaken]))


@pytest.mark.parametrize("white", [2e-5, 1e-4, 2.5e-4])
def test_the_mean_of_readings(white: float) -> None:
    """Everywhere in a step but, for little noise, next to its edges."""
    own, random = rounding(white), np.random.default_rng(1)
    course = np.repeat(np.linspace(0.1, 0.101, 41)[:, None], 4000, axis=1).reshape(-1, 1)
    read = own.read(course, random)
    np.testing.assert_allclose((read - OFFSET) / STEP, np.round((read - OFFSET) / STEP), atol=1e-6)
    mean = (read - course).reshape(41, 4000).mean(axis=1)
    off = np.abs(mean - own.error(course[::4000])[:, 0])
    assert np.median(off) < (2e-5 if white > 5e-5 else 5e-5)
    if white > 5e-5:
        assert np.max(off) < 4e-5
        slope = np.gradient(own.error(course[::4000])[:, 0] + course[::4000, 0], course[4000, 0] - course[0, 0])
        np.testing.assert_allclose(own.slope(course[::4000])[3:-3, 0], slope[3:-3], atol=0.25)


def test_a_simulation_that_is_shaken_has_the_same_mean() -> None:
    """What is taken off by a shaken simulation is on average what rounding added to the channel that was not."""
    random = np.random.default_rng(2)
    course = np.linspace(0.1, 0.101, 21)
    shaken = course[:, None] + 1.4e-4 * random.standard_normal((21, 20_000))
    seen = rounding(1e-4, 1.4e-4).error(shaken.reshape(-1, 1)).reshape(21, -1).mean(axis=1)
    np.testing.assert_allclose(seen, rounding(1e-4).error(course[:, None])[:, 0], atol=3e-5)
    naive = rounding(1e-4).error(shaken.reshape(-1, 1)).reshape(21, -1).mean(axis=1)
    assert np.max(np.abs(naive - seen)) > 6e-5


def test_what_stands_still_for_long_no_longer_pulls() -> None:
    """A gain from a channel that moves for 200 readings and stands between two edges for 800."""
    random, own = np.random.default_rng(3), rounding(1e-4)
    x = np.concatenate([np.linspace(0.05, 0.15, 200), np.full(800, 0.1504)])
    estimates = []
    for _ in range(200):
        read = own.read(x[:, None], random)[:, 0]
        gain = float(x @ read / (x @ x))
        plain = gain
        for _ in range(20):
            gain = float(x @ (read - own.error(gain * x[:, None])[:, 0]) / (x @ x))
        estimates.append((plain - 1.0, gain - 1.0))
    plain, better = np.array(estimates).T
    assert abs(plain.mean()) > 5.0 * plain.std()
    assert abs(better.mean()) < min(better.std(), 0.2 * abs(plain.mean()))


def test_the_chance_of_a_reading() -> None:
    """Adds up to one over the readings, and is that of a density where steps are fine."""
    for half in (0.2, 1.0, 5.0):
        at = 0.3 + 2.0 * half * np.arange(-60, 61)
        assert np.exp(logarithm(at, half)).sum() == pytest.approx(1.0, abs=1e-9)
    assert logarithm(np.array([1.5]), 1e-3)[0] == pytest.approx(
        np.log(2e-3) - 1.125 - 0.5 * np.log(2 * np.pi), abs=1e-5
    )
    assert np.isfinite(logarithm(np.array([40.0]), 1.0))[0]
