"""Logs of any readable format as CSV or Parquet, in the units in which they were measured."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bha.errors import LogWarning
from bha.logs import formats
from bha.logs.content import raw_of_file
from bha.logs.foreign import kinds
from bha.logs.foreign.mapping import mapping_given
from bha.logs.formats import Progress
from bha.logs.log import STANDARD_ATMOSPHERE
from bha.support.files import check_target


@dataclass(frozen=True)
class Converted:
    """What a conversion wrote.

    Attributes:
        path: the new file.
        rows: their number.
        headings: of its columns.
        gaps: whether samples are missing in it: it is read with ``missing=True`` (``--missing``).
        notes: how the log was read, a text each.
        ignored: columns that were not taken, with the reason.
    """

    path: Path
    rows: int
    headings: tuple[str, ...]
    gaps: bool
    notes: tuple[str, ...]
    ignored: dict[str, str]


def convert(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    mapping: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    missing: bool = False,
    progress: Progress | None = None,
) -> Converted:
    """Write a log of any readable format as ``.csv``, ``.csv.gz`` or ``.parquet``; units and gauge pressures stay.

    Args:
        path: the log.
        out: the new file; its extension chooses the format.
        mapping: as for :meth:`bha.Log.read`.
        missing: whether NaN and empty cells of measured outputs are missing samples.
        progress: called with the fraction done, from 0 to 1.

    Raises:
        LogError: as :meth:`bha.Log.read`.
        InputError: an extension that is not known, a folder that does not exist, or ``out`` is the log itself.
        MissingExtraError: as :meth:`bha.Log.read`.

    Warns:
        LogWarning: what is odd about the log.
    """
    source, target = Path(path), Path(out)
    check_target(target, keep=[source])
    formats.check_extension(target)
    raw = raw_of_file(
        source,
        ambient_pressure=STANDARD_ATMOSPHERE,
        columns=None,
        missing=missing,
        progress=progress,
        mapping=mapping_given(mapping),
    )
    values: dict[str, Any] = {}
    ignored: dict[str, str] = {}
    for column, found in zip(raw.columns, raw.found, strict=True):
        if isinstance(found, str):
            ignored[column.heading] = found
        elif found is not None and column.name:
            values[column.heading] = found
    for text in raw.odd:
        warnings.warn(f"{os.fspath(path)}: {text}", LogWarning, stacklevel=2)
    formats.write(target, values, None)
    rows = len(next(iter(values.values())))
    gaps = any(bool(np.isnan(array).any()) for array in values.values())
    return Converted(target, rows, tuple(values), gaps, raw.notes, ignored)


def listed(path: str | os.PathLike[str]) -> str:
    """What a log of another format has, as a mapping file that is ready to be edited.

    Raises:
        LogError: the file is damaged or cut off, or has no parts to be mapped.
        MissingExtraError: as :meth:`bha.Log.read`.
    """
    origin = os.fspath(path)
    kind = kinds.kind_of(Path(path))
    if kind is None:
        from bha.logs.foreign.tables import listed_table  # noqa: PLC0415

        return listed_table(Path(path), origin)
    from bha.logs.foreign.read import listed as listed_foreign  # noqa: PLC0415

    return listed_foreign(Path(path), origin, kind)
