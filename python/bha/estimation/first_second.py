"""Where a log begins: lengths, rates and, under commands, what stood in the chambers, told by its first second.

A log of commands that begins in motion does not say what the chambers held: the commands before it have not all come
through. It is as if others had stood until a dead time before the log, one number an input; these are found with the
lengths and rates. What the first second does not tell of them is the first command, give or take what commands of the
log differ by.
Limits: valves and chambers (``full``) are left at rest under the first command. Of an arm that stands at first, the
command is that under which it stands (:mod:`bha.recordings.first_command`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bha.estimation.dense import minimize
from bha.estimation.engine import Model
from bha.estimation.lags import is_dead_time
from bha.estimation.problem import Point, Problem, Residuals, state_deviations
from bha.estimation.records import Record, Window
from bha.estimation.runs import Run
from bha.estimation.scales import scales
from bha.parameters import ArmParameters

Array = NDArray[np.float64]

#: From this much of a log it is told how it begins, s; the rest is prediction.
START_SECONDS = 1.0
#: Least rows of it.
_ROWS = 8
#: Difference of a pressure by which derivatives are taken, Pa.
_PRESSURE = 10.0
#: Most steps, what one must promise, and how many deviations of its prior anything is off at most.
_MOST_STEPS, _TOLERANCE, _FARTHEST = 6, 1e-3, 5.0
#: How often scales are made anew where pressures are told too.
_ROUNDS = 4


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
    rec = model.records[number].alone
    last = int(np.searchsorted(rec.time, rec.time[0] + START_SECONDS))
    window = Window(0, 0, min(max(last, _ROWS), len(rec)))
    model = model.on((rec,))
    nothing = (np.zeros(0), np.ones(0))
    residuals = Residuals((rec.noise,), np.inf)
    problem = Problem(model, (window,), residuals, guess[None], nothing, state_deviations([rec]))
    unsure = unsure_of_pressures(model.parameters, rec)
    first, spread = _commands(rec) if unsure else (np.zeros(0), np.zeros(0))
    late = _dead_time(model, z) if unsure else 0.0
    arm, observation = model.shown(z, 0)
    deviations = np.concatenate([problem.state_deviation, spread])
    middle, n = np.concatenate([guess, first]), len(guess)
    differences = np.repeat([model.differences.length, model.differences.rate], n // 2)
    steps = np.concatenate([differences, np.full(len(first), _PRESSURE)]) / deviations

    def run(x: Array) -> Run:
        values = middle + deviations * x
        drive = rec.preceded_by(values[n:], late).drive if unsure else None
        return Run(arm, observation, rec, values[:n], 0, window.last, drive=drive)

    def left(points: Sequence[Array]) -> list[Array]:
        shown = model.integration.run([run(x) for x in points])
        tables = [residuals.scaled(model, window, own)[0].ravel() for own in shown]
        return [np.concatenate([table, -x]) for table, x in zip(tables, points, strict=True)]

    def slopes(x: Array, here: Array) -> Array:
        there = left([x + own for own in np.diag(steps)])
        return np.column_stack([(own - here) / step for own, step in zip(there, steps, strict=True)])

    x = np.zeros(len(middle))
    bounds = np.tile([-_FARTHEST, _FARTHEST], (len(middle), 1))
    # Where the model is wrong, its own error is the scale: the start must not make up for it. Of a start under commands
    # that were others the most is made up for by these, and then little is wrong.
    for _ in range(_ROUNDS if unsure else 1):
        values = middle + deviations * x
        there = model.on((rec.preceded_by(values[n:], late),)) if unsure else model
        residuals = scales(replace(problem, model=there), Point(z, values[None, :n]))
        x = minimize(lambda x: left([x])[0], slopes, x, bounds, max_iterations=_MOST_STEPS, tolerance=_TOLERANCE).z
    values = middle + deviations * x
    return rec.preceded_by(values[n:], late) if unsure else rec, values[:n]


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


def _commands(rec: Record) -> tuple[Array, Array]:
    """First command, and how commands of a log differ, Pa, each shape (inputs,)."""
    pressures = rec.drive.pressures
    return pressures[0], np.maximum(np.std(pressures, axis=0), _PRESSURE)


def _dead_time(model: Model, z: Array) -> float:
    """Dead time of all commands, s."""
    values = [c.value(float(x)) for c, x in zip(model.plain, z, strict=False) if is_dead_time(c.path)]
    own = [e.parameters["time"] for e in model.parameters.effects if e.kind == "delay" and e.where == "all"]
    return float(sum(values or own))
