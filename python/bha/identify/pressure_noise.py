"""What the noise of the measured pressures does to a fit: it spreads the estimate, and it shifts it.

The simulation is driven by measured pressures p + n. To first order the noise n adds G n to the prediction, which
spreads the estimate; that part is covariance. To second order it shifts the estimate: a parameter that lowers the
response G also lowers what the noise adds to the loss, so that noisy pressures make an arm look more damped than it is
(an error in the variables, not in the measurement; of size n^2, 1 % of the damping for 500 Pa on the nominal arm's
section).

Both are found by adding noise of the same size once more. What the second noise does on average to the descent
direction is what the first one did, and is taken off (simulation and extrapolation, Cook and Stefanski 1994, in one
linear step). Noise and its negative are used in pairs, so that the first order cancels exactly and a few pairs are
enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bha.errors import ConvergenceError
from bha.identify.engine import Model
from bha.identify.solver import Normal, Point, Problem

Array = NDArray[np.float64]

#: Pairs of redrawn noises for the shift, each as costly as two steps of the search.
PAIRS = 1


def is_noisy(problem: Problem) -> bool:
    """Whether any pressure of any record has noise."""
    return any(np.any(rec.pressure_noise > 0) for rec in problem.model.records)


def redrawn(model: Model, seed: int, draw: int, sign: float = 1.0) -> Model:
    """The model with noise of the records' size added to (or with ``sign`` -1 taken from) what drives it."""
    records = []
    for number, rec in enumerate(model.records):
        random = np.random.default_rng([seed, draw, number])
        noise = sign * random.standard_normal(rec.drive.pressures.shape) * rec.pressure_noise
        pressures = np.maximum(rec.drive.pressures + noise, 0.0)
        records.append(replace(rec, drive=replace(rec.drive, pressures=pressures)))
    return replace(model, records=tuple(records))


def scores(problem: Problem, point: Point, sensitivities: Sequence[Array], seed: int, draws: int) -> Array:
    """Covariance (p, p) of the descent direction that pressure noise causes.

    Args:
        problem: the problem.
        point: where.
        sensitivities: per window the derivative of its scaled residuals by z, initial state fitted, (rows, C, p); zero
            where a measurement does not count.
        seed: of the redrawn noises.
        draws: how many.
    """
    model, p = problem.model, len(point.z)
    total = np.zeros((p, p))
    if not is_noisy(problem) or not draws:
        return total
    base = model.predict(point.z, problem.windows, point.states)
    for draw in range(draws):
        disturbed = redrawn(model, seed, draw).predict(point.z, problem.windows, point.states)
        score = np.zeros(p)
        for window, sensitivity, a, b in zip(problem.windows, sensitivities, base, disturbed, strict=True):
            change = (b - a) / problem.residuals.scale[window.record]
            score += np.einsum("tcp,tc->p", sensitivity, np.nan_to_num(change))
        total += np.outer(score, score) / draws
    return total


def shift(problem: Problem, point: Point, normal: Normal, *, seed: int = 0, pairs: int = PAIRS) -> tuple[Array, Array]:
    """How far pressure noise has moved the estimate: of the coordinates, shape (p,), and of the states, (windows, 6n).

    Args:
        problem: the problem.
        point: its minimum.
        normal: normal equations there.
        seed: of the redrawn noises.
        pairs: of noises with opposite signs.

    Raises:
        ConvergenceError: a simulation with redrawn noise fails.
    """
    if not is_noisy(problem):
        return np.zeros_like(point.z), np.zeros_like(point.states)
    gradient, gradient_state = -normal.g, -normal.g_state
    for draw in range(pairs):
        for sign in (1.0, -1.0):
            disturbed = replace(problem, model=redrawn(problem.model, seed, draw, sign)).normal(point)
            gradient = gradient + disturbed.g / (2 * pairs)
            gradient_state = gradient_state + disturbed.g_state / (2 * pairs)
    found = replace(normal, g=gradient, g_state=gradient_state)
    matrix, reduced = found.reduced()
    scale = np.sqrt(np.diag(matrix))
    moved = np.linalg.lstsq(matrix / np.outer(scale, scale), reduced / scale, rcond=1e-13)[0] / scale
    if not np.all(np.isfinite(moved)):
        raise ConvergenceError("a simulation with redrawn pressure noise fails")
    return moved, found.state_steps(moved)
