"""The columns of a measured log: what their headings mean, and what their values may be.

A heading is a name and a unit, ``p11 [kPa(g)]``. The names of ``bha.names`` are the log's quantities; any other column
is kept as it is. A heading that looks like a quantity but is not spelt like one is an error, because a column that is
silently ignored is worse than none.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.errors import LogError
from bha.units import UnitError, factor_to_si, measures

SKIP, NUMBER, TIME, FREE = "skip", "number", "time", "free"

_BRACKETED = re.compile(r"(?P<name>[^\[\]]*?)\s*\[(?P<unit>[^\[\]]*)\]")
_PARENTHESES = re.compile(r"(?P<name>[^()]*?)\s*\((?P<unit>.*)\)")
_REFERENCE = re.compile(r"(?P<unit>.*?)\s*\((?P<reference>[ga])\)")


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


def plan(
    origin: str,
    headings: Sequence[str],
    *,
    ambient_pressure: float,
    only: Collection[str] | None = None,
) -> list[Column]:
    """Decide what to do with each column.

    Args:
        origin: the file, for errors.
        headings: the headings in the order of the file.
        ambient_pressure: what gauge pressures are relative to, Pa.
        only: names of the columns to read beside the time; all if None.

    Raises:
        LogError: no time, a heading that stands twice, a misspelt name, a unit that is missing, unknown or does not
            fit, or a name in ``only`` that is not there.
    """
    columns = [_column(origin, heading, ambient_pressure) for heading in headings]
    first: dict[str, Column] = {}
    for column in columns:
        if not column.name:
            continue
        if column.name in first:
            both = f"'{first[column.name].heading}' and '{column.heading}'"
            raise LogError(f"{origin}: column '{column.name}' stands twice, {both}; remove or rename one of them")
        first[column.name] = column
    if names.TIME not in first:
        raise LogError(f"{origin}: there is no column of time, 't [s]'{_nearest('time', names.TIME, first)}")
    if only is not None:
        for name in only:
            if name not in first:
                raise LogError(missing(origin, name, first))
        keep = {*only, names.TIME}
        columns = [c if c.name in keep else Column(c.heading, c.name, c.unit, SKIP) for c in columns]
    return columns


def missing(origin: str, name: str, available: Iterable[str]) -> str:
    """The text of an error: a column is not there; the nearest name that is."""
    return f"{origin}: there is no column '{name}'{_nearest(name, name, available)}"


def _nearest(wanted: str, name: str, available: Iterable[str]) -> str:
    available = [other for other in available if other]
    near = difflib.get_close_matches(wanted, available, n=1, cutoff=0.6)
    near = near or difflib.get_close_matches(name, available, n=1, cutoff=0.6)
    return f"; nearest: '{near[0]}'" if near else f"; the log has: {', '.join(available) or 'none'}"


def _column(origin: str, heading: str, ambient_pressure: float) -> Column:
    if not heading:
        return Column(heading, "", "", SKIP)
    bracketed = _BRACKETED.fullmatch(heading)
    name, unit = (bracketed["name"], bracketed["unit"].strip()) if bracketed else (heading, None)
    quantity = names.quantity(name)
    if quantity is None:
        _refuse_misspelt(origin, heading, name, unit)
        return Column(heading, name, unit or "", FREE)
    where = f"{origin}: column '{heading}'"
    if not unit:
        raise LogError(f"{where} has no unit; write it as '{names.column(name, quantity.unit)}'")
    referenced = _REFERENCE.fullmatch(unit)
    reference = referenced["reference"] if referenced and quantity.unit == "Pa" else ""
    plain_unit = referenced["unit"] if referenced and reference else unit
    try:
        factor = factor_to_si(plain_unit, quantity.unit)
    except UnitError as error:
        raise LogError(f"{where}: {error}") from error
    if quantity.kind == "time":
        return Column(heading, name, quantity.unit, TIME, factor)
    if quantity.unit != "Pa":
        return Column(heading, name, quantity.unit, NUMBER, factor)
    if reference == "g":
        hint = f"that of vacuum at an ambient pressure of {ambient_pressure} Pa"
        return Column(heading, name, "Pa", NUMBER, factor, ambient_pressure, -ambient_pressure / factor, hint, True)
    hint = f"that of vacuum; is this gauge pressure? Then write '{name} [{plain_unit}(g)]'"
    return Column(heading, name, "Pa", NUMBER, factor, least=0.0, hint=hint)


def _refuse_misspelt(origin: str, heading: str, name: str, unit: str | None) -> None:
    """An error for a heading that is a quantity but for case, blanks, separators or the kind of brackets."""
    if unit is None and (found := _PARENTHESES.fullmatch(name)):
        name, unit = found["name"], found["unit"].strip()
    meant = re.sub(r"[\s_.,:-]", "", name)
    meant = meant if names.quantity(meant) else meant.lower()
    quantity = names.quantity(meant)
    if quantity is None:
        return
    plain_unit = re.sub(r"\s*\([ga]\)$", "", unit) if unit else None
    # "T [K]" is a temperature and "Q11 [l/min]" a flow: with a unit of their own they are other quantities.
    if plain_unit and not measures(plain_unit, quantity.unit):
        return
    proposal = names.column(meant, unit or quantity.unit)
    raise LogError(f"{origin}: column '{heading}' is not known; did you mean '{proposal}'? Rename it")


def check_values(origin: str, column: Column, values: NDArray[np.float64]) -> None:
    """Check the values of a column as they stand in the file; the checks and texts of the reader of CSV.

    Raises:
        LogError: a value that is not finite, too small, or a time that runs backwards; the text names row and column.
    """
    if column.used not in (NUMBER, TIME):
        return

    def fault(row: int, text: str) -> LogError:
        return LogError(f"{origin}, row {row + 1}, column '{column.heading}': {text}")

    finite = np.isfinite(values)
    if not finite.all():
        row = int(np.argmin(finite))
        shown = str(values[row]).replace("nan", "NaN")
        text = f'found "{shown}"; expected a finite number: write the last known value or remove the row'
        raise fault(row, text)
    if len(values) and values.min() < column.least:
        row = int(np.argmax(values < column.least))
        raise fault(row, f"found {values[row]}, below the least possible value {column.least}; {column.hint}")
    if column.used == TIME:
        backwards = values[1:] < values[:-1]
        if backwards.any():
            row = int(np.argmax(backwards)) + 1
            text = f"time runs backwards, from {values[row - 1]} to {values[row]}; times may repeat but not decrease"
            raise fault(row, text)
