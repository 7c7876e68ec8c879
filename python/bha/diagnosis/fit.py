"""Fits of a diagnosis: plain parameters, effects and the initial state of every log together, from whole logs.

What: the problems that a search solves by the hundred, over the same logs and their whitening in bands of frequency,
each with another set of effects; how it goes about them, and how much its priors weigh. The estimation itself is that
of :mod:`bha.estimation.problem` and :mod:`bha.estimation.solver`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Event

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.cache import Cache
from bha.diagnosis.model import IMPLAUSIBLE
from bha.errors import ConvergenceError
from bha.estimation.bands import NoiseModel, Whitener
from bha.estimation.engine import Model, Near
from bha.estimation.integration import COARSE_ERROR_SHARE, COARSE_MISFIT_SHARE, allowed, noise_of
from bha.estimation.problem import Point, Residuals, Slopes, flat, projected
from bha.estimation.problem import Problem as EstimationProblem
from bha.estimation.records import Record, Window
from bha.estimation.solver import Policy, slopes_at, solve
from bha.parameters import paths

Array = NDArray[np.float64]

#: Plausible errors of an initial length, m, and rate, m/s, as measured.
STATE_DEVIATION = (0.01, 0.1)
#: Time over which a residual that is not noise errs alike, about, s: what physics leaves follows the arm's motion.
MEMORY = 1.0 / 3.0
#: Greatest step from a start that is far, in plausible distances.
FAR_STEP = 3.0
#: Numbers that were measured by hand and that an arc and a camera exchange.
MEASURED = frozenset({"rest_length", "camera_position"})
#: A step that gains less than this is none.
NEGLIGIBLE = 0.5


@dataclass(frozen=True)
class Problem(EstimationProblem):
    """Logs as every fit of a search sees them: a problem whose model each fit exchanges for its own.

    Attributes:
        cache: keeps finished fits.
        restarts: plain coordinates from which every fit of a larger or smaller model starts as well, where the cost has
            several valleys (stiff arms, see :mod:`bha.diagnosis.baseline`).
        stop: where it is set, fits on other threads end as after Ctrl-C, which reaches the first thread alone.
    """

    cache: Cache = field(default_factory=lambda: Cache(None, ""))
    restarts: tuple[Array, ...] = ()
    stop: Event = field(default_factory=Event, compare=False)

    @property
    def records(self) -> tuple[Record, ...]:
        """The logs."""
        return self.model.records

    @property
    def whiteners(self) -> tuple[Whitener, ...]:
        """The whitening of each window."""
        found = [self.residuals.whitening[window] for window in self.windows]
        return tuple(w for w in found if isinstance(w, Whitener))

    @property
    def rows(self) -> int:
        """Number of white numbers in all."""
        return sum(part.stop - part.start for part in self.slices())

    @property
    def rate(self) -> float:
        """White rows a second."""
        return sum(w.kept for w in self.whiteners) / sum(float(np.ptp(w.time)) for w in self.whiteners)

    def misfit(self, fit: Fit) -> float:
        """Error of a fit over that of a right model."""
        return float(np.sqrt(fit.squares / self.rows))

    def of(self, model: Model) -> Problem:
        """The problem of a model of the search."""
        mean, deviation = np.array([c.prior for c in model.coordinates]).reshape(-1, 2).T
        return replace(self, model=model.on(self.records), prior=(mean, deviation))

    def simulate(self, model: Model, x: Array, states: Sequence[Array]) -> list[Array]:
        """Outputs of every window."""
        return model.on(self.records).predict(x, self.windows, np.stack(states))

    def residual(self, outputs: Sequence[Array]) -> Array:
        """White residual of all windows, measured less simulated, one vector; NaN if a run diverged."""
        pairs = zip(self.windows, outputs, strict=True)
        return np.concatenate([self.residuals.scaled(self.model, window, y)[0].ravel() for window, y in pairs])

    def white(self, changes: Sequence[Array]) -> Array:
        """White rows of a change of the outputs of all windows, one vector."""
        found = []
        for window, y in zip(self.windows, changes, strict=True):
            mask = self.records[window.record].usable[window.first : window.last]
            found.append(self.residuals.white(window, y, mask).ravel())
        return np.concatenate(found)

    def slices(self) -> list[slice]:
        """Where each window's numbers are in the vector."""
        found, at = [], 0
        for whitener, window in zip(self.whiteners, self.windows, strict=True):
            size = whitener.kept * len(self.records[window.record].channels)
            found.append(slice(at, at + size))
            at += size
        return found

    def split(self, table: Array) -> list[Array]:
        """White numbers of all windows, shape (rows, ...), window by window, each (kept, channels, ...)."""
        shapes = [(w.kept, -1, *table.shape[1:]) for w in self.whiteners]
        return [table[part].reshape(shape) for part, shape in zip(self.slices(), shapes, strict=True)]


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        model: plain arm and effects.
        x: coordinates.
        states: initial state of each window.
        outputs: simulated outputs of each window.
        residual: white residual.
        cost: sum of squares of the residual plus the prior's.
        jacobian: white outputs by coordinates, shape (rows, size), or None.
        state_jacobians: white outputs of each window by its initial state, m and m/s.
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


def problem_of(
    model: Model,
    windows: Sequence[Window],
    noise: NoiseModel,
    states: Array,
    *,
    cache: Cache | None = None,
) -> Problem:
    """The problem of windows of a model's records, white by a noise model, with first guesses of initial states."""
    parts = [model.records[w.record].kept(slice(w.first, w.last)) for w in windows]
    whitening = {window: Whitener(part, noise) for window, part in zip(windows, parts, strict=True)}
    residuals = Residuals(tuple(rec.noise for rec in model.records), np.inf, whitening)
    nothing = (np.zeros(0), np.ones(0))
    problem = Problem(model, tuple(windows), residuals, states, nothing, STATE_DEVIATION)
    return (problem if cache is None else replace(problem, cache=cache)).of(model)


def whole_logs(model: Model, noise: NoiseModel, states: Sequence[Array], cache: Cache | None = None) -> Problem:
    """The problem of a model's records from their starts to their ends, see :func:`problem_of`."""
    windows = [Window(k, 0, len(rec)) for k, rec in enumerate(model.records)]
    return problem_of(model, windows, noise, np.stack(states), cache=cache)


def prior_cost(model: Model, x: Array) -> float:
    """Squares of the coordinates that have a prior."""
    weights = np.array([c.prior_weight for c in model.coordinates])
    return float(weights @ x**2) if len(x) else 0.0


def prior_precision(fit: Fit, trust: float | None = None) -> Array:
    """Weight of the prior of each coordinate against the squares of a residual, shape (size,).

    ``trust`` is that of all priors, as :attr:`Fit.trust`; the fit's own if None.
    """
    return (fit.trust if trust is None else trust) * np.array([c.prior_weight for c in fit.model.coordinates])


def prior_weight(mean_square: float, rate: float) -> float:
    """Weight of the prior: one under a right model, and as much more as the residual exceeds the noise.

    ``rate`` is that of the white rows, 1/s: so many of them err together as come within ``MEMORY``.
    A residual that is not noise but physics is no evidence about the plain parameters to the precision of the noise:
    neighbouring samples err together. Without this a strong effect drives them to absurd values, and the absurd values
    hide the effect.
    """
    return 1.0 + max(1.0, MEMORY * rate) * max(0.0, mean_square - 1.05)


def evaluate(problem: Problem, model: Model, x: Array, states: Sequence[Array], trust: float = 1.0) -> Fit:
    """The model at ``x`` without sensitivities; infinite cost if a run diverged."""
    model = model.on(problem.records)
    outputs = problem.simulate(model, x, states)
    residual = problem.residual(outputs)
    cost = float(residual @ residual) + trust * prior_cost(model, x) if np.all(np.isfinite(residual)) else np.inf
    return Fit(model, x, tuple(states), tuple(outputs), residual, cost, trust=trust)


def weighted(problem: Problem, fit: Fit) -> Fit:
    """The fit with the weight of the prior that its residual asks for."""
    trust = prior_weight(fit.squares / problem.rows, problem.rate)
    return replace(fit, trust=trust, cost=fit.squares + trust * fit.prior)


def near(problem: EstimationProblem, point: Point) -> Near | None:
    """Where the coarse step serves for sensitivities: where it makes of the fit itself what the fine one does.

    Beyond its limit stiction chatters, and differences of chatter are no sensitivities.
    """
    if point.outputs is None or point.left is None:
        return None
    misfit = float(np.sqrt(np.mean(np.concatenate([left.ravel() for left in point.left]) ** 2)))
    share = allowed(COARSE_ERROR_SHARE, COARSE_MISFIT_SHARE, misfit)
    return Near(point.outputs, share * noise_of(problem.model.records))


def columns(problem: Problem, fit: Fit, which: Sequence[int]) -> Array:
    """White sensitivities by the coordinates ``which``, shape (rows, len(which)), by forward differences."""
    own, point = problem.of(fit.model), point_of(problem, fit)
    found = [s.by_z for _, s in own.slopes(point, which=which, by_states=False, near=near(own, point))]
    return np.concatenate([flat(table) for table in found])


def state_columns(problem: Problem, fit: Fit) -> tuple[Array, ...]:
    """White sensitivities of each window by its own initial state, by lengths, 1/m, and rates, s/m."""
    own, point = problem.of(fit.model), point_of(problem, fit)
    found = [s.by_state for _, s in own.slopes(point, which=(), near=near(own, point))]
    return tuple(flat(table) for table in found)


def sensitivities(
    problem: Problem, fit: Fit, states: Sequence[Array], which: Sequence[int] | None = None
) -> tuple[Array, ...]:
    """How what a model shows of each log changes with its coordinates ``which`` (all if None), (rows, C, K), not white.

    Raises:
        ConvergenceError: a simulation of the model fails.
    """
    model = fit.model.on(problem.records)
    shown = model.linearize(fit.x, problem.windows, np.stack(states), which=which, by_states=False)
    return tuple(by_x for _, by_x, _ in shown)


def with_sensitivities(problem: Problem, fit: Fit) -> Fit:
    """The fit with all its sensitivities."""
    own = problem.of(fit.model)
    return _with_slopes(fit, slopes_at(own, point_of(problem, fit), Policy(near=near)))


def project_states(problem: Problem, state_jacobians: Sequence[Array], table: Array) -> Array:
    """``table`` (rows, k) on the complement of what initial states can do, prior of the states included."""
    return projected(problem.slices(), state_jacobians, table, problem.state_precision)


def improve(
    problem: Problem,
    fit: Fit,
    *,
    iterations: int = 8,
    tolerance: float = 1e-3,
    renew: Sequence[int] | None = None,
    limit: float | Array = 1.0,
    renewals: int = 3,
) -> Fit:
    """Fit from ``fit`` on.

    Sensitivities are kept from step to step as long as they predict what a step brings, and renewed when they do not.

    Args:
        problem: the logs.
        fit: where to start, with its sensitivities where it has them.
        iterations: most steps.
        tolerance: stop when a step lowers the cost by less than this share, or by less than ``NEGLIGIBLE``.
        renew: coordinates whose sensitivities are renewed in every step in any case (those that enter most
            nonlinearly).
        limit: greatest step of a coordinate, or of each.
        renewals: how often all sensitivities may be renewed.

    Raises:
        ConvergenceError: the start itself diverges.
    """
    if not np.isfinite(fit.cost):
        raise ConvergenceError("the simulation diverges at the start of the fit; is the arm's file that of the logs?")
    policy = Policy(
        max_iterations=iterations,
        tolerance=tolerance,
        negligible=NEGLIGIBLE,
        rise=(30.0, 1e-2, 1e6),
        limit=limit,
        renewals=renewals,
        renew=tuple(renew or ()),
        weigh=partial(_weighed, problem.rate, problem.stop),
        near=near,
    )
    slopes = None
    if fit.jacobian is not None and fit.state_jacobians is not None:
        tables = zip(problem.split(fit.jacobian), fit.state_jacobians, strict=True)
        slopes = [Slopes(by_z, own.reshape(*by_z.shape[:2], -1)) for by_z, own in tables]
    outcome = solve(problem.of(fit.model), point_of(problem, fit), policy, slopes=slopes)
    point = outcome.point
    assert point.outputs is not None
    residual = problem.residual(point.outputs)
    ended = Fit(fit.model, point.z, tuple(point.states), point.outputs, residual, point.cost)
    return weighted(problem, ended if outcome.slopes is None else _with_slopes(ended, outcome.slopes))


def restarted(problem: Problem, fit: Fit) -> Fit:
    """``fit``, or if that ends lower the fit of the same model from a restart of the problem, all effects anew."""
    effects = [v for effect in fit.model.effects for v in effect.begin]
    for plain in problem.restarts:
        start = evaluate(problem, fit.model, np.concatenate([plain, effects]), fit.states, fit.trust)
        if np.isfinite(start.cost):
            other = improve(problem, start, iterations=20, tolerance=2e-3, renewals=7)
            fit = min(fit, other, key=lambda f: f.cost)
    return fit


def lowest(
    problem: Problem, fit: Fit, starts: Iterable[Array], *, iterations: int, tolerance: float, renewals: int
) -> Fit:
    """``fit``, or the lowest of the fits of the same model from other coordinates that ends lower.

    Starts may be far: their steps go up to ``FAR_STEP``, and those that diverge are left out.
    """
    best = fit
    for x in starts:
        start = evaluate(problem, fit.model, x, fit.states)
        if np.isfinite(start.cost):
            with suppress(ConvergenceError):
                found = improve(
                    problem, start, iterations=iterations, tolerance=tolerance, renewals=renewals, limit=FAR_STEP
                )
                best = min(best, found, key=lambda own: own.cost)
    return best


def as_measured(problem: Problem, fit: Fit) -> Fit:
    """The fit, or where it ends lower one from the geometry of the file, where that has been left far behind.

    An arc that is shorter and seen by a camera farther off makes up for much that a model lacks, and for nothing once
    it has that.
    """
    own = [k for k, c in enumerate(fit.model.plain) if paths.key_of(c.path) in MEASURED]
    if not own or np.max(np.abs(fit.x[own])) < IMPLAUSIBLE:
        return fit
    x = fit.x.copy()
    x[own] = 0.0
    best = lowest(problem, fit, [x], iterations=15, tolerance=1e-3, renewals=5)
    return fit if best is fit else with_sensitivities(problem, best)


def point_of(problem: Problem, fit: Fit) -> Point:
    """A fit as a point of a search."""
    return Point(fit.x, np.stack(fit.states), fit.cost, fit.outputs, tuple(problem.split(fit.residual)))


def _weighed(rate: float, stop: Event, problem: EstimationProblem, point: Point) -> EstimationProblem:
    """The problem with the weight of its priors that a residual asks for, states free about where they are."""
    if stop.is_set():
        raise KeyboardInterrupt
    assert point.left is not None
    squares, rows = sum(float(np.sum(left**2)) for left in point.left), sum(left.size for left in point.left)
    return replace(
        problem,
        prior_weight=prior_weight(squares / rows, rate),
        state_weight=max(1.0, squares / rows),
        guesses=point.states,
    )


def _with_slopes(fit: Fit, slopes: Sequence[Slopes]) -> Fit:
    """The fit with these sensitivities."""
    jacobian = np.concatenate([flat(own.by_z) for own in slopes])
    return replace(fit, jacobian=jacobian, state_jacobians=tuple(flat(own.by_state) for own in slopes))
