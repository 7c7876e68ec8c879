"""What held poses show: channels of an arm that stands where pressures hold it, paper (62), behind a lag a channel.

Each channel follows its resting value through a first-order lag of its own sort (across the arm, along it, lengths), so
that an overdamped arm or lagging pressures need no integration (:mod:`bha.estimation.slow`). Where an arm swings, or
several lags follow each other, the difference is an error of the model and counts as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import BhaError, ConvergenceError
from bha.estimation.conditions import Condition, conditioned
from bha.estimation.free import Coordinate, apply
from bha.estimation.slow import SlowRecord, lag_response
from bha.parameters import ArmParameters, paths
from bha.recordings import Observation, Output

Array = NDArray[np.float64]

#: Difference of a coordinate, and of the logarithm of a lag.
_STEP, _LAG_STEP = 1e-4, 1e-3


def sort_of(output: Output) -> tuple[str, int]:
    """Channels that share a lag: lengths, positions across the base's axis and along it, section by section."""
    if output.kind != "position":
        return output.kind, output.section
    return ("along" if output.number == 3 else "across"), output.section


@dataclass(frozen=True)
class Held:
    """Poses of one record: lengths, m, shape (g, 3n), and positions of the heads, m, shape (g, n, 3).

    NaN where the pressures hold no pose; no heads at all where the parameters are not allowed.
    """

    lengths: Array
    heads: Array | None


@dataclass(frozen=True)
class HeldPoses:
    """Held poses of an arm with free parameters beside slow records.

    Attributes:
        parameters: the arm at z = 0.
        coordinates: the free parameters; none that acts on rates only.
        records: what was measured.
    """

    parameters: ArmParameters
    coordinates: tuple[Coordinate, ...]
    records: tuple[SlowRecord, ...]

    @cached_property
    def sorts(self) -> tuple[tuple[str, int], ...]:
        """The sorts of channels that have a lag each."""
        return tuple(dict.fromkeys(sort_of(output) for slow in self.records for output in slow.outputs))

    @cached_property
    def _changed(self) -> dict[Condition, ArmParameters]:
        return conditioned(self.parameters, (slow.record.condition for slow in self.records))

    def _arm(self, z: Array, condition: Condition) -> Arm | None:
        try:
            return Arm(apply(self._changed[condition], self.coordinates, z, condition.session))
        except BhaError:
            return None

    def held(self, z: Array, near: Sequence[Held] | None = None) -> list[Held]:
        """Where the pressures hold the arm, record by record; the search for each pose begins at that of ``near``."""
        found = []
        arms = {condition: self._arm(z, condition) for condition in self._changed}
        for k, slow in enumerate(self.records):
            arm = arms[slow.record.condition]
            if arm is None:
                found.append(Held(np.full((len(slow.measured), 3 * len(self.parameters.sections)), np.nan), None))
                continue
            poses = held_poses(arm, slow.pressures, slow.forces, None if near is None else near[k].lengths)
            heads = np.full((len(poses), arm.section_count, 3), np.nan)
            for row in np.flatnonzero(np.isfinite(poses[:, 0])):
                heads[row] = arm.forward_kinematics(poses[row])[0]
            found.append(Held(poses, heads))
        return found

    def shown(self, z: Array, held: Sequence[Held]) -> list[Array]:
        """What the channels show of held poses, per record (g, C); NaN where there is none."""
        found = []
        parameters = {c: apply(changed, self.coordinates, z, c.session) for c, changed in self._changed.items()}
        observations: dict[tuple[Condition, tuple[Output, ...]], Observation] = {}
        for slow, own in zip(self.records, held, strict=True):
            if own.heads is None:
                found.append(np.full(slow.measured.shape, np.nan))
                continue
            key = slow.record.condition, slow.outputs
            if key not in observations:
                observations[key] = Observation.of(parameters[key[0]], slow.outputs)
            observation = observations[key]
            lengths = own.lengths * observation.core_gains + observation.core_shifts
            found.append(observation.predicted(lengths, own.heads))
        return found

    def lagged(self, resting: Sequence[Array], lags: Array) -> list[Array]:
        """The channels behind their lags, s, shape (sorts,)."""
        found = []
        for slow, table in zip(self.records, resting, strict=True):
            own = np.array([self.sorts.index(sort_of(output)) for output in slow.outputs])
            filled, lagged = _filled(table), np.full(table.shape, np.nan)
            for sort in set(own):
                lagged[:, own == sort] = lag_response(float(lags[sort]), slow.step, filled[:, own == sort])
            found.append(np.where(np.isfinite(table), lagged, np.nan))
        return found

    def derivatives(self, z: Array, lags: Array, held: Sequence[Held]) -> list[Array]:
        """Derivatives of what is shown by z and by the logarithms of the lags, per record (g, C, p + sorts)."""
        still = self.shown(z, held)
        base, columns = self.lagged(still, lags), []
        for k, coordinate in enumerate(self.coordinates):
            h = _STEP if z[k] + _STEP <= coordinate.bounds[1] else -_STEP
            moved = z.copy()
            moved[k] += h
            there = held if all(paths.is_of_sensors(path) for path in coordinate.members) else self.held(moved, held)
            columns.append(
                [(b - a) / h for a, b in zip(base, self.lagged(self.shown(moved, there), lags), strict=True)]
            )
        for k in range(len(lags)):
            longer = lags.copy()
            longer[k] *= np.exp(_LAG_STEP)
            columns.append([(b - a) / _LAG_STEP for a, b in zip(base, self.lagged(still, longer), strict=True)])
        return [np.stack([column[r] for column in columns], axis=-1) for r in range(len(self.records))]


def held_poses(arm: Arm, pressures: Array, forces: Array | None = None, near: Array | None = None) -> Array:
    """Lengths that pressures hold, row by row, shape (g, 3n); NaN where they hold none.

    Args:
        arm: the arm.
        pressures: Pa, shape (g, inputs).
        forces: N, shape (g, n, 3).
        near: where each search begins, shape (g, 3n); NaN, or None for all: at the pose of the row before.
    """
    poses = np.full((len(pressures), 3 * arm.section_count), np.nan)
    before: Array | None = None
    for k, pressure in enumerate(pressures):
        force = None if forces is None else forces[k]
        start = before if near is None or not np.isfinite(near[k, 0]) else near[k]
        try:
            before = poses[k] = arm.static_lengths(pressure, force, start=start)
        except ConvergenceError:
            before = None
    return poses


def _filled(table: Array) -> Array:
    """The table with the value of the row before, or the first there is, where there is none."""
    good = np.flatnonzero(np.all(np.isfinite(table), axis=1))
    if len(good) in (0, len(table)):
        return table
    rows = np.arange(len(table))
    return np.asarray(table[good[np.clip(np.searchsorted(good, rows, side="right") - 1, 0, None)]])
