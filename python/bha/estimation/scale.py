"""What fixes the scale of forces, and what is free of an arm of which nothing but a tape measure and a scale tell.

Mass, area, stiffness, bending stiffness and damping share one scale: all times two, and the arm moves the same. Weight
against pressure ties mass to area, section by section, nothing ties all to newtons but a value that is known. The rule,
section by section, in this order:

1. what the file calls published is known and stays;
2. where the file calls its area measured or identified, areas count as known to a tenth;
3. else the mass is that of the file, within 5 % where it calls it measured (on a scale), else within 15 %, and areas
   are free: who has a scale knows what an arm weighs, and nobody the effective area of a bellows before it was found.

Numbers of a tape measure are free about the file's values: rest lengths, how far below the head the mass hangs and how
it is spread about that (moments of inertia), where wires run. A rest length that is off by some per cent is
millimetres, many times the noise, and what cannot become length becomes curvature of springs and weight; moments that
are not those of the cylinder of (56) become bending stiffness, and radii of wires (docs/decisions/0015). Guesses
(stiffness, bending stiffness, damping) are free by factors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from bha.arm import Arm
from bha.estimation.free import FreeParameter, camera_free, typical_scale
from bha.estimation.records import Record
from bha.parameters import ArmParameters, SectionParameters, paths
from bha.parameters.provenance import published
from bha.parameters.tables import AXES

#: Standard deviation of ln(mass) of an arm that was weighed and of one of which the file does not say so, and of
#: ln(area) of one that comes with its drawings and of one that does not.
WEIGHED, STATED, DRAWN, AREA = 0.05, 0.15, 0.1, math.log(3.0)
#: The same of a stiffness and of a damping: guesses are starts, and must not weigh in the scale.
STIFFNESS, DAMPING = math.log(1e6), math.log(1e6)
#: The same of what each higher power of a spring adds at the ends of its range, in the force of the first one there: of
#: one that the file states, and of one that it does not.
CURVED, STRAIGHT = 0.5, 0.1
#: Powers of a spring.
POWERS = 3
#: Standard deviation of a bending stiffness, in itself or what the springs bend, whichever is greater.
BENDING = 10.0
#: Standard deviation of the logarithm of a factor on moments of inertia: those of (56) are of a solid cylinder, and the
#: mass of bellows lies along them.
INERTIA = 0.5
#: Standard deviations of a rest length, and of where the mass hangs, in rest lengths.
REST_LENGTH, CENTRE = 0.03, 1.0 / 6.0
#: Standard deviations of the azimuth of a wire, rad, and of its radius, in itself.
WIRE_ANGLE, WIRE_RADIUS = math.radians(2.0), 0.03


def default_free_of(parameters: ArmParameters, records: Sequence[Record]) -> tuple[FreeParameter, ...]:
    """What is free of an arm by default under these records, without lags of commands (:mod:`bha.estimation.lags`)."""
    free: list[FreeParameter] = []
    for number in range(1, len(parameters.sections) + 1):
        free += _of_section(parameters, number)
    free += wires_free(parameters, records)
    if all(sees_a_head(rec) for rec in records):
        free += camera_free(parameters)
    return tuple(free)


def sees_a_head(rec: Record) -> bool:
    """Whether all three coordinates of some head are measured."""
    sections = [output.section for output in rec.observation.outputs if output.kind == "position"]
    return any(sections.count(section) == len(AXES) for section in sections)


def scale_of(parameters: ArmParameters, free: Sequence[FreeParameter]) -> str:
    """What the scale of forces rests on, as a sentence."""
    areas = [_spread(f) for f in free if f.path.startswith("section.") and f.path.endswith(".terminal_area")]
    masses = [_spread(f) for f in free if f.path.startswith("section.") and f.path.endswith(".mass")]
    if not areas:
        return (
            "the scale of forces is that of the file's areas: masses, stiffnesses and dampings are right if these are"
        )
    if masses and max(areas) < max(masses):
        return (
            f"the scale of forces is that of the file's areas, taken as known to {100 * max(areas):g} %: masses, "
            "stiffnesses and dampings are right as far as these are"
        )
    known = f", taken as known to {100 * max(masses):g} %" if masses else ""
    return (
        f"the scale of forces is that of the file's masses{known}: areas, stiffnesses and dampings are right as far as "
        "these are"
    )


def _spread(free: FreeParameter) -> float:
    """Standard deviation of the prior of a positive number, in itself."""
    return math.inf if free.prior is None else free.prior[1] / free.prior[0]


def _of_section(parameters: ArmParameters, number: int) -> list[FreeParameter]:
    place, section = f"section.{number}", parameters.sections[number - 1]
    status = {name: entry.status for name, entry in section.provenance.items()}
    known = published(section.provenance)
    area = status.get("terminal_area")
    drawn = area in ("published", "measured", "identified")
    free = []
    if "mass" not in known:
        weighed = WEIGHED if status.get("mass") == "measured" else STATED
        free.append(_about(f"{place}.mass", section.mass, math.log(5.0) if drawn else weighed))
    if not {"mass", "inertia"} & known:
        free.append(_about(f"{place}.inertia.*", 1.0, INERTIA))
    for k, value in enumerate(section.stiffness, start=1):
        path = f"{place}.stiffness.{k}"
        if k > 1:
            free.append(curved(parameters, path))
        else:
            free.append(_about(path, value, STIFFNESS) if value > 0 and not drawn else FreeParameter(path))
    for k, value in enumerate(section.bending_stiffness, start=1):
        path = f"{place}.bending_stiffness.{k}"
        if k == 1:
            free.append(_beside_the_springs(path, value, section, number))
        elif value:
            free.append(FreeParameter(path))
    if section.damping > 0 and not drawn:
        free.append(_about(f"{place}.damping", section.damping, DAMPING))
    else:
        free.append(FreeParameter(f"{place}.damping"))
    if "terminal_area" not in known:
        free.append(_about(f"{place}.terminal_area", section.terminal_area, DRAWN if drawn else AREA))
    return [*free, *_of_a_tape_measure(place, section, known)]


def is_guessed(section: SectionParameters) -> bool:
    """Whether stiffness, damping and area of a section are guesses: it states one number of its springs, and nothing
    that would tell where that comes from.

    A tape measure's file says how stiff a chamber is about; who has a curve has measured it.
    """
    stated = section.provenance.get("stiffness")
    return len(section.stiffness) == 1 and (stated is None or stated.status == "assumed")


def curved(parameters: ArmParameters, path: str) -> FreeParameter:
    """A coefficient of a higher power of a spring."""
    value = paths.get_value(parameters, path)
    spread = (CURVED if value else STRAIGHT) * typical_scale(parameters, path, value)
    return FreeParameter(path, prior=(value, spread))


def with_curved_springs(arm: Arm) -> Arm:
    """The arm with springs of three powers where its file states one number; the same one where it does so of none.

    A tape measure's file says how stiff a chamber is, not that it is as stiff at the ends of its range as at rest.
    Without what is missing there an arm that rings is fitted in another valley.
    """
    mapping, changed = arm.parameters.to_mapping(), False
    for table, section in zip(mapping["section"], arm.parameters.sections, strict=True):
        if len(section.stiffness) == 1 and "stiffness" not in published(section.provenance):
            table["stiffness"] = [section.stiffness[0], *[0.0] * (POWERS - 1)]
            changed = True
    return Arm(arm.parameters.updated({"section": mapping["section"]})) if changed else arm


def _of_a_tape_measure(place: str, section: SectionParameters, known: set[str]) -> list[FreeParameter]:
    length, free = section.rest_length, []
    if "rest_length" not in known:
        free.append(_about(f"{place}.rest_length", length, REST_LENGTH))
    if "center_of_mass" not in section.model_fields_set and "terminal_area" not in known:
        prior = (0.0, CENTRE * length)
        free.append(FreeParameter(f"{place}.center_of_mass.z", lower=-0.5 * length, upper=0.0, prior=prior))
    return free


def wires_free(parameters: ArmParameters, records: Sequence[Record]) -> list[FreeParameter]:
    """Where the wires run that every log reads: nobody holds a protractor to better than some degrees."""
    read = [set(rec.observation.names) for rec in records]
    free = []
    for number, wire in enumerate(parameters.length_sensors, start=1):
        if not all(wire.name in names for names in read):
            continue
        known = published(wire.provenance)
        if "angle" not in known:
            free.append(FreeParameter(f"length_sensor.{number}.angle", prior=(wire.angle_rad, WIRE_ANGLE)))
        if "radius" not in known and wire.radius > 0.0:
            prior = (wire.radius, WIRE_RADIUS * wire.radius)
            free.append(FreeParameter(f"length_sensor.{number}.radius", prior=prior))
    return free


def _beside_the_springs(path: str, value: float, section: SectionParameters, number: int) -> FreeParameter:
    """A bending stiffness on a linear scale: weight, springs and it add up, and only their sum is told well."""
    springs = 0.5 * section.stiffness[0] * sum(b.radius**2 for b in section.resolved_bellows(number))
    size = max(abs(value), springs)
    return FreeParameter(path, prior=(value, BENDING * size), logarithmic=False, scale=size)


def _about(path: str, value: float, deviation: float) -> FreeParameter:
    """A positive number, free about a value by the standard deviation of its logarithm."""
    return FreeParameter(path, prior=(value, value * deviation))
