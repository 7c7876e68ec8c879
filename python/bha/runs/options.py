"""How to integrate: method, steps and tolerances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bha import _core
from bha.errors import InputError
from bha.runs.input import Interpolation

Method = Literal["auto", "dopri5", "rodas4", "rk4", "ros2"]

#: The greatest number of steps that the core counts.
MOST_STEPS = 2**63 - 1


@dataclass(frozen=True)
class Options:
    """How to integrate. What is not allowed raises an :class:`InputError` when the options are made.

    Attributes:
        method: ``"auto"``, which is ``"rodas4"`` for arms whose damping makes them stiff, ``"dopri5"`` for others; or
            one by name: ``"dopri5"``, adaptive Dormand-Prince 5(4); ``"rodas4"``, adaptive Rosenbrock 4(3), linearly
            implicit; ``"rk4"``, fixed step; ``"ros2"``, linearly implicit with fixed step.
        step: longest step of ``rk4`` and ``ros2``, s; steps end on every output and on every jump of the input.
        rtol: relative tolerance of adaptive methods.
        atol: absolute tolerance of adaptive methods, m and m/s; ``rodas4`` allows 100 times as much for rates.
        min_step: shortest step of adaptive methods, s; needing a shorter one is an error.
        max_step: longest step of adaptive methods, s.
        max_steps: most steps in all, at least 1; None is no limit.
        interpolation: what holds between two samples, in place of what the input says; as it says if None.
    """

    method: Method = "auto"
    step: float = 1e-3
    rtol: float = 1e-6
    atol: float = 1e-8
    min_step: float = 1e-10
    max_step: float = float("inf")
    max_steps: int | None = None
    interpolation: Interpolation | None = None

    def __post_init__(self) -> None:
        """Have the core look at all of them."""
        limits = (self.step, self.rtol, self.atol, self.min_step, self.max_step)
        try:
            _core.check_options(self.method, *limits, self.max_steps, self.interpolation)
        except OverflowError:
            raise InputError(f"max_steps: {self.max_steps}; allowed: 1 to {MOST_STEPS}, or none for no limit") from None
        except TypeError as error:
            raise InputError(f"options: {error}; see bha.Options for what is allowed") from None
