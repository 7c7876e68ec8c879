"""Numbers of a parameter file by name: ``section.2.mass``, ``section.1.bellows.3.rest_length``, ``gravity.x``.

A path is the way to one number through the tables of the file, its steps joined by dots; tables and entries of lists
count from 1, entries of vectors are ``x``, ``y``, ``z``. Identification, derivatives and diagnosis name parameters so.

=============================================  ==============================================
path                                           number
=============================================  ==============================================
``gravity.x``                                  an entry of gravity, m/s^2
``ambient_pressure``                           Pa
``section.2.mass``                             a value of section 2
``section.1.stiffness.2``                      coefficient of the second power, N/m^2
``section.1.bending_stiffness.1``              k1 (``.2``: k3, ``.3``: k5), N m; likewise ``cross_bending_stiffness``
``section.1.bending_plane``                    rad
``section.1.axial_stiffness.1``                N/m; with ``axial_rest_length`` (m), ``axial_damping`` (N s/m)
``section.1.center_of_mass.z``                 an entry of a vector
``section.1.bellows.3.rest_length``            a value of one bellows only
``section.1.masses.2.mass``                    of a mass along a section; ``share``
``base.position.x``                            of the base in the world, m; ``rotation``: rotation vector, rad
``effect.1.time_constant``                     a number of an effect, if the arm has effects
``sensors.camera_position.z``                  of the camera; ``camera_rotation``: rotation vector, rad
``length_sensor.1.offset``                     of a length sensor; ``angle`` (rad), ``radius``
``pneumatics.fill_time``                       time constant of commanded pressures, s; ``vent_time``
``section.*.damping``, ``section.1.stiffness.*``  a group: every number that the pattern matches
=============================================  ==============================================

Angles are in rad, also where the file states them in degrees; setting one states it in rad. Numbers of sensors do not
act on the arm's motion: :func:`is_of_sensors` tells them.

A section's value acts on those of its bellows that do not state their own. The moments of inertia follow the mass
where the file leaves them to (56).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import ValidationError

from bha.arrays import floats
from bha.errors import InputError, ParameterError
from bha.parameters.arm import ArmParameters, section_mapping
from bha.parameters.base import nearest
from bha.parameters.base_pose import BaseParameters
from bha.parameters.section import BENDING_TERMS, SectionParameters
from bha.parameters.sensors import SensorsParameters
from bha.parameters.tables import (
    ARM_VECTORS,
    AXES,
    BASE_VECTORS,
    SECTION_LISTS,
    SENSORS_VECTORS,
    resolved,
    table_of,
    write_number,
)

#: Most coefficients of a stiffness polynomial, and of the bending moment.
_TERMS = {
    "stiffness": 8,
    "bending_stiffness": BENDING_TERMS,
    "cross_bending_stiffness": BENDING_TERMS,
    "axial_stiffness": 8,
}
_ARM_NUMBERS = ("ambient_pressure",)
_SECTION_VECTORS = ("center_of_mass", "inertia")
_SECTION_NUMBERS = (
    "mass",
    "bellows_radius",
    "bellows_outer_radius",
    "terminal_area",
    "rest_length",
    "damping",
    "base_offset",
    "head_offset",
    "bending_plane",
    "axial_rest_length",
    "axial_damping",
)
#: Numbers that follow others where the file does not state them: they are there once it states the key beside.
_FOLLOWING = {
    "cross_bending_stiffness": "cross_bending_stiffness",
    "bending_plane": "cross_bending_stiffness",
    "axial_stiffness": "axial_stiffness",
    "axial_rest_length": "axial_stiffness",
    "axial_damping": "axial_stiffness",
}
_BELLOWS_NUMBERS = ("angle", "radius", "terminal_area", "rest_length", "damping")
_MASS_NUMBERS = ("mass", "share")
_PNEUMATICS_NUMBERS = ("fill_time", "vent_time")
_LENGTH_SENSOR_NUMBERS = ("angle", "radius", "offset")
_UNITS = {
    "fill_time": "s",
    "vent_time": "s",
    "position": "m",
    "rotation": "rad",
    "camera_position": "m",
    "camera_rotation": "rad",
    "angle": "rad",
    "offset": "m",
    "gravity": "m/s^2",
    "ambient_pressure": "Pa",
    "mass": "kg",
    "inertia": "kg m^2",
    "center_of_mass": "m",
    "bellows_radius": "m",
    "bellows_outer_radius": "m",
    "radius": "m",
    "terminal_area": "m^2",
    "rest_length": "m",
    "damping": "N s/m",
    "bending_stiffness": "N m",
    "cross_bending_stiffness": "N m",
    "bending_plane": "rad",
    "axial_rest_length": "m",
    "axial_damping": "N s/m",
    "base_offset": "m",
    "head_offset": "m",
}


def key_of(path: str) -> str:
    """The file's key that a path ends in: ``stiffness`` of ``section.1.bellows.2.stiffness.1``."""
    steps = path.split(".")
    last = steps[-1]
    return steps[-2] if len(steps) > 1 and steps[0] != "effect" and (last in (*AXES, "*") or last.isdigit()) else last


def is_of_sensors(path: str) -> bool:
    """Whether a path is that of a sensor's number, which measured values depend on and the motion does not."""
    return path.partition(".")[0] in ("sensors", "length_sensor")


def is_dead_time(path: str) -> bool:
    """Whether a path is that of a dead time, an effect's number."""
    return path.startswith("effect.") and path.endswith(".time")


def acts_on_outputs(path: str) -> bool:
    """Whether how measured values follow from the motion depends on a number: where sensors sit, how they err."""
    steps = path.split(".")
    return is_of_sensors(path) or steps[0] in ("effect", "*") or steps[-1] in ("radius", "bellows_radius", "*")


#: Keys of sections and their bellows on which it does not depend where the lengths of an arm have its heads.
_UNSEEN = frozenset(
    {"mass", "inertia", "center_of_mass", "terminal_area", "rest_length", "stiffness", "damping", "bending_stiffness"}
    | {"cross_bending_stiffness", "bending_plane", "axial_stiffness", "axial_rest_length", "axial_damping", "angle"}
)
#: Numbers of effects that turn, twist or bend otherwise, or of sensors that err.
_SEEN_OF_EFFECTS = frozenset({"about_x", "about_y", "change", "stiffness", "offset", "gain"})


def acts_on_pose(path: str) -> bool:
    """Whether it depends on a number which lengths of the arm put its heads, or its sensors, where they are."""
    steps = path.split(".")
    if steps[0] == "section":
        return key_of(path) not in _UNSEEN
    if steps[0] == "effect":
        return steps[-1] in _SEEN_OF_EFFECTS
    return steps[0] not in ("pneumatics", "gravity", "ambient_pressure")


def unit_of(path: str) -> str:
    """Unit of the number at a path; empty for groups, which are factors, and for effects."""
    if "*" in path or path.startswith("effect."):
        return ""
    key = key_of(path)
    if key in ("stiffness", "axial_stiffness"):
        power = int(path.rsplit(".", 1)[1])
        return "N/m" if power == 1 else f"N/m^{power}"
    return _UNITS.get(key, "")


def is_group(path: str) -> bool:
    """Whether a path is a pattern with a star."""
    return "*" in path.split(".")


def available(parameters: ArmParameters) -> tuple[str, ...]:
    """The paths of all numbers the arm's model has, in the order of the file; of polynomials the terms it has."""
    paths = [f"{name}.{axis}" for name in ARM_VECTORS for axis in AXES]
    paths += _ARM_NUMBERS
    for number, section in enumerate(parameters.sections, start=1):
        place = f"section.{number}"
        paths += [f"{place}.{name}" for name in _SECTION_NUMBERS if _stated(section, name)]
        paths += [f"{place}.{name}.{axis}" for name in _SECTION_VECTORS for axis in AXES]
        lists = [name for name in SECTION_LISTS if _stated(section, name)]
        paths += [f"{place}.{name}.{k + 1}" for name in lists for k in range(len(getattr(section, name)))]
        for count, bellows in enumerate(section.resolved_bellows(number), start=1):
            paths += [f"{place}.bellows.{count}.{name}" for name in _BELLOWS_NUMBERS]
            paths += [f"{place}.bellows.{count}.stiffness.{k + 1}" for k in range(len(bellows.stiffness))]
        paths += [f"{place}.masses.{k + 1}.{name}" for k in range(len(section.masses)) for name in _MASS_NUMBERS]
    if parameters.base is not None:
        paths += [f"base.{name}.{axis}" for name in BASE_VECTORS for axis in AXES]
    if parameters.sensors is not None:
        paths += [f"sensors.{name}.{axis}" for name in SENSORS_VECTORS for axis in AXES]
    for count in range(1, len(parameters.length_sensors) + 1):
        paths += [f"length_sensor.{count}.{name}" for name in _LENGTH_SENSOR_NUMBERS]
    if parameters.pneumatics is not None:
        paths += [f"pneumatics.{name}" for name in _pneumatics_numbers(parameters)]
    for count, effect in enumerate(_effects(parameters.to_mapping()), start=1):
        paths += [f"effect.{count}.{name}" for name, value in effect.items() if _is_number(value)]
    return tuple(paths)


def expand(parameters: ArmParameters, path: str) -> tuple[str, ...]:
    """The paths that a pattern with stars matches; of a plain path that path alone.

    A section's pattern does not reach into its bellows' own values: ``section.*.damping`` is one number a section.

    Raises:
        ParameterError: nothing matches.
    """
    if not is_group(path):
        get_value(parameters, path)
        return (path,)
    pattern = re.compile(r"\.".join(r"[^.]+" if step == "*" else re.escape(step) for step in path.split(".")))
    found = tuple(name for name in available(parameters) if pattern.fullmatch(name))
    if not found:
        raise ParameterError(f"{parameters.name}: no parameter matches {path!r}{nearest(path, available(parameters))}")
    return found


def get_value(  # noqa: PLR0911, PLR0912  (a table of cases)
    parameters: ArmParameters, path: str
) -> float:
    """The number at a path; that of a bellows includes what it inherits, a power beyond a polynomial's terms is 0.

    Raises:
        ParameterError: there is no such number; the text names the nearest path.
    """
    match path.split("."):
        case [name] if name in _ARM_NUMBERS:
            return float(getattr(parameters, name))
        case [name, axis] if name in ARM_VECTORS and axis in AXES:
            return float(getattr(parameters, name)[AXES.index(axis)])
        case ["effect", number, name]:
            place = _index(number, len(parameters.effects))
            if place is not None:
                effect = parameters.effects[place]
                if _is_number(effect.stated_numbers.get(name)):
                    return float(effect.stated_numbers[name])
                if name in effect.parameters:
                    default = f"the default, {effect.parameters[name]:g}, is not stated"
                    raise ParameterError(
                        f"{parameters.name}: {path}: {default}; state {name} in effect {number} of the file first"
                    )
        case ["base", name, axis] if name in BASE_VECTORS and axis in AXES:
            base = parameters.base or BaseParameters()
            vector = base.position if name == "position" else base.rotation_rad
            return float(vector[AXES.index(axis)])
        case ["section", number, "masses", place, name] if name in _MASS_NUMBERS:
            section, _ = _section(parameters, number, path)
            index = _index(place, len(section.masses))
            if index is not None:
                return float(getattr(section.masses[index], name))
        case ["sensors", name, axis] if name in SENSORS_VECTORS and axis in AXES:
            sensors = parameters.sensors or SensorsParameters()
            vector = sensors.camera_position if name == "camera_position" else sensors.camera_rotation_rad
            return float(vector[AXES.index(axis)])
        case ["pneumatics", name] if name in (stated := _pneumatics_numbers(parameters)):
            return stated[name]
        case ["length_sensor", number, name] if name in _LENGTH_SENSOR_NUMBERS:
            place = _index(number, len(parameters.length_sensors))
            if place is not None:
                sensor = parameters.length_sensors[place]
                return float(sensor.angle_rad if name == "angle" else getattr(sensor, name))
        case ["section", number, "bellows", place, name, *rest] if name in (*_BELLOWS_NUMBERS, "stiffness"):
            section, i = _section(parameters, number, path)
            bellows = section.resolved_bellows(i)
            index = _index(place, len(bellows))
            if index is not None:
                return _entry(parameters, path, name, getattr(bellows[index], name), rest)
        case ["section", number, name, *rest] if name in (*_SECTION_NUMBERS, *_SECTION_VECTORS, *SECTION_LISTS):
            section, _ = _section(parameters, number, path)
            return _entry(parameters, path, name, resolved(section, name), rest)
    raise _unknown(parameters, path)


def with_values(parameters: ArmParameters, values: Mapping[str, float]) -> ArmParameters:
    """A copy of the parameters with the numbers at some paths changed. Provenance entries stay as they are.

    Setting a bellows' own number states it in that bellows' table (made if the section has none); setting an entry of
    the inertia states all three moments; setting a power beyond a polynomial's terms fills those between with zeros.

    Raises:
        ParameterError: there is no such number, or the value is not allowed in a parameter file.
    """
    if not values:
        return parameters
    if all(path.startswith("section.") for path in values) and (fast := _with_section_values(parameters, values)):
        return fast
    mapping = parameters.to_mapping()
    for path, value in values.items():
        get_value(parameters, path)
        write_number(parameters, mapping, path, float(value))
    return parameters.updated(mapping)


def stated(parameters: ArmParameters, names: Iterable[str]) -> ArmParameters:
    """The same arm with those of the numbers stated that a section has only once it states them.

    These are a second bending plane and what holds the mean length. Arms that differ in them have one structure then.

    Raises:
        ParameterError: there is no such number, or one without the key that it belongs to.
    """
    missing = {}
    for path in names:
        value, steps = get_value(parameters, path), path.split(".")
        if steps[0] == "section" and steps[2] in _FOLLOWING:
            section, _ = _section(parameters, steps[1], path)
            if not _stated(section, steps[2]):
                missing[path] = value
    return with_values(parameters, missing)


def restated(parameters: ArmParameters, values: Mapping[str, float]) -> ArmParameters:
    """As :func:`with_values`, for values that someone states anew.

    Patterns stand for all that they match; a changed value loses its provenance, which was that of another value.

    Raises:
        ParameterError: there is no such number, or the value is not allowed in a parameter file.
        InputError: something that is no finite number.
    """
    if not isinstance(values, Mapping):
        raise InputError(f"values: {type(values).__name__}; a mapping from paths to numbers is needed")
    wanted: dict[str, float] = {}
    for path, value in values.items():
        if not isinstance(path, str):
            raise InputError(f"values: {path!r} is no path; a text such as 'section.1.mass' is needed")
        number = float(floats(value, path, ()))
        wanted |= dict.fromkeys(expand(parameters, path), number)
    changed = {path: value for path, value in wanted.items() if value != get_value(parameters, path)}
    if not changed:
        return parameters
    restated = with_values(parameters, changed)
    mapping, stale = restated.to_mapping(), False
    for path in changed:
        table, key, _ = table_of(mapping, path)
        entries = table.get("provenance", {})
        stale |= entries.pop(key, None) is not None
        if not entries:
            table.pop("provenance", None)
    return restated.updated(mapping) if stale else restated


def _with_section_values(parameters: ArmParameters, values: Mapping[str, float]) -> ArmParameters | None:
    """As :func:`with_values`, where only numbers of sections change: these sections are checked and nothing else.

    Sweeps and identification build arms by the million. None where a value is not allowed; the long way says which.
    """
    for path in values:
        get_value(parameters, path)
    touched = {int(path.split(".")[1]) - 1 for path in values}
    tables = [section_mapping(section) if k in touched else None for k, section in enumerate(parameters.sections)]
    for path, value in values.items():
        write_number(parameters, {"section": tables}, path, float(value))
    try:
        return parameters.with_sections({k: SectionParameters.model_validate(tables[k]) for k in touched})
    except ValidationError:
        return None


def _stated(section: SectionParameters, name: str) -> bool:
    """Whether the model has a number of a section of its own, and not one that follows from others."""
    if name in _FOLLOWING:
        return getattr(section, _FOLLOWING[name]) is not None or bool(name == "axial_damping" and section.axial_damping)
    return getattr(section, name) is not None


def _section(parameters: ArmParameters, number: str, path: str) -> tuple[Any, int]:
    index = _index(number, len(parameters.sections))
    if index is None:
        raise _unknown(parameters, path)
    return parameters.sections[index], index + 1


def _index(text: str, count: int) -> int | None:
    """Index from 0 of a number from 1 to ``count`` that is written in plain digits; None for all else."""
    plain = text.isascii() and text.isdecimal() and not text.startswith("0") and len(text) <= len(str(count))
    return int(text) - 1 if plain and int(text) <= count else None


def _entry(parameters: ArmParameters, path: str, name: str, value: Any, rest: list[str]) -> float:
    if isinstance(value, tuple):
        if len(rest) == 1 and name in _TERMS and (term := _index(rest[0], _TERMS[name])) is not None:
            return float(value[term]) if term < len(value) else 0.0
        if len(rest) == 1 and name in _SECTION_VECTORS and rest[0] in AXES:
            return float(value[AXES.index(rest[0])])
    elif not rest and value is not None:
        return float(value)
    raise _unknown(parameters, path)


def _unknown(parameters: ArmParameters, path: str) -> ParameterError:
    return ParameterError(f"{parameters.name}: no parameter {path[:200]!r}{nearest(path, available(parameters))}")


def _effects(mapping: Mapping[str, Any]) -> list[dict[str, Any]]:
    effects: list[dict[str, Any]] = mapping.get("effect", [])
    return effects


def _pneumatics_numbers(parameters: ArmParameters) -> dict[str, float]:
    """The time constants that the ``[pneumatics]`` table states."""
    table = parameters.pneumatics
    found = {} if table is None else {name: getattr(table, name) for name in _PNEUMATICS_NUMBERS}
    return {name: float(value) for name, value in found.items() if value is not None}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
