"""Where a log begins: lengths, rates and, under commands, what stood in the chambers, told by its first second.

A log of commands that begins in motion does not say what the chambers held: the commands before it have not all come
through. It is as if others had stood, one number an input, until some moment within a dead time before the log, when
its first ones came. These numbers and the moment are found with the lengths and rates. What the first second does not
tell of them is the first command, give or take what commands of the log differ by.
Limits: one command before the first one. Valves and chambers (``full``) are left at rest under the first command. Of an
arm that stands at first, the command is that under which it stands (:mod:`bha.recordings.first_command`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha.estimation.dense import minimize
from bha.estimation.engine import Model
from bha.estimation.problem import Point, Problem, Residuals, state_deviations
from bha.estimation.records import Record, Window
from bha.estimation.runs import Run
from bha.estimation.scales import scales
from bha.parameters import ArmParameters, paths

Array = NDArray[np.float64]

#: From this much of a log it is told how it begins, s; the rest is prediction.
START_SECONDS = 1.0
#: Least rows of it.
_ROWS = 8
#: How much of a log beyond its first second is looked at, s: over as much its pressures are averaged at the most.
_BEYOND = 0.5
#: Difference of a pressure by which derivatives are taken, Pa.
_PRESSURE = 10.0
#: Most steps, what one must promise, and how many deviations of its prior anything is off at most.
_MOST_STEPS, _TOLERANCE, _FARTHEST = 6, 1e-3, 5.0
#: How often scales are made anew where pressures are told too.
_ROUNDS = 4
#: Moments at which the first commands may have come, in dead times before the log, and least dead time, s, of which
#: more than the first is tried.
_MOMENTS, _LEAST_DEAD_TIME = (1.0, 0.75, 0.5, 0.25, 0.0), 0.02


def unsure_of_pressures(parameters: ArmParameters, rec: Record) -> bool:
    """Whether a log leaves open what stood in the chambers of an arm when it began."""
    if not rec.drive.commanded or rec.resting is not None:
        return False
    table = parameters.pneumatics
    lags = (table is not None and table.level == "lag") or any(e.kind == "pressure_lag" for e in parameters.effects)
    return lags and (table is None or table.level != "full")


def first_second(model: Model, z: Array, number: int, guess: Array) -> tuple[Record, Array]:
    """A record with what stood in the chambers before it, and the initial state, shape (6n,), that go with it best.

    Args:
        model: the model; its integrator resolves the motion.
        z: coordinates.
        number: of the record.
        guess: of the initial state, shape (6n,), centre of its prior.

    Raises:
        ConvergenceError: the simulation from the guess fails.
    """
    whole, guess = model.records[number].alone, guess[: 6 * model.sections]
    last = min(max(int(np.searchsorted(whole.time, whole.time[0] + START_SECONDS)), _ROWS), len(whole))
    # What comes after it does not matter, and is the most of a log.
    rec = whole.between(float(whole.drive.time[0]), float(whole.time[last - 1]) + _BEYOND)
    model = model.on((rec,))
    unsure = unsure_of_pressures(model.parameters, whole)
    first, spread = _commands(whole) if unsure else (np.zeros(0), np.zeros(0))
    deviations = np.concatenate([np.repeat(state_deviations([rec]), len(guess) // 2), spread])
    middle = np.concatenate([guess, first])
    start = _Start(model, z, Window(0, 0, last), middle, deviations, len(guess))
    late = _dead_time(model, z) if unsure else 0.0
    moment, x = late, np.zeros(len(middle))
    if late >= _LEAST_DEAD_TIME:
        tried = [(share * late, start.found(share * late, x, 1)) for share in _MOMENTS]
        moment, x = min(tried, key=lambda one: start.cost(*one))
    values = start.values(start.found(moment, x, _ROUNDS if unsure else 1))
    return _preceded(whole, values[len(guess) :], moment), values[: len(guess)]


@dataclass(frozen=True)
class _Start:
    """The first second of a log as a function of x: initial state and, where it is unsure, pressures before it.

    Attributes:
        model: the model on the record alone.
        z: its coordinates.
        window: the first second.
        middle: values at x = 0: m, m/s and Pa.
        deviations: how far one x takes each.
        states: how many of them are of the initial state; the others are pressures.
    """

    model: Model
    z: Array
    window: Window
    middle: Array
    deviations: Array
    states: int

    def values(self, x: Array) -> Array:
        """Initial state and pressures."""
        return np.asarray(self.middle + self.deviations * x)

    def record(self, values: Array, moment: float) -> Record:
        """The record with its pressures before it, until ``moment``, s, before the log."""
        return _preceded(self.model.records[0], values[self.states :], moment)

    def found(self, moment: float, x: Array, rounds: int) -> Array:
        """The best x from one on, with scales made anew so many times.

        Where the model is wrong, its own error is the scale: the start must not make up for it. Of a start under
        commands that were others the most is made up for by these, and then little is wrong.
        """
        for _ in range(rounds):
            values = self.values(x)
            problem = replace(self._problem, model=self.model.on((self.record(values, moment),)))
            scaled = scales(problem, Point(self.z, values[None, : self.states]))
            x = self._searched(moment, x, scaled)
        return x

    def cost(self, moment: float, x: Array) -> float:
        """Squares of what is left in units of the sensors' noise, and of x."""
        return float(np.sum(self._left(moment, [x], self._problem.residuals)[0] ** 2))

    @cached_property
    def _problem(self) -> Problem:
        rec = self.model.records[0]
        residuals = Residuals((rec.noise,), np.inf)
        nothing = (np.zeros(0), np.ones(0))
        guess = self.middle[None, : self.states]
        return Problem(self.model, (self.window,), residuals, guess, nothing, state_deviations([rec]))

    @cached_property
    def _steps(self) -> Array:
        """Differences of x by which derivatives are taken."""
        differences = self.model.differences
        of_states = np.repeat([differences.length, differences.rate], self.states // 2)
        of_pressures = np.full(len(self.middle) - self.states, _PRESSURE)
        return np.asarray(np.concatenate([of_states, of_pressures]) / self.deviations)

    def _searched(self, moment: float, x: Array, scaled: Residuals) -> Array:
        def slopes(x: Array, here: Array) -> Array:
            there = self._left(moment, [x + own for own in np.diag(self._steps)], scaled)
            return np.column_stack([(own - here) / step for own, step in zip(there, self._steps, strict=True)])

        def left(x: Array) -> Array:
            return self._left(moment, [x], scaled)[0]

        bounds = np.tile([-_FARTHEST, _FARTHEST], (len(x), 1))
        return minimize(left, slopes, x, bounds, max_iterations=_MOST_STEPS, tolerance=_TOLERANCE).z

    def _left(self, moment: float, points: Sequence[Array], scaled: Residuals) -> list[Array]:
        arm, observation = self.model.shown(self.z, 0)
        rec, runs = self.model.records[0], []
        for values in map(self.values, points):
            drive = self.record(values, moment).drive if len(values) > self.states else None
            runs.append(Run(arm, observation, rec, values[: self.states], 0, self.window.last, drive=drive))
        tables = [scaled.scaled(self.model, self.window, own)[0].ravel() for own in self.model.integration.run(runs)]
        return [np.concatenate([table, -x]) for table, x in zip(tables, points, strict=True)]


def preceded(model: Model, z: Array) -> Model:
    """The model with what stood in the chambers before each log of commands that begins in motion.

    Raises:
        ConvergenceError: a simulation fails.
    """
    told = list(model.records)
    for number, rec in enumerate(told):
        if unsure_of_pressures(model.parameters, rec):
            guess = model.guesses(z, [Window(number, 0, len(rec))])[0]
            told[number] = first_second(model, z, number, guess)[0]
    return model.on(told)


def _preceded(rec: Record, pressures: Array, moment: float) -> Record:
    """The record with these pressures before it until ``moment``, s, before the log; itself where there are none."""
    return rec.preceded_by(pressures, moment) if len(pressures) else rec


def _commands(rec: Record) -> tuple[Array, Array]:
    """First command, and how commands of a log differ, Pa, each shape (inputs,)."""
    pressures = rec.drive.pressures
    return pressures[0], np.maximum(np.std(pressures, axis=0), _PRESSURE)


def _dead_time(model: Model, z: Array) -> float:
    """Dead time of all commands, s."""
    values = [c.value(float(x)) for c, x in zip(model.plain, z, strict=False) if paths.is_dead_time(c.path)]
    own = [e.parameters["time"] for e in model.parameters.effects if e.kind == "delay" and e.where == "all"]
    return float(sum(values or own))
