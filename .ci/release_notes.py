"""Notes of a release: what CHANGELOG.md says of the version. Fails where tag, version and changelog do not agree.

usage: release_notes.py v1.2.3
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def notes(tag: str, version: str, changelog: str) -> str:
    """The changelog's section of a version.

    Raises:
        ValueError: the tag is not that of the version, or the changelog has no dated section of it above all others, or
            it still has unreleased changes.
    """
    if tag != f"v{version}":
        raise ValueError(f"the tag is {tag}, the version of Cargo.toml {version}: tag v{version}, or change Cargo.toml")
    _, *sections = re.split(r"^## ", changelog, flags=re.MULTILINE)
    heading, _, unreleased = sections[0].partition("\n")
    if heading != "[Unreleased]" or unreleased.strip():
        raise ValueError(f"CHANGELOG.md has unreleased changes: put '## [{version}] - YYYY-MM-DD' above them")
    heading, _, text = sections[1].partition("\n") if len(sections) > 1 else ("nothing", "", "")
    if not re.fullmatch(rf"\[{re.escape(version)}\] - \d{{4}}-\d\d-\d\d", heading):
        raise ValueError(f"CHANGELOG.md has {heading!r} on top; '[{version}] - YYYY-MM-DD' must stand there")
    return text.strip() + "\n"


def main() -> None:
    """Print the notes, or say why not."""
    version = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["package"]["version"]
    try:
        text = notes(sys.argv[1], version, (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    except ValueError as error:
        sys.exit(f"release_notes: {error}")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
