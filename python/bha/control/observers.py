"""Observers: rates of the lengths from length sensors."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


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

    def to_core(self) -> dict[str, Any]:
        """What the core is given."""
        return {"kind": "difference", "cutoff": self.cutoff}


Observer = KalmanFilter | FilteredDifference
