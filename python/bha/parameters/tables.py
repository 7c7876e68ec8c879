"""The tables of a parameter file: where the number at a path stands in them, and how it is written there.

Paths and what they name: :mod:`bha.parameters.paths`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from bha.parameters.arm import ArmParameters
from bha.parameters.section import STANDARD_ANGLES_DEG, SectionParameters

#: Entries of a vector.
AXES = ("x", "y", "z")
#: Vectors and lists by the table that has them.
ARM_VECTORS = ("gravity",)
SECTION_LISTS = ("stiffness", "bending_stiffness", "cross_bending_stiffness", "axial_stiffness")
BASE_VECTORS = ("position", "rotation")
SENSORS_VECTORS = ("camera_position", "camera_rotation")


def resolved(section: SectionParameters, name: str) -> Any:
    """A section's value, that which it follows from where it is not stated."""
    match name:
        case "inertia":
            return section.resolved_inertia()
        case "cross_bending_stiffness":
            return section.resolved_cross_bending_stiffness
        case "bending_plane":
            return section.bending_plane_rad
        case "axial_stiffness":
            return section.axial_stiffness or ()
        case "axial_rest_length":
            return section.resolved_axial_rest_length
        case _:
            return getattr(section, name)


def table_of(mapping: Mapping[str, Any], path: str) -> tuple[Any, str, int | None]:
    """The table of a file's mapping that holds the number at a path, its key there, and its place in a list or None.

    Used to state a provenance beside a value; the number must be stated in the mapping.
    """
    steps = path.split(".")
    table: Any = mapping
    if steps[0] in ("base", "pneumatics", "sensors"):
        table, steps = mapping[steps[0]], steps[1:]
    elif steps[0] in ("section", "effect", "length_sensor"):
        table, steps = mapping[steps[0]][int(steps[1]) - 1], steps[2:]
    if steps[0] in ("bellows", "masses"):
        table, steps = table[steps[0]][int(steps[1]) - 1], steps[2:]
    place = None if len(steps) == 1 else AXES.index(steps[1]) if steps[1] in AXES else int(steps[1]) - 1
    return table, steps[0], place


def write_number(parameters: ArmParameters, mapping: dict[str, Any], path: str, value: float) -> None:
    """Write a number into a mapping of a file, in place; tables and entries that are not there are made.

    Args:
        parameters: what the file says, for what an entry inherits.
        mapping: of the file.
        path: of a number that the parameters have.
        value: in SI units; angles in rad, in which they are then stated.
    """
    steps = path.split(".")
    if steps[:1] == ["section"]:
        index = int(steps[1])
        section = parameters.sections[index - 1]
        table = mapping["section"][index - 1]
        if steps[2] == "bellows":
            table.setdefault("bellows", [{"angle_deg": angle} for angle in STANDARD_ANGLES_DEG])
            inherited = vars(section.resolved_bellows(index)[int(steps[3]) - 1])
            if steps[4] == "angle":
                _state_in_radians(table["bellows"][int(steps[3]) - 1], "angle")
        else:
            inherited = {name: resolved(section, name) for name in (*SECTION_LISTS, "center_of_mass", "inertia")}
            if steps[2] == "bending_plane":
                _state_in_radians(table, "bending_plane")
    elif steps[0] == "base":
        _state_in_radians(mapping.setdefault("base", {}), "rotation")
        inherited = dict.fromkeys(BASE_VECTORS, (0.0, 0.0, 0.0))
    elif steps[0] == "sensors":
        _state_in_radians(mapping.setdefault("sensors", {}), "camera_rotation")
        inherited = dict.fromkeys(SENSORS_VECTORS, (0.0, 0.0, 0.0))
    else:
        if steps[0] == "length_sensor":
            _state_in_radians(mapping["length_sensor"][int(steps[1]) - 1], "angle")
        inherited = {name: getattr(parameters, name) for name in ARM_VECTORS}
    holder, name, place = table_of(mapping, path)
    if place is None:
        holder[name] = value
        return
    entries = list(holder.get(name, inherited[name]))
    entries += [0.0] * (place + 1 - len(entries))
    entries[place] = value
    holder[name] = entries


def _state_in_radians(table: dict[str, Any], name: str) -> None:
    """State an angle (or vector of angles) that a table has in degrees in rad, with its provenance."""
    degrees = f"{name}_deg"
    if degrees not in table:
        return
    table[name] = _radians(table.pop(degrees))
    entry = table.get("provenance", {}).pop(degrees, None)
    if entry is not None:
        if isinstance(entry, dict):
            entry = {k: _radians(v) if k in ("ci95", "standard_error") else v for k, v in entry.items()}
        table["provenance"][name] = entry


def _radians(value: Any) -> Any:
    return [_radians(entry) for entry in value] if isinstance(value, list | tuple) else math.radians(value)
