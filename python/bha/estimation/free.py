"""Free parameters: which numbers of an arm are estimated, on which scale, within which bounds, with which prior.

Every free parameter is estimated on a coordinate z that is 0 at the start: z = ln(value / start) for numbers that are
positive by nature, z = (value - start) / scale for the others. On this coordinate steps, priors and standard errors are
of order one, whatever the unit. A group (a path with stars) is one factor on all numbers it matches.

Physical ranges are wide on purpose: they say what no pneumatic bellows arm has, not what is likely. A value that leaves
its range is reported, never silently accepted: a parameter there stands in for physics that the model lacks.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError, ParameterWarning
from bha.parameters import ArmParameters, SensorsParameters, paths
from bha.parameters.tables import AXES

# Keys whose numbers are positive and are estimated on a logarithmic scale.
_POSITIVE = frozenset(
    {"mass", "bellows_radius", "bellows_outer_radius", "radius", "terminal_area", "rest_length", "damping", "inertia"}
    | {"axial_rest_length", "axial_damping"}
)
_STIFFNESSES = frozenset({"stiffness", "bending_stiffness", "cross_bending_stiffness", "axial_stiffness"})
# Physical range of a key: what lies outside is not a pneumatic bellows arm of 0.05 to 5 m.
_RANGES: dict[str, tuple[float, float]] = {
    "mass": (1e-3, 50.0),
    "inertia": (1e-8, 10.0),
    "bellows_radius": (2e-3, 1.0),
    "bellows_outer_radius": (1e-3, 0.5),
    "radius": (0.0, 1.0),
    "terminal_area": (1e-6, 0.1),
    "rest_length": (5e-3, 2.0),
    "damping": (0.0, 1e6),
    "axial_rest_length": (5e-3, 2.0),
    "axial_damping": (0.0, 1e6),
    "bending_plane": (-2.0 * math.pi, 2.0 * math.pi),
    "ambient_pressure": (6e4, 1.1e5),
    "base_offset": (0.0, 0.5),
    "head_offset": (0.0, 0.5),
    "center_of_mass": (-0.5, 0.5),
    "gravity": (-9.9, 9.9),
}
# A change of a sensor's number that shows: m and rad.
_SENSOR_SCALES = {"camera_position": 0.02, "camera_rotation": 0.05, "angle": 0.05, "radius": 0.01, "offset": 0.02}
# Standard deviation of the default prior on ln(value): a factor of five either way is unremarkable.
_LOG_PRIOR = math.log(5.0)


@dataclass(frozen=True)
class FreeParameter:
    """One number (or one factor on a group of numbers) to estimate.

    Attributes:
        path: where it stands in the parameter file (``bha.parameters.paths``); with stars a factor on a group.
        sessions: names of the sessions whose logs it acts on; empty for all. Two free parameters may share a path if
            they act on different sessions.
        start: value to start from; that of the arm (1 for a group) if None.
        lower: lower bound, in the unit of the value; the physical range's if None.
        upper: upper bound; the physical range's if None.
        prior: (mean, standard deviation) in the unit of the value; a wide one about the start if None.
        logarithmic: whether to estimate ln(value); by the nature of the number if None.
        scale: unit of the coordinate z where not logarithmic, in the unit of the value; by its nature if None.
    """

    path: str
    sessions: tuple[str, ...] = ()
    start: float | None = None
    lower: float | None = None
    upper: float | None = None
    prior: tuple[float, float] | None = None
    logarithmic: bool | None = None
    scale: float | None = None

    @property
    def name(self) -> str:
        """The path, with its sessions where it has some."""
        return self.path + (f" ({', '.join(self.sessions)})" if self.sessions else "")


@dataclass(frozen=True)
class Coordinate:
    """A number that is estimated, with everything filled in: the map between its value and the coordinate z.

    Attributes:
        name: what it is called in reports.
        path: where it stands, as in :mod:`bha.parameters.paths` or as the model that has it reads it.
        unit: SI unit.
        start: value at z = 0.
        scale: how far the value moves with z, or its logarithm.
        logarithmic: whether the value is ``start exp(scale z)``, else ``start + scale z``.
        lower: least value.
        upper: greatest value.
        prior_mean: mean of the prior, as a value.
        prior_deviation: its standard deviation, as a value; infinite for no prior.
        members: the numbers that a group matches.
        sessions: names of the sessions whose logs it acts on; empty for all.
        range: values outside of which no arm has it.
    """

    name: str
    path: str
    unit: str
    start: float
    scale: float
    logarithmic: bool
    lower: float
    upper: float
    prior_mean: float
    prior_deviation: float
    members: tuple[str, ...] = ()
    sessions: tuple[str, ...] = ()
    range: tuple[float, float] = (-math.inf, math.inf)

    def value(self, z: float) -> float:
        """Value in SI units at the coordinate z, within the bounds."""
        raw = self.start * math.exp(min(self.scale * z, 50.0)) if self.logarithmic else self.start + self.scale * z
        # A bound's own coordinate gives the bound, not what rounding makes of it.
        on = [b for b in (self.lower, self.upper) if math.isclose(raw, b, abs_tol=1e-12 * abs(self.scale))]
        return on[0] if on else min(max(raw, self.lower), self.upper)

    def coordinate(self, value: float) -> float:
        """Coordinate z of a value, or of the bound beyond which it lies."""
        value = min(max(value, self.lower), self.upper)
        if self.logarithmic:
            return math.log(max(value, 1e-300) / self.start) / self.scale
        return (value - self.start) / self.scale

    def slope(self, z: float) -> float:
        """d value / dz within the bounds."""
        return self.scale * self.value(z) if self.logarithmic else self.scale

    def acts_on(self, session: str) -> bool:
        """Whether logs of a session see it."""
        return not self.sessions or session in self.sessions

    def at_bound(self, z: float) -> bool:
        """Whether the value sits on a bound."""
        value = self.value(z)
        size = 1e-6 * max(abs(value), self.scale if not self.logarithmic else 0.0)
        return value <= self.lower + size or value >= self.upper - size

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds on z."""
        return self.coordinate(self.lower), self.coordinate(self.upper)

    @property
    def prior(self) -> tuple[float, float]:
        """Mean and standard deviation of the prior on z."""
        unit = abs(self.prior_mean * self.scale if self.logarithmic else self.scale)
        return self.coordinate(self.prior_mean), self.prior_deviation / unit

    @property
    def prior_weight(self) -> float:
        """One over the variance of the prior on z; 0 for none."""
        return float(self.prior[1] ** -2.0)


def resolve(parameters: ArmParameters, free: Iterable[FreeParameter | str]) -> tuple[Coordinate, ...]:
    """The coordinates of free parameters on an arm.

    Raises:
        ParameterError: a path that the arm does not have.
        InputError: a number would be free twice, a start outside its bounds, a bound that is not allowed.
    """
    coordinates = tuple(_resolve(parameters, FreeParameter(f) if isinstance(f, str) else f) for f in free)
    if not coordinates:
        raise InputError("there is no free parameter; name at least one, for example section.1.mass")
    seen: dict[tuple[str, str], str] = {}
    for coordinate in coordinates:
        for member in coordinate.members:
            for session in coordinate.sessions or ("",):
                clash = seen.get((member, session)) or seen.get((member, "")) if session else _any(seen, member)
                if clash and "*" not in coordinate.path and "*" not in clash:
                    raise InputError(f"{member} is free twice: as {clash} and as {coordinate.name}")
                seen[member, session] = coordinate.name
    return coordinates


def _any(seen: Mapping[tuple[str, str], str], member: str) -> str | None:
    return next((name for (other, _), name in seen.items() if other == member), None)


def _resolve(parameters: ArmParameters, free: FreeParameter) -> Coordinate:
    members = paths.expand(parameters, free.path)
    group = paths.is_group(free.path)
    key = paths.key_of(free.path)
    start = (1.0 if group else paths.get_value(parameters, free.path)) if free.start is None else free.start
    low, high = (1e-3, 1e3) if group else physical_range(free.path)
    lower, upper = low if free.lower is None else free.lower, high if free.upper is None else free.upper
    positive = group or key in _POSITIVE or (key in _STIFFNESSES and free.path.endswith(".1"))
    logarithmic = (positive and start > 0) if free.logarithmic is None else free.logarithmic
    if logarithmic:
        lower = max(lower, start * 1e-6)
    if not math.isfinite(start) or (logarithmic and start <= 0):
        raise InputError(f"{free.name}: start {start}; a {'positive' if logarithmic else 'finite'} number is needed")
    if not lower < upper or not lower <= start <= upper:
        raise InputError(f"{free.name}: start {start} must lie within its bounds [{lower}, {upper}]")
    scale = free.scale if free.scale is not None else typical_scale(parameters, free.path, start)
    if logarithmic:
        scale = 1.0
    prior_mean, deviation = start, (start * _LOG_PRIOR if logarithmic else 3.0 * scale)
    if free.prior is not None:
        prior_mean, deviation = free.prior
        if not (math.isfinite(prior_mean) and deviation > 0) or (logarithmic and prior_mean <= 0):
            raise InputError(f"{free.name}: prior {free.prior}; a finite mean and a positive deviation are needed")
    return Coordinate(
        name=free.name,
        path=free.path,
        members=members,
        sessions=free.sessions,
        unit=paths.unit_of(free.path),
        start=start,
        logarithmic=logarithmic,
        scale=scale,
        lower=lower,
        upper=upper,
        prior_mean=prior_mean,
        prior_deviation=deviation,
        range=(low, high),
    )


def physical_range(path: str) -> tuple[float, float]:
    """The range outside which the number at a path is not that of a pneumatic bellows arm."""
    key = paths.key_of(path)
    if key in ("stiffness", "axial_stiffness"):
        return (0.0, 1e6) if path.endswith(".1") else (-math.inf, math.inf)
    if key in ("bending_stiffness", "cross_bending_stiffness"):
        return (0.0, 1e4) if path.endswith(".1") else (-math.inf, math.inf)
    return _RANGES.get(key, (-math.inf, math.inf))


def typical_scale(  # noqa: PLR0911  (a table of cases)
    parameters: ArmParameters, path: str, value: float
) -> float:
    """A change of the number at a path that makes a visible difference: the unit of its coordinate z."""
    key, steps = paths.key_of(path), path.split(".")
    if key in _SENSOR_SCALES and (paths.is_of_sensors(path) or key == "angle"):
        return _SENSOR_SCALES[key]
    if key == "center_of_mass":
        return 0.02
    if key == "gravity":
        return 0.5
    if key in ("base_offset", "head_offset", "rest_length", "axial_rest_length"):
        return 0.02
    if key == "bending_plane":
        return 0.2
    if key == "ambient_pressure":
        return 2e3
    if key == "radius":
        return 0.1 * parameters.sections[int(steps[1]) - 1].bellows_radius
    if key in _STIFFNESSES and steps[0] == "section" and steps[-1].isdigit():
        section = parameters.sections[int(steps[1]) - 1]
        if key in ("stiffness", "axial_stiffness"):
            travel = 0.5 * (section.length_range[1] - section.length_range[0])
            first = abs(section.stiffness[0]) or section.terminal_area * 1e4 / travel
            return float(first / travel ** (int(steps[-1]) - 1))
        return abs(section.bending_stiffness[0]) or 1.0
    return 0.2 * abs(value) or 1.0


def apply(
    parameters: ArmParameters, coordinates: Sequence[Coordinate], z: NDArray[np.float64], session: str = ""
) -> ArmParameters:
    """The parameters with the coordinates' values at ``z`` put in, as logs of ``session`` see them."""
    acting = [(c, c.value(float(x))) for c, x in zip(coordinates, z, strict=True) if c.acts_on(session)]
    return with_values(parameters, [c for c, _ in acting], [value for _, value in acting])


def with_values(
    parameters: ArmParameters, coordinates: Sequence[Coordinate], values: Sequence[float] | NDArray[np.float64]
) -> ArmParameters:
    """The parameters with values of the coordinates put in, factors of groups last."""
    found: dict[str, float] = {}
    for group in (False, True):
        for coordinate, value in zip(coordinates, values, strict=True):
            if paths.is_group(coordinate.path) != group:
                continue
            for member in coordinate.members:
                if group:
                    found[member] = float(value) * found.get(member, paths.get_value(parameters, member))
                else:
                    found[member] = float(value)
    with warnings.catch_warnings():
        # Moments of inertia that fit no body on the way to the minimum are judged at the end.
        warnings.simplefilter("ignore", ParameterWarning)
        return paths.with_values(parameters, found)


def default_free(parameters: ArmParameters, *, masses: bool = True) -> tuple[str, ...]:
    """What is usually unknown of an arm: per section mass, stiffness (the terms it has), bending stiffness and damping.

    Terminal areas and rest lengths are left out: pressures give forces through the areas, so that areas, masses and
    stiffnesses share one scale that only a weight (gravity) tells, and rest lengths are usually measured.
    """
    names = []
    for number, section in enumerate(parameters.sections, start=1):
        place = f"section.{number}"
        names += [f"{place}.mass"] if masses else []
        names += [f"{place}.stiffness.{k + 1}" for k in range(len(section.stiffness))]
        names += [f"{place}.bending_stiffness.{k + 1}" for k, v in enumerate(section.bending_stiffness) if v or not k]
        names += [f"{place}.damping"]
    return tuple(names)


def camera_free(parameters: ArmParameters) -> tuple[FreeParameter, ...]:
    """The camera's frame, where heads are measured: it never stands quite where the file has it.

    A camera that is held fixed there comes out as stiffness and mass. What the file calls published stays.
    """
    sensors = parameters.sensors or SensorsParameters()
    found = []
    for name, spread in sensors.uncertain.items():
        for axis in AXES:
            path = f"sensors.{name}.{axis}"
            found.append(FreeParameter(path, prior=(paths.get_value(parameters, path), spread)))
    return tuple(found)


def with_start(free: FreeParameter | str, start: float) -> FreeParameter:
    """A free parameter with another start value."""
    return replace(FreeParameter(free) if isinstance(free, str) else free, start=start)
