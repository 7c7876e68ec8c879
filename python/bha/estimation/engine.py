"""Predictions of many parameter sets over many windows, and their derivatives, in one batch of simulations.

Every window is simulated on a grid of the integrator's own steps (``bha.estimation.grid``), so that windows of
equal length share the lanes of the batch. Derivatives are forward differences over the batch: the step is fixed, so
that a prediction is a smooth function of parameters and initial state and the differences are good to about 1e-6 of the
derivative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError, ParameterError
from bha.estimation.conditions import Condition, check_apart, conditioned
from bha.estimation.free import Coordinate, apply
from bha.estimation.grid import Grid, averaged, grid_of
from bha.estimation.records import Record, Window
from bha.parameters import ArmParameters, paths
from bha.recordings import Observation
from bha.recordings.outputs import longest_sensor_delay
from bha.runs.options import Method
from bha.simulation.batch import Batch, simulate_batch

Array = NDArray[np.float64]

#: Difference of a parameter's coordinate z, of an initial length (m) and of an initial rate (m/s).
PARAMETER_STEP = 1e-5
LENGTH_STEP = 1e-6
RATE_STEP = 1e-5
#: Steps of the fixed-step integrator that are tried, from coarse to fine, s.
STEPS = (0.02, 0.01, 0.005, 0.0025, 0.00125, 0.0006)
#: Numbers a batch may hold at once.
_BATCH_VALUES = 60_000_000


@dataclass(frozen=True)
class Model:
    """An arm with free parameters and records to compare it with: a function from (z, initial states) to predictions.

    Attributes:
        parameters: the arm at z = 0 (but for starts that differ from it).
        coordinates: the free parameters.
        records: what it is compared with.
        step: step of the integrator, s.
        method: the integrator, ``"rk4"`` or, for arms whose damping makes them stiff, ``"ros2"``.
        threads: threads of the batch; all cores if None.
    """

    parameters: ArmParameters
    coordinates: tuple[Coordinate, ...]
    records: tuple[Record, ...]
    step: float = 2.5e-3
    method: Method = "rk4"
    threads: int | None = None

    def __post_init__(self) -> None:
        """Refuse numbers that are both known and free."""
        check_apart(self.coordinates, (rec.condition for rec in self.records))

    @cached_property
    def _changed(self) -> dict[Condition, ArmParameters]:
        return conditioned(self.parameters, (rec.condition for rec in self.records))

    def arm(self, z: Array, condition: Condition = Condition()) -> Arm:  # noqa: B008  (frozen)
        """The arm at ``z``, as logs of a condition see it.

        Raises:
            ParameterError: values that no arm can have.
        """
        changed = self._changed.get(condition)
        parameters = condition.applied(self.parameters) if changed is None else changed
        return Arm(apply(parameters, self.coordinates, z, condition.session))

    def predict(self, z: Array, windows: Sequence[Window], states: Array) -> list[Array]:
        """Predicted channels of each window, shapes (rows, C); NaN from where a simulation failed.

        Args:
            z: coordinates of the free parameters, shape (p,).
            windows: the windows.
            states: initial lengths and rates of each, shape (windows, 6n).
        """
        arms = self._arms(z)
        if arms is None:
            return [np.full((w.last - w.first, len(self.records[w.record].channels)), np.nan) for w in windows]
        members = [(arms[self.records[w.record].condition], w, state) for w, state in zip(windows, states, strict=True)]
        return self._run(members)

    def predict_each(
        self, points: Sequence[tuple[Array, Array]], windows: Sequence[Window]
    ) -> list[list[Array] | None]:
        """As :meth:`predict` for several points (z, initial states) abreast; None where parameters are not allowed."""
        arms = [self._arms(z) for z, _ in points]
        members = [
            (own[self.records[w.record].condition], w, state)
            for own, (_, states) in zip(arms, points, strict=True)
            if own is not None
            for w, state in zip(windows, states, strict=True)
        ]
        shown = iter(self._run(members) if members else [])
        return [None if own is None else [next(shown) for _ in windows] for own in arms]

    def linearize(self, z: Array, windows: Sequence[Window], states: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Per window the prediction (rows, C), its derivative by z (rows, C, p) and by the initial state (rows, C, 6n).

        Windows come one after the other, so that a long log's derivatives need not be in memory all at once.

        Raises:
            ConvergenceError: a simulation at ``z`` itself fails.
        """
        p, n = len(z), states.shape[1]
        base = self._arms(z)
        if base is None:
            raise ConvergenceError("the model cannot be linearized where its parameters are not allowed")
        varied = []
        for k in range(p):
            h = PARAMETER_STEP * self._direction(k, z)
            changed = z.copy()
            changed[k] += h
            arms = self._arms(changed)
            if arms is None:
                raise ConvergenceError(f"{self.coordinates[k].name}: no derivative at the edge of what is allowed")
            varied.append((arms, h))
        steps = np.where(np.arange(n) < n // 2, LENGTH_STEP, RATE_STEP)
        for chunk in self._chunks(windows, 1 + p + n):
            members = []
            for w in chunk:
                condition = self.records[windows[w].record].condition
                members.append((base[condition], windows[w], states[w]))
                for k, (arms, _) in enumerate(varied):
                    scope = self.coordinates[k].sessions
                    if not scope or condition.session in scope:
                        members.append((arms[condition], windows[w], states[w]))
                members += [
                    (base[condition], windows[w], states[w] + h * e) for h, e in zip(steps, np.eye(n), strict=True)
                ]
            outputs = iter(self._run(members))
            for w in chunk:
                session = self.records[windows[w].record].session
                center = next(outputs)
                by_z = np.zeros((*center.shape, p))
                for k, (_, h) in enumerate(varied):
                    scope = self.coordinates[k].sessions
                    if not scope or session in scope:
                        by_z[..., k] = (next(outputs) - center) / h
                by_state = np.stack([(next(outputs) - center) / h for h in steps], axis=-1)
                yield center, by_z, by_state

    def _direction(self, k: int, z: Array) -> float:
        """The side on which a difference stays within the bounds."""
        _, upper = self.coordinates[k].bounds
        return -1.0 if z[k] + PARAMETER_STEP > upper else 1.0

    def _arms(self, z: Array) -> dict[Condition, Arm] | None:
        try:
            return {condition: self.arm(z, condition) for condition in self._changed}
        except ParameterError:
            return None

    def _chunks(self, windows: Sequence[Window], members: int) -> list[list[int]]:
        """Windows in groups whose batch fits into memory; windows of like length together, since batches are padded."""
        n = 6 * len(self.parameters.sections)
        chunks: list[list[int]] = [[]]
        longest = 0
        for k, window in enumerate(windows):
            rows = self._grid_rows(window)
            longest = max(longest, rows)
            if chunks[-1] and (len(chunks[-1]) + 1) * members * longest * n > _BATCH_VALUES:
                chunks.append([])
                longest = rows
            chunks[-1].append(k)
        return chunks

    def _grid_rows(self, window: Window) -> int:
        time = self.records[window.record].time
        return int((time[window.last - 1] - time[window.first]) / self.step) + 2

    def _run(self, members: Sequence[tuple[Arm, Window, Array]]) -> list[Array]:
        pieces = dict.fromkeys(w for _, w, _ in members)
        lead = 1.5 * longest_sensor_delay(self.parameters)
        grids = {w: self._grid(w, lead) for w in pieces}
        drives = {w.record: averaged(self.records[w.record].drive, self.step) for w in grids}
        own, runs = self._runs(members)
        times = np.full((len(runs), max(len(g.time) for g in grids.values())), np.nan)
        for k, (_, w, _) in enumerate(runs):
            times[k, : len(grids[w].time)] = grids[w].time
        batch: Batch = simulate_batch(
            [arm for arm, _, _ in runs],
            [drives[w.record] for _, w, _ in runs],
            np.stack([state for _, _, state in runs]),
            times=times,
            start=times[:, 0].copy(),
            method=self.method,
            step=self.step * (1.0 + 1e-9),
            velocities=False,
            head_positions=any(rec.observation.needs_positions for rec in self.records),
            head_orientations=any(rec.observation.needs_orientations for rec in self.records),
            measured=True,
            threads=self.threads,
            warn=False,
        )
        seen: dict[tuple[int, int], Observation] = {}
        outputs = []
        for k, (arm, w, _) in zip(own, members, strict=True):
            grid = grids[w]
            if (id(arm), w.record) not in seen:
                seen[id(arm), w.record] = Observation.of(arm.parameters, self.records[w.record].observation.outputs)
            heads, turns = (
                None if table is None else table[k, : len(grid.time)]
                for table in (batch.head_positions, batch.head_orientations)
            )
            shown = seen[id(arm), w.record].predicted(batch.lengths[k, : len(grid.time)], heads, turns)
            outputs.append(grid.at_rows(shown))
        return outputs

    def _runs(self, members: Sequence[tuple[Arm, Window, Array]]) -> tuple[list[int], list[tuple[Arm, Window, Array]]]:
        """For each member its simulation, and these: members whose arms differ in sensors only share one."""
        if not any(paths.is_of_sensors(c.path) for c in self.coordinates):
            return list(range(len(members))), list(members)
        moving = {id(arm): arm.parameters.to_core_json() for arm, _, _ in members}
        runs: dict[tuple[str, Window, bytes], int] = {}
        own = [runs.setdefault((moving[id(arm)], w, state.tobytes()), len(runs)) for arm, w, state in members]
        return own, [members[own.index(k)] for k in range(len(runs))]

    def _grid(self, window: Window, lead: float) -> Grid:
        """The grid of a window: begun earlier by what its sensors are behind, as far as the log goes back."""
        rec = self.records[window.record]
        rows = rec.time[window.first : window.last]
        return grid_of(rows, self.step, start=max(float(rec.time[0]), float(rows[0]) - lead))
