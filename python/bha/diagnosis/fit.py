"""Output-error fit: plain parameters, effects and the initial state of every log together, by simulation.

What: Levenberg-Marquardt on the whitened residual of whole logs plus the prior. The initial state of each log is
eliminated within the step (its sensitivities fade with the arm's motion, so they are only simulated until then).
Source: Nocedal and Wright 2006, chapter 10; whitening :mod:`bha.diagnosis.noise`.
Validity: a local method: it needs the plain arm within some ten to twenty per cent, or a simulation that stays on
course.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import lsq_linear

from bha.diagnosis.cache import Cache
from bha.diagnosis.engine import Engine
from bha.diagnosis.model import Model
from bha.diagnosis.noise import Whitener
from bha.diagnosis.steps import COARSE_ERROR_SHARE, COARSE_MISFIT_SHARE, allowed, far_apart
from bha.errors import ConvergenceError
from bha.estimation.records import Record
from bha.estimation.runs import Run

Array = NDArray[np.float64]

#: Steps of the difference quotients, in coordinates.
DIFFERENCE = 1e-3
#: Size of one unit of an initial state: m and m/s.
STATE_LENGTH, STATE_RATE = 1e-3, 1e-2
#: Plausible error of an initial state as measured, in these units.
STATE_SPREAD = 10.0
#: Neighbouring numbers of a residual that is not noise that err together, about.
CORRELATION = 20.0
#: After this time the arm has forgotten how it started, s.
MEMORY = 4.0


@dataclass(frozen=True)
class Problem:
    """Logs, their whitening, and the engine.

    Attributes:
        records: the logs.
        whiteners: one a log.
        engine: runs the simulations.
        cache: keeps finished fits.
        restarts: plain coordinates from which every fit of a larger or smaller model starts as well, where the cost has
            several valleys (stiff arms, see :mod:`bha.diagnosis.baseline`).
    """

    records: tuple[Record, ...]
    whiteners: tuple[Whitener, ...]
    engine: Engine
    cache: Cache = field(default_factory=lambda: Cache(None, ""))
    restarts: tuple[Array, ...] = ()

    @property
    def rows(self) -> int:
        """Number of white numbers in all."""
        return sum(w.kept * len(r.channels) for w, r in zip(self.whiteners, self.records, strict=True))

    def misfit(self, fit: Fit) -> float:
        """Error of a fit over that of a right model."""
        return float(np.sqrt(fit.squares / self.rows))

    def simulate(self, model: Model, x: Array, states: Sequence[Array]) -> list[Array]:
        """Outputs of every log."""
        return self.engine.run(model.runs(x, self.records, states), finer=model.finer)

    def residual(self, outputs: Sequence[Array]) -> Array:
        """White residual of all logs, measured less simulated, one vector; NaN if a run diverged."""
        return np.concatenate(
            [w(r.measured - y).ravel() for w, r, y in zip(self.whiteners, self.records, outputs, strict=True)]
        )

    def white(self, changes: Sequence[Array]) -> Array:
        """White rows of a change of the outputs of all logs, one vector."""
        return np.concatenate([w(y).ravel() for w, y in zip(self.whiteners, changes, strict=True)])

    def slices(self) -> list[slice]:
        """Where each log's numbers are in the vector."""
        found, at = [], 0
        for w, r in zip(self.whiteners, self.records, strict=True):
            size = w.kept * len(r.channels)
            found.append(slice(at, at + size))
            at += size
        return found


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        model: plain arm and effects.
        x: coordinates.
        states: initial state of each log.
        outputs: simulated outputs of each log.
        residual: white residual.
        cost: sum of squares of the residual plus the prior's.
        jacobian: white outputs by coordinates, shape (rows, size), or None.
        state_jacobians: white outputs of each log by its initial state, in units of ``STATE_LENGTH`` and
            ``STATE_RATE``.
        trust: weight of the prior against the squares of the residual, see :func:`prior_weight`.
    """

    model: Model
    x: Array
    states: tuple[Array, ...]
    outputs: tuple[Array, ...]
    residual: Array
    cost: float
    jacobian: Array | None = None
    state_jacobians: tuple[Array, ...] | None = None
    trust: float = 1.0

    @property
    def squares(self) -> float:
        """Sum of squares of the white residual."""
        return float(self.residual @ self.residual)

    @property
    def prior(self) -> float:
        """Sum of squares of the prior."""
        return prior_cost(self.model, self.x)


def prior_cost(model: Model, x: Array) -> float:
    """Squares of the coordinates that have a prior."""
    weights = np.array([c.prior_weight for c in model.coordinates])
    return float(weights @ x**2) if len(x) else 0.0


def state_units(n: int) -> Array:
    """Units of the 2n numbers of a state."""
    return np.concatenate([np.full(n, STATE_LENGTH), np.full(n, STATE_RATE)])


def prior_weight(squares: float, rows: int) -> float:
    """Weight of the prior: one under a right model, and as much more as the residual exceeds the noise.

    A residual that is not noise but physics is no evidence about the plain parameters to the precision of the noise:
    neighbouring samples err together. Without this a strong effect drives them to absurd values, and the absurd values
    hide the effect.
    """
    return 1.0 + CORRELATION * max(0.0, squares / rows - 1.05)


def evaluate(problem: Problem, model: Model, x: Array, states: Sequence[Array], trust: float = 1.0) -> Fit:
    """The model at ``x`` without sensitivities; infinite cost if a run diverged."""
    outputs = problem.simulate(model, x, states)
    residual = problem.residual(outputs)
    cost = float(residual @ residual) + trust * prior_cost(model, x) if np.all(np.isfinite(residual)) else np.inf
    return Fit(model, x, tuple(states), tuple(outputs), residual, cost, trust=trust)


def weighted(fit: Fit, rows: int) -> Fit:
    """The fit with the weight of the prior that its residual asks for."""
    trust = prior_weight(fit.squares, rows)
    return replace(fit, trust=trust, cost=fit.squares + trust * fit.prior)


def columns(problem: Problem, fit: Fit, which: Sequence[int]) -> Array:
    """White sensitivities by the coordinates ``which``, shape (rows, len(which)), by forward differences."""
    runs: list[Run] = []
    steps = []
    for k in which:
        x = fit.x.copy()
        coordinate = fit.model.coordinates[k]
        step = DIFFERENCE
        if coordinate.value(x[k] + step) == coordinate.value(x[k]):
            step = -DIFFERENCE
        x[k] += step
        steps.append(step)
        runs += fit.model.runs(x, problem.records, fit.states)
    base, outputs = with_base(problem, fit, runs)
    count = len(problem.records)
    result = np.empty((problem.rows, len(which)))
    for column, step in enumerate(steps):
        changed = outputs[column * count : (column + 1) * count]
        change = [(a - b) / step for a, b in zip(changed, base, strict=True)]
        result[:, column] = problem.white(change)
    return np.nan_to_num(result)


def with_base(problem: Problem, fit: Fit, runs: Sequence[Run]) -> tuple[list[Array], list[Array]]:
    """Outputs of the fit and of ``runs``, all at one step: their differences are what is wanted.

    The coarse step serves where it makes of the fit itself what the fine one does: beyond its limit stiction chatters,
    and differences of chatter are no sensitivities.
    """
    first, finer = fit.model.runs(fit.x, problem.records, fit.states), fit.model.finer
    count = len(first)
    outputs = problem.engine.run([*first, *runs], coarse=True, finer=finer)
    share = allowed(COARSE_ERROR_SHARE, COARSE_MISFIT_SHARE, problem.misfit(fit))
    if far_apart(problem.records, outputs[:count], fit.outputs, share):
        outputs = problem.engine.run([*first, *runs], finer=finer)
    return outputs[:count], outputs[count:]


def state_columns(problem: Problem, fit: Fit) -> tuple[Array, ...]:
    """White sensitivities of each log by its own initial state."""
    n = len(fit.states[0]) // 2
    units = state_units(n)
    runs = []
    for run in fit.model.runs(fit.x, problem.records, fit.states):
        time = run.record.time
        rows = min(int(np.searchsorted(time, time[0] + MEMORY)) + 1, len(time))
        for k in range(2 * n):
            changed = run.state.copy()
            changed[k] += 0.1 * units[k]
            runs.append(replace(run, state=changed, last=rows))
    base, outputs = with_base(problem, fit, runs)
    result = []
    for i, (record, white) in enumerate(zip(problem.records, problem.whiteners, strict=True)):
        table = np.zeros((2 * n, len(record.rows), len(record.channels)))
        for k in range(2 * n):
            y = outputs[i * 2 * n + k]
            table[k, : len(y)] = (y - base[i][: len(y)]) / 0.1
        result.append(white(np.nan_to_num(table)).reshape(2 * n, -1).T)
    return tuple(result)


def project_states(problem: Problem, state_jacobians: Sequence[Array], table: Array, misfit: float = 1.0) -> Array:
    """``table`` (rows, k) on the complement of what initial states can do, prior of the states included.

    ``misfit`` is the mean square of a residual that is not noise: what states may do to fit it counts for less.
    """
    result = table.copy()
    for part, jacobian in zip(problem.slices(), state_jacobians, strict=True):
        normal = jacobian.T @ jacobian + misfit * np.eye(jacobian.shape[1]) / STATE_SPREAD**2
        result[part] -= jacobian @ np.linalg.solve(normal, jacobian.T @ table[part])
    return result


def solve_step(problem: Problem, fit: Fit, damping: float) -> tuple[Array, list[Array]]:
    """Levenberg-Marquardt step of the coordinates and of the states."""
    assert fit.jacobian is not None
    assert fit.state_jacobians is not None
    weights = fit.trust * np.array([c.prior_weight for c in fit.model.coordinates])
    misfit = max(1.0, fit.squares / problem.rows)
    projected = project_states(problem, fit.state_jacobians, np.column_stack([fit.jacobian, fit.residual]), misfit)
    reduced, rest = projected[:, :-1], projected[:, -1]
    hessian = fit.jacobian.T @ reduced
    gradient = fit.jacobian.T @ rest - weights * fit.x
    matrix = hessian + np.diag(weights)
    matrix += damping * np.diag(np.diag(matrix)) + 1e-12 * np.trace(matrix) / max(len(matrix), 1) * np.eye(len(matrix))
    step = _within_bounds(matrix, gradient, fit)
    states = []
    units = state_units(len(fit.states[0]) // 2)
    for part, jacobian in zip(problem.slices(), fit.state_jacobians, strict=True):
        normal = jacobian.T @ jacobian + misfit * np.eye(jacobian.shape[1]) / STATE_SPREAD**2
        normal += damping * np.diag(np.diag(normal))
        left = fit.residual[part] - fit.jacobian[part] @ step
        states.append(np.linalg.solve(normal, jacobian.T @ left) * units)
    return step, states


def _within_bounds(matrix: Array, gradient: Array, fit: Fit) -> Array:
    """The step that minimises the quadratic form within the bounds of the coordinates.

    One that is cut off afterwards would leave the others where they make up for what is not allowed: the strengths of a
    bank would be no least squares of what cannot be negative.
    """
    step = np.asarray(np.linalg.solve(matrix, gradient), dtype=np.float64)
    low, high = np.array([c.bounds for c in fit.model.coordinates]).reshape(-1, 2).T - fit.x
    if np.all((step >= low) & (step <= high)):
        return step
    factor = np.linalg.cholesky(matrix)
    right = solve_triangular(factor, gradient, lower=True)
    inside = (np.minimum(low, 0.0), np.maximum(high, 0.0))
    return np.asarray(lsq_linear(factor.T, right, inside, method="bvls").x, dtype=np.float64)


def improve(
    problem: Problem,
    fit: Fit,
    *,
    iterations: int = 8,
    tolerance: float = 1e-3,
    renew: Sequence[int] | None = None,
    limit: float = 3.0,
    renewals: int = 3,
) -> Fit:
    """Fit from ``fit`` on.

    Sensitivities are kept from step to step as long as they predict what a step brings, and renewed when they do not:
    they cost some thirty times a run.

    Args:
        problem: the logs.
        fit: where to start, with its sensitivities where it has them.
        iterations: most steps.
        tolerance: stop when a step lowers the cost by less than this share, or by less than 0.5.
        renew: coordinates whose sensitivities are renewed in every step in any case (those that enter most
            nonlinearly).
        limit: greatest step of a coordinate.
        renewals: how often all sensitivities may be renewed.

    Raises:
        ConvergenceError: the start itself diverges.
    """
    if not np.isfinite(fit.cost):
        raise ConvergenceError("the simulation diverges at the start of the fit; is the arm's file that of the logs?")
    if fit.jacobian is None or fit.state_jacobians is None:
        fit = with_sensitivities(problem, fit)
    fit = weighted(fit, problem.rows)
    damping, fresh = 1e-4, True
    for _ in range(iterations):
        trial, predicted = _attempt(problem, fit, damping, limit)
        for _ in range(6):
            if trial is not None and trial.cost < fit.cost:
                break
            damping = max(30.0 * damping, 1e-2)
            trial, predicted = _attempt(problem, fit, damping, limit)
        if trial is None or trial.cost >= fit.cost:
            if fresh or renewals == 0:
                break
            fit, fresh, renewals, damping = with_sensitivities(problem, fit), True, renewals - 1, 1e-4
            continue
        gain = fit.cost - trial.cost
        damping = max(0.1 * damping, 1e-7)
        small = gain < max(tolerance * fit.cost, 0.5)
        fit = weighted(replace(trial, jacobian=fit.jacobian, state_jacobians=fit.state_jacobians), problem.rows)
        if small and (fresh or renewals == 0):
            break
        good = gain > 0.6 * predicted and not small
        fresh = False
        if not good and renewals > 0:
            fit, fresh, renewals = with_sensitivities(problem, fit), True, renewals - 1
        elif renew:
            assert fit.jacobian is not None
            jacobian = fit.jacobian.copy()
            jacobian[:, list(renew)] = columns(problem, fit, renew)
            fit = replace(fit, jacobian=jacobian)
    return fit


def restarted(problem: Problem, fit: Fit) -> Fit:
    """``fit``, or if that ends lower the fit of the same model from a restart of the problem, all effects anew."""
    effects = [v for effect in fit.model.effects for v in effect.begin]
    for plain in problem.restarts:
        start = evaluate(problem, fit.model, np.concatenate([plain, effects]), fit.states, fit.trust)
        if np.isfinite(start.cost):
            other = improve(problem, start, iterations=20, tolerance=2e-3, renewals=7)
            fit = min(fit, other, key=lambda f: f.cost)
    return fit


def _attempt(problem: Problem, fit: Fit, damping: float, limit: float) -> tuple[Fit | None, float]:
    """A step, its result, and the gain that the sensitivities predict."""
    step, states = solve_step(problem, fit, damping)
    size = float(np.max(np.abs(step), initial=0.0))
    if size > limit:
        step *= limit / size
        states = [s * (limit / size) for s in states]
    x = fit.x + step
    x = np.array([c.coordinate(c.value(v)) for c, v in zip(fit.model.coordinates, x, strict=True)])
    trial = evaluate(problem, fit.model, x, [a + b for a, b in zip(fit.states, states, strict=True)], fit.trust)
    assert fit.jacobian is not None
    assert fit.state_jacobians is not None
    left = fit.residual - fit.jacobian @ (x - fit.x)
    units = state_units(len(fit.states[0]) // 2)
    for part, jacobian, change in zip(problem.slices(), fit.state_jacobians, states, strict=True):
        left[part] -= jacobian @ (change / units)
    predicted = fit.cost - float(left @ left) - fit.trust * prior_cost(fit.model, x)
    return (trial if np.isfinite(trial.cost) else None), predicted


def with_sensitivities(problem: Problem, fit: Fit) -> Fit:
    """The fit with all its sensitivities."""
    return replace(
        fit,
        jacobian=columns(problem, fit, range(fit.model.size)),
        state_jacobians=state_columns(problem, fit),
    )
