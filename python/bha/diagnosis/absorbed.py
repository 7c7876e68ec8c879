"""What a fit makes of errors that follow nothing: less of them on its own logs, more on others.

What: an arm that is pushed by what no log holds errs slowly, and slow errors are few independent numbers. A fit bends
its parameters to them: what is left on its own logs is less than what the disturbance does, and on others the
parameters that are wrong by as much err beside it, and that follows the pose. Draws of errors are therefore fitted as
the errors were, by the sensitivities on all cells and the priors, before anything is read from them.
Limits: to first order; initial states are not fitted with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import Fit, Problem, prior_precision, sensitivities
from bha.diagnosis.holdout import Holdout, Prediction
from bha.diagnosis.information import information
from bha.errors import ConvergenceError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Absorption:
    """How parameters answer to errors in cells.

    Attributes:
        slopes: of what the model shows, by the coordinates, cells of all logs one after the other, shape (g, C, K).
        own: which cells are of logs of the fit, shape (g,).
        weights: of a squared error in each channel, 1/m^2, shape (C,).
        precision: of the priors, shape (K,).
    """

    slopes: Array
    own: NDArray[np.bool_]
    weights: Array
    precision: Array

    def left(self, errors: Array) -> Array:
        """What a fit leaves of draws of errors, m, shape (g, draws, C)."""
        told = self.slopes[self.own]
        weighted = told * self.weights[:, None]
        normal = np.einsum("gck,gcl->kl", weighted, told, optimize=True) + np.diag(self.precision)
        scores = np.einsum("gck,gdc->kd", weighted, errors[self.own], optimize=True)
        change = np.linalg.lstsq(normal, scores, rcond=1e-12)[0]
        return np.asarray(errors - np.einsum("gck,kd->gdc", self.slopes, change, optimize=True))

    def grown(self, left: Array) -> Array:
        """RMS of what is left on logs held out over that on those of the fit, shape (draws,); one without either."""
        if np.all(self.own) or not np.any(self.own):
            return np.ones(left.shape[1])
        before, after = (np.sqrt(np.mean(left[which] ** 2, axis=(0, 2))) for which in (self.own, ~self.own))
        return np.asarray(after / np.maximum(before, 1e-300))


def slopes_on(problem: Problem, fit: Fit, holdout: Holdout, prediction: Prediction) -> tuple[Array, ...] | None:
    """The sensitivities of a model on the logs of its fit and on those held out, one after the other; None for none."""
    try:
        own = sensitivities(problem, fit, fit.states)
        found = (*own, *sensitivities(holdout.problem, fit, prediction.states))
    except ConvergenceError:
        return None
    return found if all(np.all(np.isfinite(table)) for table in found) else None


def absorption(problem: Problem, fit: Fit, slopes: Sequence[Array], own: Sequence[bool]) -> Absorption:
    """How the parameters of a fit answer to errors in cells.

    Args:
        problem: the logs of the fit.
        fit: the model, with its sensitivities.
        slopes: in the cells of each log, shape (g, C, K).
        own: which of these are logs of the fit.
    """
    noise = np.mean([record.noise for record in problem.records], axis=0)
    table = np.concatenate(slopes)
    which = np.repeat(own, [len(part) for part in slopes])
    weights = 1.0 / noise**2
    # As many numbers as the fit has had: a cell is the mean of several, and of what is filtered.
    told = float(np.sum(information(problem, fit).jacobian ** 2))
    here = float(np.sum(table[which] ** 2 * weights[:, None]))
    return Absorption(table, which, weights * told / max(here, 1e-300), prior_precision(fit))
