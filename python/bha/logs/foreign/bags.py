"""ROS bags: ROS 1 (``.bag``), ROS 2 (a folder with ``metadata.yaml``, or ``.db3``) and MCAP, read by ``rosbags``.

Messages come one by one; only those of mapped topics are decoded, so memory is that of the columns. Definitions of
messages are those in the bag; bags of ROS 2 that have none are read by those of the distribution they name.
"""

from __future__ import annotations

import difflib
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from bha.errors import LogError
from bha.logs.foreign import messages
from bha.logs.foreign.clocks import Stamps, times_of
from bha.logs.foreign.mapping import Entry, MappingFile
from bha.logs.foreign.messages import PathError
from bha.logs.foreign.series import Foreign, Part, Said, Series, named_faults
from bha.logs.foreign.topics import parts_of_message, parts_of_transforms
from bha.logs.formats import Progress
from bha.support.extras import import_extra

_EXTRA = {"extra": "bags", "purpose": "Reading ROS bags and MCAP"}
_ADVICE = "rosbag reindex, ros2 bag reindex or mcap recover may save what is whole of it"
#: Of bags of ROS 2 that neither have definitions nor name their distribution.
_DISTRIBUTION = "humble"
_BETWEEN_FRAMES = "->"
#: Messages between two calls of the progress.
_WATCH = 512


@contextmanager
def _opened(path: Path, origin: str) -> Iterator[Any]:
    """An open reader of ``rosbags``, with ``connections`` and ``messages``."""
    one = import_extra("rosbags.rosbag1", **_EXTRA)
    two = import_extra("rosbags.rosbag2", **_EXTRA)
    with named_faults(origin, "the bag", _ADVICE):
        reader = one.Reader(path) if _is_one(path) else two.Reader(path)
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def _is_one(path: Path) -> bool:
    if path.suffix == ".bag" or not path.is_file():
        return path.suffix == ".bag"
    with path.open("rb") as file:
        return file.read(8) == b"#ROSBAG "


class _Decoder:
    """Raw messages to objects, by the definitions in the bag or those of the distribution."""

    def __init__(self, reader: Any, origin: str) -> None:
        self._types = import_extra("rosbags.typesys", **_EXTRA)
        self._is_one = type(reader).__module__.startswith("rosbags.rosbag1")
        distribution = "noetic" if self._is_one else str(getattr(reader, "ros_distro", None) or _DISTRIBUTION)
        known = {store.name.partition("_")[2].lower(): store for store in self._types.Stores if "_" in store.name}
        self._standard = known.get(distribution.lower(), known[_DISTRIBUTION])
        self._stores: dict[int, Any] = {}
        self._origin = origin

    def __call__(self, connection: Any, raw: bytes) -> Any:
        """The message; what is damaged in it is an error that names topic and type."""
        if connection.id not in self._stores:
            self._stores[connection.id] = self._store(connection)
        store = self._stores[connection.id]
        decode = store.deserialize_ros1 if self._is_one else store.deserialize_cdr
        with named_faults(f"{self._origin}: {connection.topic}", f"a message ({connection.msgtype})"):
            return decode(raw, connection.msgtype)

    def _store(self, connection: Any) -> Any:
        where = f"{self._origin}: {connection.topic}"
        encoding = getattr(connection.ext, "serialization_format", "ros1")
        if not self._is_one and encoding != "cdr":
            raise LogError(f"{where}: messages are encoded as {encoding!r}; those of ROS 2, 'cdr', can be read")
        definition = connection.msgdef
        if definition.data:
            idl = definition.format.name == "IDL"
            with named_faults(where, f"the definition of {connection.msgtype}"):
                store = self._types.get_typestore(self._types.Stores.EMPTY)
                store.register(
                    self._types.get_types_from_idl(definition.data)
                    if idl
                    else self._types.get_types_from_msg(definition.data, connection.msgtype)
                )
                store.get_msgdef(connection.msgtype)
                return store
        store = self._types.get_typestore(self._standard)
        if connection.msgtype not in store.fielddefs:
            raise LogError(
                f"{where}: the definition of {connection.msgtype} is neither in the bag nor one of ROS's own; bags "
                "that are recorded as MCAP have the definitions of all messages in them (ros2 bag convert)"
            )
        return store


@dataclass
class _Group:
    """Samples of one topic, or of one pair of frames of a topic of transforms, while they are gathered."""

    source: str
    stamped: bool = True
    stamps: array[int] = field(default_factory=lambda: array("q"))
    received: array[int] = field(default_factory=lambda: array("q"))
    values: dict[str, array[float]] = field(default_factory=dict)
    entries: list[tuple[Entry, tuple[messages.Step, ...]]] = field(default_factory=list)
    frames: tuple[str, str] | None = None


def read(path: Path, origin: str, mapping: MappingFile, progress: Progress | None) -> Foreign:
    """The mapped parts of a bag.

    Raises:
        LogError: a bag that is damaged or cut off, a topic or field that is not there, a message of an unknown kind.
        MissingExtraError: rosbags is not installed.
    """
    if mapping.time is not None or mapping.rate is not None:
        found = "rate" if mapping.time is None else f'"{mapping.time.source}" = "t [...]"'
        raise LogError(f'{mapping.origin}: {found}: messages have times; choose with stamp = "header" or "received"')
    said = Said()
    with _opened(path, origin) as reader:
        topics = _topics(reader)
        groups = _groups(origin, mapping, topics)
        wanted = [c for topic in groups for c in topics[topic]]
        total = sum(c.msgcount for c in wanted)
        decoder = _Decoder(reader, origin)
        seen = 0
        for connection, received, raw in _messages(reader, wanted, origin):
            _gather(origin, groups[connection.topic], decoder(connection, raw), int(received))
            seen += 1
            if progress is not None and seen % _WATCH == 0:
                progress(min(seen / max(total, 1), 1.0))
        if seen < total:
            raise LogError(f"{origin}: the bag is cut off: {seen} of {total} messages can be read; {_ADVICE}")
    if progress is not None:
        progress(1.0)
    listed = [group for of_topic in groups.values() for group in of_topic]
    for group in listed:
        _refuse_empty(origin, group, groups)
    stamps = [Stamps(g.source, np.array(g.stamps), np.array(g.received), g.stamped) for g in listed]
    times, orders = times_of(origin, stamps, mapping.stamp, said)
    series = tuple(
        Series(g.source, t, {heading: np.array(values)[order] for heading, values in g.values.items()})
        for g, t, order in zip(listed, times, orders, strict=True)
    )
    return Foreign(series, tuple(said.notes), tuple(said.doubts))


def _messages(reader: Any, wanted: Sequence[Any], origin: str) -> Iterator[tuple[Any, int, bytes]]:
    with named_faults(origin, "the bag", _ADVICE):
        source = iter(reader.messages(connections=list(wanted)))
    while True:
        with named_faults(origin, "the bag", _ADVICE):
            item = next(source, None)
        if item is None:
            return
        yield item


def _topics(reader: Any) -> dict[str, list[Any]]:
    topics: dict[str, list[Any]] = {}
    for connection in reader.connections:
        topics.setdefault(connection.topic, []).append(connection)
    return topics


def _groups(origin: str, mapping: MappingFile, topics: dict[str, list[Any]]) -> dict[str, list[_Group]]:
    """What is gathered of each topic that is mapped."""
    groups: dict[str, list[_Group]] = {}
    for entry in mapping.entries:
        topic, path = _split(entry.source, topics)
        if topic is None:
            near = difflib.get_close_matches(entry.source, topics, n=1, cutoff=0.4)
            hint = f"nearest: '{near[0]}'" if near else f"the bag has: {', '.join(sorted(topics)[:20]) or 'no topics'}"
            raise LogError(f"{origin}: there is no topic of '{entry.source}'; {hint}")
        if entry.time is not None:
            raise LogError(f'{mapping.origin}: "{entry.source}": time: messages have times of their own; leave it out')
        types = sorted({connection.msgtype for connection in topics[topic]})
        if len(types) > 1:
            raise LogError(f"{origin}: {topic} has messages of several types: {', '.join(types)}")
        frames, path = _frames(path)
        try:
            steps = messages.steps_of(path)
        except PathError as error:
            raise LogError(f'{mapping.origin}: "{entry.source}": {error}') from error
        source = topic if frames is None else f"{topic}[{_BETWEEN_FRAMES.join(frames)}]"
        group = next((g for g in groups.get(topic, ()) if g.frames == frames), None)
        if group is None:
            group = _Group(source, frames=frames)
            groups.setdefault(topic, []).append(group)
        group.entries.append((entry, steps))
        group.values |= {heading: array("d") for heading in entry.headings if heading}
    return groups


def _split(source: str, topics: dict[str, list[Any]]) -> tuple[str | None, str]:
    """The topic that a source begins with, and the path through its messages."""
    for topic in sorted(topics, key=len, reverse=True):
        rest = source.removeprefix(topic)
        if source.startswith(topic) and (not rest or rest[0] in ".["):
            return topic, rest
    return None, ""


def _frames(path: str) -> tuple[tuple[str, str] | None, str]:
    """Parent and child frame that a path begins with, ``[base->tip]``, and the rest of it."""
    if not path.startswith("["):
        return None, path
    inner, _, rest = path[1:].partition("]")
    if _BETWEEN_FRAMES not in inner:
        return None, path
    parent, _, child = inner.partition(_BETWEEN_FRAMES)
    return (parent.strip(), child.strip()), rest


def _gather(origin: str, groups: list[_Group], message: Any, received: int) -> None:
    for group in groups:
        if group.frames is None:
            _append(origin, group, message, received, messages.frame_of(message))
            continue
        transforms = getattr(message, "transforms", None)
        if transforms is None:
            raise LogError(f"{origin}: {group.source}: messages hold no transforms between frames")
        for transform in transforms:
            if (messages.frame_of(transform), str(transform.child_frame_id)) == group.frames:
                _append(origin, group, transform, received, group.frames[0])


def _append(origin: str, group: _Group, message: Any, received: int, frame: str | None) -> None:
    number = len(group.received) + 1
    for entry, steps in group.entries:
        if entry.frame is not None and frame != entry.frame:
            found = "no frame" if frame is None else f"frame '{frame}'"
            raise LogError(
                f"{origin}: {entry.source}, message {number}: found {found}; the mapping says '{entry.frame}'"
            )
        try:
            found_numbers = messages.numbers(messages.at(message, steps), entry)
        except PathError as error:
            kind = getattr(type(message), "__msgtype__", "")
            raise LogError(f"{origin}: {entry.source}, message {number} ({kind}): {error}") from error
        for heading, value in zip(entry.headings, found_numbers, strict=True):
            if heading:
                group.values[heading].append(value)
    stamp = messages.stamp_of(message)
    group.stamped &= stamp is not None
    group.stamps.append(stamp or 0)
    group.received.append(received)


def _refuse_empty(origin: str, group: _Group, groups: dict[str, list[_Group]]) -> None:
    if len(group.received):
        return
    if group.frames is None:
        raise LogError(f"{origin}: {group.source} has no messages; leave it out of the mapping")
    raise LogError(
        f"{origin}: {group.source}: there is no transform from '{group.frames[0]}' to '{group.frames[1]}'; "
        "bha convert FILE --list shows the pairs of frames"
    )


def parts(path: Path, origin: str) -> list[Part]:
    """What a bag has: a part for each number, array and pose of each topic, by its first message.

    Raises:
        LogError: the bag is damaged.
        MissingExtraError: rosbags is not installed.
    """
    listed: list[Part] = []
    with _opened(path, origin) as reader:
        decoder = _Decoder(reader, origin)
        seconds = max(reader.end_time - reader.start_time, 1) * 1e-9
        for topic, connections in sorted(_topics(reader).items()):
            count = sum(c.msgcount for c in connections)
            rate = (count - 1) / seconds if count > 1 else None
            kind = connections[0].msgtype
            try:
                first = [decoder(c, raw) for c, _, raw in islice(_messages(reader, connections, origin), 200)]
            except LogError as error:
                reason = str(error).removeprefix(f"{origin}: ").removeprefix(f"{topic}: ")
                listed.append(Part(topic, kind, count=count, rate=rate, about=reason))
                continue
            if not first:
                listed.append(Part(topic, kind, about="no messages"))
            elif hasattr(first[0], "transforms"):
                listed += parts_of_transforms(topic, kind, first, count, rate)
            else:
                listed += parts_of_message(topic, kind, first[0], count, rate)
    return listed
