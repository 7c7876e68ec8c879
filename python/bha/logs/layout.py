"""How a table of text is laid out: what parts its fields, what marks decimals, where headings and numbers begin.

Told by its first lines: numbers stand where several lines in a row have the same number of fields, nearly all of them
numbers, by one separator and one decimal mark; headings are the nearest line above them with as many fields that are
no numbers. Between both may stand a line of units. Programs (LabVIEW, dSPACE ControlDesk, spreadsheets) write such
tables with semicolons or tabs, decimal commas and lines above them that say when and by whom.
"""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bha.logs.headings import heading_parts
from bha.logs.units import EXAMPLES, measures

#: Bytes and lines of the beginning that are looked at.
_PROBE, _LINES = 1 << 16, 400
#: Lines of numbers in a row that make a table, where there are as many.
_ENOUGH = 3
_NUMBERS = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|nan|[+-]?inf", re.IGNORECASE),
    ",": re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?|nan|[+-]?inf", re.IGNORECASE),
}
_NAMES = {",": "commas", ";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True)
class Layout:
    """The layout of a table of text that is no plain CSV; lines count from 1.

    Attributes:
        separator: between fields, ``","``, ``";"`` or a tab.
        decimal_comma: whether numbers have a decimal comma.
        headings_line: where the headings stand.
        units: of each column, where a line of units stands below the headings; None where none does.
        numbers_line: where the numbers begin.
        after_text: the line after the last one above the numbers that is not empty; where the core reads on.
    """

    separator: str
    decimal_comma: bool
    headings_line: int
    units: tuple[str, ...] | None
    numbers_line: int
    after_text: int

    @property
    def for_core(self) -> tuple[str, bool, int, int]:
        """As the reader of the core takes it."""
        return self.separator, self.decimal_comma, self.headings_line, self.after_text

    def headings(self, found: Sequence[str]) -> list[str]:
        """The headings with the units that stand below them, ``p11 [bar]`` of ``p11`` and ``bar``."""
        units = list(self.units or ())
        units += [""] * (len(found) - len(units))
        return [
            f"{heading} [{unit}]" if unit and heading and heading_parts(heading)[1] is None else heading
            for heading, unit in zip(found, units, strict=False)
        ]

    def in_words(self) -> str:
        """How the table is read, for a note."""
        decimals = ", decimal commas" if self.decimal_comma else ""
        units = ", units below them" if self.units is not None else ""
        return (
            f"read as a table: fields parted by {_NAMES[self.separator]}{decimals}; headings in line "
            f"{self.headings_line}{units}, numbers from line {self.numbers_line} on"
        )


def layout_of(path: Path) -> Layout | None:
    """The layout of a file, plain or gzip; None where it is that of a plain CSV file, or none is told."""
    lines = _first_lines(path)
    best: tuple[tuple[float, int, int], Layout] | None = None
    for separator in _NAMES:
        for decimal in (".", ",") if separator != "," else (".",):
            found = _table(lines, separator, decimal)
            if found is not None and (best is None or found[0] > best[0]):
                best = found
    if best is None or _is_plain(best[1], lines):
        return None
    return best[1]


def _is_plain(layout: Layout, lines: Sequence[str]) -> bool:
    """Whether the reader of plain CSV reads it: commas, headings first, numbers next, but for blank lines."""
    others = [*lines[: layout.headings_line - 1], *lines[layout.headings_line : layout.numbers_line - 1]]
    return layout.separator == "," and not any(line.strip() for line in others)


def _first_lines(path: Path) -> list[str]:
    try:
        with path.open("rb") as file:
            packed = file.read(2) == b"\x1f\x8b"
        with gzip.open(path, "rb") if packed else path.open("rb") as text:
            start = text.read(_PROBE)
    except (OSError, EOFError, ValueError, zlib.error):
        return []  # the reader says what is wrong with it
    if b"\0" in start:
        return []
    try:
        content = start.decode("utf-8-sig", errors="strict")
    except UnicodeDecodeError as error:
        # A character that the probe has cut in half is no sign of another encoding.
        content = start[: error.start].decode() if error.start > len(start) - 4 else start.decode("latin-1")
    lines = re.split(r"\r\n|\n|\r", content)
    whole = len(start) < _PROBE
    return lines[:_LINES] if whole or len(lines) > _LINES else lines[:-1]


def _table(lines: Sequence[str], separator: str, decimal: str) -> tuple[tuple[float, int, int], Layout] | None:
    """The table by a separator and a decimal mark, with how well it fits: share of numbers, lines, fields."""
    cells = [_fields(line, separator) for line in lines]
    number = _NUMBERS[decimal]
    shares = [_share(row, number) for row in cells]
    for first in range(len(cells)):
        run = _run(cells, shares, lines, first)
        if run is None:
            continue
        width = min(len(cells[k]) for k in run)
        above = _headings(cells, shares, first, width)
        if above is None:
            continue
        headings, units = above
        text = next(k for k in range(first - 1, headings - 1, -1) if lines[k])
        layout = Layout(separator, decimal == ",", headings + 1, units, first + 1, text + 2)
        return (sum(shares[k] for k in run) / len(run), len(run), width), layout
    return None


def _fields(line: str, separator: str) -> list[str]:
    """The fields of a line without the empty ones at its end."""
    fields = [field.strip() for field in next(csv.reader([line], delimiter=separator), [])]
    while fields and not fields[-1]:
        fields.pop()
    return fields


def _share(row: Sequence[str], number: re.Pattern[str]) -> float:
    """The share of numbers among the fields that hold something; 0 for a line with fewer than two of them."""
    numbers = sum(number.fullmatch(field) is not None for field in row)
    return numbers / sum(1 for field in row if field) if numbers >= 2 else 0.0


def _run(cells: Sequence[list[str]], shares: Sequence[float], lines: Sequence[str], first: int) -> list[int] | None:
    """The lines of numbers that begin at a line; None if too few do."""
    following = [k for k in range(first, len(lines)) if lines[k].strip()]
    run: list[int] = []
    for k in following:
        if shares[k] < 0.5 or abs(len(cells[k]) - len(cells[first])) > 1:
            break
        run.append(k)
    return run if first in run and len(run) >= min(_ENOUGH, len(following)) else None


def _headings(
    cells: Sequence[list[str]], shares: Sequence[float], first: int, width: int
) -> tuple[int, tuple[str, ...] | None] | None:
    """The line of headings above a line of numbers, and the units below it; None where none fits.

    It is the next one above, but for a line of units, if as many fields stand above that.
    """
    text = [k for k in range(first - 1, -1, -1) if cells[k]]
    fit = [width <= len(cells[k]) <= width + 2 and shares[k] < 0.5 for k in text]
    if True not in fit:
        return None
    nearest = fit.index(True)
    units = _units(cells[text[nearest]])
    if units is not None and nearest + 1 < len(text) and fit[nearest + 1]:
        return text[nearest + 1], units
    return text[nearest], None


def _units(row: Sequence[str]) -> tuple[str, ...] | None:
    """The units of a line of units, without brackets; None for a line of something else."""
    plain = [re.sub(r"^[\[(](.*)[\])]$", r"\1", field) for field in row]
    known = [field in ("", "-", "1") or _is_unit(field) for field in plain]
    stated = sum(1 for field in plain if field not in ("", "-", "1"))
    return tuple("" if field == "-" else field for field in plain) if stated and all(known) else None


def _is_unit(text: str) -> bool:
    bare = re.sub(r"\s*\([ga]\)$", "", text)
    return bare in _OTHER_UNITS or any(measures(bare, si) for si in EXAMPLES)


_OTHER_UNITS = ("V", "A", "mA", "mV", "°C", "K", "rad", "°", "deg", "Hz", "%", "l/min", "Nm", "m/s^2", "W")
