"""Nonlinear least squares over shared parameters and the initial state of each window.

The unknowns have the form of an arrow: every window has its own initial state and all share the parameters. Each
Levenberg-Marquardt step therefore eliminates the initial states window by window (Schur complement), so that a hundred
windows cost little more than one. Bounds hold the parameters, wide priors hold what the data do not tell, and a Huber
loss on residuals in units of their scale keeps outliers from deciding.

Source: Levenberg (1944), Marquardt (1963); elimination as in bundle adjustment, Triggs et al. (2000), section 6.1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bha.errors import ConvergenceError
from bha.estimation.engine import Model
from bha.estimation.innovations import Whitening
from bha.estimation.records import Window
from bha.estimation.steps import bounded_step, huber_loss

Array = NDArray[np.float64]

#: Residuals beyond this many scales count linearly, not squared (Huber).
HUBER = 3.0
#: Standard deviations of the prior on initial lengths (m) and rates (m/s) about their guess: very wide.
STATE_DEVIATION = (0.02, 0.5)
_LARGEST_DAMPING = 1e8
_NEGLIGIBLE = 1e-2
#: A step that keeps less than this part of its promise is bent, at most so often, by ever shorter corrections.
_KEPT, _BENDS, _SHORTER = 0.75, 3, 0.5
#: Damping of the full step, which is tried first and taken where it keeps this part of its promise.
_LEAST_DAMPING, _TRUSTED = 1e-10, 0.5


@dataclass(frozen=True)
class Residuals:
    """How predictions and measurements are compared.

    Attributes:
        scale: per record the scale of each channel's residuals, m, shape (C,).
        huber: Huber's constant in scales; infinite for plain least squares.
        whitening: filters that take a window's residuals to innovations; for windows that have none (gain 0, output
            error) they are divided by their scale.
    """

    scale: tuple[Array, ...]
    huber: float = HUBER
    whitening: Mapping[Window, Whitening] = field(default_factory=dict)

    def scaled(self, model: Model, window: Window, predicted: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Residuals in scales, shape (rows, C), zero where a measurement does not count, and which count."""
        rec = model.records[window.record]
        rows = slice(window.first, window.last)
        mask = rec.usable[rows]
        return self.white(window, np.where(mask, rec.measured[rows], 0.0) - predicted, mask), mask

    def white(self, window: Window, values: Array, mask: NDArray[np.bool_]) -> Array:
        """Residuals (rows, C), or what is linear in them (rows, C, ...), in scales; zero where nothing counts."""
        kept = np.where(mask.reshape(*mask.shape, *[1] * (values.ndim - 2)), values, 0.0)
        if window in self.whitening:
            return self.whitening[window](kept)
        return np.asarray(kept / self.scale[window.record].reshape(-1, *[1] * (values.ndim - 2)))

    def cost(self, residuals: Array) -> float:
        """Sum of the loss; for plain least squares the sum of squares."""
        return huber_loss(residuals, self.huber)

    def weights(self, residuals: Array) -> Array:
        """Square roots of the weights that make the loss a sum of squares at this point."""
        with np.errstate(divide="ignore"):
            return np.sqrt(np.minimum(1.0, self.huber / np.abs(residuals)))


@dataclass(frozen=True)
class Point:
    """A point of the search.

    Attributes:
        z: coordinates of the parameters, shape (p,).
        states: initial states of the windows, shape (windows, 6n).
        cost: loss there, priors included.
    """

    z: Array
    states: Array
    cost: float = np.inf


@dataclass(frozen=True)
class Outcome:
    """Where a search ended.

    Attributes:
        point: the best point.
        converged: whether nothing was left to gain there.
        message: why it ended.
        iterations: steps taken.
        history: loss after each step.
        interrupted: whether Ctrl-C ended it.
    """

    point: Point
    converged: bool
    message: str
    iterations: int
    history: tuple[float, ...] = field(default=())
    interrupted: bool = False


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in a search; it hands on how far that has come."""

    def __init__(self, outcome: Outcome) -> None:
        """``outcome``: the best point so far."""
        super().__init__("interrupted")
        self.outcome = outcome


@dataclass(frozen=True)
class Block:
    """A window's linearization: weighed residuals (rows, C) and their derivatives by z (..., p) and state (..., 6n).

    ``weight`` are the square roots of the loss' weights, shape (rows, C).
    """

    residual: Array
    by_z: Array
    by_state: Array
    mask: NDArray[np.bool_]
    weight: Array


@dataclass(frozen=True)
class Normal:
    """Normal equations of one linearization, initial states kept apart window by window.

    Attributes:
        h: by the parameters, priors included, shape (p, p).
        g: right-hand side, shape (p,).
        h_state: by each window's initial state, shape (windows, 6n, 6n).
        g_state: right-hand sides, shape (windows, 6n).
        h_mixed: between the two, shape (windows, 6n, p).
        blocks: what they were made of, if asked for.
    """

    h: Array
    g: Array
    h_state: Array
    g_state: Array
    h_mixed: Array
    blocks: tuple[Block, ...] | None = None

    def reduced(self, damping: float = 0.0) -> tuple[Array, Array]:
        """Matrix and right-hand side for the parameters alone, initial states eliminated."""
        h = self.h + damping * np.diag(np.diag(self.h))
        h_state = self.h_state.copy()
        diagonal = np.arange(h_state.shape[1])
        h_state[:, diagonal, diagonal] *= 1.0 + damping
        gain = np.linalg.solve(h_state, self.h_mixed)
        return h - np.einsum("wsp,wsq->pq", self.h_mixed, gain), self.g - np.einsum("wsp,ws->p", gain, self.g_state)

    def after(self, dz: Array, states: Array) -> tuple[Array, Array]:
        """Right-hand sides once a step has been taken, were the model linear: shapes (p,) and (windows, 6n)."""
        g = self.g - self.h @ dz - np.einsum("wsp,ws->p", self.h_mixed, states)
        return g, self.g_state - self.h_mixed @ dz - np.einsum("wst,wt->ws", self.h_state, states)

    def state_steps(self, dz: Array, damping: float = 0.0) -> Array:
        """Steps of the initial states that belong to a step of the parameters, shape (windows, 6n)."""
        h_state = self.h_state.copy()
        diagonal = np.arange(h_state.shape[1])
        h_state[:, diagonal, diagonal] *= 1.0 + damping
        steps = np.linalg.solve(h_state, (self.g_state - self.h_mixed @ dz)[..., None])[..., 0]
        return np.asarray(steps, dtype=np.float64)


@dataclass(frozen=True)
class Problem:
    """A model, windows, how residuals are weighed, and the priors.

    Attributes:
        model: model and records.
        windows: the windows.
        residuals: how residuals are weighed.
        guesses: guessed initial states, centre of their prior, shape (windows, 6n).
        prior: mean and standard deviation of the coordinates, each (p,); infinite deviations for none.
        deviations: standard deviations of the prior on initial lengths (m) and rates (m/s) about their guess.
    """

    model: Model
    windows: tuple[Window, ...]
    residuals: Residuals
    guesses: Array
    prior: tuple[Array, Array]
    deviations: tuple[float, float] = STATE_DEVIATION

    @property
    def state_deviation(self) -> Array:
        """Standard deviations of the prior on an initial state, shape (6n,)."""
        n = self.guesses.shape[1] // 2
        return np.repeat(self.deviations, n)

    def evaluated(self, z: Array, states: Array) -> Point:
        """The point with its loss; infinite where a simulation fails."""
        left = self.left(z, states)
        if left is None:
            return Point(z, states)
        return Point(z, states, self._prior_cost(z, states) + sum(self.residuals.cost(residual) for residual in left))

    def left(self, z: Array, states: Array) -> list[Array] | None:
        """Residuals of the windows in scales, each (rows, C); None where a simulation fails."""
        found = []
        for window, predicted in zip(self.windows, self.model.predict(z, self.windows, states), strict=True):
            residual, _ = self.residuals.scaled(self.model, window, predicted)
            if not np.all(np.isfinite(residual)):
                return None
            found.append(residual)
        return found

    def there(self, normal: Normal, z: Array, states: Array) -> tuple[Point, Normal | None]:
        """A point, and ``normal`` with the descent direction of what is left there, its derivatives as they were."""
        left = self.left(z, states)
        if left is None:
            return Point(z, states), None
        assert normal.blocks is not None
        point = Point(z, states, self._prior_cost(z, states) + sum(self.residuals.cost(residual) for residual in left))
        mean, deviation = self.prior
        g, g_state = (mean - z) / deviation**2, self.state_deviation**-2.0 * (self.guesses - states)
        for k, (block, residual) in enumerate(zip(normal.blocks, left, strict=True)):
            weighed = block.weight * residual
            g = g + np.einsum("tcp,tc->p", block.by_z, weighed)
            g_state[k] += np.einsum("tcs,tc->s", block.by_state, weighed)
        return point, replace(normal, g=g, g_state=g_state)

    def failing_window(self, z: Array, states: Array) -> Window | None:
        """The first window whose simulation fails, if any."""
        for window, predicted in zip(self.windows, self.model.predict(z, self.windows, states), strict=True):
            if not np.all(np.isfinite(predicted)):
                return window
        return None

    def normal(self, point: Point, *, keep: bool = False) -> Normal:
        """Normal equations at a point; of the gradients the descent direction, -1/2 of the loss' derivative."""
        blocks = []
        p, w, s = len(point.z), len(self.windows), self.guesses.shape[1]
        mean, deviation = self.prior
        h, g = np.diag(deviation**-2.0), (mean - point.z) / deviation**2
        state_precision = self.state_deviation**-2.0
        h_state, g_state, h_mixed = np.empty((w, s, s)), np.empty((w, s)), np.empty((w, s, p))
        linear = self.model.linearize(point.z, self.windows, point.states)
        for k, (window, (predicted, by_z, by_state)) in enumerate(zip(self.windows, linear, strict=True)):
            residual, mask = self.residuals.scaled(self.model, window, predicted)
            weight = self.residuals.weights(residual)
            slopes = self.residuals.white(window, np.concatenate([by_z, by_state], axis=-1), mask) * weight[..., None]
            block = Block(weight * residual, slopes[..., :p], slopes[..., p:], mask, weight)
            a, b, r = block.by_z.reshape(mask.size, p), block.by_state.reshape(mask.size, s), block.residual.ravel()
            h, g = h + a.T @ a, g + a.T @ r
            h_state[k] = b.T @ b + np.diag(state_precision)
            g_state[k] = b.T @ r + state_precision * (self.guesses[k] - point.states[k])
            h_mixed[k] = b.T @ a
            if keep:
                blocks.append(block)
        return Normal(h, g, h_state, g_state, h_mixed, tuple(blocks) if keep else None)

    def rescaled(self, residuals: Residuals) -> Problem:
        """The same problem with residuals weighed otherwise."""
        return replace(self, residuals=residuals)

    def _prior_cost(self, z: Array, states: Array) -> float:
        mean, deviation = self.prior
        return float(
            np.sum(((z - mean) / deviation) ** 2) + np.sum(((states - self.guesses) / self.state_deviation) ** 2)
        )


def solve(
    problem: Problem,
    start: Point,
    *,
    max_iterations: int = 40,
    tolerance: float = 1e-6,
    damping: float = 1e-4,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Minimise the loss from a point.

    Args:
        problem: what to minimise.
        start: where from.
        max_iterations: most steps.
        tolerance: converged when a full step is expected to lower the loss by less than this part of it (or by less
            than a hundredth, where one standard error of one parameter changes it by one).
        damping: relative damping of the first step.
        progress: called with the number of steps and the loss.

    Returns:
        The best point, whether it is a minimum, and why the search ended.

    Raises:
        ConvergenceError: the simulation fails at the start.
        Interrupted: Ctrl-C after that.
    """
    best = problem.evaluated(start.z, start.states)
    if not np.isfinite(best.cost):
        raise ConvergenceError(_failure_text(problem, start))
    bounds = np.array([coordinate.bounds for coordinate in problem.model.coordinates]).reshape(-1, 2)
    history = [best.cost]
    gain = np.inf
    try:
        for iteration in range(max_iterations):
            if progress is not None:
                progress(iteration, best.cost)
            try:
                normal = problem.normal(best, keep=True)
            except ConvergenceError as error:
                return Outcome(best, False, str(error), iteration, tuple(history))
            if not (np.all(np.isfinite(normal.h)) and np.all(np.isfinite(normal.h_mixed))):
                return Outcome(best, False, "a derivative is not finite", iteration, tuple(history))
            gain = _expected_gain(normal, best.z, bounds, problem)
            if gain < max(_NEGLIGIBLE, tolerance * best.cost):
                return Outcome(best, True, "nothing left to gain", iteration, tuple(history))
            trial = _tried(problem, normal, best, bounds, _LEAST_DAMPING)
            bent = best.cost - trial.cost > _TRUSTED * gain
            while not bent:
                trial = _tried(problem, normal, best, bounds, damping)
                if trial.cost < best.cost:
                    break
                damping = max(10.0 * damping, 1e-6)
                if damping > _LARGEST_DAMPING:
                    done = gain < 1e-3 * best.cost
                    message = "no step lowers the loss" + ("" if done else ", though one should")
                    return Outcome(best, done, message, iteration, tuple(history))
            best = trial
            history.append(best.cost)
            damping = max(damping / 10.0, 1e-10)
    except KeyboardInterrupt:
        stopped = Outcome(best, False, "interrupted", len(history) - 1, tuple(history), interrupted=True)
        raise Interrupted(stopped) from None
    return Outcome(best, False, f"not converged after {max_iterations} steps", max_iterations, tuple(history))


def _tried(problem: Problem, normal: Normal, best: Point, bounds: Array, damping: float) -> Point:
    """The point a damped step leads to, bent along the valley where the straight step misses what it promised.

    In a curved valley a step along it climbs its sides. What is left there beyond what a linear model would leave is
    projected back by the same derivatives, hardly damped: the second-order term of the path (geodesic acceleration,
    Transtrum and Sethna 2012), which leads back to the bottom without another linearization.
    """
    z, states = _step(normal, best, bounds, damping)
    dz, moved = z - best.z, states - best.states
    promised = float(normal.g @ dz + np.sum(normal.g_state * moved))
    g, g_state = normal.after(dz, moved)
    trial, there = problem.there(normal, z, states)
    lowest, size = trial, float(np.linalg.norm(dz))
    for _ in range(_BENDS):
        if there is None or best.cost - lowest.cost > _KEPT * promised:
            break
        beyond = replace(there, g=there.g - g, g_state=there.g_state - g_state)
        z, states = _step(beyond, trial, bounds, _LEAST_DAMPING)
        bend = float(np.linalg.norm(z - trial.z))
        # A correction as long as what it corrects is none.
        if bend > _SHORTER * size:
            break
        trial, there = problem.there(normal, z, states)
        lowest, size = min(lowest, trial, key=lambda point: point.cost), bend
    return lowest


def _expected_gain(normal: Normal, z: Array, bounds: Array, problem: Problem) -> float:
    """How much the loss would fall with an undamped step, were the model linear."""
    point = Point(z, np.zeros_like(problem.guesses))
    new, steps = _step(normal, point, bounds, 1e-12)
    dz = new - z
    gain = normal.g @ dz + np.sum(normal.g_state * steps)
    return float(gain)


def _step(normal: Normal, point: Point, bounds: Array, damping: float) -> tuple[Array, Array]:
    """The damped step within the bounds: a parameter that would leave them is put on its bound, the rest solved for."""
    h, g = normal.reduced(damping)
    dz = bounded_step(h, g, bounds[:, 0] - point.z, bounds[:, 1] - point.z)
    return np.clip(point.z + dz, bounds[:, 0], bounds[:, 1]), point.states + normal.state_steps(dz, damping)


def _failure_text(problem: Problem, start: Point) -> str:
    window = problem.failing_window(start.z, start.states)
    if window is None:
        return "the loss at the start is not finite"
    rec = problem.model.records[window.record]
    return (
        f"{rec.name}: the simulation with the starting values fails in the window from {rec.time[window.first]:g} to "
        f"{rec.time[window.last - 1]:g} s; start from values nearer to the arm's, or leave this span out"
    )
