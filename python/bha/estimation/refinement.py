"""Joint refinement: all free parameters from all logs at once, by simulation from measured pressures.

A lightly damped arm makes the loss of one long simulation a range of narrow valleys: half a period of phase error
already points the wrong way. The fit therefore starts with windows shorter than a period, each with its own initial
state, and ends with longer ones (Bock's multiple shooting without its continuity constraints; a window forgets its
initial state within a few decay times). The scale of a channel's residuals is its sensor noise where the model is good
enough, and the spread of what the model leaves where it is not. That is output error; the last stage takes what it
leaves to innovations and estimates the noises with the parameters (:mod:`bha.estimation.disturbed`).
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError
from bha.estimation.conditions import Condition
from bha.estimation.disturbed import Disturbed, fit_with_noise
from bha.estimation.engine import Model
from bha.estimation.first_second import preceded
from bha.estimation.free import Coordinate, FreeParameter, resolve
from bha.estimation.integration import by, choose_integration, too_coarse
from bha.estimation.pace import Pace, Progress
from bha.estimation.pressure_noise import PAIRS, Corrected, corrected, is_noisy, uncorrected
from bha.estimation.problem import HUBER, Normal, Point, Problem, Residuals, state_deviations
from bha.estimation.records import Record, Window, some_of, windows
from bha.estimation.runs import Integration
from bha.estimation.scales import alike, fit_with_scales, scales
from bha.estimation.solver import Interrupted, Outcome
from bha.estimation.strays import is_sparse, without_strays
from bha.estimation.uncertainty import Uncertainty, uncertainty
from bha.runs.options import Method
from bha.support.shown import short_repr

Array = NDArray[np.float64]

#: The last search ends when a step gains less than this part of the loss, or less than a hundredth.
_TOLERANCE = 1e-6
#: Rows of all but the last stage are at least this far apart, and short windows last this long together, s.
_COARSE_INTERVAL, _SHORT_BUDGET = 0.01, 20.0
#: Rows over which white residuals of a log are correlated by chance, at the most.
_WHITE = 1.5
#: Windows in which noises are estimated last at least this long, s, and no longer than logs.
_NOISE_WINDOW = 30.0
#: Variance of a coordinate above which output error does not tell a parameter: one half.
_TOLD = 0.25
#: Most steps by which the shift of pressure noise is taken off.
_CORRECTIONS = 4
#: By how many times what a linear model says the loss may rise with them.
_FAITHFUL = 3.0


@dataclass(frozen=True)
class Settings:
    """How to fit.

    Attributes:
        windows: lengths of the windows of the successive stages, s; None in it is a whole log. None in its place: 0.75
            and 6 s; 6 s and whole logs where pressures have a memory of what was before a window (commands through
            pneumatics, a pressure lag): behind valves and chambers (``full``) a window begins as if they had been at
            rest, and to know a lag's past takes as long as a short window.
        huber: Huber's constant, in scales of the residuals; infinite for plain least squares.
        step: step of the integrator, s; chosen and checked if None.
        method: the integrator, ``"rk4"`` or ``"ros2"``; chosen if None (``"rk4"`` where only ``step`` is given).
        interval: rows closer together than this are thinned, s; what drives the arm keeps all its samples.
        max_iterations: most steps of the last stage (and at most 12 of the earlier ones).
        threads: threads of the simulations; all cores if None.
        state_deviation: standard deviations of initial lengths (m) and rates (m/s) of a window about what was measured
            there; as wide as :func:`bha.estimation.problem.state_deviations` if None. A model with a gap needs narrow
            ones where windows are long: initial states would make up for the gap, and a log that is predicted from its
            start has none to make up with.
        prediction_error: whether the noises are estimated with the model in a last stage, and residuals weighed by
            them; output error alone if not. None: where an arm of one section is driven by measured pressures and
            its lengths are measured; with more sections the search for sizes takes longer than the fit.
        draws: redrawn pressure noises for the standard errors; 0 leaves pressure noise out.
        seed: of the redrawn noises.
        lasting: by how much what the model leaves, beyond the noise, weighs less than an error that is another one in
            each row: the root of the number of rows for which it lasts. Priors count for more as it grows.
        pooled: whether what the model leaves weighs alike in all channels of a kind and all logs, by its root mean
            square, instead of in each by its robust spread. Where a model lacks physics in all it shows, a channel or a
            log that it happens to meet would else outweigh those that it misses.
    """

    windows: tuple[float | None, ...] | None = None
    huber: float = HUBER
    step: float | None = None
    method: Method | None = None
    interval: float = 0.0
    max_iterations: int = 40
    threads: int | None = None
    state_deviation: tuple[float, float] | None = None
    prediction_error: bool | None = None
    draws: int = 24
    seed: int = 0
    lasting: float = 1.0
    pooled: bool = False


@short_repr
@dataclass(frozen=True)
class Refinement:
    """A joint fit: the problem of its last stage, where it ended, how well that is known.

    Attributes:
        problem: model, windows, scales and priors of the last stage.
        outcome: where the search ended.
        uncertainty: covariance of the coordinates there; None where it could not be computed.
        pressure_shift: how far the coordinates were moved to take off what noise of the pressures does, shape (p,).
        seconds: how long it took.
        noises: the noises that were found with the parameters; None for a fit by output error alone.
    """

    problem: Problem
    outcome: Outcome
    uncertainty: Uncertainty | None
    pressure_shift: Array
    seconds: float
    noises: Disturbed | None = None

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
        """95 % intervals of the values, SI units, shape (p, 2); on the logarithmic scale where that is estimated.

        Within the bounds: what logs do not tell of a number without a prior would be anything else beyond them.
        """
        z = self.outcome.point.z
        if self.uncertainty is None:
            return np.full((len(z), 2), np.nan)
        reach = 1.96 * np.sqrt(np.diag(self.uncertainty.covariance))
        ends = [
            [c.value(float(end)) for end in np.clip([a - d, a + d], *c.bounds)]
            for c, a, d in zip(self.coordinates, z, reach, strict=True)
        ]
        return np.sort(np.array(ends), axis=1)

    @property
    def arm(self) -> Arm:
        """The arm at the estimate, as logs without a session see it."""
        return self.problem.model.arm(self.outcome.point.z)

    def arm_of(self, session: str) -> Arm:
        """The arm at the estimate, as logs of a session see it."""
        return self.problem.model.arm(self.outcome.point.z, Condition(session))


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
        records: what to fit, see :func:`bha.estimation.records.record`.
        free: what to estimate: paths, or free parameters with bounds and priors.
        settings: how.
        progress: called with what is being done and the fraction done of all (a guess).

    Returns:
        The fit. One that did not converge is returned too, with its best point and ``outcome.converged`` false.

    Raises:
        ParameterError: a path the arm does not have.
        InputError: something that does not fit together.
        ConvergenceError: the simulation fails with the starting values.
        KeyboardInterrupt: Ctrl-C before the first step has ended. Later it ends the search, and the fit so far is
            returned: ``outcome.interrupted``, without standard errors.
    """
    began = clock.perf_counter()
    settings = settings or Settings()
    if settings.windows is None:
        settings = replace(settings, windows=(6.0, None) if remembers(arm, records) else (0.75, 6.0))
    coordinates = resolve(arm.parameters, free)
    model = Model(arm.parameters, coordinates, tuple(records), Integration(threads=settings.threads))
    mean, deviation = (np.array(v) for v in zip(*[c.prior for c in coordinates], strict=True))
    stages = _stages(settings)
    pace = _pace(model, stages, settings, progress or (lambda _text, _fraction: None))
    reached: tuple[Problem, Outcome] | None = None
    finer: float | None = None
    searched, noises = False, None
    try:
        for number, stage in enumerate(stages):
            final = number == len(stages) - 1
            model = replace(model, records=_sound(model.records, reached))
            staged = replace(model, records=tuple(r.thinned(stage.interval) for r in model.records))
            z = np.zeros(len(coordinates)) if reached is None else reached[1].point.z
            if final and reached is not None:
                problem, states = _on_all_rows(_with_what_lasts(*reached, staged, settings), staged, reached[1].point)
            else:
                problem = _stage_problem(staged, z, (mean, deviation), stage.length, settings, stage.budget)
                states = problem.guesses
            pace.note("choosing the step of the integrator")
            integrated = _integrated(staged, z, problem, states, settings, finer)
            problem = replace(problem, model=preceded(integrated, z))
            try:
                outcome = fit_with_scales(
                    problem,
                    Point(z, states),
                    max_iterations=settings.max_iterations if final else min(12, settings.max_iterations),
                    tolerance=_TOLERANCE if final else 1e-3,
                    damping=1e-4 if number == 0 else 1e-7,
                    progress=_teller(pace, stage, number),
                )
            except Interrupted as stopped:
                reached = problem, stopped.outcome
                raise
            reached = problem.rescaled(scales(problem, outcome.point)), outcome
            if final and settings.step is None and finer is None and too_coarse(reached[0], outcome.point):
                # What was fine enough at the start need not be at the end, where frequencies are others.
                finer = 0.5
                stages.append(stage)
                pace.work.append(pace.work[-1])
        assert reached is not None
        (problem, outcome), searched = reached, True
        if (noises := _with_noises(problem, outcome, settings, pace)) is not None:
            problem, outcome = reached = noises.problem, noises.outcome
        outcome, known, moved = _known(problem, outcome, noises, settings, pace)
    except KeyboardInterrupt:
        if reached is None or not np.isfinite(reached[1].point.cost):
            raise  # there is nothing yet that was not there before
        problem, outcome = reached
        how = "interrupted before its standard errors were known" if searched else "interrupted"
        outcome = replace(outcome, converged=searched and outcome.converged, interrupted=True, message=how)
        known, moved = None, np.zeros_like(outcome.point.z)
    pace.finish()
    return Refinement(problem, outcome, known, moved, clock.perf_counter() - began, noises)


def _known(
    problem: Problem, outcome: Outcome, noises: Disturbed | None, settings: Settings, pace: Pace
) -> tuple[Outcome, Uncertainty | None, Array]:
    """The outcome without what pressure noise has moved it by, how well it is known, and how far it was moved."""
    pace.last("standard errors")
    z, known = outcome.point.z, None
    try:
        outcome, normal, better = _without_pressure_noise(problem, outcome, settings)
        known = uncertainty(
            problem, outcome.point, normal, better, noises=noises, seed=settings.seed, draws=settings.draws
        )
    except (ConvergenceError, np.linalg.LinAlgError) as error:
        pace.note(f"standard errors: {error}")
    return outcome, known, outcome.point.z - z


def _pace(model: Model, stages: Sequence[_Stage], settings: Settings, tell: Progress) -> Pace:
    """The work of a step of each stage, in simulated seconds, and what follows the last one."""
    sets = 1 + len(model.coordinates) + 6 * len(model.parameters.sections)
    seconds = sum(rec.duration for rec in model.records)
    work = [sets * (seconds if stage.budget is None else min(seconds, stage.budget)) for stage in stages]
    noisy = settings.draws > 0 and any(rec.has_unsure_pressures for rec in model.records)
    return Pace(tell, work, 1.0 + (2.0 * PAIRS + settings.draws / sets if noisy else 0.0))


def _teller(pace: Pace, stage: _Stage, number: int) -> Callable[[int, float], None]:
    label = "whole logs" if stage.length is None else f"windows of {stage.length:g} s"
    return lambda iteration, cost: pace.step(f"{label}, step {iteration + 1}, loss {cost:.4g}", number, iteration)


def _with_noises(problem: Problem, outcome: Outcome, settings: Settings, pace: Pace) -> Disturbed | None:
    """The last stage, in windows as long as what is slow; None where it is not wanted, or its simulations fail."""
    # It begins near a minimum.
    if not (_wants_noises(problem.model, settings) and outcome.converged):
        return None
    assert settings.windows is not None
    pace.last("noises")
    length = None if settings.windows[-1] is None else max(settings.windows[-1], _NOISE_WINDOW)
    point = outcome.point
    try:
        long = _stage_problem(problem.model, point.z, problem.prior, length, settings)
        start = Point(point.z, long.guesses)
        if not np.isfinite(long.evaluated(start.z, start.states).cost):
            # An arm near the edge of stability is followed in short windows only.
            long, start = problem, point
        found = fit_with_noise(long, start, max_iterations=settings.max_iterations, tolerance=_TOLERANCE)
        return found if _tells(problem, outcome, found, settings) else None
    except (ConvergenceError, np.linalg.LinAlgError):
        return None


def _tells(problem: Problem, outcome: Outcome, found: Disturbed, settings: Settings) -> bool:
    """Whether output error tells every parameter, under as much noise of the logged pressures as there may be.

    Where that noise passes for excitation, innovations take it for knowledge. What differences of readings say of it
    would not do for sparse logs: at 10 Hz they take motion for noise, of the input that moves least the least.
    """
    most = found.most_logged()
    records = tuple(
        rec.with_pressure_noise(most * np.minimum(rec.pressure_noise, _least(rec))) for rec in problem.model.records
    )
    problem = replace(problem, model=replace(problem.model, records=records))
    if not (settings.draws and is_noisy(problem)):
        return True
    known = _without_pressure_noise(problem, outcome, settings)[2].information
    values, vectors = np.linalg.eigh(0.5 * (known + known.T))
    return bool(np.all(np.sum(vectors**2 / np.maximum(values, 1e-12 * values[-1]), axis=1) <= _TOLD))


def _least(rec: Record) -> float:
    """Least noise of a logged pressure that has some, Pa: the inputs of an arm have sensors of one sort."""
    noisy = rec.pressure_noise[rec.pressure_noise > 0.0]
    return float(np.min(noisy)) if len(noisy) else 0.0


def _wants_noises(model: Model, settings: Settings) -> bool:
    """Whether the noises are to be estimated with the model."""
    wanted = settings.prediction_error
    return _is_for_noises(model) if wanted is None else wanted


def _is_for_noises(model: Model) -> bool:
    """Whether noises are estimated by default: what intervals were tested on, in time that is short beside the fit."""
    measured = all(
        not rec.drive.commanded and all(output.kind == "length" for output in rec.observation.outputs)
        for rec in model.records
    )
    return measured and len(model.parameters.sections) == 1


def _without_pressure_noise(
    problem: Problem, outcome: Outcome, settings: Settings
) -> tuple[Outcome, Normal, Corrected]:
    """The outcome with what pressure noise has moved it by taken off, normal equations and information there."""
    normal = problem.normal(outcome.point, keep=True)
    if not settings.draws or not is_noisy(problem):
        return outcome, normal, uncorrected(problem, normal)
    bounds = np.array([c.bounds for c in problem.model.coordinates]).T
    better = corrected(problem, outcome.point, normal, seed=settings.seed)
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
        better = corrected(problem, moved, normal, seed=settings.seed)
    # Off the minimum the loss rises by what the shift says, or steps have led to where their derivatives do not hold.
    shift = outcome.point.z - before.z
    said = max(float(shift @ first[1].reduced()[0] @ shift), float(len(shift)))
    if outcome.point.cost - before.cost > _FAITHFUL * said:
        return first
    return outcome, normal, better


def _integrated(
    model: Model, z: Array, problem: Problem, states: Array, settings: Settings, finer: float | None
) -> Model:
    """The model with the integrator that the settings ask for, or the one that is accurate enough."""
    if settings.step is not None:
        return by(model, method=settings.method or "rk4", step=settings.step)
    chosen = choose_integration(model, z, problem.windows, states, methods=settings.method)
    return by(chosen, step=chosen.integration.step * (finer or 1.0))


def remembers(arm: Arm, records: Sequence[Record]) -> bool:
    """Whether pressures that act depend on commands of long before."""
    commanded = any(rec.drive.commanded for rec in records)
    lags = any(effect.kind == "pressure_lag" for effect in arm.parameters.effects)
    return lags or (commanded and arm.pneumatics_level != "ideal")


@dataclass(frozen=True)
class _Stage:
    """Length of the windows, s (None: whole logs), interval of the rows, s, and most of all windows together, s."""

    length: float | None
    interval: float
    budget: float | None


def _stages(settings: Settings) -> list[_Stage]:
    """Coarse and on a part first, on everything last."""
    assert settings.windows is not None
    short = (_SHORT_BUDGET if length is not None and length <= 2.0 else None for length in settings.windows)
    coarse = max(_COARSE_INTERVAL, settings.interval)
    stages = [_Stage(length, coarse, budget) for length, budget in zip(settings.windows, short, strict=True)]
    return [*stages, _Stage(settings.windows[-1], settings.interval, None)]


def _on_all_rows(problem: Problem, model: Model, point: Point) -> tuple[Problem, Array]:
    """The same windows with all rows of their records, and their initial states as they are."""
    thin = problem.model.records
    pieces = []
    for w in problem.windows:
        full = model.records[w.record].time
        edges = thin[w.record].time[[w.first, w.last - 1]]
        first, last = np.searchsorted(full, edges)
        pieces.append(Window(w.record, int(first), int(last) + 1))
    # The last rows of a record may lie behind its last thinned row.
    for k, w in enumerate(pieces):
        end = len(model.records[w.record]) if k + 1 == len(pieces) or pieces[k + 1].record != w.record else None
        pieces[k] = replace(w, last=end or pieces[k + 1].first)
    return replace(problem, model=model, windows=tuple(pieces)), point.states


def _sound(records: Sequence[Record], reached: tuple[Problem, Outcome] | None) -> tuple[Record, ...]:
    """The records without stray readings, by where a search has ended; those as they are that it saw thinned."""
    if reached is None or not any(is_sparse(rec) for rec in records):
        return tuple(records)
    problem, outcome = reached
    seen = problem.model.records
    shown = problem.model.predict(outcome.point.z, problem.windows, outcome.point.states)
    sound = without_strays(seen, problem.by_record(shown))
    return tuple(new if len(new) == len(rec) else rec for rec, new in zip(records, sound, strict=True))


def _with_what_lasts(problem: Problem, outcome: Outcome, staged: Model, settings: Settings) -> Problem:
    """The problem with what its model leaves weighing by how long it lasts, in rows of the last stage.

    An error that is alike in many rows is one number, and priors are to count beside it as beside one. Where settings
    say how long it lasts that stays; innovations, which come after, know it themselves.
    """
    if problem.residuals.lasting > 1.0 or _wants_noises(problem.model, settings):
        return problem
    rows = alike(problem, problem.evaluated(outcome.point.z, outcome.point.states))
    more = sum(map(len, staged.records)) / sum(map(len, problem.model.records))
    lasting = max(1.0, rows * more) ** 0.5 if rows > _WHITE else 1.0
    return problem.rescaled(replace(problem.residuals, lasting=lasting))


def _stage_problem(
    model: Model,
    z: Array,
    prior: tuple[Array, Array],
    length: float | None,
    settings: Settings,
    budget: float | None = None,
) -> Problem:
    pieces = windows(model.records, length)
    if budget is not None:
        pieces = some_of(pieces, model.records, budget)
    noises = tuple(rec.noise for rec in model.records)
    residuals = Residuals(noises, settings.huber, lasting=settings.lasting, pooled=settings.pooled)
    guesses = model.guesses(z, pieces)
    deviations = settings.state_deviation or state_deviations(model.records)
    return Problem(model, tuple(pieces), residuals, guesses, prior, deviations)
