"""One run of an arm: what drives it, how it is integrated, what comes out and how that is written."""

from bha.runs.input import Input, Interpolation
from bha.runs.options import Method, Options
from bha.runs.simulation import Simulation
from bha.runs.trajectory import Trajectory, TrajectoryWriter

__all__ = ["Input", "Interpolation", "Method", "Options", "Simulation", "Trajectory", "TrajectoryWriter"]
