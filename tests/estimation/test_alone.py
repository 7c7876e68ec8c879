"""From which frequency on sensors are alone in what a fit leaves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from bha.estimation.alone import LOWEST, sensors_alone_from

Array = NDArray[np.float64]
STEP = 0.01


def coloured(random: np.random.Generator, time: float, rows: int = 3000, channels: int = 6) -> Array:
    """First-order noise of variance one."""
    kept = np.exp(-STEP / time)
    drawn = random.standard_normal((rows, channels))
    return np.asarray(lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], drawn, axis=0))


@pytest.mark.parametrize("time", [0.001, 0.1])
def test_noise_of_sensors_is_alone_everywhere(time: float) -> None:
    found = [
        sensors_alone_from([coloured(np.random.default_rng([seed, k]), time) for k in range(2)], STEP, 47.0)
        for seed in range(20)
    ]
    assert np.mean(np.array(found) < 2.0 * LOWEST) >= 0.9


def test_below_what_several_sensors_see_they_are_not_alone() -> None:
    for seed in range(5):
        random = np.random.default_rng(seed)
        # A motion of up to 5 Hz that two of six sensors see alike, as large as their noise.
        motion = lfilter(*butter(4, 5.0, fs=1.0 / STEP), random.standard_normal(3000))
        parts = coloured(random, 0.1)
        parts[:, :2] += (motion / motion.std())[:, None]
        assert 3.0 < sensors_alone_from([parts], STEP, 47.0) < 12.0


def test_what_one_sensor_has_more_of_is_not_the_noise_of_all() -> None:
    random = np.random.default_rng(4)
    parts = coloured(random, 0.001)
    slow = lfilter(*butter(4, 3.0, fs=1.0 / STEP), random.standard_normal(3000))
    parts[:, 2] += 2.0 * slow / slow.std()
    assert 2.0 < sensors_alone_from([parts], STEP, 47.0) < 7.0


def test_one_channel_tells_nothing() -> None:
    assert sensors_alone_from([coloured(np.random.default_rng(1), 0.1, channels=1)], STEP, 47.0) == 47.0
