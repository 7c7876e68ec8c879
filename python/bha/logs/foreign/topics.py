"""What the messages of a topic have, to be listed, and what a mapping of it might be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from bha.logs.foreign import proposals
from bha.logs.foreign.messages import fields_of, frame_of, pose_of
from bha.logs.foreign.series import Part

_DEEPEST, _MOST_ENTRIES = 6, 64


def parts_of_message(topic: str, kind: str, message: Any, count: int, rate: float | None) -> list[Part]:
    """The parts of a topic by one of its messages: its pose, if it is one, else its numbers and arrays."""
    frame = frame_of(message)
    about = f"frame '{frame}'" if frame else ""
    found = pose_of(message)
    if found is not None:
        return [Part(topic, kind, "", count, rate, about, _head(found, frame))]
    return list(_leaves(topic, "", kind, message, count, rate, about, _DEEPEST))


def parts_of_transforms(topic: str, kind: str, messages: Sequence[Any], count: int, rate: float | None) -> list[Part]:
    """A part for each pair of frames of a topic of transforms."""
    pairs: dict[tuple[str, str], int] = {}
    for message in messages:
        for transform in message.transforms:
            pair = (str(frame_of(transform)), str(transform.child_frame_id))
            pairs[pair] = pairs.get(pair, 0) + 1
    share = {pair: n / len(messages) for pair, n in pairs.items()}
    return [
        Part(
            f"{topic}[{parent}->{child}]",
            kind,
            "",
            round(count * share[parent, child]),
            None if rate is None else rate * share[parent, child],
            f"frame '{parent}'",
            f'{{ head = 1, frame = "{parent}" }}',
        )
        for parent, child in pairs
    ]


def _head(pose: tuple[Any, Any], frame: str | None = None) -> str:
    position, orientation = pose
    return proposals.of_pose(position is not None, orientation is not None, frame)


def _leaves(
    topic: str, path: str, kind: str, value: Any, count: int, rate: float | None, about: str, depth: int
) -> Iterator[Part]:
    """Numbers, arrays and poses below a message."""
    names = [str(name) for name in getattr(value, "name", ())] if isinstance(getattr(value, "name", None), list) else []
    for name in fields_of(value):
        inner, where = getattr(value, name), f"{path}.{name}"
        if name in ("header", "layout"):  # its stamp is the time, its frame is said; what arrays are laid out like
            continue
        common = (count, rate, about)
        if isinstance(inner, bool | int | float | np.number):
            yield Part(
                topic + where, f"{kind} {type(inner).__name__}", "", *common, proposals.of_pressure(topic + where)
            )
        elif isinstance(inner, list | tuple | np.ndarray) and len(inner) and _is_number(inner[0]):
            yield from _array(topic, where, kind, inner, names if len(names) == len(inner) else [], common)
        elif fields_of(inner) and depth:
            pose = pose_of(inner) if name in ("pose", "transform", "position", "orientation", "point") else None
            if pose is not None:
                yield Part(topic + where, kind, "", *common, _head(pose))
            else:
                yield from _leaves(topic, where, kind, inner, *common, depth - 1)
        elif isinstance(inner, list) and inner and fields_of(inner[0]) and depth:
            for k, entry in enumerate(inner[:_MOST_ENTRIES]):
                pose = pose_of(entry)
                if pose is not None:
                    text = _head(pose).replace("head = 1", f"head = {k + 1}")
                    yield Part(f"{topic}{where}[{k}]", kind, "", *common, text)
                else:
                    yield from _leaves(topic, f"{where}[{k}]", kind, entry, *common, depth - 1)


def _is_number(value: Any) -> bool:
    return isinstance(value, bool | int | float | np.number)


def _array(
    topic: str, where: str, kind: str, values: Any, labels: list[str], common: tuple[int, float | None, str]
) -> Iterator[Part]:
    if labels:
        for k, label in enumerate(labels):
            length = where.endswith(".position")
            yield Part(f"{topic}{where}[{label}]", kind, "", *common, f'"q1{k + 1} [m]"' if length and k < 9 else "")
        return
    shape = f"{len(values)} numbers"
    yield Part(topic + where, kind, shape, *common, proposals.of_several(topic + where, len(values)))
