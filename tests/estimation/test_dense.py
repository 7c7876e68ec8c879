"""Small least squares, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

from bha.estimation.dense import minimize
from bha.estimation.steps import bounded_step

WIDE = np.array([[-np.inf, np.inf]] * 2)


def test_rosenbrock_is_minimal_at_one_one() -> None:
    def residuals(z: np.ndarray) -> np.ndarray:
        return np.array([10.0 * (z[1] - z[0] ** 2), 1.0 - z[0]])

    def jacobian(z: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.array([[-20.0 * z[0], 10.0], [-1.0, 0.0]])

    found = minimize(residuals, jacobian, np.array([-1.2, 1.0]), WIDE, max_iterations=60, tolerance=1e-12)
    assert found.z == pytest.approx([1.0, 1.0], abs=1e-5)


def test_a_bound_holds_and_the_others_are_solved_for() -> None:
    a, b = np.array([[1.0, 0.5], [0.5, 1.0], [0.2, 0.1]]), np.array([2.0, 1.0, 0.3])
    bounds = np.array([[-10.0, 0.5], [-10.0, 10.0]])
    found = minimize(lambda z: a @ z - b, lambda _z, _r: a, np.zeros(2), bounds, tolerance=1e-12)
    rest = np.linalg.lstsq(a[:, 1:], b - 0.5 * a[:, 0], rcond=None)[0]
    assert found.z == pytest.approx([0.5, rest[0]], abs=1e-6)
    assert found.converged


def test_huber_takes_the_median_of_what_lies_far() -> None:
    data = np.array([0.0, 0.1, -0.1, 0.05, 50.0])
    one = np.ones((5, 1))
    found = minimize(lambda z: z - data, lambda _z, _r: one, np.zeros(1), WIDE[:1], huber=0.2, tolerance=1e-10)
    # The mean of the near ones with the far one pulling by its constant: 4 z - 0.05 - 0.2 = 0.
    assert found.z[0] == pytest.approx(0.0625, abs=1e-4)


def test_a_step_within_bounds_is_the_least_of_all_such_steps() -> None:
    rng = np.random.default_rng(6)
    for _ in range(5):
        a, gradient = rng.standard_normal((12, 4)), 8.0 * rng.standard_normal(4)
        matrix, x = a.T @ a, np.array([0.0, 1.0, 0.5, 0.2])
        found = optimize.minimize(
            lambda s, m=matrix, g=gradient: float(0.5 * s @ m @ s - g @ s),
            np.zeros(4),
            bounds=list(zip(-x, 1.0 - x, strict=True)),
        )
        np.testing.assert_allclose(bounded_step(matrix, gradient, -x, 1.0 - x), found.x, atol=1e-4)
