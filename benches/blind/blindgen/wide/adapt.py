"""Cases for a product that does not know all that users write: copies of the inputs that lack it.

``sensors``: the tables ``[sensors]`` and ``[[length_sensor]]`` are taken out of the file (the wires' columns stay in
the logs). ``commands``: commanded pressures are renamed to measured ones, as a user does where a command has no option
for them.
"""

import re
import shutil
from collections.abc import Iterable
from pathlib import Path

LACKS = ("sensors", "commands")


def without_sensor_tables(text: str) -> str:
    """A parameter file without the tables that describe sensors."""
    kept: list[str] = []
    skipping = False
    for line in text.splitlines():
        if line.startswith("["):
            skipping = line.strip() in ("[sensors]", "[[length_sensor]]")
        if not skipping:
            kept.append(line)
    return "\n".join(kept).rstrip() + "\n"


def adapted(case: Path, target: Path, lacks: Iterable[str]) -> Path:
    """A folder with the inputs of a case for a product that lacks something; the case's own where it lacks nothing."""
    lacking = set(lacks)
    if not lacking:
        return case
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    for path in sorted(case.iterdir()):
        if path.suffix == ".toml" and "sensors" in lacking:
            (target / path.name).write_text(without_sensor_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
        elif path.suffix == ".csv" and "commands" in lacking:
            with path.open(encoding="utf-8") as source, (target / path.name).open("w", encoding="utf-8") as copy:
                copy.write(re.sub(r"\bpc(?=\d)", "p", source.readline()))
                shutil.copyfileobj(source, copy)
        else:
            (target / path.name).symlink_to(path.resolve())
    return target
