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
from bha.estimation.disturbed import Disturbed
from bha.estimation.divided import otherwise_divided
from bha.estimation.engine import Model
from bha.estimation.first_second import preceded
from bha.estimation.free import Coordinate, FreeParameter, resolve
from bha.estimation.integration import by, choose_integration, too_coarse
from bha.estimation.noise_stage import with_noises
from bha.estimation.pace import Pace, Progress
from bha.estimation.pressure_noise import PAIRS, without_pressure_noise
from bha.estimation.problem import Point, Problem
from bha.estimation.records import Record
from bha.estimation.runs import Integration
from bha.estimation.scales import fit_with_scales, scales
from bha.estimation.settings import Settings
from bha.estimation.solver import Interrupted, Outcome
from bha.estimation.stages import TOLERANCE, Stage, on_all_rows, sound, stage_problem, stages_of, with_what_lasts
from bha.estimation.uncertainty import Uncertainty, uncertainty
from bha.support.shown import short_repr

Array = NDArray[np.float64]


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
    stages = stages_of(settings)
    pace = _pace(model, stages, settings, progress or (lambda _text, _fraction: None))
    reached: tuple[Problem, Outcome] | None = None
    finer: float | None = None
    searched, noises = False, None
    try:
        for number, stage in enumerate(stages):
            final = number == len(stages) - 1
            model = replace(model, records=sound(model.records, reached))
            staged = replace(model, records=tuple(r.thinned(stage.interval) for r in model.records))
            z = np.zeros(len(coordinates)) if reached is None else reached[1].point.z
            if final and reached is not None:
                problem, states = on_all_rows(with_what_lasts(*reached, staged, settings), staged, reached[1].point)
            else:
                problem = stage_problem(staged, z, (mean, deviation), stage.length, settings, stage.budget)
                states = problem.guesses
            pace.note("choosing the step of the integrator")
            integrated = _integrated(staged, z, problem, states, settings, finer)
            problem = replace(problem, model=preceded(integrated, z))
            try:
                outcome = fit_with_scales(
                    problem,
                    Point(z, states),
                    max_iterations=settings.max_iterations if final else min(12, settings.max_iterations),
                    tolerance=TOLERANCE if final else 1e-3,
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
        reached = _otherwise_divided(*reached, settings, pace)
        (problem, outcome), searched = reached, True
        if (noises := with_noises(problem, outcome, settings, pace)) is not None:
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


def _otherwise_divided(problem: Problem, outcome: Outcome, settings: Settings, pace: Pace) -> tuple[Problem, Outcome]:
    """The same, or where it is lower the other valley of lag and damping."""

    def tell(_step: int, loss: float) -> None:
        pace.note(f"lag and damping divided otherwise, loss {loss:.4g}")

    other = otherwise_divided(problem, outcome.point, max_iterations=settings.max_iterations, progress=tell)
    return (problem, outcome) if other is None else (problem.rescaled(scales(problem, other.point)), other)


def _known(
    problem: Problem, outcome: Outcome, noises: Disturbed | None, settings: Settings, pace: Pace
) -> tuple[Outcome, Uncertainty | None, Array]:
    """The outcome without what pressure noise has moved it by, how well it is known, and how far it was moved."""
    pace.last("standard errors")
    z, known = outcome.point.z, None
    try:
        outcome, normal, better = without_pressure_noise(problem, outcome, seed=settings.seed, draws=settings.draws)
        known = uncertainty(
            problem, outcome.point, normal, better, noises=noises, seed=settings.seed, draws=settings.draws
        )
    except (ConvergenceError, np.linalg.LinAlgError) as error:
        pace.note(f"standard errors: {error}")
    return outcome, known, outcome.point.z - z


def _pace(model: Model, stages: Sequence[Stage], settings: Settings, tell: Progress) -> Pace:
    """The work of a step of each stage, in simulated seconds, and what follows the last one."""
    sets = 1 + len(model.coordinates) + 6 * len(model.parameters.sections)
    seconds = sum(rec.duration for rec in model.records)
    work = [sets * (seconds if stage.budget is None else min(seconds, stage.budget)) for stage in stages]
    noisy = settings.draws > 0 and any(rec.has_unsure_pressures for rec in model.records)
    return Pace(tell, work, 1.0 + (2.0 * PAIRS + settings.draws / sets if noisy else 0.0))


def _teller(pace: Pace, stage: Stage, number: int) -> Callable[[int, float], None]:
    label = "whole logs" if stage.length is None else f"windows of {stage.length:g} s"
    return lambda iteration, cost: pace.step(f"{label}, step {iteration + 1}, loss {cost:.4g}", number, iteration)


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
