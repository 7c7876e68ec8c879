"""One bellows of a section: where it sits, how stiff it is, and the pressure input that feeds it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from pydantic import model_validator

from bha.parameters.base import NotNegative, Number, Polynomial, Positive, Table, key, stated_angle
from bha.parameters.provenance import ProvenanceTable, check_provenance, provenance_key

INPUT_PATTERN = r"^p([1-9][1-9]|[1-9][0-9]{1,2}_[1-9][0-9]{0,2}|[1-9]_[1-9][0-9]{1,2})$"
STIFFNESS_ALLOWED = "1 to 8 numbers [c1, c2, ...] (N/m, N/m^2, ...)"
STIFFNESS_MEANING = "spring force c1 e + c2 e^2 + ..., e = length - rest_length"


class BellowsParameters(Table):
    """A ``[[section.bellows]]`` table. What it leaves out is inherited from its section."""

    angle: Number | None = key("a number (rad)", "about z, from x; give angle or angle_deg", unit="rad", default=None)
    angle_deg: Number | None = key(
        "a number (degrees)", "the same in degrees; give angle or angle_deg", unit="deg", default=None
    )
    radius: NotNegative | None = key(
        "a number >= 0 (m)", "distance from the centre line", left_out="bellows_radius", unit="m", default=None
    )
    terminal_area: Positive | None = key(
        "a number > 0 (m^2)", "area that its pressure pushes on", left_out="the section's", unit="m^2", default=None
    )
    rest_length: Positive | None = key(
        "a number > 0 (m)", "length without spring force", left_out="the section's", unit="m", default=None
    )
    stiffness: Polynomial | None = key(
        STIFFNESS_ALLOWED, STIFFNESS_MEANING, unit="N/m^k", left_out="the section's", default=None
    )
    damping: NotNegative | None = key(
        "a number >= 0 (N s/m)", "damping", left_out="the section's", unit="N s/m", default=None
    )
    input: str | None = key(
        'the name of a pressure input: "p", section and input number, as in "p13" ("p10_3" where one has two digits)',
        "what feeds it; several bellows may name the same",
        left_out='by its number, "p11", "p12", ...',
        default=None,
        pattern=INPUT_PATTERN,
    )
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        stated_angle(self.angle, self.angle_deg)
        stated = {name: value for name, value in self if value is not None and name != "provenance"}
        check_provenance(self.provenance, stated)
        return self

    @property
    def angle_rad(self) -> float:
        """Angle about the section's z axis from its x axis, rad."""
        return stated_angle(self.angle, self.angle_deg)


@dataclass(frozen=True)
class ResolvedBellows:
    """A bellows with every value filled in, SI units: what the model computes with.

    Attributes:
        angle: about the section's z axis from its x axis, rad.
        radius: distance from the section's centre line, m.
        terminal_area: A_P of (25), m^2.
        rest_length: length at which the spring force is zero, m.
        stiffness: coefficients of the spring force by ascending power of (length - rest_length), from the first.
        damping: N s/m.
        input: name of the pressure input that feeds it.
    """

    angle: float
    radius: float
    terminal_area: float
    rest_length: float
    stiffness: tuple[float, ...]
    damping: float
    input: str
