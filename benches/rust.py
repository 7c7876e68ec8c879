"""Medians of the benchmarks in Rust: runs `cargo bench` (divan) and reads its tables."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

#: Seconds in each unit that divan prints.
UNITS = {"ns": 1e-9, "µs": 1e-6, "ms": 1e-3, "s": 1.0}
#: A row of divan's: tree, name, fastest | slowest | median | ...; rows of groups have no numbers.
ROW = re.compile(r"^(?P<tree>[│├╰─ ]*)(?P<name>\S+)\s+[\d.]+ \S+\s+│ [\d.]+ \S+\s+│ (?P<median>[\d.]+) (?P<unit>\S+)")
GROUP = re.compile(r"^(?P<tree>[│├╰─ ]*)(?P<name>\S+)\s*│")


def medians(bench: str) -> dict[str, float]:
    """Median time of each row of a benchmark file in Rust, s.

    Raises:
        RuntimeError: cargo failed; its words.
    """
    command = ["cargo", "bench", "--quiet", "--bench", bench]
    done = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr}")
    return dict(parsed(done.stdout.splitlines()))


def parsed(lines: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Rows of divan's table: names with their group before them, medians in s."""
    group = ""
    for line in lines:
        if row := ROW.match(line):
            nested = len(row["tree"]) > 3
            name = row["name"].replace("_", " ")
            yield (f"{group} {name}" if nested else name), float(row["median"]) * UNITS[row["unit"]]
        elif found := GROUP.match(line):
            group = found["name"].replace("_", " ")
