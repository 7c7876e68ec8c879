"""The candidates: every kind of effect, where it may sit, how its signature is probed, and how its numbers are fitted.

What: one :class:`KindPlan` a kind. Kinds, places and the ranges of the numbers come from the core's registry; here is
only what a search needs beside it: which numbers the outputs are linear in (strengths), on which grid those that do not
exist without the effect are tried (shapes: time constants, yields, wall places), and what is plausible.
Source: kinds and forms `rust/src/effects/kinds`; magnitudes as in `docs/diagnosis.md`.
Convention: a *probe* is an effect at small strength; its signature is the change of the outputs per unit of strength.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.model import Coordinate, EffectTerm
from bha.errors import InputError
from bha.parameters.section import are_standard_bellows

Array = NDArray[np.float64]
Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Strength:
    """A number in which the outputs are (for small values) linear.

    Attributes:
        name: the number of the effect.
        typical: a typical size in a real arm; the probe has a fraction of it.
        signed: whether either sign is physical.
    """

    name: str
    typical: float
    signed: bool = False


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
        sorts: sorts of places that are tried: ``all``, ``section``, ``bellows``, ``input``, ``sensors``.
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
        numbers: see :class:`bha.diagnosis.model.EffectTerm`.
        further: of a kind of which several may act in one place (branches, stages): from the numbers of the one that is
            there the shapes from which another is sought.
        adding: numbers whose sum over such elements is what they amount to together.
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
        """All combinations of the shapes' grids."""
        combinations: list[dict[str, float]] = [{}]
        for shape in (*self.shapes, *self.grid):
            combinations = [{**c, shape.name: value} for c in combinations for value in shape.grid]
        return combinations


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
            coordinate = Coordinate(
                f"{where}: {strength.name}", unit, 0.0, spread, False, (where, strength.name), low, high, prior=0.0
            )
            coordinates.append(coordinate)
            start.append(coordinate.coordinate(begin.get(strength.name, 0.0)))
        for shape in (*self.plan.shapes, *self.plan.extra):
            unit, low, high = ranges(self.kind, shape.name)
            nominal = float(self.shape.get(shape.name, shape.grid[0]))
            low, high = max(low, shape.low, 1e-9 if shape.logarithmic else -math.inf), min(high, shape.high)
            coordinate = Coordinate(
                f"{where}: {shape.name}",
                unit,
                nominal,
                shape.spread,
                shape.logarithmic,
                (where, shape.name),
                low,
                high,
                prior=0.05,
            )
            coordinates.append(coordinate)
            start.append(coordinate.coordinate(begin.get(shape.name, nominal)))
        fixed = dict(self.plan.fixed)
        anew = list(start)
        if self.plan.grid and self.plan.begin is not None:
            # As probed: both ways of a lag alike.
            probed = self.plan.begin([1.0] * len(self.plan.probed(self.shape)), self.shape)
            anew = [
                c.coordinate(probed.get(str(c.path[-1]), c.value(v))) for c, v in zip(coordinates, start, strict=True)
            ]
        term = EffectTerm(self.kind, self.where, tuple(coordinates), fixed, self.plan.numbers, tuple(anew))
        return term, start


#: Strength of a probe as a share of the typical one.
PROBE_SHARE = 0.05

#: Unit, least and greatest value of a number of a kind.
Ranges = Callable[[str, str], tuple[str, float, float]]


def core_ranges() -> Ranges:
    """The ranges that the core's registry allows."""
    from bha.parameters.effect import EFFECT_KINDS  # noqa: PLC0415  (the registry is read once)

    table = {
        (kind.kind, number.name): (number.unit, number.low, number.high)
        for kind in EFFECT_KINDS.values()
        for number in kind.parameters
    }

    def ranges(kind: str, name: str) -> tuple[str, float, float]:
        return table.get((kind, name), ("", -math.inf, math.inf))

    return ranges


def places(plan: KindPlan, core: Mapping[str, Any]) -> list[str]:
    """Where the kind may sit on an arm, largest places first."""
    sections = core["section"]
    result: list[str] = []
    for sort in plan.sorts:
        if sort in ("all", "sensors"):
            result.append(sort)
        elif sort == "tip":
            result.append(f"section {len(sections)}")
        elif sort == "section":
            count = len(sections) - (1 if plan.kind == "section_coupling" else 0)
            if count > 1 or "all" not in plan.sorts:
                result += [f"section {i + 1}" for i in range(count)]
        elif sort == "bellows":
            result += [bellows_place(i, k) for i, s in enumerate(sections) for k in range(len(s["bellows"]))]
        elif sort == "length":
            # Sensors of single lengths are modelled where these are the coordinates.
            result += [bellows_place(i, k) for i, s in enumerate(sections) if _are_coordinates(s) for k in range(3)]
        elif sort == "input":
            result += [f"input {name}" for name in core["inputs"]]
    return result


def _are_coordinates(section: Mapping[str, Any]) -> bool:
    return are_standard_bellows([(b["angle"], b["radius"]) for b in section["bellows"]], section["bellows_radius"])


def bellows_place(section: int, bellows: int) -> str:
    """``bellows 32`` for indices from 0."""
    separator = "_" if section > 8 or bellows > 8 else ""
    return f"bellows {section + 1}{separator}{bellows + 1}"


def members(where: str, sort: str, core: Mapping[str, Any]) -> list[str]:
    """The places of sort ``sort`` that make up the place ``where``."""
    sections = core["section"]
    chosen = range(len(sections))
    if where.startswith("section "):
        chosen = range(int(where.split()[1]) - 1, int(where.split()[1]))
    elif where.startswith(("bellows ", "input ")):
        return [where]
    if sort == "bellows":
        return [bellows_place(i, k) for i in chosen for k in range(len(sections[i]["bellows"]))]
    if sort == "section":
        return [f"section {i + 1}" for i in chosen]
    if sort == "input":
        found = [int(b["input"]) for i in chosen for b in sections[i]["bellows"]]
        return [f"input {core['inputs'][j]}" for j in dict.fromkeys(found)]
    return [where]


def nested(first: str, second: str, core: Mapping[str, Any]) -> bool:
    """Whether one of two places of the same sort of effect lies within the other."""
    sort = "input" if "input" in f"{first} {second}" else "bellows"
    a, b = (set(members(where, sort, core)) for where in (first, second))
    return a <= b or b <= a


TAU_GRID = (0.1, 0.35, 1.2, 4.0, 15.0)
#: Directions of walls, rad.
DIRECTIONS = tuple(k * math.pi / 4.0 for k in range(8))
PAYLOAD_PROBE, PAYLOAD_OFFSET = 0.01, 0.05
HOSE_PROBE, HOSE_REACH = 0.5, 0.3
#: A time constant that is none, s.
AT_ONCE = 1e-4


def _payload_start(strengths: Sequence[float], shape: Numbers) -> dict[str, float]:
    """Mass and place from the strengths of the four probes: a mass at the head's origin, and shifted along x, y, z."""
    mass = float(sum(strengths))
    if abs(mass) < 1e-3:
        return {"mass": math.copysign(1e-3, mass)}
    shift = {a: PAYLOAD_OFFSET * float(s) / mass for a, s in zip("xyz", strengths[1:], strict=True)}
    return {"mass": min(max(mass, -0.3), 1.0), **{a: min(max(v, -0.1), 0.1) for a, v in shift.items()}}


def _hose_start(strengths: Sequence[float], shape: Numbers) -> dict[str, float]:
    """Spring and anchor from the strengths of its probes, anchored at the origin and shifted along x, y, z."""
    stiffness = float(sum(strengths[:4]))
    if stiffness < 0.5:
        return {"stiffness": 0.5, "damping": max(0.0, float(strengths[4])), "drag": max(0.0, float(strengths[5]))}
    anchor = [min(max(HOSE_REACH * float(s) / stiffness, -2.0), 2.0) for s in strengths[1:4]]
    return {
        "stiffness": stiffness,
        "damping": max(0.0, float(strengths[4])),
        "drag": max(0.0, float(strengths[5])),
        "anchor_x": anchor[0],
        "anchor_y": anchor[1],
        "anchor_z": anchor[2],
    }


def _payload_probes(shape: Numbers) -> list[tuple[dict[str, float], float]]:
    places: list[dict[str, float]] = [{}, *({a: PAYLOAD_OFFSET} for a in "xyz")]
    return [({"mass": PAYLOAD_PROBE, **place}, PAYLOAD_PROBE) for place in places]


def _hose_probes(shape: Numbers) -> list[tuple[dict[str, float], float]]:
    nothing = {"stiffness": 0.0, "damping": 0.0, "drag": 0.0}
    anchors: list[dict[str, float]] = [{}, *({f"anchor_{a}": HOSE_REACH} for a in "xyz")]
    springs = [({**nothing, "stiffness": HOSE_PROBE, **anchor}, HOSE_PROBE) for anchor in anchors]
    return [*springs, ({**nothing, "damping": 0.02}, 0.02), ({**nothing, "drag": 0.02}, 0.02)]


def _lag_probes(shape: Numbers) -> list[tuple[dict[str, float], float]]:
    """Filling alone and venting alone behind, the other at once."""
    tau = shape["tau"]
    return [({"fill": tau, "vent": AT_ONCE}, 1.0), ({"fill": AT_ONCE, "vent": tau}, 1.0)]


def _lag_start(strengths: Sequence[float], shape: Numbers) -> dict[str, float]:
    fill, vent = (shape["tau"] * min(max(float(s), 0.1), 3.0) for s in strengths)
    return {"fill": fill, "vent": vent}


def _torsion_probes(shape: Numbers) -> list[tuple[dict[str, float], float]]:
    return [({"stiffness": shape["trial"]}, 1.0)]


def _torsion_start(strengths: Sequence[float], shape: Numbers) -> dict[str, float]:
    return {"stiffness": shape["trial"] / min(max(float(strengths[0]), 1e-3), 1e3)}


def _wall(numbers: Mapping[str, float]) -> dict[str, float]:
    """The wall of the file from its direction (angle about z) and its distance from the base's axis."""
    angle, distance = numbers["angle"], numbers["distance"]
    c, s = math.cos(angle), math.sin(angle)
    rest = {k: v for k, v in numbers.items() if k not in ("angle", "distance")}
    return {
        **rest,
        "wall_x": distance * c,
        "wall_y": distance * s,
        "wall_z": 0.0,
        "normal_x": -c,
        "normal_y": -s,
        "normal_z": 0.0,
    }


BELLOWS = ("all", "section", "bellows")
SECTION = ("all", "section")
INPUT = ("all", "section", "input")

PLANS: tuple[KindPlan, ...] = (
    KindPlan(
        "creep",
        BELLOWS,
        (Strength("stiffness", 100.0),),
        (Shape("tau", TAU_GRID),),
        parts="bellows",
        passive=("stiffness",),
        further=lambda old: [{"tau": 5.0 * old["tau"]}, {"tau": 0.2 * old["tau"]}],
        adding=("stiffness",),
    ),
    KindPlan(
        "hysteresis",
        BELLOWS,
        (Strength("amplitude", 3.0),),
        (Shape("yield", (2e-3, 6e-3, 15e-3), low=8e-4),),
        parts="bellows",
        passive=("amplitude",),
        further=lambda old: [{"yield": 3.0 * old["yield"]}, {"yield": old["yield"] / 3.0}],
        adding=("amplitude",),
    ),
    KindPlan(
        "friction",
        BELLOWS,
        (Strength("coulomb_force", 2.0),),
        fixed={"stribeck_velocity": 0.01},
        parts="bellows",
        passive=("coulomb_force",),
        extra=(
            Shape("presliding", (3e-4,), low=2e-5, high=1e-3),
            Shape("static_ratio", (1.2,), logarithmic=False, spread=0.3, high=2.5),
        ),
    ),
    KindPlan("quadratic_damping", BELLOWS, (Strength("damping", 60.0),), parts="bellows", passive=("damping",)),
    KindPlan("bending_damping", SECTION, (Strength("damping", 0.1),), parts="section", passive=("damping",)),
    KindPlan("bending_nonlinear", SECTION, (Strength("cubic_stiffness", 3.0, signed=True),), parts="section"),
    KindPlan(
        "section_coupling",
        SECTION,
        (Strength("stiffness", 1.0), Strength("damping", 0.05)),
        passive=("stiffness", "damping"),
    ),
    KindPlan(
        "effective_area",
        SECTION,
        (Strength("by_pressure", 1e-6, signed=True), Strength("by_length", 1.0, signed=True)),
        parts="section",
    ),
    KindPlan("weak_bellows", ("bellows",), (Strength("change", 0.15, signed=True),)),
    KindPlan(
        "payload",
        ("section",),
        (Strength("mass", 0.1, signed=True),),
        extra=tuple(Shape(a, (0.0,), logarithmic=False, spread=0.05) for a in "xyz"),
        probes=_payload_probes,
        begin=_payload_start,
    ),
    KindPlan("base_tilt", ("all",), (Strength("about_x", 0.05, signed=True), Strength("about_y", 0.05, signed=True))),
    KindPlan(
        "tool_drag",
        ("tip",),
        (Strength("stiffness", 10.0), Strength("damping", 0.5), Strength("drag", 0.2)),
        extra=tuple(Shape(f"anchor_{a}", (0.0,), logarithmic=False, spread=0.5) for a in "xyz"),
        passive=("stiffness", "damping", "drag"),
        probes=_hose_probes,
        begin=_hose_start,
    ),
    KindPlan(
        "contact",
        ("section",),
        (Strength("stiffness", 500.0),),
        (
            Shape("angle", DIRECTIONS, logarithmic=False, spread=0.3),
            Shape("distance", (0.7, 0.85), logarithmic=False, spread=0.02),
        ),
        passive=("stiffness",),
        extra=(Shape("damping", (1.0,), spread=1.5), Shape("rounding", (1e-3,), low=1e-4, high=0.05)),
        numbers=_wall,
    ),
    KindPlan("work_conjugate", ("all",), ()),
    KindPlan(
        "pressure_lag",
        INPUT,
        (),
        parts="input",
        extra=(Shape("fill", (0.06,)), Shape("vent", (0.06,))),
        grid=(Shape("tau", (0.01, 0.04, 0.15, 0.6)),),
        probes=_lag_probes,
        begin=_lag_start,
        further=lambda old: [{"tau": 0.25 * math.sqrt(old["fill"] * old["vent"])}],
        adding=("fill", "vent"),
    ),
    KindPlan("delay", ("all",), (Strength("time", 0.02),)),
    KindPlan("valve_dead_band", INPUT, (), (Shape("band", (300.0, 1000.0, 3000.0, 8000.0)),), parts="input"),
    KindPlan("pressure_offset", ("input",), (Strength("offset", 2e3, signed=True),)),
    KindPlan("pressure_gain", ("input",), (Strength("gain", 0.05, signed=True),)),
    KindPlan("length_offset", ("length",), (Strength("offset", 3e-3, signed=True),), needs_lengths=True),
    KindPlan("length_gain", ("length",), (Strength("gain", 0.03, signed=True),), needs_lengths=True),
    KindPlan(
        "torsion",
        SECTION,
        (),
        parts="section",
        extra=(Shape("stiffness", (10.0,)),),
        grid=(Shape("trial", (10.0,)),),
        probes=_torsion_probes,
        begin=_torsion_start,
        needs_heads=True,
    ),
    KindPlan(
        "non_constant_curvature", SECTION, (Strength("asymmetry", 0.2, signed=True),), parts="section", needs_heads=True
    ),
)


def available(kinds: Sequence[str] | None = None) -> list[KindPlan]:
    """The plans of the kinds that the core knows, or of those among ``kinds``.

    Raises:
        InputError: one of ``kinds`` has no plan.
    """
    from bha.parameters.effect import EFFECT_KINDS  # noqa: PLC0415  (the registry is read once)

    known = [plan for plan in PLANS if plan.kind in EFFECT_KINDS]
    if kinds is None:
        return known
    names = [plan.kind for plan in known]
    for kind in kinds:
        if kind not in names:
            raise InputError(f"kinds: {kind!r} is no candidate; allowed: {', '.join(names)}")
    return [plan for plan in known if plan.kind in kinds]
