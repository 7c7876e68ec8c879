"""The stages of a joint fit: windows and rows of each, and what one takes over from the one before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.estimation.engine import Model
from bha.estimation.problem import Point, Problem, Residuals, state_deviations
from bha.estimation.records import Record, Window, some_of, windows
from bha.estimation.scales import alike
from bha.estimation.settings import Settings
from bha.estimation.solver import Outcome
from bha.estimation.strays import is_sparse, without_strays

Array = NDArray[np.float64]

#: The last search ends when a step gains less than this part of the loss, or less than a hundredth.
TOLERANCE = 1e-6
#: Rows of all but the last stage are at least this far apart, and short windows last this long together, s.
_COARSE_INTERVAL, _SHORT_BUDGET = 0.01, 20.0
#: Rows over which white residuals of a log are correlated by chance, at the most.
_WHITE = 1.5


@dataclass(frozen=True)
class Stage:
    """Length of the windows, s (None: whole logs), interval of the rows, s, and most of all windows together, s."""

    length: float | None
    interval: float
    budget: float | None


def stages_of(settings: Settings) -> list[Stage]:
    """Coarse and on a part first, on everything last."""
    assert settings.windows is not None
    short = (_SHORT_BUDGET if length is not None and length <= 2.0 else None for length in settings.windows)
    coarse = max(_COARSE_INTERVAL, settings.interval)
    stages = [Stage(length, coarse, budget) for length, budget in zip(settings.windows, short, strict=True)]
    return [*stages, Stage(settings.windows[-1], settings.interval, None)]


def stage_problem(
    model: Model,
    z: Array,
    prior: tuple[Array, Array],
    length: float | None,
    settings: Settings,
    budget: float | None = None,
) -> Problem:
    """The problem of a stage before its first step: its windows, initial states by guess, scales of the sensors.

    Args:
        model: with records as thin as the stage has them.
        z: coordinates to guess initial states with.
        prior: mean and deviation of the coordinates.
        length: of the windows, s; None for whole logs.
        settings: how to fit.
        budget: most of all windows together, s.
    """
    pieces = windows(model.records, length)
    if budget is not None:
        pieces = some_of(pieces, model.records, budget)
    noises = tuple(rec.noise for rec in model.records)
    residuals = Residuals(noises, settings.huber, lasting=settings.lasting, pooled=settings.pooled)
    guesses = model.guesses(z, pieces)
    deviations = settings.state_deviation or state_deviations(model.records)
    return Problem(model, tuple(pieces), residuals, guesses, prior, deviations)


def on_all_rows(problem: Problem, model: Model, point: Point) -> tuple[Problem, Array]:
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


def sound(records: Sequence[Record], reached: tuple[Problem, Outcome] | None) -> tuple[Record, ...]:
    """The records without stray readings, by where a search has ended; those as they are that it saw thinned."""
    if reached is None or not any(is_sparse(rec) for rec in records):
        return tuple(records)
    problem, outcome = reached
    seen = problem.model.records
    shown = problem.model.predict(outcome.point.z, problem.windows, outcome.point.states)
    kept = without_strays(seen, problem.by_record(shown))
    return tuple(new if len(new) == len(rec) else rec for rec, new in zip(records, kept, strict=True))


def with_what_lasts(problem: Problem, outcome: Outcome, staged: Model, settings: Settings) -> Problem:
    """The problem with what its model leaves weighing by how long it lasts, in rows of the last stage.

    An error that is alike in many rows is one number, and priors are to count beside it as beside one. Where settings
    say how long it lasts that stays; innovations, which come after, know it themselves.
    """
    if problem.residuals.lasting > 1.0 or wants_noises(problem.model, settings):
        return problem
    rows = alike(problem, problem.evaluated(outcome.point.z, outcome.point.states))
    more = sum(map(len, staged.records)) / sum(map(len, problem.model.records))
    lasting = max(1.0, rows * more) ** 0.5 if rows > _WHITE else 1.0
    return problem.rescaled(replace(problem.residuals, lasting=lasting))


def wants_noises(model: Model, settings: Settings) -> bool:
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
