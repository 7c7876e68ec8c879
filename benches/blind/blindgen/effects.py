"""The catalogue of hidden effects: where each may sit, how it is drawn, and how it is installed in the true arm.

Each kind has a *shape* (time constants, signs, places; drawn once) and an *amplitude* (one number that the
calibration of strength may scale between physical limits). ``install`` writes both into a
:class:`~blindgen.truth.Truth` and returns the parameters for the sealed answer; ``comparable`` among them are those a
diagnosis by a natural formula can be held against.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import hidden as h
from .plant import P_REST, P_STIFFNESS
from .truth import Truth

Array = NDArray[np.float64]
Shape = dict[str, Any]
Parameters = dict[str, float]


@dataclass(frozen=True)
class EffectKind:
    """One kind of the catalogue (or, ``known`` false, from outside it)."""

    name: str
    places: tuple[str, ...]  # of "all", "section", "bellows", "input"
    typical: float
    limits: tuple[float, float]
    unit: str
    draw: Callable[[np.random.Generator, "Context"], Shape]
    install: Callable[[Truth, str, Shape, float], Parameters]
    comparable: tuple[str, ...] = ()
    known: bool = True
    needs_heads: bool = False
    sections: tuple[int, ...] | None = None  # allowed sections, counted from 1; None: any


@dataclass(frozen=True)
class Context:
    """What drawing may look at: the plain arm's heads during a typical run (samples, n, 3), and the section it is
    for.
    """

    heads: Array
    section: int


@dataclass(frozen=True)
class HiddenEffect:
    """One effect of a case."""

    kind: str
    where: str
    shape: Shape
    amplitude: float
    parameters: Parameters = field(default_factory=dict)


def bellows_of(where: str, sections: int) -> list[int]:
    """Bellows (or input) numbers from 0 that a where-string names."""
    if where == "all":
        return list(range(3 * sections))
    word, number = where.split()
    if word == "section":
        i = int(number) - 1
        return [3 * i, 3 * i + 1, 3 * i + 2]
    digits = number.lstrip("p")
    return [3 * (int(digits[0]) - 1) + int(digits[1]) - 1]


def sections_of(where: str, sections: int) -> list[int]:
    """Section numbers from 0 that a where-string names."""
    return list(range(sections)) if where == "all" else [int(where.split()[1]) - 1]


def _sign(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def _nothing(rng: np.random.Generator, context: Context) -> Shape:
    return {}


def _count(truth: Truth) -> int:
    return int(truth.plant.sections.shape[0])


def _draw_creep(rng: np.random.Generator, context: Context) -> Shape:
    tau = float(np.exp(rng.uniform(np.log(0.15), np.log(1.5))))
    return {"tau_a": tau, "tau_b": tau * rng.uniform(2.5, 5.0), "share_a": rng.uniform(0.4, 0.7)}


def _creep(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    total = 0.0
    for j in bellows_of(where, _count(truth)):
        k = amplitude * truth.plant.sections[j // 3, P_STIFFNESS]
        row = truth.hidden.bellows[j]
        row[h.B_CREEP : h.B_CREEP + 4] = (
            k * shape["share_a"],
            shape["tau_a"],
            k * (1.0 - shape["share_a"]),
            shape["tau_b"],
        )
        total = k
    return {"share": amplitude, "stiffness_last": total, **shape}


def _draw_hysteresis(rng: np.random.Generator, context: Context) -> Shape:
    return {"yield": float(np.exp(rng.uniform(np.log(2e-3), np.log(10e-3))))}


def _hysteresis(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for j in bellows_of(where, _count(truth)):
        truth.hidden.bellows[j, h.B_SLIP : h.B_SLIP + 2] = (amplitude, shape["yield"])
    return {"force": amplitude, **shape}


def _draw_friction(rng: np.random.Generator, context: Context) -> Shape:
    return {
        "break_ratio": rng.uniform(1.0, 1.4),
        "stribeck_speed": rng.uniform(3e-3, 15e-3),
        "bristle": rng.uniform(0.1e-3, 0.4e-3),
    }


def _friction(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for j in bellows_of(where, _count(truth)):
        truth.hidden.bellows[j, h.B_BRISTLE : h.B_BRISTLE + 5] = (
            amplitude,
            amplitude * shape["break_ratio"],
            shape["stribeck_speed"],
            shape["bristle"],
            0.5,
        )
    return {"force": amplitude, **shape}


def _quadratic(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for j in bellows_of(where, _count(truth)):
        truth.hidden.bellows[j, h.B_POWER : h.B_POWER + 2] = (amplitude, 1.7)
    return {"factor": amplitude, "exponent": 1.7}


def _bending_damping(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for i in sections_of(where, _count(truth)):
        truth.hidden.sections[i, h.S_BENDING_DAMPING : h.S_BENDING_DAMPING + 2] = (amplitude, 0.2)
    return {"damping": amplitude, "growth": 0.2}


def _bending_nonlinear(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for i in sections_of(where, _count(truth)):
        truth.hidden.sections[i, h.S_BENDING_EXPONENTIAL : h.S_BENDING_EXPONENTIAL + 2] = (amplitude, shape["scale"])
    return {"moment": amplitude, **shape}


def _coupling(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    n = _count(truth)
    for i in range(n - 1) if where == "all" else sections_of(where, n):
        truth.hidden.sections[i, h.S_COUPLING : h.S_COUPLING + 2] = (amplitude, 0.02 * amplitude)
    return {"stiffness": amplitude, "damping": 0.02 * amplitude}


def _draw_area(rng: np.random.Generator, context: Context) -> Shape:
    variant = "pressure" if rng.random() < 0.5 else "length"
    return {"variant": variant, "sign": _sign(rng), "scale": rng.uniform(0.5e5, 1.0e5)}


def _area(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    value = shape["sign"] * amplitude
    for j in bellows_of(where, _count(truth)):
        if shape["variant"] == "pressure":
            truth.hidden.bellows[j, h.B_AREA : h.B_AREA + 2] = (value, shape["scale"])
        else:
            # Amplitude is the relative change over 0.1 m of elongation.
            truth.hidden.bellows[j, h.B_AREA + 2] = 10.0 * value
    if shape["variant"] == "pressure":
        return {"tanh_factor": value, "pressure_scale": shape["scale"]}
    return {"slope_per_m": 10.0 * value}


def _draw_weak(rng: np.random.Generator, context: Context) -> Shape:
    return {"sign": 1.0 if rng.random() < 0.7 else -1.0, "slope": rng.uniform(-2.0, 2.0)}


def _weak(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for j in bellows_of(where, _count(truth)):
        truth.hidden.bellows[j, h.B_WEAK : h.B_WEAK + 2] = (shape["sign"] * amplitude, shape["slope"])
    return {"loss": shape["sign"] * amplitude, "slope_per_m": shape["slope"]}


def _draw_payload(rng: np.random.Generator, context: Context) -> Shape:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    side = rng.uniform(0.0, 0.05)
    return {"x": side * np.cos(angle), "y": side * np.sin(angle), "z": rng.uniform(0.02, 0.08)}


def _payload(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for i in sections_of(where, _count(truth)):
        truth.hidden.sections[i, h.S_PAYLOAD : h.S_PAYLOAD + 4] = (amplitude, shape["x"], shape["y"], shape["z"])
    return {"mass": amplitude, **shape}


def _draw_direction(rng: np.random.Generator, context: Context) -> Shape:
    return {"direction": rng.uniform(0.0, 2.0 * np.pi)}


def _tilt(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    g = truth.hidden.whole[:3].copy()
    axis = np.array([np.cos(shape["direction"]), np.sin(shape["direction"]), 0.0])
    c, s = np.cos(amplitude), np.sin(amplitude)
    turned = g * c + np.cross(axis, g) * s + axis * (axis @ g) * (1.0 - c)
    truth.hidden.whole[:3] = turned
    return {"angle": amplitude, **shape, "gravity_x": turned[0], "gravity_y": turned[1], "gravity_z": turned[2]}


def _draw_tool(rng: np.random.Generator, context: Context) -> Shape:
    angle, reach = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.15, 0.4)
    height = rng.uniform(0.1, 0.9) * float(np.mean(context.heads[:, -1, 2]))
    return {
        "anchor_x": reach * np.cos(angle),
        "anchor_y": reach * np.sin(angle),
        "anchor_z": height,
        "damping_time": rng.uniform(0.02, 0.1),
        "air": rng.uniform(0.05, 0.3),
    }


def _tool(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    anchor = (shape["anchor_x"], shape["anchor_y"], shape["anchor_z"])
    damping = amplitude * shape["damping_time"]
    truth.hidden.whole[h.W_TOOL : h.W_TOOL + 6] = (*anchor, amplitude, damping, shape["air"])
    return {"stiffness": amplitude, "damping": damping, **shape}


def _draw_contact(rng: np.random.Generator, context: Context) -> Shape:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    normal = np.array([np.cos(angle), np.sin(angle), 0.0])
    reach = context.heads[:, context.section] @ normal
    return {
        "normal_x": float(normal[0]),
        "normal_y": float(normal[1]),
        "normal_z": 0.0,
        "offset": float(np.quantile(reach, rng.uniform(0.70, 0.88))),
        "damping": rng.uniform(0.3, 1.5),
    }


def _contact(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for i in sections_of(where, _count(truth)):
        truth.hidden.sections[i, h.S_CONTACT : h.S_CONTACT + 6] = (
            shape["normal_x"],
            shape["normal_y"],
            shape["normal_z"],
            shape["offset"],
            amplitude,
            shape["damping"],
        )
    return {"hertz_stiffness": amplitude, **shape}


def _draw_lag(rng: np.random.Generator, context: Context) -> Shape:
    return {"vent_ratio": rng.choice([1.0, -1.0]) * rng.uniform(0.3, 1.0)}


def _lag(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    # Ratio of venting to filling between e^-1 and e: either may be the slower one.
    vent = amplitude * float(np.exp(shape["vent_ratio"]))
    for j in bellows_of(where, _count(truth)):
        truth.path.tau_fill[j], truth.path.tau_vent[j] = amplitude, vent
    return {"tau_fill": amplitude, "tau_vent": vent}


def _draw_delay(rng: np.random.Generator, context: Context) -> Shape:
    return {"variant": "inputs" if rng.random() < 0.6 else "sensors"}


def _delay(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    if shape["variant"] == "inputs":
        for j in bellows_of(where, _count(truth)):
            truth.path.delay[j] = amplitude
    else:
        truth.sensors.delay = amplitude
    return {"delay": amplitude}


def _band(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for j in bellows_of(where, _count(truth)):
        truth.path.band[j] = amplitude
    return {"band": amplitude}


def _draw_signed(rng: np.random.Generator, context: Context) -> Shape:
    return {"sign": _sign(rng)}


def _reading(group: str, field_name: str) -> Callable[[Truth, str, Shape, float], Parameters]:
    """Install an offset or a gain of one sensor; positive means it reads too high."""

    def install(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
        value = shape["sign"] * amplitude
        for j in bellows_of(where, _count(truth)):
            getattr(getattr(truth, group), field_name)[j] = value
        return {field_name: value}

    return install


def _other_model(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    truth.plant = truth.plant._replace(work_conjugate=not truth.plant.work_conjugate)
    return {}


def _draw_torsion(rng: np.random.Generator, context: Context) -> Shape:
    return {"sign": _sign(rng), "constant": rng.uniform(-0.05, 0.05)}


def _torsion(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    twist, constant = shape["sign"] * amplitude, shape["constant"] * amplitude
    for i in sections_of(where, _count(truth)):
        truth.hidden.sections[i, h.S_TORSION : h.S_TORSION + 2] = (twist, constant)
    rest = float(truth.plant.sections[0, P_REST])
    return {"twist_per_length": twist, "constant": constant, "zero_length": rest}


def _curvature(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    value = shape["sign"] * amplitude
    for i in sections_of(where, _count(truth)):
        truth.hidden.sections[i, h.S_SPLIT] = 0.5 * (1.0 + value)
    return {"imbalance": value}


def _draw_drift(rng: np.random.Generator, context: Context) -> Shape:
    return {"sign": _sign(rng), "time": rng.uniform(20.0, 90.0)}


def _drift(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for j in bellows_of(where, _count(truth)):
        truth.hidden.bellows[j, h.B_DRIFT : h.B_DRIFT + 2] = (shape["sign"] * amplitude, shape["time"])
    return {"relative": shape["sign"] * amplitude, "time": shape["time"]}


def _draw_periodic(rng: np.random.Generator, context: Context) -> Shape:
    return {
        "frequency": float(np.exp(rng.uniform(np.log(0.4), np.log(6.0)))),
        "phase": rng.uniform(0.0, 2.0 * np.pi),
        "direction": rng.uniform(0.0, 2.0 * np.pi),
    }


def _periodic(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    for i in sections_of(where, _count(truth)):
        truth.hidden.sections[i, h.S_PERIODIC : h.S_PERIODIC + 4] = (
            amplitude,
            shape["frequency"],
            shape["phase"],
            shape["direction"],
        )
    return {"force": amplitude, **shape}


def _chiral(truth: Truth, where: str, shape: Shape, amplitude: float) -> Parameters:
    n = _count(truth)
    for i in range(n - 1) if where == "all" else sections_of(where, n):
        truth.hidden.sections[i, h.S_CHIRAL] = shape["sign"] * amplitude
    return {"stiffness": shape["sign"] * amplitude}


_BELLOWS = ("all", "section", "bellows")
_SECTION = ("all", "section")
_INPUT = ("all", "section", "input")
_NEIGHBOURS = (1, 2)

_KINDS = (
    EffectKind("creep", _BELLOWS, 0.15, (0.01, 0.8), "1", _draw_creep, _creep),
    EffectKind("hysteresis", _BELLOWS, 4.0, (0.2, 40.0), "N", _draw_hysteresis, _hysteresis, ("force",)),
    EffectKind("friction", _BELLOWS, 2.0, (0.1, 20.0), "N", _draw_friction, _friction, ("force",)),
    EffectKind("quadratic_damping", _BELLOWS, 80.0, (3.0, 1500.0), "N/(m/s)^1.7", _nothing, _quadratic),
    EffectKind("bending_damping", _SECTION, 0.15, (0.01, 2.0), "N m s", _nothing, _bending_damping, ("damping",)),
    EffectKind(
        "bending_nonlinear",
        _SECTION,
        3.0,
        (0.1, 60.0),
        "N m",
        lambda rng, context: {"scale": rng.uniform(0.35, 0.6)},
        _bending_nonlinear,
    ),
    EffectKind(
        "section_coupling",
        _SECTION,
        1.0,
        (0.05, 12.0),
        "N m",
        _nothing,
        _coupling,
        ("stiffness",),
        sections=_NEIGHBOURS,
    ),
    EffectKind("effective_area", _SECTION, 0.06, (0.005, 0.6), "1", _draw_area, _area),
    EffectKind("weak_bellows", ("bellows",), 0.15, (0.01, 0.5), "1", _draw_weak, _weak, ("loss",)),
    EffectKind("payload", ("section",), 0.1, (0.005, 0.6), "kg", _draw_payload, _payload, ("mass",)),
    EffectKind("base_tilt", ("all",), 0.05, (0.005, 0.35), "rad", _draw_direction, _tilt, ("angle",)),
    EffectKind("tool_drag", ("all",), 10.0, (0.5, 150.0), "N/m", _draw_tool, _tool, ("stiffness",)),
    EffectKind("contact", ("section",), 8000.0, (300.0, 4e5), "N/m^1.5", _draw_contact, _contact, sections=(2, 3)),
    EffectKind("pressure_lag", _INPUT, 0.06, (0.003, 0.6), "s", _draw_lag, _lag, ("tau_fill", "tau_vent")),
    EffectKind("delay", ("all",), 0.02, (0.001, 0.12), "s", _draw_delay, _delay, ("delay",)),
    EffectKind("valve_dead_band", _INPUT, 2000.0, (100.0, 15e3), "Pa", _nothing, _band, ("band",)),
    EffectKind(
        "pressure_offset",
        ("input",),
        3000.0,
        (150.0, 40e3),
        "Pa",
        _draw_signed,
        _reading("path", "offset"),
        ("offset",),
    ),
    EffectKind("pressure_gain", ("input",), 0.06, (0.004, 0.5), "1", _draw_signed, _reading("path", "gain"), ("gain",)),
    EffectKind(
        "length_offset",
        ("bellows",),
        4e-3,
        (3e-4, 40e-3),
        "m",
        _draw_signed,
        _reading("sensors", "offset"),
        ("offset",),
    ),
    EffectKind(
        "length_gain", ("bellows",), 0.04, (2e-3, 0.25), "1", _draw_signed, _reading("sensors", "gain"), ("gain",)
    ),
    EffectKind("work_conjugate", ("all",), 1.0, (1.0, 1.0), "1", _nothing, _other_model),
    EffectKind("torsion", _SECTION, 1.5, (0.05, 12.0), "rad/m", _draw_torsion, _torsion, needs_heads=True),
    EffectKind("taper", _SECTION, 0.2, (0.01, 0.8), "1", _draw_signed, _curvature, needs_heads=True),
    EffectKind("stiffness_drift", _SECTION, 0.08, (0.005, 0.5), "1", _draw_drift, _drift, known=False),
    EffectKind("periodic_force", ("section",), 0.6, (0.02, 8.0), "N", _draw_periodic, _periodic, known=False),
    EffectKind(
        "twist_coupling", _SECTION, 1.0, (0.05, 12.0), "N m", _draw_signed, _chiral, known=False, sections=_NEIGHBOURS
    ),
)
EFFECTS = {kind.name: kind for kind in _KINDS}


def draw_place(kind: EffectKind, rng: np.random.Generator, sections: int = 3) -> str:
    """A where-string for the kind, its sorts of place evenly."""
    sort = kind.places[int(rng.integers(len(kind.places)))]
    allowed = [i for i in (kind.sections or range(1, sections + 1)) if i <= sections]
    i = allowed[int(rng.integers(len(allowed)))]
    k = int(rng.integers(1, 4))
    return {"all": "all", "section": f"section {i}", "bellows": f"bellows {i}{k}", "input": f"input p{i}{k}"}[sort]


def draw_effect(name: str, where: str | None, rng: np.random.Generator, heads: Array) -> HiddenEffect:
    """Draw the shape (and, unless given, the place) of an effect at its typical amplitude."""
    if name not in EFFECTS:
        raise ValueError(f"unknown effect kind {name!r}; known are {', '.join(sorted(EFFECTS))}")
    kind = EFFECTS[name]
    place = draw_place(kind, rng, heads.shape[1]) if where is None else where
    sort = place.split()[0]
    if sort not in kind.places:
        raise ValueError(f"{name} cannot sit at {place!r}; it may sit at: {', '.join(kind.places)}")
    section = int(place.split()[1]) - 1 if sort == "section" else heads.shape[1] - 1
    if sort == "section" and kind.sections is not None and section + 1 not in kind.sections:
        raise ValueError(f"{name} cannot sit at {place!r}; allowed sections: {', '.join(map(str, kind.sections))}")
    return HiddenEffect(name, place, kind.draw(rng, Context(heads, section)), kind.typical)


def install(truth: Truth, effect: HiddenEffect) -> tuple[Truth, HiddenEffect]:
    """A truth with the effect added, and the effect with its parameters filled in."""
    changed = truth.copy()
    parameters = EFFECTS[effect.kind].install(changed, effect.where, effect.shape, effect.amplitude)
    filled = HiddenEffect(effect.kind, effect.where, effect.shape, effect.amplitude, parameters)
    return changed, filled
