"""What a fit knows of its coordinates: one normal matrix for all that is asked of it.

What: the white sensitivities beyond what initial states can do, and their normal matrix with the priors. Screening,
prediction of logs that are left out, the gap's allowance for uncertain parameters and the intervals all stand on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import Fit, Problem, prior_precision, project_states

Array = NDArray[np.float64]

#: Added to the diagonal of a normal matrix, as a share of its mean: numbers without prior that nothing tells apart keep
#: it from being singular, and what is left of single precision is smaller.
RIDGE = 1e-10


@dataclass(frozen=True)
class Information:
    """The sensitivities of a fit and their normal matrix.

    Attributes:
        problem: the logs.
        by_states: white sensitivities of each log by its initial state.
        jacobian: by the coordinates, beyond what initial states can do, shape (rows, size).
        normal: their normal matrix, priors and a small ridge included, shape (size, size).
    """

    problem: Problem
    by_states: tuple[Array, ...]
    jacobian: Array
    normal: Array

    @property
    def covariance(self) -> Array:
        """Covariance of the coordinates under white noise, shape (size, size)."""
        return np.asarray(np.linalg.inv(self.normal))

    def beyond(self, table: NDArray[np.floating[Any]]) -> Array:
        """What initial states cannot do of ``table`` (rows, k)."""
        return project_states(self.problem, self.by_states, np.asarray(table, dtype=np.float64))

    def complement(self, table: NDArray[np.floating[Any]]) -> Array:
        """What neither initial states nor the coordinates can do of ``table`` (rows, k)."""
        left = self.beyond(table)
        if self.jacobian.shape[1]:
            left -= self.jacobian @ np.linalg.solve(self.normal, self.jacobian.T @ left)
        return left


def information(problem: Problem, fit: Fit, trust: float | None = None) -> Information:
    """That of a fit with its sensitivities; ``trust`` is the weight of its priors, that of the fit if None."""
    assert fit.jacobian is not None
    assert fit.state_jacobians is not None
    jacobian = project_states(problem, fit.state_jacobians, fit.jacobian)
    normal = jacobian.T @ jacobian + np.diag(prior_precision(fit, trust))
    normal += RIDGE * np.trace(normal) / max(len(normal), 1) * np.eye(len(normal))
    return Information(problem, fit.state_jacobians, jacobian, normal)
