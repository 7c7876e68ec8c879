"""This machine and this commit."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import cpuinfo

from .entry import Machine

ROOT = Path(__file__).resolve().parents[2]
#: What decides how fast the package is.
SOURCES = ("rust", "python", "benches", "Cargo.toml", "Cargo.lock", "pyproject.toml")


def output(*command: str) -> str:
    """What a command prints.

    Raises:
        OSError, subprocess.CalledProcessError: it is not there, or failed.
    """
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def machine() -> Machine:
    """This machine: nothing that names its owner or place."""
    return Machine(
        processor=str(cpuinfo.get_cpu_info().get("brand_raw") or platform.machine()),
        cores=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        rust=output("rustc", "--version").split()[1],
    )


def commit() -> tuple[str, str]:
    """The commit that is checked out, and when it was made (UTC).

    Raises:
        ValueError: sources differ from the commit, or there is no repository: what is measured has no name.
    """
    try:
        changed = output("git", "status", "--porcelain", "--", *SOURCES, ":!benches/history/entries")
        name, when = output("git", "log", "-1", "--format=%H %cI").split()
    except (OSError, subprocess.CalledProcessError) as error:
        raise ValueError(f"git does not say which commit this is: {error}") from error
    if changed:
        raise ValueError(f"sources differ from commit {name[:8]}; commit them first:\n{changed}")
    return name, utc(datetime.fromisoformat(when))


def now() -> str:
    """The time (UTC), to the second."""
    return utc(datetime.now(UTC))


def utc(when: datetime) -> str:
    """ISO 8601 in UTC, to the second."""
    return when.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def load() -> float | None:
    """Processes that wanted to run in the last minute; None where the system does not say."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
