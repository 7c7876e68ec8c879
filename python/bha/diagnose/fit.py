"""Output-error fit: plain parameters, effects and the initial state of every log together, by simulation.

What: Levenberg-Marquardt on the whitened residual of whole logs plus the prior. The initial state of each log is eliminated within the
step (its sensitivities fade with the arm's motion, so they are only simulated until then).
Source: Nocedal and Wright 2006, chapter 10; whitening :mod:`bha.diagnose.noise`.
Validity: a local method: it needs the plain arm within some ten to twenty per cent, or a simulation that stays on course.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.diagnose.engine import Engine, Job
from bha.diagnose.model import Model
from bha.diagnose.noise import Whitener
from bha.diagnose.records import Record
from bha.errors import ConvergenceError

Array = NDArray[np.float64]

#: Steps of the difference quotients, in coordinates.
DIFFERENCE = 1e-3
#: Size of one unit of an initial state: m and m/s.
STATE_LENGTH, STATE_RATE = 1e-3, 1e-2
#: Plausible error of an initial state as measured, in these units.
STATE_SPREAD = 10.0
#: After this time the arm has forgotten how it started, s.
MEMORY = 4.0


@dataclass(frozen=True)
class Problem:
    """Logs, their whitening, and the engine.

    Attributes:
        records: the logs.
        whiteners: one a log.
        engine: runs the simulations.
    """

    records: tuple[Record, ...]
    whiteners: tuple[Whitener, ...]
    engine: Engine

    @property
    def rows(self) -> int:
        """Number of white numbers in all."""
        return sum(w.kept * len(r.channels) for w, r in zip(self.whiteners, self.records, strict=True))

    def simulate(self, model: Model, x: Array, states: Sequence[Array]) -> list[Array]:
        """Outputs of every log."""
        arm = model.arm(x)
        return self.engine.run([Job(arm, r, s) for r, s in zip(self.records, states, strict=True)])

    def residual(self, outputs: Sequence[Array]) -> Array:
        """White residual of all logs, measured less simulated, one vector; NaN if a run diverged."""
        return np.concatenate(
            [w(r.outputs - y).ravel() for w, r, y in zip(self.whiteners, self.records, outputs, strict=True)]
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
        state_jacobians: white outputs of each log by its initial state, in units of ``STATE_LENGTH`` and ``STATE_RATE``.
    """

    model: Model
    x: Array
    states: tuple[Array, ...]
    outputs: tuple[Array, ...]
    residual: Array
    cost: float
    jacobian: Array | None = None
    state_jacobians: tuple[Array, ...] | None = None

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
    weights = np.array([c.prior for c in model.coordinates])
    return float(weights @ x**2) if len(x) else 0.0


def state_units(n: int) -> Array:
    """Units of the 2n numbers of a state."""
    return np.concatenate([np.full(n, STATE_LENGTH), np.full(n, STATE_RATE)])


def evaluate(problem: Problem, model: Model, x: Array, states: Sequence[Array]) -> Fit:
    """The model at ``x`` without sensitivities; infinite cost if a run diverged."""
    outputs = problem.simulate(model, x, states)
    residual = problem.residual(outputs)
    cost = float(residual @ residual) + prior_cost(model, x) if np.all(np.isfinite(residual)) else np.inf
    return Fit(model, x, tuple(states), tuple(outputs), residual, cost)


def columns(problem: Problem, fit: Fit, which: Sequence[int]) -> Array:
    """White sensitivities by the coordinates ``which``, shape (rows, len(which)), by forward differences."""
    jobs: list[Job] = []
    steps = []
    for k in which:
        x = fit.x.copy()
        coordinate = fit.model.coordinates[k]
        step = DIFFERENCE
        if coordinate.value(x[k] + step) == coordinate.value(x[k]):
            step = -DIFFERENCE
        x[k] += step
        steps.append(step)
        arm = fit.model.arm(x)
        jobs += [Job(arm, r, s) for r, s in zip(problem.records, fit.states, strict=True)]
    outputs = problem.engine.run(jobs)
    count = len(problem.records)
    result = np.empty((problem.rows, len(which)))
    for column, step in enumerate(steps):
        changed = outputs[column * count : (column + 1) * count]
        change = [(a - b) / step for a, b in zip(changed, fit.outputs, strict=True)]
        result[:, column] = problem.white(change)
    return np.nan_to_num(result)


def state_columns(problem: Problem, fit: Fit) -> tuple[Array, ...]:
    """White sensitivities of each log by its own initial state."""
    n = len(fit.states[0]) // 2
    units = state_units(n)
    arm = fit.model.arm(fit.x)
    jobs = []
    for record, state in zip(problem.records, fit.states, strict=True):
        rows = int(np.searchsorted(record.output_time, record.output_time[0] + MEMORY)) + 1
        for k in range(2 * n):
            changed = state.copy()
            changed[k] += 0.1 * units[k]
            jobs.append(Job(arm, record, changed, rows=rows))
    outputs = problem.engine.run(jobs)
    result = []
    for i, (record, white) in enumerate(zip(problem.records, problem.whiteners, strict=True)):
        table = np.zeros((2 * n, len(record.rows), len(record.channels)))
        for k in range(2 * n):
            y = outputs[i * 2 * n + k]
            table[k, : len(y)] = (y - fit.outputs[i][: len(y)]) / 0.1
        result.append(white(np.nan_to_num(table)).reshape(2 * n, -1).T)
    return tuple(result)


@dataclass(frozen=True)
class Normal:
    """Normal equations with the initial states eliminated.

    Attributes:
        hessian: J^T J after elimination, without prior, shape (size, size).
        gradient: J^T r after elimination.
        jacobian: J projected on the complement of the initial states.
        residual: the residual, likewise.
        back: per log what gives the states' step: (inverse of their normal matrix, their Jacobian).
    """

    hessian: Array
    gradient: Array
    jacobian: Array
    residual: Array
    back: tuple[tuple[Array, Array], ...]


def project_states(problem: Problem, state_jacobians: Sequence[Array], table: Array) -> Array:
    """``table`` (rows, k) on the complement of what initial states can do, prior of the states included."""
    result = table.copy()
    for part, jacobian in zip(problem.slices(), state_jacobians, strict=True):
        normal = jacobian.T @ jacobian + np.eye(jacobian.shape[1]) / STATE_SPREAD**2
        result[part] -= jacobian @ np.linalg.solve(normal, jacobian.T @ table[part])
    return result


def solve_step(problem: Problem, fit: Fit, damping: float, free: NDArray[np.bool_]) -> tuple[Array, list[Array]]:
    """Levenberg-Marquardt step of the coordinates and of the states."""
    assert fit.jacobian is not None
    assert fit.state_jacobians is not None
    weights = np.array([c.prior for c in fit.model.coordinates])
    projected = project_states(problem, fit.state_jacobians, np.column_stack([fit.jacobian, fit.residual]))
    reduced, rest = projected[:, :-1], projected[:, -1]
    hessian = fit.jacobian.T @ reduced
    gradient = fit.jacobian.T @ rest - weights * fit.x
    index = np.flatnonzero(free)
    matrix = hessian[np.ix_(index, index)] + np.diag(weights[index])
    matrix += damping * np.diag(np.diag(matrix)) + 1e-12 * np.trace(matrix) / max(len(index), 1) * np.eye(len(index))
    step = np.zeros_like(fit.x)
    step[index] = np.linalg.solve(matrix, gradient[index])
    states = []
    units = state_units(len(fit.states[0]) // 2)
    for part, jacobian in zip(problem.slices(), fit.state_jacobians, strict=True):
        normal = jacobian.T @ jacobian + np.eye(jacobian.shape[1]) / STATE_SPREAD**2
        left = fit.residual[part] - fit.jacobian[part] @ step
        states.append(np.linalg.solve(normal, jacobian.T @ left) * units)
    return step, states


def improve(
    problem: Problem,
    fit: Fit,
    *,
    iterations: int = 8,
    tolerance: float = 1e-3,
    renew: Sequence[int] | None = None,
    limit: float = 3.0,
) -> Fit:
    """Fit from ``fit`` on.

    Args:
        problem: the logs.
        fit: where to start, with its sensitivities where it has them.
        iterations: most steps.
        tolerance: stop when a step lowers the cost by less than this share, or by less than 0.1.
        renew: coordinates whose sensitivities are renewed in every step; all, and those of the states, if None. The others
            are renewed only when a step fails.
        limit: greatest step of a coordinate.

    Raises:
        ConvergenceError: the start itself diverges.
    """
    if not np.isfinite(fit.cost):
        raise ConvergenceError("the simulation diverges at the start of the fit; is the arm's file that of the logs?")
    if fit.jacobian is None or fit.state_jacobians is None:
        fit = with_sensitivities(problem, fit)
    damping, fresh = 1e-4, True
    free = np.ones(fit.model.size, dtype=np.bool_)
    for _ in range(iterations):
        accepted = None
        for _ in range(5):
            step, states = solve_step(problem, fit, damping, free)
            size = float(np.max(np.abs(step), initial=0.0))
            step *= min(1.0, limit / size) if size > 0 else 1.0
            x = fit.x + step
            x = np.array([c.coordinate(c.value(v)) for c, v in zip(fit.model.coordinates, x, strict=True)])
            trial = evaluate(problem, fit.model, x, [a + b for a, b in zip(fit.states, states, strict=True)])
            if trial.cost < fit.cost:
                accepted = trial
                break
            damping = max(10.0 * damping, 1e-2)
        if accepted is None:
            if fresh:
                break
            fit, fresh = with_sensitivities(problem, fit), True
            continue
        gain = fit.cost - accepted.cost
        damping = 0.2 * damping if damping > 1e-5 else damping
        done = gain < max(tolerance * fit.cost, 0.1)
        fit = replace(accepted, jacobian=fit.jacobian, state_jacobians=fit.state_jacobians)
        if done and fresh:
            break
        fresh = False
        if renew is None:
            fit, fresh = with_sensitivities(problem, fit), True
        elif done:
            break
        else:
            assert fit.jacobian is not None
            jacobian = fit.jacobian.copy()
            jacobian[:, list(renew)] = columns(problem, fit, renew)
            fit = replace(fit, jacobian=jacobian)
    return fit


def with_sensitivities(problem: Problem, fit: Fit) -> Fit:
    """The fit with all its sensitivities."""
    return replace(
        fit,
        jacobian=columns(problem, fit, range(fit.model.size)),
        state_jacobians=state_columns(problem, fit),
    )
