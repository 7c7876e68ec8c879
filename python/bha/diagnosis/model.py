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
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.arm.geometry import CameraFrame, camera_frame
from bha.arm.variants import Variants, with_effects
from bha.errors import BhaError
from bha.estimation.free import Coordinate
from bha.estimation.records import Record
from bha.estimation.runs import Run
from bha.parameters import Place, paths

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


def coordinate(
    name: str,
    path: str,
    unit: str,
    nominal: float,
    spread: float,
    *,
    logarithmic: bool,
    low: float = -math.inf,
    high: float = math.inf,
    weight: float = 1.0,
) -> Coordinate:
    """A number that counts in the distances it plausibly has from its nominal value.

    Args:
        name: ``section 1 mass``, ``creep at bellows 32: tau``.
        path: where it stands in the core's description, or the name of an effect's number.
        unit: its unit.
        nominal: its value at x = 0.
        spread: one standard deviation of the prior, absolute, or of the logarithm.
        logarithmic: whether the value is ``nominal exp(spread x)``, else ``nominal + spread x``.
        low: least value.
        high: greatest value.
        weight: of the prior, 0 for none.
    """
    deviation = (nominal if logarithmic else 1.0) * spread * (weight**-0.5 if weight else math.inf)
    return Coordinate(name, path, unit, nominal, spread, logarithmic, low, high, nominal, deviation)


def of_camera(coordinate: Coordinate) -> bool:
    """Whether a coordinate says how heads are seen, not how they move."""
    return paths.is_of_sensors(coordinate.path)


def is_damping(coordinate: Coordinate) -> bool:
    """Whether a plain coordinate is a damping."""
    return paths.key_of(coordinate.path) == "damping"


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
    fixed: Mapping[str, float] = field(default_factory=dict)
    numbers: Callable[[Mapping[str, float]], dict[str, float]] = dict
    begin: tuple[float, ...] = ()
    bank: tuple[Mapping[str, float], ...] = ({},)

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


@dataclass(frozen=True)
class Model:
    """An arm in coordinates: plain parameters first, then those of the effects.

    Attributes:
        core: the core's description of the arm at its nominal values, without the effects of this model.
        plain: the plain coordinates.
        arms: the arms without the effects, by values of those plain coordinates that are not the camera's.
        effects: the effects.
        finer: the step of the integration, which was chosen for the plain arm, is divided by this.
        sensors: the file's, where coordinates of the camera are among the plain ones (:mod:`bha.diagnosis.camera`).
    """

    core: Core
    plain: tuple[Coordinate, ...]
    arms: Variants = field(compare=False)
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
        for own, value in zip(self.plain, x, strict=False):
            if of_camera(own):
                _, key, axis = own.path.split(".")
                vectors[key][paths.AXES.index(axis)] = own.value(float(value))
        return self.sensors.with_camera(vectors["camera_position"], vectors["camera_rotation"])

    def runs(
        self, x: Array, records: Sequence[Record], states: Sequence[Array], rows: Sequence[int] | None = None
    ) -> list[Run]:
        """A run at ``x`` on each record, over all its rows or so many; without an arm where none has the numbers."""
        try:
            arm = self.arm(x)
        except BhaError:
            arm = None
        return runs_of(arm, records, states, self.camera(x), rows)

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
        plain, parts = self.split(x)
        moving = [(c, c.value(float(v))) for c, v in zip(self.plain, plain, strict=True) if not of_camera(c)]
        core = described(self.core, [c for c, _ in moving], [value for _, value in moving])
        return dict(with_effects(core, self._tables(parts)))

    def arm(self, x: Array) -> _core.Arm:
        """The arm at ``x``; the same object for the same numbers.

        Raises:
            ParameterError: no arm has them.
        """
        plain, parts = self.split(x)
        values = [c.value(float(v)) for c, v in zip(self.plain, plain, strict=True) if not of_camera(c)]
        return self._variants.arm(np.array(values), [table["parameters"] for table in self._tables(parts)])

    @cached_property
    def _variants(self) -> Variants:
        return self.arms.beside(self._tables([np.zeros(len(e.coordinates)) for e in self.effects]))

    def _tables(self, parts: Sequence[Array]) -> list[dict[str, Any]]:
        """All elements of all effects in the core's description."""
        return [
            effect.table(numbers)
            for effect, part in zip(self.effects, parts, strict=True)
            for numbers in effect.elements([float(v) for v in part])
        ]

    def values(self, x: Array) -> dict[str, float]:
        """All values by name."""
        return {c.name: c.value(float(v)) for c, v in zip(self.coordinates, x, strict=True)}


def runs_of(
    arm: _core.Arm | None,
    records: Sequence[Record],
    states: Sequence[Array],
    camera: CameraFrame | None = None,
    rows: Sequence[int] | None = None,
) -> list[Run]:
    """A run of an arm on each record, its heads seen in a frame (the record's for None), over so many rows or all."""
    last = [None] * len(records) if rows is None else rows
    pairs = zip(records, states, last, strict=True)
    return [Run(arm, r.observation.seen_by(camera), r, state, last=end) for r, state, end in pairs]


def described(core: Core, coordinates: Sequence[Coordinate], values: Sequence[float] | Array) -> Core:
    """``core`` with values of plain coordinates."""
    changed = copy.deepcopy(core)
    for own, value in zip(coordinates, values, strict=True):
        number = int(own.path.split(".")[1]) - 1
        set_plain(changed["section"][number], own.path, float(value), core["section"][number])
    return changed


def set_plain(section: Core, path: str, value: float, nominal: Core) -> None:
    """Write one plain number of a section into the core's description.

    ``section.1.mass`` moves the inertia along, since (56) is proportional to the mass; ``section.1.inertia.*`` is a
    factor. ``section.1.bellows.2.rest_length`` is that of one bellows. ``section.1.tangent_stiffness.3`` (at the third
    of :func:`stiffness_elongations` of the ``nominal`` section), ``section.1.damping``, ``section.1.rest_length`` and
    ``section.1.terminal_area`` act on all bellows of the section, whose differences stay in proportion.
    """
    _, _, key, *rest = path.split(".")
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
    elif key == "bellows":
        section["bellows"][int(rest[0]) - 1][rest[1]] = value
    elif key == "tangent_stiffness":
        set_tangent_stiffness(section, stiffness_elongations(nominal), int(rest[0]) - 1, value)
    else:
        old = section["bellows"][0][key]
        for bellows in section["bellows"]:
            bellows[key] = bellows[key] * value / old if old else value


def stiffness_elongations(section: Core) -> tuple[float, ...]:
    """Elongations at which the tangent stiffness is identified, m: places in a section's range from its rest length."""
    low, high = section["length_range"]
    rest = section["bellows"][0]["rest_length"]
    return tuple(low + share * (high - low) - rest for share in STIFFNESS_PLACES)


def tangent_stiffness(stiffness: Sequence[float], elongation: float) -> float:
    """Slope of the spring force ``sum_m stiffness[m] x^(m + 1)``, N/m."""
    return sum((m + 1) * k * elongation**m for m, k in enumerate(stiffness))


def set_tangent_stiffness(section: Core, elongations: Sequence[float], place: int, value: float) -> None:
    """Change the springs of a section: tangent stiffness ``value`` at one elongation, and as it was at the others."""
    at = list(elongations)
    own = at.pop(place)
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

    def describe(values: Array) -> Core:
        return described(core, coordinates, values)

    arms = Variants(describe, [c.value(0.0) for c in coordinates], [abs(c.slope(0.0)) for c in coordinates])
    return Model(core, tuple(coordinates), arms)


def _plain_of_section(arm: Arm, i: int, section: Core) -> list[Coordinate]:
    bellows = section["bellows"][0]
    place, path = Place.of_section(i + 1), f"section.{i + 1}"
    rest, stiffness = float(bellows["rest_length"]), [float(k) for k in bellows["stiffness"]]

    def scaled(key: str, unit: str, nominal: float, spread: float) -> Coordinate:
        return coordinate(f"{place} {key}", f"{path}.{key}", unit, nominal, spread, logarithmic=True)

    found = [
        scaled("mass", "kg", float(section["mass"]), MASS_SPREAD),
        coordinate(f"{place} inertia factor", f"{path}.inertia.*", "1", 1.0, INERTIA_SPREAD, logarithmic=True),
        coordinate(
            f"{place} center_of_mass z",
            f"{path}.center_of_mass.z",
            "m",
            float(section["center_of_mass"][2]),
            CENTER_SPREAD * rest,
            logarithmic=False,
        ),
        *_rest_lengths(arm, i, section),
        scaled("damping", "N s/m", max(float(bellows["damping"]), 1e-3), DAMPING_SPREAD),
    ]
    first = stiffness[0] if stiffness[0] > 0.0 else 1.0
    for number, elongation in enumerate(stiffness_elongations(section), start=1):
        nominal = max(tangent_stiffness(stiffness, elongation), LEAST_STIFFNESS * first)
        name = f"{place} tangent stiffness at {1e3 * elongation:+.0f} mm"
        own = f"{path}.tangent_stiffness.{number}"
        found.append(coordinate(name, own, "N/m", nominal, STIFFNESS_SPREAD, logarithmic=True))
    bending = float(section["bending_stiffness"][0])
    # Where the file has none, a tenth of what the bellows' springs make of a bend.
    size = bending if bending > 0.0 else 0.15 * first * float(section["bellows_radius"]) ** 2
    found.append(
        coordinate(
            f"{place} bending_stiffness",
            f"{path}.bending_stiffness.1",
            "N m",
            bending,
            BENDING_SPREAD * size,
            logarithmic=False,
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
    chosen = [(Place.of_section(i + 1), f"section.{i + 1}", lengths[0])]
    if stated is not None and all(bellows.rest_length is not None for bellows in stated):
        chosen = [
            (Place.of_bellows(i + 1, k), f"section.{i + 1}.bellows.{k}", rest)
            for k, rest in enumerate(lengths, start=1)
        ]
    return [
        coordinate(
            f"{place} rest_length",
            f"{path}.rest_length",
            "m",
            rest,
            REST_SPREAD * rest,
            logarithmic=False,
            low=0.01 * rest,
        )
        for place, path, rest in chosen
    ]
