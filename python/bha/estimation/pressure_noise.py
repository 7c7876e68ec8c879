"""What the noise of the measured pressures does to a fit: it spreads the estimate, shifts it and passes for knowledge.

The simulation is driven by measured pressures p + n. To first order the noise n adds G n to the prediction, which
spreads the estimate; that part is covariance. To second order it does two things more. It shifts the estimate: a
parameter that lowers the response G also lowers what the noise adds to the loss, so that noisy pressures make an arm
look more damped than it is (an error in the variables, of size n^2: 12 % of the damping for 1500 Pa in
``benches/identify_recovery.py``). And it adds to the Fisher information: where a slow log says nothing about a mass,
the noise still shakes the simulated arm.

Both are found by adding noise of the same size once more. What the second noise does on average to gradient and
information is what the first one did, and is taken off (simulation and extrapolation, Cook and Stefanski 1994;
corrected scores, Nakamura 1990). Noise and its negative are used as a pair, so that the first order cancels exactly.
Directions of the parameters whose information comes mostly from noise are left to the priors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.errors import ConvergenceError
from bha.estimation.engine import Model
from bha.estimation.problem import Normal, Point, Problem
from bha.estimation.solver import Outcome
from bha.estimation.steps import bounded_step

Array = NDArray[np.float64]

#: Pairs of redrawn noises, each as costly as two steps of the search.
PAIRS = 1
#: A direction counts as measured if more than this part of its information is not noise of the pressures.
MEASURED_SHARE = 0.3
#: Most steps by which the shift of pressure noise is taken off.
_CORRECTIONS = 4
#: By how many times what a linear model says the loss may rise with them.
_FAITHFUL = 3.0


@dataclass(frozen=True)
class Corrected:
    """Information and step of the parameters with what pressure noise did taken off.

    Attributes:
        information: on z in the data, without priors, shape (p, p).
        measured: projection on the directions that the data and not the noise tell; for gradients, shape (p, p).
        step: from the estimate to the corrected one, shape (p,).
        state_steps: those of the initial states that belong to it, shape (windows, 6n).
    """

    information: Array
    measured: Array
    step: Array
    state_steps: Array


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
            mask = problem.model.records[window.record].usable[window.first : window.last]
            change = problem.residuals.white(window, np.nan_to_num(b - a), mask)
            score += np.einsum("tcp,tc->p", sensitivity, change)
        total += np.outer(score, score) / draws
    return total


def uncorrected(problem: Problem, normal: Normal) -> Corrected:
    """Information as it stands, where pressures have no noise."""
    h, _ = normal.reduced()
    return Corrected(
        h - np.diag(problem.prior[1] ** -2.0), np.eye(len(h)), np.zeros(len(h)), np.zeros_like(problem.guesses)
    )


def corrected(problem: Problem, point: Point, normal: Normal, *, seed: int = 0, pairs: int = PAIRS) -> Corrected:
    """Take off what the noise of the pressures did to the information and to the estimate.

    Args:
        problem: the problem.
        point: its minimum, or the corrected point of the step before.
        normal: normal equations there.
        seed: of the redrawn noises.
        pairs: of noises with opposite signs.

    Raises:
        ConvergenceError: a simulation with redrawn noise fails.
    """
    mean, deviation = problem.prior
    prior = np.diag(deviation**-2.0)
    fields = ("h", "g", "h_state", "g_state", "h_mixed")
    changed = {name: 2.0 * getattr(normal, name) for name in fields}
    for draw in range(pairs):
        for sign in (1.0, -1.0):
            disturbed = replace(problem, model=redrawn(problem.model, seed, draw, sign)).normal(point)
            changed = {name: value - getattr(disturbed, name) / (2 * pairs) for name, value in changed.items()}
    better = replace(normal, **changed)
    matrix, gradient = better.reduced()
    if not np.all(np.isfinite(matrix)):
        raise ConvergenceError("a simulation with redrawn pressure noise fails")
    pull = prior @ (mean - point.z)
    root, inverse_root = _roots(normal.reduced()[0] - prior)
    shares, directions = np.linalg.eigh(inverse_root @ (matrix - prior) @ inverse_root.T)
    kept = shares > MEASURED_SHARE
    basis = root @ directions
    information = (basis * np.where(kept, shares, 0.0)) @ basis.T
    measured = (basis * kept) @ directions.T @ inverse_root
    low, high = np.array([c.bounds for c in problem.model.coordinates]).reshape(-1, 2).T
    # Cut off at a bound only afterwards, a step would leave the others where they make up for what is not allowed.
    step = bounded_step(information + prior, measured @ (gradient - pull) + pull, low - point.z, high - point.z)
    return Corrected(information, measured, step, better.state_steps(step))


def without_pressure_noise(
    problem: Problem, outcome: Outcome, *, seed: int, draws: int
) -> tuple[Outcome, Normal, Corrected]:
    """The outcome with what pressure noise has moved it by taken off, normal equations and information there."""
    normal = problem.normal(outcome.point, keep=True)
    if not draws or not is_noisy(problem):
        return outcome, normal, uncorrected(problem, normal)
    bounds = np.array([c.bounds for c in problem.model.coordinates]).T
    better = corrected(problem, outcome.point, normal, seed=seed)
    before = problem.evaluated(outcome.point.z, outcome.point.states)
    first = replace(outcome, point=before), normal, better
    sizes: list[float] = []
    for _ in range(_CORRECTIONS):
        point = outcome.point
        sizes.append(float(better.step @ normal.reduced()[0] @ better.step))
        if len(sizes) > 2 and sizes[-1] > sizes[-2] > sizes[-3]:
            # Corrections that go on growing lead away, along what noise alone tells; one may overshoot.
            break
        moved = problem.evaluated(np.clip(point.z + better.step, *bounds), point.states + better.state_steps)
        if not np.isfinite(moved.cost):
            break
        outcome = replace(outcome, point=moved)
        # Steps within the error are not repeated: the information is that of next to the same point.
        if sizes[-1] < len(better.step):
            break
        normal = problem.normal(moved, keep=True)
        better = corrected(problem, moved, normal, seed=seed)
    # Off the minimum the loss rises by what the shift says, or steps have led to where their derivatives do not hold.
    shift = outcome.point.z - before.z
    said = max(float(shift @ first[1].reduced()[0] @ shift), float(len(shift)))
    if outcome.point.cost - before.cost > _FAITHFUL * said:
        return first
    return outcome, normal, better


def _roots(information: Array) -> tuple[Array, Array]:
    """A matrix L with L L^T the (semidefinite) information, and its inverse; no direction is quite without."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    values = np.maximum(values, 1e-12 * values[-1])
    return scale[:, None] * vectors * np.sqrt(values), (vectors / np.sqrt(values)).T / scale
