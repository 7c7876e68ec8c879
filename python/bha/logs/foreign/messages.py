"""Messages of ROS: numbers, arrays and poses at a path through their fields, whatever their type is called.

A path is what follows the topic in a mapping file: ``.pose.position.x``, ``.data[2]``, ``.position[lift]``. A word in
brackets is looked for in the field ``name`` beside the array, as a ``JointState`` has it. What has a position and an
orientation (or a translation and a rotation) is a pose, however deep it lies.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from bha.logs.foreign.mapping import Entry

Step = str | int | tuple[str]

_STEP = re.compile(r"\.(?P<field>\w+)|\[(?P<index>\d+)\]|\[(?P<label>[^\[\]]+)\]")
#: How deep poses are looked for.
_DEEPEST = 4


class PathError(ValueError):
    """A path leads nowhere in a message, or to something else than what is mapped. The text says what is there."""


def steps_of(path: str) -> tuple[Step, ...]:
    """The steps of a path: names of fields, indices, and labels as tuples of one text.

    Raises:
        PathError: not a path.
    """
    steps: list[Step] = []
    place = 0
    while place < len(path):
        found = _STEP.match(path, place)
        if found is None:
            raise PathError(f"'{path[place:]}' is no path; expected .field, [index] or [name of a joint]")
        if found["field"]:
            steps.append(found["field"])
        else:
            steps.append(int(found["index"]) if found["index"] else (found["label"],))
        place = found.end()
    return tuple(steps)


def at(message: Any, steps: Sequence[Step]) -> Any:
    """What stands in a message at the end of a path.

    Raises:
        PathError: nothing does; the text names what is there.
    """
    owner, value, done = None, message, ""
    for step in steps:
        if isinstance(step, str):
            fields = fields_of(value)
            if step not in fields:
                near = difflib.get_close_matches(step, fields, n=1)
                hint = f"nearest: '{near[0]}'" if near else f"there are: {', '.join(fields) or 'none'}"
                raise PathError(f"there is no field '{step}'{f' in {done}' if done else ''}; {hint}")
            owner, value, done = value, getattr(value, step), f"{done}.{step}"
            continue
        length = _length(value)
        if length is None:
            raise PathError(f"{done or 'the message'} is no array")
        index = step if isinstance(step, int) else _labelled(owner, step[0], done)
        if not 0 <= index < length:
            raise PathError(f"{done}[{index}]: the array has {length} entries, counted from 0")
        owner, value, done = None, value[index], f"{done}[{index}]"
    return value


def _labelled(owner: Any, label: str, done: str) -> int:
    labels = list(getattr(owner, "name", ()))
    if label not in labels:
        known = ", ".join(map(str, labels[:12])) or "none"
        raise PathError(f"{done}[{label}]: no such name beside the array; there are: {known}")
    return labels.index(label)


def fields_of(value: Any) -> list[str]:
    """Names of the fields of a message; none for what is no message."""
    return [name for name in getattr(type(value), "__dataclass_fields__", {}) if not name.startswith("_")]


def _length(value: Any) -> int | None:
    return len(value) if isinstance(value, list | tuple | np.ndarray) else None


def numbers(value: Any, entry: Entry) -> list[float]:
    """The components of an entry, in the order of its headings.

    Raises:
        PathError: the value is something else than what is mapped.
    """
    if entry.head is not None:
        return _pose_numbers(value, entry)
    if isinstance(value, bool | int | float | np.number):
        found = [float(value)]
    elif (length := _length(value)) is not None:
        try:
            found = np.asarray(value, dtype=np.float64).reshape(length).tolist()
        except (TypeError, ValueError) as error:
            raise PathError("is an array of something else than numbers") from error
    else:
        fields = ", ".join(fields_of(value)) or "no numbers"
        raise PathError(f"is a {_kind(value)}, no number; name a field of it ({fields}), or map a pose with head = 1")
    if len(found) != len(entry.headings):
        what = "an array of 1 number" if len(found) == 1 else f"an array of {len(found)} numbers"
        wanted = f"{len(entry.headings)} channels are" if len(entry.headings) > 1 else "1 channel is"
        raise PathError(f"is {what}; {wanted} mapped to it (name one as [0], or all as channels = [...])")
    return found


def _kind(value: Any) -> str:
    return getattr(type(value), "__msgtype__", type(value).__name__)


def pose_of(value: Any) -> tuple[Any, Any] | None:
    """Position and quaternion messages of what has a pose; None for what has none. Either may be None."""
    for _ in range(_DEEPEST):
        fields = fields_of(value)
        for position, orientation in (("position", "orientation"), ("translation", "rotation")):
            if position in fields and orientation in fields:
                return getattr(value, position), getattr(value, orientation)
        if {"x", "y", "z"} <= set(fields):
            return (None, value) if "w" in fields else (value, None)
        deeper = [name for name in ("pose", "transform", "point") if name in fields]
        if not deeper:
            return None
        value = getattr(value, deeper[0])
    return None


def _pose_numbers(value: Any, entry: Entry) -> list[float]:
    found = pose_of(value)
    if found is None:
        raise PathError(f"is a {_kind(value)}, no pose: it has no position and orientation")
    listed: list[float] = []
    for part, message, axes in zip(("position", "orientation"), found, ("xyz", "wxyz"), strict=True):
        if part not in entry.parts:
            continue
        if message is None:
            raise PathError(f"has no {part}; write parts = {[p for p in entry.parts if p != part]}")
        listed += [float(getattr(message, axis)) for axis in axes]
    return listed


def stamp_of(message: Any) -> int | None:
    """The stamp in a message's header, ns; None where it has no header."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None:
        return None
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def frame_of(message: Any) -> str | None:
    """The frame that a message's header names; None where it has no header."""
    frame = getattr(getattr(message, "header", None), "frame_id", None)
    return None if frame is None else str(frame)
