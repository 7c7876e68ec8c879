"""Numbers that stand in no file and that an arm follows from: a tangent stiffness, a factor on moments of inertia.

What: how such a number of a section is written into the core's description of the arm. A polynomial's coefficients are
no good unknowns, for they trade off against each other; its slope at some lengths is one. A mass that moves its moments
of inertia along, (56), is another.
Limits: written one after the other from what the file says; two of them that act on the same number add up, or are
factors of it.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.estimation.free import Coordinate, with_values
from bha.parameters import ArmParameters, paths

Array = NDArray[np.float64]
Core = dict[str, Any]

#: Where in the range of lengths the tangent stiffness is identified: as many terms of the polynomial as places. Numbers
#: at places stay positive and plausible where coefficients would not: a polynomial that turns soft beyond the data
#: lets the arm run away on other logs.
STIFFNESS_PLACES = (0.05, 0.35, 0.65, 0.95)


def core_of(parameters: ArmParameters) -> Core:
    """The core's description of an arm, as a table of its own."""
    return dict(json.loads(parameters.to_core_json()))


def described(parameters: ArmParameters, coordinates: Sequence[Coordinate], values: Sequence[float] | Array) -> Core:
    """The core's description of an arm with values of coordinates: those of the file first, then what follows.

    Where sensors sit is no part of it.

    Raises:
        ParameterError: no arm has them.
    """
    moving = [(c, float(v)) for c, v in zip(coordinates, values, strict=True) if not paths.is_of_sensors(c.path)]
    stated = [(c, v) for c, v in moving if c.members]
    core = with_values(parameters, [c for c, _ in stated], [v for _, v in stated]).to_core()
    derived = [(c, v) for c, v in moving if not c.members]
    if not derived:
        return core
    nominal = json.loads(json.dumps(core, allow_nan=False))
    changed: Core = copy.deepcopy(nominal)
    for own, value in derived:
        number = int(own.path.split(".")[1]) - 1
        set_number(changed["section"][number], own.path, value, nominal["section"][number])
    return changed


def set_number(section: Core, path: str, value: float, nominal: Core) -> None:
    """Write one such number of a section into the core's description.

    ``section.1.mass`` moves the inertia along, since (56) is proportional to the mass; ``section.1.inertia.*`` is a
    factor. ``section.1.bellows.2.rest_length`` is that of one bellows. ``section.1.tangent_stiffness.3`` (at the third
    of :func:`stiffness_elongations` of the ``nominal`` section), ``section.1.damping``, ``section.1.rest_length`` and
    ``section.1.terminal_area`` act on all bellows of the section, whose differences stay in proportion.
    """
    _, _, key, *rest = path.split(".")
    if key == "mass":
        factor = value / section["mass"]
        section["mass"] = value
        section["inertia"] = [factor * entry for entry in section["inertia"]]
    elif key == "inertia":
        section["inertia"] = [value * entry for entry in section["inertia"]]
    elif key == "center_of_mass":
        # The logged force keeps acting where it did.
        section["force_point"] = section.get("force_point") or section["center_of_mass"]
        section["center_of_mass"] = [*section["center_of_mass"][:2], value]
    elif key == "bending_stiffness":
        section["bending_stiffness"] = [value, *section["bending_stiffness"][1:]]
    elif key == "bellows":
        section["bellows"][int(rest[0]) - 1][rest[1]] = value
    elif key == "tangent_stiffness":
        set_tangent_stiffness(section, stiffness_elongations(nominal), int(rest[0]) - 1, value)
    else:
        old = section["bellows"][0][key]
        for bellows in section["bellows"]:
            bellows[key] = bellows[key] * value / old if old else value


def stiffness_elongations(section: Core) -> tuple[float, ...]:
    """Elongations at which the tangent stiffness is identified, m: places in a section's range from its rest length."""
    low, high = section["length_range"]
    rest = section["bellows"][0]["rest_length"]
    return tuple(low + share * (high - low) - rest for share in STIFFNESS_PLACES)


def tangent_stiffness(stiffness: Sequence[float], elongation: float) -> float:
    """Slope of the spring force ``sum_m stiffness[m] x^(m + 1)``, N/m."""
    return sum((m + 1) * k * elongation**m for m, k in enumerate(stiffness))


def set_tangent_stiffness(section: Core, elongations: Sequence[float], place: int, value: float) -> None:
    """Change the springs of a section: tangent stiffness ``value`` at one elongation, and as it was at the others."""
    at = list(elongations)
    own = at.pop(place)
    # Lagrange's polynomial: one at its own elongation, zero at the others.
    shape = np.array([1.0])
    for other in at:
        shape = np.convolve(shape, np.array([-other, 1.0]) / (own - other))
    first = list(section["bellows"][0]["stiffness"])
    change = value - tangent_stiffness(first, own)
    for bellows in section["bellows"]:
        terms = [*bellows["stiffness"], *[0.0] * (len(shape) - len(bellows["stiffness"]))]
        scale = terms[0] / first[0] if first[0] else 1.0
        for m, weight in enumerate(shape):
            terms[m] += scale * change * float(weight) / (m + 1)
        bellows["stiffness"] = terms
