"""Observers: rates of the lengths from length sensors."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from bha.errors import InputError


@dataclass(frozen=True)
class KalmanFilter:
    """A Kalman filter on the controller's model, with its steady-state gain at the pose where it starts.

    It also estimates the acceleration that the model does not explain, as a random walk.

    Attributes:
        length_noise: standard deviation of measured lengths, m.
        pressure_noise: standard deviation of measured pressures, Pa.
        acceleration_noise: standard deviation, period by period, of accelerations that the model lacks, m/s^2.
        disturbance_noise: wandering of the unexplained acceleration in one second, m/s^2.
        renewal: periods after which the gain is computed anew at the present estimate; 0: never.
    """

    length_noise: float = 1e-4
    pressure_noise: float = 200.0
    acceleration_noise: float = 2.0
    disturbance_noise: float = 10.0
    renewal: int = 0

    def __post_init__(self) -> None:
        """Check that they are numbers."""
        _check(self, "length_noise", "pressure_noise", "acceleration_noise", "disturbance_noise")
        if not isinstance(self.renewal, int) or self.renewal < 0:
            raise InputError(f"KalmanFilter: renewal is {self.renewal!r}; a whole number from 0 on is needed")

    def to_core(self) -> dict[str, Any]:
        """What the core is given."""
        return {"kind": "kalman", **asdict(self)}


@dataclass(frozen=True)
class FilteredDifference:
    """Differences of the measured lengths through a first-order low pass.

    Attributes:
        cutoff: corner frequency of the low pass, rad/s.
    """

    cutoff: float = 150.0

    def __post_init__(self) -> None:
        """Check that it is a number."""
        _check(self, "cutoff")

    def to_core(self) -> dict[str, Any]:
        """What the core is given."""
        return {"kind": "difference", "cutoff": self.cutoff}


def _check(observer: KalmanFilter | FilteredDifference, *names: str) -> None:
    """Numbers that are finite and not below zero; the core says where zero is none."""
    for name in names:
        value = getattr(observer, name)
        try:
            good = math.isfinite(value) and value >= 0
        except TypeError:
            good = False
        if not good:
            found = repr(value)[:60]
            raise InputError(f"{type(observer).__name__}: {name} is {found}; a number not below zero is needed")


Observer = KalmanFilter | FilteredDifference
