"""Simulations, many at a time: the outputs of a log under given parameters and initial states."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.diagnose.records import Record
from bha.errors import BhaError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Job:
    """One simulation.

    Attributes:
        arm: the arm as the core's JSON.
        record: the log that drives it.
        state: lengths and rates at its first compared row, shape (6n,).
        pressures: other pressures than the record's, Pa, or None.
        rows: only that many of its compared rows; all if None.
    """

    arm: str
    record: Record
    state: Array
    pressures: Array | None = None
    rows: int | None = None


class Engine:
    """Runs jobs over threads with one fixed step; a run that diverges gives NaN from there on."""

    def __init__(self, step: float, threads: int | None = None, tick: Callable[[int], None] | None = None) -> None:
        """Step of the integration, s; number of threads (all cores if None); ``tick`` is told of finished jobs."""
        self.step = step
        self.threads = threads or os.cpu_count() or 1
        self.count = 0
        self._tick = tick

    def run(self, jobs: Sequence[Job]) -> list[Array]:
        """Outputs of every job, shape (rows, channels), m."""
        self.count += len(jobs)
        arms = {text: _core.Arm(text) for text in {job.arm for job in jobs}}
        if len(jobs) == 1 or self.threads == 1:
            return [self._one(arms[job.arm], job) for job in jobs]
        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(lambda job: self._one(arms[job.arm], job), jobs))

    def _one(self, arm: _core.Arm, job: Job) -> Array:
        record = job.record
        times = record.output_time if job.rows is None else record.output_time[: job.rows]
        result = np.full((len(times), len(record.channels)), np.nan)
        n = len(job.state) // 2
        forces = None if record.forces is None else record.forces.reshape(len(record.time), -1)
        try:
            run = _core.Simulation(
                arm,
                record.time,
                record.pressures if job.pressures is None else job.pressures,
                forces,
                method="rk4",
                step=self.step,
                start=float(times[0]),
                q=job.state[:n],
                qd=job.state[n:],
            )
            lengths, _, _, heads, _ = run.advance(times)
        except BhaError:
            return result
        result[: len(lengths)] = observe(record.channels, lengths, heads)
        if self._tick is not None:
            self._tick(1)
        return result


def observe(channels: Sequence[str], lengths: Array, heads: Array) -> Array:
    """The measured channels out of all lengths (m, 3n) and head positions (m, 3n)."""
    both = np.concatenate([lengths, heads.reshape(len(lengths), -1)], axis=1)
    return both[:, channel_columns(channels, lengths.shape[1] // 3)]


def channel_columns(channels: Sequence[str], sections: int) -> list[int]:
    """Columns of the channels in all lengths and head positions side by side."""
    from bha import names  # noqa: PLC0415  (a name only)

    lengths = [names.length_name(i, k) for i in range(1, sections + 1) for k in (1, 2, 3)]
    heads = [name for i in range(1, sections + 1) for name in names.position_names(i)]
    place = {name: k for k, name in enumerate([*lengths, *heads])}
    return [place[name] for name in channels]
