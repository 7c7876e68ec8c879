"""What pressures and lengths a controller may use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.errors import InputError
from bha.support.shown import short_repr

if TYPE_CHECKING:
    from bha.arm import Arm


@short_repr
@dataclass(frozen=True)
class Limits:
    """Limits of the pressures and lengths of an arm.

    Attributes:
        low: lowest pressure of each input, Pa absolute, shape (inputs,).
        high: highest pressure of each input, Pa absolute, shape (inputs,).
        preferred: pressure that each input tends to where the wanted force leaves a choice (more bellows than
            coordinates, an input that moves nothing), Pa absolute, shape (inputs,). A higher one stiffens the arm.
        shortest: shortest of each length, m, shape (3n,).
        longest: longest of each length, m, shape (3n,).
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    preferred: NDArray[np.float64]
    shortest: NDArray[np.float64]
    longest: NDArray[np.float64]

    @classmethod
    def of(cls, arm: Arm, *, preferred: float | None = None) -> Limits:
        """The limits that the parameter file gives: ``pressure_range`` and ``length_range`` of each section.

        An input that feeds several sections keeps to the limits of all. ``preferred`` (Pa absolute, the same for all
        inputs) is the middle of the range if None.

        Raises:
            InputError: the ranges of sections with a common input do not overlap.
        """
        index = {name: k for k, name in enumerate(arm.inputs)}
        low, high = np.zeros(len(index)), np.full(len(index), np.inf)
        for number, section in enumerate(arm.parameters.sections, start=1):
            for bellows in section.resolved_bellows(number):
                k = index[bellows.input]
                low[k] = max(low[k], section.pressure_range[0])
                high[k] = min(high[k], section.pressure_range[1])
        for name, k in index.items():
            if low[k] >= high[k]:
                raise InputError(
                    f"pressure_range: input {name} feeds sections whose ranges have no pressure in common, "
                    f"{low[k]} to {high[k]} Pa"
                )
        middle = (low + high) / 2 if preferred is None else np.clip(np.full(len(index), float(preferred)), low, high)
        lengths = np.repeat([section.length_range for section in arm.parameters.sections], 3, axis=0)
        return cls(low, high, middle, lengths[:, 0], lengths[:, 1])

    @property
    def middle(self) -> NDArray[np.float64]:
        """The middle of each length's range, m, shape (3n,)."""
        return (self.shortest + self.longest) / 2

    def rest_near(self, arm: Arm, lengths: ArrayLike) -> _core.Rest:
        """Pressures within the limits under which ``arm`` rests nearest to ``lengths`` (3n,), m, and where it then is.

        Raises:
            ConvergenceError: it rests nowhere near.
        """
        return _core.rest_near(arm, lengths, self.low, self.high, self.preferred)

    def resolved(
        self, arm: Arm, tips: ArrayLike, directions: ArrayLike | None = None, start: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Lengths within the limits that bring ``arm``'s tip to ``tips`` (k, 3), m, row by row, shape (k, 3n).

        Args:
            arm: the arm.
            tips: positions of the last head in the base frame.
            directions: of its z axis, shape (k, 3); None: left free.
            start: lengths from which the first row is sought; None: the middle.

        Raises:
            ConvergenceError: a row is out of reach; the text names it.
        """
        first = self.middle if start is None else start
        return _core.resolved_motion(arm, tips, directions, first, self.shortest, self.longest)
