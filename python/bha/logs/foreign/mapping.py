"""The mapping file: which part of a foreign file is which channel of a log.

::

    schema = "bha-columns/1"

    [time]
    stamp = "header"

    [columns]
    "/joints.position[lift]" = "q11 [m]"
    "/valves.data" = { channels = ["p11", "p12", "p13"], unit = "bar(g)" }
    "/tip" = { head = 1, frame = "mocap" }

A part of the file is named as ``bha convert FILE --list`` prints it.
"""

from __future__ import annotations

import difflib
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from bha import names
from bha.errors import LogError
from bha.logs.headings import named

SCHEMA = "bha-columns/1"
#: A file of this name beside a log maps it: ``run.bag.columns.toml``; or one for all files of the folder.
SUFFIX, OF_FOLDER = ".columns.toml", "columns.toml"
#: Bytes of a mapping file; what is larger is something else.
LARGEST_FILE = 1 << 20

Stamp = Literal["header", "received"]
Quaternion = Literal["wxyz", "xyzw"]

_ENTRY_KEYS = ("channel", "channels", "head", "unit", "parts", "quaternion", "frame", "time", "time_unit")
_PARTS = ("position", "orientation")


@dataclass(frozen=True)
class Entry:
    """One line of ``[columns]``.

    Attributes:
        source: the part of the file.
        headings: headings of its components in their order in the log; of a head position first, then orientation.
        head: number of the head whose pose it is; None for plain numbers.
        parts: what of a pose is taken, ``"position"``, ``"orientation"`` or both.
        stated_parts: whether the file says so itself.
        unit: unit of a head's position.
        quaternion: order of the four numbers of an orientation in an array; None: not stated.
        frame: the frame that poses must be in; None: any.
        time: the part of the file that has its times; None: the one that belongs to it.
        time_unit: unit of these.
    """

    source: str
    headings: tuple[str, ...]
    head: int | None = None
    parts: tuple[str, ...] = _PARTS
    stated_parts: bool = False
    unit: str = "m"
    quaternion: Quaternion | None = None
    frame: str | None = None
    time: str | None = None
    time_unit: str = "s"

    @property
    def is_time(self) -> bool:
        """Whether it is the time of what has no time of its own."""
        return len(self.headings) == 1 and named(self.headings[0])[0] == names.TIME


@dataclass(frozen=True)
class MappingFile:
    """A whole mapping file.

    Attributes:
        origin: what errors call it.
        entries: of ``[columns]``.
        stamp: which time of a message counts; None: not stated.
        rate: rows per second of files without times, 1/s.
        text: as it stands, for the hash of what was read by it.
    """

    origin: str
    entries: tuple[Entry, ...]
    stamp: Stamp | None = None
    rate: float | None = None
    text: str = field(default="", compare=False)

    @property
    def time(self) -> Entry | None:
        """The entry that is the time of what has no time of its own."""
        return next((entry for entry in self.entries if entry.is_time), None)


def beside(path: Path, *, of_folder: bool) -> Path | None:
    """The mapping file that lies beside a log; None if none does.

    Args:
        path: the log.
        of_folder: whether one for all files of the folder counts.
    """
    own = path.with_name(path.name + SUFFIX)
    if own.is_file():
        return own
    common = path.with_name(OF_FOLDER)
    return common if of_folder and common.is_file() else None


def mapping_given(given: str | os.PathLike[str] | Mapping[str, Any] | None) -> MappingFile | None:
    """The mapping that a caller gives: a file's path, or what the file amounts to; None for none.

    Raises:
        LogError: as :func:`read_mapping`.
    """
    if given is None:
        return None
    return mapping_of(given, "<mapping>", repr(given)) if isinstance(given, Mapping) else read_mapping(given)


def read_mapping(path: str | os.PathLike[str]) -> MappingFile:
    """Read a mapping file.

    Raises:
        LogError: missing, not TOML or not a mapping; every fault with its key, what was found and what is allowed.
    """
    origin = os.fspath(path)
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        raise LogError(f"{origin}: the mapping file cannot be read: {getattr(error, 'strerror', error)}") from error
    if len(content) > LARGEST_FILE:
        raise LogError(f"{origin}: is larger than a mapping file may be, {LARGEST_FILE >> 20} MiB")
    try:
        text = content.decode().removeprefix("\ufeff")
        mapping = tomllib.loads(text.replace("\r\n", "\n"))
    except (ValueError, RecursionError) as error:
        raise LogError(f"{origin}: not a TOML file: {error}") from error
    return mapping_of(mapping, origin, text)


def mapping_of(mapping: Mapping[str, Any], origin: str, text: str = "") -> MappingFile:
    """A mapping file from what its TOML amounts to.

    Raises:
        LogError: as :func:`read_mapping`.
    """
    if mapping.get("schema") != SCHEMA:
        found = f"found {mapping['schema']!r}" if "schema" in mapping else "missing"
        raise LogError(f'{origin}: schema: {found}; a mapping file begins with: schema = "{SCHEMA}"')
    faults: list[str] = []
    _unknown(mapping, ("schema", "time", "columns"), "", faults)
    stamp, rate = _time(mapping.get("time", {}), faults)
    columns = mapping.get("columns")
    entries: list[Entry] = []
    if not isinstance(columns, Mapping) or not columns:
        faults.append('columns: missing; expected a table such as \'"/valves.data[0]" = "p11 [bar(g)]"\'')
    else:
        for source, value in columns.items():
            try:
                entries.append(_entry(source, value))
            except _EntryError as error:
                faults.append(f'columns: "{source}": {error}')
    seen: dict[str, str] = {}
    for entry in entries:
        for heading in filter(None, entry.headings):
            name = named(heading)[0]
            if name in seen:
                faults.append(f'columns: "{entry.source}": {name} is mapped to "{seen[name]}" already; leave one out')
            seen[name] = entry.source
    if faults:
        raise LogError("\n".join(f"{origin}: {fault}" for fault in faults[:10]))
    return MappingFile(origin, tuple(entries), stamp, rate, text)


class _EntryError(ValueError):
    """What is wrong with an entry."""


def _unknown(table: Mapping[str, Any], allowed: Sequence[str], where: str, faults: list[str]) -> None:
    for key in table:
        if key not in allowed:
            near = difflib.get_close_matches(str(key), allowed, n=1)
            hint = f"nearest allowed: {near[0]!r}" if near else f"allowed: {', '.join(allowed)}"
            faults.append(f"{where}{key}: unknown key; {hint}")


def _time(table: Any, faults: list[str]) -> tuple[Stamp | None, float | None]:
    if not isinstance(table, Mapping):
        faults.append(f"time: found {table!r}; expected a table with stamp or rate")
        return None, None
    _unknown(table, ("stamp", "rate"), "time: ", faults)
    stamp, rate = table.get("stamp"), table.get("rate")
    if stamp not in (None, "header", "received"):
        faults.append(f'time: stamp: found {stamp!r}; allowed: "header" (when measured) or "received" (when recorded)')
    if rate is not None and not (isinstance(rate, int | float) and not isinstance(rate, bool) and 0 < rate <= 1e9):
        faults.append(f"time: rate: found {rate!r}; allowed: a number > 0 (rows per second)")
        rate = None
    return stamp, rate


def _entry(source: str, value: Any) -> Entry:
    if isinstance(value, str):
        return Entry(source, (_heading(value),))
    if not isinstance(value, Mapping):
        raise _EntryError(
            f'found {value!r}; expected a heading such as "p11 [bar(g)]", or a table with channel, channels or head'
        )
    faults: list[str] = []
    _unknown(value, _ENTRY_KEYS, "", faults)
    if faults:
        raise _EntryError("; ".join(faults))
    stated = [key for key in ("channel", "channels", "head") if key in value]
    if len(stated) != 1:
        found = " and ".join(stated) or "none of them"
        raise _EntryError(f"found {found}; expected one of channel, channels and head")
    unit = _text(value, "unit")
    common: dict[str, Any] = {
        "frame": _text(value, "frame"),
        "time": _text(value, "time"),
        "time_unit": _text(value, "time_unit") or "s",
    }
    if "head" in value:
        return _head(source, value, unit or "m", common)
    for key in ("parts", "quaternion"):
        if key in value:
            raise _EntryError(f"{key} belongs to a head; found {stated[0]}")
    if "channel" in value:
        return Entry(source, (_heading(_with_unit(_text(value, "channel") or "", unit)),), **common)
    channels = value["channels"]
    if not isinstance(channels, list) or not channels or not all(isinstance(c, str) for c in channels):
        raise _EntryError(f'channels: found {channels!r}; expected names in order, such as ["p11", "p12"]')
    # A component that is not wanted has an empty name.
    return Entry(source, tuple(_heading(_with_unit(c, unit)) if c else "" for c in channels), **common)


def _head(source: str, value: Mapping[str, Any], unit: str, common: Mapping[str, Any]) -> Entry:
    head = value["head"]
    if not isinstance(head, int) or isinstance(head, bool) or not 1 <= head <= 999:
        raise _EntryError(f"head: found {head!r}; allowed: the number of a section, from 1")
    quaternion = value.get("quaternion")
    if quaternion not in (None, "wxyz", "xyzw"):
        raise _EntryError(f'quaternion: found {quaternion!r}; allowed: "wxyz" (scalar first) or "xyzw" (scalar last)')
    stated = value.get("parts")
    asked = stated if isinstance(stated, list) else [stated] if stated is not None else list(_PARTS)
    if not asked or any(part not in _PARTS for part in asked):
        raise _EntryError(f'parts: found {stated!r}; allowed: "position", "orientation", or both in a list')
    parts = tuple(part for part in _PARTS if part in asked)
    return Entry(
        source,
        head_headings(head, parts, unit),
        head=head,
        parts=parts,
        stated_parts=stated is not None,
        unit=unit,
        quaternion=quaternion,
        **common,
    )


def head_headings(head: int, parts: Sequence[str], unit: str) -> tuple[str, ...]:
    """The headings of a head's pose, ``("x1 [m]", ..., "ow1", ...)``."""
    listed: list[str] = []
    if "position" in parts:
        listed += [names.column(name, unit) for name in names.position_names(head)]
    if "orientation" in parts:
        listed += [names.column(name, "1") for name in names.orientation_names(head)]
    return tuple(listed)


def _text(value: Mapping[str, Any], key: str) -> str | None:
    found = value.get(key)
    if found is not None and not (isinstance(found, str) and found):
        raise _EntryError(f"{key}: found {found!r}; expected a text")
    return found


def _with_unit(channel: str, unit: str | None) -> str:
    if unit is None or named(channel)[1] is not None:
        return channel
    return names.column(channel, unit)


def _heading(text: str) -> str:
    """A heading; one whose name is a quantity's must have its unit."""
    heading = text.strip()
    name, unit = named(heading)
    if not name:
        raise _EntryError('found an empty channel; expected a heading such as "p11 [bar(g)]"')
    quantity = names.quantity(name)
    if quantity is not None and unit is None and quantity.unit != "1":
        raise _EntryError(f"'{heading}' has no unit; write it as '{names.column(name, quantity.unit)}'")
    return heading
