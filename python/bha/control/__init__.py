"""Control of an arm: references, controllers and observers that run in the core, closed loops, and stepping from
outside.

A controller holds a model of its own, an :class:`bha.Arm` that need not be the plant's. Everything that runs every
period runs in the compiled core; a Python function ``controller(t, y) -> p`` can stand in for it.
"""

from bha.control.controller import Controller
from bha.control.controllers import (
    FeedbackLinearization,
    GravityPd,
    LinearQuadraticRegulator,
    Pid,
    StaticModel,
)
from bha.control.limits import Limits
from bha.control.linear_system import state_space
from bha.control.loop import ClosedLoopRun, Sensors, simulate_closed_loop
from bha.control.margins import LinearLoop, linear_loop
from bha.control.motions import hold, point_to_point, there_and_back, tip_circle, tip_line, tip_path, tip_samples
from bha.control.observers import FilteredDifference, KalmanFilter
from bha.control.reach import Reachability, reachability
from bha.control.reference import Reference
from bha.control.stepper import Stepper

__all__ = [
    "ClosedLoopRun",
    "Controller",
    "FeedbackLinearization",
    "FilteredDifference",
    "GravityPd",
    "KalmanFilter",
    "Limits",
    "LinearLoop",
    "LinearQuadraticRegulator",
    "Pid",
    "Reachability",
    "Reference",
    "Sensors",
    "StaticModel",
    "Stepper",
    "hold",
    "linear_loop",
    "point_to_point",
    "reachability",
    "simulate_closed_loop",
    "state_space",
    "there_and_back",
    "tip_circle",
    "tip_line",
    "tip_path",
    "tip_samples",
]
