"""Prediction of logs that took no part in the fit: open loop, from an initial state estimated on each of them.

What: outputs, error by block, and the test whether one model predicts better than another.
Source: paired signed-rank test of Wilcoxon (1945) on the logarithms of the block errors: a few blocks with large errors
do not decide.
Validity: blocks longer than the errors are correlated, a second where the logs are long enough. In logs below some ten
seconds they are shorter, neighbours are related, and the p-value is too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bha.diagnose.fit import STATE_SPREAD, Fit, Problem, evaluate, state_columns, state_units
from bha.diagnose.model import Model
from bha.diagnose.where import block_edges

Array = NDArray[np.float64]

#: Length of a block, s, and its least length where the logs are too short for enough of them.
HOLDOUT_BLOCK, SHORTEST_BLOCK = 1.0, 0.3
#: Blocks that a rank test needs: with n of them its least p-value is 2^-n.
ENOUGH_BLOCKS = 10


@dataclass(frozen=True)
class Prediction:
    """A model on the held-out logs.

    Attributes:
        outputs: simulated outputs of each log.
        states: estimated initial states.
        white: white residual of all logs.
        blocks: mean square of the white residual of each block.
        rms: open-loop error over all logs and channels, m.
    """

    outputs: tuple[Array, ...]
    states: tuple[Array, ...]
    white: Array
    blocks: Array
    rms: float

    @property
    def mean_square(self) -> float:
        """Mean square of the white residual; one for a right model."""
        return float(np.mean(self.white**2))


class Holdout:
    """The held-out logs with their whitening and the sensitivities of their initial states."""

    def __init__(self, problem: Problem, states: Sequence[Array]) -> None:
        """The logs and first guesses of their initial states."""
        self.problem = problem
        self._states = tuple(states)
        self._sensitivities: tuple[Array, ...] | None = None

    def predict(self, model: Model, x: Array) -> Prediction:
        """Open-loop prediction; a run that diverges gives infinite errors."""
        fit = evaluate(self.problem, model, x, self._states)
        if self._sensitivities is None and np.isfinite(fit.cost):
            self._sensitivities = state_columns(self.problem, fit)
        for _ in range(2):
            if self._sensitivities is None or not np.isfinite(fit.cost):
                break
            trial = evaluate(self.problem, model, x, self._improved(fit, self._sensitivities))
            if not trial.cost < fit.cost:
                break
            fit = trial
        return self._prediction(fit)

    def _improved(self, fit: Fit, sensitivities: Sequence[Array]) -> list[Array]:
        units = state_units(len(fit.states[0]) // 2)
        states = []
        for part, jacobian, state in zip(self.problem.slices(), sensitivities, fit.states, strict=True):
            # A model with a gap errs everywhere; the state must not bend to it more than it is uncertain.
            weight = max(1.0, float(np.mean(fit.residual[part] ** 2)))
            normal = jacobian.T @ jacobian / weight + np.eye(jacobian.shape[1]) / STATE_SPREAD**2
            states.append(state + np.linalg.solve(normal, jacobian.T @ fit.residual[part] / weight) * units)
        return states

    def _prediction(self, fit: Fit) -> Prediction:
        squares, count = 0.0, 0
        blocks: list[float] = []
        length = block_length([float(np.ptp(w.time)) for w in self.problem.whiteners])
        for record, whitener, part, y in zip(
            self.problem.records, self.problem.whiteners, self.problem.slices(), fit.outputs, strict=True
        ):
            error = (record.outputs - y)[record.good]
            squares += float(np.sum(error**2)) if np.all(np.isfinite(error)) else np.inf
            count += error.size
            white = fit.residual[part].reshape(whitener.kept, -1)
            blocks += [float(np.mean(white[s] ** 2)) for s in block_edges(whitener.time, length)]
        values = np.nan_to_num(np.array(blocks), nan=1e12, posinf=1e12)
        return Prediction(fit.outputs, fit.states, fit.residual, values, float(np.sqrt(squares / max(count, 1))))


def block_length(durations: Sequence[float]) -> float:
    """Length of the blocks of logs of these durations, s: shorter than usual where a rank test had too few."""
    return float(np.clip(sum(durations) / ENOUGH_BLOCKS, SHORTEST_BLOCK, HOLDOUT_BLOCK))


def better(without: Prediction, with_it: Prediction) -> float:
    """One-sided p-value that the second prediction is no better than the first."""
    difference = np.log(without.blocks) - np.log(with_it.blocks)
    if np.all(np.abs(difference) < 1e-12):
        return 1.0
    return float(stats.wilcoxon(difference, alternative="greater").pvalue)


def thinned(prediction: Prediction, factor: int) -> Prediction:
    """The prediction with every ``factor``-th row, for figures."""
    return replace(prediction, outputs=tuple(y[::factor] for y in prediction.outputs))
