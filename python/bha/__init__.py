"""Simulate, identify, diagnose and control pneumatic bellows arms (Falkenhahn et al., IEEE T-RO 31(6), 2015)."""

# Before all that takes time: see there.
from bha import startup as startup

# isort: split

from bha import robots
from bha._core import __version__
from bha.arm import Arm
from bha.batch import Batch, simulate_batch
from bha.checkup import Checkup, check
from bha.derivatives import Derivatives, Sensitivities, parameter_names, sensitivities
from bha.diagnose import diagnose
from bha.errors import (
    BhaError,
    ConvergenceError,
    FileError,
    FileWarning,
    InputError,
    LogError,
    LogWarning,
    MissingExtraError,
    ParameterError,
    ParameterWarning,
    SimulationError,
)
from bha.log import Log
from bha.recordings import Recording
from bha.simulation import Input, Options, Simulation, simulate
from bha.trajectory import Trajectory, TrajectoryWriter

__all__ = [
    "Arm",
    "Batch",
    "BhaError",
    "Checkup",
    "ConvergenceError",
    "Derivatives",
    "FileError",
    "FileWarning",
    "Input",
    "InputError",
    "Log",
    "LogError",
    "LogWarning",
    "MissingExtraError",
    "Options",
    "ParameterError",
    "ParameterWarning",
    "Recording",
    "Sensitivities",
    "Simulation",
    "SimulationError",
    "Trajectory",
    "TrajectoryWriter",
    "__version__",
    "check",
    "diagnose",
    "parameter_names",
    "robots",
    "sensitivities",
    "simulate",
    "simulate_batch",
]
