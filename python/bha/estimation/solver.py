"""Nonlinear least squares by the method of Levenberg and Marquardt, for every fit of simulations to logs.

Each step solves the normal equations of a :class:`bha.estimation.problem.Problem`, initial states eliminated, within
the bounds of the parameters. How a search goes about it is a :class:`Policy`: derivatives at every step, or kept as
long as they predict what a step brings (they cost some thirty times a run); a bend along curved valleys, or none; how
much the priors weigh against a residual that is not noise.

Source: Levenberg (1944), Marquardt (1963); Nocedal and Wright 2006, chapter 10.
Validity: a local method: it needs a start in the right valley.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bha.errors import ConvergenceError
from bha.estimation.engine import Near
from bha.estimation.memories import within
from bha.estimation.problem import Normal, Point, Problem, Slopes
from bha.estimation.steps import bounded_step

Array = NDArray[np.float64]

#: A step that keeps less than this part of its promise is bent, by ever shorter corrections.
_KEPT, _SHORTER = 0.75, 0.5
#: Damping of the full step, which is tried first and taken where it keeps this part of its promise.
_LEAST_DAMPING, _TRUSTED = 1e-10, 0.5
#: Part of what kept derivatives promise that a step must bring, so that they are kept on.
_PREDICTS = 0.6


@dataclass(frozen=True)
class Policy:
    """How a search goes about it.

    Attributes:
        max_iterations: most steps.
        tolerance: converged when a full step is expected to lower the loss by less than this part of it, or by less
            than ``negligible``.
        negligible: the same, absolute: one standard error of one parameter changes the loss by one.
        crawl: converged too when so many steps together have lowered the loss by less than so much: along a curved
            valley a full step always promises more than it keeps.
        damping: relative damping of the first step.
        rise: factor on the damping, and its least value, after a step that does not lower the loss; beyond the third
            number no step is tried.
        bends: corrections by which a step is bent along a valley, at the most.
        full_first: whether the undamped step is tried first.
        limit: greatest step of a coordinate, or of each; the rest of the step is shortened with it.
        renewals: how often kept derivatives may be taken anew; None: at every step.
        renew: coordinates by which kept derivatives are taken anew at every step in any case (those that enter most
            nonlinearly).
        weigh: the problem with the weights of its priors that a point asks for; they stay if None.
        near: where the coarse step of the integrator serves for derivatives; nowhere if None.
    """

    max_iterations: int = 40
    tolerance: float = 1e-6
    negligible: float = 1e-2
    crawl: tuple[int, float] = (5, 0.2)
    damping: float = 1e-4
    rise: tuple[float, float, float] = (10.0, 1e-6, 1e8)
    bends: int = 3
    full_first: bool = True
    limit: float | Array = np.inf
    renewals: int | None = None
    renew: tuple[int, ...] = ()
    weigh: Callable[[Problem, Point], Problem] | None = None
    near: Callable[[Problem, Point], Near | None] | None = None

    def among(self, alike: float) -> Policy:
        """The same where so many numbers of the residual say the same: by as much more a gain must be to count."""
        steps, least = self.crawl
        return replace(self, negligible=alike * self.negligible, crawl=(steps, alike * least))

    def threshold(self, cost: float) -> float:
        """A gain below which nothing is left to gain."""
        return max(self.negligible, self.tolerance * cost)


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
        slopes: the derivatives of the last step, where the policy keeps them.
    """

    point: Point
    converged: bool
    message: str
    iterations: int
    history: tuple[float, ...] = field(default=())
    interrupted: bool = False
    slopes: tuple[Slopes, ...] | None = None


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in a search; it hands on how far that has come."""

    def __init__(self, outcome: Outcome) -> None:
        """``outcome``: the best point so far."""
        super().__init__("interrupted")
        self.outcome = outcome


def solve(
    problem: Problem,
    start: Point,
    policy: Policy | None = None,
    *,
    slopes: Sequence[Slopes] | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Minimise the loss from a point.

    Args:
        problem: what to minimise.
        start: where from.
        policy: how.
        slopes: derivatives to begin with, where the policy keeps them.
        progress: called with the number of steps and the loss.

    Returns:
        The best point, whether it is a minimum, and why the search ended.

    Raises:
        ConvergenceError: the simulation fails at the start.
        Interrupted: Ctrl-C after that.
    """
    policy = policy or Policy()
    first = problem.evaluated(start.z, start.states) if start.left is None else problem.costed(start)
    if not np.isfinite(first.cost):
        raise ConvergenceError(_failure_text(problem, start))
    search = _Search(problem, policy, first, None if slopes is None else tuple(slopes))
    try:
        for iteration in range(policy.max_iterations):
            if progress is not None:
                progress(iteration, search.best.cost)
            if (ended := search.step()) is not None:
                return ended
    except KeyboardInterrupt:
        raise Interrupted(replace(search.ended(False, "interrupted"), interrupted=True)) from None
    return search.exhausted()


class _Search:
    """A search on its way: the best point, the damping, and derivatives that are kept."""

    def __init__(self, problem: Problem, policy: Policy, first: Point, slopes: tuple[Slopes, ...] | None) -> None:
        """Begin at a point that has a loss."""
        self.problem, self.policy, self.best = problem, policy, first
        self._weigh()
        self._bounds = np.array([coordinate.bounds for coordinate in problem.model.coordinates]).reshape(-1, 2)
        self._history = [self.best.cost]
        self._damping = policy.damping
        # Derivatives that are kept, whether they count as those of the best point, and how often they may be renewed.
        self._slopes, self._fresh, self._left = slopes, True, policy.renewals or 0

    @property
    def _keeps(self) -> bool:
        return self.policy.renewals is not None

    @property
    def _crawls(self) -> bool:
        """Whether the last steps have gained nothing that counts."""
        steps, least = self.policy.crawl
        return len(self._history) > steps and self._history[-1 - steps] - self._history[-1] < least

    def ended(self, converged: bool, message: str) -> Outcome:
        """Where the search is."""
        steps = len(self._history) - 1
        return Outcome(self.best, converged, message, steps, tuple(self._history), slopes=self._slopes)

    def exhausted(self) -> Outcome:
        """Where the search is once it may take no more steps, with the derivatives that the next one would have."""
        with suppress(ConvergenceError):
            self._prepare()
        ended = self.ended(False, f"not converged after {self.policy.max_iterations} steps")
        return replace(ended, iterations=self.policy.max_iterations)

    def _prepare(self) -> None:
        """Take kept derivatives where there are none."""
        if self._keeps and self._slopes is None:
            self._slopes = slopes_at(self.problem, self.best, self.policy)

    def step(self) -> Outcome | None:
        """Go on; where the search ended if it does."""
        try:
            self._prepare()
            normal = self.problem.normal(self.best, self._slopes if self._keeps else None, keep=True)
        except ConvergenceError as error:
            return self.ended(False, str(error))
        if not (np.all(np.isfinite(normal.h)) and np.all(np.isfinite(normal.h_mixed))):
            return self.ended(False, "a derivative is not finite")
        gain = _expected_gain(self.problem, normal, self.best, self._bounds, self.policy)
        nothing = gain < self.policy.threshold(self.best.cost)
        found = None if nothing else self._lower(normal, gain)
        if found is not None:
            return self._accept(*found)
        if not self._fresh and self._left:
            # Derivatives of another point may be what is wrong.
            self._renew()
            self._damping = self.policy.damping
            return None
        if nothing:
            return self.ended(True, "nothing left to gain")
        done = gain < 1e-3 * self.best.cost
        return self.ended(done, "no step lowers the loss" + ("" if done else ", though one should"))

    def _lower(self, normal: Normal, gain: float) -> tuple[Point, float] | None:
        """A lower point and what its step promised; None where no step leads lower."""
        if self.policy.full_first:
            trial, promised = self._tried(normal, _LEAST_DAMPING)
            if self.best.cost - trial.cost > _TRUSTED * gain:
                return trial, promised
        factor, least, largest = self.policy.rise
        while True:
            trial, promised = self._tried(normal, self._damping)
            if trial.cost < self.best.cost:
                return trial, promised
            self._damping = max(factor * self._damping, least)
            if self._damping > largest:
                return None

    def _accept(self, trial: Point, promised: float) -> Outcome | None:
        """Take a lower point; where the search ended if kept derivatives say so."""
        gained, self.best = self.best.cost - trial.cost, trial
        self._history.append(trial.cost)
        self._damping = max(self._damping / 10.0, 1e-10)
        small = gained < self.policy.threshold(trial.cost)
        self._weigh()
        if not self._keeps:
            return self.ended(True, "nothing left to gain but along a valley") if self._crawls else None
        if small and (self._fresh or not self._left):
            return self.ended(True, "nothing left to gain")
        self._fresh = False
        if self._left and (small or gained < _PREDICTS * promised):
            self._renew()
        elif self.policy.renew:
            assert self._slopes is not None
            self._slopes = renewed(self.problem, self.best, self.policy, self._slopes)
        return None

    def _renew(self) -> None:
        self._slopes, self._fresh, self._left = None, True, self._left - 1

    def _weigh(self) -> None:
        """Give the priors the weights that the best point asks for."""
        if self.policy.weigh is not None:
            self.problem = self.policy.weigh(self.problem, self.best)
            self.best = self.problem.costed(self.best)

    def _tried(self, normal: Normal, damping: float) -> tuple[Point, float]:
        return _tried(self.problem, normal, self.best, self._bounds, self.policy, damping)


def slopes_at(problem: Problem, point: Point, policy: Policy) -> tuple[Slopes, ...]:
    """Derivatives of all windows at a point.

    Raises:
        ConvergenceError: a simulation there fails.
    """
    near = policy.near(problem, point) if policy.near is not None else None
    return tuple(own for _, own in problem.slopes(point, near=near))


def renewed(problem: Problem, point: Point, policy: Policy, slopes: Sequence[Slopes]) -> tuple[Slopes, ...]:
    """Derivatives with those by some coordinates taken anew at a point."""
    near = policy.near(problem, point) if policy.near is not None else None
    which, found = list(policy.renew), []
    for old, (_, own) in zip(slopes, problem.slopes(point, which=which, by_states=False, near=near), strict=True):
        by_z = old.by_z.copy()
        by_z[..., which] = own.by_z
        found.append(Slopes(by_z, old.by_state))
    return tuple(found)


def _tried(
    problem: Problem, normal: Normal, best: Point, bounds: Array, policy: Policy, damping: float
) -> tuple[Point, float]:
    """The point a damped step leads to and what it promised, bent along the valley where it misses that.

    In a curved valley a step along it climbs its sides. What is left there beyond what a linear model would leave is
    projected back by the same derivatives, hardly damped: the second-order term of the path (geodesic acceleration,
    Transtrum and Sethna 2012), which leads back to the bottom without another linearization.
    """
    z, states = _step(problem, normal, best, bounds, policy, damping)
    dz, moved = z - best.z, states - best.states
    promised = normal.promised(dz, moved)
    if not policy.bends:
        return problem.evaluated(z, states), promised
    g, g_state = normal.after(dz, moved)
    along = float(normal.g @ dz + np.sum(normal.g_state * moved))
    trial, there = problem.there(normal, z, states)
    lowest, size = trial, float(np.linalg.norm(dz))
    for _ in range(policy.bends):
        if there is None or best.cost - lowest.cost > _KEPT * along:
            break
        beyond = replace(there, g=there.g - g, g_state=there.g_state - g_state)
        z, states = _step(problem, beyond, trial, bounds, policy, _LEAST_DAMPING)
        bend = float(np.linalg.norm(z - trial.z))
        # A correction as long as what it corrects is none.
        if bend > _SHORTER * size:
            break
        trial, there = problem.there(normal, z, states)
        lowest, size = min(lowest, trial, key=lambda point: point.cost), bend
    return lowest, promised


def _expected_gain(problem: Problem, normal: Normal, point: Point, bounds: Array, policy: Policy) -> float:
    """How much the loss would fall with an undamped step, were the model linear."""
    z, states = _step(problem, normal, point, bounds, policy, 1e-12)
    return float(normal.g @ (z - point.z) + np.sum(normal.g_state * (states - point.states)))


def _step(
    problem: Problem, normal: Normal, point: Point, bounds: Array, policy: Policy, damping: float
) -> tuple[Array, Array]:
    """The damped step within the bounds: a parameter that would leave them is put on its bound, the rest solved for."""
    h, g = normal.reduced(damping)
    dz = bounded_step(h, g, bounds[:, 0] - point.z, bounds[:, 1] - point.z)
    states = normal.state_steps(dz, damping)
    over = float(np.max(np.abs(dz) / policy.limit, initial=0.0))
    if over > 1.0:
        dz, states = dz / over, states / over
    states = within(point.states + states, 3 * problem.model.sections)
    return np.clip(point.z + dz, bounds[:, 0], bounds[:, 1]), states


def _failure_text(problem: Problem, start: Point) -> str:
    window = problem.failing_window(start.z, start.states)
    if window is None:
        return "the loss at the start is not finite"
    rec = problem.model.records[window.record]
    return (
        f"{rec.name}: the simulation with the starting values fails in the window from {rec.time[window.first]:g} to "
        f"{rec.time[window.last - 1]:g} s; start from values nearer to the arm's, or leave this span out"
    )
