"""The candidates: every kind of effect, where it may sit, how its signature is probed, and how its numbers are fitted.

What: one :class:`KindPlan` a kind. Kinds, places and the ranges of the numbers come from the core's registry; here is
only what a search needs beside it: which numbers the outputs are linear in (strengths), on which grid those that do not
exist without the effect are tried (shapes: time constants, yields, wall places), and what is plausible.
Source: kinds and forms `rust/src/effects/kinds`; magnitudes as in `docs/explanation/diagnosis.md`.
Convention: a *probe* is an effect at small strength; its signature is the change of the outputs per unit of strength.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from bha.diagnosis.plan import PLACES, KindPlan, Numbers, Shape, Strength
from bha.errors import InputError
from bha.parameters import EFFECT_KINDS

TAU_GRID = (0.1, 0.35, 1.2, 4.0, 15.0)
#: Yields of elements that slip at once.
YIELD_GRID = (1e-3, 2.5e-3, 6e-3, 15e-3, 40e-3)
#: Directions of walls, rad.
DIRECTIONS = tuple(k * math.pi / 4.0 for k in range(8))
#: Planes of bending, rad.
PLANES = tuple(k * math.pi / 4.0 for k in range(4))
#: Stiffest spring of a hose, N/m, as the core allows.
STIFFEST_HOSE = 1e4
PAYLOAD_PROBE, PAYLOAD_OFFSET = 0.01, 0.05
HOSE_PROBE, HOSE_REACH = 0.5, 0.3
#: How far a base plausibly leans that was put up by eye, rad, and a marker stands from where the file has it, m: what
#: leans or stands farther off is seen, and stands in for what is not.
TILT, MARKER = 0.1, 0.02
#: The kind of a band, and the deviations of the pressures' noise that lie within one that takes it off.
BAND, BAND_NOISES = "valve_dead_band", 4.0
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
    stiffness = min(float(sum(strengths[:PLACES])), STIFFEST_HOSE)
    if stiffness < 0.5:
        # Less than none, linearly, of a hose that holds the arm fast: a fit begins far below it, and in its scale.
        return {
            "stiffness": max(0.5, -0.1 * stiffness),
            "damping": max(0.0, float(strengths[4])),
            "drag": max(0.0, float(strengths[5])),
        }
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
        bank=tuple({"tau": tau} for tau in TAU_GRID),
    ),
    KindPlan(
        "hysteresis",
        BELLOWS,
        (Strength("amplitude", 3.0),),
        (Shape("yield", (2e-3, 6e-3, 15e-3), low=8e-4),),
        parts="bellows",
        passive=("amplitude",),
        further=lambda old: [{**old, "yield": factor * old["yield"]} for factor in (3.0, 1.0 / 3.0)],
        adding=("amplitude",),
        bank=tuple({"yield": reach, "sharpness": 1.0} for reach in YIELD_GRID),
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
    # Where a cube is not all that it grows by.
    KindPlan(
        "bending_nonlinear",
        SECTION,
        (Strength("cubic_stiffness", 3.0, signed=True), Strength("quintic_stiffness", 3.0, signed=True)),
        parts="section",
    ),
    KindPlan(
        "bending_anisotropy",
        SECTION,
        (Strength("stiffness", 1.0),),
        (Shape("angle", PLANES, logarithmic=False, spread=0.4),),
        parts="section",
        passive=("stiffness",),
    ),
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
    # Of springs, pressure changes what it does of areas by length; of bending it is told.
    KindPlan("pressure_stiffness", SECTION, (Strength("bending", 1e-6, signed=True),), parts="section"),
    KindPlan("weak_bellows", ("bellows",), (Strength("change", 0.15, signed=True),)),
    KindPlan(
        "payload",
        ("section",),
        (Strength("mass", 0.1, signed=True),),
        extra=tuple(Shape(a, (0.0,), logarithmic=False, spread=0.05) for a in "xyz"),
        probes=_payload_probes,
        begin=_payload_start,
    ),
    KindPlan(
        "base_tilt", ("all",), tuple(Strength(f"about_{axis}", 0.05, signed=True, plausible=TILT) for axis in "xy")
    ),
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
        (Strength("stiffness", 500.0, hard=True),),
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
        forward=True,
        further=lambda old: [{"tau": 0.25 * math.sqrt(old["fill"] * old["vent"])}],
        adding=("fill", "vent"),
    ),
    KindPlan("delay", ("all", "input"), (Strength("time", 0.02),), parts="input"),
    # Where heads alone are measured, late inputs are the same.
    KindPlan("delay", ("heads",), (Strength("time", 0.02),), needs_heads=True, needs_lengths=True),
    KindPlan(BAND, INPUT, (), (Shape("band", (300.0, 1000.0, 3000.0, 8000.0)),), parts="input"),
    KindPlan("pressure_offset", ("input",), (Strength("offset", 2e3, signed=True),)),
    KindPlan("pressure_gain", ("input",), (Strength("gain", 0.05, signed=True),)),
    KindPlan("leak", INPUT, (Strength("drop", 2e3),), parts="input"),
    KindPlan("length_offset", ("length",), (Strength("offset", 3e-3, signed=True),), needs_lengths=True),
    KindPlan("length_gain", ("length",), (Strength("gain", 0.03, signed=True),), needs_lengths=True),
    KindPlan("wire_backlash", ("length",), (Strength("play", 1e-3),), needs_lengths=True),
    KindPlan(
        "marker_offset",
        ("section",),
        tuple(Strength(axis, 0.01, signed=True, plausible=MARKER) for axis in "xyz"),
        needs_heads=True,
    ),
    KindPlan(
        "torsion",
        SECTION,
        (Strength("twist_per_length", 1.0, signed=True),),
        parts="section",
        needs_heads=True,
    ),
    KindPlan(
        "torsion",
        SECTION,
        (),
        parts="section",
        extra=(Shape("stiffness", (10.0,)),),
        grid=(Shape("trial", (10.0,)),),
        probes=_torsion_probes,
        begin=_torsion_start,
        forward=True,
        needs_heads=True,
    ),
    # Lengths see it by the weights' lever arms alone, and then as something else.
    KindPlan("taper", SECTION, (Strength("change", 0.2, signed=True),), parts="section", needs_heads=True),
    KindPlan("distributed_mass", SECTION, (Strength("share", 0.2),), parts="section"),
)


def available(kinds: Sequence[str] | None = None) -> list[KindPlan]:
    """The plans of the kinds that the core knows, or of those among ``kinds``.

    Raises:
        InputError: one of ``kinds`` has no plan.
    """
    known = [plan for plan in PLANS if plan.kind in EFFECT_KINDS]
    if kinds is None:
        return known
    names = [plan.kind for plan in known]
    for kind in kinds:
        if kind not in names:
            raise InputError(f"kinds: {kind!r} is no candidate; allowed: {', '.join(names)}")
    return [plan for plan in known if plan.kind in kinds]


def beyond_noise(plans: Sequence[KindPlan], noise: float) -> list[KindPlan]:
    """The plans without bands that are a filter of what pressures are read with, ``noise``, Pa.

    A narrower band takes noise off whatever the valves do: an arm that noise makes ring is predicted better with it.
    """
    least = BAND_NOISES * noise
    return [
        replace(plan, shapes=tuple(_above(s, least) for s in plan.shapes)) if plan.kind == BAND else plan
        for plan in plans
    ]


def _above(shape: Shape, least: float) -> Shape:
    """The shape with no value below some; that one is tried where the grid has none beyond it."""
    return replace(shape, grid=tuple(v for v in shape.grid if v > least) or (least,), low=max(shape.low, least))
