"""Simulated outputs of stretches of records, many at a time: the one way from estimation into the batch.

What: each run is one arm from one state, driven as a record was or otherwise, and shown as that record's outputs at its
rows. Runs that are the same motion (they differ in sensors only) are simulated once, the others together, so that they
share lanes; as many in one batch as memory allows.
Steps of the integrator end at the rows where rows are a whole number of steps apart, else on an even grid from which
rows are read (:mod:`bha.estimation.grid`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.estimation.grid import Grid, averaged, graded, grid_of
from bha.estimation.records import Record
from bha.recordings import Observation
from bha.runs.input import Input
from bha.runs.options import Method, Options
from bha.simulation.batch import run_members

Array = NDArray[np.float64]

#: Numbers a batch may hold at once.
BATCH_VALUES = 60_000_000
#: Distances of outputs are steps but for rounding: the integrator's step is longer by this part.
_SLACK = 1e-5


@dataclass(frozen=True, eq=False)
class Run:
    """One simulation.

    Attributes:
        arm: the arm; None where the parameters are none of an arm.
        observation: the outputs, as this arm shows them.
        record: the log.
        state: lengths and rates at the start, m and m/s, shape (6n,).
        first: the first row shown.
        last: the row after the last one shown; all rows of the record if None.
        drive: what drives the arm in place of the record.
        lead: how much earlier than the first row the run starts, s, as far as the record goes back.
        moved: where what each bellows remembers stands at the start (:mod:`bha.estimation.memories`), shape (bellows,);
            empty where all are at rest.
    """

    arm: _core.Arm | None
    observation: Observation
    record: Record
    state: Array
    first: int = 0
    last: int | None = None
    drive: Input | None = None
    lead: float = 0.0
    moved: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def possible(self) -> bool:
        """Whether there is an arm and a state to begin with."""
        return self.arm is not None and bool(np.all(np.isfinite(self.state)))

    @property
    def log(self) -> tuple[int, int]:
        """Runs with the same one begin together."""
        return id(self.record), self.first

    @property
    def stretch(self) -> tuple[int, int, int, float]:
        """Runs with the same one have the same rows."""
        return id(self.record), self.first, self.end, self.lead

    @property
    def end(self) -> int:
        """The row after the last one shown."""
        return len(self.record) if self.last is None else self.last

    def grid(self, step: float) -> Grid:
        """Where the integrator's steps end, and how rows follow."""
        rows = self.record.time[self.first : self.end]
        return grid_of(rows, step, start=max(float(self.record.time[0]), float(rows[0]) - self.lead))

    def nothing(self) -> Array:
        """What a run that fails at once shows."""
        return np.full((self.end - self.first, len(self.observation.outputs)), np.nan)


@dataclass(frozen=True)
class Integration:
    """How runs are integrated: with one fixed step, so that what they show is a smooth function of all values.

    Attributes:
        step: of the integrator, s.
        method: the integrator, ``"rk4"`` or, for arms whose damping makes them stiff, ``"ros2"``.
        threads: of the batch; all cores if None.
        coarse: step where only differences between runs are wanted, s, whose errors cancel to first order; ``step`` if
            None.
        finer: both are divided by this.
        shares: of the step, tried in turn where a run fails: it was chosen for one arm, and an effect (quadratic
            damping, a wall) may make a stiffer one of it. All runs of the same rows are repeated then, since their
            differences only mean something at the same step.
    """

    step: float = 2.5e-3
    method: Method = "rk4"
    threads: int | None = None
    coarse: float | None = None
    finer: int = 1
    shares: tuple[float, ...] = (1.0,)

    def once(self) -> Integration:
        """The same, with runs that fail left as they are."""
        return replace(self, shares=(1.0,))

    def length(self, *, coarse: bool = False) -> float:
        """The step, s."""
        return (self.coarse if coarse and self.coarse is not None else self.step) / self.finer

    def run(self, runs: Sequence[Run], *, coarse: bool = False) -> list[Array]:
        """The outputs of each run at its rows, each (rows, C); NaN from where a run fails."""
        found: list[Array] = [run.nothing() for run in runs]
        left = list(range(len(runs)))
        for share in self.shares:
            step = share * self.length(coarse=coarse)
            for k, table in zip(left, outputs([runs[k] for k in left], step, self.method, self.threads), strict=True):
                found[k] = table
            failed = {runs[k].log for k in left if runs[k].possible and not np.all(np.isfinite(found[k][-1]))}
            left = [k for k in left if runs[k].log in failed]
            if not left:
                break
        return found


def outputs(runs: Sequence[Run], step: float, method: Method = "rk4", threads: int | None = None) -> list[Array]:
    """The outputs of each run at its rows, each (rows, C), with one step, s; NaN from where a run fails."""
    possible = [k for k, run in enumerate(runs) if run.possible]
    found: list[Array | None] = [None] * len(runs)
    for chunk in _chunks([(k, runs[k]) for k in possible], step):
        shown = _together([runs[k] for k in chunk], step, method, threads)
        for k, table in zip(chunk, shown, strict=True):
            found[k] = table
    return [run.nothing() if table is None else table for run, table in zip(runs, found, strict=True)]


def _chunks(runs: Sequence[tuple[int, Run]], step: float) -> Iterator[list[int]]:
    """Runs whose batch fits into memory; such of like length together, since batches are padded."""
    chunk: list[int] = []
    longest = 0
    for k, run in sorted(runs, key=lambda entry: _length(entry[1], step)):
        longest = _length(run, step)
        # Lengths and positions, as they are and as they are shown.
        if chunk and (len(chunk) + 1) * longest * 2 * len(run.state) > BATCH_VALUES:
            yield chunk
            chunk = []
        chunk.append(k)
    if chunk:
        yield chunk


def _length(run: Run, step: float) -> int:
    """About how many rows a run needs."""
    time = run.record.time
    return max(run.end - run.first, int((time[run.end - 1] - time[run.first]) / step) + 2)


def _together(runs: Sequence[Run], step: float, method: Method, threads: int | None) -> list[Array]:
    """Outputs of runs that have an arm, in one batch."""
    grids: dict[tuple[int, int, int, float], Grid] = {}
    for run in runs:
        if run.stretch not in grids:
            grids[run.stretch] = run.grid(step)
    places = {key: k for k, key in enumerate(grids)}
    # The implicit method is that of stiff arms.
    ends = {key: graded(g, step) if method == "ros2" else (g.time, slice(None)) for key, g in grids.items()}
    arms = {id(run.arm): run.arm for run in runs if run.arm is not None}
    arm_at = {key: k for k, key in enumerate(arms)}
    driven = {id(drive): drive for drive in (run.drive or run.record.drive for run in runs)}
    drive_at = {key: k for k, key in enumerate(driven)}
    # Runs that differ in what they are seen by are one simulation.
    members: dict[tuple[int, int, int, bytes, bytes], int] = {}
    states: list[Array] = []
    moved: list[Array] = []
    starts: list[float] = []
    own: list[int] = []
    for run in runs:
        key = (arm_at[id(run.arm)], drive_at[id(run.drive or run.record.drive)], places[run.stretch])
        place = members.setdefault((*key, run.state.tobytes(), run.moved.tobytes()), len(members))
        if place == len(states):
            states.append(run.state)
            moved.append(run.moved)
            starts.append(grids[run.stretch].start)
        own.append(place)
    remembered = max(map(len, moved))
    batch = run_members(
        list(arms.values()),
        [averaged(drive, step).in_core() for drive in driven.values()],
        [time for time, _ in ends.values()],
        [(arm, drive, place) for arm, drive, place, *_ in members],
        np.array(starts),
        np.stack(states),
        Options(method, step * (1.0 + _SLACK)),
        moved=np.stack([np.resize(own, remembered) for own in moved]) if remembered else None,
        velocities=False,
        head_positions=any(run.observation.needs_positions for run in runs),
        head_orientations=any(run.observation.needs_orientations for run in runs),
        measured=True,
        threads=threads,
    )
    alike: dict[tuple[int, tuple[int, int, int, float]], list[int]] = {}
    for k, run in enumerate(runs):
        alike.setdefault((id(run.observation), run.stretch), []).append(k)
    shown: list[Array] = [np.empty(0)] * len(runs)
    for (_, stretch), group in alike.items():
        grid, rows, (time, points) = grids[stretch], [own[k] for k in group], ends[stretch]
        lengths, heads, turns = (
            None if table is None else table[rows, : len(time)][:, points]
            for table in (batch.lengths, batch.head_positions, batch.head_orientations)
        )
        assert lengths is not None
        tables = grid.at_rows(runs[group[0]].observation.predicted(lengths, heads, turns))
        for k, table in zip(group, tables, strict=True):
            shown[k] = np.ascontiguousarray(table)
    return shown
