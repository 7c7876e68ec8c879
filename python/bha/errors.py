"""Every error the package raises on purpose. Each says what was found, where, what is allowed and what to do."""

from __future__ import annotations

from typing import Any


class BhaError(Exception):
    """Base class of all errors raised by this package."""


class ParameterError(BhaError, ValueError):
    """A parameter file or a parameter value is wrong. The text names file, key, what was found and what is allowed."""


class LogError(BhaError, ValueError):
    """A measured log cannot be read. The text names file, line and column."""


class InputError(BhaError, ValueError):
    """An argument of a call is wrong: shape, type, range or a value that is not finite."""


class SimulationError(BhaError, RuntimeError):
    """A simulation could not go on.

    Attributes:
        time: time of the last good state, s.
        trajectory: what was computed until then (a ``Trajectory``), or None.
    """

    def __init__(self, message: str, time: float = float("nan"), trajectory: Any = None) -> None:
        """Keep the time of the failure and the trajectory up to it beside the message."""
        super().__init__(message)
        self.time = time
        self.trajectory = trajectory


class ConvergenceError(BhaError, RuntimeError):
    """An iterative solution (statics, identification) did not converge. The text gives the residual that was left."""


class MissingExtraError(BhaError, ImportError):
    """A feature needs an optional dependency. The text gives the pip command that installs it."""


class ParameterWarning(UserWarning):
    """A parameter file is valid, but a value in it is physically implausible. The text says which and why."""


class LogWarning(UserWarning):
    """A measured log is readable, but something about it deserves a look. The text says what."""
