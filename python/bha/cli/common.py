"""What the subcommands share: the arm argument, errors without traceback, machine output; and what they show people."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import click
import numpy as np

from bha import robots
from bha.arm import Arm
from bha.cli.terminal import INTERRUPTED, console, errors_as_lines, fail, progress_bar, say, table
from bha.errors import BhaError, InputError, ParameterError, way_out
from bha.parameters.base import nearest

__all__ = [
    "INTERRUPTED",
    "arm_argument",
    "console",
    "fail",
    "json_option",
    "load_arm",
    "print_json",
    "progress_bar",
    "read_json",
    "reports_errors",
    "say",
    "table",
]

P = ParamSpec("P")
R = TypeVar("R")

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object for machines, nothing else.")


def load_arm(name: str) -> Arm:
    """The arm of a parameter file, or the one of that name that ships with the package.

    Raises:
        ParameterError: neither is there, or the file is wrong.
    """
    if not os.path.exists(name):
        if name in robots.names():
            return robots.load(name)
        if not name.endswith(".toml"):
            hint = "bha robots lists the arms that ship with the package"
            raise ParameterError(f"{name}: there is no such file, and no arm of that name{_near(name)}; {hint}")
    return Arm.load(name)


def _near(name: str) -> str:
    hint = nearest(name, robots.names())
    return hint if hint.startswith("; nearest") else ""


def _load_arm(_ctx: click.Context, _parameter: click.Parameter, value: str) -> Arm:
    try:
        return load_arm(value)
    except BhaError as error:
        fail(error)


#: A parameter file, or the name of an arm that ships with the package.
arm_argument = click.argument("arm", metavar="ARM", callback=_load_arm)


def reports_errors(command: Callable[P, R]) -> Callable[P, R]:
    """A command that says errors and warnings in lines, without traceback: see :func:`errors_as_lines`."""

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        with errors_as_lines():
            return command(*args, **kwargs)

    return wrapped


def print_json(values: dict[str, Any]) -> None:
    """One JSON object on standard output; NumPy values as numbers and lists."""
    click.echo(json.dumps(values, default=_plain))


def read_json(path: Path) -> dict[str, Any]:
    """The JSON object that a command has printed into a file.

    Raises:
        InputError: the file cannot be read, or holds no JSON object.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {way_out(error)}") from error
    except ValueError as error:
        raise InputError(f"{path}: no JSON ({error}); redirect what a command with --json prints") from error
    if not isinstance(found, dict):
        raise InputError(f"{path}: {type(found).__name__}; a JSON object is needed, as commands with --json print it")
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")
