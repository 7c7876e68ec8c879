"""What a tape measure and a scale tell of an arm, and which of it is plausible.

The measures of an arm that stands, lies or hangs where it works. ``guesses.py`` makes from them what nobody can
measure with a tape, ``new_file.py`` the parameter file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from bha.errors import ParameterError
from bha.parameters.arm import MOST_SECTIONS

Mounting = Literal["hanging", "lying", "upright"]

STANDARD_GRAVITY = 9.81  # m/s^2
STANDARD_ATMOSPHERE = 101325.0  # Pa
FEWEST_BELLOWS, MOST_BELLOWS = 2, 12


@dataclass(frozen=True)
class Measure:
    """One thing to measure.

    Attributes:
        name: attribute of :class:`MeasuredSection` or :class:`MeasuredArm`.
        what: what it is, in words.
        unit: SI unit.
        shown: the unit people measure it in.
        factor: a value in ``shown`` times this is the value in ``unit``.
        low: least plausible value, in ``unit``.
        high: greatest plausible value, in ``unit``.
        example: a usual value, in ``unit``.
    """

    name: str
    what: str
    unit: str
    shown: str
    factor: float
    low: float
    high: float
    example: float

    @property
    def kind(self) -> str:
        """What kind of quantity it is, a word."""
        return {"m": "length", "kg": "mass", "Pa": "pressure", "m^2": "area"}[self.unit]

    def text(self, value: float) -> str:
        """A value with the unit people measure it in, ``150 mm``."""
        return f"{value / self.factor:.4g} {self.shown}"

    def doubt(self, value: float) -> str | None:
        """What is odd about a value; None if arms have such. Names the unit that was probably meant."""
        if self.low <= value <= self.high:
            return None
        text = f"{self.name}: {self.text(value)} is not what arms have, {self.text(self.low)} to {self.text(self.high)}"
        meant = next((value * f for f in (self.factor, 1.0 / self.factor) if self.low <= value * f <= self.high), None)
        return text if meant is None or self.factor == 1.0 else f"{text}; is {self.text(meant)} meant?"


#: Of a section. Lengths are those of the arm as it is mounted.
SECTION_MEASURES = (
    Measure("length", "length of a bellows at ambient pressure", "m", "mm", 1e-3, 0.01, 2.0, 0.15),
    Measure("longest", "its length with the greatest pressure in all bellows", "m", "mm", 1e-3, 0.011, 4.0, 0.225),
    Measure("radius", "from the centre line to the middle of a bellows", "m", "mm", 1e-3, 0.003, 0.5, 0.06),
    Measure("diameter", "outer diameter of one bellows", "m", "mm", 1e-3, 0.003, 0.4, 0.05),
    Measure("mass", "mass of the section: head plate, bellows, hoses", "kg", "kg", 1.0, 0.005, 15.0, 0.5),
    Measure("base_offset", "stiff piece before the bellows", "m", "mm", 1e-3, 0.0, 0.5, 0.0),
    Measure("head_offset", "stiff piece after the bellows", "m", "mm", 1e-3, 0.0, 0.5, 0.0),
)
#: Of the whole arm. Gauge pressures: above ambient pressure.
ARM_MEASURES = (
    Measure("pressure_max", "greatest gauge pressure", "Pa", "bar", 1e5, 2e3, 1.2e6, 1e5),
    Measure("pressure_min", "least gauge pressure, below 0 with a vacuum", "Pa", "bar", 1e5, -1e5, 0.0, 0.0),
)
#: Effective area of a bellows that is not round, m^2; measured by hardly anybody.
AREA = Measure("area", "effective area of one bellows", "m^2", "cm^2", 1e-4, 5e-6, 0.1, 2e-3)
#: Longest over length where nobody has measured it.
USUAL_STRETCH = 1.5


@dataclass(frozen=True)
class MeasuredSection:
    """A section with equal bellows at equal angles; SI units.

    Attributes:
        length: of a bellows at ambient pressure, on the arm as it is mounted, m.
        longest: its length with the greatest pressure in all bellows of the section, m; None: not measured.
        radius: from the centre line to the middle of a bellows, m.
        diameter: outer diameter of one bellows, m.
        mass: kg.
        bellows: their number, 2 to 12.
        first_angle_deg: angle of bellows 1 about z from x, degrees; the others follow at equal angles.
        base_offset: stiff piece along z before the bellows, m.
        head_offset: stiff piece after them, m.
        area: effective area of one bellows, m^2; None: guessed from the diameter.
    """

    length: float
    radius: float
    diameter: float
    mass: float
    longest: float | None = None
    bellows: int = 3
    first_angle_deg: float = 0.0
    base_offset: float = 0.0
    head_offset: float = 0.0
    area: float | None = None

    @property
    def resolved_longest(self) -> float:
        """The longest length, m; half as long again as ``length`` where it was not measured."""
        return USUAL_STRETCH * self.length if self.longest is None else self.longest

    @property
    def angles_deg(self) -> tuple[float, ...]:
        """Angles of the bellows about z from x, degrees, from 0 up to 360."""
        step = 360.0 / self.bellows
        return tuple(round(math.fmod(self.first_angle_deg + k * step, 360.0), 9) for k in range(self.bellows))


@dataclass(frozen=True)
class MeasuredArm:
    """An arm from base to tip; SI units.

    Attributes:
        name: of the arm.
        sections: from the base on.
        pressure_max: greatest gauge pressure, Pa.
        pressure_min: least gauge pressure, Pa, at most 0.
        mounting: ``"hanging"``, ``"lying"`` (the straight arm is level, x points down) or ``"upright"``.
        ambient_pressure: absolute, Pa.
    """

    name: str
    sections: tuple[MeasuredSection, ...]
    pressure_max: float
    pressure_min: float = 0.0
    mounting: Mounting = "hanging"
    ambient_pressure: float = STANDARD_ATMOSPHERE

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of gravity in the base's frame, m/s^2."""
        g = STANDARD_GRAVITY
        return {"hanging": (0.0, 0.0, g), "lying": (g, 0.0, 0.0), "upright": (0.0, 0.0, -g)}[self.mounting]


def check(arm: MeasuredArm) -> None:
    """Check that the measures can be those of an arm.

    Raises:
        ParameterError: with every measure that cannot be: what was found, and what is allowed.
    """
    faults = list(_faults(arm))
    if faults:
        raise ParameterError("\n".join(f"{arm.name}: {fault}" for fault in faults))


def _faults(arm: MeasuredArm) -> Iterator[str]:
    if not 1 <= len(arm.sections) <= MOST_SECTIONS:
        yield f"sections: found {len(arm.sections)}; allowed: 1 to {MOST_SECTIONS}"
    if arm.mounting not in get_args(Mounting):
        yield f"mounting: found {arm.mounting!r}; allowed: {', '.join(get_args(Mounting))}"
    if not 0.0 < arm.ambient_pressure < math.inf:
        yield f"ambient_pressure: found {arm.ambient_pressure}; allowed: a finite number > 0 (Pa)"
    elif not -arm.ambient_pressure <= arm.pressure_min <= 0.0:
        least = -arm.ambient_pressure
        yield f"pressure_min: found {arm.pressure_min} Pa; allowed: gauge pressure from {least} (vacuum) to 0 Pa"
    if not 0.0 < arm.pressure_max < math.inf:
        yield f"pressure_max: found {arm.pressure_max} Pa; allowed: a finite gauge pressure > 0"
    for number, section in enumerate(arm.sections, start=1):
        for fault in _section_faults(section):
            yield f"section {number}: {fault}"


def _section_faults(section: MeasuredSection) -> Iterator[str]:
    if not FEWEST_BELLOWS <= section.bellows <= MOST_BELLOWS:
        yield f"bellows: found {section.bellows}; allowed: {FEWEST_BELLOWS} to {MOST_BELLOWS}"
    if not math.isfinite(section.first_angle_deg):
        yield f"first_angle_deg: found {section.first_angle_deg}; allowed: a finite number (degrees)"
    for measure in (*SECTION_MEASURES, AREA):
        value = getattr(section, measure.name)
        least = 0.0 if measure.name.endswith("offset") else math.ulp(0.0)
        if value is not None and not least <= value < math.inf:
            allowed = ">= 0" if least == 0.0 else "> 0"
            yield f"{measure.name}: found {value}; allowed: a finite number {allowed} ({measure.unit})"
    if section.longest is not None and section.longest <= section.length:
        yield (
            f"longest: found {section.longest} m; allowed: more than the length at ambient pressure, "
            f"{section.length} m, for pressure lengthens a bellows"
        )


def doubts(arm: MeasuredArm) -> list[str]:
    """What is odd about measures that can be, a text each: sizes that no arm has, measures that do not go together."""
    found = [measure.doubt(getattr(arm, measure.name)) for measure in ARM_MEASURES]
    texts = [text for text in found if text]
    said: dict[str, list[int]] = {}
    for number, section in enumerate(arm.sections, start=1):
        for text in _section_doubts(section):
            said.setdefault(text, []).append(number)
    return [*texts, *(f"{_sections(numbers)}: {text}" for text, numbers in said.items())]


def _sections(numbers: Sequence[int]) -> str:
    return f"section {numbers[0]}" if len(numbers) == 1 else f"sections {', '.join(map(str, numbers))}"


def _section_doubts(section: MeasuredSection) -> Iterator[str]:
    for measure in (*SECTION_MEASURES, AREA):
        value = getattr(section, measure.name)
        if value is not None and (text := measure.doubt(value)):
            yield text
    apart = 2.0 * section.radius * math.sin(math.pi / section.bellows)
    if section.diameter > 1.05 * apart:
        yield (
            f"diameter: {section.bellows} bellows of {1e3 * section.diameter:.4g} mm have no room side by side at "
            f"{1e3 * section.radius:.4g} mm from the centre line, where their middles are {1e3 * apart:.4g} mm apart"
        )
    stretch = section.resolved_longest / section.length
    if not 1.02 <= stretch <= 3.0:
        yield f"longest: {stretch:.3g} times the length at ambient pressure; bellows reach 1.02 to 3 times"
