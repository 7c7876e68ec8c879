"""What a log holds, from a file or from columns in memory: planned, checked, converted to SI, and what is odd in it."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import LogError
from bha.logs import arrays, formats
from bha.logs.columns import FREE, SKIP, Column, check_values, convert, doubts, plan
from bha.logs.foreign import kinds
from bha.logs.foreign.mapping import MappingFile, beside, read_mapping
from bha.logs.foreign.tables import renamed
from bha.logs.formats import Found, Progress

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Content:
    """The columns of a log by name, in the order of the file.

    Attributes:
        values: in SI units.
        units: unit of each column's values.
        headings: heading of each column as it stands in the file.
        gauge_columns: names of the pressures that the file has as gauge pressure.
        ignored: columns that were not read, with the reason.
        doubts: what is odd, a text each.
        sha256: SHA-256 of the file, hexadecimal, or None; of a mapped one, of file and mapping together.
        notes: how the file was read where that does not go without saying, a text each.
        gaps: whether samples are missing because parts of the file have times of their own.
    """

    values: dict[str, Array]
    units: dict[str, str]
    headings: dict[str, str]
    gauge_columns: tuple[str, ...]
    ignored: dict[str, str]
    doubts: tuple[str, ...]
    sha256: str | None = None
    notes: tuple[str, ...] = ()
    gaps: bool = False


@dataclass(frozen=True)
class Raw:
    """What was found in a file, in the units of the file: checked, but not converted.

    Attributes:
        columns: what each column is.
        found: the values of each; None if it was skipped; where and what, if it holds something else than numbers.
        sha256: see :class:`Content`.
        notes: see :class:`Content`.
        odd: what is odd about the file, a text each.
        gaps: see :class:`Content`.
    """

    columns: list[Column]
    found: list[Found]
    sha256: str
    notes: tuple[str, ...] = ()
    odd: tuple[str, ...] = ()
    gaps: bool = False


def of_file(
    path: Path,
    *,
    ambient_pressure: float,
    columns: Collection[str] | None,
    missing: bool,
    progress: Progress | None,
    mapping: MappingFile | None = None,
) -> Content:
    """The content of a file; arguments and errors as for ``bha.Log.read``."""
    raw = raw_of_file(
        path,
        ambient_pressure=ambient_pressure,
        columns=columns,
        missing=missing,
        progress=progress,
        mapping=mapping,
    )
    content = _converted(os.fspath(path), raw.columns, raw.found, list(raw.odd), raw.sha256)
    return replace(content, notes=raw.notes, gaps=raw.gaps)


def raw_of_file(
    path: Path,
    *,
    ambient_pressure: float,
    columns: Collection[str] | None,
    missing: bool,
    progress: Progress | None,
    mapping: MappingFile | None = None,
) -> Raw:
    """What a file has, in its own units; arguments and errors as for ``bha.Log.read``.

    Without ``mapping`` one that lies beside the file counts, see :func:`bha.logs.foreign.mapping.beside`.
    """
    if path.suffix.lower() == ".toml" and path.is_file():
        raise LogError(f"{os.fspath(path)}: is a parameter file by its name, and no log; name a log, such as log.csv")
    kind = kinds.kind_of(path)
    if mapping is None and (found := beside(path, of_folder=kind is not None)) is not None:
        mapping = read_mapping(found)
    if kind is not None:
        return _of_foreign(path, kind, ambient_pressure, columns, missing, progress, mapping)
    return _of_table(path, ambient_pressure, columns, missing, progress, mapping)


def _of_foreign(
    path: Path,
    kind: kinds.Kind,
    ambient_pressure: float,
    columns: Collection[str] | None,
    missing: bool,
    progress: Progress | None,
    mapping: MappingFile | None,
) -> Raw:
    from bha.logs.foreign import read  # noqa: PLC0415  (with libraries that tables do not need)

    origin = os.fspath(path)
    if mapping is None:
        raise read.not_mapped(path, origin, kind)
    table = read.columns_of(path, origin, kind, mapping, missing=missing, progress=progress)
    may_miss = missing or table.gaps
    headings = list(table.values)
    planned = plan(origin, headings, ambient_pressure=ambient_pressure, only=columns, missing=may_miss)
    values: list[Found] = []
    for column in planned:
        array = None if column.used == SKIP else table.values[column.heading]
        fault = None if array is None else check_values(origin, column, array)
        values.append(array if fault is None else fault)
    digest = formats.sha256_of(path, origin, mapping.text)
    return Raw(planned, values, digest, table.notes, table.doubts, table.gaps)


def _of_table(
    path: Path,
    ambient_pressure: float,
    columns: Collection[str] | None,
    missing: bool,
    progress: Progress | None,
    mapping: MappingFile | None,
) -> Raw:
    origin = os.fspath(path)

    def decide(headings: Sequence[str], opening: Sequence[str]) -> list[Column]:
        if mapping is not None:
            headings, opening = renamed(origin, headings, mapping), ()
        return plan(origin, headings, ambient_pressure=ambient_pressure, only=columns, missing=missing, opening=opening)

    notes = [] if mapping is None else [f"columns by {mapping.origin}"]
    unterminated = False
    with formats.rereadable(path) as source:
        if formats.is_parquet(source):
            planned, found = formats.read_parquet(source, origin, decide, progress)
        else:
            table = formats.read_text(source, origin, decide, progress)
            planned, found, unterminated = table.columns, table.found, table.unterminated
            notes += [] if table.layout is None else [table.layout.in_words()]
        digest = formats.sha256_of(source, origin, mapping.text if mapping is not None else "")
    odd = ("the last line has no line end; if the file was cut off, its last number may be wrong",) * unterminated
    return Raw(planned, found, digest, tuple(notes), odd)


def of_columns(
    columns: Iterable[tuple[object, Any]],
    numbers: Callable[[Any], Array],
    origin: str,
    *,
    ambient_pressure: float,
    missing: bool,
    strict: bool,
) -> Content:
    """The content of columns in memory, by heading; ``numbers`` makes a new float64 array of what a column gives.

    Unless ``strict``, columns of other names than those of ``bha.names`` are ignored where they hold no numbers.

    Raises:
        LogError: as ``bha.Log.from_arrays``.
    """
    given = list(columns)
    for heading, _ in given:
        if not isinstance(heading, str):
            raise LogError(f"{origin}: found the column name {heading!r}; names are texts, such as 'p11 [Pa]'")
    headings = [str(heading).strip() for heading, _ in given]
    planned = plan(origin, headings, ambient_pressure=ambient_pressure, missing=missing)
    found: list[Found] = []
    rows: int | None = None
    for column, (_, values) in zip(planned, given, strict=True):
        where = f"{origin}, column '{column.heading}'"
        try:
            array = numbers(values)
        except arrays.NotNumbersError as error:
            if strict or column.used != FREE:
                raise LogError(f"{where}: {error}") from error
            found.append(str(error))
            continue
        if array.ndim != 1 or rows not in (None, len(array)):
            expected = "(m,)" if rows is None else f"({rows},)"
            raise LogError(f"{where}: found shape {array.shape}; expected {expected}")
        rows = len(array)
        fault = check_values(origin, column, array)
        if fault is not None and strict:
            raise LogError(f"{where}, {fault}")
        found.append(array if fault is None else fault)
    if not rows:
        raise LogError(f"{origin} has headings but no rows of numbers")
    return _converted(origin, planned, found, [], None)


def _converted(
    origin: str, planned: Sequence[Column], found: Sequence[Found], odd: list[str], sha256: str | None
) -> Content:
    """Convert the columns in place, so that a long log never exists twice."""
    read: dict[str, tuple[Column, Array]] = {}
    ignored: dict[str, str] = {}
    for number, (column, array) in enumerate(zip(planned, found, strict=True), start=1):
        if isinstance(array, str):
            ignored[column.name or f"column {number}"] = array
        elif not column.name:
            ignored[f"column {number}"] = "it has no heading"
        elif array is not None:
            read[column.name] = (column, array)
    odd += doubts(read.values())
    for column, array in read.values():
        convert(origin, column, array)
    return Content(
        {name: array for name, (_, array) in read.items()},
        {name: column.unit for name, (column, _) in read.items()},
        {name: column.heading for name, (column, _) in read.items()},
        tuple(name for name, (column, _) in read.items() if column.gauge),
        ignored,
        tuple(odd),
        sha256,
    )
