"""Predictions of many parameter sets over many windows, and their derivatives, in one batch of simulations.

Derivatives are forward differences over the batch: the step is fixed, so
that a prediction is a smooth function of parameters and initial state and the differences are good to about 1e-6 of the
derivative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError
from bha.estimation.arms import Arms, Case
from bha.estimation.conditions import Condition, check_apart
from bha.estimation.free import Coordinate, apply
from bha.estimation.records import Record, Window
from bha.estimation.runs import Run, outputs
from bha.parameters import ArmParameters
from bha.recordings.outputs import longest_sensor_delay
from bha.runs.options import Method

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

    def arm(self, z: Array, condition: Condition = Condition()) -> Arm:  # noqa: B008  (frozen)
        """The arm at ``z``, as logs of a condition see it.

        Raises:
            ParameterError: values that no arm can have.
        """
        changed = self._arms.changed.get(condition)
        parameters = condition.applied(self.parameters) if changed is None else changed
        return Arm(apply(parameters, self.coordinates, z, condition.session))

    def predict(self, z: Array, windows: Sequence[Window], states: Array) -> list[Array]:
        """Predicted channels of each window, shapes (rows, C); NaN from where a simulation failed.

        Args:
            z: coordinates of the free parameters, shape (p,).
            windows: the windows.
            states: initial lengths and rates of each, shape (windows, 6n).
        """
        runs = [self._at(z, w, state) for w, state in zip(windows, states, strict=True)]
        return self._outputs(runs)

    def predict_each(self, points: Sequence[tuple[Array, Array]], windows: Sequence[Window]) -> list[list[Array]]:
        """As :meth:`predict` for several points (z, initial states) abreast."""
        runs = [self._at(z, w, own) for z, states in points for w, own in zip(windows, states, strict=True)]
        shown = iter(self._outputs(runs))
        return [[next(shown) for _ in windows] for _ in points]

    def linearize(self, z: Array, windows: Sequence[Window], states: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Per window the prediction (rows, C), its derivative by z (rows, C, p) and by the initial state (rows, C, 6n).

        Windows come one after the other, so that a long log's derivatives need not be in memory all at once.

        Raises:
            ConvergenceError: a simulation at ``z`` itself fails.
        """
        p, n = len(z), states.shape[1]
        moved = [self._moved(k, z) for k in range(p)]
        steps = np.where(np.arange(n) < n // 2, LENGTH_STEP, RATE_STEP)
        for chunk in self._chunks(windows, 1 + p + n):
            runs: list[Run] = []
            for w in chunk:
                base = self._at(z, windows[w], states[w])
                if base.arm is None:
                    raise ConvergenceError("the model cannot be linearized where its parameters are not allowed")
                runs.append(base)
                session = base.record.session
                for k, (changed, _) in enumerate(moved):
                    if self.coordinates[k].acts_on(session):
                        runs.append(self._at(changed, windows[w], states[w]))
                        if runs[-1].arm is None:
                            name = self.coordinates[k].name
                            raise ConvergenceError(f"{name}: no derivative at the edge of what is allowed")
                runs += [replace(base, state=states[w] + h * e) for h, e in zip(steps, np.eye(n), strict=True)]
            outputs = iter(self._outputs(runs))
            for w in chunk:
                session = self.records[windows[w].record].session
                center = next(outputs)
                by_z = np.zeros((*center.shape, p))
                for k, (_, h) in enumerate(moved):
                    if self.coordinates[k].acts_on(session):
                        by_z[..., k] = (next(outputs) - center) / h
                by_state = np.stack([(next(outputs) - center) / h for h in steps], axis=-1)
                yield center, by_z, by_state

    def _moved(self, k: int, z: Array) -> tuple[Array, float]:
        """The point with one coordinate moved, on the side on which it stays within its bounds, and by how much."""
        _, upper = self.coordinates[k].bounds
        h = -PARAMETER_STEP if z[k] + PARAMETER_STEP > upper else PARAMETER_STEP
        changed = z.copy()
        changed[k] += h
        return changed, h

    def _chunks(self, windows: Sequence[Window], members: int) -> list[list[int]]:
        """Windows in groups whose predictions fit into memory; windows of like length together."""
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

    def _at(self, z: Array, window: Window, state: Array) -> Run:
        """The run of a window at ``z``; without an arm where the parameters are not allowed."""
        rec = self.records[window.record]
        arm, observation = self._arms.at(z, window.record)
        return Run(arm, observation, rec, state, window.first, window.last, lead=self._lead)

    def _outputs(self, runs: Sequence[Run]) -> list[Array]:
        return outputs(runs, self.step, method=self.method, threads=self.threads)

    @cached_property
    def _lead(self) -> float:
        """How much earlier a run begins: its sensors may be behind."""
        return 1.5 * longest_sensor_delay(self.parameters)

    @cached_property
    def _arms(self) -> Arms:
        cases = (Case(rec.condition, rec.observation, rec.drive.commanded) for rec in self.records)
        return Arms(self.parameters, self.coordinates, tuple(cases))
