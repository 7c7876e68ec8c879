"""Numbers of the arm's file that no bellows arm has: millimetres for metres, grams for kilograms, gauge for absolute.

What: each number is held against what arms are, from one for a finger to one for a crane, and against its neighbours in
the same section. A number that fits when another unit is read is a mistake of the unit; the line to write is given.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from bha.checkup.finding import Explanation, Finding, Severity

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.parameters import SectionParameters

#: Key: smallest and largest plausible value, SI, and units that are mixed up with it, by how much too large they are.
LIMITS: dict[str, tuple[float, float, dict[float, str]]] = {
    "mass": (1e-4, 60.0, {1e3: "g", 1e6: "mg"}),
    "bellows_radius": (1e-3, 1.0, {1e3: "mm", 1e2: "cm", 39.37: "inches"}),
    "bellows_outer_radius": (5e-4, 0.5, {1e3: "mm", 1e2: "cm", 39.37: "inches"}),
    "terminal_area": (1e-7, 0.2, {1e6: "mm^2", 1e4: "cm^2", 1550.0: "square inches"}),
    "rest_length": (1e-3, 3.0, {1e3: "mm", 1e2: "cm", 39.37: "inches"}),
    "base_offset": (0.0, 3.0, {1e3: "mm", 1e2: "cm", 39.37: "inches"}),
    "head_offset": (0.0, 3.0, {1e3: "mm", 1e2: "cm", 39.37: "inches"}),
}
RANGE_LIMITS: dict[str, tuple[float, float, dict[float, str]]] = {
    "length_range": (5e-4, 5.0, {1e3: "mm", 1e2: "cm", 39.37: "inches"}),
    "pressure_range": (1e3, 5e6, {1e-5: "bar", 1e-3: "kPa", 1.45038e-4: "psi"}),
}
#: Densities, kg/m^3, between which a section with its plates lies.
DENSITY = (1.0, 2e4)
#: Earth's gravity, m/s^2, and by how much a file may differ.
EARTH, EARTH_TOLERANCE = 9.81, 0.1
#: Ambient pressures where people live, Pa.
AMBIENT = (3e4, 1.2e5)


def geometry_findings(arm: Arm) -> list[Finding]:
    """What is implausible in an arm's file."""
    found = list(_arm(arm))
    for number, section in enumerate(arm.parameters.sections, start=1):
        values = list(_values(section, number))
        found += values
        if not any(finding.severity == "fault" for finding in values):
            found += _proportions(section, number)
    return found


def _arm(arm: Arm) -> Iterator[Finding]:
    ambient = arm.parameters.ambient_pressure
    if not AMBIENT[0] <= ambient <= AMBIENT[1]:
        for ratio, unit in RANGE_LIMITS["pressure_range"][2].items():
            if AMBIENT[0] <= ambient / ratio <= AMBIENT[1]:
                yield _unit("ambient_pressure", "Pa", ambient, ratio, unit, "")
                break
        else:
            severity: Severity = "note" if ambient == 0.0 else "warning"
            what = f"ambient_pressure is {ambient:g} Pa, which is on no place where people live"
            yield _finding(
                severity, what, f"plausible: {AMBIENT[0]:g} to {AMBIENT[1]:g} Pa", "ambient_pressure = 101325.0"
            )
    size = float(np.linalg.norm(arm.parameters.gravity))
    if size > 0.0 and abs(size / EARTH - 1.0) > EARTH_TOLERANCE:
        what = f"gravity is {size:.4g} m/s^2"
        direction = np.asarray(arm.parameters.gravity) / size * EARTH
        line = f"gravity = [{', '.join(f'{g:.4g}' for g in direction)}]"
        yield _finding("warning", what, "on Earth it is 9.81 m/s^2", line)


def _values(section: SectionParameters, number: int) -> Iterator[Finding]:
    place = f" in [[section]] {number}"
    for key, (low, high, units) in LIMITS.items():
        value = getattr(section, key)
        if value is not None and not low <= value <= high:
            yield _implausible(key, value, low, high, _likeliest(key, value, units, section), place)
    for b, bellows in enumerate(section.bellows or (), start=1):
        for key, limit in (
            ("radius", "bellows_radius"),
            ("terminal_area", "terminal_area"),
            ("rest_length", "rest_length"),
        ):
            value = getattr(bellows, key)
            low, high, units = LIMITS[limit]
            if value is not None and not low <= value <= high:
                yield _implausible(key, value, low, high, units, f" in [[section.bellows]] {b} of section {number}")
    for key, (low, high, units) in RANGE_LIMITS.items():
        pair = getattr(section, key)
        if key == "pressure_range" and pair[1] <= 5e3:
            ratio, unit = next(((r, u) for r, u in units.items() if 1.05e5 <= pair[1] / r <= 2e6), (0.0, ""))
            if ratio:
                yield _unit(key, "Pa", pair, ratio, unit, place)
                continue
        if not (pair[1] <= high and pair[1] > low):
            yield _implausible(key, pair, low, high, units, place)


def _proportions(section: SectionParameters, number: int) -> Iterator[Finding]:
    """Numbers that are possible, but not together."""
    place = f"section {number}"
    radius, length = section.bellows_radius, float(np.mean(section.length_range))
    for key, other, ratio in (
        ("bellows_radius", "mean of length_range", radius / length),
        ("rest_length", "mean of length_range", section.rest_length / length),
        ("bellows_outer_radius", "bellows_radius", (section.bellows_outer_radius or radius) / radius),
    ):
        if not 0.02 <= ratio <= 20.0:
            what = f"{place}: {key} is {ratio:.3g} times {other}"
            yield _finding(
                "fault", what, "plausible: 0.02 to 20 times", f"check the unit (m) of {key} and of {other.split()[-1]}"
            )
    outer = section.bellows_outer_radius or 0.3 * radius
    volume = np.pi * (radius + outer) ** 2 * length
    density = section.mass / volume
    if not DENSITY[0] <= density <= DENSITY[1]:
        what = f"{place}: {section.mass:g} kg in {1e3 * volume:.3g} l are {density:.3g} kg/m^3"
        yield _finding(
            "warning",
            what,
            f"plausible: {DENSITY[0]:g} to {DENSITY[1]:g} kg/m^3",
            "check the units of mass (kg) and of the radii (m)",
        )
    share = section.terminal_area / (np.pi * (radius + outer) ** 2)
    if share > 3.0 or share < 1e-4:
        what = f"{place}: terminal_area is {share:.3g} times the area of the whole section"
        yield _finding("warning", what, "plausible: 1e-4 to 3 times", "check the unit of terminal_area (m^2)")
    if not any(k > 0.0 for k in (section.stiffness[0], *(section.axial_stiffness or ())[:1])):
        what = (
            f"{place}: stiffness begins with {section.stiffness[0]:g} N/m: no spring holds its bellows at rest_length"
        )
        yield _finding("warning", what, "arms have a first coefficient above 0", "check the sign of stiffness (N/m)")
    low, high = section.pressure_range
    stroke = section.terminal_area * (high - low) / section.stiffness[0] if section.stiffness[0] > 0.0 else np.nan
    span = section.length_range[1] - section.length_range[0]
    if np.isfinite(stroke) and not 0.02 <= stroke / span <= 50.0:
        what = f"{place}: pressure_range moves a bellows by {1e3 * stroke:.3g} mm, length_range has {1e3 * span:.3g} mm"
        yield _finding(
            "warning",
            what,
            "terminal_area times pressures over stiffness",
            "check the units of terminal_area (m^2), stiffness (N/m) and pressure_range (Pa)",
        )


def _likeliest(key: str, value: float, units: dict[float, str], section: SectionParameters) -> dict[float, str]:
    """The units of an area in the order in which they make a chamber of a tenth of the section's area."""
    if key != "terminal_area":
        return units
    whole = 0.1 * np.pi * (section.bellows_radius + (section.bellows_outer_radius or 0.0)) ** 2
    return dict(sorted(units.items(), key=lambda unit: abs(np.log(value / unit[0] / whole))))


def _implausible(key: str, value: object, low: float, high: float, units: dict[float, str], place: str) -> Finding:
    si = {"mass": "kg", "terminal_area": "m^2", "pressure_range": "Pa"}.get(key, "m")
    largest = value[1] if isinstance(value, tuple) else value
    assert isinstance(largest, float)
    for ratio, unit in units.items():
        if low < largest / ratio <= high:
            return _unit(key, si, value, ratio, unit, place)
    return _finding(
        "warning",
        f"{key} = {_text(value)} {si}{place} is implausible",
        f"arms have {low:g} to {high:g} {si}",
        f"check {key}{place}",
    )


def _unit(key: str, si: str, value: object, ratio: float, unit: str, place: str) -> Finding:
    mended = [v / ratio for v in value] if isinstance(value, tuple) else value / ratio  # type: ignore[operator]
    what = f"{key} = {_text(value)}{place} reads as {si}; it looks like {unit}"
    return _finding("fault", what, f"in {si} no arm has that", f"{key} = {_text(mended)}{place and '  #' + place}")


def _finding(severity: Severity, what: str, evidence: str, repair: str) -> Finding:
    return Finding(severity, "geometry", "arm file", what, evidence, {}, (Explanation("a number of the file", repair),))


def _text(value: object) -> str:
    return "[" + ", ".join(f"{v:g}" for v in value) + "]" if isinstance(value, list | tuple) else f"{value:g}"
