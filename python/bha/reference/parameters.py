"""Parameters of an arm for the reference model, read from an arm file (schema ``bha-arm/1``).

What: the constants of the paper's model, one frozen dataclass per section, and nothing of the package's own arm class,
so that a wrong reading of a parameter there shows up against this one. Units: SI. Frame: base frame, z along the
straight arm; the world frame where an arm file has a base pose (12). Limits: three equal bellows at 0, 120 and 240
degrees per section; whatever an arm file says beyond that (``section.bellows``, ``effects``) is refused, never ignored.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from bha.errors import ParameterError
from bha.reference.homogeneous import Array, along_z

SCHEMA = "bha-arm/1"
FORCE_MODELS = ("end_force", "work_conjugate")
BELLOWS_ANGLES = np.deg2rad([0.0, 120.0, 240.0])

# Keys that say something about the values and change nothing in the model.
_DOCUMENTATION_KEYS = frozenset({"name", "description", "provenance", "source", "sources", "notes", "license"})
_NOT_IMPLEMENTED_KEYS = frozenset({"bellows", "effects"})


@dataclasses.dataclass(frozen=True)
class SectionArc:
    """One of several arcs that make a section, from its base on: (6), (8) of variable curvature and conical sections.

    Length and bending are the arc's shares of those of the section; radius and area are those of the bellows here, in
    m and m^2.
    """

    length: float
    bending: float
    radius: float
    area: float


@dataclasses.dataclass(frozen=True)
class PointMass:
    """A mass at a share of the section's arc length; vectors are in the frame of the centre line there."""

    share: float
    mass: float  # kg
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)  # diagonal of J about its centre of mass, kg m^2
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m


@dataclasses.dataclass(frozen=True)
class Section:
    """One section: three equal bellows between a base plate and a head plate. Vectors are in the head frame.

    Without ``arcs`` it is one arc, (7) and (9). ``masses`` lie along it, beside the ``mass`` at its head.
    """

    mass: float  # kg
    inertia: tuple[float, float, float]  # diagonal of J about the centre of mass, kg m^2
    center_of_mass: tuple[float, float, float]  # r_S, m
    bellows_radius: float  # r_B, m
    bellows_outer_radius: float  # r_b, m
    terminal_area: float  # A_P, m^2
    rest_length: float  # m
    stiffness: tuple[float, ...]  # coefficients of (q - rest_length)^1, ^2, ...: N/m, N/m^2, ...
    damping: float  # N s/m
    bending_stiffness: tuple[float, float, float]  # k1, k3, k5 of M_bend, (33), where phi is bending_plane, N m
    length_range: tuple[float, float]  # m
    cross_bending_stiffness: tuple[float, float, float]  # k1, k3, k5 at right angles to that plane, N m
    bending_plane: float = 0.0  # rad
    # Of the mean length: coefficients of (l - axial_rest_length)^1, ^2, ...: N/m, N/m^2, ...
    axial_stiffness: tuple[float, ...] = ()
    axial_rest_length: float = 0.0  # m
    axial_damping: float = 0.0  # N s/m
    base_offset: float = 0.0  # rigid piece along z below the arc, m
    head_offset: float = 0.0  # rigid piece along z above the arc, m; the head frame sits on top of it
    arcs: tuple[SectionArc, ...] = ()
    masses: tuple[PointMass, ...] = ()

    @cached_property
    def all_arcs(self) -> tuple[SectionArc, ...]:
        """The arcs, one of them where the section has no others."""
        return self.arcs or (SectionArc(1.0, 1.0, self.bellows_radius, self.terminal_area),)

    @property
    def head_radius(self) -> float:
        """Where the bellows meet the head, m: the radius of the last arc."""
        return self.all_arcs[-1].radius

    @cached_property
    def homogeneous_center_of_mass(self) -> Array:
        """Equation (18a), the centre of mass in the head frame with a fourth component 1; shape (4,)."""
        return np.array([*self.center_of_mass, 1.0])

    @cached_property
    def homogeneous_contact_points(self) -> Array:
        """Equation (18b), where the bellows meet the head, as rows [r_B cos a_k, r_B sin a_k, 0, 1]; shape (3, 4)."""
        r_B = self.head_radius
        return np.array([[r_B * math.cos(a), r_B * math.sin(a), 0.0, 1.0] for a in BELLOWS_ANGLES])

    @cached_property
    def inertia_tensor(self) -> Array:
        """Equation (55), J in the head frame; shape (3, 3), kg m^2."""
        return np.diag(self.inertia)

    @cached_property
    def base_piece(self) -> Array:
        """Pose of the arc's base in the head frame of the section below; shape (4, 4). Identity in the paper (13)."""
        return along_z(self.base_offset)

    @cached_property
    def head_piece(self) -> Array:
        """Pose of the head frame at the end of the arc; shape (4, 4). Identity in the paper."""
        return along_z(self.head_offset)


@dataclasses.dataclass(frozen=True)
class Arm:
    """An arm of n sections and the switches of the model.

    ``force_model`` is ``end_force`` (the paper's) or ``work_conjugate``; ``rotational_energy`` and ``coriolis_forces``
    switch the terms off that (58)-(61) leave out.
    """

    sections: tuple[Section, ...]
    gravity: tuple[float, float, float]  # world frame, m/s^2
    ambient_pressure: float  # Pa
    force_model: str = "end_force"
    rotational_energy: bool = True
    coriolis_forces: bool = True
    base_position: tuple[float, float, float] = (0.0, 0.0, 0.0)  # world frame, m
    base_rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rotation vector, world frame, rad

    def __post_init__(self) -> None:
        """Refuse a force model that does not exist, an arm without sections and areas that (27) has no place for."""
        if self.force_model not in FORCE_MODELS:
            raise ParameterError(f"force_model: found {self.force_model!r}, allowed are {', '.join(FORCE_MODELS)}")
        if not self.sections:
            raise ParameterError("section: found none, at least one [[section]] is needed")
        tapered = any(len({arc.area for arc in section.arcs}) > 1 for section in self.sections)
        if tapered and self.force_model == "end_force":
            raise ParameterError(
                "force_model: found end_force with areas that differ along a section; (27) lets a bellows push its two "
                "ends with one force; allowed is work_conjugate"
            )

    @cached_property
    def base_pose(self) -> Array:
        """Equation (12), wH_1b: pose of the arm's base in the world; shape (4, 4)."""
        H = np.eye(4)
        H[:3, :3] = rotation_by_vector(self.base_rotation)
        H[:3, 3] = self.base_position
        return H

    @property
    def section_count(self) -> int:
        """Number of sections n; the arm has 3n coordinates."""
        return len(self.sections)

    def with_options(
        self,
        *,
        force_model: str | None = None,
        rotational_energy: bool | None = None,
        coriolis_forces: bool | None = None,
    ) -> Arm:
        """Return the same arm with other switches; what is None stays as it is."""
        return dataclasses.replace(
            self,
            force_model=self.force_model if force_model is None else force_model,
            rotational_energy=self.rotational_energy if rotational_energy is None else rotational_energy,
            coriolis_forces=self.coriolis_forces if coriolis_forces is None else coriolis_forces,
        )


def rotation_by_vector(vector: tuple[float, float, float]) -> Array:
    """Rodrigues' formula: the rotation about a vector by its length, rad; shape (3, 3)."""
    x, y, z = vector
    angle = math.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return np.eye(3)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / angle
    rotation: Array = np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K
    return rotation


def cylinder_inertia(
    mass: float, bellows_radius: float, bellows_outer_radius: float, average_length: float
) -> tuple[float, float, float]:
    """Equation (56): moments of inertia of a solid cylinder of the section's size, (J_x, J_y, J_z) in kg m^2."""
    radius = bellows_radius + bellows_outer_radius
    J_x = mass * radius**2 / 4 + mass * average_length**2 / 12
    return J_x, J_x, mass * radius**2 / 2


def inertia_upper_bound(
    mass: float, bellows_radius: float, bellows_outer_radius: float, maximal_length: float
) -> tuple[float, float, float]:
    """Equation (57): moments of inertia of a hollow cylinder, an upper bound; (J_x, J_y, J_z) in kg m^2."""
    radius = bellows_radius + bellows_outer_radius
    J_x = mass * radius**2 / 2 + mass * maximal_length**2 / 12
    return J_x, J_x, mass * radius**2


def load_arm(path: str | Path) -> Arm:
    """Read an arm file. Raises ParameterError naming file and key; OSError if the file cannot be opened."""
    path = Path(path)
    return parse_arm(path.read_text(encoding="utf-8"), source=str(path))


def parse_arm(text: str, source: str = "arm") -> Arm:
    """Read an arm from TOML text; ``source`` is what errors call it. Raises ParameterError."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ParameterError(f"{source}: not valid TOML: {error}") from error
    top = _Table(table, source)
    if (schema := table.get("schema")) != SCHEMA:
        raise ParameterError(f"{source}: schema: found {schema!r}, allowed is {SCHEMA!r}")
    sections = table.get("section")
    if not isinstance(sections, list) or not all(isinstance(section, dict) for section in sections):
        raise ParameterError(f"{source}: section: found {sections!r}, needed is at least one [[section]] table")
    base = table.get("base", {})
    if not isinstance(base, dict):
        raise ParameterError(f"{source}: base: found {base!r}, needed is a [base] table")
    position, rotation = _base(_Table(base, f"{source}: base"))
    arm = Arm(
        sections=tuple(_section(_Table(s, f"{source}: section {i}")) for i, s in enumerate(sections, start=1)),
        gravity=_three(top.numbers("gravity", 3)),
        ambient_pressure=top.number("ambient_pressure", positive=True),
        force_model=top.choice("force_model", "end_force"),
        rotational_energy=top.switch("rotational_energy"),
        coriolis_forces=top.switch("coriolis_forces"),
        base_position=position,
        base_rotation=rotation,
    )
    # Ideal pneumatics: the pressures given are those in the bellows, which is all the reference model knows.
    pneumatics = table.get("pneumatics")
    ideal = isinstance(pneumatics, dict) and pneumatics.get("level") == "ideal"
    top.refuse_the_rest({"schema", "section", "base", *({"pneumatics"} if ideal else ())})
    return arm


def _base(table: _Table) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Position, m, and rotation vector, rad, of the base in the world."""
    zero = (0.0, 0.0, 0.0)
    position = _three(table.numbers("position", 3, default=zero))
    if "rotation" in table.values and "rotation_deg" in table.values:
        raise ParameterError(f"{table.where}: rotation_deg: found rotation as well, allowed is one of them")
    x, y, z = table.numbers("rotation_deg", 3, default=zero)
    rotation = _three(table.numbers("rotation", 3, default=(math.radians(x), math.radians(y), math.radians(z))))
    table.refuse_the_rest(set())
    return position, rotation


def _section(table: _Table) -> Section:
    mass = table.number("mass", positive=True)
    r_B = table.number("bellows_radius", positive=True)
    r_b = table.number("bellows_outer_radius", positive=True)
    shortest, longest = table.numbers("length_range", 2)
    if not 0.0 < shortest < longest:
        raise ParameterError(
            f"{table.where}: length_range: found [{shortest}, {longest}], needed is 0 < first < second"
        )
    inertia = cylinder_inertia(mass, r_B, r_b, (shortest + longest) / 2)
    if "inertia" in table.values:
        inertia = _three(table.numbers("inertia", 3))
    bending = table.numbers("bending_stiffness", 1, 3)
    terminal_area = table.number("terminal_area", positive=True)
    cross_bending = table.numbers("cross_bending_stiffness", 1, 3, default=bending)
    if "bending_plane" in table.values and "bending_plane_deg" in table.values:
        raise ParameterError(
            f"{table.where}: found both of bending_plane and bending_plane_deg, one at most is allowed"
        )
    bending_plane = math.radians(table.number("bending_plane_deg", default=0.0))
    rest_length = table.number("rest_length", positive=True)
    section = Section(
        mass=mass,
        inertia=inertia,
        center_of_mass=_three(table.numbers("center_of_mass", 3, default=(0.0, 0.0, 0.0))),
        bellows_radius=r_B,
        bellows_outer_radius=r_b,
        terminal_area=terminal_area,
        rest_length=rest_length,
        stiffness=table.numbers("stiffness", 1, 12),
        damping=table.number("damping"),
        bending_stiffness=_three((*bending, 0.0, 0.0)[:3]),
        length_range=(shortest, longest),
        cross_bending_stiffness=_three((*cross_bending, 0.0, 0.0)[:3]),
        bending_plane=table.number("bending_plane", default=bending_plane),
        axial_stiffness=table.numbers("axial_stiffness", 0, 12, default=()),
        axial_rest_length=table.number("axial_rest_length", default=rest_length, positive=True),
        axial_damping=table.number("axial_damping", default=0.0),
        base_offset=table.number("base_offset", default=0.0),
        head_offset=table.number("head_offset", default=0.0),
        arcs=_arcs(table.tables("arcs"), r_B, terminal_area),
        masses=tuple(_point_mass(t) for t in table.tables("masses")),
    )
    # The range of pressures limits what a user should ask for; no equation of motion contains it.
    table.refuse_the_rest({"pressure_range"})
    return section


def _arcs(tables: list[_Table], bellows_radius: float, terminal_area: float) -> tuple[SectionArc, ...]:
    """The arcs, with radii whose mean, weighted by bending, is ``bellows_radius``, and areas alike, weighted by length.

    The first is what makes the three lengths those of the bellows: q_k = sum of l_j - r_j psi_j cos(phi - a_k).
    """
    stated = []
    for table in tables:
        length, bending = table.number("length", positive=True), table.number("bending")
        stated.append(
            (length, bending, table.number("relative_radius", default=1.0), table.number("relative_area", default=1.0))
        )
        table.refuse_the_rest(set())
    if not stated:
        return ()
    for column, name in ((0, "length"), (1, "bending")):
        if abs(sum(arc[column] for arc in stated) - 1.0) > 1e-6:
            raise ParameterError(f"{tables[0].where}: {name}: found shares that do not add up to 1")
    lengths, bendings = sum(arc[0] for arc in stated), sum(arc[1] for arc in stated)
    mean_radius = sum(b / bendings * r for _, b, r, _ in stated)
    mean_area = sum(length / lengths * a for length, _, _, a in stated)
    return tuple(
        SectionArc(length / lengths, b / bendings, bellows_radius * r / mean_radius, terminal_area * a / mean_area)
        for length, b, r, a in stated
    )


def _point_mass(table: _Table) -> PointMass:
    zero = (0.0, 0.0, 0.0)
    mass = PointMass(
        share=table.number("share"),
        mass=table.number("mass", positive=True),
        inertia=_three(table.numbers("inertia", 3, default=zero)),
        offset=_three(table.numbers("offset", 3, default=zero)),
    )
    table.refuse_the_rest(set())
    if not 0.0 <= mass.share <= 1.0:
        raise ParameterError(f"{table.where}: share: found {mass.share!r}, needed is a number from 0 to 1")
    return mass


def _three(values: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z


class _Table:
    """A TOML table that remembers which keys were read, so that the others can be refused."""

    def __init__(self, values: Mapping[str, Any], where: str) -> None:
        self.values = values
        self.where = where
        self._read: set[str] = set()
        for key in sorted(_NOT_IMPLEMENTED_KEYS & values.keys()):
            raise ParameterError(
                f"{where}: {key}: the reference model has three equal bellows a section and only the paper's effects; "
                "use the compiled model for this arm or take the key out"
            )

    def _get(self, key: str, default: object) -> Any:
        self._read.add(key)
        if key in self.values:
            return self.values[key]
        if default is None:
            raise ParameterError(f"{self.where}: {key}: missing; the reference model needs it")
        return default

    def number(self, key: str, *, default: float | None = None, positive: bool = False) -> float:
        value = self._get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ParameterError(f"{self.where}: {key}: found {value!r}, needed is a finite number")
        if positive and value <= 0:
            raise ParameterError(f"{self.where}: {key}: found {value!r}, needed is a number above 0")
        return float(value)

    def numbers(
        self, key: str, least: int, most: int | None = None, *, default: tuple[float, ...] | None = None
    ) -> tuple[float, ...]:
        values = self._get(key, default)
        most = least if most is None else most
        is_list = isinstance(values, list | tuple) and least <= len(values) <= most
        if not is_list or any(isinstance(v, bool) or not isinstance(v, int | float) for v in values):
            count = str(least) if least == most else f"{least} to {most}"
            raise ParameterError(f"{self.where}: {key}: found {values!r}, needed is a list of {count} numbers")
        if not all(math.isfinite(v) for v in values):
            raise ParameterError(f"{self.where}: {key}: found {values!r}, needed are finite numbers")
        return tuple(float(v) for v in values)

    def tables(self, key: str) -> list[_Table]:
        values = self._get(key, ())
        if not isinstance(values, list | tuple) or not all(isinstance(value, dict) for value in values):
            raise ParameterError(f"{self.where}: {key}: found {values!r}, needed are tables")
        return [_Table(value, f"{self.where}: {key} {i}") for i, value in enumerate(values, start=1)]

    def choice(self, key: str, default: str) -> str:
        value = self._get(key, default)
        if value not in FORCE_MODELS:
            raise ParameterError(f"{self.where}: {key}: found {value!r}, allowed are {', '.join(FORCE_MODELS)}")
        return str(value)

    def switch(self, key: str) -> bool:
        value = self._get(key, True)
        if not isinstance(value, bool):
            raise ParameterError(f"{self.where}: {key}: found {value!r}, allowed are true and false")
        return value

    def refuse_the_rest(self, also_allowed: set[str]) -> None:
        for key in sorted(self.values.keys() - self._read - _DOCUMENTATION_KEYS - also_allowed):
            raise ParameterError(f"{self.where}: {key}: unknown key; the reference model cannot say what it means")
