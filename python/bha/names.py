"""Names of the quantities of an arm in tables and files: one place, so that what is written can be read back.

A name is a short prefix followed by the section number and, where a section has several, the bellows (or input)
number, both counted from 1: ``q11`` is the length of bellows 1 of section 1. Where either number has two digits an
underscore keeps them apart: ``q10_1``, ``p1_12``. A column of a file is a name with its unit in brackets: ``q11 [m]``.

==========================  ====================  ====
quantity                    name                  SI
==========================  ====================  ====
time                        ``t``                 s
bellows length              ``q11``               m
bellows velocity            ``qd11``              m/s
coordinate                  ``qv11``              m
coordinate velocity         ``qvd11``             m/s
pressure, measured          ``p11``               Pa
pressure, commanded         ``pc11``              Pa
head position               ``x1 y1 z1``          m
head orientation            ``ow1 ox1 oy1 oz1``   1
external force, world       ``fx1 fy1 fz1``       N
==========================  ====================  ====

A section has up to 12 bellows, but three coordinates: the lengths at its ``bellows_radius`` at 0, 120 and 240 degrees,
whether or not bellows are there ("virtual" lengths). Where the bellows are these three, ``q11`` and ``qv11`` are the
same number. Orientations are unit quaternions, scalar first; their unit ``[1]`` may be left out.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from bha.errors import InputError

TIME = "t"
_UNITS = {
    "time": "s",
    "length": "m",
    "velocity": "m/s",
    "coordinate": "m",
    "coordinate_velocity": "m/s",
    "pressure": "Pa",
    "commanded_pressure": "Pa",
    "position": "m",
    "orientation": "1",
    "force": "N",
}
#: Most bellows of a section, and the number of its coordinates.
MOST_BELLOWS, COORDINATES = 12, 3
_MOST = {
    "length": MOST_BELLOWS,
    "velocity": MOST_BELLOWS,
    "coordinate": COORDINATES,
    "coordinate_velocity": COORDINATES,
}
_PREFIXES = {
    "q": "length",
    "qd": "velocity",
    "qv": "coordinate",
    "qvd": "coordinate_velocity",
    "p": "pressure",
    "pc": "commanded_pressure",
}
_PAIRED = re.compile(r"(qv?d?|pc?)(?:([1-9])([1-9])|([1-9]\d+)_([1-9]\d*)|([1-9])_([1-9]\d+))")
_AXIS = re.compile(r"(f?)([xyz])([1-9]\d*)")
_ORIENTATION = re.compile(r"o([wxyz])([1-9]\d*)")
_PRESSURE = re.compile(r"pc?(?:([1-9])[1-9]|([1-9]\d*)_[1-9]\d*)")


def length_name(section: int, bellows: int) -> str:
    """Name of a bellows length, ``q11``; sections and bellows count from 1."""
    return "q" + _pair(section, bellows)


def velocity_name(section: int, bellows: int) -> str:
    """Name of the time derivative of a bellows length, ``qd11``."""
    return "qd" + _pair(section, bellows)


def coordinate_name(section: int, number: int) -> str:
    """Name of a coordinate (a virtual length), ``qv11``; sections and coordinates count from 1."""
    return "qv" + _pair(section, number)


def coordinate_velocity_name(section: int, number: int) -> str:
    """Name of the time derivative of a coordinate, ``qvd11``."""
    return "qvd" + _pair(section, number)


def pressure_name(section: int, number: int) -> str:
    """Name of a measured pressure, ``p11``; ``number`` is that of the bellows or of the pressure input."""
    return "p" + _pair(section, number)


def commanded_pressure_name(section: int, number: int) -> str:
    """Name of a commanded pressure, ``pc11``; numbered like the measured one."""
    return "pc" + _pair(section, number)


def section_of_pressure(name: str) -> int | None:
    """The first number in the name of a pressure, ``p23`` to 2; None if the name is not of that form."""
    found = _PRESSURE.fullmatch(name)
    return int(found[1] or found[2]) if found else None


def position_names(section: int) -> tuple[str, str, str]:
    """Names of the head position of a section, ``("x1", "y1", "z1")``."""
    _check(section, "section")
    return (f"x{section}", f"y{section}", f"z{section}")


def orientation_names(section: int) -> tuple[str, str, str, str]:
    """Names of the head orientation of a section, a unit quaternion, ``("ow1", "ox1", "oy1", "oz1")``."""
    _check(section, "section")
    return (f"ow{section}", f"ox{section}", f"oy{section}", f"oz{section}")


def force_names(section: int) -> tuple[str, str, str]:
    """Names of the external force on a section in the world, ``("fx1", "fy1", "fz1")``."""
    _check(section, "section")
    return (f"fx{section}", f"fy{section}", f"fz{section}")


@dataclass(frozen=True)
class Quantity:
    """What a name stands for.

    Attributes:
        kind: ``"time"``, ``"length"``, ``"velocity"``, ``"coordinate"``, ``"coordinate_velocity"``, ``"pressure"``,
            ``"commanded_pressure"``, ``"position"``, ``"orientation"`` or ``"force"``.
        section: number of the section, from 1; 0 for the time.
        number: number of the bellows, coordinate or input, from 1; that of the axis, from 1 for x, of positions and
            forces; that of the entry, from 1 for w, of orientations.
    """

    kind: str
    section: int = 0
    number: int = 0

    @property
    def unit(self) -> str:
        """SI unit of the quantity, "1" where it has none."""
        return _UNITS[self.kind]


def quantity(name: str) -> Quantity | None:
    """What a name stands for; None if it is none of the names of this module, spelt exactly as here."""
    if name == TIME:
        return Quantity("time")
    if found := _PAIRED.fullmatch(name):
        section, number = (int(digits) for digits in found.groups()[1:] if digits)
        kind = _PREFIXES[found[1]]
        return Quantity(kind, section, number) if number <= _MOST.get(kind, number) else None
    if found := _AXIS.fullmatch(name):
        return Quantity("force" if found[1] else "position", int(found[3]), "xyz".index(found[2]) + 1)
    if found := _ORIENTATION.fullmatch(name):
        return Quantity("orientation", int(found[2]), "wxyz".index(found[1]) + 1)
    return None


def meant(name: str) -> str | None:
    """The quantity's name that ``name`` is but for case, blanks and separators, ``q11`` of ``Q_11``; None if none."""
    plain = re.sub(r"[\s_.,:-]", "", name)
    return next((spelt for spelt in (name, plain, plain.lower()) if quantity(spelt)), None)


def column(name: str, unit: str) -> str:
    """The heading of a column: ``column("q11", "m")`` is ``"q11 [m]"``."""
    return f"{name} [{unit}]"


def _pair(section: int, number: int) -> str:
    _check(section, "section")
    _check(number, "bellows or input")
    separator = "_" if section > 9 or number > 9 else ""
    return f"{section}{separator}{number}"


def _check(number: int, what: str) -> None:
    if number < 1:
        raise InputError(f"{what} number is {number}; numbers count from 1")
