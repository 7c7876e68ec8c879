"""What differs along a section: its arcs and the masses that lie on it.

A section of several arcs has its curvature, and the radius and area of its bellows, piece by piece: (6) and (8) of the
paper with variable or piecewise constant curvature, and its conical sections. The shares are fixed, so that the
coordinates stay three lengths. ::

    [[section.arcs]]
    length = 0.5
    bending = 0.6
    relative_radius = 1.05

    [[section.arcs]]
    length = 0.5
    bending = 0.4
    relative_radius = 0.95

    [[section.masses]]
    share = 0.5
    mass = 0.2
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from bha.parameters.base import NotNegative, Number, Positive, Table, Vector3, key, table_error
from bha.parameters.provenance import ProvenanceTable, check_provenance, provenance_key

#: Most arcs and most masses of a section, as in the core.
MOST_ALONG = 32
# How far sums of rounded shares may be from 1.
_SUM = 1e-6
Share = Annotated[Number, Field(ge=0, le=1)]


class SectionArcParameters(Table):
    """A ``[[section.arcs]]`` table: one of the arcs that make a section, from its base on."""

    length: Positive = key("a number > 0", "the arc's share of the section's length; the shares add up to 1")
    bending: Number = key(
        "a number",
        "the arc's share of the section's bending angle, below 0 where it bends the other way; the shares add up to 1",
    )
    relative_radius: Positive = key(
        "a number > 0",
        "distance of the bellows from the centre line here, relative to that in the other arcs; their "
        "mean weighted by bending stands for bellows_radius",
        default=1.0,
    )
    relative_area: Positive = key(
        "a number > 0",
        "area that the pressure acts on here, relative to that in the other arcs; their mean "
        "weighted by length stands for terminal_area; other than 1 with work_conjugate "
        "only",
        default=1.0,
    )
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_provenance(self.provenance, {name: value for name, value in self if name != "provenance"})
        return self

    def to_core(self) -> dict[str, float]:
        """What the core computes with."""
        return {
            "length": self.length,
            "bending": self.bending,
            "relative_radius": self.relative_radius,
            "relative_area": self.relative_area,
        }


class PointMassParameters(Table):
    """A ``[[section.masses]]`` table: a mass at a place along the section, beside the mass at its head."""

    share: Share = key("a number from 0 (base) to 1 (head)", "where on the section's arcs, as a share of their length")
    mass: Positive = key("a number > 0 (kg)", "the mass", unit="kg")
    inertia: tuple[NotNegative, NotNegative, NotNegative] = key(
        "[Jx, Jy, Jz], numbers >= 0 (kg m^2)",
        "about its own centre of mass in the frame of the centre line there",
        unit="kg m^2",
        default=(0.0, 0.0, 0.0),
    )
    offset: Vector3 = key(
        "[x, y, z], numbers (m)",
        "its centre of mass in the frame of the centre line there, z along the line",
        unit="m",
        default=(0.0, 0.0, 0.0),
    )
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_provenance(self.provenance, {name: value for name, value in self if name != "provenance"})
        return self

    def to_core(self) -> dict[str, Any]:
        """What the core computes with."""
        return {"share": self.share, "mass": self.mass, "inertia": self.inertia, "offset": self.offset}


def check_arcs(arcs: Sequence[SectionArcParameters]) -> None:
    """Check that the shares of a section's arcs add up to 1 and that its bellows stand beside the centre line.

    Raises:
        PydanticCustomError: with what is wrong; pydantic adds where.
    """
    for name in ("length", "bending"):
        total = math.fsum(getattr(arc, name) for arc in arcs)
        if abs(total - 1.0) > _SUM:
            message = f"the shares {name} of the {len(arcs)} arcs add up to {total:g}; allowed: shares that add up to 1"
            raise table_error(message, "arcs")
    if mean_radius(arcs) <= 0.0:
        raise table_error(
            "the mean of relative_radius, weighted by bending, is not above 0; allowed: bending shares that leave the "
            "bellows lengths a positive radius",
            "arcs",
        )


def mean_radius(arcs: Sequence[SectionArcParameters]) -> float:
    """Mean of ``relative_radius`` weighted by bending, which stands for ``bellows_radius``."""
    return math.fsum(arc.bending * arc.relative_radius for arc in arcs)


def has_several_areas(arcs: Sequence[SectionArcParameters]) -> bool:
    """Whether the area of the bellows differs from arc to arc."""
    return len({arc.relative_area for arc in arcs}) > 1
