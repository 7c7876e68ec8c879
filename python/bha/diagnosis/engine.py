"""Simulations, many at a time: the outputs of a log under given parameters and initial states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.arm.geometry import CameraFrame
from bha.errors import BhaError
from bha.estimation.records import Record
from bha.runs.input import Input

Array = NDArray[np.float64]

#: Numbers that one call of the core may return, so that memory stays bounded.
CHUNK_NUMBERS = 40_000_000
#: Shares of the step that are tried in turn where a run diverges: the step was chosen for the nominal arm, and an
#: effect (quadratic damping, a wall) may make a stiffer one of it.
STEP_SHARES = (1.0, 0.5, 0.25)


@dataclass(frozen=True)
class Job:
    """One simulation.

    Attributes:
        arm: the arm as the core's JSON.
        record: the log that drives it.
        state: lengths and rates at its first compared row, shape (6n,).
        drive: what drives the arm in place of the record, or None.
        rows: only that many of its compared rows; all if None.
        finer: the engine's steps are divided by this.
        camera: the frame in which heads are seen; that of the record's outputs if None.
    """

    arm: str
    record: Record
    state: Array
    drive: Input | None = None
    rows: int | None = None
    finer: int = 1
    camera: CameraFrame | None = None


class Engine:
    """Runs jobs over threads with one fixed step; a run that diverges gives NaN from there on.

    Jobs that share a log run in one call of the core, which may put them abreast. Where one of them diverges, all of
    them are repeated with finer steps: their differences only mean something at the same step.
    """

    def __init__(
        self,
        step: float,
        threads: int | None = None,
        coarse: float | None = None,
        tick: Callable[[int], None] | None = None,
        method: Literal["rk4", "ros2"] = "rk4",
        shares: Sequence[float] = STEP_SHARES,
    ) -> None:
        """An engine.

        Args:
            step: step of the integration, s.
            threads: number of threads; all cores if None.
            coarse: step where only differences between runs are wanted, s: their errors cancel to first order.
            tick: told of the number of finished jobs.
            method: of integration; the linearly implicit ``ros2`` for stiff arms.
            shares: shares of the step that are tried in turn where a run diverges.
        """
        self.step = step
        self.coarse = coarse or step
        self.threads = threads or 0
        self.method = method
        self.shares = tuple(shares)
        self.count = 0
        self._tick = tick

    def with_step(self, step: float, coarse: float | None = None) -> Engine:
        """An engine like this one with other steps, s."""
        return Engine(step, self.threads, coarse, self._tick, self.method, self.shares)

    def once(self) -> Engine:
        """An engine like this one that leaves a run that diverges as it is."""
        return Engine(self.step, self.threads, self.coarse, self._tick, self.method, (1.0,))

    def run(self, jobs: Sequence[Job], *, coarse: bool = False) -> list[Array]:
        """Outputs of every job, shape (rows, channels), m."""
        step = self.coarse if coarse else self.step
        groups: dict[tuple[Record, int, int], list[int]] = {}
        for k, job in enumerate(jobs):
            groups.setdefault((job.record, job.rows or len(job.record.rows), job.finer), []).append(k)
        results: list[Array] = [np.empty(0)] * len(jobs)
        for (_, rows, finer), members in groups.items():
            size = max(1, CHUNK_NUMBERS // (rows * 6 * len(jobs[members[0]].state)))
            for first in range(0, len(members), size):
                part = members[first : first + size]
                for k, y in zip(part, self._together([jobs[k] for k in part], rows, step / finer), strict=True):
                    results[k] = y
                self.count += len(part)
                if self._tick is not None:
                    self._tick(len(part))
        return results

    def _together(self, jobs: Sequence[Job], rows: int, step: float) -> list[Array]:
        record = jobs[0].record
        times = np.ascontiguousarray(record.time[:rows])
        texts = list(dict.fromkeys(job.arm for job in jobs))
        arms: dict[str, int] = {}
        built: list[_core.Arm] = []
        for text in texts:
            try:
                built.append(_core.Arm(text))
            except BhaError:
                continue  # parameters without a model: no run, NaN
            arms[text] = len(built) - 1
        drives = {id(drive): drive for drive in (job.drive or record.drive for job in jobs)}
        places = {key: k for k, key in enumerate(drives)}
        live = [k for k, job in enumerate(jobs) if job.arm in arms and np.all(np.isfinite(job.state))]
        nothing = np.full((rows, len(record.channels)), np.nan)
        if not live:
            return [nothing] * len(jobs)
        observation = record.observation
        # Jobs that differ in what they are seen by are one simulation.
        runs: dict[tuple[int, int, bytes], int] = {}
        states: list[Array] = []
        own: dict[int, int] = {}
        for k in live:
            job = jobs[k]
            run = (arms[job.arm], places[id(job.drive or record.drive)], job.state.tobytes())
            if run not in runs:
                runs[run] = len(runs)
                states.append(job.state)
            own[k] = runs[run]
        for share in self.shares:
            found = _core.simulate_batch(
                built,
                [drive.in_core() for drive in drives.values()],
                [times],
                [(arm, drive, 0) for arm, drive, _ in runs],
                np.full(len(runs), times[0]),
                np.ascontiguousarray(states),
                method=self.method,
                step=share * step,
                velocities=False,
                head_positions=observation.needs_positions,
                measured=True,
                threads=self.threads,
            )
            if np.all(np.isfinite(found.lengths[:, -1])):
                break
        lengths, heads = found.lengths, found.head_positions
        positions = None if heads is None else heads.reshape(*lengths.shape[:2], -1, 3)
        results = [nothing] * len(jobs)
        for camera in dict.fromkeys(jobs[k].camera for k in live):
            mine = [k for k in live if jobs[k].camera is camera]
            rows_of = [own[k] for k in mine]
            seen = observation.seen_by(camera)
            outputs = seen.predicted(lengths[rows_of], None if positions is None else positions[rows_of])
            for k, y in zip(mine, np.ascontiguousarray(outputs), strict=True):
                results[k] = y
        return results
