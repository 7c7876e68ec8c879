"""Where and what the sensors of an arm measure: the ``[sensors]`` and ``[[length_sensor]]`` tables of a parameter file.

They say how measured columns of a log relate to the model; the model's motion does not depend on them, and the compiled
core never sees them. ``bha.arm.geometry`` has the maps that follow from them.

::

    [sensors]
    camera_position = [0.0, 0.0, -1.2]
    camera_axes = ["x", "-y", "-z"]

    [[length_sensor]]
    name = "wire1"
    angle_deg = 60.0
    radius = 0.11
    sections = [1, 2]
    offset = 0.04
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from bha import names
from bha.parameters.base import NotNegative, Number, Table, Vector3, key, stated_angle, table_error
from bha.parameters.provenance import ProvenanceTable, check_provenance, provenance_key, published

SignedAxis = Literal["x", "y", "z", "-x", "-y", "-z"]
LengthColumns = Literal["bellows", "coordinates"]
AXES_ALLOWED = 'three texts, each of x, y, z once, with an optional "-", as in ["x", "-y", "-z"]'
#: How far an origin, m, and a rotation vector, rad, of a camera plausibly are from where a file has them: one standard
#: deviation of each entry.
CAMERA_SPREADS = {"camera_position": 0.02, "camera_rotation": 0.05}
SectionNumber = Annotated[int, Field(strict=True, ge=1)]


class SensorsParameters(Table):
    """The ``[sensors]`` table: the frame in which heads are measured, and what columns of lengths mean."""

    camera_position: Vector3 = key(
        "[x, y, z], numbers (m)",
        "the origin of the frame that heads are measured in, in the world",
        unit="m",
        default=(0.0, 0.0, 0.0),
    )
    camera_rotation: Vector3 | None = key(
        "[x, y, z], numbers (rad)",
        "rotation vector in the world by which the camera is turned after camera_axes; give "
        "camera_rotation or camera_rotation_deg",
        left_out="[0, 0, 0]",
        unit="rad",
        default=None,
    )
    camera_rotation_deg: Vector3 | None = key(
        "[x, y, z], numbers (degrees)",
        "the same in degrees; give camera_rotation or camera_rotation_deg",
        left_out="[0, 0, 0]",
        unit="deg",
        default=None,
    )
    camera_axes: tuple[SignedAxis, SignedAxis, SignedAxis] = key(
        AXES_ALLOWED,
        "the axes of the world along which those of the camera point before camera_rotation; a mirrored frame is "
        "allowed",
        default=("x", "y", "z"),
    )
    lengths: LengthColumns = key(
        '"bellows" or "coordinates"',
        "what q11, q12, q13 of a log are: the lengths of the bellows, where they sit, or those at 0, 120 and 240 "
        "degrees at bellows_radius",
        default="bellows",
    )
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.camera_rotation is not None and self.camera_rotation_deg is not None:
            message = "found both of camera_rotation and camera_rotation_deg; allowed: one of them"
            raise table_error(message, "camera_rotation_deg")
        if sorted(axis.removeprefix("-") for axis in self.camera_axes) != ["x", "y", "z"]:
            raise table_error(f"found {list(self.camera_axes)}; allowed: {AXES_ALLOWED}", "camera_axes")
        stated = {name: value for name, value in self if value is not None and name != "provenance"}
        check_provenance(self.provenance, stated)
        return self

    @property
    def uncertain(self) -> dict[str, float]:
        """What of the camera's frame is not published, with how far off it plausibly is (m, rad): markers tell it."""
        known = published(self.provenance)
        return {name: spread for name, spread in CAMERA_SPREADS.items() if name not in known}

    @property
    def camera_rotation_rad(self) -> tuple[float, float, float]:
        """Rotation vector of the camera in the world, rad."""
        if self.camera_rotation_deg is not None:
            x, y, z = self.camera_rotation_deg
            return (math.radians(x), math.radians(y), math.radians(z))
        return self.camera_rotation or (0.0, 0.0, 0.0)


class LengthSensorParameters(Table):
    """A ``[[length_sensor]]`` table: a wire along the arm, or what else measures arcs beside the centre line."""

    name: str = key(
        "a text of 1 to 100 characters",
        "the column of the log, without its unit, of a name that stands for nothing else",
        min_length=1,
        max_length=100,
        strict=True,
    )
    angle: Number | None = key("a number (rad)", "about z, from x; give angle or angle_deg", unit="rad", default=None)
    angle_deg: Number | None = key(
        "a number (degrees)", "the same in degrees; give angle or angle_deg", unit="deg", default=None
    )
    radius: NotNegative = key("a number >= 0 (m)", "distance from the centre line", unit="m")
    sections: tuple[SectionNumber, ...] = key(
        "a list of section numbers, from 1, each once", "the sections whose bending parts it runs along", min_length=1
    )
    offset: Number = key(
        "a number (m)", "what the reading has beside the arcs in these sections", unit="m", default=0.0
    )
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        stated_angle(self.angle, self.angle_deg)
        if self.name != self.name.strip() or any(sign in self.name for sign in '[](),;"\n\r\t'):
            allowed = 'a name without blanks at its ends, brackets, quotes, commas and semicolons, as in "wire1"'
            raise table_error(f'found "{self.name}"; allowed: {allowed}', "name")
        if taken := names.meant(self.name):
            allowed = f'a name that no one can take for another quantity, as in "wire1" (a log reads it as {taken})'
            raise table_error(f'found "{self.name}"; allowed: {allowed}', "name")
        if len(set(self.sections)) < len(self.sections):
            raise table_error(f"found {list(self.sections)}; allowed: each section once", "sections")
        stated = {name: value for name, value in self if value is not None and name != "provenance"}
        check_provenance(self.provenance, stated)
        return self

    @property
    def angle_rad(self) -> float:
        """Angle about the sections' z axes from their x axes, rad."""
        return stated_angle(self.angle, self.angle_deg)


def check_length_sensors(sensors: Sequence[LengthSensorParameters], section_count: int) -> None:
    """Check that the sections of ``sensors`` exist on an arm and that no name is given twice.

    Raises:
        PydanticCustomError: with what is wrong; pydantic adds where.
    """
    first: dict[str, int] = {}
    for number, sensor in enumerate(sensors):
        if sensor.name in first:
            message = (
                f'found "{sensor.name}", which is length_sensor {first[sensor.name]} already; allowed: another name'
            )
            raise table_error(message, f"length_sensor.{number}.name")
        first[sensor.name] = number + 1
        if max(sensor.sections) > section_count:
            message = f"found {list(sensor.sections)}; allowed: sections 1 to {section_count}, which the arm has"
            raise table_error(message, f"length_sensor.{number}.sections")
