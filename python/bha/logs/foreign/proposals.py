"""What a part of a foreign file might be, told by how people call things: proposals for a mapping file."""

from __future__ import annotations

import re

from bha import names
from bha.logs.headings import as_time, heading_parts

_PRESSURE = re.compile(r"press|chamber|valve|druck|\bp(c?\d+|c?)\b", re.IGNORECASE)
_COMMAND = re.compile(r"cmd|command|desired|setpoint|target|\bref|\bpc", re.IGNORECASE)
_HEAD = re.compile(r"tip|head|pos|marker|ee\b", re.IGNORECASE)
#: Inputs of a section that can be numbered with one digit.
_MOST = 9


def of_one(text: str, unit: str = "") -> str:
    """The heading of what is called like a quantity, as TOML; empty if it is not."""
    name, stated = heading_parts(text)
    if (time := as_time(text)) is not None:
        return f'"{time}"'
    meant = names.meant(name)
    quantity = names.quantity(meant) if meant else None
    if meant is None or quantity is None:
        return ""
    return f'"{names.column(meant, stated or unit or quantity.unit)}"'


def of_pressure(text: str, unit: str = "") -> str:
    """A pressure for what is called like one, numbered like it; empty if it is not."""
    if not _PRESSURE.search(text):
        return ""
    number = re.search(r"(\d)\D*$", text)
    kind = "pc" if _COMMAND.search(text) else "p"
    return f'"{kind}1{number[1] if number and number[1] != "0" else 1} [{unit or "Pa"}]"'


def of_several(text: str, count: int, unit: str = "") -> str:
    """Pressures or the position of a head for an array that is called like them; empty if it is not."""
    if _PRESSURE.search(text) and 1 <= count <= _MOST:
        kind = "pc" if _COMMAND.search(text) else "p"
        channels = ", ".join(f'"{kind}1{k + 1}"' for k in range(count))
        return f'{{ channels = [{channels}], unit = "{unit or "Pa"}" }}'
    if _HEAD.search(text) and count == 3:
        return f'{{ head = 1, unit = "{unit or "m"}" }}'
    return ""


def of_pose(has_position: bool, has_orientation: bool, frame: str | None) -> str:
    """A head, ``{ head = 1, frame = "mocap" }``."""
    parts = "" if has_position and has_orientation else f', parts = "{"position" if has_position else "orientation"}"'
    return "{ head = 1" + parts + (f', frame = "{frame}" }}' if frame else " }")
