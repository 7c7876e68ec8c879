"""From commanded to acting pressure: the ``[pneumatics]`` table, the same for every input of the arm.

Three levels, chosen by the key ``level``: ``"ideal"`` (the command acts as it is; also without the table), ``"lag"``
(first order, own time constants for filling and venting) and ``"full"`` (valve by ISO 6358 with a spool, polytropic
chamber whose volume is the dead volume plus terminal area times bellows length, PI pressure controller). A file may
give the values of several levels; those that its level does not need are kept and not used.
"""

from __future__ import annotations

from typing import Any, Literal, Self, get_args

from pydantic import model_validator

from bha.parameters.base import NotNegative, Number, Positive, Table, key, table_error
from bha.parameters.provenance import ProvenanceTable, check_provenance, provenance_key

PneumaticsLevel = Literal["ideal", "lag", "full"]

# What each level cannot do without.
NEEDED: dict[str, tuple[str, ...]] = {
    "ideal": (),
    "lag": ("fill_time", "vent_time"),
    "full": (
        "supply_pressure",
        "exhaust_pressure",
        "sonic_conductance",
        "critical_pressure_ratio",
        "air_temperature",
        "dead_volume",
        "polytropic_exponent",
        "spool_time",
        "spool_dead_band",
        "proportional_gain",
        "integral_gain",
        "feed_forward",
    ),
}


class PneumaticsParameters(Table):
    """The ``[pneumatics]`` table."""

    level: PneumaticsLevel = key(
        " or ".join(f'"{name}"' for name in get_args(PneumaticsLevel)),
        "how much is modelled between command and bellows",
    )
    fill_time: Positive | None = key("a number > 0 (s)", 'time constant of filling, of "lag"', unit="s", default=None)
    vent_time: Positive | None = key("a number > 0 (s)", 'time constant of venting, of "lag"', unit="s", default=None)
    supply_pressure: Positive | None = key(
        "a number > 0, absolute (Pa)", "behind the valve's supply port", unit="Pa", default=None
    )
    exhaust_pressure: Positive | None = key(
        "a number > 0, absolute (Pa)", "behind the valve's exhaust port", unit="Pa", default=None
    )
    vacuum_pressure: Positive | None = key(
        "a number > 0, absolute (Pa), below exhaust_pressure",
        "where given, the exhaust has a check valve and the valve's lower side also draws to here",
        left_out="no vacuum",
        unit="Pa",
        default=None,
    )
    sonic_conductance: Positive | None = key(
        "a number > 0 (m^3/(s Pa))", "C of ISO 6358 at full opening", unit="m^3/(s Pa)", default=None
    )
    exhaust_conductance: Positive | None = key(
        "a number > 0 (m^3/(s Pa))",
        "C towards exhaust and vacuum",
        left_out="sonic_conductance",
        unit="m^3/(s Pa)",
        default=None,
    )
    critical_pressure_ratio: Number | None = key(
        "a number from 0 to 0.99", "b of ISO 6358", default=None, ge=0, le=0.99
    )
    air_temperature: Positive | None = key("a number > 0 (K)", "of supply and chambers", unit="K", default=None)
    dead_volume: NotNegative | None = key(
        "a number >= 0 (m^3)", "volume of an input besides its bellows: tube and fittings", unit="m^3", default=None
    )
    polytropic_exponent: Number | None = key(
        "a number from 1 (isothermal) to 1.4 (adiabatic)", "of the air in the chambers", default=None, ge=1, le=1.4
    )
    spool_time: Positive | None = key("a number > 0 (s)", "time constant of the spool", unit="s", default=None)
    spool_dead_band: Number | None = key(
        "a number from 0 to 0.9", "spool travel without flow, as a part of full travel", default=None, ge=0, le=0.9
    )
    proportional_gain: NotNegative | None = key(
        "a number >= 0 (1/s)", "of the pressure controller", unit="1/s", default=None
    )
    integral_gain: NotNegative | None = key(
        "a number >= 0 (1/s^2)", "of the pressure controller", unit="1/s^2", default=None
    )
    feed_forward: NotNegative | None = key(
        "a number >= 0", "part of the reference's rate that the pressure controller feeds forward", default=None
    )
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        stated = {name: value for name, value in self if value is not None and name != "provenance"}
        check_provenance(self.provenance, stated)
        for name in NEEDED[self.level]:
            if name not in stated:
                allowed = type(self).model_fields[name].description
                raise table_error(f'missing; level = "{self.level}" needs it; allowed: {allowed}', name)
        if self.supply_pressure is not None and self.exhaust_pressure is not None:
            if self.supply_pressure <= self.exhaust_pressure:
                message = f"found {self.supply_pressure}; allowed: above exhaust_pressure, {self.exhaust_pressure}"
                raise table_error(message, "supply_pressure")
            if self.vacuum_pressure is not None and self.vacuum_pressure >= self.exhaust_pressure:
                message = f"found {self.vacuum_pressure}; allowed: below exhaust_pressure, {self.exhaust_pressure}"
                raise table_error(message, "vacuum_pressure")
        return self

    def to_core(self) -> dict[str, Any]:
        """What the core computes with."""
        return self.model_dump(mode="json", exclude_none=True, exclude={"provenance"})
