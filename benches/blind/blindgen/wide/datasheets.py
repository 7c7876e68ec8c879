"""What the user's file says of the arm: from a data sheet, from a first identification, or from a tape measure.

==============  ==================  ====================  ===========  ==========================
file            masses              stiffness, damping,   area         geometry (rest lengths,
                                    bending stiffness                  radii, places of wires)
==============  ==================  ====================  ===========  ==========================
``data_sheet``  10 %                10 %                  2 %          1 %
``identified``  30 %                30 %                  5 %          1 %, rest lengths 5 %
``tape``        5 % (weighed)       factor of up to 3     factor of 3  5 %
==============  ==================  ====================  ===========  ==========================

Each number is off on its own, evenly to either side. Angles, gravity, ambient pressure (but for a session's drift) and
the force model are right, unless a setup fault says otherwise. A tape measure knows no nonlinear springs. No file
knows where the camera stands.
"""

from dataclasses import dataclass

import numpy as np

from .arms import TrueArm
from .faults import Fault
from .sensors import Sensors

QUALITIES = ("data_sheet", "identified", "tape")


@dataclass(frozen=True)
class Quality:
    """How far numbers are off: relative, or (``guess``) a factor of up to so much."""

    mass: float
    mechanics: float
    area: float
    geometry: float
    rest: float
    guess: float = 0.0
    springs: int = 3


TABLE = {
    "data_sheet": Quality(0.10, 0.10, 0.02, 0.01, 0.01),
    "identified": Quality(0.30, 0.30, 0.05, 0.01, 0.05),
    "tape": Quality(0.05, 0.0, 0.0, 0.05, 0.05, guess=3.0, springs=1),
}


def _list(values: object) -> str:
    return "[" + ", ".join(f"{x:.6g}" for x in np.ravel(np.asarray(values))) + "]"


def user_file(rng: np.random.Generator, arm: TrueArm, quality: str, sensors: Sensors, fault: Fault | None) -> str:
    """Text of the parameter file that the product gets."""
    q = TABLE[quality]

    def off(share: float) -> float:
        return float(1.0 + rng.uniform(-share, share))

    def mechanics() -> float:
        return float(q.guess ** rng.uniform(-1.0, 1.0)) if q.guess else off(q.mechanics)

    sign = -1.0 if fault is not None and fault.kind == "gravity_sign" else 1.0
    lines = [
        'schema = "bha-arm/1"',
        'name = "arm"',
        f"gravity = {_list(sign * np.array(arm.gravity))}",
        f"ambient_pressure = {arm.ambient:.6g}",
        f'force_model = "{arm.force_model}"',
    ]
    if sensors.sort == "coordinates" and not all(arm.standard(i) for i in range(len(arm.sections))):
        lines += ["", "[sensors]", 'lengths = "coordinates"']
    for i, s in enumerate(arm.sections):
        area = float(q.guess ** rng.uniform(-1.0, 1.0)) if q.guess else off(q.area)
        size = off(q.geometry)
        lines += [
            "",
            "[[section]]",
            f"mass = {s.mass * off(q.mass):.6g}",
            f"bellows_radius = {s.radius * size:.6g}",
            f"bellows_outer_radius = {s.outer_radius * off(q.geometry):.6g}",
            f"terminal_area = {s.area * area:.6g}",
            f"rest_length = {s.rest_length * off(q.rest):.6g}",
            f"stiffness = {_list([k * mechanics() for k in s.stiffness[: q.springs]])}",
            f"damping = {s.damping * mechanics():.6g}",
            f"bending_stiffness = {_list([s.bending[0] * mechanics()])}",
            f"length_range = {_list([0.95 * s.length_range[0], 1.05 * s.length_range[1]])}",
            f"pressure_range = {_list([s.pressure_range[0] - 2e3, s.pressure_range[1] + 2e3])}",
        ]
        turn = fault.angle if fault is not None and fault.where == f"section {i + 1}" else 0.0
        if not arm.standard(i) or turn:
            for x in s.bellows:
                angle = np.rad2deg(x.angle + turn) % 360.0
                lines += ["", "[[section.bellows]]", f"angle_deg = {angle:.6g}", f"radius = {x.radius * size:.6g}"]
                lines += [f'input = "{x.input}"']
    for wire in sensors.wires:
        angle = np.rad2deg(wire.angle) + rng.uniform(-2.0, 2.0)
        lines += [
            "",
            "[[length_sensor]]",
            f'name = "{wire.name}"',
            f"angle_deg = {angle % 360.0:.6g}",
            f"radius = {wire.radius * off(q.geometry):.6g}",
            f"sections = [{', '.join(str(i + 1) for i in wire.sections)}]",
        ]
    return "\n".join(lines) + "\n"


def true_parameters(arm: TrueArm) -> dict[str, float]:
    """True values by the product's paths, to hold the intervals of an identification against."""
    out: dict[str, float] = {}
    for i, s in enumerate(arm.sections):
        base = f"section.{i + 1}"
        out[f"{base}.mass"] = s.mass
        out[f"{base}.damping"] = s.damping
        out[f"{base}.bending_stiffness.1"] = s.bending[0]
        # Exponential hardening has no coefficients; its first one is the slope at rest.
        out[f"{base}.stiffness.1"] = s.stiffness[0]
        if s.hardening[0] == 0.0:
            out[f"{base}.stiffness.2"], out[f"{base}.stiffness.3"] = s.stiffness[1], s.stiffness[2]
        out[f"{base}.rest_length"] = s.rest_length
        out[f"{base}.terminal_area"] = s.area
    return out
