"""The last stage of a fit: parameters and the sizes of the noises in turn, by prediction error.

What: near the point that output error has found, the sizes of the noises are estimated from what it leaves
(:mod:`bha.estimation.noise_fit`), residuals become innovations, and the parameters are fitted again, until neither
moves. Windows are long here: what is slow is seen in long ones only. What rounding to coarse steps adds on average
(:mod:`bha.estimation.rounding`) is taken off the readings by where the model has the channels, anew in each round.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.estimation.initial import pose_of
from bha.estimation.noise import Linear, Noise, poses_along, ways_of
from bha.estimation.noise_fit import (
    Found,
    Likelihood,
    Piece,
    axes_of_sizes,
    base_of,
    clipped,
    find,
    is_dense,
    most_logged,
)
from bha.estimation.problem import Point, Problem
from bha.estimation.records import Record
from bha.estimation.rounding import Rounding, rounding_of
from bha.estimation.solver import Outcome, Policy, solve

Array = NDArray[np.float64]

#: Poses a second at which the arm is looked for, and at which it is linearized in a window at the most.
_POSES_A_SECOND, _POSES = 20.0, 128
#: Rounds of sizes and parameters at the most, and the step, in standard errors, below which they have settled.
_ROUNDS, _SETTLED = 4, 0.1
#: The same where what rounding adds has to be found with them.
_ROUNDS_OF_STEPS = 8


@dataclass(frozen=True)
class Disturbed:
    """A fit with its noises.

    Attributes:
        problem: windows, and residuals as innovations.
        outcome: where the search ended.
        found: the sizes of the noises.
        likelihood: from which they are.
        rounding: what was taken off the readings of the problem's records.
    """

    problem: Problem
    outcome: Outcome
    found: Found
    likelihood: Likelihood
    rounding: Rounding

    @cached_property
    def axes_of_sizes(self) -> tuple[Array, Array]:
        """How well the sizes are known, along the axes of their likelihood; found once, by some dozen filters."""
        return axes_of_sizes(self.likelihood, self.found)

    def most_logged(self) -> float:
        """Factor on the records' noise of the logged pressures that is greater than the true one, at 95 %.

        Readings that tell their own noise are believed: then it is one.
        """
        return 1.0 if self.found.shape.readings_tell else most_logged(self.found, self.axes_of_sizes)

    def mean_square(self, record: int) -> Array:
        """Mean square of the innovations of each channel of a record, shape (C,): one where the noises are right."""
        left = self.problem.evaluated(self.outcome.point.z, self.outcome.point.states).left
        assert left is not None
        own = [(w, values) for w, values in zip(self.problem.windows, left, strict=True) if w.record == record]
        rec = self.problem.model.records[record]
        read = sum(rec.usable[w.first : w.last].sum(axis=0) for w, _ in own)
        return np.asarray(sum(np.sum(values**2, axis=0) for _, values in own) / np.maximum(read, 1))

    def unlogged_words(self) -> str:
        """What acts and is in no log, section by section; empty for nothing."""
        found = []
        for section, (size, seconds) in self.found.sizes.unlogged.items():
            linear = next(piece for piece in self.likelihood.pieces)
            own = [area for area, owner in zip(linear.areas, linear.sections, strict=True) if owner == section]
            force = size * float(np.mean(own)) if own else 0.0
            found.append(f"{size:.2g} Pa ({force:.2g} N a bellows) over {seconds:.2g} s in section {section}")
        return ", ".join(found)

    @property
    def is_coarse(self) -> bool:
        """Whether channels are read in steps so coarse that rounding is no white noise."""
        return any(piece.noise(self.found.sizes).is_coarse for piece in self.likelihood.pieces)

    def noise(self, record: int) -> Noise:
        """The noise of a record."""
        return next(piece.noise(self.found.sizes) for piece in self.likelihood.pieces if piece.window.record == record)


def fit_with_noise(
    problem: Problem,
    point: Point,
    *,
    max_iterations: int,
    tolerance: float,
    progress: Callable[[int, float], None] | None = None,
) -> Disturbed:
    """Estimate noises and parameters near a point.

    Args:
        problem: windows as long as what is slow; its scales are not looked at.
        point: where output error ended.
        max_iterations: most steps of each round.
        tolerance: of the search.
        progress: called with the number of steps and the loss.

    Raises:
        ConvergenceError: a simulation fails at the point.
    """
    problem = replace(problem, model=replace(problem.model, records=tuple(map(_with_least, problem.model.records))))
    as_read = problem
    found: Found | None = None
    outcome = Outcome(point, False, "not started", 0)
    iterations = 0
    rounding = rounding_of(as_read, point)
    if rounding.is_coarse:
        # Nearly nothing is left within a step and a whole one at its edges: no outliers.
        problem = problem.rescaled(replace(problem.residuals, huber=np.inf))
    added: list[Array] | None = None
    for _ in range(_ROUNDS_OF_STEPS if rounding.is_coarse else _ROUNDS):
        if rounding.is_coarse:
            now = _added_by(rounding, as_read, outcome.point)
            # Half of the way each time: near an edge what rounding adds changes faster than the channel does.
            added = now if added is None else [0.5 * (a + b) for a, b in zip(added, now, strict=True)]
            records = tuple(map(rounding.taken_off, as_read.model.records, added))
            problem = replace(problem, model=replace(problem.model, records=records))
        likelihood = likelihood_at(problem, outcome.point, least=2.0 * rounding.quantum)
        found = find(likelihood, before=found)
        filters = {piece.window: piece.filter(found.sizes) for piece in likelihood.pieces}
        problem = problem.rescaled(replace(problem.residuals, whitening=filters))
        before = outcome.point.z
        policy = Policy(max_iterations=max_iterations, tolerance=tolerance)
        outcome = solve(problem, Point(outcome.point.z, outcome.point.states), policy, progress=progress)
        iterations += outcome.iterations
        moved = (outcome.point.z - before) / np.sqrt(np.diag(found.judged.covariance))
        if np.max(np.abs(moved), initial=0.0) < _SETTLED:
            break
        if rounding.is_coarse:
            rounding = rounding_of(as_read, outcome.point)
    assert found is not None
    # What shakes the simulation from here on has the size that was found.
    records = tuple(r.with_pressure_noise(found.sizes.logged * r.pressure_noise) for r in problem.model.records)
    problem = replace(problem, model=replace(problem.model, records=records))
    return Disturbed(problem, replace(outcome, iterations=iterations), found, likelihood, rounding)


def _added_by(rounding: Rounding, problem: Problem, point: Point) -> list[Array]:
    """What rounding adds to the readings of each record on average, (rows, C), by what is shown at a point."""
    shown = problem.by_record(problem.model.predict(point.z, problem.windows, point.states))
    return [np.where(np.isnan(own), 0.0, rounding.error(own)) for own in shown]


def _with_least(rec: Record) -> Record:
    """The record, where readings are few with the noise of the input that hides its own least: sensors are alike."""
    known = rec.pressure_noise[rec.pressure_noise > 0.0]
    if not len(known) or is_dense(rec):
        return rec
    return rec.with_pressure_noise(np.where(rec.pressure_noise > 0.0, known.min(), 0.0))


def likelihood_at(problem: Problem, point: Point, *, least: Array | float = 0.0) -> Likelihood:
    """The likelihood of sizes near a point; residuals up to ``least`` are no outliers, shape (C,)."""
    model, pieces = problem.model, []
    mean, deviation = problem.prior
    linear = model.linearize(point.z, problem.windows, point.states)
    for k, (window, (predicted, by_z, by_state)) in enumerate(zip(problem.windows, linear, strict=True)):
        rec = model.records[window.record]
        rows = slice(window.first, window.last)
        usable = rec.usable[rows]
        residual = clipped(np.where(usable, rec.measured[rows] - predicted, 0.0), usable, least)
        arm = model.arm(point.z, rec.condition)
        driven = _driven(arm)
        linears, places = _linears(arm, rec, rows, predicted)
        pieces.append(
            Piece(
                window=window,
                record=rec,
                linears=linears,
                places=places,
                sections=tuple(section for section, _ in driven),
                areas=tuple(area for _, area in driven),
                base=base_of(rec, residual, usable),
                course=predicted,
                ways=ways_of(predicted, np.array([fact.quantum for fact in rec.facts])),
                columns=np.concatenate([residual[..., None], by_z, by_state], axis=-1),
                offset=(problem.guesses[k] - point.states[k]) / problem.state_deviation,
                deviations=problem.state_deviation,
            )
        )
    return Likelihood(tuple(pieces), mean - point.z, deviation)


def _driven(arm: Arm) -> list[tuple[int, float]]:
    """What each pressure input drives: the lowest of its sections, from 1, and the area of a bellows there, m^2."""
    owner: dict[str, tuple[int, float]] = {}
    for number, section in enumerate(arm.parameters.sections, start=1):
        for bellows in section.resolved_bellows(number):
            owner.setdefault(bellows.input, (number, bellows.terminal_area))
    return [owner.get(name, (1, 0.0)) for name in arm.inputs]


def _linears(arm: Arm, rec: Record, rows: slice, course: Array) -> tuple[tuple[Linear, ...], NDArray[np.intp]]:
    """The arm in some poses along a window, and the nearest of them to each row."""
    time = rec.time[rows]
    pressures = np.column_stack([np.interp(time, rec.drive.time, p) for p in rec.drive.pressures.T])
    # Poses that pressures hold, corrected by what the simulation shows, a few times a second.
    few = np.unique(np.linspace(0, len(time) - 1, 1 + int(_POSES_A_SECOND * (time[-1] - time[0]))).round().astype(int))
    lengths = np.stack([pose_of(arm, rec, course[k], rec.noise, pressures[k]) for k in few])
    every = np.column_stack([np.interp(time, time[few], column) for column in lengths.T])
    chosen, places = poses_along(every, _POSES)
    return tuple(Linear.of(arm, rec, every[k], pressures[k]) for k in chosen), places
