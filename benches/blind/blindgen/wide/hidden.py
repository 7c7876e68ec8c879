"""Hidden effects of the wide world: where each may sit, how it is drawn, and how it is installed.

An effect has a *shape* (time constants, exponents, signs; drawn once) and an *amplitude* (one number, relative to the
arm where that makes sense, that the calibration of strength scales within limits). Every form is another than the one a
diagnosis would naturally try: see :mod:`.bellows` and :mod:`blindgen.hidden`. Kinds that are *refused* stay out of the
catalogue for good, so that one can see whether the product keeps what it does not know.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from . import installers as put
from .arms import TrueArm
from .installers import Context, Numbers, Shape
from .truth import Truth

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kind:
    """One kind of hidden effect."""

    name: str
    places: tuple[str, ...]  # of "all", "section", "bellows", "input", "sensor"
    typical: float
    limits: tuple[float, float]
    draw: Callable[[np.random.Generator, Context], Shape]
    install: Callable[[Truth, TrueArm, str, Shape, float], Numbers]
    comparable: tuple[str, ...] = ()
    refused: bool = False
    needs: str = (
        ""  # "heads", "turning" heads, "lengths" (coordinates), "neighbour" (two sections), "paper" (end_force)
    )


@dataclass(frozen=True)
class Effect:
    """One effect of a case."""

    kind: str
    where: str
    shape: Shape
    amplitude: float
    parameters: Numbers = field(default_factory=dict)


_BELLOWS = ("all", "section", "bellows")
_SECTION = ("all", "section")
_INPUT = ("all", "section", "input")

_KINDS = (
    Kind("creep", _BELLOWS, 0.15, (0.005, 1.5), put.draw_creep, put.creep),
    Kind("hysteresis", _BELLOWS, 0.06, (0.002, 0.8), put.draw_yield, put.hysteresis, ("force",)),
    Kind("friction", _BELLOWS, 0.04, (0.002, 0.5), put.draw_friction, put.friction, ("force",)),
    Kind(
        "quadratic_damping",
        _BELLOWS,
        0.3,
        (0.005, 20.0),
        lambda rng, context: {"exponent": float(rng.choice([rng.uniform(1.4, 1.8), rng.uniform(2.2, 2.6)]))},
        put.power,
    ),
    Kind("bending_damping", _SECTION, 1.0, (0.02, 30.0), put.draw_nothing, put.bending_damping, ("damping",)),
    Kind(
        "bending_nonlinear",
        _SECTION,
        0.3,
        (0.01, 8.0),
        lambda rng, context: {"scale": float(rng.uniform(0.35, 0.6))},
        put.bending_nonlinear,
    ),
    Kind(
        "section_coupling",
        _SECTION,
        0.2,
        (0.01, 3.0),
        put.draw_nothing,
        put.coupling,
        ("stiffness",),
        needs="neighbour",
    ),
    Kind("effective_area", _SECTION, 0.08, (0.005, 0.5), put.draw_area, put.area),
    Kind("weak_bellows", ("bellows",), 0.15, (0.01, 0.5), put.draw_weak, put.weak, ("loss",)),
    Kind("payload", ("section",), 0.25, (0.01, 2.0), put.draw_payload, put.payload, ("mass",)),
    Kind("base_tilt", ("all",), 0.05, (0.004, 0.4), put.draw_direction, put.tilt, ("angle",)),
    Kind("tool_drag", ("all",), 0.1, (0.003, 2.0), put.draw_tool, put.tool, ("stiffness",)),
    Kind("contact", ("section",), 2.0, (0.05, 60.0), put.draw_contact, put.contact),
    Kind("pressure_lag", _INPUT, 0.08, (0.004, 1.5), put.draw_lag, put.lag, ("tau_fill", "tau_vent")),
    Kind("delay", ("all",), 0.03, (0.002, 0.25), put.draw_delay, put.delay, ("delay",)),
    Kind("valve_dead_band", _INPUT, 0.02, (0.001, 0.2), put.draw_nothing, put.band, ("band",)),
    Kind("pressure_offset", ("input",), 0.04, (0.002, 0.3), put.draw_sign, put.pressure_offset, ("offset",)),
    Kind("pressure_gain", ("input",), 0.06, (0.004, 0.5), put.draw_sign, put.pressure_gain, ("gain",)),
    Kind(
        "length_offset", ("sensor",), 0.02, (0.002, 0.2), put.draw_sign, put.length_offset, ("offset",), needs="lengths"
    ),
    Kind("length_gain", ("sensor",), 0.04, (0.002, 0.3), put.draw_sign, put.length_gain, ("gain",), needs="lengths"),
    Kind("torsion", _SECTION, 0.2, (0.01, 1.5), put.draw_sign, put.torsion, needs="turning"),
    Kind("taper", _SECTION, 0.2, (0.01, 0.8), put.draw_sign, put.curvature, needs="heads"),
    Kind("work_conjugate", ("all",), 1.0, (1.0, 1.0), put.draw_nothing, put.other_model, needs="paper"),
    Kind("one_sided_damping", _SECTION, 1.5, (0.05, 20.0), put.draw_nothing, put.one_sided, refused=True),
    Kind("supply_crosstalk", ("all",), 0.05, (0.002, 0.6), put.draw_sag, put.sag, refused=True),
    Kind("stiffness_drift", _SECTION, 0.08, (0.005, 0.5), put.draw_drift, put.drift, refused=True),
    Kind("periodic_force", ("section",), 0.1, (0.003, 2.0), put.draw_periodic, put.periodic, refused=True),
)
KINDS = {kind.name: kind for kind in _KINDS}


def feasible(kind: Kind, sections: int, sensors: str, paper: bool) -> bool:
    """Whether an arm of so many sections under such sensors can have the kind and show it."""
    return {
        "": True,
        "heads": sensors in ("heads", "poses"),
        # Torsion of the last section moves no head; only orientations show it.
        "turning": sensors == "poses" or (sensors == "heads" and sections > 1),
        "lengths": sensors == "coordinates",
        "neighbour": sections > 1,
        "paper": paper,
    }[kind.needs]


def draw_effect(name: str, rng: np.random.Generator, arm: TrueArm, heads: Array) -> Effect:
    """Draw place and shape of an effect at its typical amplitude."""
    kind = KINDS[name]
    sort = kind.places[int(rng.integers(len(kind.places)))]
    n = len(arm.sections)
    last = n - 1 if kind.needs == "neighbour" else n
    i = int(rng.integers(last))
    count = 3 if sort == "sensor" else len(arm.sections[i].bellows)
    k = int(rng.integers(count))
    if name == "torsion" and n > 1:
        i = int(rng.integers(n - 1))
    where = {
        "all": "all",
        "section": f"section {i + 1}",
        "bellows": f"bellows {i + 1}{k + 1}",
        "sensor": f"bellows {i + 1}{k + 1}",
        "input": f"input {arm.sections[i].bellows[k % len(arm.sections[i].bellows)].input}",
    }[sort]
    section = n - 1 if sort == "all" else i
    return Effect(name, where, kind.draw(rng, Context(arm, heads, section)), kind.typical)


def install(truth: Truth, arm: TrueArm, effect: Effect) -> tuple[Truth, Effect]:
    """A truth with the effect added, and the effect with its parameters filled in."""
    changed = truth.copy()
    numbers = KINDS[effect.kind].install(changed, arm, effect.where, effect.shape, effect.amplitude)
    return changed, Effect(effect.kind, effect.where, effect.shape, effect.amplitude, numbers)
