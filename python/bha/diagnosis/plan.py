"""How one kind of effect is searched for: which numbers, from where, and how its signature is probed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

Numbers = Mapping[str, float]

#: Strength of a probe as a share of the typical one.
PROBE_SHARE = 0.05
#: Probes of one amount at several places: at an origin and shifted along x, y and z.
PLACES = 4
#: Standard deviations of its prior beyond which no arm has a strength.
FARTHEST = 3.0


@dataclass(frozen=True)
class Strength:
    """A number in which the outputs are (for small values) linear.

    Attributes:
        name: the number of the effect.
        typical: a typical size in a real arm; the probe has a fraction of it.
        signed: whether either sign is physical.
        plausible: one standard deviation of its prior, where what is plausible does not depend on the arm; infinite for
            none.
        hard: whether more of it does hardly more from some size on, as a wall's stiffness: a fit then tells little of
            how much there is, to first order down to none, and everything of whether there is some.
    """

    name: str
    typical: float
    signed: bool = False
    plausible: float = math.inf
    hard: bool = False


@dataclass(frozen=True)
class Shape:
    """A number that means nothing without the effect: a time constant, a yield, a place.

    Attributes:
        name: the number of the effect.
        grid: where it is tried.
        logarithmic: whether it is positive and its logarithm is fitted.
        spread: how far a fit may plausibly move it from the grid, relative for logarithmic ones.
        low: least value of this kind: beyond it another kind of the same form begins.
        high: greatest value.
    """

    name: str
    grid: tuple[float, ...]
    logarithmic: bool = True
    spread: float = 1.0
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True)
class KindPlan:
    """How one kind is searched for.

    Attributes:
        kind: its name in the registry.
        sorts: sorts of places that are tried: ``all``, ``section``, ``bellows``, ``input``, ``sensors``,
            ``heads``, ``length`` (the sensors of single lengths), ``tip``.
        strengths: linear numbers.
        shapes: nonlinear numbers.
        fixed: numbers that are given and not searched.
        parts: the sort of place whose signatures add up to those of the larger places; empty if each is probed.
        passive: numbers that must not be negative for the effect to create no energy.
        extra: nonlinear numbers that are fitted but not tried on a grid, with their start.
        needs_heads: whether it shows in measured head positions only.
        needs_lengths: whether it shows in measured lengths only.
        grid: numbers that only serve to try probes, and are not fitted themselves.
        probes: from the shapes the numbers of the effects that are probed, and the strength each stands for; one probe
            a strength without it.
        begin: start of the numbers that are fitted, from the strengths of the probes and the shapes; zero strength
            without it.
        numbers: see :class:`bha.estimation.terms.EffectTerm`.
        further: of a kind of which several may act in one place (branches, stages): from the numbers of the one that is
            there the shapes from which another is sought.
        adding: numbers whose sum over such elements is what they amount to together.
        forward: of a kind with probes of its own, whether none of their strengths may be negative.
        bank: numbers of the elements of a bank, by growing shape: several elements in one place with a strength each,
            none of them negative. Each is a candidate by itself, too.
    """

    kind: str
    sorts: tuple[str, ...]
    strengths: tuple[Strength, ...]
    shapes: tuple[Shape, ...] = ()
    fixed: Numbers = field(default_factory=dict)
    parts: str = ""
    passive: tuple[str, ...] = ()
    extra: tuple[Shape, ...] = ()
    needs_heads: bool = False
    needs_lengths: bool = False
    grid: tuple[Shape, ...] = ()
    probes: Callable[[Numbers], list[tuple[dict[str, float], float]]] | None = None
    begin: Callable[[Sequence[float], Numbers], dict[str, float]] | None = None
    numbers: Callable[[Mapping[str, float]], dict[str, float]] = dict
    further: Callable[[Numbers], list[dict[str, float]]] | None = None
    adding: tuple[str, ...] = ()
    bank: tuple[Numbers, ...] = ()
    forward: bool = False

    @property
    def is_a_law(self) -> bool:
        """Whether it is another law in the place of one of the arm's: there is all of it or none, and no number."""
        return not (self.strengths or self.shapes or self.extra or self.probes)

    def is_plausible(self, strengths: Sequence[float], shape: Numbers) -> bool:
        """Whether an arm may have what probes promise: as its priors say, and as a fit would begin with it.

        Signatures are those of little of an effect; three kilograms that are missing are none.
        """
        if self.probes is None:
            own = zip(self.strengths, strengths, strict=False)
            return all(abs(value) <= FARTHEST * strength.plausible for strength, value in own)
        if not self.strengths or self.begin is None:
            return True
        amount = float(sum(strengths[:PLACES]))
        return math.isclose(self.begin(strengths, shape)[self.strengths[0].name], amount, rel_tol=1e-6)

    @property
    def one_sided_numbers(self) -> tuple[str, ...]:
        """Numbers of the effect that its strengths stand for, none of which may be negative; empty for other kinds."""
        if not self.is_one_sided:
            return ()
        return tuple(s.name for s in (self.strengths if self.probes is None else self.extra))

    @property
    def is_one_sided(self) -> bool:
        """Whether none of the strengths of its probes may be negative: there is no lag of less than none."""
        return self.forward if self.probes is not None else not any(s.signed for s in self.strengths)

    @property
    def size(self) -> int:
        """Numbers that a fit has to find."""
        return max(1, len(self.strengths) + len(self.shapes) + len(self.extra))

    def probed(self, shape: Numbers) -> list[tuple[dict[str, float], float]]:
        """Numbers of the effects to probe, with the strength each stands for."""
        rest = {**self.fixed, **{s.name: s.grid[0] for s in self.extra}, **shape}
        if self.probes is not None:
            names = {g.name for g in self.grid}
            rest = {k: v for k, v in rest.items() if k not in names}
            return [(self.numbers({**rest, **numbers}), size) for numbers, size in self.probes(shape)]
        if not self.strengths:
            return [(self.numbers(rest), 1.0)]
        zero = {s.name: 0.0 for s in self.strengths}
        return [
            (self.numbers({**rest, **zero, s.name: PROBE_SHARE * s.typical}), PROBE_SHARE * s.typical)
            for s in self.strengths
        ]

    def shape_grid(self) -> list[dict[str, float]]:
        """All combinations of the shapes' grids, and the elements of the bank that are not among them."""
        combinations: list[dict[str, float]] = [{}]
        for shape in (*self.shapes, *self.grid):
            combinations = [{**c, shape.name: value} for c in combinations for value in shape.grid]
        return combinations + [dict(element) for element in self.bank if element not in combinations]

    def fixed_of(self, shape: Numbers) -> dict[str, float]:
        """Numbers that stay in a fit from ``shape``: those that are given, and those of a bank that are not fitted."""
        fitted = {s.name for s in self.strengths} | {s.name for s in (*self.shapes, *self.extra, *self.grid)}
        return {**self.fixed, **{name: value for name, value in shape.items() if name not in fitted}}


def together(elements: Sequence[Mapping[str, float]], adding: Sequence[str]) -> dict[str, float]:
    """What elements amount to: sums of the numbers ``adding``; of the others the mean of logarithms by these sums.

    Of elements without such a number, or with one that is zero, it is the numbers of the first.
    """
    first = dict(elements[0])
    weights = np.array([sum(abs(e[name]) for name in adding if name in e) for e in elements])
    if len(elements) == 1 or not np.sum(weights):
        return first
    for name in first:
        own = np.array([e[name] for e in elements])
        if name in adding:
            first[name] = float(np.sum(own))
        elif np.all(own > 0.0):
            first[name] = float(np.exp(np.average(np.log(own), weights=weights)))
    return first
