"""Every error the package raises on purpose. Each says what was found, where, what is allowed and what to do."""

from __future__ import annotations

import errno
from typing import Any


class BhaError(Exception):
    """Base class of all errors raised by this package."""


class ParameterError(BhaError, ValueError):
    """A parameter file or a parameter value is wrong. The text names file, key, what was found and what is allowed."""


class LogError(BhaError, ValueError):
    """A measured log cannot be read. The text names file, line and column."""


class InputError(BhaError, ValueError):
    """An argument of a call is wrong: shape, type, range or a value that is not finite."""


class FileError(BhaError, OSError):
    """A file or folder cannot be written or opened. The text names it, why, and the way out."""


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


class ReferenceWarning(UserWarning):
    """A reference leaves what the arm can reach. The text says which part, and what is nearest."""


class LogWarning(UserWarning):
    """A measured log is readable, but something about it deserves a look. The text says what."""


class FileWarning(UserWarning):
    """A file that the package keeps for itself is damaged or cannot be written; the work goes on without it."""


def way_out(error: OSError) -> str:
    """What the system says of a file, and what helps: the end of a :class:`FileError`'s text."""
    # Other libraries give the number in their text only, or not at all.
    said = error.strerror or str(error) or type(error).__name__
    return f"{said}; {_WAYS_OUT[error.errno]}" if error.errno in _WAYS_OUT else said


_WAYS_OUT = {
    errno.ENOSPC: "make room, or name a path on another disk",
    getattr(errno, "EDQUOT", errno.ENOSPC): "make room, or name a path on another disk",
    errno.EFBIG: "raise the limit of file sizes (ulimit -f), or write less",
    errno.EACCES: "name a path that you may write, or change its permissions",
    errno.EPERM: "name a path that you may write, or change its permissions",
    errno.EROFS: "name a path that you may write",
    errno.ENAMETOOLONG: "use a shorter name",
    errno.ENOENT: "name a folder that exists and takes files",
    errno.ENOTDIR: "name a folder, not something below a file",
    errno.EEXIST: "a file of that name is in the way; name another path",
    errno.EMFILE: "too many files are open; raise the limit (ulimit -n)",
}
