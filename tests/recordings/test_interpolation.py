"""Akima's curve against SciPy's, and through what it must not swing beyond."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from bha.recordings.interpolation import akima


def test_where_nothing_is_limited_it_is_the_curve_of_scipy() -> None:
    knots = np.sort(np.random.default_rng(1).uniform(0.0, 10.0, 400))
    values = np.exp(0.3 * knots)
    at = np.linspace(knots[0], knots[-1], 1000)
    np.testing.assert_allclose(akima(at, knots, values), Akima1DInterpolator(knots, values)(at), rtol=1e-9)


def test_a_smooth_curve_is_met_better_than_by_straight_lines() -> None:
    knots = np.arange(0.0, 4.0, 0.04)
    at = np.arange(0.0, 3.9, 0.005)

    def smooth(t: np.ndarray) -> np.ndarray:
        return np.asarray(np.sin(4.0 * t) + np.tanh(12.0 * (t - 3.0)))

    values = smooth(knots)
    error = np.sqrt(np.mean((akima(at, knots, values) - smooth(at)) ** 2))
    assert error < 0.5 * np.sqrt(np.mean((np.interp(at, knots, values) - smooth(at)) ** 2))


def test_readings_that_come_unevenly_do_not_make_it_swing() -> None:
    rng = np.random.default_rng(2)
    knots = np.cumsum(np.where(rng.random(300) < 0.5, 0.002, 0.1))
    values = 644.0 * np.round(150.0 + 20.0 * rng.standard_normal(300))
    curve = akima(np.linspace(knots[0], knots[-1], 20000), knots, values)
    swing = np.ptp(values)
    assert values.min() - 0.1 * swing < curve.min()
    assert curve.max() < values.max() + 0.1 * swing


def test_flat_parts_stay_flat_and_the_ends_constant() -> None:
    knots = np.arange(12.0)
    values = np.where(knots < 6.0, 1.0, 2.0)
    curve = akima(np.linspace(-2.0, 14.0, 500), knots, values)
    assert curve.min() >= 1.0 - 1e-12
    assert curve.max() <= 2.0 + 1e-12
    assert curve[0] == 1.0
    assert curve[-1] == 2.0
