"""The model that is fitted: an arm's plain parameters and any number of effects, over one vector of coordinates.

What: every number that may change is a :class:`Coordinate`, which says how it enters the core's description of the arm
and how far it may plausibly be from its nominal value: the vector ``x`` counts in these distances, so that the prior is
a unit normal.
Source: plain parameters as in the paper's identification (section IV): mass and inertia (56), longitudinal stiffness
(Fig. 8), bending stiffness (Fig. 9), damping (Fig. 10).
Validity: the scale of all forces is set by the effective areas, which count as known unless the parameter file calls
them assumed.
"""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.arm.geometry import CameraFrame, camera_frame
from bha.parameters import Place

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.parameters.sensors import SensorsParameters

Array = NDArray[np.float64]
Core = dict[str, Any]

#: Plausible relative distance of a plain parameter from the file's value, one standard deviation.
MASS_SPREAD, INERTIA_SPREAD, STIFFNESS_SPREAD, DAMPING_SPREAD, BENDING_SPREAD, AREA_SPREAD = (
    0.15,
    0.3,
    0.3,
    0.6,
    0.4,
    0.2,
)
#: Plausible distance of the centre of mass along z and of the rest length, as a share of the rest length.
CENTER_SPREAD, REST_SPREAD = 0.08, 0.2
#: Where in the range of lengths the tangent stiffness is identified: as many terms of the polynomial as places. Numbers
#: at places stay positive and plausible where coefficients would not: a polynomial that turns soft beyond the data
#: lets the arm run away on other logs.
STIFFNESS_PLACES = (0.05, 0.35, 0.65, 0.95)
#: Least tangent stiffness, as a share of that at rest.
LEAST_STIFFNESS = 0.05


@dataclass(frozen=True)
class Coordinate:
    """One number of the model.

    Attributes:
        name: ``section 1 mass``, ``creep at bellows 32: tau``.
        unit: its unit.
        nominal: its value at x = 0.
        spread: one standard deviation of the prior, absolute, or of the logarithm.
        logarithmic: whether the value is ``nominal exp(spread x)``, else ``nominal + spread x``.
        low: least value.
        high: greatest value.
        path: where it stands in the core's description: section index and key, or effect index and key.
        prior: weight of the prior, 0 for none.
    """

    name: str
    unit: str
    nominal: float
    spread: float
    logarithmic: bool
    path: tuple[str | int, ...]
    low: float = -math.inf
    high: float = math.inf
    prior: float = 1.0

    @property
    def of_camera(self) -> bool:
        """Whether it says how heads are seen, not how they move."""
        return str(self.path[0]).startswith("camera_")

    def value(self, x: float) -> float:
        """The value at coordinate ``x``."""
        raw = (
            self.nominal * math.exp(min(self.spread * x, 50.0)) if self.logarithmic else self.nominal + self.spread * x
        )
        return min(max(raw, self.low), self.high)

    def coordinate(self, value: float) -> float:
        """The coordinate of ``value``."""
        value = min(max(value, self.low), self.high)
        if self.logarithmic:
            return math.log(max(value, 1e-300) / self.nominal) / self.spread
        return (value - self.nominal) / self.spread

    def slope(self, x: float) -> float:
        """Change of the value with the coordinate."""
        return self.spread * self.value(x) if self.logarithmic else self.spread

    def at_bound(self, x: float) -> bool:
        """Whether the value sits on a bound."""
        value = self.value(x)
        size = 1e-6 * max(abs(value), self.spread if not self.logarithmic else 0.0)
        return value <= self.low + size or value >= self.high - size


@dataclass(frozen=True)
class EffectTerm:
    """One effect in the model.

    Attributes:
        kind: as in a parameter file.
        where: as in a parameter file.
        coordinates: what is fitted.
        fixed: numbers that stay.
        numbers: what makes the numbers of the file from those that are fitted, where they are others (a wall's angle
            and distance).
        begin: coordinates from which they are fitted when nothing better is known.
    """

    kind: str
    where: str
    coordinates: tuple[Coordinate, ...]
    fixed: Mapping[str, float] = field(default_factory=dict)
    numbers: Callable[[Mapping[str, float]], dict[str, float]] = dict
    begin: tuple[float, ...] = ()

    @property
    def label(self) -> str:
        """``creep at bellows 32``."""
        return f"{self.kind} at {self.where}"

    def parameters(self, x: Sequence[float]) -> dict[str, float]:
        """Numbers by name at the coordinates ``x``."""
        values = {str(c.path[-1]): c.value(v) for c, v in zip(self.coordinates, x, strict=True)}
        return self.numbers({**self.fixed, **values})

    def on_bound(self, x: Array) -> set[str]:
        """Names of the numbers that sit on a bound at the coordinates ``x``."""
        return {str(c.path[-1]) for c, v in zip(self.coordinates, x, strict=True) if c.at_bound(float(v))}


@dataclass(frozen=True)
class Model:
    """An arm in coordinates: plain parameters first, then those of the effects.

    Attributes:
        core: the core's description of the arm at its nominal values, without the effects of this model.
        plain: the plain coordinates.
        effects: the effects.
        finer: the step of the integration, which was chosen for the plain arm, is divided by this.
        sensors: the file's, where coordinates of the camera are among the plain ones (:mod:`bha.diagnosis.camera`).
    """

    core: Core
    plain: tuple[Coordinate, ...]
    effects: tuple[EffectTerm, ...] = ()
    finer: int = 1
    sensors: SensorsParameters | None = None

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All of them, in the order of ``x``."""
        return (*self.plain, *(c for effect in self.effects for c in effect.coordinates))

    @property
    def size(self) -> int:
        """Length of ``x``."""
        return len(self.plain) + sum(len(e.coordinates) for e in self.effects)

    @property
    def sections(self) -> int:
        """Number of sections."""
        return len(self.core["section"])

    def with_effects(self, effects: Sequence[EffectTerm]) -> Model:
        """The same plain arm with other effects."""
        return replace(self, effects=tuple(effects))

    def with_plain(self, plain: Sequence[Coordinate], sensors: SensorsParameters) -> Model:
        """The same arm with other plain coordinates, those of its camera among them."""
        return replace(self, plain=tuple(plain), sensors=sensors)

    def sensors_at(self, x: Array) -> SensorsParameters | None:
        """The sensors with the camera that is seen by at ``x``; None where no coordinate moves it."""
        if self.sensors is None:
            return None
        vectors = {
            "camera_position": list(self.sensors.camera_position),
            "camera_rotation": list(self.sensors.camera_rotation_rad),
        }
        for coordinate, value in zip(self.plain, x, strict=False):
            if str(coordinate.path[0]) in vectors:
                vectors[str(coordinate.path[0])][int(coordinate.path[1])] = coordinate.value(float(value))
        return self.sensors.with_camera(vectors["camera_position"], vectors["camera_rotation"])

    def camera(self, x: Array) -> CameraFrame | None:
        """The frame in which heads are seen at ``x``; None for that of the file."""
        sensors = self.sensors_at(x)
        return None if sensors is None else camera_frame(sensors)

    def place(self, number: int) -> slice:
        """Where the coordinates of one effect stand in ``x``."""
        first = len(self.plain) + sum(len(e.coordinates) for e in self.effects[:number])
        return slice(first, first + len(self.effects[number].coordinates))

    def split(self, x: Array) -> tuple[Array, list[Array]]:
        """Plain coordinates, and those of each effect."""
        return x[: len(self.plain)], [x[self.place(k)] for k in range(len(self.effects))]

    def description(self, x: Array) -> Core:
        """The core's description at ``x``."""
        core = copy.deepcopy(self.core)
        plain, parts = self.split(x)
        for coordinate, value in zip(self.plain, plain, strict=True):
            if not coordinate.of_camera:
                set_plain(core, coordinate.path, coordinate.value(float(value)))
        effects = [
            {"kind": e.kind, "where": e.where, "parameters": e.parameters([float(v) for v in part])}
            for e, part in zip(self.effects, parts, strict=True)
        ]
        return with_effect_tables(core, effects)

    def arm(self, x: Array) -> str:
        """The same as text, what the core builds an arm from."""
        return json.dumps(self.description(x), allow_nan=False)

    def values(self, x: Array) -> dict[str, float]:
        """All values by name."""
        return {c.name: c.value(float(v)) for c, v in zip(self.coordinates, x, strict=True)}


def with_effect_tables(core: Core, effects: Sequence[Mapping[str, Any]]) -> Core:
    """``core`` with effects added to those it has."""
    return {**core, "effect": [*core.get("effect", []), *map(dict, effects)]} if effects else core


def set_plain(core: Core, path: tuple[str | int, ...], value: float) -> None:
    """Write one plain number into the core's description.

    ``("mass", i)`` moves the inertia along, since (56) is proportional to the mass. ``("rest_length", i, k)`` is that
    of one bellows. ``("tangent_stiffness", i, place)`` (see :func:`set_tangent_stiffness`), ``("damping", i)``,
    ``("rest_length", i)`` and ``("terminal_area", i)`` act on all bellows of the section, whose differences stay in
    proportion.
    """
    key, section = str(path[0]), core["section"][int(path[1])]
    if key == "mass":
        factor = value / section["mass"]
        section["mass"] = value
        section["inertia"] = [factor * entry for entry in section["inertia"]]
    elif key == "inertia":
        section["inertia"] = [value * entry for entry in section["inertia"]]
    elif key == "center_of_mass":
        # The logged force keeps acting where it did.
        section["force_point"] = section.get("force_point") or section["center_of_mass"]
        section["center_of_mass"] = [*section["center_of_mass"][:2], value]
    elif key == "bending_stiffness":
        section["bending_stiffness"] = [value, *section["bending_stiffness"][1:]]
    elif key == "rest_length" and len(path) > 2:
        section["bellows"][int(path[2])][key] = value
    elif key == "tangent_stiffness":
        set_tangent_stiffness(section, path[2], value)
    else:
        old = section["bellows"][0][key]
        for bellows in section["bellows"]:
            bellows[key] = bellows[key] * value / old if old else value


def stiffness_elongations(low: float, high: float, rest: float) -> tuple[float, ...]:
    """Elongations at which the tangent stiffness is identified, m, for a range of lengths and a nominal rest length."""
    return tuple(low + share * (high - low) - rest for share in STIFFNESS_PLACES)


def tangent_stiffness(stiffness: Sequence[float], elongation: float) -> float:
    """Slope of the spring force ``sum_m stiffness[m] x^(m + 1)``, N/m."""
    return sum((m + 1) * k * elongation**m for m, k in enumerate(stiffness))


def set_tangent_stiffness(section: Core, place: str | int, value: float) -> None:
    """Change the springs of a section: tangent stiffness ``value`` at one elongation, and as it was at the others.

    ``place`` names the elongations and which of them it is: ``"k x0 x1 ..."``.
    """
    number, *elongations = str(place).split()
    at = [float(x) for x in elongations]
    own = at.pop(int(number))
    # Lagrange's polynomial: one at its own elongation, zero at the others.
    shape = np.array([1.0])
    for other in at:
        shape = np.convolve(shape, np.array([-other, 1.0]) / (own - other))
    first = list(section["bellows"][0]["stiffness"])
    change = value - tangent_stiffness(first, own)
    for bellows in section["bellows"]:
        terms = [*bellows["stiffness"], *[0.0] * (len(shape) - len(bellows["stiffness"]))]
        scale = terms[0] / first[0] if first[0] else 1.0
        for m, weight in enumerate(shape):
            terms[m] += scale * change * float(weight) / (m + 1)
        bellows["stiffness"] = terms


def plain_model(arm: Arm) -> Model:
    """The model of an arm with its plain parameters free."""
    core = json.loads(arm.parameters.to_core_json())
    coordinates: list[Coordinate] = []
    for i, section in enumerate(core["section"]):
        coordinates += _plain_of_section(arm, i, section)
    return Model(core, tuple(coordinates))


def _plain_of_section(arm: Arm, i: int, section: Core) -> list[Coordinate]:
    bellows = section["bellows"][0]
    place = Place.of_section(i + 1)
    rest, stiffness = float(bellows["rest_length"]), [float(k) for k in bellows["stiffness"]]
    low, high = section["length_range"]

    def scaled(key: str, unit: str, nominal: float, spread: float, *more: str | int) -> Coordinate:
        return Coordinate(f"{place} {key}", unit, nominal, spread, True, (key, i, *more))

    found = [
        scaled("mass", "kg", float(section["mass"]), MASS_SPREAD),
        Coordinate(f"{place} inertia factor", "1", 1.0, INERTIA_SPREAD, True, ("inertia", i)),
        Coordinate(
            f"{place} center_of_mass z",
            "m",
            float(section["center_of_mass"][2]),
            CENTER_SPREAD * rest,
            False,
            ("center_of_mass", i),
        ),
        *_rest_lengths(arm, i, section),
        scaled("damping", "N s/m", max(float(bellows["damping"]), 1e-3), DAMPING_SPREAD),
    ]
    first = stiffness[0] if stiffness[0] > 0.0 else 1.0
    elongations = stiffness_elongations(low, high, rest)
    listed = " ".join(repr(x) for x in elongations)
    for number, elongation in enumerate(elongations):
        nominal = max(tangent_stiffness(stiffness, elongation), LEAST_STIFFNESS * first)
        name = f"{place} tangent stiffness at {1e3 * elongation:+.0f} mm"
        path = ("tangent_stiffness", i, f"{number} {listed}")
        found.append(Coordinate(name, "N/m", nominal, STIFFNESS_SPREAD, True, path))
    bending = float(section["bending_stiffness"][0])
    # Where the file has none, a tenth of what the bellows' springs make of a bend.
    size = bending if bending > 0.0 else 0.15 * first * float(section["bellows_radius"]) ** 2
    found.append(
        Coordinate(
            f"{place} bending_stiffness",
            "N m",
            bending,
            BENDING_SPREAD * size,
            False,
            ("bending_stiffness", i),
            low=0.0,
        )
    )
    stated = arm.parameters.sections[i].provenance.get("terminal_area")
    if stated is not None and stated.status == "assumed":
        found.append(scaled("terminal_area", "m^2", float(bellows["terminal_area"]), AREA_SPREAD))
    return found


def _rest_lengths(arm: Arm, i: int, section: Core) -> list[Coordinate]:
    """One for all bellows of the section, or one each where the file states one for each."""
    stated = arm.parameters.sections[i].bellows
    lengths = [float(b["rest_length"]) for b in section["bellows"]]
    chosen: list[tuple[Place, tuple[str | int, ...], float]] = [
        (Place.of_section(i + 1), ("rest_length", i), lengths[0])
    ]
    if stated is not None and all(bellows.rest_length is not None for bellows in stated):
        chosen = [(Place.of_bellows(i + 1, k + 1), ("rest_length", i, k), rest) for k, rest in enumerate(lengths)]
    return [
        Coordinate(f"{place} rest_length", "m", rest, REST_SPREAD * rest, False, path, low=0.01 * rest)
        for place, path, rest in chosen
    ]
