"""Columns of a log that look like data of the arm and are used by nothing."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import TYPE_CHECKING

from bha import names
from bha.logs.units import measures

if TYPE_CHECKING:
    from bha.logs import Log

#: Letters with a number of a section or bellows behind: what names of quantities look like.
_LIKE_A_QUANTITY = re.compile(r"[a-zA-Z]{1,4}[_ ]?\d{1,2}(_\d{1,2})?")
#: What a part of a quaternion is often called.
_QUATERNION = re.compile(r"q[wxyz]([1-9]\d?)")
#: Units of what an arm has: lengths, pressures, forces, moments.
_UNITS = ("m", "Pa", "N", "N*m")
#: Columns that are named at the most; a log may have a hundred of them.
MOST_NAMED = 8


def unused(log: Log, used: Collection[str]) -> str | None:
    """A text that names such columns; None if there are none.

    Rates, and the sort of pressures that does not drive, are known quantities and not meant.
    """
    found = [
        name
        for name in log.columns
        if name not in used and names.quantity(name) is None and _looks_like_data(name, log.units[name])
    ]
    if not found:
        return None
    shown = ", ".join(_described(name, log.units[name]) for name in found[:MOST_NAMED])
    more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
    verb = "is" if len(found) == 1 else "are"
    hint = _hint(found, log)
    return f"{shown}{more} {verb} used by nothing{hint}"


def _looks_like_data(name: str, unit: str) -> bool:
    if _LIKE_A_QUANTITY.fullmatch(name):
        return True
    return bool(unit) and any(measures(unit, si) for si in _UNITS)


def _described(name: str, unit: str) -> str:
    return f"'{names.column(name, unit)}'" if unit else f"'{name}'"


def _hint(found: list[str], log: Log) -> str:
    """The way to use a quaternion by another name, or a length, as a wire of the arm's file."""
    for name in found:
        if (spelt := _QUATERNION.fullmatch(name)) and all(f"q{axis}{spelt[1]}" in found for axis in "wxyz"):
            right = names.orientation_names(int(spelt[1]))
            return f"; did you mean {', '.join(right)}, the orientation of head {int(spelt[1])}?"
    for name in found:
        if log.units[name] and measures(log.units[name], "m"):
            return f'; a [[length_sensor]] with name = "{name}" in the arm\'s file would use it'
    return ""
