"""Forces and moments from outside, at any point of an arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arrays import floats
from bha.errors import InputError
from bha.support.shown import short_repr

Three = tuple[float, float, float]
_NONE = (0.0, 0.0, 0.0)


@short_repr
@dataclass(frozen=True, eq=False)
class Wrench:
    """A force and a moment that act on an arm at one of its points, beside the ``f_ext`` at the sections' force points.

    The point moves with the arm; the directions of force and moment do not turn with it. Points are named as in
    ``Arm.point_pose`` and ``Arm.jacobian``, by which a wrench makes the generalized force J^T (force, moment).

    Attributes:
        section: number of the section it acts on, from 1.
        force: N, in the frame of ``forward_kinematics`` (the base's, unless the arm has a base pose), shape (3,); where
            it drives a simulation also (samples, 3).
        moment: N m, likewise.
        fraction: where along the section, from 0 (start of its arc; what is before it does not move) to 1 (its head).
        offset: the point, m, in the frame of the arm there, shape (3,).
    """

    section: int
    force: NDArray[np.float64] | Three = _NONE
    moment: NDArray[np.float64] | Three = _NONE
    fraction: float = 1.0
    offset: NDArray[np.float64] | Three = _NONE

    def __post_init__(self) -> None:
        """Look at everything but the section, which is the arm's to know."""
        for name in ("force", "moment"):
            object.__setattr__(self, name, floats(getattr(self, name), f"wrench: {name}", (3,), (None, 3)))
        object.__setattr__(self, "offset", floats(self.offset, "wrench: offset", (3,)))
        fraction = float(floats(self.fraction, "wrench: fraction", ()))
        if not 0.0 <= fraction <= 1.0:
            raise InputError(f"wrench: fraction: {fraction:g}; a number from 0 (start of the section) to 1 (its head)")
        object.__setattr__(self, "fraction", fraction)
