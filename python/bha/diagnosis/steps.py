"""How coarse a step of the integration may be: measured by halving it, not assumed.

What: errors of a step against the noise of the outputs, for the plain arm and for one that effects make stiffer.
Validity: the first seconds of every log stand for the whole of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.engine import Engine
from bha.diagnosis.model import Model
from bha.estimation.records import Record

Array = NDArray[np.float64]

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


def noise_of(records: Sequence[Record]) -> float:
    """A typical error of a right model, m: noise of the outputs, and what the arm does otherwise each time."""
    return float(np.median([np.median(np.maximum(r.noise, r.repeat_noise)) for r in records]))


def checked_rows(record: Record) -> int:
    """Rows of a log on which a step is checked."""
    return min(len(record.rows), int(CHECKED_TIME / record.sample_time))


def root_mean_square(first: Sequence[Array], second: Sequence[Array]) -> float:
    """RMS difference of the outputs of two sets of runs, m; NaN where one diverged."""
    return float(np.sqrt(np.mean([np.mean((a - b) ** 2) for a, b in zip(first, second, strict=True)])))


def far_apart(records: Sequence[Record], first: Sequence[Array], second: Sequence[Array], share: float) -> bool:
    """Whether two sets of runs differ by more than ``share`` of the noise, or one of them diverged."""
    return not root_mean_square(first, second) <= share * noise_of(records)


def allowed(share: float, far_off: float, misfit: float) -> float:
    """Greatest error over the noise: ``share``, or that share ``far_off`` of a model's ``misfit`` where it is large."""
    return max(share, far_off * misfit) if FAR_OFF < misfit < np.inf else share


def resolved(
    engine: Engine, records: Sequence[Record], model: Model, x: Array, states: Sequence[Array], misfit: float
) -> Model:
    """``model`` with the coarsest step that its effects at ``x`` allow; ``misfit`` as for :func:`allowed`."""
    engine = engine.once()
    share = allowed(CANDIDATE_ERROR_SHARE, MISFIT_SHARE, misfit)
    runs = model.runs(x, records, states, [checked_rows(r) for r in records])

    def outputs(finer: int) -> list[Array]:
        return engine.run(runs, finer=finer)

    found = {1: outputs(1)}
    for finer in DIVISORS[:-1]:
        found[2 * finer] = outputs(2 * finer)
        if not far_apart(records, found[finer], found[2 * finer], share):
            return replace(model, finer=max(finer, model.finer))
    return replace(model, finer=DIVISORS[-1])
