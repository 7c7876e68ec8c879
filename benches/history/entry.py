"""One run of the benchmarks as data, with its file.

Seconds belong to a machine. Where two sides of a row, or rows of a table, ran in one process, their ratio says more: it
is what is compared across machines and years.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

FORMAT = "bha-bench/1"
#: The table whose rows are compared with its first row, too.
AGAINST_FIRST_ROW = "Table III"


@dataclass(frozen=True)
class Side:
    """One thing that was timed: median and quartiles, s; without quartiles where only the median is known."""

    name: str
    median: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Row:
    """Sides of one quantity, timed in one process."""

    table: str
    name: str
    sides: tuple[Side, ...]


@dataclass(frozen=True)
class Machine:
    """What the times depend on beside the commit."""

    processor: str
    cores: int
    system: str
    python: str
    rust: str

    @property
    def short(self) -> str:
        """For names of files: letters, digits and hyphens."""
        return re.sub(r"[^a-z0-9]+", "-", self.processor.lower()).strip("-")[:40].strip("-")


@dataclass(frozen=True)
class Entry:
    """A run: of which commit, when, where, how busy the machine was (processes that wanted to run, last minute)."""

    commit: str
    committed: str
    measured: str
    load: float | None
    machine: Machine
    rows: tuple[Row, ...]

    @property
    def label(self) -> str:
        """Day and commit, as in figures."""
        return f"{self.committed[:10]} {self.commit[:7]}"


@dataclass(frozen=True)
class Ratio:
    """How many times as long the first takes as the second; low and high by the quartiles of both."""

    table: str
    row: str
    sides: str
    value: float
    low: float | None
    high: float | None

    @property
    def label(self) -> str:
        """What identifies it from run to run."""
        return f"{self.table}: {self.row}, {self.sides}"


def ratio(row: Row, sides: str, first: Side, second: Side) -> Ratio:
    """Of two sides; quartiles are taken against each other, so that the interval is the widest they allow."""
    low = high = None
    if first.low and first.high and second.low and second.high:
        low, high = first.low / second.high, first.high / second.low
    return Ratio(row.table, row.name, sides, first.median / second.median, low, high)


def first_to_second(row: Row) -> Ratio | None:
    """Of a row of two sides; None for others, whose seconds compare on their own machine only."""
    return ratio(row, " / ".join(side.name for side in row.sides), *row.sides) if len(row.sides) == 2 else None


def to_first_row(rows: Sequence[Row]) -> Iterator[Ratio]:
    """Each side of the later rows of ``AGAINST_FIRST_ROW`` to the same side of its first row."""
    first, *others = [row for row in rows if row.table == AGAINST_FIRST_ROW] or [None]
    against = {side.name: side for side in first.sides} if first else {}
    for row in others:
        yield from (
            ratio(row, f"{side.name}, to {first.name}", side, against[side.name])
            for side in row.sides
            if side.name in against
        )


def ratios(rows: Sequence[Row]) -> Iterator[Ratio]:
    """All ratios of a run."""
    yield from filter(None, map(first_to_second, rows))
    yield from to_first_row(rows)


def file_name(entry: Entry) -> str:
    """One for each commit and machine: a second run there replaces the first."""
    return f"{entry.committed[:10]}_{entry.commit[:8]}_{entry.machine.short}.json"


def to_json(entry: Entry) -> str:
    """The file's text; sides without quartiles have none there either."""
    mapping = {"format": FORMAT, **asdict(entry)}
    for row in mapping["rows"]:
        row["sides"] = [{key: value for key, value in side.items() if value is not None} for side in row["sides"]]
    return json.dumps(mapping, indent=1, ensure_ascii=False) + "\n"


def from_json(text: str, where: str) -> Entry:
    """The entry of a file's text.

    Raises:
        ValueError: it is of another format, or something is missing or too much.
    """
    try:
        found: dict[str, Any] = json.loads(text)
        if found.pop("format", None) != FORMAT:
            raise ValueError(f"its format is not {FORMAT}")
        rows = tuple(Row(r["table"], r["name"], tuple(Side(**s) for s in r["sides"])) for r in found.pop("rows"))
        return Entry(machine=Machine(**found.pop("machine")), rows=rows, **found)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{where}: is no entry of the benchmarks' history: {error}") from error


def read_folder(folder: Path) -> list[Entry]:
    """All entries of a folder, in the order in which their commits were made."""
    entries = [from_json(path.read_text(encoding="utf-8"), str(path)) for path in sorted(folder.glob("*.json"))]
    return sorted(entries, key=lambda entry: (entry.committed, entry.commit, entry.machine.short))
