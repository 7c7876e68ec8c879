"""Where held-out logs ask for what the logs of the fit do not tell: an arm stretched farther, bent the other way.

What: the variance that the plain model's open numbers give the errors of each block of the held-out logs,
diag(J C J^T), over that of the noise. Where it is above a quarter a right model errs by half of the noise, and a
wrong one by anything: a spring law beyond the lengths that were fitted. Such blocks say nothing of any model and do
not count, for none; the result says which they are.
Source: propagation of the covariance of least squares. Limits: to first order, about the plain fit; at least half of
the readings count in any case.
"""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import Problem, project_states, state_columns
from bha.diagnosis.holdout import Block, Holdout
from bha.diagnosis.information import information
from bha.recordings.ranges import stretches
from bha.support.spans import spans_of

if TYPE_CHECKING:
    from bha.diagnosis.refit import Trial

Array = NDArray[np.float64]

#: Variance over that of noise from which a block does not count, and the least share of readings that count.
OPEN, LEAST = 0.25, 0.5


def where_told(problem: Problem, plain: Trial) -> tuple[Holdout, str]:
    """The held-out logs with errors counted where the logs of the fit tell the plain model, and which part is not.

    Args:
        problem: the logs of the fit.
        plain: the plain model on both.
    """
    holdout, fit = plain.holdout, plain.fit
    here, spread = holdout.slopes(fit, plain.prediction.states)
    if not np.isfinite(here.cost):
        return holdout, ""
    # What initial states take up, each log's own, is none.
    spread = project_states(holdout.problem, state_columns(holdout.problem, here), spread)
    covariance = information(problem, fit).covariance
    parts = holdout.problem.split(np.einsum("ij,jk,ik->i", spread, covariance, spread, optimize=True))
    told = [block for block in holdout.blocks if np.mean(parts[block.log][block.white]) <= OPEN]
    every = sum(block.count for block in holdout.blocks)
    if len(told) == len(holdout.blocks) or sum(block.count for block in told) < LEAST * every:
        return holdout, ""
    return holdout.counted_in(told), _in_words(holdout, [block for block in holdout.blocks if block not in told])


def _in_words(holdout: Holdout, aside: list[Block]) -> str:
    found = []
    for log, own in groupby(aside, key=lambda block: block.log):
        record = holdout.readings.records[log]
        left = np.zeros(len(record), dtype=np.bool_)
        for block in own:
            left[block.readings] = True
        time = record.time
        spans = [(float(time[a]), float(time[b - 1])) for a, b in spans_of(left)]
        found.append(f"{record.name} {stretches(spans, float(time[0]))}")
    return f"not counted, as the logs of the fit do not tell what the arm does there: {', '.join(found)}"
