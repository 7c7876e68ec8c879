"""Units of the columns of a log, through ``pint``; imported only when a unit is not the SI unit itself."""

from __future__ import annotations

import functools
import re
from typing import Any

EXAMPLES = {
    "s": "a time, such as s or ms",
    "m": "a length, such as m or mm",
    "m/s": "a velocity, such as m/s or mm/s",
    "Pa": "a pressure, such as Pa, kPa, bar, or kPa(g) for gauge pressure",
    "N": "a force, such as N",
}
# What a unit may consist of. Nothing that can make a parser of expressions compute for long, such as m^9^9^9.
_PLAUSIBLE = re.compile(r"[^\W\d](?:[\w\s*/·.%°()-]|\^|\*\*)*")
_POWER = re.compile(r"(?:\^|\*\*)\s*(.{0,3})")


class UnitError(ValueError):
    """A unit is not known or is not one of the quantity. The text says which and what is expected."""


@functools.cache
def factor_to_si(unit: str, si: str) -> float:
    """Factor by which a value in ``unit`` is multiplied to get it in the SI unit ``si``, a key of ``EXAMPLES``.

    Raises:
        UnitError: the unit is not known, or not one of the quantity that ``si`` measures.
    """
    if unit == si:
        return 1.0
    found = _parse(unit)
    if found is None:
        raise UnitError(f"unit '{unit}' is not known; expected {EXAMPLES[si]}")
    if found.dimensionality != _registry().Unit(si).dimensionality:
        raise UnitError(f"unit '{unit}' does not fit; expected {EXAMPLES[si]}")
    return float(_registry().Quantity(1.0, found).to(si).magnitude)


def measures(unit: str, si: str) -> bool:
    """Whether ``unit`` is one of the quantity that the SI unit ``si`` measures; False for units that are not known."""
    try:
        factor_to_si(unit, si)
    except UnitError:
        return False
    return True


@functools.cache
def _registry() -> Any:
    import pint  # noqa: PLC0415 - a third of a second that logs in SI units need not spend

    return pint.UnitRegistry()


def _parse(unit: str) -> Any:
    powers = _POWER.findall(unit)
    if len(unit) > 40 or not _PLAUSIBLE.fullmatch(unit) or not all(re.match(r"-?\d(?!\d)", p) for p in powers):
        return None
    if re.search(r"\d\s*(\^|\*\*)", unit):
        return None
    try:
        return _registry().Unit(unit)
    except Exception:
        # Whatever pint's parser stumbles over is not a unit; it raises errors of many kinds.
        return None
