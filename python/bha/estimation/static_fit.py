"""Joint fit of what a slow arm tells: poses that the pressures hold, paper (62), against measured lengths and heads.

The paper identifies longitudinal and bending stiffness one after the other from steady states (section IV-C and D);
here all static parameters are fitted to chosen rows at once, from the arm's own values and without lags: what
:mod:`bha.estimation.statics` does from any guess, for those who choose rows and parameters themselves. What lags is
left to the refinement by simulation, for which this fit is the start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError, InputError
from bha.estimation.conditions import check_apart
from bha.estimation.dense import minimize
from bha.estimation.free import Coordinate, FreeParameter, apply, resolve
from bha.estimation.held import HeldPoses
from bha.estimation.records import Record
from bha.estimation.slow import SlowRecord
from bha.estimation.statics import Search
from bha.parameters import ArmParameters
from bha.support.shown import short_repr

Array = NDArray[np.float64]


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
        errors: per record measured minus predicted, m, shape (rows, C); NaN where no pose is held or nothing was read.
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
    coordinates = resolve(arm.parameters, free)
    check_apart(coordinates, (rec.condition for rec in records))
    chosen = tuple(rows) if rows is not None else tuple(_every(rec, interval) for rec in records)
    if not any(len(r) for r in chosen):
        raise InputError("no row of the logs is left to compare")
    slow = tuple(_at_rows(rec, own, interval) for rec, own in zip(records, chosen, strict=True) if len(own))
    poses, start = HeldPoses(arm.parameters, coordinates, slow), np.zeros(len(coordinates))
    search = Search(poses, [np.full(len(own.outputs), scale) for own in slow], poses.held(start), lagging=False)
    if not any(np.isfinite(held.lengths).any() for held in search.held):
        raise ConvergenceError("the starting arm holds no pose under the measured pressures; start from other values")
    steps = 0

    def jacobian(z: Array, left: Array) -> Array:
        nonlocal steps
        steps += 1
        if progress is not None:
            progress(1.0 - 0.85**steps)
        return search.jacobian(z, left)

    found = minimize(
        search.residuals, jacobian, start, search.bounds, huber=3.0, max_iterations=max_evaluations, tolerance=1e-6
    )
    message = "nothing left to gain" if found.converged else f"not converged after {found.iterations} steps"
    errors = iter(search.errors(found.z))
    tables = [
        _filled(rec, next(errors)) if len(own) else _filled(rec, None) for rec, own in zip(records, chosen, strict=True)
    ]
    return StaticFit(arm.parameters, coordinates, found.z, found.converged, message, chosen, tuple(tables))


def _at_rows(rec: Record, rows: NDArray[np.int64], interval: float) -> SlowRecord:
    """Some rows of a record as cells of a slow one."""
    kept = [k for k, output in enumerate(rec.observation.outputs) if output.kind != "orientation"]
    drive, time = rec.drive, rec.time[rows]
    pressures = np.column_stack([np.interp(time, drive.time, p) for p in drive.pressures.T])
    forces = None if drive.forces is None else np.asarray(drive.forces[rec.rows[rows]])
    measured = np.where(rec.usable[rows], rec.measured[rows], np.nan)[:, kept]
    outputs = tuple(rec.observation.outputs[k] for k in kept)
    return SlowRecord(rec, outputs, interval, pressures, forces, measured)


def _filled(rec: Record, errors: Array | None) -> Array:
    """Errors of all channels of a record, NaN for orientations, which take no part."""
    table = np.full((0 if errors is None else len(errors), len(rec.channels)), np.nan)
    if errors is not None:
        table[:, [output.kind != "orientation" for output in rec.observation.outputs]] = errors
    return table


def _every(rec: Record, interval: float) -> NDArray[np.int64]:
    times = np.arange(rec.time[0], rec.time[-1], interval)
    return np.unique(np.searchsorted(rec.time, times)).astype(np.int64)
