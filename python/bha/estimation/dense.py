"""Small nonlinear least squares by the method of Levenberg and Marquardt, within bounds.

For problems of some ten unknowns whose residuals and derivatives come as whole matrices. A parameter that would leave
its bounds is put on its bound and the others are solved for. Residuals beyond ``huber`` count linearly.
Source: Levenberg (1944), Marquardt (1963).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.estimation.steps import bounded_step, huber_loss

Array = NDArray[np.float64]

_LARGEST_DAMPING = 1e6


@dataclass(frozen=True)
class Minimum:
    """Where a search ended.

    Attributes:
        z: the best point, shape (p,).
        cost: loss there.
        converged: whether a full step would not have lowered the loss by more than the tolerance.
        iterations: steps taken.
    """

    z: Array
    cost: float
    converged: bool
    iterations: int


def minimize(
    residuals: Callable[[Array], Array],
    jacobian: Callable[[Array, Array], Array],
    start: Array,
    bounds: Array,
    *,
    huber: float = np.inf,
    max_iterations: int = 30,
    tolerance: float = 1e-4,
) -> Minimum:
    """Minimise the loss of residuals from a point.

    Args:
        residuals: of a point (p,), shape (m,); not finite where the point is not allowed.
        jacobian: of a point and its residuals, shape (m, p).
        start: where from; its residuals must be finite.
        bounds: of the unknowns, shape (p, 2).
        huber: residuals beyond it count linearly.
        max_iterations: most steps.
        tolerance: part of the loss that a step must promise.
    """
    z, left = start.copy(), residuals(start)
    cost, damping = huber_loss(left, huber), 1e-3
    for iteration in range(max_iterations):
        slopes = jacobian(z, left)
        weight = np.minimum(1.0, huber / np.maximum(np.abs(left), 1e-300))
        h, g = slopes.T @ (slopes * weight[:, None]), -slopes.T @ (weight * left)
        if not np.all(np.isfinite(h)):
            return Minimum(z, cost, False, iteration)
        full = _step(h, g, z, bounds, 1e-10)
        if g @ full < tolerance * cost:
            return Minimum(z, cost, True, iteration)
        while True:
            trial = np.clip(z + _step(h, g, z, bounds, damping), bounds[:, 0], bounds[:, 1])
            there = residuals(trial)
            new = huber_loss(there, huber) if np.all(np.isfinite(there)) else np.inf
            if new < cost:
                break
            damping *= 10.0
            if damping > _LARGEST_DAMPING:
                return Minimum(z, cost, True, iteration)
        z, left, cost = trial, there, new
        damping = max(damping / 10.0, 1e-9)
    return Minimum(z, cost, False, max_iterations)


def _step(h: Array, g: Array, z: Array, bounds: Array, damping: float) -> Array:
    """The damped step within the bounds."""
    return bounded_step(h + damping * np.diag(np.diag(h)), g, bounds[:, 0] - z, bounds[:, 1] - z)
