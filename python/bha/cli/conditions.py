"""What differs between logs, on the command line: ``--with LOG KEY=VALUE`` and ``--session NAME=LOG,LOG``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from bha.errors import InputError

#: Known changes of the arm in one log.
with_option = click.option(
    "--with", "withs", metavar="LOG KEY=VALUE", nargs=2, multiple=True,
    help="Known to be otherwise while LOG was measured: section.3.payload=0.2 (a mass at a head, kg), gravity.x=9.81, "
    "base.rotation.y=1.57 or any other path; several with commas between; may be repeated.",
)  # fmt: skip
#: Names of sessions.
session_option = click.option(
    "--session", "sessions", metavar="NAME=LOG,...", multiple=True,
    help="Session (day, mounting) that logs belong to; may be repeated.",
)  # fmt: skip


def changes_in(withs: Sequence[tuple[str, str]], logs: Sequence[Path]) -> dict[str, dict[str, float]]:
    """Name of a log -> path -> number.

    Raises:
        InputError: a log that is not given, or no number.
    """
    found: dict[str, dict[str, float]] = {}
    for log, text in withs:
        own = found.setdefault(name_of(log, logs, "--with"), {})
        for part in text.split(","):
            path, equals, value = part.partition("=")
            try:
                number = float(value)
            except ValueError:
                equals = ""
            if not equals or not path.strip():
                raise InputError(f"--with {log} {text}: {part!r}; PATH=NUMBER is needed, as in section.3.payload=0.2")
            if path.strip() in own:
                raise InputError(f"--with {log}: {path.strip()} is stated twice; allowed: once")
            own[path.strip()] = number
    return found


def sessions_in(texts: Sequence[str], logs: Sequence[Path]) -> dict[str, list[str]]:
    """Name of a session -> names of its logs.

    Raises:
        InputError: a log that is not given, or no name.
    """
    found: dict[str, list[str]] = {}
    for text in texts:
        name, equals, members = text.partition("=")
        if not equals or not name or not members:
            raise InputError(f"--session {text}: NAME=LOG,LOG is needed, as in april=day1.csv,day2.csv")
        found.setdefault(name, []).extend(name_of(log, logs, "--session") for log in members.split(","))
    return found


def name_of(log: str, logs: Sequence[Path], option: str) -> str:
    """The name that a recording of one of some logs has: its path as given, or its file's name.

    Raises:
        InputError: there is no such log, or several have the name.
    """
    own = [path for path in logs if Path(log) in (path, Path(path.name))]
    if not own:
        raise InputError(f"{option} {log}: not among the logs {', '.join(str(path) for path in logs)}")
    if sum(path.name == own[0].name for path in logs) > 1:
        raise InputError(f"{option} {log}: several logs are called {own[0].name}; rename one")
    return own[0].name
