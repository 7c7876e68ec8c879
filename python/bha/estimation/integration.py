"""Which integrator and which step: as coarse as the noise allows, checked by halving.

Lightly damped arms are cheapest with the classical method of order 4. Arms whose damping outweighs their masses are
stiff: there the explicit method needs steps far below what accuracy asks for, and a linearly implicit one of order 2 is
cheaper. What counts as accurate is set by the sensors' noise, or by what the model leaves unexplained where that is
much more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bha.errors import ConvergenceError
from bha.estimation.engine import Model, root_mean_square
from bha.estimation.problem import Point, Problem
from bha.estimation.records import Record, Window
from bha.estimation.runs import Integration
from bha.runs.options import Method

Array = NDArray[np.float64]

#: Steps of the fixed-step integrator that are tried, from coarse to fine, s.
STEPS = (0.02, 0.01, 0.005, 0.0025, 0.00125, 0.0006)
#: Error of the integrator that is allowed, in sensor noises and in what the model leaves (median).
_NOISE_SHARE = 0.1
_RESIDUAL_SHARE = 0.01
#: A classical step as long as this is not worth comparing with the implicit method, s.
_GOOD_STEP = 1e-2
#: Steps over which the implicit method keeps its Jacobian, at the least.
_KEPT = 4
_WINDOWS = 4
#: Rows at the start of a window do not count: part of it, and at most so long, s. An initial state that is free makes a
#: layer there in an arm that is stiff, which no step resolves and which nothing but that state follows from.
_LAYER = (0.25, 0.5)
#: Least part of what is allowed in the lengths or positions that are missed most, in any window, for the others: where
#: a model misses by millimetres it gains nothing from micrometres elsewhere, or while the arm stands still.
_OTHERS = 0.25
#: Greatest share of the noise that the integration's error may have.
STEP_ERROR_SHARE = 0.15
#: The same for runs of which only differences are wanted.
COARSE_ERROR_SHARE = 1.0
#: The same for a candidate: many are tried, and the error is alike in all runs that are compared.
CANDIDATE_ERROR_SHARE = 0.5
#: Where a model errs by more than this times the noise, the integration may err by these shares of that, the second
#: where only differences are wanted: no effect of the catalogue brings it down to the noise.
FAR_OFF, MISFIT_SHARE, COARSE_MISFIT_SHARE = 100.0, 1.0 / 100.0, 1.0 / 10.0
#: Divisors of the step that are tried for a candidate.
DIVISORS = (1, 2, 4)
#: Part of each log on which a step is checked, s.
CHECKED_TIME = 6.0


def choose_integration(
    model: Model, z: Array, pieces: Sequence[Window], states: Array, *, methods: Method | None = None
) -> Model:
    """The model with the cheapest integrator (or that of ``methods``) that is accurate enough over some windows.

    Raises:
        ConvergenceError: the simulation fails with every integrator.
    """
    chosen = np.unique(np.linspace(0, len(pieces) - 1, min(_WINDOWS, len(pieces))).astype(int))
    some, their = [pieces[k] for k in chosen], states[chosen]
    explicit = None if methods == "ros2" else _longest(by(model, method="rk4"), z, some, their)
    if explicit is not None and explicit >= _GOOD_STEP:
        return by(model, method="rk4", step=explicit)
    implicit = None if methods == "rk4" else _longest(by(model, method="ros2"), z, some, their)
    candidates: tuple[tuple[Method, float | None], ...] = (("rk4", explicit), ("ros2", implicit))
    found: list[tuple[float, Method, float]] = []
    for method, step in candidates:
        if step is not None:
            found.append((evaluations(method, states.shape[1]) / step, method, step))
    if not found:
        return _fallback(model, z, some, their)
    _, method, step = min(found)
    return by(model, method=method, step=step)


def by(model: Model, *, method: Method | None = None, step: float | None = None) -> Model:
    """The model with another integrator, or another step of it, s."""
    own = model.integration
    return replace(model, integration=replace(own, method=method or own.method, step=step or own.step))


def evaluations(method: str, unknowns: int) -> float:
    """Evaluations of the equations of motion a step costs; of the implicit one two by time and a Jacobian's share."""
    return 4.0 if method == "rk4" else 4.0 + unknowns / _KEPT


def too_coarse(problem: Problem, point: Point) -> bool:
    """Whether halving the step changes predictions by more than twice what is allowed."""
    model = problem.model
    coarse = model.predict(point.z, problem.windows, point.states)
    fine = by(model, step=model.integration.step / 2).predict(point.z, problem.windows, point.states)
    return _excess(model, problem.windows, coarse, fine) > 2.0


def _longest(model: Model, z: Array, some: Sequence[Window], states: Array) -> float | None:
    """The longest step that halving does not change too much."""
    coarse: list[Array] | None = None
    previous = STEPS[0]
    for step in (*STEPS, STEPS[-1] / 2):
        fine = by(model, step=step).predict(z, some, states)
        if coarse is not None and _excess(model, some, coarse, fine) < 1.0:
            return previous
        coarse, previous = fine, step
    return None


def _excess(model: Model, some: Sequence[Window], coarse: list[Array], fine: list[Array]) -> float:
    """The greatest root mean square change of a channel in a window, in what is allowed."""
    if not all(np.all(np.isfinite(run)) for run in (*coarse, *fine)):
        return np.inf
    allowed = _allowed(model, some, fine)
    worst = 0.0
    for window, a, b, most in zip(some, coarse, fine, allowed, strict=True):
        time = model.records[window.record].time[window.first : window.last]
        since = time - time[0]
        counts = since >= min(_LAYER[0] * float(since[-1]), _LAYER[1])
        worst = max(worst, float(np.max(np.sqrt(np.mean((a - b)[counts] ** 2, axis=0)) / most)))
    return worst


def _allowed(model: Model, some: Sequence[Window], predicted: list[Array]) -> list[Array]:
    """The error that is allowed in each channel of some windows, by noise and by what the model leaves."""
    allowed, in_metres = [], []
    for window, run in zip(some, predicted, strict=True):
        rec = model.records[window.record]
        rows = slice(window.first, window.last)
        left = np.abs(np.where(rec.usable[rows], rec.measured[rows] - run, 0.0))
        allowed.append(np.maximum(_NOISE_SHARE * rec.noise, _RESIDUAL_SHARE * np.median(left, axis=0) / 0.6745))
        in_metres.append(np.array([output.kind != "orientation" for output in rec.observation.outputs]))
    most = max((float(np.max(a[m])) for a, m in zip(allowed, in_metres, strict=True) if m.any()), default=0.0)
    return [np.where(m, np.maximum(a, _OTHERS * most), a) for a, m in zip(allowed, in_metres, strict=True)]


def _fallback(model: Model, z: Array, some: Sequence[Window], states: Array) -> Model:
    """The finest step tried, if the simulation at least runs with it.

    Raises:
        ConvergenceError: it does not.
    """
    methods: tuple[Method, ...] = ("rk4", "ros2")
    for method in methods:
        finest = by(model, method=method, step=STEPS[-1] / 2)
        predicted = finest.predict(z, some, states)
        failed = [k for k, p in enumerate(predicted) if not np.all(np.isfinite(p))]
        if not failed:
            return finest
    window = some[failed[0]]
    rec = model.records[window.record]
    raise ConvergenceError(
        f"{rec.name}: the simulation with the starting values fails between {rec.time[window.first]:g} and "
        f"{rec.time[window.last - 1]:g} s with every step tried; start from values nearer to the arm's"
    )


def noise_of(records: Sequence[Record]) -> float:
    """A typical error of a right model, m: noise of the outputs, and what the arm does otherwise each time."""
    return float(np.median([np.median(np.maximum(r.noise, r.repeat_noise)) for r in records]))


def checked_rows(record: Record) -> int:
    """Rows of a log on which a step is checked."""
    return min(len(record.rows), int(CHECKED_TIME / record.sample_time))


def far_apart(records: Sequence[Record], first: Sequence[Array], second: Sequence[Array], share: float) -> bool:
    """Whether two sets of runs differ by more than ``share`` of the noise, or one of them diverged."""
    return not root_mean_square(first, second) <= share * noise_of(records)


def allowed(share: float, far_off: float, misfit: float) -> float:
    """Greatest error over the noise: ``share``, or that share ``far_off`` of a model's ``misfit`` where it is large."""
    return max(share, far_off * misfit) if FAR_OFF < misfit < np.inf else share


def resolved(model: Model, x: Array, states: Sequence[Array], misfit: float) -> Model:
    """``model`` with the coarsest step that its effects at ``x`` allow; ``misfit`` as for :func:`allowed`."""
    records = model.records
    share = allowed(CANDIDATE_ERROR_SHARE, MISFIT_SHARE, misfit)
    runs = model.runs(x, states, [checked_rows(r) for r in records])

    def with_divisor(finer: int) -> Integration:
        return replace(model.integration, finer=finer)

    found = {1: with_divisor(1).once().run(runs)}
    for finer in DIVISORS[:-1]:
        found[2 * finer] = with_divisor(2 * finer).once().run(runs)
        if not far_apart(records, found[finer], found[2 * finer], share):
            return replace(model, integration=with_divisor(max(finer, model.integration.finer)))
    return replace(model, integration=with_divisor(DIVISORS[-1]))
