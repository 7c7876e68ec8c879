"""The parameter file of an arm: its top-level table, reading, writing, and the JSON that the core is built from."""

from __future__ import annotations

import json
import os
import tomllib
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self, get_args

from pydantic import PrivateAttr, ValidationError, model_validator

from bha.errors import ParameterError, ParameterWarning
from bha.parameters import messages
from bha.parameters.along import has_several_areas
from bha.parameters.base import NotNegative, Switch, Table, Vector3, key, table_error
from bha.parameters.base_pose import BaseParameters
from bha.parameters.document import merged_toml
from bha.parameters.effect import EffectParameters, check_effects
from bha.parameters.pneumatics import PneumaticsParameters
from bha.parameters.provenance import (
    ASSUMED,
    Provenance,
    ProvenanceTable,
    check_provenance,
    provenance_key,
    provenance_mapping,
)
from bha.parameters.section import BENDING_TERMS, TABLES_OF_A_SECTION, SectionParameters
from bha.parameters.sensors import LengthSensorParameters, SensorsParameters, check_length_sensors
from bha.support.files import written_whole

SCHEMA = "bha-arm/1"
#: Most sections of an arm, as in the core.
MOST_SECTIONS = 256
#: Bytes of a parameter file; what is larger is something else, such as a log.
LARGEST_FILE = 16 << 20
ForceModel = Literal["end_force", "work_conjugate"]
_TABLES = ("base", "pneumatics", "sections", "sensors", "length_sensors", "effects", "provenance")
_NOT_VALUES = ("schema_name", "name", *_TABLES)


@dataclass(frozen=True)
class StatedValue:
    """One value of a parameter file with where it comes from.

    Attributes:
        section: number of its section, from 1; None for values of the whole arm.
        bellows: number of its bellows within the section, from 1; None for values of the section.
        effect: number of its effect, from 1; None for values that belong to no effect.
        sensor: its table among the sensors, ``"sensors"`` or ``"length sensor wire1"``; None for other values.
        part: another table it stands in, ``"base"``, or ``"arc 2"`` or ``"mass 1"`` of its section; None for the rest.
        key: its name in the file.
        value: number, text, switch or tuple of numbers.
        unit: unit of the value as text, empty where it has none.
        provenance: where it comes from; assumed where the file does not say.
    """

    section: int | None
    bellows: int | None
    key: str
    value: Any
    unit: str
    provenance: Provenance
    effect: int | None = None
    sensor: str | None = None
    part: str | None = None


class ArmParameters(Table):
    """Everything a parameter file says. Immutable; compare with ``==``.

    Read one with :meth:`read`, change one with :meth:`updated`, write it with :meth:`write`.
    """

    schema_name: Literal["bha-arm/1"] = key(f'"{SCHEMA}"', "what the file is", alias="schema")
    name: str = key(
        "a text of 1 to 200 characters", "name of the arm, for tables and pictures", min_length=1, max_length=200
    )
    gravity: Vector3 = key(
        "[x, y, z], numbers (m/s^2)",
        "acceleration of gravity in the world, which is the base's frame unless [base] says otherwise",
        unit="m/s^2",
    )
    ambient_pressure: NotNegative = key("a number >= 0 (Pa)", "absolute pressure outside of the bellows", unit="Pa")
    force_model: ForceModel = key(
        " or ".join(f'"{name}"' for name in get_args(ForceModel)), "along what the bellows push", default="end_force"
    )
    rotational_energy: Switch = key(
        "true or false", "whether the kinetic energy has its rotational part, (58) and (59)", default=True
    )
    coriolis_forces: Switch = key(
        "true or false", "whether Coriolis and centrifugal forces act, (60) and (61)", default=True
    )
    provenance: ProvenanceTable = provenance_key()
    base: BaseParameters | None = key(
        "a [base] table",
        "where the base stands in the world",
        left_out="the world's frame is that of the base",
        default=None,
    )
    pneumatics: PneumaticsParameters | None = key(
        "a [pneumatics] table", "from commanded to acting pressure", left_out="ideal pressures", default=None
    )
    sections: tuple[SectionParameters, ...] = key(
        f"one [[section]] table, in double brackets, per section of the arm, at most {MOST_SECTIONS}",
        "the sections, from the base on",
        alias="section",
        min_length=1,
        max_length=MOST_SECTIONS,
    )

    sensors: SensorsParameters | None = key(
        "a [sensors] table",
        "where and what the sensors measure",
        left_out="heads are measured in the world's frame, lengths at the bellows",
        default=None,
    )
    length_sensors: tuple[LengthSensorParameters, ...] = key(
        "[[length_sensor]] tables, in double brackets",
        "one per wire or other length that a log has",
        left_out="none",
        alias="length_sensor",
        default=(),
    )
    effects: tuple[EffectParameters, ...] = key(
        "[[effect]] tables, in double brackets",
        "one per effect beyond the paper's model",
        left_out="none",
        alias="effect",
        default=(),
    )

    # The text this was read from: writing back keeps its comments and order.
    _toml: str | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _check(self) -> Self:
        stated = {name: value for name, value in self if name not in _NOT_VALUES}
        check_provenance(self.provenance, stated)
        self._check_areas()
        check_length_sensors(self.length_sensors, len(self.sections))
        bellows = [len(s.resolved_bellows(1)) for s in self.sections]
        check_effects(self.effects, bellows, self.inputs, self.measures_coordinates)
        return self

    def _check_areas(self) -> None:
        for number, section in enumerate(self.sections, start=1):
            if self.force_model == "end_force" and has_several_areas(section.arcs):
                raise table_error(
                    f'found "end_force" with areas that differ along section {number}: in (27) a bellows pushes both '
                    'of its ends with one force; allowed: force_model = "work_conjugate", or one relative_area',
                    "force_model",
                )

    @property
    def base_pose(self) -> BaseParameters:
        """Where the base stands in the world, (12); at its origin where the file does not say."""
        return self.base or BaseParameters()

    def __eq__(self, other: object) -> bool:
        """Whether all values and their provenance are equal; comments and order of the file do not matter."""
        if not isinstance(other, ArmParameters):
            return NotImplemented
        return self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        """Hash of the values the model computes with."""
        return hash(self.to_core_json())

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read a parameter file.

        Raises:
            ParameterError: the file is missing, not TOML or not valid. The text lists every fault, each with file,
                line, key, what was found and what is allowed.
        """
        try:
            with Path(path).open("rb") as file:
                content = file.read(LARGEST_FILE + 1)
        except (OSError, ValueError) as error:
            raise ParameterError(messages.unreadable(path, error)) from error
        if len(content) > LARGEST_FILE:
            raise ParameterError(f"{path}: is larger than {LARGEST_FILE >> 20} MiB; no parameter file is")
        try:
            text = content.decode()
        except UnicodeDecodeError as error:
            raise ParameterError(messages.not_text(os.fspath(path), error)) from error
        return cls.from_toml(text, origin=os.fspath(path))

    @classmethod
    def from_toml(cls, text: str, *, origin: str = "<text>") -> Self:
        """Like :meth:`read`, from the text of a parameter file; errors name ``origin`` as the file."""
        text = text.removeprefix("\ufeff").replace("\r\n", "\n")
        try:
            mapping = tomllib.loads(text)
        except (ValueError, RecursionError) as error:
            raise ParameterError(messages.not_toml(origin, text, error)) from error
        parameters = cls.from_mapping(mapping, origin=origin, text=text)
        parameters._toml = text
        return parameters

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], *, origin: str = "<mapping>", text: str | None = None) -> Self:
        """Build from the nested mapping that a parameter file amounts to.

        Args:
            mapping: keys as in the file; lists may be lists or tuples.
            origin: what errors name as the file.
            text: the file's text, so that errors can name lines.

        Raises:
            ParameterError: as for :meth:`read`.

        Warns:
            ParameterWarning: a value is allowed, but physically impossible.
        """
        if not isinstance(mapping, Mapping):
            found = type(mapping).__name__
            raise ParameterError(f"{origin}: found {found}; expected a mapping of keys to values, as a file has")
        schema = mapping.get("schema")
        if not isinstance(schema, str) or schema != SCHEMA:
            raise ParameterError(messages.wrong_schema(origin, mapping, SCHEMA))
        try:
            parameters = cls.model_validate(mapping)
        except ValidationError as error:
            raise ParameterError(messages.invalid(origin, error, cls, mapping, text)) from error
        for number, section in enumerate(parameters.sections, start=1):
            if implausible := section.implausible():
                warnings.warn(f"{origin}: section {number}: {implausible}", ParameterWarning, stacklevel=2)
        return parameters

    def updated(self, changes: Mapping[str, Any]) -> Self:
        """A copy with top-level keys changed; comments and order of the file it came from are kept.

        Raises:
            ParameterError: an unknown key or a value that is not allowed.
        """
        parameters = self.from_mapping({**self.to_mapping(), **changes}, origin=self.name)
        parameters._toml = self._toml
        return parameters

    def to_mapping(self) -> dict[str, Any]:
        """The nested mapping that the file amounts to: what was stated, nothing that is left to defaults."""
        mapping = _stated_mapping(self, set(_TABLES))
        if self.provenance:
            mapping["provenance"] = provenance_mapping(self.provenance)
        if self.base is not None:
            mapping["base"] = _table_mapping(self.base)
        if self.pneumatics is not None:
            mapping["pneumatics"] = _table_mapping(self.pneumatics)
        mapping["section"] = [section_mapping(section) for section in self.sections]
        if self.sensors is not None:
            mapping["sensors"] = _table_mapping(self.sensors)
        if self.length_sensors:
            mapping["length_sensor"] = [_table_mapping(sensor) for sensor in self.length_sensors]
        if self.effects:
            mapping["effect"] = [effect.to_mapping() for effect in self.effects]
        return mapping

    def with_sections(self, changed: Mapping[int, SectionParameters]) -> Self:
        """A copy with some sections replaced, by index from 0, by ones with as many bellows and the same inputs.

        What concerns the whole arm is not checked again, for it cannot have changed.

        Warns:
            ParameterWarning: as :meth:`from_mapping`.
        """
        for index, section in changed.items():
            if implausible := section.implausible():
                text = f"{self.name}: section {index + 1}: {implausible}"
                warnings.warn(text, ParameterWarning, stacklevel=2)
        sections = tuple(changed.get(index, section) for index, section in enumerate(self.sections))
        return self.model_copy(update={"sections": sections})

    def to_toml(self) -> str:
        """The text of the parameter file; comments and order of the file it was read from are kept."""
        return merged_toml(self.to_mapping(), self._toml)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the parameter file, whole or not at all.

        Raises:
            InputError: the folder does not exist.
        """
        with written_whole(path) as temporary:
            temporary.write_text(self.to_toml(), encoding="utf-8", newline="\n")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the pressure inputs in the order in which they first appear."""
        return tuple(dict.fromkeys(name for names in self.inputs_of_bellows for name in names))

    @property
    def inputs_of_bellows(self) -> list[list[str]]:
        """For each section the input of each of its bellows."""
        return [[b.input for b in s.resolved_bellows(number)] for number, s in enumerate(self.sections, start=1)]

    @property
    def measures_coordinates(self) -> tuple[bool, ...]:
        """For each section whether its measured lengths q11 .. are its three coordinates."""
        all_are = self.sensors is not None and self.sensors.lengths == "coordinates"
        return tuple(all_are or section.has_standard_bellows for section in self.sections)

    @property
    def has_standard_bellows(self) -> bool:
        """Whether the bellows of every section are the standard three, so that the coordinates are their lengths."""
        return all(section.has_standard_bellows for section in self.sections)

    def to_core_json(self) -> str:
        """:meth:`to_core` as JSON."""
        return json.dumps(self.to_core(), allow_nan=False)

    def to_core(self) -> dict[str, Any]:
        """Everything the core computes with, every default and inherited value filled in; inputs by index.

        Where the sensors are is not among it: the motion does not depend on them.
        """
        inputs = self.inputs
        index = {name: i for i, name in enumerate(inputs)}
        sections = [
            {
                "mass": section.mass,
                "inertia": section.resolved_inertia(),
                "center_of_mass": section.center_of_mass,
                "force_point": section.force_point,
                "bellows_radius": section.bellows_radius,
                "base_offset": section.base_offset,
                "head_offset": section.head_offset,
                "bending_stiffness": _bending(section.bending_stiffness),
                **_planes(section),
                **_axial(section),
                "length_range": section.length_range,
                "bellows": [{**vars(b), "input": index[b.input]} for b in section.resolved_bellows(number)],
                **{name: [entry.to_core() for entry in along] for name, along in section.along.items() if along},
            }
            for number, section in enumerate(self.sections, start=1)
        ]
        core: dict[str, Any] = {
            "name": self.name,
            "gravity": self.gravity,
            "ambient_pressure": self.ambient_pressure,
            "force_model": self.force_model,
            "rotational_energy": self.rotational_energy,
            "coriolis_forces": self.coriolis_forces,
            "inputs": inputs,
            "section": sections,
            "effect": [effect.to_core() for effect in self.effects],
        }
        if self.base is not None:
            core["base"] = {"position": self.base.position, "rotation": self.base.rotation_rad}
        if self.pneumatics is not None:
            core["pneumatics"] = self.pneumatics.to_core()
        return core

    def stated_values(self) -> Iterator[StatedValue]:
        """Every value the file states, in its order of tables, with where it comes from."""
        yield from _stated(self, None, None, set(_NOT_VALUES))
        if self.base is not None:
            yield from _stated(self.base, None, None, {"provenance"}, part="base")
        if self.pneumatics is not None:
            yield from _stated(self.pneumatics, None, None, {"provenance"})
        for number, section in enumerate(self.sections, start=1):
            yield from _stated(section, number, None, set(TABLES_OF_A_SECTION))
            for place, bellows in enumerate(section.bellows or (), start=1):
                yield from _stated(bellows, number, place, {"provenance"})
            for place, arc in enumerate(section.arcs, start=1):
                yield from _stated(arc, number, None, {"provenance"}, part=f"arc {place}")
            for place, mass in enumerate(section.masses, start=1):
                yield from _stated(mass, number, None, {"provenance"}, part=f"mass {place}")
        if self.sensors is not None:
            yield from _stated(self.sensors, None, None, {"provenance"}, sensor="sensors")
        for sensor in self.length_sensors:
            yield from _stated(sensor, None, None, {"name", "provenance"}, sensor=f"length sensor {sensor.name}")
        for number, effect in enumerate(self.effects, start=1):
            where = effect.place
            units = {p.name: p.unit for p in effect.info.parameters}
            for name, value in effect.parameters.items():
                provenance = effect.provenance.get(name, ASSUMED)
                unit = units.get(name, "")
                yield StatedValue(where.section, where.bellows, name, value, unit, provenance, effect=number)


def _bending(stated: tuple[float, ...]) -> tuple[float, ...]:
    """All coefficients of a bending moment, zero where none is stated."""
    return (*stated, *[0.0] * (BENDING_TERMS - len(stated)))


def _planes(section: SectionParameters) -> dict[str, Any]:
    """The keys of a bending stiffness that differs from plane to plane; none where it does not."""
    if section.cross_bending_stiffness is None:
        return {}
    return {
        "cross_bending_stiffness": _bending(section.cross_bending_stiffness),
        "bending_plane": section.bending_plane_rad,
    }


def _axial(section: SectionParameters) -> dict[str, Any]:
    """The table of what holds a section's mean length beside its bellows; none where nothing does."""
    if section.axial_stiffness is None and section.axial_damping == 0.0:
        return {}
    return {
        "axial": {
            "stiffness": section.axial_stiffness or (0.0,),
            "rest_length": section.resolved_axial_rest_length,
            "damping": section.axial_damping,
        }
    }


def section_mapping(section: SectionParameters) -> dict[str, Any]:
    """The ``[[section]]`` table as it stands in a file."""
    table = _stated_mapping(section, set(TABLES_OF_A_SECTION))
    if section.provenance:
        table["provenance"] = provenance_mapping(section.provenance)
    if section.bellows is not None:
        table["bellows"] = [_table_mapping(bellows) for bellows in section.bellows]
    if section.arcs:
        table["arcs"] = [_table_mapping(arc) for arc in section.arcs]
    if section.masses:
        table["masses"] = [_table_mapping(mass) for mass in section.masses]
    return table


def _stated(
    table: Any,
    section: int | None,
    bellows: int | None,
    skip: set[str],
    *,
    sensor: str | None = None,
    part: str | None = None,
) -> Iterator[StatedValue]:
    for name, field in type(table).model_fields.items():
        if name in table.model_fields_set and name not in skip and getattr(table, name) is not None:
            provenance = table.provenance.get(name, ASSUMED)
            unit = field.json_schema_extra["unit"]
            value = getattr(table, name)
            yield StatedValue(section, bellows, name, value, unit, provenance, sensor=sensor, part=part)


def _table_mapping(table: Any) -> dict[str, Any]:
    """A table without tables of its own but for its provenance, as it stands in a file."""
    mapping = _stated_mapping(table, {"provenance"})
    if table.provenance:
        mapping["provenance"] = provenance_mapping(table.provenance)
    return mapping


def _stated_mapping(table: Table, skip: set[str]) -> dict[str, Any]:
    return table.model_dump(mode="json", exclude_unset=True, exclude_none=True, by_alias=True, exclude=skip)
