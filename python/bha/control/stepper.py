"""A simulated arm that is stepped from outside, in place of the real one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arrays import floats

if TYPE_CHECKING:
    from bha.arm import Arm


def stable_step(arm: Arm, p: ArrayLike | None = None) -> float:
    """Longest step with which RK4 is stable around rest under pressures ``p`` (ambient if None), with some reserve, s.

    RK4 is stable where step times the fastest eigenvalue of the linearized arm is below about 2.8; this is 2.
    """
    p = np.full(len(arm.inputs), arm.parameters.ambient_pressure) if p is None else floats(p, "p", (len(arm.inputs),))
    q = arm.static_lengths(p)
    a, _ = arm.linearize(q, np.zeros_like(q), p)
    return float(2.0 / np.abs(np.linalg.eigvals(a)).max())


class Stepper(_core.Stepper):
    """A plant for hardware-in-the-loop: ``reset``, then ``step(p, dt)`` again and again.

    Commands pass through the arm's pneumatics. The attributes ``time``, ``lengths``, ``velocities`` and ``pressures``
    are those at the end of the last step. Nothing is allocated in a step but what is returned.
    """

    __slots__ = ("_arm",)
    _arm: Arm

    def __new__(cls, arm: Arm, step: float | None = None) -> Stepper:
        """A plant of ``arm``, at rest under ambient pressure, integrated by RK4 with steps of at most ``step`` s.

        Without ``step`` it is 1 ms, or what :func:`stable_step` gives, if that is less.

        Raises:
            InputError: a step that is not positive.
            ConvergenceError: the arm has no rest under ambient pressure.
        """
        self = super().__new__(cls, arm, min(1e-3, stable_step(arm)) if step is None else step)
        self._arm = arm
        return self

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self._arm

    def reset(
        self, p: ArrayLike | None = None, q: ArrayLike | None = None, qd: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Begin at time 0 and return the first measurement: lengths, then pressures, shape (3n + inputs,).

        Args:
            p: pressures in the chambers and commanded, Pa absolute, shape (inputs,); ambient if None.
            q: lengths, m, shape (3n,); at rest under ``p`` if None.
            qd: rates, m/s, shape (3n,); zero if None.

        Raises:
            InputError: a wrong shape, or a value that is not finite.
            ConvergenceError: there is no rest under ``p``.
        """
        if p is None:
            p = np.full(len(self._arm.inputs), self._arm.parameters.ambient_pressure)
        return super().reset(p, q, qd)
