"""What the subcommands share: the arm argument, errors without traceback, tables, progress, machine output."""

from __future__ import annotations

import functools
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, ParamSpec, TypeVar

import click
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from bha import robots
from bha.arm import Arm
from bha.errors import BhaError

P = ParamSpec("P")
R = TypeVar("R")

#: Exit code of Ctrl-C, as shells give it.
INTERRUPTED = 130

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object for machines, nothing else.")


def _load_arm(_ctx: click.Context, _parameter: click.Parameter, value: str) -> Arm:
    if not os.path.exists(value) and value in robots.names():
        return robots.load(value)
    try:
        return Arm.load(value)
    except BhaError as error:
        fail(error)


#: A parameter file, or the name of an arm that ships with the package.
arm_argument = click.argument("arm", metavar="ARM", callback=_load_arm)


def fail(error: BhaError, code: int = 1) -> NoReturn:
    """Print an error and end the program."""
    click.echo(f"error: {error}", err=True)
    sys.exit(code)


def reports_errors(command: Callable[P, R]) -> Callable[P, R]:
    """A command whose deliberate errors are printed without traceback, exit code 1; 130 after Ctrl-C."""

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return command(*args, **kwargs)
        except BhaError as error:
            fail(error)
        except KeyboardInterrupt:
            click.echo("interrupted", err=True)
            sys.exit(INTERRUPTED)

    return wrapped


def console() -> Console:
    """Where tables go."""
    return Console()


def table(*headings: str, title: str | None = None) -> Table:
    """A table whose headings keep their units: Rich takes ``[mm]`` for markup."""
    return Table(*map(escape, headings), title=None if title is None else escape(title))


class RateColumn(ProgressColumn):
    """How many of something are done a second."""

    def __init__(self, what: str) -> None:
        """``what`` is counted: ``"runs"``."""
        super().__init__()
        self._what = what

    def render(self, task: Task) -> Text:
        """``230 runs/s``."""
        return Text("" if task.speed is None else f"{task.speed:.3g} {self._what}/s")


def progress_bar(*, hidden: bool = False, rate_of: str | None = None) -> Progress:
    """A progress bar on standard error with the time left; silent if ``hidden`` or where nobody looks.

    With ``rate_of`` it says how many of these are done a second.
    """
    errors = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        *(() if rate_of is None else (RateColumn(rate_of),)),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=errors,
        transient=True,
        disable=hidden or not errors.is_terminal,
    )


def print_json(values: dict[str, Any]) -> None:
    """One JSON object on standard output; NumPy values as numbers and lists."""
    click.echo(json.dumps(values, default=_plain))


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")
