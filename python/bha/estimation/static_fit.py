"""Joint fit of what a slow arm tells: poses that the pressures hold, paper (62), against measured lengths and heads.

The paper identifies longitudinal and bending stiffness one after the other from steady states (section IV-C and D);
here all static parameters are fitted to all poses at once. Rows need not be steady to the last digit: what lags is left
to the refinement by simulation, for which this fit is the start. It needs no integration, hence no stiffness of the
arm's equations limits it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError, InputError, ParameterError
from bha.estimation.conditions import check_apart, conditioned
from bha.estimation.free import Coordinate, FreeParameter, apply, resolve
from bha.estimation.held import held_poses
from bha.estimation.records import Record
from bha.parameters import ArmParameters
from bha.recordings import Observation
from bha.support.extras import import_extra
from bha.support.shown import short_repr

Array = NDArray[np.float64]

_STEP = 1e-5
# Residual where a pose cannot be held at all: large, so that the search turns back.
_FAILED = 0.5


@short_repr
@dataclass(frozen=True)
class StaticFit:
    """Parameters fitted to held poses.

    Attributes:
        parameters: the arm's parameters the fit started from.
        coordinates: the free parameters.
        z: their coordinates at the best point, shape (p,).
        converged: whether nothing was left to gain.
        message: why the search ended.
        rows: per record which of its rows were compared.
        errors: per record measured minus predicted, m, shape (rows, C).
    """

    parameters: ArmParameters
    coordinates: tuple[Coordinate, ...]
    z: Array
    converged: bool
    message: str
    rows: tuple[NDArray[np.int64], ...]
    errors: tuple[Array, ...]

    @property
    def values(self) -> Array:
        """Fitted values in SI units, shape (p,)."""
        return np.array([c.value(z) for c, z in zip(self.coordinates, self.z, strict=True)])

    def arm(self, session: str = "") -> Arm:
        """The fitted arm, as logs of a session see it."""
        return Arm(apply(self.parameters, self.coordinates, self.z, session))

    def starts(self) -> list[FreeParameter]:
        """The free parameters with the fitted values as their start, for a refinement from ``arm()``."""
        return [
            FreeParameter(c.path, c.sessions, start=float(v), lower=c.lower, upper=c.upper, logarithmic=c.logarithmic)
            for c, v in zip(self.coordinates, self.values, strict=True)
        ]


def fit_poses(
    arm: Arm,
    records: Sequence[Record],
    free: Iterable[FreeParameter | str],
    *,
    interval: float = 0.25,
    rows: Sequence[NDArray[np.int64]] | None = None,
    scale: float = 2e-3,
    max_evaluations: int = 40,
    progress: Callable[[float], None] | None = None,
) -> StaticFit:
    """Fit static parameters to the poses that the measured pressures hold.

    Args:
        arm: where to start from.
        records: what to fit.
        free: what to estimate; masses, stiffnesses, rest lengths, areas, gravity; never damping or inertia.
        interval: distance of the rows compared, s.
        rows: per record the rows to compare, instead of ``interval``: those of steady stretches, for example.
        scale: size of an error that is unremarkable, m; errors beyond three of it count linearly.
        max_evaluations: most steps of the search.
        progress: called with a guess of the fraction done.

    Raises:
        InputError: nothing to compare.
        ParameterError: a path the arm does not have.
        ConvergenceError: the pressures hold no pose of the starting arm.
    """
    optimize = import_extra("scipy.optimize", extra="identify", purpose="Fitting held poses")
    coordinates = resolve(arm.parameters, free)
    check_apart(coordinates, (rec.condition for rec in records))
    chosen = tuple(rows) if rows is not None else tuple(_every(rec, interval) for rec in records)
    if not any(len(r) for r in chosen):
        raise InputError("no row of the logs is left to compare")
    poses = _Poses(arm.parameters, coordinates, tuple(records), chosen, scale)
    first = poses.residuals(np.zeros(len(coordinates)))
    if np.all(first == _FAILED / scale):
        raise ConvergenceError("the starting arm holds no pose under the measured pressures; start from other values")
    bounds = np.array([c.bounds for c in coordinates]).T
    steps = 0

    def jacobian(z: Array) -> Array:
        nonlocal steps
        steps += 1
        if progress is not None:
            progress(1.0 - 0.85**steps)
        return poses.jacobian(z)

    found = optimize.least_squares(
        poses.residuals,
        np.zeros(len(coordinates)),
        jac=jacobian,
        bounds=(bounds[0] - 1e-9, bounds[1] + 1e-9),
        loss="huber",
        f_scale=3.0,
        xtol=1e-6,
        ftol=1e-6,
        max_nfev=max_evaluations,
    )
    # The search keeps a hair's breadth outside of the bounds, so that it may start on one.
    z = np.clip(np.asarray(found.x, dtype=np.float64), bounds[0], bounds[1])
    return StaticFit(
        arm.parameters, coordinates, z, found.status > 0, str(found.message), chosen, tuple(poses.errors(z))
    )


class _Poses:
    """Errors of held poses as a function of z; remembers the last poses to start the next solution from."""

    def __init__(
        self,
        parameters: ArmParameters,
        coordinates: tuple[Coordinate, ...],
        records: tuple[Record, ...],
        rows: tuple[NDArray[np.int64], ...],
        scale: float,
    ) -> None:
        self._coordinates, self._records, self._rows = coordinates, records, rows
        self._changed = conditioned(parameters, (rec.condition for rec in records))
        self._scale = scale
        self._pressures = [
            np.column_stack([np.interp(rec.time[r], rec.drive.time, p) for p in rec.drive.pressures.T])
            for rec, r in zip(records, rows, strict=True)
        ]
        self._last: list[Array | None] = [None] * len(records)

    def errors(self, z: Array, *, remember: bool = True) -> list[Array]:
        """Measured minus predicted, m, per record (rows, C); NaN where no pose is held."""
        found = []
        for k, (rec, rows) in enumerate(zip(self._records, self._rows, strict=True)):
            error = np.full((len(rows), len(rec.channels)), np.nan)
            try:
                arm = Arm(apply(self._changed[rec.condition], self._coordinates, z, rec.session))
            except ParameterError:
                found.append(error)
                continue
            shown = Observation.of(arm.parameters, rec.observation.outputs)
            poses = held_poses(arm, self._pressures[k], near=self._last[k])
            for i in np.flatnonzero(np.isfinite(poses[:, 0])):
                error[i] = rec.measured[rows[i]] - shown.at(arm, poses[i])[0]
            if remember:
                self._last[k] = poses
            found.append(error)
        return found

    def residuals(self, z: Array, *, remember: bool = True) -> Array:
        parts = []
        for rec, rows, error in zip(self._records, self._rows, self.errors(z, remember=remember), strict=True):
            filled = np.where(np.isfinite(error), error, _FAILED) / self._scale
            parts.append(np.where(rec.usable[rows], filled, 0.0).ravel())
        means = [c.prior for c in self._coordinates]
        prior = [(entry - mean) / deviation for entry, (mean, deviation) in zip(z, means, strict=True)]
        return np.concatenate([*parts, prior])

    def jacobian(self, z: Array) -> Array:
        base = self.residuals(z)
        columns = []
        for k, coordinate in enumerate(self._coordinates):
            h = _STEP if z[k] + _STEP <= coordinate.bounds[1] else -_STEP
            moved = z.copy()
            moved[k] += h
            columns.append((self.residuals(moved, remember=False) - base) / h)
        return np.column_stack(columns)


def _every(rec: Record, interval: float) -> NDArray[np.int64]:
    times = np.arange(rec.time[0], rec.time[-1], interval)
    return np.unique(np.searchsorted(rec.time, times)).astype(np.int64)
