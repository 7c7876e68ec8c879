"""Prediction of logs that took no part in the fit: open loop, from an initial state estimated on each of them.

What: outputs, error by block, and the test whether one model predicts better than another.
Source: paired signed-rank test of Wilcoxon (1945) on the logarithms of the block errors: a few blocks with large errors
do not decide.
Open loop near the edge of stability a right model may run away while the arm does not; it is compared up to there.
Validity: blocks longer than the errors are correlated, a second where the logs are long enough. In logs below some ten
seconds they are shorter, neighbours are related, and the p-value is too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bha.diagnosis.fit import STATE_SPREAD, Fit, Problem, state_columns, state_units
from bha.diagnosis.model import Model
from bha.diagnosis.where import block_edges

Array = NDArray[np.float64]

#: Length of a block, s, and its least length where the logs are too short for enough of them.
HOLDOUT_BLOCK, SHORTEST_BLOCK = 1.0, 0.3
#: Blocks that a rank test needs: with n of them its least p-value is 2^-n.
ENOUGH_BLOCKS = 10
#: An arm that is this far off has run away, m; what it did in the last second before that does not count either.
RUN_AWAY, BEFORE_RUN_AWAY = 0.3, 1.0
#: Least share of the readings of a block that count, so that it does.
LEAST_COUNTED = 0.3
#: Share of the blocks before a model runs away that is enough to compare it.
LEAST_VALID = 0.4


@dataclass(frozen=True)
class Prediction:
    """A model on the held-out logs.

    Attributes:
        outputs: simulated outputs of each log.
        states: estimated initial states.
        white: white residual of all logs.
        blocks: mean square of the white residual of each block with readings; NaN where the model has run away.
        rms: open-loop error over all logs and channels, m.
        until: time of each log up to which the model has not run away, s; infinite where it never does.
    """

    outputs: tuple[Array, ...]
    states: tuple[Array, ...]
    white: Array
    blocks: Array
    rms: float
    until: tuple[float, ...]

    @property
    def mean_square(self) -> float:
        """Mean square of the white residual; one for a right model, infinite for one that runs away early."""
        valid = np.isfinite(self.blocks)
        return float(np.mean(self.blocks[valid])) if np.mean(valid) >= LEAST_VALID else np.inf


class Holdout:
    """The held-out logs with their whitening and the sensitivities of their initial states."""

    def __init__(self, problem: Problem, states: Sequence[Array]) -> None:
        """The logs and first guesses of their initial states."""
        self.problem = problem
        self._states = tuple(states)
        self._sensitivities: tuple[Array, ...] | None = None

    def predict(self, model: Model, x: Array) -> Prediction:
        """Open-loop prediction; rows from where a run runs away do not count."""
        fit, until = self._evaluate(model, x, self._states)
        if self._sensitivities is None and np.isfinite(fit.cost):
            self._sensitivities = state_columns(self.problem, fit)
        for _ in range(2):
            if self._sensitivities is None or not np.isfinite(fit.cost):
                break
            trial, later = self._evaluate(model, x, self._improved(fit, self._sensitivities))
            if not trial.cost < fit.cost:
                break
            fit, until = trial, later
        return self._prediction(fit, until)

    def _evaluate(self, model: Model, x: Array, states: Sequence[Array]) -> tuple[Fit, tuple[float, ...]]:
        """The model at ``x``; where it has run away the outputs are those measured, so that nothing is made of them."""
        outputs, until = [], []
        for record, y in zip(self.problem.records, self.problem.simulate(model, x, states), strict=True):
            far = ~np.all(np.abs(y - record.measured) < RUN_AWAY, axis=1)
            time = record.time
            end = float(time[np.argmax(far)]) - BEFORE_RUN_AWAY if np.any(far) else np.inf
            outputs.append(np.where((time < end)[:, None], y, record.measured))
            until.append(end)
        residual = self.problem.residual(outputs)
        return Fit(model, x, tuple(states), tuple(outputs), residual, float(residual @ residual)), tuple(until)

    def _improved(self, fit: Fit, sensitivities: Sequence[Array]) -> list[Array]:
        units = state_units(len(fit.states[0]) // 2)
        states = []
        for part, jacobian, state in zip(self.problem.slices(), sensitivities, fit.states, strict=True):
            # A model with a gap errs everywhere; the state must not bend to it more than it is uncertain.
            weight = max(1.0, float(np.mean(fit.residual[part] ** 2)))
            normal = jacobian.T @ jacobian / weight + np.eye(jacobian.shape[1]) / STATE_SPREAD**2
            states.append(state + np.linalg.solve(normal, jacobian.T @ fit.residual[part] / weight) * units)
        return states

    def _prediction(self, fit: Fit, until: tuple[float, ...]) -> Prediction:
        squares, count = 0.0, 0
        blocks: list[float] = []
        length = block_length([float(np.ptp(w.time)) for w in self.problem.whiteners])
        for record, whitener, part, y, end in zip(
            self.problem.records, self.problem.whiteners, self.problem.slices(), fit.outputs, until, strict=True
        ):
            error = (record.measured - y)[record.usable & (record.time < end)[:, None]]
            squares += float(np.sum(error**2))
            count += error.size
            white = fit.residual[part].reshape(whitener.kept, -1)
            share = np.interp(whitener.time, record.time, np.mean(record.usable, axis=1))
            for s in block_edges(whitener.time, length):
                counted = float(np.mean(share[s]))
                # What does not count is zero in the white rows. A block without readings says nothing, of any model.
                if counted >= LEAST_COUNTED:
                    square = float(np.mean(white[s] ** 2)) / counted
                    blocks.append(square if whitener.time[s][-1] < end else np.nan)
        rms = float(np.sqrt(squares / count)) if count else np.inf
        return Prediction(fit.outputs, fit.states, fit.residual, np.array(blocks), rms, until)


def block_length(durations: Sequence[float]) -> float:
    """Length of the blocks of logs of these durations, s: shorter than usual where a rank test had too few."""
    return float(np.clip(sum(durations) / ENOUGH_BLOCKS, SHORTEST_BLOCK, HOLDOUT_BLOCK))


def both(first: Prediction, second: Prediction) -> tuple[Array, Array]:
    """Blocks of two predictions in which neither model has run away; none if they are too few."""
    valid = np.isfinite(first.blocks) & np.isfinite(second.blocks)
    if np.mean(valid) < LEAST_VALID:
        valid[:] = False
    return first.blocks[valid], second.blocks[valid]


def better(without: Prediction, with_it: Prediction) -> float:
    """One-sided p-value that the second prediction is no better than the first."""
    before, after = both(without, with_it)
    difference = np.log(before) - np.log(after)
    if len(difference) == 0 or np.all(np.abs(difference) < 1e-12):
        return 1.0
    return float(stats.wilcoxon(difference, alternative="greater").pvalue)


def excesses(*predictions: Prediction) -> list[float]:
    """Mean square above that of noise of several predictions, over the blocks in which no model has run away.

    The mean is geometric, over blocks: near the edge of stability a few blocks of a right model may hold more error
    than all others together.
    """
    valid = np.all([np.isfinite(p.blocks) for p in predictions], axis=0)
    if np.mean(valid) < LEAST_VALID:
        return [0.0 for _ in predictions]
    return [max(0.0, float(np.exp(np.mean(np.log(p.blocks[valid])))) - 1.0) for p in predictions]


def thinned(prediction: Prediction, factor: int) -> Prediction:
    """The prediction with every ``factor``-th row, for figures."""
    return replace(prediction, outputs=tuple(y[::factor] for y in prediction.outputs))
