"""Parameter files of the arm (schema ``bha-arm/1``): read, perturb, write; and the plant they describe."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .plant import (
    P_AREA,
    P_BENDING,
    P_CENTER,
    P_COLUMNS,
    P_DAMPING,
    P_INERTIA,
    P_MASS,
    P_RADIUS,
    P_REST,
    P_SLICED,
    P_STIFFNESS,
    Plant,
)

Array = NDArray[np.float64]

# Slices of the distributed mass: places and shares of the three-point Gauss rule along the arc.
SLICES = np.array([[0.11270166537925831, 5 / 18], [0.5, 8 / 18], [0.8872983346207417, 5 / 18]])


@dataclass(frozen=True)
class SectionFile:
    """One ``[[section]]`` table; SI units."""

    mass: float
    inertia: tuple[float, ...]
    center_of_mass: tuple[float, ...]
    bellows_radius: float
    bellows_outer_radius: float
    terminal_area: float
    rest_length: float
    stiffness: tuple[float, ...]
    damping: float
    bending_stiffness: tuple[float, ...]
    length_range: tuple[float, ...]
    pressure_range: tuple[float, ...]


@dataclass(frozen=True)
class ArmFile:
    """A whole parameter file."""

    name: str
    gravity: tuple[float, ...]
    ambient_pressure: float
    force_model: str
    sections: tuple[SectionFile, ...]


def parse_arm(text: str) -> ArmFile:
    """Read the text of a parameter file. Unknown keys are refused: the generator must not guess."""
    data: dict[str, Any] = tomllib.loads(text)
    if data.pop("schema") != "bha-arm/1":
        raise ValueError("parameter file: schema must be 'bha-arm/1'")
    sections = []
    for table in data.pop("section"):
        row: dict[str, Any] = {k: tuple(map(float, v)) if isinstance(v, list) else float(v) for k, v in table.items()}
        sections.append(SectionFile(**row))
    data["gravity"] = tuple(map(float, data["gravity"]))
    return ArmFile(sections=tuple(sections), **data)


def read_arm(path: Path) -> ArmFile:
    """Read a parameter file."""
    return parse_arm(path.read_text(encoding="utf-8"))


def format_arm(arm: ArmFile) -> str:
    """Text of a parameter file; every number to full precision."""

    def value(item: object) -> str:
        if isinstance(item, tuple):
            return "[" + ", ".join(repr(float(x)) for x in item) + "]"
        return f'"{item}"' if isinstance(item, str) else repr(item)

    lines = ['schema = "bha-arm/1"', f'name = "{arm.name}"']
    lines += [f"{key} = {value(getattr(arm, key))}" for key in ("gravity", "ambient_pressure", "force_model")]
    for section in arm.sections:
        lines += ["", "[[section]]"]
        lines += [f"{key} = {value(item)}" for key, item in vars(section).items()]
    return "\n".join(lines) + "\n"


def build_plant(arm: ArmFile, *, distributed: float = 0.0) -> Plant:
    """Plant of the arm; ``distributed`` is the share of each section's mass that sits on slices along the arc."""
    s = arm.sections
    rows = np.zeros((len(s), P_COLUMNS))
    for i, section in enumerate(s):
        rows[i, P_MASS] = section.mass
        rows[i, P_INERTIA : P_INERTIA + 3] = section.inertia
        rows[i, P_CENTER : P_CENTER + 3] = section.center_of_mass
        rows[i, P_RADIUS] = section.bellows_radius
        rows[i, P_AREA] = section.terminal_area
        rows[i, P_REST] = section.rest_length
        rows[i, P_STIFFNESS : P_STIFFNESS + len(section.stiffness)] = section.stiffness
        rows[i, P_DAMPING] = section.damping
        rows[i, P_BENDING : P_BENDING + len(section.bending_stiffness)] = section.bending_stiffness
    rows[:, P_SLICED] = distributed
    return Plant(rows, SLICES.copy(), arm.ambient_pressure, arm.force_model == "work_conjugate")


def perturb_arm(arm: ArmFile, rng: np.random.Generator, low: float = 0.10, high: float = 0.15) -> ArmFile:
    """A file whose identifiable parameters are off by ``low`` to ``high``, each on its own and to either side.

    Off: mass, stiffness (each coefficient), damping, bending stiffness, rest length. The inertia follows the mass,
    since (56) computes it from mass and geometry. Geometry, effective area and ambient pressure are measured on the
    bench and stay right: an error of the area cannot be told from one common factor on mass, stiffness and damping.
    """

    def factor() -> float:
        size = 1.0 + rng.uniform(low, high)
        return float(size if rng.random() < 0.5 else 1.0 / size)

    sections = []
    for s in arm.sections:
        mass = factor()
        sections.append(
            replace(
                s,
                mass=s.mass * mass,
                inertia=tuple(x * mass for x in s.inertia),
                rest_length=s.rest_length * factor(),
                stiffness=tuple(x * factor() for x in s.stiffness),
                damping=s.damping * factor(),
                bending_stiffness=tuple(x * factor() for x in s.bending_stiffness),
            )
        )
    return replace(arm, sections=tuple(sections))
