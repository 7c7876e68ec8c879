"""Files of named arrays (MATLAB, HDF5): what they have, and series of what is mapped.

A file is a tree: mappings by name, lists (struct arrays, cells), arrays, texts. An array is named by its way through
the tree, ``logsout.signals[0].values``; one column of it by its place, ``logsout.signals[0].values[2]``; all places
count from 0. Where entries of a list have names (``Name`` or ``label``), these stand for the place
too: ``rec.Y[p1].Data``.

Times belong to the arrays below the same structure: ``time`` of a structure with time of Simulink, ``X`` of a recording
of dSPACE. Else they are what the mapping maps to ``t``, or an array called ``t``, ``time`` or ``tout`` beside all.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from bha.errors import LogError
from bha.logs.foreign import proposals
from bha.logs.foreign.mapping import Entry, MappingFile, Quaternion, head_headings
from bha.logs.foreign.series import Array, Foreign, Part, Said, Series, named_faults
from bha.logs.headings import named
from bha.logs.units import UnitError, factor_to_si

_TIME_NAMES = ("time", "t", "tout", "timestamp", "timestamps")
_NAMES, _UNITS = ("Name", "label", "name", "blockName"), ("Unit", "unit", "units")
_DEEPEST, _MOST = 12, 20_000


@dataclass(frozen=True)
class Leaf:
    """An array of a file.

    Attributes:
        source: its way through the file.
        values: an array, or what NumPy can make one from: loaded when needed.
        about: what is known by the structures that it lies in.
    """

    source: str
    values: Any
    about: Context

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape as it is stored."""
        return tuple(int(n) for n in self.values.shape)

    @property
    def unit(self) -> str:
        """The unit that stands beside it, or empty."""
        return str(getattr(self.values, "unit", "")) or self.about.unit


@dataclass(frozen=True)
class Context:
    """What the structures around an array say of it.

    Attributes:
        time: the array with its times, if one belongs to it by the structure of the file.
        own_time: whether that one lies in a structure of its own, not beside all arrays.
        names: of the structures, outermost first.
        unit: that stands beside it, or empty.
    """

    time: str | None = None
    own_time: bool = False
    names: tuple[str, ...] = ()
    unit: str = ""

    def inside(self, node: Any) -> Context:
        """The same below a node, by the name and the unit that stand in it."""
        if not isinstance(node, Mapping):
            return self
        name = next((str(node[key]) for key in _NAMES if isinstance(node.get(key), str) and node[key]), None)
        unit = next((str(node[key]) for key in _UNITS if isinstance(node.get(key), str) and node[key]), "")
        return replace(self, names=self.names if name is None else (*self.names, name), unit=unit or self.unit)


def leaves(tree: Mapping[str, Any], separator: str = ".") -> dict[str, Leaf]:
    """All arrays of numbers of a file by source."""
    walk = _Walk(separator).below("", tree, Context(), _DEEPEST)
    return {leaf.source: leaf for leaf in islice(walk, _MOST)}


@dataclass(frozen=True)
class _Walk:
    """Through a tree; ``separator`` stands between names."""

    separator: str

    def below(self, way: str, node: Any, context: Context, depth: int) -> Iterator[Leaf]:
        """All arrays below a node."""
        if depth < 0:
            return
        if isinstance(node, Mapping):
            there = self._time_of(way, node)
            if there is not None:
                context = replace(context, time=there, own_time=bool(way))
            for name, inner in node.items():
                where = self._joined(way, name)
                if name == "Y" and "X" in node:
                    yield from self._of_dspace(way, node, context, depth)
                    continue
                own = replace(context, time=None, own_time=False) if where == context.time else context
                yield from self.below(where, inner, own.inside(inner), depth - 1)
        elif isinstance(node, list):
            for k, inner in enumerate(node):
                yield from self.below(f"{way}[{k}]", inner, context.inside(inner), depth - 1)
        elif _is_array(node):
            yield Leaf(way, node, context)

    def _of_dspace(self, way: str, node: Mapping[str, Any], context: Context, depth: int) -> Iterator[Leaf]:
        """A recording of dSPACE: each of Y names its time among X, counted from 1."""
        given = node["Y"] if isinstance(node["Y"], list) else [node["Y"]]
        times = node["X"] if isinstance(node["X"], list) else [node["X"]]
        for k, inner in enumerate(given):
            index = np.ravel(inner.get("XIndex", 1)) if isinstance(inner, Mapping) else np.ones(1)
            number = int(index[0]) - 1 if index.size and index.dtype.kind in "iuf" else 0
            place = f"[{min(max(number, 0), len(times) - 1)}]" if isinstance(node["X"], list) else ""
            time = self._joined(self._joined(way, "X") + place, "Data")
            here = self._joined(way, "Y") + (f"[{k}]" if isinstance(node["Y"], list) else "")
            own = replace(context, time=time, own_time=True).inside(inner)
            yield from self.below(here, inner, own, depth - 1)

    def _joined(self, way: str, name: str) -> str:
        return f"{way}{self.separator}{name}" if way or self.separator == "/" else name

    def _time_of(self, way: str, node: Mapping[str, Any]) -> str | None:
        for name, inner in node.items():
            if name.lower() in _TIME_NAMES and _is_array(inner) and max(inner.shape, default=0) == _size(inner) > 1:
                return self._joined(way, name)
        return None


def _size(array: Any) -> int:
    return math.prod(int(n) for n in array.shape)


def _is_array(node: Any) -> bool:
    return hasattr(node, "shape") and hasattr(node, "dtype") and node.dtype.kind in "iufb"


def parts(found: Mapping[str, Leaf]) -> list[Part]:
    """What a file has, to be listed; single numbers are left out."""
    listed = []
    times = {leaf.about.time: leaf.about.own_time for leaf in found.values() if leaf.about.time}
    for leaf in found.values():
        if _size(leaf.values) < 2:
            continue
        said = [*leaf.about.names, f"unit {leaf.unit}" if leaf.unit else ""]
        said.append(f"times in {leaf.about.time}" if leaf.about.time else "")
        if leaf.source in times:
            proposal = "" if times[leaf.source] else '"t [s]"'
        else:
            of_time = found.get(leaf.about.time or "")
            rows = 0 if of_time is None else _size(of_time.values)
            proposal = _proposed(leaf, rows)
        shape = " x ".join(map(str, leaf.shape))
        about = ", ".join(filter(None, said))
        listed.append(Part(leaf.source, str(leaf.values.dtype), shape, max(leaf.shape), None, about, proposal))
    return listed


def _proposed(leaf: Leaf, rows: int) -> str:
    """What an array might be, by its own name and those of the structures around it."""
    count, rest = divmod(_size(leaf.values), rows) if rows else (0, 1)
    if rest:
        return ""
    last = re.split(r"[./]", leaf.source)[-1]
    called = [re.split(r"[./]", name)[-1] for name in reversed(leaf.about.names)]
    for text in (last, *called):
        proposal = (
            proposals.of_one(text, leaf.unit) or proposals.of_pressure(text, leaf.unit)
            if count == 1
            else proposals.of_several(text, count, leaf.unit)
        )
        if proposal:
            return proposal
    return ""


def read(origin: str, found: Mapping[str, Leaf], mapping: MappingFile, said: Said) -> Foreign:
    """The mapped arrays, those with one time together.

    Raises:
        LogError: an array that is not there, without times or of another shape than is mapped; times that are no
            numbers or run backwards.
    """
    if mapping.stamp is not None:
        raise LogError(f"{mapping.origin}: time: stamp: is for messages of bags; {origin} has arrays")
    gathered: dict[str, Series] = {}
    for entry in mapping.entries:
        if entry.is_time:
            _leaf_of(origin, mapping, found, entry.source)
            continue
        leaf, column = _leaf_of(origin, mapping, found, entry.source)
        time_source = _time_source(origin, mapping, found, entry, leaf)
        if time_source not in gathered:
            time = _times(origin, mapping, found, entry, time_source, leaf)
            gathered[time_source] = Series(time_source, time, {})
        series = gathered[time_source]
        rows = len(series.time)
        table = _table(origin, leaf, rows, time_source)
        if column is not None:
            if not column < table.shape[1]:
                raise LogError(f"{origin}: {entry.source}: the array has {table.shape[1]} columns, counted from 0")
            table = table[:, [column]]
        series.columns.update(_components(origin, entry, table))
    for source in gathered:
        if source.startswith(_BY_RATE):
            said.notes.append(f"times are made from {mapping.rate:g} rows per second")
    return Foreign(tuple(gathered.values()), tuple(dict.fromkeys(said.notes)), tuple(said.doubts))


_BY_RATE = "rate, "


def _leaf_of(origin: str, mapping: MappingFile, found: Mapping[str, Leaf], source: str) -> tuple[Leaf, int | None]:
    """The array of a source, and the column of it that is meant; None for all."""
    if source in found:
        return found[source], None
    inner, _, place = source.removesuffix("]").rpartition("[")
    if source.endswith("]") and place.isdigit() and inner in found:
        return found[inner], int(place)
    by_name = _with_names(found)
    if source in by_name:
        return found[by_name[source]], None
    if source.endswith("]") and place.isdigit() and inner in by_name:
        return found[by_name[inner]], int(place)
    near = difflib.get_close_matches(source, found, n=1, cutoff=0.5)
    known = ", ".join(list(found)[:20]) or "no arrays of numbers"
    hint = f"nearest: '{near[0]}'" if near else f"the file has: {known}"
    raise LogError(f"{origin}: there is no array '{source}'; {hint} (mapped by {mapping.origin})")


def _with_names(found: Mapping[str, Leaf]) -> dict[str, str]:
    """Sources with the name of a list's entry instead of its place."""
    named_sources: dict[str, str] = {}
    for source, leaf in found.items():
        name = leaf.about.names[-1] if leaf.about.names else ""
        head, bracket, rest = source.rpartition("[")
        place, _, tail = rest.partition("]")
        if name and bracket and place.isdigit():
            named_sources.setdefault(f"{head}[{name}]{tail}", source)
    return named_sources


def _time_source(origin: str, mapping: MappingFile, found: Mapping[str, Leaf], entry: Entry, leaf: Leaf) -> str:
    if entry.time is not None:
        _leaf_of(origin, mapping, found, entry.time)
        return entry.time
    if leaf.about.time is not None and leaf.about.own_time and leaf.about.time in found:
        return leaf.about.time
    if mapping.time is not None:
        return mapping.time.source
    if mapping.rate is not None:
        return f"{_BY_RATE}{max(leaf.shape, default=0)} rows"
    if leaf.about.time is not None and leaf.about.time in found:
        return leaf.about.time
    raise LogError(
        f'{origin}: {entry.source} has no times: map some array to "t [s]" ({mapping.origin}), name one by '
        'time = "...", or write rate = ... (rows per second) under [time]'
    )


def _times(
    origin: str, mapping: MappingFile, found: Mapping[str, Leaf], entry: Entry, source: str, leaf: Leaf
) -> Array:
    if source.startswith(_BY_RATE) and mapping.rate is not None:
        return np.arange(max(leaf.shape, default=0)) / mapping.rate
    of_times, column = _leaf_of(origin, mapping, found, source)
    values = _loaded(origin, of_times)
    if column is not None:
        values = np.atleast_2d(values)[:, column] if values.ndim == 2 and column < values.shape[1] else values.ravel()
    if values.size == 0 or max(values.shape) != values.size:
        shape = " x ".join(map(str, values.shape))
        raise LogError(f"{origin}: {source}: times are one row or column of numbers; found {shape}")
    unit = entry.time_unit
    if mapping.time is not None and source == mapping.time.source:
        unit = named(mapping.time.headings[0])[1] or "s"
    try:
        factor = factor_to_si(unit, "s")
    except UnitError as error:
        raise LogError(f"{mapping.origin}: {source}: {error}") from error
    time = values.reshape(-1)
    if not np.isfinite(time).all():
        row = int(np.argmin(np.isfinite(time)))
        raise LogError(
            f"{origin}: {source}, row {row + 1}: found {time[row]}; a row without a time has no place in a log"
        )
    back = np.diff(time) < 0
    if back.any():
        row = int(np.argmax(back)) + 1
        text = f"time runs backwards, from {time[row - 1]} to {time[row]}"
        raise LogError(f"{origin}: {source}, row {row + 1}: {text}; times may repeat but not decrease")
    return time * factor


def _loaded(origin: str, leaf: Leaf) -> Array:
    with named_faults(f"{origin}: {leaf.source}", "the array"):
        values = np.asarray(leaf.values)
        with np.errstate(over="ignore", invalid="ignore"):
            return np.array(values, dtype=np.float64)


def _table(origin: str, leaf: Leaf, rows: int, time_source: str) -> Array:
    """An array as one row for each time, whatever axis its times run along; shape (rows, k)."""
    values = _loaded(origin, leaf)
    along = [axis for axis, length in enumerate(values.shape) if length == rows]
    if values.ndim and values.size == rows:
        return values.reshape(rows, 1)
    if len(along) != 1:
        shape = " x ".join(map(str, values.shape)) or "one number"
        text = f"found {shape}; expected one axis of {rows}, the length of {time_source}"
        raise LogError(f"{origin}: {leaf.source}: {text}")
    return np.moveaxis(values, along[0], 0).reshape(rows, -1)


def _components(origin: str, entry: Entry, table: Array) -> dict[str, Array]:
    entry = _fitting(origin, entry, table.shape[1])
    if table.shape[1] != len(entry.headings):
        wanted = f"{len(entry.headings)} channel{'s are' if len(entry.headings) > 1 else ' is'} mapped to it"
        raise LogError(
            f"{origin}: {entry.source}: has {table.shape[1]} columns; {wanted} (name one as {entry.source}[0], or all "
            "as channels = [...])"
        )
    order = list(range(table.shape[1]))
    if entry.quaternion == "xyzw" and "orientation" in entry.parts:
        order = [*order[:-4], order[-1], *order[-4:-1]]
    return {
        heading: np.ascontiguousarray(table[:, place])
        for heading, place in zip(entry.headings, order, strict=True)
        if heading
    }


_WIDTHS: dict[int, tuple[str, ...]] = {3: ("position",), 4: ("orientation",), 7: ("position", "orientation")}


def _fitting(origin: str, entry: Entry, width: int) -> Entry:
    """The entry of a pose with the parts that its array has: 3 columns, 4, or 7."""
    if entry.head is None:
        return entry
    parts = entry.parts if entry.stated_parts else _WIDTHS.get(width, ())
    if _WIDTHS.get(width) != parts:
        raise LogError(
            f"{origin}: {entry.source}: has {width} columns; a head has 3 (position), 4 (quaternion) or 7 (both)"
        )
    quaternion: Quaternion | None = entry.quaternion
    if "orientation" in parts and quaternion is None:
        raise LogError(
            f'{origin}: {entry.source}: which number of the quaternion is the scalar? Write quaternion = "wxyz" '
            '(first) or "xyzw" (last)'
        )
    return replace(entry, parts=parts, headings=head_headings(entry.head, parts, entry.unit))
