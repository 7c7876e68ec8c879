"""An axial stiffness of its own, where a slow arm bends more easily than its springs allow.

Linear springs k at radii r of a section with parallel chambers make two numbers, whatever their chambers and pressures:
a stiffness against stretching, sum k + K, and one against bending, sum k r^2 cos^2 + k_bend. Beside the springs a
bending stiffness k_bend >= 0 says the second where it is more than the springs make; where it is less (fabric that
hardly lengthens, a sleeve, a backbone) an axial stiffness K says the first. Never both: only two of the three numbers
are told. The statics (:mod:`bha.estimation.statics`) end near k_bend = 0 there, and simulations judge whether K is
better (:mod:`bha.estimation.begin`). Damping follows: that of the bellows for bending, an axial damping for the rest of
the stretching.
Limits: one driven chamber tells both by its area, and the area by the scale (:mod:`bha.estimation.scale`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from bha.estimation.free import FreeParameter
from bha.estimation.statics import Statics
from bha.parameters import ArmParameters

#: Part of what the springs bend below which a bending stiffness may stand for none.
_NONE = 0.2
#: Nobody knows it: the deviation of its prior as a logarithm.
_DEVIATION = math.log(1e6)


def without_bending_stiffness(parameters: ArmParameters, statics: Statics) -> tuple[int, ...]:
    """Sections whose bending stiffness the statics have at its bound of zero, and that state no axial one."""
    found = []
    for coordinate, z in zip(statics.coordinates, statics.z, strict=True):
        steps = coordinate.path.split(".")
        if steps[0] != "section" or steps[2:] != ["bending_stiffness", "1"] or not steps[1].isdigit():
            continue
        number = int(steps[1])
        section = parameters.sections[number - 1]
        stiffness = statics.values.get(f"section.{number}.stiffness.1", section.stiffness[0])
        springs = 0.5 * stiffness * sum(b.radius**2 for b in section.resolved_bellows(number))
        if section.axial_stiffness is None and abs(coordinate.value(float(z))) < _NONE * springs:
            found.append(number)
    return tuple(found)


def with_axial_stiffness(
    parameters: ArmParameters, free: Sequence[FreeParameter | str], sections: Sequence[int]
) -> tuple[ArmParameters, tuple[FreeParameter | str, ...]]:
    """The parameters with an axial stiffness in place of the bending stiffness of some sections, and what is free.

    Such an arm bends far. Where the file states no force model it gets the one whose forces do the work of springs.
    """
    mapping, left, more = parameters.to_mapping(), list(free), []
    if "force_model" not in parameters.model_fields_set:
        mapping["force_model"] = "work_conjugate"
    for number in sections:
        table, section = mapping["section"][number - 1], parameters.sections[number - 1]
        place, count = f"section.{number}", len(section.resolved_bellows(number))
        stiffness, damping = count * section.stiffness[0], count * max(section.damping, 1e-3 * section.stiffness[0])
        table["bending_stiffness"] = [0.0, *section.bending_stiffness[1:]]
        table["axial_stiffness"], table["axial_damping"] = [stiffness], damping
        left = [f for f in left if (f if isinstance(f, str) else f.path) != f"{place}.bending_stiffness.1"]
        more += [
            FreeParameter(f"{place}.axial_stiffness.1", prior=(stiffness, _DEVIATION * stiffness)),
            FreeParameter(f"{place}.axial_damping", prior=(damping, _DEVIATION * damping)),
        ]
    return parameters.updated(mapping), (*left, *more)
