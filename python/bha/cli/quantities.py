"""Options and answers that are a number with a unit: ``150mm``, ``1.2 bar``, ``0.75``; SI where none is given."""

from __future__ import annotations

import math
import re
from typing import Any

import click

from bha.logs.units import UnitError, factor_to_si

_NUMBER = re.compile(r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>.*?)\s*")


class Quantity(click.ParamType):  # type: ignore[type-arg, unused-ignore]
    """A number with a unit, as a float in the SI unit ``si``, a key of ``bha.logs.units.EXAMPLES``.

    Pressures are gauge pressures: ``bar(g)`` is ``bar``, and ``bar(a)`` is refused.
    """

    name = "quantity"

    def __init__(self, si: str, example: str) -> None:
        """``example`` is how one may look, ``"150mm"``."""
        self._si, self._example = si, example

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number in SI."""
        if isinstance(value, int | float):
            return float(value)
        found = _NUMBER.fullmatch(str(value))
        if found is None:
            self.fail(f"found {value!r}; expected a number, with its unit if not {self._si}: {self._example}")
        unit = found["unit"] or self._si
        if self._si == "Pa":
            if unit.endswith("(a)"):
                self.fail(f"found {value!r}; expected gauge pressure, above ambient pressure: {self._example}")
            unit = unit.removesuffix("(g)").rstrip()
        try:
            number = float(found["number"]) * factor_to_si(unit, self._si)
        except UnitError as error:
            self.fail(f"found {value!r}: {error}")
        if not math.isfinite(number):
            self.fail(f"found {value!r}; expected a finite number")
        return number


class Each(click.ParamType):  # type: ignore[type-arg, unused-ignore]
    """One value for all sections, or one for each with commas between: ``0.75kg,0.6kg``; a tuple."""

    name = "value[,value...]"

    def __init__(self, kind: Any) -> None:
        """``kind`` is that of each value."""
        self._kind = kind

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[Any, ...]:
        """The values in order."""
        if isinstance(value, tuple):
            return value
        return tuple(self._kind.convert(part.strip(), param, ctx) for part in str(value).split(","))
