"""Statics first: what a slow arm tells of its parameters, from any guess.

What: a joint fit of the poses that pressures hold, N(q, 0) = tau(q, p) (62), to all slow records at once, behind a lag
a sort of channel (:mod:`bha.estimation.held`). Statics know three kinds of numbers: A/k (how far pressures stretch and
bend), m g/k (how far weight does) and k_bend/k (how the two differ). The search begins with a net of factors over these
three, far wider than a tape-measure file is wrong; the best of its points are refined each on its own, on coarse cells
first. No simulation is run, so that no stiffness of the equations of motion stands in the way, and a start at which a
simulation would fail is as good as any other.
Priors of the free parameters count in full: what statics do not tell stays at the file's value.
Limits: lengths and positions of heads; orientations are left to the joint fit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from bha.estimation.dense import minimize
from bha.estimation.free import Coordinate
from bha.estimation.held import Held, HeldPoses, sort_of
from bha.estimation.long_run import correlation_length
from bha.estimation.records import Record
from bha.estimation.slow import slow_record
from bha.parameters import ArmParameters, paths

Array = NDArray[np.float64]

#: Keys that act on held poses; what is left acts on rates only.
STATIC_KEYS = frozenset(
    {
        "mass", "stiffness", "bending_stiffness", "terminal_area", "rest_length", "radius", "bellows_radius",
        "axial_stiffness", "axial_rest_length", "base_offset", "head_offset", "center_of_mass", "gravity",
        "ambient_pressure", "camera_position", "camera_rotation", "offset", "angle",
    }
)  # fmt: skip
#: The same of effects: gains and offsets of pressures or of what is seen, areas, springs of single bellows.
_STATIC_EFFECT_KEYS = frozenset({"gain", "offset", "by_length", "by_pressure", "change"})
#: Kinds of effects whose stiffness holds poses; that of others relaxes.
_STATIC_SPRINGS = frozenset({"section_coupling", "bending_anisotropy", "tool_drag"})
#: The net: factors on stiffness, on A/k, on k_bend/k and, where it is free, on K/k of an axial stiffness K.
_STIFFNESS_FACTORS = (1 / 30, 1 / 10, 1 / 3, 1.0, 3.0, 10.0, 30.0)
_AREA_FACTORS = (1 / 9, 1 / 3, 1.0, 3.0, 9.0)
_BENDING_FACTORS = (0.1, 1.0, 10.0)
_AXIAL_FACTORS = (1.0, 4.0, 16.0, 64.0)
#: Lags that are tried at each point of the net, s.
_LAGS = (0.0, 0.1, 0.3, 1.0, 3.0)
_LEAST_LAG, _GREATEST_LAG = 1e-3, 30.0
#: The camera's turn about the base's axis.
TURN = "sensors.camera_rotation.z"
#: Cells of all records together: on the net, in the searches, in the last one.
_NET_CELLS, _SEARCH_CELLS, _LAST_CELLS = 90, 240, 700
#: Cells, and the tolerance of the search, where poses are only compared with those of other arms.
_NEAR_CELLS, _NEAR_TOLERANCE = 120, 1e-2
#: Least step of a grid, s, and how many points of the net are refined.
_LEAST_STEP, _STARTS = 0.05, 4
#: How much worse, in merit for each channel, a rival may be.
_RIVAL = 0.1
#: Huber's constant in scales; a pose that is not held counts as so many scales.
_HUBER, _NOT_HELD = 3.0, 30.0
#: Standard deviation of the prior on the logarithm of a lag, about this lag, s.
_LAG_PRIOR = (0.1, 2.0)
_MEDIAN_NORMAL = 0.6745


@dataclass(frozen=True)
class Statics:
    """What held poses tell.

    Attributes:
        coordinates: the free parameters that act on held poses.
        z: their coordinates, shape (p,).
        lags: lag of each sort of channels, s.
        sorts: the sorts: ``"across"``, ``"along"`` or ``"length"``, and the section.
        spread: robust spread of what is left, m, the root mean square over channels.
        merit: sum over channels of the logarithm of the spread: the smaller, the better.
        channels: how many channels these are.
        lasts: for how long what is left errs alike, s, the median over channels.
        converged: whether nothing was left to gain.
        rivals: other fits that statics alone hardly tell from this one; a simulation may.
    """

    coordinates: tuple[Coordinate, ...]
    z: Array
    lags: Array
    sorts: tuple[tuple[str, int], ...]
    spread: float
    merit: float
    channels: int
    lasts: float
    converged: bool
    rivals: tuple[Statics, ...] = ()

    @property
    def values(self) -> dict[str, float]:
        """Name of each parameter -> its value, SI."""
        return {c.name: c.value(float(z)) for c, z in zip(self.coordinates, self.z, strict=True)}

    def lag(self, *sorts: str) -> float:
        """The median lag of some sorts of channels, s; of all where none is of them."""
        own = [lag for (sort, _), lag in zip(self.sorts, self.lags, strict=True) if sort in sorts]
        return float(np.median(own or self.lags))


def is_static(parameters: ArmParameters, coordinate: Coordinate) -> bool:
    """Whether a parameter acts on held poses."""
    member = coordinate.members[0]
    key = paths.key_of(member)
    if not coordinate.path.startswith("effect."):
        return key in STATIC_KEYS
    if key == "stiffness":
        return parameters.effects[int(member.split(".")[1]) - 1].kind in _STATIC_SPRINGS
    return key in _STATIC_EFFECT_KEYS


def fit_statics(
    parameters: ArmParameters, coordinates: Sequence[Coordinate], records: Sequence[Record]
) -> Statics | None:
    """The best held poses from all starts; None where no start holds poses, or nothing free acts on any."""
    own = tuple(c for c in coordinates if is_static(parameters, c))
    if not own:
        return None
    net = _poses(parameters, own, records, _NET_CELLS)
    starts = _starts(net, _net(net))
    search = _poses(parameters, own, records, _SEARCH_CELLS)
    found = [fit for z, lags in starts if (fit := _refined(search, z, lags, 1, tolerance=1e-2)) is not None]
    if not found:
        return None
    found.sort(key=lambda fit: fit.merit)
    best = found[0]
    for poses in (search, _poses(parameters, own, records, _LAST_CELLS)):
        finer = _refined(poses, best.z, best.lags, 2)
        # An arm that its pressures hold in several poses may be found in others from here: what it was is then kept.
        if finer is not None and finer.merit < best.merit + _RIVAL * best.channels:
            best = finer
    near = found[0].merit + _RIVAL * found[0].channels
    return replace(best, rivals=tuple(fit for fit in found[1:] if fit.merit < near))


def near_statics(
    parameters: ArmParameters,
    coordinates: Sequence[Coordinate],
    records: Sequence[Record],
    start: Statics | None = None,
) -> Statics | None:
    """The held poses next to the file's values, or to ``start``, on coarse cells: to compare arms by, no estimate.

    ``start`` may be of fewer coordinates. Where its values hold no poses, the search begins at the best point of the
    net; None where none does, or where nothing free acts on any.
    """
    own = tuple(c for c in coordinates if is_static(parameters, c))
    if not own:
        return None
    poses = _poses(parameters, own, records, _NEAR_CELLS)
    values = {} if start is None else start.values
    z = np.array([c.coordinate(values[c.name]) if c.name in values else 0.0 for c in own])
    lags = _best_lags(poses, poses.shown(z, poses.held(z))) if start is None else start.lags
    # What is left at the start of a fit is the scale that a second round would take.
    found = _refined(poses, z, lags, 2 if start is None else 1, tolerance=_NEAR_TOLERANCE)
    if found is None and start is None:
        net = _net(_poses(parameters, own, records, _NET_CELLS))
        found = next((fit for z, lags in net[:1] if (fit := _refined(poses, z, lags, 2, tolerance=1e-3))), None)
    return found


def refit_statics(
    parameters: ArmParameters, coordinates: Sequence[Coordinate], records: Sequence[Record], z: Array, lags: Array
) -> Statics | None:
    """The held poses next to a point, ``z`` of all coordinates, with its lags, s; None where it holds no poses."""
    places = [k for k, c in enumerate(coordinates) if is_static(parameters, c)]
    own = tuple(coordinates[k] for k in places)
    return _refined(_poses(parameters, own, records, _SEARCH_CELLS), z[places], lags, 2)


def left_out(
    parameters: ArmParameters, coordinates: Sequence[Coordinate], records: Sequence[Record], z: Array, lags: Array
) -> float:
    """Merit of each record's held poses under a fit to the others, from a point with its lags: what carries over.

    Infinite where the others hold no poses, or show a sort of channels less. On coarse cells: to compare arms by.
    """
    places = [k for k, c in enumerate(coordinates) if is_static(parameters, c)]
    own = tuple(coordinates[k] for k in places)
    everything = _poses(parameters, own, records, _NEAR_CELLS)
    total = 0.0
    for k, slow in enumerate(everything.records):
        others = replace(everything, records=(*everything.records[:k], *everything.records[k + 1 :]))
        alone = replace(everything, records=(slow,))
        if set(others.sorts) != set(everything.sorts):
            return math.inf
        own_lags = dict(zip(everything.sorts, lags, strict=True))
        start = np.array([own_lags[sort] for sort in others.sorts])
        found = _refined(others, z[places], start, 1, tolerance=_NEAR_TOLERANCE)
        if found is None:
            return math.inf
        own_lags = dict(zip(found.sorts, found.lags, strict=True))
        behind = np.array([own_lags[sort] for sort in alone.sorts])
        shown = alone.lagged(alone.shown(found.z, alone.held(found.z)), behind)
        total += _merit(alone, shown, centred=True)
    return total


def _starts(poses: HeldPoses, points: Sequence[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """The best points; where an axial stiffness is free the best of each of its factors, for it is told badly."""
    axial = [k for k, c in enumerate(poses.coordinates) if c.path.endswith(".axial_stiffness.1")]
    springs = [k for k, c in enumerate(poses.coordinates) if c.path.endswith(".stiffness.1") and k not in axial]
    if not axial or not springs:
        return list(points[:_STARTS])
    best: dict[float, tuple[Array, Array]] = {}
    for z, lags in points:
        best.setdefault(round(float(z[axial[0]] - z[springs[0]]), 3), (z, lags))
    return list(best.values())


def _poses(
    parameters: ArmParameters, coordinates: tuple[Coordinate, ...], records: Sequence[Record], cells: int
) -> HeldPoses:
    step = max(_LEAST_STEP, sum(rec.duration for rec in records) / cells)
    return HeldPoses(parameters, coordinates, tuple(slow_record(rec, step) for rec in records))


def _net(poses: HeldPoses) -> list[tuple[Array, Array]]:
    """Points of the net with their lags, the best first."""
    bounds = np.array([c.bounds for c in poses.coordinates])
    tried: list[tuple[float, Array, Array]] = []
    seen: set[bytes] = set()
    keys = {paths.key_of(c.members[0]) for c in poses.coordinates}
    bendings = _BENDING_FACTORS if "bending_stiffness" in keys else (1.0,)
    axials = _AXIAL_FACTORS if "axial_stiffness" in keys else (1.0,)
    for stiffness, area, bending, axial in product(_STIFFNESS_FACTORS, _AREA_FACTORS, bendings, axials):
        factors = {"stiffness": stiffness, "terminal_area": stiffness * area, "bending_stiffness": stiffness * bending}
        factors["axial_stiffness"] = stiffness * axial
        z = np.array([_moved(c, factors.get(paths.key_of(c.members[0]), 1.0)) for c in poses.coordinates])
        z = np.clip(z, bounds[:, 0], bounds[:, 1])
        # What bounds or published values hold makes points alike.
        if (same := np.round(z, 6).tobytes()) in seen:
            continue
        seen.add(same)
        held = poses.held(z)
        for point in (z, _turned(poses, z, poses.shown(z, held))):
            resting = poses.shown(point, held)
            lags = _best_lags(poses, resting)
            merit = _merit(poses, poses.lagged(resting, lags), centred=True)
            if math.isfinite(merit):
                tried.append((merit, point, lags))
            if not any(c.path == TURN for c in poses.coordinates):
                break
    return [(z, lags) for _, z, lags in sorted(tried, key=lambda entry: entry[0])]


def _turned(poses: HeldPoses, z: Array, shown: Sequence[Array]) -> Array:
    """The point with the camera turned about the base's axis so that the heads move as they were measured.

    Chambers at another azimuth than the file says look the same where the arm hangs or stands upright.
    """
    place = next((k for k, c in enumerate(poses.coordinates) if c.path == TURN), None)
    if place is None:
        return z
    total = 0j
    for slow, table in zip(poses.records, shown, strict=True):
        across = {(o.section, o.number): k for k, o in enumerate(slow.outputs) if o.kind == "position"}
        for section in {s for s, number in across if number == 1 and (s, 2) in across}:
            pair = [across[section, 1], across[section, 2]]
            seen, said = (t[:, pair] @ np.array([1.0, 1j]) for t in (slow.measured, table))
            both = np.isfinite(seen) & np.isfinite(said)
            if both.any():
                total += np.sum((seen - seen[both].mean())[both] * np.conj((said - said[both].mean())[both]))
    point = z.copy()
    coordinate = poses.coordinates[place]
    angle = coordinate.value(float(z[place])) - float(np.angle(total))
    point[place] = coordinate.coordinate(math.remainder(angle, 2.0 * math.pi))
    return point


def _moved(coordinate: Coordinate, factor: float) -> float:
    """The coordinate of its start times a factor."""
    if coordinate.logarithmic:
        return math.log(factor)
    return coordinate.coordinate(coordinate.start * factor)


def _best_lags(poses: HeldPoses, resting: Sequence[Array]) -> Array:
    """For each sort of channels the lag, of those tried, that leaves least."""
    count = len(poses.sorts)
    left = []
    for lag in _LAGS:
        errors = _errors(poses, poses.lagged(resting, np.full(count, lag)))
        left.append([_left(poses, errors, sort) for sort in poses.sorts])
    return np.array([_LAGS[k] for k in np.argmin(np.array(left), axis=0)])


def _errors(poses: HeldPoses, shown: Sequence[Array]) -> list[Array]:
    return [slow.measured - table for slow, table in zip(poses.records, shown, strict=True)]


def _left(poses: HeldPoses, errors: Sequence[Array], sort: tuple[str, int]) -> float:
    """Sum over the channels of a sort of the logarithm of the spread about their middle."""
    total = 0.0
    for slow, table in zip(poses.records, errors, strict=True):
        for output, column in zip(slow.outputs, table.T, strict=True):
            if sort_of(output) == sort and np.isfinite(column).any():
                total += math.log(max(_spread(column - np.nanmedian(column)), 1e-9))
    return total


def _merit(poses: HeldPoses, shown: Sequence[Array], *, centred: bool) -> float:
    """Sum over channels of the logarithm of the spread of what is left; infinite where a tenth is not held."""
    total = 0.0
    for slow, errors in zip(poses.records, _errors(poses, shown), strict=True):
        counts = np.isfinite(slow.measured)
        if np.isfinite(errors).sum() < 0.9 * counts.sum():
            return math.inf
        for c, column in enumerate(errors.T):
            if counts[:, c].any():
                middle = float(np.nanmedian(column)) if centred else 0.0
                # Below the noise nothing more is to be told.
                total += math.log(max(_spread(column - middle), float(slow.record.noise[c]) / 3.0))
    return total


def _spread(values: Array) -> float:
    """Root mean square without the largest tenth: of what is measured all over the log, not only where it rests."""
    size = np.sort(np.abs(values[np.isfinite(values)]))
    return float(np.sqrt(np.mean(size[: max(1, int(0.9 * len(size)))] ** 2))) if len(size) else math.inf


@dataclass
class Search:
    """Residuals of held poses, in scales, and their derivatives; remembers the poses to start the next ones from.

    Unknowns are the coordinates and, where channels lag, the logarithms of the lags, shape (p + sorts,).
    """

    poses: HeldPoses
    scales: list[Array]
    held: list[Held]
    lagging: bool = True

    @property
    def _lags(self) -> int:
        """Of how many sorts of channels the lag is an unknown."""
        return len(self.poses.sorts) if self.lagging else 0

    @property
    def prior(self) -> Array:
        """Mean and standard deviation of each unknown, shape (p + sorts, 2)."""
        lag = (math.log(_LAG_PRIOR[0]), _LAG_PRIOR[1])
        return np.array([*(c.prior for c in self.poses.coordinates), *[lag] * self._lags])

    @property
    def bounds(self) -> Array:
        """Bounds of each unknown, shape (p + sorts, 2)."""
        lag = (math.log(_LEAST_LAG), math.log(_GREATEST_LAG))
        return np.array([*(c.bounds for c in self.poses.coordinates), *[lag] * self._lags])

    def residuals(self, x: Array) -> Array:
        """Errors of all channels and of the priors."""
        z, lags = self.parts(x)
        self.held = self.poses.held(z, self.held)
        errors = _errors(self.poses, self.poses.lagged(self.poses.shown(z, self.held), lags))
        found = [
            np.where(np.isfinite(slow.measured), np.nan_to_num(error / scale, nan=_NOT_HELD), 0.0).ravel()
            for slow, error, scale in zip(self.poses.records, errors, self.scales, strict=True)
        ]
        mean, deviation = self.prior.T
        return np.concatenate([*found, (x - mean) / deviation])

    def jacobian(self, x: Array, _left: Array) -> Array:
        """Derivatives of the residuals."""
        z, lags = self.parts(x)
        slopes = self.poses.derivatives(z, lags, self.poses.held(z, self.held))
        found = [
            np.nan_to_num(-slope / scale[:, None] * np.isfinite(slow.measured)[..., None])[..., : len(x)].reshape(
                -1, len(x)
            )
            for slow, slope, scale in zip(self.poses.records, slopes, self.scales, strict=True)
        ]
        return np.concatenate([*found, np.diag(1.0 / self.prior[:, 1])])

    def parts(self, x: Array) -> tuple[Array, Array]:
        """Coordinates and lags, s."""
        p = len(self.poses.coordinates)
        return x[:p], np.exp(x[p:]) if self.lagging else np.zeros(len(self.poses.sorts))

    def errors(self, x: Array) -> list[Array]:
        """Measured less shown, per record (g, C); NaN where no pose is held or nothing was read."""
        z, lags = self.parts(x)
        return _errors(self.poses, self.poses.lagged(self.poses.shown(z, self.poses.held(z, self.held)), lags))


def _refined(poses: HeldPoses, z: Array, lags: Array, rounds: int, *, tolerance: float = 1e-4) -> Statics | None:
    """The fit from a point: searches between which the channels' scales become what is left; None without poses."""
    x = np.concatenate([z, np.log(np.clip(lags, 1e-2, _GREATEST_LAG))])
    search, done = Search(poses, [], poses.held(z)), False
    for _ in range(rounds):
        scales = _scales(poses, search.held, *search.parts(x))
        if scales is None:
            return None
        search.scales = scales
        found = minimize(
            search.residuals, search.jacobian, x, search.bounds, huber=_HUBER, max_iterations=12, tolerance=tolerance
        )
        x, done = found.z, found.converged
        search.held = poses.held(search.parts(x)[0])
    z, lags = search.parts(x)
    shown = poses.lagged(poses.shown(z, search.held), lags)
    merit = _merit(poses, shown, centred=False)
    if not math.isfinite(merit):
        return None
    spreads, lasts = [], []
    for slow, table in zip(poses.records, _errors(poses, shown), strict=True):
        for column in table.T:
            if (seen := np.isfinite(column)).any():
                spreads.append(_spread(column))
                lasts.append(slow.step * correlation_length([column[seen]]))
    spread = float(np.sqrt(np.mean(np.square(spreads))))
    lasting = float(np.median(lasts))
    return Statics(poses.coordinates, z, lags, poses.sorts, spread, merit, len(spreads), lasting, done)


def _scales(poses: HeldPoses, held: Sequence[Held], z: Array, lags: Array) -> list[Array] | None:
    """Scale of each channel: what is left there, or its noise where that is more; None where poses are not held."""
    errors = _errors(poses, poses.lagged(poses.shown(z, held), lags))
    if not all(np.isfinite(table).any() for table in errors):
        return None
    found = []
    for slow, table in zip(poses.records, errors, strict=True):
        left = [_spread(column) if np.isfinite(column).any() else 1.0 for column in table.T]
        found.append(np.maximum(np.array(left), slow.record.noise[: len(left)]))
    return found
