"""Prediction of training logs by parameters that the other training logs give: what a search decides by.

What: each log in turn, or where logs are few each of some long blocks, is left out. The parameters without it follow
from the sensitivities and the white residual, whose inner products are summed by group, and what they leave of the
group as well: no refit is needed, and no simulation. All models that are compared hold their plain parameters by the
priors alike, with the weight that the plain model's residual asks for: one that fits better has lighter priors, and
would be thrown farther by what is left out.
Source: leave-group-out cross-validation, Stone 1974; its one-step form for nonlinear least squares, Nocedal and Wright
2006, chapter 10.
Validity: the fit is at its minimum, and near enough to that without the group for its sensitivities to hold. A
simulation with these parameters adds the error of that step to the prediction and swamps it where parameters are badly
known (docs/decisions/0018).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.information import Information, information
from bha.diagnosis.where import block_edges

Array = NDArray[np.float64]

#: Fewest logs that are left out whole; fewer are cut into blocks, so many in all at least.
FEWEST_LOGS, FEWEST_BLOCKS = 3, 4
#: Greatest change of a coordinate that the sensitivities are trusted with, in plausible distances: for the coordinates
#: themselves, and for what they leave of the logs, where an error of it would count as one of the model.
GREATEST_CHANGE, GREATEST_OF_ERRORS = 2.0, 1.0


@dataclass(frozen=True)
class Group:
    """What is left out together.

    Attributes:
        log: number of the log.
        rows: its white rows.
    """

    log: int
    rows: slice


def groups(problem: Problem) -> list[Group]:
    """Whole logs if there are enough, else long blocks of them."""
    count = len(problem.records)
    each = 1 if count >= FEWEST_LOGS else -(-FEWEST_BLOCKS // count)
    found = []
    for log, whitener in enumerate(problem.whiteners):
        time = whitener.time
        found += [Group(log, rows) for rows in block_edges(time, float(time[-1] - time[0]) / each)]
    return found


def without_groups(problem: Problem, fit: Fit, left_out: Sequence[Group]) -> list[Array]:
    """Coordinates that the fit has without each group, by its sensitivities."""
    found = []
    for _, change in _changes(information(problem, fit), fit, left_out, GREATEST_CHANGE):
        moved = zip(fit.model.coordinates, fit.x + change, strict=True)
        found.append(np.array([c.coordinate(c.value(v)) for c, v in moved]))
    return found


def crossed(problem: Problem, fit: Fit, trust: float) -> float:
    """Mean square of the white residual of the training logs, each as the others predict it; ``fit`` with slopes.

    ``trust`` is the weight of the priors of all models that are compared.
    """
    known, squares = information(problem, fit, trust), 0.0
    for own, change in _changes(known, fit, groups(problem), GREATEST_OF_ERRORS):
        squares += float(np.sum((fit.residual[own] - known.jacobian[own] @ change) ** 2))
    return squares / len(fit.residual)


def share_of_excess(plain: float, smaller: float, larger: float) -> float:
    """Share of the excess of ``plain`` that is gone with a larger set and is not with a smaller; all mean squares."""
    return (smaller - larger) / (plain - 1.0) if plain > 1.0 else 0.0


def _changes(known: Information, fit: Fit, left_out: Sequence[Group], greatest: float) -> Iterator[tuple[slice, Array]]:
    """The numbers of each group in the white vector, and by how much, at most, the coordinates change without it."""
    problem, jacobian = known.problem, known.jacobian
    for group in left_out:
        part = problem.slices()[group.log]
        width = (part.stop - part.start) // problem.whiteners[group.log].kept
        own = slice(part.start + group.rows.start * width, part.start + group.rows.stop * width)
        rest = known.normal - jacobian[own].T @ jacobian[own]
        change = -np.linalg.lstsq(rest, jacobian[own].T @ fit.residual[own], rcond=1e-12)[0]
        size = float(np.max(np.abs(change), initial=0.0))
        yield own, np.asarray(change * min(1.0, greatest / max(size, 1e-300)))
