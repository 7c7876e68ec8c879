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

from bha import _core
from bha.estimation.arms import Arms, Case
from bha.estimation.free import Coordinate
from bha.estimation.preload import preloads_of
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
    def _arms(self) -> Arms:
        cases = (
            Case(slow.record.condition, Observation.of(self.parameters, slow.outputs), record=slow.record)
            for slow in self.records
        )
        return Arms(self.parameters, self.coordinates, tuple(cases))

    def held(self, z: Array, near: Sequence[Held] | None = None) -> list[Held]:
        """Where the pressures hold the arm, record by record; the search for each pose begins at that of ``near``."""
        found = []
        for k, slow in enumerate(self.records):
            arm, _ = self._arms.at(z, k)
            if arm is None:
                found.append(self._nowhere(slow))
                continue
            start = None if near is None else near[k].lengths
            found.append(_with_heads(arm, held_poses(arm, slow.pressures, slow.forces, start)))
        return found

    def moved(self, z: Array, points: Sequence[Array], held: Sequence[Held]) -> list[list[Held]]:
        """The poses of each of some points near ``z``, to first order from those of ``z``, record by record."""
        found: list[list[Held]] = [[] for _ in points]
        for k, slow in enumerate(self.records):
            arm, _ = self._arms.at(z, k)
            others = [self._arms.at(point, k)[0] for point in points]
            there = [other for other in others if other is not None]
            poses = iter(
                ()
                if arm is None
                else _core.moved_poses(arm, there, slow.pressures, held[k].lengths, _flat(slow.forces))
            )
            for own, other in zip(found, others, strict=True):
                own.append(self._nowhere(slow) if arm is None or other is None else _with_heads(other, next(poses)))
        return found

    def shown(self, z: Array, held: Sequence[Held]) -> list[Array]:
        """What the channels show of held poses, per record (g, C); NaN where there is none."""
        found = []
        for k, (slow, own) in enumerate(zip(self.records, held, strict=True)):
            if own.heads is None:
                found.append(np.full(slow.measured.shape, np.nan))
                continue
            _, observation = self._arms.at(z, k)
            lengths = own.lengths * observation.core_gains + observation.core_shifts
            found.append(observation.predicted(lengths, own.heads))
        return found

    def _nowhere(self, slow: SlowRecord) -> Held:
        return Held(np.full((len(slow.measured), 3 * len(self.parameters.sections)), np.nan), None)

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
        steps = [_STEP if x + _STEP <= c.bounds[1] else -_STEP for x, c in zip(z, self.coordinates, strict=True)]
        points = [z + h * e for h, e in zip(steps, np.eye(len(z)), strict=True)]
        # Where first poses tell preloads, these follow the camera.
        told = preloads_of(self.parameters) is not None
        moving = [k for k, c in enumerate(self.coordinates) if told or not all(map(paths.is_of_sensors, c.members))]
        there = dict(zip(moving, self.moved(z, [points[k] for k in moving], held), strict=True))
        for k, (point, h) in enumerate(zip(points, steps, strict=True)):
            beside = self.lagged(self.shown(point, there.get(k, held)), lags)
            columns.append([(b - a) / h for a, b in zip(base, beside, strict=True)])
        for k in range(len(lags)):
            longer = lags.copy()
            longer[k] *= np.exp(_LAG_STEP)
            columns.append([(b - a) / _LAG_STEP for a, b in zip(base, self.lagged(still, longer), strict=True)])
        return [np.stack([column[r] for column in columns], axis=-1) for r in range(len(self.records))]


def held_poses(arm: _core.Arm, pressures: Array, forces: Array | None = None, near: Array | None = None) -> Array:
    """Lengths that pressures hold, row by row, shape (g, 3n); NaN where they hold none.

    Args:
        arm: the arm.
        pressures: Pa, shape (g, inputs).
        forces: N, shape (g, n, 3).
        near: where each search begins, shape (g, 3n); NaN, or None for all: at the pose of the row before.
    """
    return _core.held_poses(arm, pressures, _flat(forces), near)


def _flat(forces: Array | None) -> Array | None:
    return None if forces is None else forces.reshape(len(forces), -1)


def _with_heads(arm: _core.Arm, lengths: Array) -> Held:
    """Poses with the positions of their heads."""
    good = np.isfinite(lengths[:, 0])
    heads = np.full((len(lengths), lengths.shape[1] // 3, 3), np.nan)
    heads[good] = arm.forward_kinematics(lengths[good])[0]
    return Held(lengths, heads)


def _filled(table: Array) -> Array:
    """The table with the value of the row before, or the first there is, where there is none."""
    good = np.flatnonzero(np.all(np.isfinite(table), axis=1))
    if len(good) in (0, len(table)):
        return table
    rows = np.arange(len(table))
    return np.asarray(table[good[np.clip(np.searchsorted(good, rows, side="right") - 1, 0, None)]])
