"""Simulate, identify, diagnose and control pneumatic bellows arms (Falkenhahn et al., IEEE T-RO 31(6), 2015)."""

# Before all that takes time: see there.
from bha.support import startup as startup

# isort: split

from typing import TYPE_CHECKING

from bha import robots
from bha._core import __version__
from bha.arm import Arm, Wrench
from bha.arm.derivatives import Derivatives
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
from bha.logs import Log
from bha.recordings import Recording
from bha.runs import Input, Options, Simulation, Trajectory, TrajectoryWriter
from bha.simulation import (
    Batch,
    Sensitivities,
    parameter_names,
    sensitivities,
    simulate,
    simulate_batch,
)
from bha.support.later import imported_later

if TYPE_CHECKING:
    from bha.checkup import Checkup, check
    from bha.control import simulate_closed_loop
    from bha.diagnosis import diagnose
    from bha.identification import excite, identify
    from bha.sweeps import sweep
    from bha.viewer import view

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
    "Wrench",
    "__version__",
    "check",
    "diagnose",
    "excite",
    "identify",
    "parameter_names",
    "robots",
    "sensitivities",
    "simulate",
    "simulate_batch",
    "simulate_closed_loop",
    "sweep",
    "view",
]

#: Name -> its package: what is imported when first asked for, so that ``import bha`` does not wait for it.
_LATER = {
    "Checkup": "bha.checkup",
    "check": "bha.checkup",
    "diagnose": "bha.diagnosis",
    "excite": "bha.identification",
    "identify": "bha.identification",
    "simulate_closed_loop": "bha.control",
    "sweep": "bha.sweeps",
    "view": "bha.viewer",
}


if not TYPE_CHECKING:  # a checker knows all names, and that there are no others
    __getattr__ = imported_later(globals(), _LATER)


def __dir__() -> list[str]:
    """All names, those that are imported later too."""
    return sorted({*globals(), *__all__})
