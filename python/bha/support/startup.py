"""Ctrl-C while the command ``bha`` is still importing its modules: a line and exit code 130, no traceback.

That takes most of a second, and the command's own handling of Ctrl-C is among what is imported. Programs that import
the package see nothing of it.
"""

from __future__ import annotations

import os
import sys
from itertools import pairwise
from types import TracebackType


def is_command() -> bool:
    """Whether this process is the command, as a script or as ``python -m bha``."""
    program = os.path.basename((getattr(sys, "argv", None) or [""])[0])
    as_module = any(pair == ("-m", "bha") for pair in pairwise(sys.orig_argv))
    return os.path.splitext(program)[0] == "bha" or as_module


def interrupt_quietly() -> None:
    """In the command, and nowhere else, end without traceback where nobody catches Ctrl-C."""
    if not is_command():
        return
    before = sys.excepthook

    def hook(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
        if not issubclass(kind, KeyboardInterrupt):
            before(kind, error, traceback)
            return
        if sys.stderr is not None:
            sys.stderr.write("interrupted\n")
            sys.stderr.flush()
        os._exit(130)

    sys.excepthook = hook


interrupt_quietly()
