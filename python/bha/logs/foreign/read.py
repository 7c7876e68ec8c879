"""From a foreign file and its mapping to columns by heading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bha.errors import LogError
from bha.logs.foreign import arrays_of, bags, hdf5, matlab
from bha.logs.foreign.kinds import Kind
from bha.logs.foreign.mapping import MappingFile
from bha.logs.foreign.merge import is_drive, merged
from bha.logs.foreign.series import Array, Foreign, Part, Said
from bha.logs.foreign.skeleton import skeleton
from bha.logs.formats import Progress


@dataclass(frozen=True)
class Columns:
    """What a mapping makes of a foreign file.

    Attributes:
        values: by heading, in the units of the headings; NaN where nothing was measured.
        gaps: whether there are gaps because parts were measured at different times.
        notes: how it was read, a text each.
        doubts: what is odd, a text each.
    """

    values: dict[str, Array]
    gaps: bool
    notes: tuple[str, ...]
    doubts: tuple[str, ...]


def columns_of(
    path: Path, origin: str, kind: Kind, mapping: MappingFile, *, missing: bool, progress: Progress | None
) -> Columns:
    """The columns of a log that a mapping makes of a file.

    Raises:
        LogError: a file that is damaged or cut off, a part that is not there or is no number, a sample that is NaN
            unless ``missing``, times that run backwards.
        MissingExtraError: the library for this kind of file is not installed.
    """
    said = Said()
    if kind == "bag":
        found = bags.read(path, origin, mapping, progress)
    else:
        found = _of_arrays(path, origin, kind, mapping, said)
    _check_samples(origin, found, missing)
    said.notes = [f"columns by {mapping.origin}", *found.notes]
    values, gaps = merged(origin, found.series, said)
    return Columns(values, gaps, tuple(said.notes), found.doubts)


def _of_arrays(path: Path, origin: str, kind: Kind, mapping: MappingFile, said: Said) -> Foreign:
    wanted = [name for entry in mapping.entries for name in (entry.source, entry.time) if name]
    objects = Said()
    if kind == "matlab":
        tree = matlab.tree(path, origin, wanted, objects)
        _refuse_objects(origin, wanted, objects)
        return arrays_of.read(origin, arrays_of.leaves(tree), mapping, said)
    with hdf5.opened(path, origin, objects) as (tree, separator):
        _refuse_objects(origin, wanted, objects)
        return arrays_of.read(origin, arrays_of.leaves(tree, separator), mapping, said)


def _refuse_objects(origin: str, wanted: Sequence[str], objects: Said) -> None:
    """Objects that are not mapped do no harm; those that are cannot be read."""
    for text in objects.doubts:
        name = text.partition(" ")[0]
        if any(source == name or source.startswith((f"{name}.", f"{name}[")) for source in wanted):
            raise LogError(f"{origin}: {text}")


def _check_samples(origin: str, found: Foreign, missing: bool) -> None:
    """A sample that is no number is an error where it stands, before gaps are made that look the same."""
    for series in found.series:
        for heading, values in series.columns.items():
            unfit = np.isinf(values) if missing and not is_drive(heading) else ~np.isfinite(values)
            if unfit.any():
                row = int(np.argmax(unfit))
                advice = "remove it from the recording"
                if np.isnan(values[row]):
                    advice = "pressures and forces drive the arm and may not be missing"
                    if not is_drive(heading):
                        advice = "take such samples as missing (--missing; in Python missing=True)"
                raise LogError(
                    f"{origin}: {series.source}, sample {row + 1}, column '{heading}': found {values[row]}; {advice}"
                )


def listing(path: Path, origin: str, kind: Kind) -> tuple[list[Part], list[str]]:
    """What a foreign file has, and what of it cannot be read.

    Raises:
        LogError: damaged or cut off.
        MissingExtraError: the library for this kind of file is not installed.
    """
    said = Said()
    if kind == "bag":
        return bags.parts(path, origin), []
    if kind == "matlab":
        return arrays_of.parts(arrays_of.leaves(matlab.tree(path, origin, [], said))), said.doubts
    with hdf5.opened(path, origin, said) as (tree, separator):
        return arrays_of.parts(arrays_of.leaves(tree, separator)), said.doubts


def listed(path: Path, origin: str, kind: Kind) -> str:
    """What a foreign file has, as a mapping file to be edited; errors as for :func:`listing`."""
    parts, doubts = listing(path, origin, kind)
    return skeleton(path.name, parts, stamps=kind == "bag", doubts=doubts)


def not_mapped(path: Path, origin: str, kind: Kind) -> LogError:
    """The error that a foreign file without a mapping is answered with: what it has, and what to do."""
    parts, doubts = listing(path, origin, kind)
    shown = [
        f"  {part.source}  ({', '.join(filter(None, [part.kind, part.shape, part.about]))})" for part in parts[:20]
    ]
    more = [f"  ... and {len(parts) - 20} more"] if len(parts) > 20 else []
    return LogError(
        "\n".join(
            [
                f"{origin}: which of its parts are which columns of a log? A mapping file says so: "
                f"bha convert {origin} --list > {origin}.columns.toml writes one to be edited. It has:",
                *(shown or ["  nothing that could be a column"]),
                *more,
                *(f"  {doubt}" for doubt in doubts),
            ]
        )
    )
