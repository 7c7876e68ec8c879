"""A candidate of the search: a kind of effect at a place, and the numbers that a fit of it has."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bha.diagnosis.model import EffectTerm, coordinate, number_of
from bha.diagnosis.plan import KindPlan, Numbers
from bha.estimation.free import Coordinate
from bha.parameters import EFFECT_KINDS

#: Unit, least and greatest value of a number of a kind.
Ranges = Callable[[str, str], tuple[str, float, float]]


@dataclass(frozen=True)
class Candidate:
    """A kind at a place with shapes: one line of the screening.

    Attributes:
        plan: the kind.
        where: its place, as in a parameter file.
        shape: its nonlinear numbers.
    """

    plan: KindPlan
    where: str
    shape: Numbers

    @property
    def kind(self) -> str:
        """Name of the kind."""
        return self.plan.kind

    @property
    def key(self) -> tuple[str, str]:
        """Kind and place."""
        return (self.plan.kind, self.where)

    def term(self, strengths: Sequence[float], ranges: Ranges) -> tuple[EffectTerm, list[float]]:
        """The effect with all its numbers free, and where its coordinates start.

        Strengths count from zero in units of what the screening expects. Started at strength zero, a first step finds
        strengths and plain parameters together; that is safer than to trust the strengths that the screening promises.
        """
        coordinates: list[Coordinate] = []
        start: list[float] = []
        where = f"{self.kind} at {self.where}"
        begin = self.plan.begin(strengths, self.shape) if self.plan.begin is not None else {}
        for number, strength in enumerate(self.plan.strengths):
            unit, low, high = ranges(self.kind, strength.name)
            expected = begin.get(strength.name, strengths[number] if number < len(strengths) else 0.0)
            spread = max(0.2 * strength.typical, abs(expected)) if math.isfinite(expected) else strength.typical
            low = low if strength.signed else max(low, 0.0)
            own = coordinate(
                f"{where}: {strength.name}",
                f"effect.{strength.name}",
                unit,
                0.0,
                spread,
                logarithmic=False,
                low=low,
                high=high,
                weight=0.0,
            )
            coordinates.append(own)
            start.append(own.coordinate(begin.get(strength.name, 0.0)))
        for shape in (*self.plan.shapes, *self.plan.extra):
            unit, low, high = ranges(self.kind, shape.name)
            nominal = float(self.shape.get(shape.name, shape.grid[0]))
            low, high = max(low, shape.low, 1e-9 if shape.logarithmic else -math.inf), min(high, shape.high)
            own = coordinate(
                f"{where}: {shape.name}",
                f"effect.{shape.name}",
                unit,
                nominal,
                shape.spread,
                logarithmic=shape.logarithmic,
                low=low,
                high=high,
                weight=0.05,
            )
            coordinates.append(own)
            start.append(own.coordinate(begin.get(shape.name, nominal)))
        fixed = dict(self.plan.fixed)
        anew = list(start)
        if self.plan.grid and self.plan.begin is not None:
            # As probed: both ways of a lag alike.
            probed = self.plan.begin([1.0] * len(self.plan.probed(self.shape)), self.shape)
            anew = [c.coordinate(probed.get(number_of(c), c.value(v))) for c, v in zip(coordinates, start, strict=True)]
        term = EffectTerm(self.kind, self.where, tuple(coordinates), fixed, self.plan.numbers, tuple(anew))
        return term, start


def core_ranges() -> Ranges:
    """The ranges that the core's registry allows."""
    table = {
        (kind.kind, number.name): (number.unit, number.low, number.high)
        for kind in EFFECT_KINDS.values()
        for number in kind.parameters
    }

    def ranges(kind: str, name: str) -> tuple[str, float, float]:
        return table.get((kind, name), ("", -math.inf, math.inf))

    return ranges
