"""A simulated arm that is stepped from outside, in place of the real one; and how arms are stepped at all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arrays import floats
from bha.control.limits import Limits

if TYPE_CHECKING:
    from bha.arm import Arm

#: Longest step that a plant takes by itself, s.
USUAL_STEP = 1e-3

#: How a plant is integrated.
SteppingMethod = Literal["rk4", "ros2"]


def stable_step(arm: Arm, p: ArrayLike | None = None) -> float:
    """Longest step with which RK4 is stable around rest under pressures ``p``, with some reserve, s.

    Ambient pressures if ``p`` is None. With pneumatics at most the 2 ms that these allow.
    """
    p = np.full(len(arm.inputs), arm.parameters.ambient_pressure) if p is None else floats(p, "p", (len(arm.inputs),))
    return _core.plan_steps(arm, p[None], "rk4", None, float("inf")).step


def plan_steps(
    arm: Arm, *, method: str | None = None, step: float | None = None, usual: float = USUAL_STEP
) -> tuple[str, float]:
    """Method and longest step, s, that are stable for ``arm`` under all pressures within its ranges.

    Stability is judged at rest under the lowest, the highest and the middle pressures and, where a step is not far from
    the limit there, with each input alone at its highest and alone at its lowest.

    Args:
        arm: the arm.
        method: ``"rk4"``, ``"ros2"`` or ``"symplectic_euler"``; None: ``"rk4"``, or ``"ros2"`` where it costs less
            since the arm is stiff.
        step: longest step, s; None: ``usual``, or less where the method needs it. Without ``method`` a stiff arm may
            take shorter ones than this.
        usual: longest step where none is given, s.

    Raises:
        InputError: a step that is not positive, or with which the explicit method asked for is not stable.
        ConvergenceError: the arm has no rest under any of the pressures.
    """
    found = Limits.of(arm)
    corners = [found.low, found.high, (found.low + found.high) / 2]
    alone = np.eye(len(arm.inputs), dtype=bool)
    rows = [*corners, *np.where(alone, found.high, found.low), *np.where(alone, found.low, found.high)]
    plan = _core.plan_steps(arm, np.array(rows), method, step, usual)
    return plan.method, plan.step


class Stepper(_core.Stepper):
    """A plant for hardware-in-the-loop: ``reset``, then ``step(p, dt)`` again and again.

    Commands pass through the arm's pneumatics. What ``reset`` and ``step`` return is what sensors have: lengths with
    the arm's own effects on sensors (the attribute ``measured_lengths``), then pressures in the chambers. The
    attributes ``time``, ``lengths``, ``velocities`` and ``pressures`` are the truth at the end of the last step.
    Nothing is allocated in a step but what is returned. A stepper pickles and copies as it stands, hidden states
    included.
    """

    __slots__ = ("_arm", "_plan")
    _arm: Arm
    _plan: tuple[str, float]

    def __new__(cls, arm: Arm, step: float | None = None, *, method: SteppingMethod | None = None) -> Stepper:
        """A plant of ``arm``, at rest under ambient pressure.

        Args:
            arm: the arm.
            step: longest step of the integration, s; None: 1 ms, or less where the arm needs it.
            method: ``"rk4"``, or ``"ros2"``, linearly implicit for stiff arms; None: RK4, or ``ros2`` where RK4 would
                need so short steps that this costs less.

        Raises:
            InputError: a step that is not positive, or with which ``"rk4"``, asked for, is not stable.
            ConvergenceError: the arm has no rest under ambient pressure.
        """
        return cls._planned(arm, plan_steps(arm, method=method, step=step))

    @classmethod
    def _planned(cls, arm: Arm, plan: tuple[str, float], state: NDArray[np.float64] | None = None) -> Stepper:
        self = super().__new__(cls, arm, plan[1], plan[0])
        self._arm, self._plan = arm, plan
        if state is not None:
            self._resume(state)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as arm, plan and state; what goes on from there is the same to the last digit."""
        return (type(self)._planned, (self._arm, self._plan, self._state))

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self._arm

    @property
    def method(self) -> str:
        """How it is integrated: ``"rk4"`` or ``"ros2"``."""
        return self._plan[0]

    @property
    def longest_step(self) -> float:
        """Longest step of the integration, s."""
        return self._plan[1]

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

    def __repr__(self) -> str:
        """Arm, method and time in one line."""
        return f"<Stepper of {self._arm.name!r}: {self.method}, {self.longest_step:.2g} s, at t = {self.time:.6g} s>"
