"""A candidate of the search: a kind of effect at a place, and the numbers that a fit of it has.

A candidate is one element, whose shapes (a yield, a time constant) are fitted from where the screening found them, or a
bank: several elements in one place whose shapes stay on the grid and whose strengths are fitted, none of them negative.
What is linear in what is fitted has no valleys, and a density of yields or a spectrum of times is what real material
has: Maxwell slip and Prandtl-Ishlinskii (Iwan 1966), Prony series (Ferry 1980).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

from bha.diagnosis.model import coordinate
from bha.diagnosis.plan import KindPlan, Numbers, Strength
from bha.estimation.free import Coordinate
from bha.estimation.terms import EffectTerm, number_of
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
        bank: of a bank those of each element; empty for one element.
    """

    plan: KindPlan
    where: str
    shape: Numbers
    bank: tuple[Numbers, ...] = ()

    @property
    def kind(self) -> str:
        """Name of the kind."""
        return self.plan.kind

    @property
    def key(self) -> tuple[str, str]:
        """Kind and place."""
        return (self.plan.kind, self.where)

    @property
    def size(self) -> int:
        """Numbers that a fit has to find."""
        return len(self.bank) * len(self.plan.strengths) if self.bank else self.plan.size

    @property
    def name(self) -> str:
        """A text that no other candidate has."""
        return repr((self.key, [sorted(shape.items()) for shape in self.bank or (self.shape,)]))

    def finer(self) -> Candidate:
        """The bank over the whole grid, with an element between any two neighbours of it as well."""
        grid = self.plan.bank
        between = [{name: math.sqrt(a[name] * b[name]) for name in a} for a, b in pairwise(grid)]
        return replace(self, bank=(*chain(*zip(grid, between, strict=False)), grid[-1]))

    def only(self, which: Sequence[int]) -> Candidate:
        """The bank with some of its elements only."""
        return replace(self, bank=tuple(self.bank[k] for k in which))

    def term(self, strengths: Sequence[float], ranges: Ranges) -> tuple[EffectTerm, list[float]]:
        """The effect with all its numbers free, and where its coordinates start.

        Strengths count from zero in units of what the screening expects. Started at strength zero, a first step finds
        strengths and plain parameters together; that is safer than to trust the strengths that the screening promises.
        """
        if self.bank:
            return self._bank(strengths, ranges)
        coordinates: list[Coordinate] = []
        start: list[float] = []
        where = f"{self.kind} at {self.where}"
        begin = self.plan.begin(strengths, self.shape) if self.plan.begin is not None else {}
        for number, strength in enumerate(self.plan.strengths):
            expected = begin.get(strength.name, strengths[number] if number < len(strengths) else 0.0)
            own = self._strength(strength, expected, ranges)
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
        fixed = self.plan.fixed_of(self.shape)
        anew = list(start)
        if self.plan.grid and self.plan.begin is not None:
            # As probed: both ways of a lag alike.
            probed = self.plan.begin([1.0] * len(self.plan.probed(self.shape)), self.shape)
            anew = [c.coordinate(probed.get(number_of(c), c.value(v))) for c, v in zip(coordinates, start, strict=True)]
        term = EffectTerm(self.kind, self.where, tuple(coordinates), fixed, self.plan.numbers, tuple(anew))
        return term, start

    def _strength(self, strength: Strength, expected: float, ranges: Ranges, element: int | None = None) -> Coordinate:
        unit, low, high = ranges(self.kind, strength.name)
        spread = max(0.2 * strength.typical, abs(expected)) if math.isfinite(expected) else strength.typical
        named, path = f"{self.kind} at {self.where}: {strength.name}", f"effect.{strength.name}"
        if element is not None:
            named, path = f"{named} {element + 1}", f"effect.{element}.{strength.name}"
        low = low if strength.signed else max(low, 0.0)
        weight = (spread / strength.plausible) ** 2
        return coordinate(named, path, unit, 0.0, spread, logarithmic=False, low=low, high=high, weight=weight)

    def _bank(self, strengths: Sequence[float], ranges: Ranges) -> tuple[EffectTerm, list[float]]:
        """The bank with the strengths of all its elements free, from zero."""
        (strength,) = self.plan.strengths
        # One scale for all: an element that the screening gives nothing may be the one that acts.
        expected = max((abs(own) for own in strengths), default=0.0)
        coordinates = [self._strength(strength, expected, ranges, k) for k in range(len(self.bank))]
        start = [c.coordinate(0.0) for c in coordinates]
        fixed = dict(self.plan.fixed)
        term = EffectTerm(
            self.kind, self.where, tuple(coordinates), fixed, self.plan.numbers, tuple(start), tuple(self.bank)
        )
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
