"""True arms: one to three sections of three to five bellows that may share inputs, heavy and ringing or of fabric and
overdamped, hanging, lying or upright.

Numbers follow from what an arm is to do: at full pressure a bellows lengthens by a third of its rest length or its
section bends by a radian, whichever is less; a section carries what is beyond it without falling over.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..armfile import SLICES
from ..hidden import no_hidden
from ..plant import (
    P_BENDING,
    P_CENTER,
    P_COLUMNS,
    P_INERTIA,
    P_MASS,
    P_RADIUS,
    P_REST,
    P_SLICED,
    Plant,
)
from . import bellows as b
from .integrate import Arm

Array = NDArray[np.float64]

REGIMES = ("ringing", "fabric")
MOUNTINGS = ("hanging", "lying", "upright")
GRAVITY = 9.81
# One arm in three has springs that harden exponentially, one in three has mass along its arcs.
HARDENED, SLICED = 1 / 3, 1 / 3


@dataclass(frozen=True)
class Bellows:
    """Place of one bellows, and the input that feeds it."""

    angle: float  # rad
    radius: float  # m
    input: str


@dataclass(frozen=True)
class Section:
    """One section; SI units. All its bellows are alike."""

    mass: float
    inertia: tuple[float, float, float]
    radius: float
    outer_radius: float
    area: float
    rest_length: float
    stiffness: tuple[float, float, float]
    damping: float
    bending: tuple[float, float]
    hardening: tuple[float, float]  # stiffness and length of an exponential hardening
    sliced: float  # share of the mass that lies along the arc
    length_range: tuple[float, float]
    pressure_range: tuple[float, float]  # absolute
    bellows: tuple[Bellows, ...]


@dataclass(frozen=True)
class TrueArm:
    """A true arm without anything hidden."""

    regime: str
    mounting: str
    gravity: tuple[float, float, float]
    ambient: float
    force_model: str
    sections: tuple[Section, ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs in the order in which they first appear."""
        return tuple(dict.fromkeys(x.input for s in self.sections for x in s.bellows))

    def fed_by(self, name: str) -> list[int]:
        """Bellows that an input feeds, counted from 0 along the arm."""
        return [j for j, x in enumerate(x for s in self.sections for x in s.bellows) if x.input == name]

    def standard(self, section: int) -> bool:
        """Whether a section (from 0) has three bellows at 0, 120 and 240 degrees on the section's radius."""
        s = self.sections[section]
        return len(s.bellows) == 3 and all(
            abs(x.angle - 2.0 * np.pi * k / 3.0) < 1e-12 and x.radius == s.radius for k, x in enumerate(s.bellows)
        )


def solid_inertia(mass: float, radius: float, outer: float, length_range: tuple[float, float]) -> tuple[float, ...]:
    """Moments of inertia of a solid cylinder of the section's size, (56) of the paper."""
    whole, length = radius + outer, 0.5 * (length_range[0] + length_range[1])
    side = mass * (0.25 * whole**2 + length**2 / 12.0)
    return side, side, 0.5 * mass * whole**2


def _layout(
    rng: np.random.Generator, section: int, count: int, shared: bool, turned: bool, radius: float
) -> tuple[Bellows, ...]:
    """Bellows evenly around, from 0 or from anywhere on; where inputs are shared, the last ones are fed by the
    first."""
    first = float(rng.uniform(0.0, 2.0 * np.pi)) if turned else 0.0
    inputs = max(3, count - 1) if shared and count > 3 else count
    return tuple(
        Bellows(first + 2.0 * np.pi * k / count, radius, f"p{section + 1}{k % inputs + 1}") for k in range(count)
    )


def _section(
    rng: np.random.Generator, regime: str, number: int, layout: tuple[int, bool, bool], *, hardened: bool, sliced: bool
) -> Section:
    count, shared, turned = layout
    taper = 0.9**number
    if regime == "ringing":
        mass, radius = rng.uniform(0.3, 0.9) * taper, rng.uniform(0.06, 0.10) * taper
        rest, full = rng.uniform(0.12, 0.20), rng.uniform(0.5e5, 1.0e5)
        lowest, stiffness, bend = -0.25e5, rng.uniform(700.0, 1800.0) * taper, rng.uniform(0.1, 0.5)
    else:
        mass, radius = rng.uniform(0.08, 0.35) * taper, rng.uniform(0.025, 0.05) * taper
        rest, full = rng.uniform(0.12, 0.28), rng.uniform(0.8e5, 2.0e5)
        lowest, stiffness, bend = 0.0, rng.uniform(800.0, 5000.0) * taper, rng.uniform(0.1, 1.0)
    # Sum of (r cos a)^2 over evenly placed bellows.
    about = 0.5 * count * radius**2
    bending = bend * about * stiffness
    reach = min(0.33 * rest, 1.0 * (about * stiffness + bending) / (radius * stiffness))
    area = reach * stiffness / full
    # The damping ratio of the stretching mode where it rings, a relaxation time of the bellows where it does not.
    damping = (
        2.0 * rng.uniform(0.05, 0.15) * float(np.sqrt(stiffness * mass / count))
        if regime == "ringing"
        else stiffness * float(np.exp(rng.uniform(np.log(0.08), np.log(0.6))))
    )
    second, third = rng.uniform(-1.0, 2.0) * stiffness, rng.uniform(0.0, 8.0) * stiffness
    along, hard = rng.uniform(0.1, 0.4), (rng.uniform(0.15, 0.5) * stiffness, rng.uniform(0.25, 0.5) * rest)
    lengths = (0.6 * rest, 1.7 * rest)
    outer = 0.3 * radius
    inertia = solid_inertia(mass, radius, outer, lengths)
    return Section(
        mass=float(mass),
        inertia=(inertia[0], inertia[1], inertia[2]),
        radius=float(radius),
        outer_radius=float(outer),
        area=float(area),
        rest_length=float(rest),
        stiffness=(float(stiffness), float(second), 0.0 if hardened else float(third)),
        damping=float(damping),
        bending=(float(bending), 0.0),
        hardening=(float(hard[0]), float(hard[1])) if hardened else (0.0, 0.0),
        sliced=float(along) if sliced else 0.0,
        length_range=lengths,
        pressure_range=(101325.0 + lowest, 101325.0 + full),
        bellows=_layout(rng, number, count, shared, turned, float(radius)),
    )


def _carry(sections: list[Section], mounting: str) -> list[Section]:
    """Stiffen sections, area and damping with them, until each carries what lies beyond it."""
    wanted = {"hanging": 0.0, "lying": 3.0, "upright": 4.0}[mounting]
    done: list[Section] = []
    for i, s in enumerate(sections):
        moment, reach = 0.0, 0.0
        for above in sections[i:]:
            reach += above.rest_length
            moment += above.mass * GRAVITY * (reach if mounting == "lying" else 0.7 * reach)
        own = 0.5 * len(s.bellows) * s.radius**2 * s.stiffness[0] + s.bending[0]
        factor = max(1.0, wanted * moment / own)
        done.append(
            replace(
                s,
                stiffness=(s.stiffness[0] * factor, s.stiffness[1] * factor, s.stiffness[2] * factor),
                bending=(s.bending[0] * factor, s.bending[1]),
                hardening=(s.hardening[0] * factor, s.hardening[1]),
                area=s.area * factor,
                damping=s.damping * (factor if s.damping > 0.05 * s.stiffness[0] else factor**0.5),
            )
        )
    return done


def draw_arm(
    rng: np.random.Generator, sections: int, regime: str, mounting: str, layout: tuple[int, bool, bool]
) -> TrueArm:
    """Draw an arm; ``layout`` is the number of bellows a section, whether inputs are shared, and whether the first
    bellows of each section stands anywhere instead of at 0 degrees.
    """
    hardened, sliced = bool(rng.random() < HARDENED), bool(rng.random() < SLICED)
    drawn = [_section(rng, regime, i, layout, hardened=hardened, sliced=sliced) for i in range(sections)]
    rows = _carry(drawn, mounting)
    side = rng.uniform(0.0, 2.0 * np.pi)
    gravity = {
        "hanging": (0.0, 0.0, GRAVITY),
        "upright": (0.0, 0.0, -GRAVITY),
        "lying": (GRAVITY * float(np.cos(side)), GRAVITY * float(np.sin(side)), 0.0),
    }[mounting]
    # The paper's forces do not conserve energy: an arm that does not hang need not be stable with them. The implicit
    # method of overdamped arms asks for symmetric forces.
    paper = mounting == "hanging" and regime == "ringing" and rng.random() < 0.5
    model = "end_force" if paper else "work_conjugate"
    ambient = float(rng.choice([101325.0, 101325.0, 95000.0, 85000.0]))
    shift = ambient - 101325.0
    rows = [replace(s, pressure_range=(s.pressure_range[0] + shift, s.pressure_range[1] + shift)) for s in rows]
    return TrueArm(regime, mounting, gravity, ambient, model, tuple(rows))


def build(arm: TrueArm, *, plain: bool = False) -> Arm:
    """The arrays of an arm without hidden physics; ``plain`` leaves out mass along the arcs and exponential hardening,
    which the product's model has no words for.
    """
    n = len(arm.sections)
    rows = np.zeros((n, P_COLUMNS))
    table = []
    inputs = arm.inputs
    for i, s in enumerate(arm.sections):
        rows[i, P_MASS] = s.mass
        rows[i, P_INERTIA : P_INERTIA + 3] = s.inertia
        rows[i, P_CENTER : P_CENTER + 3] = 0.0
        rows[i, P_RADIUS] = s.radius
        rows[i, P_REST] = s.rest_length
        rows[i, P_BENDING : P_BENDING + 2] = s.bending
        rows[i, P_SLICED] = 0.0 if plain else s.sliced
        for x in s.bellows:
            row = np.zeros(b.B_COLUMNS)
            row[b.B_SECTION] = i
            row[b.B_X], row[b.B_Y] = x.radius * np.cos(x.angle), x.radius * np.sin(x.angle)
            row[b.B_AREA], row[b.B_REST], row[b.B_DAMPING] = s.area, s.rest_length, s.damping
            row[b.B_STIFFNESS : b.B_STIFFNESS + 3] = s.stiffness
            row[b.B_INPUT] = inputs.index(x.input)
            row[b.B_HARDENING : b.B_HARDENING + 2] = (0.0, 0.0) if plain else s.hardening
            table.append(row)
    # Without area, springs and damping of its own this plant is mechanics only; the bellows come from the table.
    plant = Plant(rows, SLICES.copy(), arm.ambient, True)
    return Arm(plant, no_hidden(n, np.array(arm.gravity)), np.array(table), arm.ambient, arm.force_model == "end_force")
