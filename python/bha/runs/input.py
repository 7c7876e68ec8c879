"""What drives an arm: pressures and external forces, sampled at irregular times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arm.wrench import Wrench
from bha.arrays import floats
from bha.errors import InputError
from bha.support.shown import short_repr

Interpolation = Literal["linear", "hold"]


@short_repr
@dataclass(frozen=True)
class Input:
    """What drives an arm: pressures and, optionally, external forces, sampled at irregular times.

    Attributes:
        time: sample times, s, shape (m,), ascending; two equal times are a jump.
        pressures: Pa absolute, shape (m, inputs), in the order of ``arm.inputs``.
        forces: force at each section's centre of mass (or ``force_point``) in the world, N, shape (m, n, 3), or None.
        commanded: whether the pressures are commands, which act through the arm's pneumatics; else they are those in
            the bellows and act as they are.
        interpolation: what holds between two samples, the straight line (``"linear"``) or the earlier one (``"hold"``).
        wrenches: forces and moments anywhere, constant or with a row a sample.
    """

    time: NDArray[np.float64]
    pressures: NDArray[np.float64]
    forces: NDArray[np.float64] | None = None
    commanded: bool = True
    interpolation: Interpolation = "linear"
    wrenches: tuple[Wrench, ...] = ()

    def __post_init__(self) -> None:
        """Look at what holds between two samples; the core looks at the numbers."""
        if self.interpolation not in get_args(Interpolation):
            raise InputError(f'interpolation: {self.interpolation!r}; "linear" or "hold" are allowed')

    @property
    def force_rows(self) -> NDArray[np.float64] | None:
        """The forces with one row a sample, N, shape (m, 3n), or None."""
        return None if self.forces is None else np.reshape(self.forces, (len(self.time), -1))

    def in_core(self, interpolation: Interpolation | None = None, name: str = "") -> _core.Input:
        """The core's own copy as it is now, to be made once and passed as often as wanted.

        Args:
            interpolation: what holds between two samples, in place of what the input says.
            name: what goes before the names of the arrays in errors.

        Raises:
            InputError: sizes that do not fit, times that run backwards, values that are not allowed.
        """
        return _core.Input(
            self.time,
            self.pressures,
            self.force_rows,
            self.wrenches,
            interpolation=interpolation or self.interpolation,
            name=name,
        )

    @classmethod
    def constant(cls, pressures: ArrayLike, duration: float) -> Input:
        """The same ``pressures`` (inputs,), Pa absolute, from 0 to ``duration`` s.

        Raises:
            InputError: a negative pressure.
        """
        row = floats(pressures, "pressures", (None,))
        # As the core says it of what is simulated, where it is written down.
        if (row < 0.0).any():
            k = int(np.argmax(row < 0.0))
            raise InputError(
                f"pressures: element {k} is {row[k]:g} Pa; pressures are absolute and not negative. Is this gauge "
                "pressure? Then add the ambient pressure"
            )
        return cls(np.array([0.0, duration]), np.vstack([row, row]))
