"""Akima's curve against SciPy's, and through what it must not swing beyond."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from bha.recordings.interpolation import akima


def test_it_is_the_curve_of_scipy() -> None:
    rng = np.random.default_rng(1)
    knots = np.sort(rng.uniform(0.0, 10.0, 60))
    values = np.cumsum(rng.standard_normal(60))
    at = np.linspace(knots[0], knots[-1], 1000)
    np.testing.assert_allclose(akima(at, knots, values), Akima1DInterpolator(knots, values)(at), atol=1e-9)


def test_flat_parts_stay_flat_and_the_ends_constant() -> None:
    knots = np.arange(12.0)
    values = np.where(knots < 6.0, 1.0, 2.0)
    curve = akima(np.linspace(-2.0, 14.0, 500), knots, values)
    assert curve.min() >= 1.0 - 1e-12
    assert curve.max() <= 2.0 + 1e-12
    assert curve[0] == 1.0
    assert curve[-1] == 2.0
