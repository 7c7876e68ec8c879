"""Joint refinement by output error: all free parameters from all logs at once, by simulation from measured pressures.

A lightly damped arm makes the loss of one long simulation a range of narrow valleys: half a period of phase error
already points the wrong way. The fit therefore starts with windows shorter than a period, each with its own initial
state, and ends with longer ones (Bock's multiple shooting without its continuity constraints; a window forgets its
initial state within a few decay times). The scale of a channel's residuals is its sensor noise where the model is good
enough, and the spread of what the model leaves where it is not.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError
from bha.identify.engine import STEPS, Model
from bha.identify.free import Coordinate, FreeParameter, resolve
from bha.identify.initial import guess_state
from bha.identify.records import Record, Window, windows
from bha.identify.solver import HUBER, Outcome, Point, Problem, Residuals, solve
from bha.identify.uncertainty import Uncertainty, uncertainty

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

_MEDIAN_NORMAL = 0.6745


@dataclass(frozen=True)
class Settings:
    """How to fit.

    Attributes:
        windows: lengths of the windows of the successive stages, s; None is a whole log.
        huber: Huber's constant, in scales of the residuals; infinite for plain least squares.
        step: step of the integrator, s; chosen and checked if None.
        max_iterations: most steps of the last stage.
        threads: threads of the simulations; all cores if None.
        draws: redrawn pressure noises for the standard errors; 0 leaves pressure noise out.
        seed: of the redrawn noises.
    """

    windows: tuple[float | None, ...] = (0.75, 6.0)
    huber: float = HUBER
    step: float | None = None
    max_iterations: int = 40
    threads: int | None = None
    draws: int = 24
    seed: int = 0


@dataclass(frozen=True)
class Refinement:
    """A joint fit: the problem of its last stage, where it ended, how well that is known.

    Attributes:
        problem: model, windows, scales and priors of the last stage.
        outcome: where the search ended.
        uncertainty: covariance of the coordinates there; None where it could not be computed.
        seconds: how long it took.
    """

    problem: Problem
    outcome: Outcome
    uncertainty: Uncertainty | None
    seconds: float

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """The free parameters."""
        return self.problem.model.coordinates

    @property
    def values(self) -> Array:
        """Estimated values in SI units, shape (p,)."""
        return np.array([c.value(z) for c, z in zip(self.coordinates, self.outcome.point.z, strict=True)])

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the values, SI units, shape (p,); NaN where not known."""
        if self.uncertainty is None:
            return np.full(len(self.coordinates), np.nan)
        slopes = [c.slope(z) for c, z in zip(self.coordinates, self.outcome.point.z, strict=True)]
        return np.asarray(np.sqrt(np.diag(self.uncertainty.covariance)) * np.abs(slopes))

    @property
    def intervals(self) -> Array:
        """95 % intervals of the values, SI units, shape (p, 2); on the logarithmic scale where that is estimated."""
        z = self.outcome.point.z
        if self.uncertainty is None:
            return np.full((len(z), 2), np.nan)
        reach = 1.96 * np.sqrt(np.diag(self.uncertainty.covariance))
        ends = [[c.value(a - d), c.value(a + d)] for c, a, d in zip(self.coordinates, z, reach, strict=True)]
        return np.sort(np.array(ends), axis=1)

    @property
    def arm(self) -> Arm:
        """The arm at the estimate, as logs without a session see it."""
        return self.problem.model.arm(self.outcome.point.z)

    def arm_of(self, session: str) -> Arm:
        """The arm at the estimate, as logs of a session see it."""
        return self.problem.model.arm(self.outcome.point.z, session)


def refine(
    arm: Arm,
    records: Sequence[Record],
    free: Iterable[FreeParameter | str],
    settings: Settings | None = None,
    *,
    progress: Progress | None = None,
) -> Refinement:
    """Estimate parameters from records by simulation.

    Args:
        arm: where to start from.
        records: what to fit, see :func:`bha.identify.record`.
        free: what to estimate: paths, or free parameters with bounds and priors.
        settings: how.
        progress: called with what is being done and the fraction done of all (a guess).

    Returns:
        The fit. One that did not converge is returned too, with its best point and ``outcome.converged`` false.

    Raises:
        ParameterError: a path the arm does not have.
        InputError: something that does not fit together.
        ConvergenceError: the simulation fails with the starting values.
    """
    began = clock.perf_counter()
    settings = settings or Settings()
    coordinates = resolve(arm.parameters, free)
    model = Model(arm.parameters, coordinates, tuple(records), threads=settings.threads)
    z = np.zeros(len(coordinates))
    mean, deviation = (np.array(v) for v in zip(*[c.prior for c in coordinates], strict=True))
    tell = progress or (lambda _text, _fraction: None)
    problem: Problem | None = None
    outcome: Outcome | None = None
    stages = len(settings.windows)
    for stage, length in enumerate(settings.windows):
        pieces = tuple(windows(records, length))
        guesses = guess_states(model, z, pieces)
        if stage == 0 or settings.step is None:
            tell("choosing the step of the integrator", stage / (stages + 1))
            model = replace(model, step=settings.step or choose_step(model, z, pieces, guesses))
        final = stage == stages - 1
        label = f"windows of {length:g} s" if length is not None else "whole logs"

        def report(iteration: int, cost: float, stage: int = stage, label: str = label) -> None:
            done = (stage + 1.0 - 0.75**iteration) / (stages + 1)
            tell(f"{label}, step {iteration + 1}, loss {cost:.4g}", done)

        residuals = Residuals(tuple(rec.noise for rec in records), settings.huber)
        problem = Problem(model, pieces, residuals, guesses, (mean, deviation))
        point = Point(z, guesses)
        outcome = fit_with_scales(
            problem, point, max_iterations=settings.max_iterations if final else 15, final=final, progress=report
        )
        problem = problem.rescaled(scales(problem, outcome.point, records))
        z = outcome.point.z
    assert problem is not None
    assert outcome is not None
    tell("standard errors", stages / (stages + 1))
    try:
        normal = problem.normal(outcome.point)
        known = uncertainty(problem, outcome.point, normal, seed=settings.seed, draws=settings.draws)
    except (ConvergenceError, np.linalg.LinAlgError):
        known = None
    tell("done", 1.0)
    return Refinement(problem, outcome, known, clock.perf_counter() - began)


def guess_states(model: Model, z: Array, pieces: Sequence[Window]) -> Array:
    """Initial states of windows guessed from the measurements around their start, shape (windows, 6n)."""
    arms = {rec.session: model.arm(z, rec.session) for rec in model.records}
    return np.stack([guess_state(arms[model.records[w.record].session], model.records[w.record], w.first) for w in pieces])


def scales(problem: Problem, point: Point, records: Sequence[Record]) -> Residuals:
    """Scale of each channel: its sensor noise, or the robust spread of its residuals where that is larger."""
    spread = [[np.zeros(0)] * len(rec.channels) for rec in records]
    for window, predicted in zip(problem.windows, problem.model.predict(point.z, problem.windows, point.states), strict=True):
        rec = records[window.record]
        rows = slice(window.first, window.last)
        error = rec.measured[rows] - predicted
        for c in range(len(rec.channels)):
            good = rec.usable[rows, c]
            spread[window.record][c] = np.concatenate([spread[window.record][c], error[good, c]])
    found = []
    for rec, columns in zip(records, spread, strict=True):
        left = np.array([np.median(np.abs(c)) / _MEDIAN_NORMAL if len(c) else 0.0 for c in columns])
        found.append(np.where(left > 1.05 * rec.noise, left, rec.noise))
    return replace(problem.residuals, scale=tuple(found))


def fit_with_scales(
    problem: Problem,
    point: Point,
    *,
    max_iterations: int,
    final: bool,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Minimise while the channels' scales shrink to what the model leaves; the last search keeps them."""
    total = 0
    outcome = Outcome(point, False, "not started", 0)
    records = problem.model.records
    for _ in range(8):
        before = problem.residuals.scale
        problem = problem.rescaled(scales(problem, outcome.point, records))
        change = max(float(np.max(np.abs(np.log(a / b)))) for a, b in zip(problem.residuals.scale, before, strict=True))
        if total and change < 0.03:
            break
        outcome = solve(
            problem,
            outcome.point,
            max_iterations=min(6, max_iterations - total),
            tolerance=1e-2,
            progress=_shifted(progress, total),
        )
        total += max(1, outcome.iterations)
        if total >= max_iterations:
            break
    if not final:
        return outcome
    outcome = solve(
        problem, outcome.point, max_iterations=max(5, max_iterations - total), progress=_shifted(progress, total)
    )
    return replace(outcome, iterations=outcome.iterations + total)


def _shifted(progress: Callable[[int, float], None] | None, by: int) -> Callable[[int, float], None] | None:
    return None if progress is None else lambda iteration, cost: progress(iteration + by, cost)


def choose_step(model: Model, z: Array, pieces: Sequence[Window], states: Array, *, share: float = 0.1) -> float:
    """The longest step of the integrator whose error stays below ``share`` of every channel's noise.

    The error is the change when the step is halved, root mean square over a few windows.

    Raises:
        ConvergenceError: no step is fine enough.
    """
    chosen = np.unique(np.linspace(0, len(pieces) - 1, min(4, len(pieces))).astype(int))
    some, their = [pieces[k] for k in chosen], states[chosen]
    intervals = [np.median(np.diff(model.records[w.record].time[w.first : w.last])) for w in some]
    coarse: list[Array] | None = None
    for step in (s for s in (*STEPS, STEPS[-1] / 2) if s <= 2.0 * max(intervals)):
        fine = replace(model, step=step).predict(z, some, their)
        if coarse is not None and _step_error(model, some, coarse, fine) < share:
            return 2.0 * step
        coarse = fine
    if coarse is not None and not all(np.all(np.isfinite(c)) for c in coarse):
        window = some[next(k for k, c in enumerate(coarse) if not np.all(np.isfinite(c)))]
        rec = model.records[window.record]
        raise ConvergenceError(
            f"{rec.name}: the simulation with the starting values fails between {rec.time[window.first]:g} and "
            f"{rec.time[window.last - 1]:g} s with every step tried; start from values nearer to the arm's"
        )
    return STEPS[-1] / 2


def _step_error(model: Model, some: Sequence[Window], coarse: list[Array], fine: list[Array]) -> float:
    worst = 0.0
    for window, a, b in zip(some, coarse, fine, strict=True):
        error = np.sqrt(np.mean((a - b) ** 2, axis=0)) / model.records[window.record].noise
        worst = max(worst, float(np.max(error)) if np.all(np.isfinite(error)) else np.inf)
    return worst
