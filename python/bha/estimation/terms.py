"""Effects with numbers to estimate: what stands beside an arm's own numbers in a model of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.estimation.free import Coordinate

Array = NDArray[np.float64]


def number_of(coordinate: Coordinate) -> str:
    """The name of an effect's number that a coordinate is of."""
    return coordinate.path.rpartition(".")[2]


def element_of(coordinate: Coordinate) -> int | None:
    """The element of a bank that a coordinate is of, from 0; None where an effect has one element."""
    steps = coordinate.path.split(".")
    return int(steps[1]) if len(steps) == 3 else None


@dataclass(frozen=True)
class EffectTerm:
    """One effect in the model: one element, or a bank of several in one place.

    Attributes:
        kind: as in a parameter file.
        where: as in a parameter file.
        coordinates: what is fitted; of a bank each is of one element, see :func:`element_of`.
        fixed: numbers that stay.
        numbers: what makes the numbers of the file from those that are fitted, where they are others (a wall's angle
            and distance).
        begin: coordinates from which they are fitted when nothing better is known.
        bank: numbers that stay, element by element: the grid of a bank.
    """

    kind: str
    where: str
    coordinates: tuple[Coordinate, ...]
    fixed: Mapping[str, float] = field(default_factory=dict, hash=False)
    numbers: Callable[[Mapping[str, float]], dict[str, float]] = dict
    begin: tuple[float, ...] = ()
    bank: tuple[Mapping[str, float], ...] = field(default=({},), hash=False)

    @property
    def label(self) -> str:
        """``creep at bellows 32``."""
        return f"{self.kind} at {self.where}"

    def table(self, numbers: Mapping[str, float]) -> dict[str, Any]:
        """The effect in the core's description."""
        return {"kind": self.kind, "where": self.where, "parameters": dict(numbers)}

    def elements(self, x: Sequence[float]) -> list[dict[str, float]]:
        """Numbers by name of each element at the coordinates ``x``."""
        found = []
        for k, own in enumerate(self.bank):
            values = {
                number_of(c): c.value(v) for c, v in zip(self.coordinates, x, strict=True) if element_of(c) in (None, k)
            }
            found.append(self.numbers({**self.fixed, **own, **values}))
        return found

    def only(self, which: Sequence[int]) -> EffectTerm:
        """A bank of one strength an element with some of its elements only."""
        own = [(self.coordinates[k], self.begin[k], self.bank[k]) for k in which]
        moved = [replace(c, path=f"effect.{k}.{number_of(c)}") for k, (c, _, _) in enumerate(own)]
        return replace(
            self, coordinates=tuple(moved), begin=tuple(b for _, b, _ in own), bank=tuple(e for _, _, e in own)
        )

    def on_bound(self, x: Array) -> set[str]:
        """Names of the numbers that sit on a bound at the coordinates ``x``, in all elements that have them."""
        off = {number_of(c) for c, v in zip(self.coordinates, x, strict=True) if not c.at_bound(float(v))}
        return {number_of(c) for c in self.coordinates} - off


def tables_of(effects: Sequence[EffectTerm], parts: Sequence[Array]) -> list[dict[str, Any]]:
    """All elements of all effects in the core's description, at the coordinates of each effect."""
    return [
        effect.table(numbers)
        for effect, part in zip(effects, parts, strict=True)
        for numbers in effect.elements([float(v) for v in part])
    ]
