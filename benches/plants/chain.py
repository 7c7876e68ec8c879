"""Small bends of a hanging chain of links, in closed form: what the MuJoCo arm truly does, without simulating it.

Links k = 1..n of length h hang from each other by hinges with springs K and dampers C at their upper ends; each hinge
is bent by the same moment. With phi the links' angles from the vertical, D their differences (the hinges' angles) and
G the weight's stiffness, a diagonal matrix,

    (K D^T D + G) phi = D^T (1, ..., 1) M,        tip across = h . phi.

The response to a step of the moment has the mean time h A^-1 B A^-1 f / h A^-1 f, A = K D^T D + G, B = C D^T D: the
first moment of what is still missing, the time constant of a first-order lag. Lags in series add up in it.
Limits: small angles, no inertia (the arm creeps); the chain lengthens above its hinges, equally everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY = 9.81


@dataclass(frozen=True)
class Chain:
    """A chain of n links.

    Attributes:
        link: length of a link, m; ``end``: of what is rigid behind the last one, m.
        masses: (link from 0, distance from its hinge in m, kg), one a mass.
        stiffness: of a hinge, N m/rad; ``damping``: N m s/rad.
    """

    links: int
    link: float
    end: float
    masses: tuple[tuple[int, float, float], ...]
    stiffness: float
    damping: float

    def _solved(self, extension: float, weight: float) -> tuple[Array, Array, Array]:
        """Angles for a unit moment, lever of the tip, stiffness matrix, hinges farther apart by ``extension``, m."""
        n, length = self.links, self.link + extension
        hinges = np.eye(n) - np.eye(n, k=-1)
        weights = np.zeros(n)
        for k, distance, mass in self.masses:
            weights[:k] += mass * GRAVITY * weight * length
            weights[k] += mass * GRAVITY * weight * distance
        matrix = self.stiffness * hinges.T @ hinges + np.diag(weights)
        lever = np.full(n, length)
        lever[-1] = self.link + self.end
        return np.linalg.solve(matrix, hinges.T @ np.ones(n)), lever, matrix

    def across(self, moment: float, extension: float = 0.0, *, weight: float = 1.0) -> float:
        """How far the tip goes across for this moment at each hinge, m; ``weight`` 0: without weight."""
        angles, lever, _ = self._solved(extension, weight)
        return float(lever @ angles) * moment

    def time(self, extension: float = 0.0) -> float:
        """Mean time of the tip's response across, s."""
        angles, lever, matrix = self._solved(extension, 1.0)
        hinges = np.eye(self.links) - np.eye(self.links, k=-1)
        damping = self.damping * hinges.T @ hinges
        return float(lever @ np.linalg.solve(matrix, damping @ angles) / (lever @ angles))

    def shape(self, extension: float = 0.0) -> Array:
        """Each hinge's share of the whole bend; equal shares are an arc."""
        angles, _, _ = self._solved(extension, 1.0)
        bends = np.diff(angles, prepend=0.0)
        return np.asarray(bends / bends.sum())
