"""One section of the arm.

Frames: the section's base frame is the head frame of the section before it (the arm's base for the first). Along z
follow a rigid piece of length ``base_offset``, the bending part, whose length is the mean of the three bellows
lengths, and a rigid piece of length ``head_offset``; the head frame is at the end of the latter. ``center_of_mass`` is
given in the head frame.

Source: Falkenhahn et al. 2015, sections II and IV; inertia (56). The offsets, the free layout of bellows, the masses
along the section and the cubic term of the bending moment go beyond the paper.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any, Self, TypeVar

import numpy as np
from pydantic import model_validator

from bha.names import pressure_name
from bha.parameters.along import MOST_ALONG, PointMassParameters, SectionArcParameters, check_arcs
from bha.parameters.base import (
    NotNegative,
    NotNegativeRange,
    Number,
    Polynomial,
    Positive,
    PositiveRange,
    Table,
    Vector3,
    key,
    table_error,
)
from bha.parameters.bellows import STIFFNESS_ALLOWED, STIFFNESS_MEANING, BellowsParameters, ResolvedBellows
from bha.parameters.provenance import ProvenanceTable, check_provenance, provenance_key

T = TypeVar("T")

STANDARD_ANGLES_DEG = (0.0, 120.0, 240.0)
#: Coefficients of a bending moment, of the odd powers of the bend, and how they are written.
BENDING_TERMS = 3
BENDING_ALLOWED = "[k1], [k1, k3] or [k1, k3, k5] (N m)"
#: Keys of a section that are tables of their own.
TABLES_OF_A_SECTION = ("bellows", "arcs", "masses", "provenance")
# Angles written in radians are rounded.
_SAME_ANGLE = 1e-6
# Made once: checking these tables again and again took a third of the time in which an arm is built.
_STANDARD_BELLOWS = tuple(BellowsParameters(angle_deg=angle) for angle in STANDARD_ANGLES_DEG)


class SectionParameters(Table):
    """A ``[[section]]`` table."""

    mass: Positive = key("a number > 0 (kg)", "mass at the head, lumped at center_of_mass", unit="kg")
    inertia: tuple[NotNegative, NotNegative, NotNegative] | None = key(
        "[Jx, Jy, Jz], numbers >= 0 (kg m^2)",
        "moments of inertia about the centre of mass, axes of the head frame",
        left_out="by (56), from mass, radii and mean length",
        unit="kg m^2",
        default=None,
    )
    center_of_mass: Vector3 = key(
        "[x, y, z], numbers (m)", "centre of mass in the head frame", unit="m", default=(0.0, 0.0, 0.0)
    )
    force_point: Vector3 | None = key(
        "[x, y, z], numbers (m)",
        "where external forces act, in the head frame",
        left_out="center_of_mass, as in (28)",
        unit="m",
        default=None,
    )
    bellows_radius: Positive = key("a number > 0 (m)", "distance of the three lengths from the centre line", unit="m")
    bellows_outer_radius: Positive | None = key(
        "a number > 0 (m)",
        "radius of one bellows, for (56)",
        left_out="allowed where inertia is given",
        unit="m",
        default=None,
    )
    terminal_area: Positive = key("a number > 0 (m^2)", "area that the pressure of a bellows pushes on", unit="m^2")
    rest_length: Positive = key("a number > 0 (m)", "length of a bellows without spring force", unit="m")
    stiffness: Polynomial = key(STIFFNESS_ALLOWED, STIFFNESS_MEANING, unit="N/m^k")
    damping: NotNegative = key("a number >= 0 (N s/m)", "damping of one bellows", unit="N s/m")
    bending_stiffness: tuple[Number, ...] = key(
        BENDING_ALLOWED,
        "bending moment k1 psi + k3 psi^3 + k5 psi^5 at the bending angle psi",
        unit="N m",
        min_length=1,
        max_length=BENDING_TERMS,
    )
    cross_bending_stiffness: tuple[Number, ...] | None = key(
        BENDING_ALLOWED,
        "the same of bending at right angles to bending_plane",
        left_out="as bending_stiffness, in all planes",
        unit="N m",
        default=None,
        min_length=1,
        max_length=BENDING_TERMS,
    )
    bending_plane: Number | None = key(
        "a number (rad)",
        "phi of the plane that bending_stiffness holds in, about z from x; or bending_plane_deg",
        left_out="0",
        unit="rad",
        default=None,
    )
    bending_plane_deg: Number | None = key(
        "a number (degrees)", "the same in degrees; at most one of the two", left_out="0", unit="deg", default=None
    )
    axial_stiffness: Polynomial | None = key(
        "1 to 8 numbers [c1, c2, ...] (N/m, N/m^2, ...)",
        "axial force c1 e + c2 e^2 + ..., e = mean length - axial_rest_length",
        left_out="none",
        unit="N/m^k",
        default=None,
    )
    axial_rest_length: Positive | None = key(
        "a number > 0 (m)", "mean length without axial force", left_out="rest_length", unit="m", default=None
    )
    axial_damping: NotNegative = key("a number >= 0 (N s/m)", "damping of the mean length", unit="N s/m", default=0.0)
    length_range: PositiveRange = key(
        "[shortest, longest], 0 < shortest < longest (m)", "permitted lengths of a bellows", unit="m"
    )
    pressure_range: NotNegativeRange = key(
        "[lowest, highest], absolute, 0 <= lowest < highest (Pa)", "permitted pressures", unit="Pa"
    )
    base_offset: NotNegative = key(
        "a number >= 0 (m)", "rigid piece along z before the bending part", unit="m", default=0.0
    )
    head_offset: NotNegative = key(
        "a number >= 0 (m)", "rigid piece along z behind the bending part", unit="m", default=0.0
    )
    bellows: tuple[BellowsParameters, ...] | None = key(
        "1 to 12 [[section.bellows]] tables, in double brackets",
        "where its bellows sit",
        left_out="three at 0, 120 and 240 degrees",
        default=None,
        min_length=1,
        max_length=12,
    )
    arcs: tuple[SectionArcParameters, ...] = key(
        f"1 to {MOST_ALONG} [[section.arcs]] tables, in double brackets",
        "the arcs that it bends in",
        left_out="one arc",
        default=(),
        max_length=MOST_ALONG,
    )
    masses: tuple[PointMassParameters, ...] = key(
        f"at most {MOST_ALONG} [[section.masses]] tables, in double brackets",
        "masses along it",
        left_out="none",
        default=(),
        max_length=MOST_ALONG,
    )
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        stated = {name: value for name, value in self if value is not None and name not in TABLES_OF_A_SECTION}
        check_provenance(self.provenance, stated)
        if self.inertia is None and self.bellows_outer_radius is None:
            message = "missing; give inertia, or bellows_outer_radius so that (56) gives the inertia"
            raise table_error(message, "inertia")
        if self.arcs:
            check_arcs(self.arcs)
        self._check_planes()
        self._check_layout()
        return self

    def _check_planes(self) -> None:
        """A plane is stated once, and beside a second stiffness, without which all planes are alike."""
        angles = [name for name in ("bending_plane", "bending_plane_deg") if getattr(self, name) is not None]
        if len(angles) == 2:
            raise table_error("found both of bending_plane and bending_plane_deg; allowed: at most one", angles[0])
        if angles and self.cross_bending_stiffness is None:
            message = (
                "says nothing without cross_bending_stiffness, for all planes are alike then; state both or neither"
            )
            raise table_error(message, angles[0])

    def _check_layout(self) -> None:
        """Every motion of the section must be held by some bellows, by its bending or by its axial stiffness.

        Only the layout is judged: springs of zero stiffness are a decision, bellows in one line an oversight.
        """
        stated = self.bellows or _STANDARD_BELLOWS
        places = tuple((_inherit(b.radius, self.bellows_radius) / self.bellows_radius, b.angle_rad) for b in stated)
        planes = (self.bending_stiffness, self.resolved_cross_bending_stiffness)
        held = tuple(
            self.bending_plane_rad + turn
            for turn, stiffness in zip((0.0, math.pi / 2), planes, strict=True)
            if any(k != 0.0 for k in stiffness)
        )
        if not _all_motions_held(places, held, self.axial_stiffness is not None):
            raise table_error(
                f"the {len(places)} bellows leave the section free to bend in some direction: they sit in one line or "
                "one place and bending_stiffness is zero; allowed: bellows not all in one line, or a bending stiffness",
                "bellows",
            )

    @property
    def along(self) -> dict[str, tuple[SectionArcParameters, ...] | tuple[PointMassParameters, ...]]:
        """The tables of what differs along the section, by their keys."""
        return {"arcs": self.arcs, "masses": self.masses}

    @property
    def greatest_length(self) -> float:
        """From its base to its head with the bellows at their longest, rigid pieces included, m."""
        return self.length_range[1] + self.base_offset + self.head_offset

    @property
    def total_mass(self) -> float:
        """All mass of the section, that along it included, kg."""
        return self.mass + sum(mass.mass for mass in self.masses)

    @property
    def resolved_cross_bending_stiffness(self) -> tuple[float, ...]:
        """k1 and, where stated, k3 and k5 at right angles to the bending plane, N m."""
        return self.bending_stiffness if self.cross_bending_stiffness is None else self.cross_bending_stiffness

    @property
    def bending_plane_rad(self) -> float:
        """phi of the plane that ``bending_stiffness`` holds in, rad."""
        return math.radians(self.bending_plane_deg or 0.0) if self.bending_plane is None else self.bending_plane

    @property
    def resolved_axial_rest_length(self) -> float:
        """Mean length without axial force, m."""
        return _inherit(self.axial_rest_length, self.rest_length)

    def resolved_inertia(self) -> tuple[float, float, float]:
        """Moments of inertia (Jx, Jy, Jz) in the head frame, kg m^2; those of (56) where the file leaves them out."""
        if self.inertia is not None:
            return self.inertia
        assert self.bellows_outer_radius is not None
        radius_squared = (self.bellows_radius + self.bellows_outer_radius) ** 2
        mean_length = sum(self.length_range) / 2
        lateral = self.mass * (radius_squared / 4 + mean_length**2 / 12)
        return (lateral, lateral, self.mass * radius_squared / 2)

    @property
    def has_standard_bellows(self) -> bool:
        """Whether its bellows are three at 0, 120, 240 degrees and ``bellows_radius``, as the coordinates are."""
        if self.bellows is None:
            return True
        places = [(bellows.angle_rad, _inherit(bellows.radius, self.bellows_radius)) for bellows in self.bellows]
        return are_standard_bellows(places, self.bellows_radius)

    def implausible(self) -> str | None:
        """What is allowed in this section, but physically impossible; None if nothing is."""
        moments = self.resolved_inertia()
        smallest, middle, largest = sorted(moments)
        if largest <= (smallest + middle) * (1 + 1e-9):
            return None
        return (
            f"inertia: found {list(moments)}, which no rigid body has: the largest moment exceeds the sum of the other "
            "two; check the order [Jx, Jy, Jz] and the unit (kg m^2)"
        )

    def resolved_bellows(self, section: int) -> tuple[ResolvedBellows, ...]:
        """The bellows with every inherited value filled in; input names are made from the number ``section``."""
        if section not in self.resolved_by_number:
            self.resolved_by_number[section] = self._resolve(section)
        return self.resolved_by_number[section]

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, some values changed without a check; what follows from the old values is not kept."""
        copied = super().model_copy(update=update, deep=deep)
        copied.__dict__.pop("resolved_by_number", None)
        return copied

    @cached_property
    def resolved_by_number(self) -> dict[int, tuple[ResolvedBellows, ...]]:
        """What :meth:`resolved_bellows` returned so far, by the section's number: one check asks for it many times."""
        return {}

    def _resolve(self, section: int) -> tuple[ResolvedBellows, ...]:
        stated = self.bellows or _STANDARD_BELLOWS
        return tuple(
            ResolvedBellows(
                angle=bellows.angle_rad,
                radius=_inherit(bellows.radius, self.bellows_radius),
                terminal_area=_inherit(bellows.terminal_area, self.terminal_area),
                rest_length=_inherit(bellows.rest_length, self.rest_length),
                stiffness=_inherit(bellows.stiffness, self.stiffness),
                damping=_inherit(bellows.damping, self.damping),
                input=_inherit(bellows.input, pressure_name(section, number)),
            )
            for number, bellows in enumerate(stated, start=1)
        )


def are_standard_bellows(places: Sequence[tuple[float, float]], bellows_radius: float) -> bool:
    """Whether bellows at these angles, rad, and radii, m, are at 0, 120 and 240 degrees and ``bellows_radius``."""
    return len(places) == len(STANDARD_ANGLES_DEG) and all(
        abs(math.remainder(angle - math.radians(standard), 2 * math.pi)) < _SAME_ANGLE
        and math.isclose(radius, bellows_radius, rel_tol=_SAME_ANGLE)
        for (angle, radius), standard in zip(places, STANDARD_ANGLES_DEG, strict=True)
    )


@lru_cache(maxsize=256)
def _all_motions_held(places: tuple[tuple[float, float], ...], planes: tuple[float, ...], axial: bool) -> bool:
    """Whether bellows at these radii (as shares) and angles, rad, hold a section against bending and lengthening.

    With them a bending stiffness in planes at these angles, rad, and an axial stiffness or none.
    """
    # How the lengths of the bellows follow from the three degrees of freedom of the section.
    rows = [(radius * math.cos(angle), radius * math.sin(angle), 1.0) for radius, angle in places]
    rows += [(math.cos(angle), math.sin(angle), 0.0) for angle in planes]
    if axial:
        rows.append((0.0, 0.0, 1.0))
    return bool(np.linalg.matrix_rank(np.array(rows), tol=1e-9) == 3)


def _inherit(own: T | None, inherited: T) -> T:
    return inherited if own is None else own
