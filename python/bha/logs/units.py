"""Units of the columns of a log, through ``pint``; imported only when a unit is not the SI unit itself."""

from __future__ import annotations

import difflib
import functools
import re
from typing import Any

EXAMPLES = {
    "s": "a time, such as s or ms",
    "m": "a length, such as m or mm",
    "m/s": "a velocity, such as m/s or mm/s",
    "Pa": "a pressure, such as Pa, kPa, bar, or kPa(g) for gauge pressure",
    "N": "a force, such as N",
    "N*m": "a moment, such as N*m",
    "kg": "a mass, such as kg or g",
    "m^2": "an area, such as m^2 or cm^2",
    "deg": "an angle, such as deg or rad",
    "1": "a plain number: leave the unit out or write [1] or [-]",
}
# What logs are usually written in: what a unit that is not known is compared with.
_USUAL = {
    "s": ("s", "ms", "us", "ns", "min", "h"),
    "m": ("m", "cm", "mm", "um", "inch", "ft"),
    "m/s": ("m/s", "cm/s", "mm/s"),
    "Pa": ("Pa", "hPa", "kPa", "MPa", "mbar", "bar", "psi", "atm", "Torr", "mmHg", "inHg"),
    "N": ("N", "mN", "kN", "gf", "kgf", "lbf"),
    "kg": ("kg", "g", "lb", "oz"),
    "m^2": ("m^2", "cm^2", "mm^2", "inch^2"),
    "deg": ("deg", "rad"),
}
# Sizes, in SI, of units that somebody may measure an arm in. Beyond them stands a prefix in the wrong case: mPa, Mbar.
_SIZES = {"s": (1e-9, 1e5), "m": (1e-9, 1e4), "m/s": (1e-9, 1e4), "Pa": (0.1, 1e7), "N": (1e-9, 1e7)}
_LONGEST = 40
# What a unit may consist of. Nothing that can make a parser of expressions compute for long, such as m^9^9^9.
_PLAUSIBLE = re.compile(r"[^\W\d](?:[\w\s*/·.%°()-]|\^|\*\*)*")
_POWER = re.compile(r"(?:\^|\*\*)\s*(.{0,3})")
# Ways of writing what a pressure is relative to, beside (g) and (a).
_REFERENCE = re.compile(r"[\s_.,(-]*(?P<reference>gauge|gage|relative|rel|g|absolute|abs|a)\)?", re.IGNORECASE)


class UnitError(ValueError):
    """A unit is not known or is not one of the quantity. The text says which and what is expected."""


@functools.lru_cache(maxsize=4096)
def factor_to_si(unit: str, si: str) -> float:
    """Factor by which a value in ``unit`` is multiplied to get it in the SI unit ``si``, a key of ``EXAMPLES``.

    Raises:
        UnitError: the unit is not known, or not one of the quantity that ``si`` measures; the text proposes another.
    """
    if unit == si:
        return 1.0
    found = _parse(unit)
    if found is None:
        raise UnitError(f"unit '{unit}' is not known; expected {EXAMPLES[si]}{_did_you_mean(unit, si, guess=True)}")
    wanted = _registry().Unit("dimensionless" if si == "1" else si)
    if found.dimensionality != wanted.dimensionality or _is_angle(found) is not _is_angle(wanted):
        raise UnitError(f"unit '{unit}' does not fit; expected {EXAMPLES[si]}{_did_you_mean(unit, si, guess=False)}")
    return float(_registry().Quantity(1.0, found).to(wanted).magnitude)


def _is_angle(unit: Any) -> bool:
    """Whether a unit is one of angle, which has no dimension and yet is no plain number."""
    return "radian" in str(_registry().Quantity(1.0, unit).to_root_units().units) and unit.dimensionless


def measures(unit: str, si: str) -> bool:
    """Whether ``unit`` is one of the quantity that the SI unit ``si`` measures; False for units that are not known."""
    try:
        factor_to_si(unit, si)
    except UnitError:
        return False
    return True


def doubt(unit: str, si: str) -> str | None:
    """What is odd about a unit that fits: a size that nobody measures an arm in. None if nothing is.

    >>> doubt("mPa", "Pa")
    "'mPa' is 0.001 Pa; almost always 'MPa' is meant"
    """
    low, high = _SIZES.get(si, (0.0, float("inf")))
    factor = factor_to_si(unit, si)
    if low * (1 - 1e-9) <= factor <= high * (1 + 1e-9):
        return None
    other = unit[0].swapcase() + unit[1:]
    meant = measures(other, si) and low <= factor_to_si(other, si) <= high
    text = f"almost always '{other}' is meant" if meant else "hardly anybody measures an arm in it"
    return f"'{unit}' is {factor:g} {si}; {text}"


def _did_you_mean(unit: str, si: str, *, guess: bool) -> str:
    meant = proposal(unit, si, guess=guess)
    return f"; did you mean '{meant}'?" if meant else ""


def proposal(unit: str, si: str, *, guess: bool = False) -> str | None:
    """The usual unit that is spelt like this but for case, blanks and the way a reference is written; None if none is.

    ``guess`` allows one that is only similar.

    >>> proposal("PSIG", "Pa")
    'psi(g)'
    """
    if len(unit) > _LONGEST:
        return None
    usual = {name.lower(): name for name in _USUAL.get(si, ())}
    plain = unit.strip().lower()
    if plain in usual:
        return usual[plain]
    if si == "Pa":
        for start in range(1, len(plain)):
            found = _REFERENCE.fullmatch(plain, start)
            if found and (base := usual.get(plain[:start])):
                return f"{base}({'a' if found['reference'].startswith('a') else 'g'})"
    near = difflib.get_close_matches(plain, usual, n=1, cutoff=0.6) if guess else []
    return usual[near[0]] if near else None


@functools.cache
def _registry() -> Any:
    import pint  # noqa: PLC0415 - a third of a second that logs in SI units need not spend

    return pint.UnitRegistry()


def _parse(unit: str) -> Any:
    if len(unit) > _LONGEST or not _PLAUSIBLE.fullmatch(unit):
        return None
    if not all(re.match(r"-?\d(?!\d)", power) for power in _POWER.findall(unit)) or re.search(r"\d\s*(\^|\*\*)", unit):
        return None
    try:
        return _registry().Unit(unit)
    except Exception:
        # Whatever pint's parser stumbles over is not a unit; it raises errors of many kinds.
        return None
