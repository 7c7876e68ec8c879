"""What a controller is: an immutable description; :meth:`Controller.build` makes one that runs in the core."""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from bha import _core
from bha.control.limits import Limits
from bha.control.observers import KalmanFilter, Observer
from bha.control.working_point import Feedback, WorkingPoint
from bha.errors import InputError

if TYPE_CHECKING:
    from bha.arm import Arm

USUAL_PERIOD = 1e-3
"""Control period that is meant where none is given, s."""


@dataclass(frozen=True)
class Controller(ABC):
    """What all controllers have in common.

    Attributes:
        arm: the controller's model.
        observer: where the rates come from; None: a Kalman filter for laws with a model, differences for ``Pid``.
        limits: limits of pressures; None: those of the arm's parameter file.
        lead_time: time constant of the pressures that the controller takes back, s: it adds that much of the rate of
            the pressures that the reference alone asks for. None: that of the model's pneumatics; 0 leaves it out.
    """

    arm: Arm
    observer: Observer | None = field(default=None, kw_only=True)
    limits: Limits | None = field(default=None, kw_only=True)
    lead_time: float | None = field(default=None, kw_only=True)

    @abstractmethod
    def law(self, period: float = USUAL_PERIOD) -> dict[str, Any]:
        """The law with its gains for a control period, s, as the core takes it."""

    @abstractmethod
    def feedback(self, point: WorkingPoint, period: float = USUAL_PERIOD) -> Feedback:
        """What the law does to small deviations around rest at ``point``, which is the controller's model's."""

    def default_observer(self) -> Observer:
        """The observer where none is given."""
        return KalmanFilter()

    def model(self) -> Arm:
        """The arm that the core computes with."""
        return self.arm

    def build(self, period: float) -> _core.Controller:
        """A controller under way with a control period of ``period`` s.

        Raises:
            InputError: a gain or a period that is not allowed.
        """
        if not (math.isfinite(period) and period > 0):
            raise InputError(f"controller: period is {period}; a positive number of seconds is needed")
        limits = self.limits or Limits.of(self.arm)
        observer = self.observer or self.default_observer()
        parameters = {
            "period": period,
            "law": self.law(period),
            "observer": observer.to_core(),
            "limits": {name: getattr(limits, name).tolist() for name in ("low", "high", "preferred")},
            "lead_time": pressure_time(self.arm) if self.lead_time is None else self.lead_time,
        }
        try:
            text = json.dumps(parameters, allow_nan=False)
        except (TypeError, ValueError):
            raise InputError(
                f"{type(self).__name__}: all gains and times must be finite numbers, found {self!r}"
            ) from None
        return _core.Controller(self.model(), text)


def pressure_time(arm: Arm) -> float:
    """Time constant with which pressures follow small commands by the arm's own pneumatics, s; 0 for ideal ones."""
    table = arm.parameters.pneumatics
    if table is None or table.level == "ideal":
        return 0.0
    if table.level == "lag":
        assert table.fill_time is not None
        assert table.vent_time is not None
        return (table.fill_time + table.vent_time) / 2
    assert table.proportional_gain is not None
    assert table.spool_time is not None
    return table.spool_time + (1 / table.proportional_gain if table.proportional_gain > 0 else 0.0)
