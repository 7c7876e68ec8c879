from __future__ import annotations

import numpy as np
import pytest

from bha.identify.noise import noise_deviation, resolution


def signal(count: int = 4000) -> np.ndarray:
    t = np.arange(count) / 200.0
    return 0.15 + 0.05 * np.sin(2 * np.pi * 1.3 * t) + 0.02 * (t > 7.0)


def test_white_noise_under_motion_and_steps() -> None:
    random = np.random.default_rng(1)
    found = noise_deviation(signal() + 3e-4 * random.standard_normal(4000))
    assert found == pytest.approx(3e-4, rel=0.06)


def test_quantised_channel() -> None:
    random = np.random.default_rng(2)
    values = np.round((signal() + 2e-4 * random.standard_normal(4000)) / 1e-4) * 1e-4
    assert noise_deviation(values) == pytest.approx(np.hypot(2e-4, 1e-4 / np.sqrt(12)), rel=0.15)
    assert resolution(values) == pytest.approx(1e-4, rel=1e-6)


def test_still_channel_has_at_least_its_quantisation() -> None:
    values = np.where(np.arange(1000) % 97 == 0, 0.1001, 0.1)
    assert noise_deviation(values) == pytest.approx(1e-4 / np.sqrt(12), rel=1e-6)


def test_sensor_that_holds_its_value() -> None:
    random = np.random.default_rng(3)
    slow = signal()[::4] + 3e-4 * random.standard_normal(1000)
    held = np.repeat(slow, 4)
    assert noise_deviation(held) == pytest.approx(3e-4, rel=0.2)


def test_nothing_can_be_told_from_a_constant() -> None:
    assert np.isnan(noise_deviation(np.full(100, 0.1)))
