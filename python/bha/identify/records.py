"""Measured logs as identification sees them: channels with noise, usable rows, windows.

A record holds what the model predicts (bellows lengths and head positions) beside what drives it. Rows where a measured
pressure was frozen while the arm moved on are found and left out of residuals; the simulation still passes through
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.identify.noise import noise_deviations
from bha.log import Log
from bha.names import length_name, position_names
from bha.simulation import Input

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: A measured pressure that stays exactly the same for longer than this, while others say it moved, is frozen, s.
FROZEN_SECONDS = 1.5
#: Noise that is assumed where a channel does not tell it: length sensors and motion capture rarely do better, m.
DEFAULT_NOISE = 2e-4


@dataclass(frozen=True)
class Record:
    """One log, ready for residuals; m rows, C channels.

    Attributes:
        name: what it is called in reports.
        session: logs of one session share session parameters.
        sha256: hash of its file, or None.
        drive: what drives the arm, at all sample times.
        time: times of the rows compared, s, shape (m,).
        channels: names of the measured channels, the arm's lengths first, then its head positions.
        index: place of each channel in (3n lengths, 3n head coordinates), shape (C,).
        measured: measurements, m, shape (m, C).
        usable: which measurements count, shape (m, C).
        noise: standard deviation of each channel's sensor noise, m, shape (C,).
        pressure_noise: that of each pressure input, Pa, shape (inputs,).
    """

    name: str
    session: str
    sha256: str | None
    drive: Input
    time: Array
    channels: tuple[str, ...]
    index: NDArray[np.int64]
    measured: Array
    usable: Mask
    noise: Array
    pressure_noise: Array

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time)

    @property
    def duration(self) -> float:
        """From the first to the last row, s."""
        return float(self.time[-1] - self.time[0])

    def without(self, spans: Sequence[tuple[float, float]]) -> Record:
        """The same record with the rows within some spans of time, s, not counting."""
        usable = self.usable.copy()
        for start, end in spans:
            usable[(self.time >= start) & (self.time <= end)] = False
        return replace(self, usable=usable)

    def thinned(self, interval: float) -> Record:
        """The same record with rows at least ``interval`` s apart; what drives the arm keeps all its samples."""
        rows = _thinned(self.time, interval)
        return replace(self, time=self.time[rows], measured=self.measured[rows], usable=self.usable[rows])

    @property
    def heads_measured(self) -> bool:
        """Whether some channel is a head's position."""
        return any(not channel.startswith("q") for channel in self.channels)

    def predicted(self, lengths: Array, heads: Array | None) -> Array:
        """The record's channels out of predicted lengths (..., 3n) and head positions (..., n, 3), shape (..., C).

        Head positions may be left out where no channel is one.
        """
        if heads is None:
            return np.asarray(lengths[..., self.index])
        return np.concatenate([lengths, heads.reshape(*heads.shape[:-2], -1)], axis=-1)[..., self.index]


@dataclass(frozen=True)
class Window:
    """Rows ``first`` to ``last`` (exclusive) of a record, simulated from an initial state of their own."""

    record: int
    first: int
    last: int


def record(
    arm: Arm,
    log: Log,
    *,
    name: str | None = None,
    session: str = "",
    channels: Sequence[str] | None = None,
    noise: Array | None = None,
    min_interval: float = 0.0,
    exclude: Sequence[tuple[float, float]] = (),
) -> Record:
    """Make a record of a log.

    Args:
        arm: the arm; says which pressures drive it.
        log: the log.
        name: what to call it; the file's name if None.
        session: session of the log, for parameters that differ between sessions.
        channels: names of the channels to compare (``q11``, ``x2``, ...); all that the log has if None.
        noise: standard deviation of each channel's noise, m; estimated if None.
        min_interval: rows closer together than this are thinned, s (0: none).
        exclude: spans of time that do not count, s.

    Raises:
        LogError: the log lacks a pressure of the arm.
        InputError: the log has nothing to compare with, or too few rows.
    """
    n = arm.section_count
    origin = name or (log.path.name if log.path is not None else "<arrays>")
    possible = [length_name(i, k) for i in range(1, n + 1) for k in (1, 2, 3)]
    possible += [axis for i in range(1, n + 1) for axis in position_names(i)]
    wanted = set(possible if channels is None else channels)
    if unknown := wanted - set(possible):
        raise InputError(f"{origin}: channels {', '.join(sorted(unknown))}: an arm of {n} sections has no such channel")
    kept = [place for place, channel in enumerate(possible) if channel in log and channel in wanted]
    if not kept:
        raise InputError(
            f"{origin}: nothing to compare a simulation with; lengths (q11, ...) or head positions (x1, y1, z1, ...) "
            f"are needed, the log has {', '.join(log.columns)}"
        )
    drive = Input.from_log(arm, log)
    rows = _thinned(log.time, min_interval)
    if len(rows) < 2 or not log.time[rows[-1]] > log.time[rows[0]]:
        raise InputError(f"{origin}: {len(rows)} rows; at least two at different times are needed")
    table = np.column_stack([log[possible[place]] for place in kept])
    deviation = noise_deviations(table) if noise is None else np.asarray(noise, dtype=np.float64)
    if deviation.shape != (len(kept),):
        raise InputError(f"{origin}: noise of {deviation.shape}; one number a channel is needed, ({len(kept)},)")
    known = np.isfinite(deviation) & (deviation > 0)
    deviation = np.where(known, deviation, np.median(deviation[known]) if known.any() else DEFAULT_NOISE)
    pressure_noise = np.nan_to_num(noise_deviations(drive.pressures))
    made = Record(
        name=origin,
        session=session,
        sha256=log.sha256,
        drive=drive,
        time=log.time[rows],
        channels=tuple(possible[place] for place in kept),
        index=np.array(kept, dtype=np.int64),
        measured=table[rows],
        usable=np.isfinite(table[rows]),
        noise=deviation,
        pressure_noise=pressure_noise,
    )
    return made.without(exclude) if exclude else made


def frozen_spans(
    arm: Arm, log: Log, *, longer_than: float = FROZEN_SECONDS, recovery: float = 0.0
) -> list[tuple[float, float]]:
    """Spans of time in which all measured pressures of the arm stood exactly still together, s.

    Pressure sensors flicker; values that repeat to the last digit in every channel at once come from a data logger that
    has stopped. A log without any flicker (a simulated or filtered one) has no frozen spans.

    Args:
        arm: says which pressures are meant.
        log: the log.
        longer_than: shortest span that counts, s.
        recovery: added after each span, so that the arm can find back to what drives it, s.
    """
    moved = np.any(np.diff(log.pressures(arm.inputs), axis=0) != 0.0, axis=1)
    if not moved.any():
        return []
    ends = log.time[np.concatenate([[0], np.flatnonzero(moved) + 1, [len(log) - 1]])]
    starts, stops = ends[:-1], ends[1:]
    usual = float(np.median(np.diff(ends)))
    return [
        (float(a), float(b) + recovery)
        for a, b in zip(starts, stops, strict=True)
        if b - a > max(longer_than, 20.0 * usual)
    ]


def windows(records: Sequence[Record], length: float | None, *, min_rows: int = 8) -> list[Window]:
    """Cut records into windows of about ``length`` s (None: one a record), each with some measurement that counts.

    A record is cut evenly, so that its last window is not a stump.
    """
    made = []
    for number, rec in enumerate(records):
        pieces = 1 if length is None else max(1, round(rec.duration / length))
        edges = np.searchsorted(rec.time, np.linspace(rec.time[0], rec.time[-1], pieces + 1))
        edges[-1] = len(rec)
        for first, last in pairwise(edges):
            if last - first >= min_rows and rec.usable[first:last].any():
                made.append(Window(number, int(first), int(last)))
    if not made:
        raise InputError(f"no window of {length} s has {min_rows} rows; choose longer windows")
    return made


def some_of(pieces: Sequence[Window], records: Sequence[Record], budget: float) -> list[Window]:
    """Windows spread evenly over all, lasting ``budget`` s together at the most; all of them if they last less."""
    total = sum(records[w.record].time[w.last - 1] - records[w.record].time[w.first] for w in pieces)
    if total <= budget:
        return list(pieces)
    count = max(2, int(len(pieces) * budget / total))
    chosen = np.unique(np.linspace(0, len(pieces) - 1, count).round().astype(int))
    return [pieces[k] for k in chosen]


def _thinned(time: Array, interval: float) -> NDArray[np.int64]:
    """Rows at least ``interval`` apart, and never two at the same time."""
    if interval <= 0.0:
        return np.concatenate([[0], np.flatnonzero(np.diff(time) > 0.0) + 1]).astype(np.int64)
    kept, last = [], -np.inf
    for row, t in enumerate(time):
        if t - last >= interval * (1 - 1e-9):
            kept.append(row)
            last = t
    return np.array(kept, dtype=np.int64)
