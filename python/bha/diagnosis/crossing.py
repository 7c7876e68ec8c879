"""Prediction of training logs by parameters that the other training logs give: what a search decides by.

What: each log in turn, or where logs are few each of some long blocks, is left out. The parameters without it follow
from the sensitivities and the white residual, whose inner products are summed by group: no refit is needed. With them
the log is simulated, open loop, from an initial state that is estimated on it, as held-out logs are.
Source: leave-group-out cross-validation, Stone 1974; its one-step form for nonlinear least squares, Nocedal and Wright
2006, chapter 10.
Validity: the fit is at its minimum, and near enough to that without the group for its sensitivities to hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import Fit, Problem, prior_weights, project_states
from bha.diagnosis.holdout import Prediction, Readings, error_of, predicted, state_step, up_to_run_away
from bha.diagnosis.where import block_edges

Array = NDArray[np.float64]

#: Fewest logs that are left out whole; fewer are cut into blocks, so many in all at least.
FEWEST_LOGS, FEWEST_BLOCKS = 3, 4
#: Greatest change of a coordinate that the sensitivities are trusted with.
GREATEST_CHANGE = 2.0


@dataclass(frozen=True)
class Group:
    """What is left out together.

    Attributes:
        log: number of the log.
        rows: its white rows.
        begin: time of the first row, s.
        end: time after the last one, s; infinite at the end of the log.
    """

    log: int
    rows: slice
    begin: float
    end: float


def groups(problem: Problem) -> list[Group]:
    """Whole logs if there are enough, else long blocks of them."""
    count = len(problem.records)
    each = 1 if count >= FEWEST_LOGS else -(-FEWEST_BLOCKS // count)
    found = []
    for log, whitener in enumerate(problem.whiteners):
        time = whitener.time
        cuts = block_edges(time, float(time[-1] - time[0]) / each)
        for k, rows in enumerate(cuts):
            begin = -np.inf if k == 0 else float(time[rows.start])
            end = np.inf if k + 1 == len(cuts) else float(time[rows.stop])
            found.append(Group(log, rows, begin, end))
    return found


def normal_matrix(problem: Problem, fit: Fit) -> tuple[Array, Array]:
    """Sensitivities beyond what initial states can do, and their normal matrix with the prior."""
    assert fit.jacobian is not None
    assert fit.state_jacobians is not None
    jacobian = project_states(problem, fit.state_jacobians, fit.jacobian)
    normal = jacobian.T @ jacobian + np.diag(prior_weights(fit))
    return jacobian, normal + 1e-12 * np.trace(normal) / max(len(normal), 1) * np.eye(len(normal))


def without_groups(problem: Problem, fit: Fit, left_out: Sequence[Group]) -> list[Array]:
    """Coordinates that the fit has without each group, by its sensitivities."""
    jacobian, normal = normal_matrix(problem, fit)
    found = []
    for group in left_out:
        part = problem.slices()[group.log]
        width = (part.stop - part.start) // problem.whiteners[group.log].kept
        own = slice(part.start + group.rows.start * width, part.start + group.rows.stop * width)
        rest = normal - jacobian[own].T @ jacobian[own]
        change = -np.linalg.lstsq(rest, jacobian[own].T @ fit.residual[own], rcond=1e-12)[0]
        size = float(np.max(np.abs(change), initial=0.0))
        x = fit.x + change * min(1.0, GREATEST_CHANGE / max(size, 1e-300))
        found.append(np.array([c.coordinate(c.value(v)) for c, v in zip(fit.model.coordinates, x, strict=True)]))
    return found


def crossed(problem: Problem, fit: Fit, readings: Readings) -> Prediction:
    """Every training log as the others predict it, under the model of ``fit``, which has its sensitivities.

    ``readings`` are those of the training logs.
    """
    assert fit.jacobian is not None
    assert fit.state_jacobians is not None
    left_out = groups(problem)
    runs = []
    for group, x in zip(left_out, without_groups(problem, fit, left_out), strict=True):
        part, jacobian = problem.slices()[group.log], fit.state_jacobians[group.log]
        left = fit.residual[part] - fit.jacobian[part] @ (x - fit.x)
        state = fit.states[group.log] + state_step(problem, jacobian, left)
        runs.append(fit.model.run(x, problem.windows[group.log], state))
    simulated = fit.model.integration.run(runs)
    raw = [np.empty_like(record.measured) for record in problem.records]
    for group, y in zip(left_out, simulated, strict=True):
        time = problem.records[group.log].time
        own = (time >= group.begin) & (time < group.end)
        raw[group.log][own] = y[own]
    outputs, until = up_to_run_away(problem, raw)
    return predicted(problem, readings, outputs, fit.states, problem.residual(outputs), until, error_of(problem, raw))
