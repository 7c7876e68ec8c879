"""Headings of tables (CSV, Parquet, exports of other programs) by a mapping file."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from bha.errors import LogError
from bha.logs import formats
from bha.logs.columns import Column
from bha.logs.foreign import proposals
from bha.logs.foreign.mapping import MappingFile
from bha.logs.foreign.series import Part
from bha.logs.foreign.skeleton import skeleton
from bha.logs.headings import shortened


def renamed(origin: str, headings: Sequence[str], mapping: MappingFile) -> list[str]:
    """The headings of a log that the columns of a table have by a mapping; empty for those that are not mapped.

    Raises:
        LogError: a mapped column that is not there, or is there twice, or is to be more than one channel.
    """
    if mapping.stamp is not None or mapping.rate is not None:
        key = "stamp" if mapping.stamp is not None else "rate"
        raise LogError(f'{mapping.origin}: time: {key}: a table has a column of time; map it to "t [s]"')
    found = [""] * len(headings)
    for entry in mapping.entries:
        if len(entry.headings) != 1:
            raise LogError(
                f'{mapping.origin}: "{entry.source}": columns of a table are one channel each: "{entry.source}" = '
                '"x1 [m]"'
            )
        if entry.time is not None:
            raise LogError(f'{mapping.origin}: "{entry.source}": time: all columns of a table have its times')
        places = [k for k, heading in enumerate(headings) if heading == entry.source]
        if len(places) > 1:
            raise LogError(f"{origin}: column '{entry.source}' stands {len(places)} times; rename one of them")
        if not places:
            near = difflib.get_close_matches(entry.source, headings, n=1, cutoff=0.5)
            known = ", ".join(shortened(h) for h in headings[:20])
            hint = f"nearest: '{near[0]}'" if near else f"the file has: {known}"
            raise LogError(f"{origin}: there is no column '{entry.source}'; {hint} (mapped by {mapping.origin})")
        found[places[0]] = entry.headings[0]
    return found


def listed_table(path: Path, origin: str) -> str:
    """The columns of a table as a mapping file that is ready to be edited.

    Raises:
        LogError: not a table.
        MissingExtraError: Parquet without pyarrow.
    """
    found: list[str] = []

    def decide(headings: Sequence[str], _opening: Sequence[str]) -> list[Column]:
        found.extend(headings)
        raise _OnlyHeadingsError

    with formats.rereadable(path) as source, suppress(_OnlyHeadingsError):
        if formats.is_parquet(source):
            formats.read_parquet(source, origin, decide, None)
        else:
            formats.read_text(source, origin, decide, None)
    parts = [Part(heading, "column", proposal=proposals.of_one(heading)) for heading in found if heading]
    return skeleton(path.name, parts, stamps=False)


class _OnlyHeadingsError(Exception):
    """The headings have been read, and nothing else is wanted."""
