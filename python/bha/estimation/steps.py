"""Pieces that every least-squares search here is made of: Huber's loss, and a Newton step within bounds.

Source: Huber (1964); active set of bounds as for quadratic programs (Nocedal and Wright 2006, section 16.7).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]

#: What keeps a matrix from being singular, in units of its diagonal.
_RIDGE = 1e-13


def huber_loss(residuals: Array, constant: float) -> float:
    """Sum of squares in which what is beyond ``constant`` counts linearly; of squares alone where that is infinite."""
    size = np.abs(residuals)
    inside = np.minimum(size, constant)
    outside = size - inside
    linear = 2.0 * constant * outside if np.isfinite(constant) else 0.0
    return float(np.sum(inside**2 + linear))


def bounded_step(h: Array, g: Array, low: Array, high: Array) -> Array:
    """The step with h step = g; where it would leave ``low`` to ``high`` the best one within these.

    Args:
        h: symmetric matrix, shape (p, p).
        g: right-hand side, shape (p,).
        low: least step of each unknown, shape (p,).
        high: greatest step.
    """
    step = _solve_symmetric(h, g)
    if np.all((step >= low) & (step <= high)):
        return step
    try:
        return _within(h, g, np.minimum(low, 0.0), np.maximum(high, 0.0))
    except np.linalg.LinAlgError:
        return _one_after_the_other(h, g, low, high)


def _within(h: Array, g: Array, low: Array, high: Array) -> Array:
    """The minimum of the quadratic form within the bounds (Stark and Parker 1995); LinAlgError for a singular matrix.

    A step that is cut off afterwards would leave the others where they make up for what is not allowed: the strengths
    of a bank would be no least squares of what cannot be negative.
    """
    d = np.sqrt(np.maximum(np.diag(h), 1e-300))
    factor = np.linalg.cholesky(h / np.outer(d, d) + _RIDGE * np.eye(len(d)))
    right = solve_triangular(factor, g / d, lower=True)
    return np.asarray(lsq_linear(factor.T, right, (low * d, high * d), method="bvls").x / d, dtype=np.float64)


def _one_after_the_other(h: Array, g: Array, low: Array, high: Array) -> Array:
    """Unknowns that would leave their bounds are put there, one after the other, and stay."""
    step = np.zeros_like(g)
    fixed = np.zeros(len(step), dtype=bool)
    for _ in range(len(step) + 1):
        free = ~fixed
        if not free.any():
            break
        rhs = g[free] - h[np.ix_(free, fixed)] @ step[fixed]
        step[free] = _solve_symmetric(h[np.ix_(free, free)], rhs)
        outside = free & ((step < low) | (step > high))
        if not outside.any():
            break
        step[outside] = np.clip(step[outside], low[outside], high[outside])
        fixed |= outside
    return step


def _solve_symmetric(h: Array, g: Array) -> Array:
    """Solve with unit diagonal scaling; directions that the matrix does not know get no step."""
    d = np.sqrt(np.maximum(np.diag(h), 1e-300))
    solution = np.linalg.lstsq(h / np.outer(d, d), g / d, rcond=1e-13)[0]
    return np.asarray(solution / d, dtype=np.float64)
