"""What fixes the scale of forces, and what is free of an arm of which nothing but a tape measure and a scale tell.

Mass, area, stiffness, bending stiffness and damping share one scale: all times two, and the arm moves the same. Weight
against pressure ties mass to area, nothing ties both to newtons but a value that is known. The rule, section by
section, in this order:

1. areas that the file calls published are known and stay, and so do published masses;
2. where every log measures the section's lengths, the file's areas count as known: such an arm comes with its drawings;
3. else the arm was weighed: its mass is that of the file within 5 %, and areas are free.

Numbers of a tape measure (rest lengths, and how far below the head the mass hangs) are free about the file's values
where heads are all that is seen. Guesses (stiffness, bending stiffness, damping) are free by factors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from bha.estimation.free import FreeParameter, camera_free
from bha.estimation.records import Record
from bha.parameters import ArmParameters, SectionParameters, paths

#: Standard deviation of ln(mass) of an arm that was weighed, and of ln(area) of one that was not measured.
WEIGHED, AREA = 0.05, math.log(3.0)
#: The same of a stiffness and of a damping: guesses are starts, and must not weigh in the scale.
STIFFNESS, DAMPING = math.log(1e6), math.log(1e6)
#: Standard deviation of a bending stiffness, in itself or what the springs bend, whichever is greater.
BENDING = 10.0
#: Standard deviations of a rest length, and of where the mass hangs, in rest lengths.
REST_LENGTH, CENTRE = 0.03, 1.0 / 6.0


def default_free_of(parameters: ArmParameters, records: Sequence[Record]) -> tuple[FreeParameter, ...]:
    """What is free of an arm by default under these records, without lags of commands (:mod:`bha.estimation.lags`)."""
    free: list[FreeParameter] = []
    for number, section in enumerate(parameters.sections, start=1):
        free += _of_section(number, section, records)
    if all(sees_a_head(rec) for rec in records):
        free += camera_free(parameters)
    return tuple(free)


def sees_a_head(rec: Record) -> bool:
    """Whether all three coordinates of some head are measured."""
    sections = [output.section for output in rec.observation.outputs if output.kind == "position"]
    return any(sections.count(section) == len(paths.AXES) for section in sections)


def scale_of(parameters: ArmParameters, free: Sequence[FreeParameter | str]) -> str:
    """What the scale of forces rests on, as a sentence."""
    names = {f if isinstance(f, str) else f.path for f in free}
    count = len(parameters.sections)
    areas = {f"section.{k}.terminal_area" for k in range(1, count + 1)}
    if not areas & names:
        return (
            "the scale of forces is that of the file's areas: masses, stiffnesses and dampings are right if these are"
        )
    return (
        "the scale of forces is that of the file's masses, taken as weighed to "
        f"{100 * WEIGHED:g} %: areas, stiffnesses and dampings are right if these are"
    )


def _of_section(number: int, section: SectionParameters, records: Sequence[Record]) -> list[FreeParameter]:
    place = f"section.{number}"
    published = {name for name, entry in section.provenance.items() if entry.status == "published"}
    measured = all(_measures_lengths(rec, number) for rec in records)
    areas_known = "terminal_area" in published or measured
    free = []
    if "mass" not in published:
        free.append(_about(f"{place}.mass", section.mass, math.log(5.0) if areas_known else WEIGHED))
    for k, value in enumerate(section.stiffness, start=1):
        path = f"{place}.stiffness.{k}"
        free.append(_about(path, value, STIFFNESS) if k == 1 and value > 0 and not measured else FreeParameter(path))
    for k, value in enumerate(section.bending_stiffness, start=1):
        path = f"{place}.bending_stiffness.{k}"
        if k == 1 and not measured:
            free.append(_beside_the_springs(path, value, section, number))
        elif value or k == 1:
            free.append(FreeParameter(path))
    if section.damping > 0 and not measured:
        free.append(_about(f"{place}.damping", section.damping, DAMPING))
    else:
        free.append(FreeParameter(f"{place}.damping"))
    if not areas_known:
        free.append(_about(f"{place}.terminal_area", section.terminal_area, AREA))
    if not measured:
        free += _of_a_tape_measure(place, section, published)
    return free


def _of_a_tape_measure(place: str, section: SectionParameters, published: set[str]) -> list[FreeParameter]:
    length, free = section.rest_length, []
    if "rest_length" not in published:
        free.append(_about(f"{place}.rest_length", length, REST_LENGTH))
    if "center_of_mass" not in section.model_fields_set and "terminal_area" not in published:
        prior = (0.0, CENTRE * length)
        free.append(FreeParameter(f"{place}.center_of_mass.z", lower=-0.5 * length, upper=0.0, prior=prior))
    return free


def _beside_the_springs(path: str, value: float, section: SectionParameters, number: int) -> FreeParameter:
    """A bending stiffness on a linear scale: weight, springs and it add up, and only their sum is told well."""
    springs = 0.5 * section.stiffness[0] * sum(b.radius**2 for b in section.resolved_bellows(number))
    size = max(abs(value), springs)
    return FreeParameter(path, prior=(value, BENDING * size), logarithmic=False, scale=size)


def _about(path: str, value: float, deviation: float) -> FreeParameter:
    """A positive number, free about a value by the standard deviation of its logarithm."""
    return FreeParameter(path, prior=(value, value * deviation))


def _measures_lengths(rec: Record, section: int) -> bool:
    """Whether lengths of a section are measured, by itself or in a wire that ends at its head."""
    return any(output.kind == "length" and output.section == section for output in rec.observation.outputs)
