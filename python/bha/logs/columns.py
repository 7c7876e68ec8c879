"""The columns of a measured log: what their headings mean, and what their values may be.

A heading is a name and a unit, ``p11 [kPa(g)]``. The names of ``bha.names`` are the log's quantities; any other column
is kept as it is. A heading that looks like a quantity but is not spelt like one is an error, because a column that is
silently ignored is worse than none. ``headings.py`` says what headings are there when they are wrong.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.errors import LogError
from bha.logs.headings import PARENTHESES, named, no_column, no_time, refuse_other_layouts, shortened
from bha.logs.units import UnitError, doubt, factor_to_si, measures, proposal

SKIP, NUMBER, TIME, FREE = "skip", "number", "time", "free"

#: Most columns of a log, characters of a heading, and number of a section, bellows or input.
MOST_COLUMNS, LONGEST_HEADING, GREATEST_NUMBER = 10_000, 200, 999

#: Greatest size of a value in SI units, as in parameter files: differences, squares and cubes of such are finite.
GREATEST_VALUE = 1e30

_REFERENCE = re.compile(r"(?P<unit>.*\S)\s*\((?P<reference>[ga])\)")

_HOLD = "write the last known value, as a sensor that holds it would, or remove the row"
_MAY_BE_MISSING = f"{_HOLD}, or take such cells as missing samples (--missing; in Python missing=True)"
# What drives the motion, with what to do where a value is not there. All other columns may miss samples.
_NEVER_MISSING = {
    "time": "a row without a time has no place in the log: write the time or remove the row",
    "pressure": f"{_HOLD}: pressures drive the arm and may not be missing",
    "commanded_pressure": f"{_HOLD}: pressures drive the arm and may not be missing",
    "force": f"{_HOLD}: forces drive the arm and may not be missing",
}


@dataclass(frozen=True)
class Column:
    """What is to be done with one column of a file.

    Attributes:
        heading: the heading as it stands in the file.
        name: its name.
        unit: unit of the values after conversion: SI for quantities, that of the file for other columns.
        used: ``"skip"``, ``"number"``, ``"time"`` or ``"free"``.
        factor: a value of the file times this, plus ``offset``, is the value in ``unit``.
        offset: see ``factor``.
        least: least possible value, in the unit of the file.
        hint: what to say of a smaller one.
        gauge: whether the file has gauge pressure.
        missing: whether samples may be missing; they are NaN then.
        absent: what to say of a sample that is not there and may not be missing.
        doubt: what is odd about the heading, though it can be read; empty if nothing is.
        hollow: absolute pressures below this, in the unit of the file, are all but vacuum: more likely gauge pressure.
    """

    heading: str
    name: str
    unit: str
    used: str
    factor: float = 1.0
    offset: float = 0.0
    least: float = -math.inf
    hint: str = ""
    gauge: bool = False
    missing: bool = False
    absent: str = ""
    doubt: str = ""
    hollow: float = -math.inf


def plan(
    origin: str,
    headings: Sequence[str],
    *,
    ambient_pressure: float,
    only: Collection[str] | None = None,
    missing: bool = False,
    opening: Sequence[str] = (),
) -> list[Column]:
    """Decide what to do with each column.

    Args:
        origin: the file, for errors.
        headings: the headings in the order of the file.
        ambient_pressure: what gauge pressures are relative to, Pa.
        only: names of the columns to read beside the time; all if None.
        missing: whether samples may be missing, except of what drives the arm.
        opening: the first lines of a text file, to look for headings that are not in the first one.

    Raises:
        LogError: no time, a heading that stands twice, a misspelt name, a unit that is missing, unknown or does not
            fit, headings that are too many or too long, or a name in ``only`` that is not there.
    """
    if len(headings) > MOST_COLUMNS:
        raise LogError(f"{origin}: has {len(headings)} columns; a log has at most {MOST_COLUMNS}")
    for number, heading in enumerate(headings, start=1):
        if len(heading) > LONGEST_HEADING:
            found = f"the heading of column {number}, '{shortened(heading)}', has {len(heading)} characters"
            raise LogError(f"{origin}: {found}; a heading, such as 'p11 [kPa(g)]', has at most {LONGEST_HEADING}")
    refuse_other_layouts(origin, headings, opening)
    columns = [_column(origin, heading, ambient_pressure, missing) for heading in headings]
    first: dict[str, Column] = {}
    for column in columns:
        if not column.name:
            continue
        if column.name in first:
            both = f"'{first[column.name].heading}' and '{column.heading}'"
            raise LogError(f"{origin}: column '{column.name}' stands twice, {both}; remove or rename one of them")
        first[column.name] = column
    if names.TIME not in first:
        raise LogError(no_time(origin, headings, first))
    if only is not None:
        for name in only:
            if name not in first:
                raise LogError(no_column(origin, name, first))
        keep = {*only, names.TIME}
        columns = [c if c.name in keep else Column(c.heading, c.name, c.unit, SKIP) for c in columns]
    return columns


def doubts(columns: Iterable[tuple[Column, NDArray[np.float64]]]) -> list[str]:
    """What is odd about columns and their values, in the unit of the file, though they can be read; a text each."""
    columns = list(columns)
    found = [f"column '{column.heading}': {column.doubt}" for column, _ in columns if column.doubt]
    absolute = [(column, values.min(), values.max()) for column, values in columns if math.isfinite(column.hollow)]
    low = [(column, least) for column, least, _ in absolute if least < column.hollow]
    # A log that is at vacuum throughout says nothing of gauge pressure; one that starts there does.
    if low and any(greatest > 10.0 * column.hollow for column, _, greatest in absolute):
        column, least = low[0]
        others = f" (and {len(low) - 1} more)" if len(low) > 1 else ""
        text = f"column '{column.heading}'{others} reaches {least:g}, that is vacuum, absolute pressure being meant; "
        found.append(text + column.hint.partition("; ")[2])
    return found


def _column(origin: str, heading: str, ambient_pressure: float, missing: bool) -> Column:
    if not heading:
        return Column(heading, "", "", SKIP)
    name, unit = named(heading)
    quantity = names.quantity(name)
    if quantity is None:
        _refuse_bare_unit(origin, heading)
        _refuse_misspelt(origin, heading, name, unit)
        return Column(heading, name, unit or "", FREE, missing=True)
    where = f"{origin}: column '{heading}'"
    if max(quantity.section, quantity.number) > GREATEST_NUMBER:
        found = f"section {quantity.section}" if quantity.section > GREATEST_NUMBER else f"number {quantity.number}"
        raise LogError(f"{where}: {found}; sections, bellows and inputs count from 1 to {GREATEST_NUMBER}")
    if quantity.unit == "1" and unit in (None, "", "-"):
        unit = "1"
    if not unit:
        raise LogError(f"{where} has no unit; write it as '{names.column(name, quantity.unit)}'")
    referenced = _REFERENCE.fullmatch(unit) if quantity.unit == "Pa" else None
    plain_unit, reference = (referenced["unit"], referenced["reference"]) if referenced else (unit, "")
    try:
        factor = factor_to_si(plain_unit, quantity.unit)
    except UnitError as error:
        raise LogError(f"{where}: {_unit_fault(unit, quantity.unit, error)}") from error
    absent = _NEVER_MISSING.get(quantity.kind, _MAY_BE_MISSING)
    odd = doubt(plain_unit, quantity.unit) or ""
    may = missing and quantity.kind not in _NEVER_MISSING
    if quantity.unit != "Pa":
        used = TIME if quantity.kind == "time" else NUMBER
        return Column(heading, name, quantity.unit, used, factor, missing=may, absent=absent, doubt=odd)
    if reference == "g":
        hint = f"that of vacuum at an ambient pressure of {ambient_pressure} Pa"
        least = -ambient_pressure / factor
        return Column(
            heading, name, "Pa", NUMBER, factor, ambient_pressure, least, hint, gauge=True, absent=absent, doubt=odd
        )
    hint = f"that of vacuum; is this gauge pressure? Then write '{name} [{plain_unit}(g)]'"
    hollow = -math.inf if reference else 0.01 * ambient_pressure / factor
    return Column(heading, name, "Pa", NUMBER, factor, least=0.0, hint=hint, absent=absent, doubt=odd, hollow=hollow)


def _unit_fault(unit: str, si: str, fault: UnitError) -> UnitError:
    """What is wrong with a unit as it stands in the heading; ``fault`` is that of the unit without its reference."""
    try:
        factor_to_si(unit, si)
    except UnitError as error:
        return error
    return fault


def _refuse_misspelt(origin: str, heading: str, name: str, unit: str | None) -> None:
    """An error for a heading that is a quantity but for case, blanks, separators or brackets."""
    broken = unit is None and "[" in name
    if broken:
        # "p11 [kPa] (g)", "p11 [kPa": no single pair of brackets at the end.
        name, _, rest = name.partition("[")
        unit = re.sub(r"[\[\]\s]", "", rest)
    elif unit is None:
        name, unit = named(name, PARENTHESES)
    meant = names.meant(name)
    quantity = names.quantity(meant) if meant else None
    if meant is None or quantity is None:
        return
    plain_unit = re.sub(r"\s*\([ga]\)$", "", unit) if unit else None
    # "T [K]" is a temperature and "Q11 [l/min]" a flow: with a unit of their own they are other quantities.
    if plain_unit and not measures(plain_unit, quantity.unit):
        near = proposal(unit or "", quantity.unit)
        if near is None and not broken:
            return
        unit = near or quantity.unit
    spelt = names.column(meant, unit or quantity.unit)
    raise LogError(f"{origin}: column '{heading}' is not known; did you mean '{spelt}'? Rename it")


def _refuse_bare_unit(origin: str, heading: str) -> None:
    """An error for a heading whose unit stands without brackets, ``p11 kPa`` or ``q11_mm``."""
    name, *rest = re.split(r"[\s_/]+", heading, maxsplit=1)
    quantity = names.quantity(name)
    if not rest or quantity is None or quantity.kind == "time":
        return
    unit = rest[0] if measures(rest[0], quantity.unit) else proposal(rest[0], quantity.unit)
    if unit is not None:
        spelt = names.column(name, unit)
        raise LogError(f"{origin}: column '{heading}' is not known; did you mean '{spelt}'? Rename it")


def check_values(origin: str, column: Column, values: NDArray[np.float64]) -> str | None:
    """Check the values of a column as they stand in the file; the checks and texts of the reader of CSV.

    Returns:
        Why a free column cannot be used; None if it can.

    Raises:
        LogError: a value that is not there or not finite, too small, or a time that runs backwards; the text names row
            and column.
    """

    def fault(row: int, text: str) -> LogError:
        return LogError(f"{origin}, row {row + 1}, column '{column.heading}': {text}")

    fit = ~np.isinf(values) if column.missing else np.isfinite(values)
    if not fit.all():
        row = int(np.argmin(fit))
        if column.used == FREE:
            return f"row {row + 1}: '{values[row]}' is not a number"
        if np.isnan(values[row]):
            raise fault(row, f'found "NaN", no value; {column.absent}')
        raise fault(
            row, f'found "{values[row]}"; expected a finite number: write the last known value or remove the row'
        )
    # Comparisons with NaN are false, as they should be.
    if (small := values < column.least).any():
        row = int(np.argmax(small))
        raise fault(row, f"found {values[row]}, below the least possible value {column.least}; {column.hint}")
    if column.used == TIME:
        backwards = values[1:] < values[:-1]
        if backwards.any():
            row = int(np.argmax(backwards)) + 1
            text = f"time runs backwards, from {values[row - 1]} to {values[row]}; times may repeat but not decrease"
            raise fault(row, text)
    return None


def convert(origin: str, column: Column, values: NDArray[np.float64]) -> None:
    """Convert the values of a column from the unit of the file, in place.

    Raises:
        LogError: a value of a quantity is too great to compute with; the text names the row.
    """
    with np.errstate(over="ignore"):
        if column.factor != 1.0:
            np.multiply(values, column.factor, out=values)
        if column.offset != 0.0:
            np.add(values, column.offset, out=values)
    if column.used == FREE:
        return
    # NaN, a missing sample, is neither least nor greatest here.
    greatest = max(np.fmax.reduce(values), -np.fmin.reduce(values))
    if greatest > GREATEST_VALUE:
        row = int(np.argmax(np.abs(np.nan_to_num(values, posinf=np.inf)) > GREATEST_VALUE)) + 1
        text = f"the value is too great to compute with, above {GREATEST_VALUE:g} {column.unit}; check the unit"
        raise LogError(f"{origin}, row {row}, column '{column.heading}': {text}")
