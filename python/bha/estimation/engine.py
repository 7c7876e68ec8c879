"""The model that is fitted: an arm at some coordinates with its effects and sensors, shown on records.

What: every number that may change is a :class:`bha.estimation.free.Coordinate`; those of the arm and of its sensors
first, then those of the effects that are tried beside what the arm has. At a point z the model says which arm a log
sees (its session and known changes count) and how its outputs follow, and simulates them.
Derivatives are forward differences over one batch: the step is fixed, so that a prediction is a smooth function of
parameters and initial state and the differences are good to about 1e-6 of the derivative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.arm import Arm
from bha.arm.variants import with_effects
from bha.errors import ConvergenceError
from bha.estimation.arms import Arms, Case
from bha.estimation.conditions import Condition, check_apart
from bha.estimation.derived import Core, core_of, described
from bha.estimation.free import Coordinate, apply
from bha.estimation.initial import guess_state
from bha.estimation.memories import MOST, remembering
from bha.estimation.records import Record, Window
from bha.estimation.runs import BATCH_VALUES, Integration, Run
from bha.estimation.terms import EffectTerm, tables_of
from bha.parameters import ArmParameters, paths
from bha.recordings import Observation
from bha.recordings.outputs import longest_sensor_delay

Array = NDArray[np.float64]

#: Outputs by parameters and by initial states of a window: what is shown (rows, C), by z (..., p), by state (..., 6n).
Linearized = tuple[Array, Array, Array]


@dataclass(frozen=True)
class Differences:
    """How derivatives are taken.

    Attributes:
        parameter: difference of a parameter's coordinate z.
        length: of an initial length, m.
        rate: of an initial rate, m/s.
        moved: of where a memory stands, in shares (:mod:`bha.estimation.memories`).
        shift: least difference of a dead time, s: what bends within the integrator's steps, and not at their ends, is
            another error of the integrator, which a smaller one would pass for a derivative.
        memory: time after which an arm has forgotten how it began, s: derivatives by initial lengths and rates end
            there.
        lenient: whether a run that fails tells nothing, instead of being an error.
    """

    parameter: float = 1e-5
    length: float = 1e-6
    rate: float = 1e-5
    moved: float = 1e-3
    shift: float = 1e-3
    memory: float = np.inf
    lenient: bool = False


@dataclass(frozen=True)
class Near:
    """What a coarse step must show for differences between its runs to mean something.

    Attributes:
        outputs: what the fine step shows, per window (rows, C).
        error: greatest root mean square difference to it.
    """

    outputs: tuple[Array, ...]
    error: float


@dataclass(frozen=True)
class Model:
    """An arm in coordinates with records to show it on: a function from (z, initial states) to outputs.

    Attributes:
        parameters: the arm at z = 0 (but for starts that differ from it).
        plain: the coordinates of the arm and of its sensors.
        records: what it is compared with.
        integration: how runs are integrated.
        effects: what is tried beside the arm's own effects; their coordinates follow the plain ones in z.
        differences: how derivatives are taken.
        remembers: whether an initial state says too where what effects remember stands, one number a bellows behind
            lengths and rates (:mod:`bha.estimation.memories`).
    """

    parameters: ArmParameters
    plain: tuple[Coordinate, ...]
    records: tuple[Record, ...] = ()
    integration: Integration = field(default_factory=Integration)
    effects: tuple[EffectTerm, ...] = ()
    differences: Differences = field(default_factory=Differences)
    remembers: bool = False

    def __post_init__(self) -> None:
        """Refuse numbers that are both known and free."""
        check_apart(self.plain, (rec.condition for rec in self.records))

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """All of them, in the order of z."""
        return (*self.plain, *(c for effect in self.effects for c in effect.coordinates))

    @property
    def size(self) -> int:
        """Length of z."""
        return len(self.coordinates)

    @property
    def sections(self) -> int:
        """Number of sections."""
        return len(self.parameters.sections)

    def on(self, records: Sequence[Record]) -> Model:
        """The same model, shown on other records."""
        return self if tuple(records) == self.records else replace(self, records=tuple(records))

    def with_effects(self, effects: Sequence[EffectTerm]) -> Model:
        """The same plain arm with other effects."""
        return replace(self, effects=tuple(effects))

    def place(self, number: int) -> slice:
        """Where the coordinates of one effect stand in z."""
        first = len(self.plain) + sum(len(e.coordinates) for e in self.effects[:number])
        return slice(first, first + len(self.effects[number].coordinates))

    def split(self, z: Array) -> tuple[Array, list[Array]]:
        """Plain coordinates, and those of each effect."""
        return self._arms.split(z)

    def values(self, z: Array) -> dict[str, float]:
        """All values by name."""
        return {c.name: c.value(float(v)) for c, v in zip(self.coordinates, z, strict=True)}

    @cached_property
    def core(self) -> Core:
        """The core's description of the arm as its file has it."""
        return core_of(self.parameters)

    def description(self, z: Array) -> Core:
        """The core's description of the arm at z, effects included, as a log without session and changes sees it."""
        plain, parts = self.split(z)
        values = [c.value(float(v)) for c, v in zip(self.plain, plain, strict=True)]
        core = described(self.parameters, self.plain, values)
        return dict(with_effects(core, tables_of(self.effects, parts)))

    def arm(self, z: Array, condition: Condition = Condition()) -> Arm:  # noqa: B008  (frozen)
        """The arm at z with its parameters, as logs of a condition see it; for coordinates of the file alone.

        Raises:
            ParameterError: values that no arm can have.
        """
        assert not self.effects
        assert all(c.members for c in self.plain)
        changed = self._arms.changed.get(condition)
        parameters = condition.applied(self.parameters) if changed is None else changed
        return Arm(apply(parameters, self.plain, z, condition.session))

    def shown(self, z: Array, record: int) -> tuple[_core.Arm | None, Observation]:
        """The arm at z that a record sees, None where no arm has the values, and the outputs as that shows them."""
        return self._arms.at(z, record)

    def run(self, z: Array, window: Window, state: Array) -> Run:
        """The run of a window at z; without an arm where the parameters are not allowed."""
        arm, observation = self.shown(z, window.record)
        rec = self.records[window.record]
        moving, moved = np.split(state, [6 * self.sections])
        return Run(arm, observation, rec, moving, window.first, window.last, lead=self._lead, moved=moved)

    def runs(self, z: Array, states: Sequence[Array] | Array, rows: Sequence[int] | None = None) -> list[Run]:
        """A run at z on each record, over all its rows or so many."""
        last = [len(rec) for rec in self.records] if rows is None else rows
        windows = [Window(k, 0, end) for k, end in enumerate(last)]
        return [self.run(z, window, state) for window, state in zip(windows, states, strict=True)]

    def guesses(self, z: Array, windows: Sequence[Window]) -> Array:
        """Initial states of windows as the measurements around their starts have them, shape (windows, 6n).

        Raises:
            ConvergenceError: no arm has the values.
        """
        found = []
        for window in windows:
            arm, observation = self.shown(z, window.record)
            if arm is None:
                raise ConvergenceError("no arm has the values at which initial states are wanted")
            rec = self.records[window.record]
            found.append(guess_state(arm, self.parameters, observation, rec, window.first))
        states = np.stack(found)
        if not self.remembers:
            return states
        return np.hstack([states, np.zeros((len(states), len(np.concatenate(self.parameters.inputs_of_bellows))))])

    def predict(self, z: Array, windows: Sequence[Window], states: Array) -> list[Array]:
        """Predicted channels of each window, shapes (rows, C); NaN from where a simulation failed.

        Args:
            z: coordinates, shape (p,).
            windows: the windows.
            states: initial states of each, shape (windows, 6n), or with what is remembered (:attr:`remembers`).
        """
        return self.integration.run([self.run(z, w, state) for w, state in zip(windows, states, strict=True)])

    def predict_each(self, points: Sequence[tuple[Array, Array]], windows: Sequence[Window]) -> list[list[Array]]:
        """As :meth:`predict` for several points (z, initial states) abreast."""
        runs = [self.run(z, w, own) for z, states in points for w, own in zip(windows, states, strict=True)]
        shown = iter(self.integration.run(runs))
        return [[next(shown) for _ in windows] for _ in points]

    def linearize(
        self,
        z: Array,
        windows: Sequence[Window],
        states: Array,
        *,
        which: Sequence[int] | None = None,
        by_states: bool = True,
        near: Near | None = None,
    ) -> Iterator[Linearized]:
        """Per window the prediction (rows, C), its derivative by z (rows, C, p) and by the initial state (rows, C, 6n).

        Windows come one after the other, so that a long log's derivatives need not be in memory all at once.

        Args:
            z: coordinates, shape (p,).
            windows: the windows.
            states: initial states of each, shape (windows, 6n).
            which: coordinates by which derivatives are taken; all if None.
            by_states: whether they are taken by initial states too; else none of those are there.
            near: where the coarse step may be taken.

        Raises:
            ConvergenceError: a simulation at z itself fails.
        """
        moved = [self._moved(k, z) for k in (range(len(z)) if which is None else which)]
        acting = [[self.coordinates[k].acts_on(rec.session) for k, _, _ in moved] for rec in self.records]
        n = states.shape[1] if by_states else 0
        for chunk in self._chunks(windows, 1 + len(moved) + n):
            runs: list[Run] = []
            steps = {w: self._state_steps(windows[w], states[w][:n]) for w in chunk}
            for w in chunk:
                window = windows[w]
                base = self.run(z, window, states[w])
                if base.arm is None:
                    raise ConvergenceError("the model cannot be linearized where its parameters are not allowed")
                runs.append(base)
                for (k, changed, _), acts in zip(moved, acting[window.record], strict=True):
                    if acts:
                        runs.append(self.run(changed, window, states[w]))
                        if runs[-1].arm is None and not self.differences.lenient:
                            name = self.coordinates[k].name
                            raise ConvergenceError(f"{name}: no derivative at the edge of what is allowed")
                for place, step in steps[w]:
                    # A band that is not crossed is remembered for ever.
                    last = self._remembered(window) if place < 6 * self.sections else window.last
                    runs.append(replace(self.run(z, window, states[w] + step), last=last))
            found = iter(self._abreast(runs, chunk, near))
            for w in chunk:
                center = next(found)
                by_z = np.zeros((*center.shape, len(moved)))
                for place, ((_, _, h), acts) in enumerate(zip(moved, acting[windows[w].record], strict=True)):
                    if acts:
                        by_z[..., place] = (next(found) - center) / h
                by_state = np.zeros((*center.shape, n))
                for place, step in steps[w]:
                    table = next(found)
                    by_state[: len(table), :, place] = (table - center[: len(table)]) / step[place]
                if self.differences.lenient:
                    by_z, by_state = np.nan_to_num(by_z), np.nan_to_num(by_state)
                yield center, by_z, by_state

    def _abreast(self, runs: Sequence[Run], chunk: Sequence[int], near: Near | None) -> list[Array]:
        """Outputs of runs, the first of each window at z itself, all at one step: their differences are wanted."""
        if near is not None and self.integration.coarse is not None:
            found = self.integration.run(runs, coarse=True)
            base, wanted = _first_of_each(runs, found), [near.outputs[w] for w in chunk]
            if root_mean_square(base, wanted) <= near.error:
                return found
        return self.integration.run(runs)

    def _state_steps(self, window: Window, state: Array) -> list[tuple[int, Array]]:
        """The numbers of a window's initial state by which there are derivatives, each with the step that is taken."""
        count, differences = 3 * self.sections, self.differences
        each = np.repeat([differences.length, differences.rate], count)[: len(state)]
        places = list(range(len(each)))
        if len(state) > len(each):
            memories = state[len(each) :]
            # At the end of what is remembered only the other side is left.
            each = np.concatenate([each, np.where(memories + differences.moved > MOST, -1.0, 1.0) * differences.moved])
            places += [len(state) - len(memories) + int(k) for k in np.flatnonzero(self.memories(window))]
        return [(place, each[place] * np.eye(1, len(state), place)[0]) for place in places]

    def memories(self, window: Window) -> NDArray[np.bool_]:
        """Which bellows remember what was before a window, shape (bellows,); none where the arm stands at first."""
        record = self.records[window.record]
        own = [(effect.kind, effect.where) for effect in self.parameters.effects]
        own += [(effect.kind, effect.where) for effect in self.effects]
        found = remembering(self.parameters, own, commanded=record.drive.commanded)
        return found & (window.first > 0 or record.resting is None)

    def _remembered(self, window: Window) -> int:
        """The row of a window after which its initial state is forgotten."""
        if not np.isfinite(self.differences.memory):
            return window.last
        time = self.records[window.record].time
        return min(int(np.searchsorted(time, time[window.first] + self.differences.memory)) + 1, window.last)

    def _moved(self, k: int, z: Array) -> tuple[int, Array, float]:
        """A coordinate, the point with it moved on the side on which it stays within its bounds, and by how much."""
        own = self.coordinates[k]
        step = self.differences.parameter
        if paths.is_dead_time(own.path):
            step = max(step, self.differences.shift / own.scale)
        _, upper = own.bounds
        h = -step if z[k] + step > upper else step
        changed = z.copy()
        changed[k] += h
        return k, changed, h

    def _chunks(self, windows: Sequence[Window], members: int) -> list[list[int]]:
        """Windows in groups whose predictions fit into memory; windows of like length together."""
        n = 6 * self.sections
        chunks: list[list[int]] = [[]]
        longest = 0
        for k, window in enumerate(windows):
            rows = self._grid_rows(window)
            longest = max(longest, rows)
            if chunks[-1] and (len(chunks[-1]) + 1) * members * longest * n > BATCH_VALUES:
                chunks.append([])
                longest = rows
            chunks[-1].append(k)
        return chunks

    def _grid_rows(self, window: Window) -> int:
        time = self.records[window.record].time
        return int((time[window.last - 1] - time[window.first]) / self.integration.length()) + 2

    @cached_property
    def _lead(self) -> float:
        """How much earlier a run begins: its sensors may be behind."""
        return 1.5 * longest_sensor_delay(self.parameters)

    @cached_property
    def _arms(self) -> Arms:
        cases = (Case(rec.condition, rec.observation, rec.drive.commanded, rec) for rec in self.records)
        return Arms(self.parameters, self.plain, tuple(cases), self.effects)


def root_mean_square(first: Sequence[Array], second: Sequence[Array]) -> float:
    """Root mean square difference of the outputs of two sets of runs; NaN where one failed."""
    return float(np.sqrt(np.mean([np.mean((a - b) ** 2) for a, b in zip(first, second, strict=True)])))


def _first_of_each(runs: Sequence[Run], found: Sequence[Array]) -> list[Array]:
    """What the first run of each stretch of a record shows."""
    seen: dict[tuple[int, int], Array] = {}
    for run, table in zip(runs, found, strict=True):
        seen.setdefault(run.log, table)
    return list(seen.values())
