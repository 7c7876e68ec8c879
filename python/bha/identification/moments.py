"""Moments of inertia from geometry and mass, paper section IV-B.

(56): a solid cylinder of the section's mean height and of radius r_B + r_b. (57): the upper bound, a hollow cylinder of
the greatest length with its whole mass at that radius, for the bound of the rotational energy (Fig. 11). Moments are
about the centre of mass, along the head frame's axes.
"""

from __future__ import annotations

from dataclasses import dataclass

from bha.errors import InputError
from bha.parameters import ArmParameters, SectionParameters


@dataclass(frozen=True)
class Inertia:
    """Moments of inertia (Jx, Jy, Jz) of one section, kg m^2.

    Attributes:
        section: number of the section, from 1.
        cylinder: of (56).
        upper_bound: of (57).
        stated: what the parameter file says, (56) where it says nothing.
    """

    section: int
    cylinder: tuple[float, float, float]
    upper_bound: tuple[float, float, float]
    stated: tuple[float, float, float]

    @property
    def plausible(self) -> bool:
        """Whether what the file says stays below the upper bound."""
        return all(s <= u * (1 + 1e-9) for s, u in zip(self.stated, self.upper_bound, strict=True))


def inertia(parameters: ArmParameters) -> tuple[Inertia, ...]:
    """Moments of inertia of every section by (56) and (57), from mass, radii and range of length.

    Raises:
        InputError: a section does not say the radius of its bellows.
    """
    return tuple(_of(section, number) for number, section in enumerate(parameters.sections, start=1))


def _of(section: SectionParameters, number: int) -> Inertia:
    if section.bellows_outer_radius is None:
        raise InputError(f"section {number}: bellows_outer_radius is missing; (56) needs it")
    square = (section.bellows_radius + section.bellows_outer_radius) ** 2
    mean, greatest = sum(section.length_range) / 2.0, section.length_range[1]
    lateral = section.mass * (square / 4.0 + mean**2 / 12.0)
    bound = section.mass * (square / 2.0 + greatest**2 / 12.0)
    return Inertia(
        section=number,
        cylinder=(lateral, lateral, section.mass * square / 2.0),
        upper_bound=(bound, bound, section.mass * square),
        stated=section.resolved_inertia(),
    )
