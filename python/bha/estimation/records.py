"""Recordings as identification and diagnosis compare them with simulations: channels with noise, usable rows, windows.

A record holds what the model predicts (lengths, head positions, orientations) beside what drives it; it is made of a
:class:`bha.Recording`, which says what each sample is worth. Rows that do not count are left out of residuals; the
simulation still passes through them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.estimation.conditions import Condition, changes_of
from bha.logs import Log
from bha.recordings import ChannelFacts, Observation, PressureSort, Recording
from bha.recordings.aligned import COMMON
from bha.recordings.beginning import Resting, beginning
from bha.recordings.clock import later
from bha.recordings.doubt import Doubt
from bha.runs.input import Input
from bha.support.shown import short_repr

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Noise that is assumed where a channel does not tell it: length sensors and motion capture rarely do better; in the
#: unit of the channel (m; a quaternion's component).
DEFAULT_NOISE = 2e-4
#: What stood before a log ends at least this long before it, s: at its first sample there is the log.
_JUST_BEFORE = 1e-3
#: How long it stands in the samples, s: means over a step of the integrator are to have it.
_STOOD = 1.0
#: Time over which channels are smoothed where their rates are wanted, s.
SMOOTHING_SECONDS = 0.06


@short_repr
@dataclass(frozen=True, eq=False)
class Record:
    """One log, ready for comparison with simulations; k rows of it, C channels. Equal to itself alone.

    Attributes:
        name: what it is called in reports.
        drive: what drives the arm, at all sample times.
        rows: the samples of ``drive`` at which outputs are compared, shape (k,).
        observation: the measured channels as functions of coordinates and heads: lengths first, then head positions,
            then orientations.
        measured: measurements, in the unit of the channel (m; of a quaternion none), shape (k, C).
        usable: which measurements count, shape (k, C).
        facts: noise and flaws of the channels.
        pressure_facts: noise and flaws of the inputs; of their readings, whatever filter they went through since.
        session: logs of one session share session parameters.
        sha256: hash of its file, or None.
        doubts: what the readings of each input leave open between them; none of any if empty.
        thinning: of how many rows one is compared, after low-pass filtering.
        pressure_kept: what was kept of the cosine coefficients of its pressures, and of what is fast in them sample by
            sample, both of shape (samples, inputs); None for all.
        changes: what is known to have been otherwise of the arm, see :mod:`bha.estimation.conditions`.
        resting: where the arm stands when the record begins; None where it moves there.
        before: how many samples of ``drive`` say what was before the log (:meth:`preceded_by`).
    """

    name: str
    drive: Input
    rows: NDArray[np.intp]
    observation: Observation
    measured: Array
    usable: Mask
    facts: tuple[ChannelFacts, ...]
    pressure_facts: tuple[ChannelFacts, ...]
    session: str = ""
    sha256: str | None = None
    doubts: tuple[Doubt, ...] = ()
    thinning: int = 1
    pressure_kept: tuple[Array, Array] | None = None
    changes: tuple[tuple[str, float], ...] = ()
    resting: Resting | None = None
    before: int = 0

    def __len__(self) -> int:
        """Number of rows compared."""
        return len(self.rows)

    @cached_property
    def time(self) -> Array:
        """Times of the rows compared, s, shape (k,)."""
        return np.asarray(self.drive.time[self.rows])

    @property
    def condition(self) -> Condition:
        """Its session and the known changes."""
        return Condition(self.session, self.changes)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the measured channels."""
        return self.observation.names

    @cached_property
    def noise(self) -> Array:
        """Standard deviation of each channel's sensor noise, in its unit, shape (C,)."""
        return np.array([fact.noise for fact in self.facts])

    @cached_property
    def quantum(self) -> Array:
        """Step of the readings of each channel, in its unit, shape (C,); 0 for none."""
        return np.array([fact.quantum for fact in self.facts])

    @cached_property
    def repeat_noise(self) -> Array:
        """What the arm does otherwise each time, in the unit of the channel, shape (C,)."""
        return np.array([fact.repeat_noise for fact in self.facts])

    @cached_property
    def pressure_noise(self) -> Array:
        """Standard deviation of the noise of each pressure input, Pa, shape (inputs,)."""
        return np.array([fact.noise for fact in self.pressure_facts])

    @property
    def duration(self) -> float:
        """From the first to the last row, s."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def sample_time(self) -> float:
        """Median distance of the rows, s."""
        return float(np.median(np.diff(self.time)))

    @cached_property
    def rate(self) -> float:
        """Root mean square rate of the length or position that moves fastest, m/s; NaN where there is none."""
        step = max(SMOOTHING_SECONDS, self.sample_time)
        times = np.arange(self.time[0], self.time[-1] + step, step)
        rates = [np.nan]
        for output, values, counts in zip(self.observation.outputs, self.measured.T, self.usable.T, strict=True):
            if output.kind != "orientation" and counts.any():
                changes = np.diff(np.interp(times, self.time[counts], values[counts]))
                rates.append(float(np.sqrt(np.mean(changes**2))) / step)
        return float(np.fmax.reduce(rates))

    @property
    def has_unsure_pressures(self) -> bool:
        """Whether pressures have noise, or may be others between their readings."""
        return bool(np.any(self.pressure_noise > 0.0)) or any(doubt.any for doubt in self.doubts)

    def pressure_errors(self, rng: np.random.Generator) -> Array:
        """One draw of what the pressures may be besides those that are known, Pa, shape (samples, inputs)."""
        errors = self.pressure_noise * rng.standard_normal(self.drive.pressures.shape)
        for k, doubt in enumerate(self.doubts):
            if doubt.any:
                errors[:, k] += doubt.drawn(self.drive.time, rng)
        return np.asarray(errors)

    def driven_by(self, pressures: Array) -> Input:
        """What drives the arm with other pressures, Pa absolute, shape (samples, inputs)."""
        return replace(self.drive, pressures=pressures)

    @property
    def alone(self) -> Record:
        """The record with nothing before its log."""
        return self if self.before == 0 else self._shifted(self.drive.time[self.before :], self.before, 0)

    def preceded_by(self, pressures: Array, late: float) -> Record:
        """The same record with pressures, Pa absolute, shape (inputs,), that stood until ``late`` s before its log.

        The first ones of the log took their place then.
        """
        own = self.alone
        start = own.drive.time[0] - late - _JUST_BEFORE + np.array([-_STOOD, 0.0, 0.0])
        made = own._shifted(np.concatenate([start, own.drive.time]), -len(start), len(start))
        made.drive.pressures[: len(start) - 1] = np.maximum(pressures, 0.0)
        return made

    def _shifted(self, time: Array, by: int, before: int) -> Record:
        """The record driven at other times: some of its first samples left out, or the first one repeated."""
        drive = self.drive
        places = np.maximum(np.arange(len(time)) + by, 0)
        forces = None if drive.forces is None else drive.forces[places]
        moved = replace(drive, time=time, pressures=drive.pressures[places], forces=forces)
        return replace(self, drive=moved, rows=self.rows - by, before=before)

    def kept(self, rows: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Record:
        """The same record with some of its rows; what drives the arm keeps all its samples."""
        return replace(self, rows=self.rows[rows], measured=self.measured[rows], usable=self.usable[rows])

    def between(self, start: float, end: float) -> Record:
        """The part from ``start`` to ``end``, s, driven by the samples there alone.

        Raises:
            InputError: there is none.
        """
        drive = self.drive
        inside = np.flatnonzero((drive.time >= start) & (drive.time <= end))
        if len(inside) == 0:
            raise InputError(f"{self.name}: no row between {start} and {end} s")
        first, last = int(inside[0]), int(inside[-1])
        part = slice(first, last + 1)
        forces = None if drive.forces is None else drive.forces[part]
        cut = self.kept((self.rows >= first) & (self.rows <= last))
        return replace(
            cut,
            resting=self.resting if first == 0 else None,
            drive=replace(drive, time=drive.time[part], pressures=drive.pressures[part], forces=forces),
            rows=cut.rows - first,
            doubts=tuple(doubt.between(first, last) for doubt in self.doubts),
            pressure_kept=None,
        )

    def without(self, spans: Sequence[tuple[float, float]]) -> Record:
        """The same record with the rows within some spans of time, s, not counting."""
        usable = self.usable.copy()
        for start, end in spans:
            usable[(self.time >= start) & (self.time <= end)] = False
        return replace(self, usable=usable)

    def thinned(self, interval: float) -> Record:
        """The same record with readings at least ``interval`` s apart; what drives the arm keeps all its samples."""
        return self.kept(_thinned_readings(self.time, self.usable, interval))

    def with_noise(self, noise: Array) -> Record:
        """The same record with another noise of its channels, in their units, shape (C,)."""
        return replace(self, facts=_with_noise(self.facts, noise))

    def with_pressure_noise(self, noise: Array) -> Record:
        """The same record with another noise of its pressures, Pa, shape (inputs,)."""
        return replace(self, pressure_facts=_with_noise(self.pressure_facts, noise))


def reading_noise(facts: Sequence[ChannelFacts]) -> Array:
    """Standard deviation of the readings of channels, in their units, shape (C,): no less than what rounding makes."""
    return np.array([max(fact.noise, fact.quantum / np.sqrt(12.0)) for fact in facts])


def _with_noise(facts: Sequence[ChannelFacts], noise: Array) -> tuple[ChannelFacts, ...]:
    return tuple(replace(fact, noise=float(own)) for fact, own in zip(facts, noise, strict=True))


@dataclass(frozen=True)
class Window:
    """Rows ``first`` to ``last`` (exclusive) of a record, simulated from an initial state of their own."""

    record: int
    first: int
    last: int


def record(
    arm: Arm,
    log: Log | Recording | str | os.PathLike[str],
    *,
    pressures: PressureSort | None = None,
    name: str | None = None,
    session: str = "",
    changes: Mapping[str, float] | None = None,
    channels: Sequence[str] | None = None,
    noise: Array | None = None,
    min_interval: float = 0.0,
    exclude: Sequence[tuple[float, float]] = (),
) -> Record:
    """Make a record of a log.

    Args:
        arm: the arm; says which pressures drive it.
        log: the log, its path, or a recording of it.
        pressures: which pressures drive the arm, ``"measured"`` or ``"commanded"``; if None measured ones where there
            are any.
        name: what to call it; the file's name if None.
        session: session of the log, for parameters that differ between sessions.
        changes: what is known to have been otherwise of the arm: path -> number, ``{"section.1.payload": 0.2}``
            (:mod:`bha.estimation.conditions`).
        channels: names of the channels to compare (``q11``, ``x2``, ...); all that the log has if None.
        noise: standard deviation of each channel's noise, m; estimated if None.
        min_interval: rows closer together than this are thinned, s (0: none).
        exclude: spans of time that do not count, s.

    Raises:
        LogError: the log lacks a pressure of the arm, or has a name that the arm's layout contradicts.
        InputError: the log has nothing to compare with, or too few rows.
    """
    otherwise = changes_of(changes or {})
    as_changed = Condition(session, otherwise).applied(arm.parameters)
    if not isinstance(log, Recording):
        log = Recording(Arm(as_changed) if otherwise else arm, log, pressures=pressures, name=name)
    recording = log
    origin, outputs = name or recording.name, recording.outputs
    if channels is not None and (unknown := set(channels) - set(recording.channels)):
        has = ", ".join(recording.channels) or "none"
        raise InputError(f"{origin}: channels {', '.join(sorted(unknown))}: not measured of this arm; found {has}")
    kept = [k for k, output in enumerate(outputs) if channels is None or output.name in channels]
    if not kept:
        raise InputError(
            f"{origin}: nothing to compare a simulation with; lengths (q11, ...), head positions (x1, y1, z1, ...) or "
            f"orientations (ow1, ox1, ...) are needed, the log has {', '.join(recording.log.columns)}"
        )
    rows = _thinned_readings(recording.time, recording.usable[:, kept], min_interval)
    if len(rows) < 2 or not recording.time[rows[-1]] > recording.time[rows[0]]:
        raise InputError(f"{origin}: {len(rows)} rows; at least two at different times are needed")
    facts = [recording.facts[k] for k in kept]
    deviation = reading_noise(facts) if noise is None else np.asarray(noise, dtype=np.float64)
    if deviation.shape != (len(kept),):
        raise InputError(f"{origin}: noise of {deviation.shape}; one number a channel is needed, ({len(kept)},)")
    known = np.isfinite(deviation) & (deviation > 0)
    deviation = np.where(known, deviation, np.median(deviation[known]) if known.any() else DEFAULT_NOISE)
    stands, drive = beginning(recording, kept)
    made = Record(
        name=origin,
        drive=drive,
        rows=recording.drive_rows[rows],
        observation=Observation.of(as_changed, [outputs[k] for k in kept]),
        measured=recording.measured[rows][:, kept],
        usable=recording.usable[rows][:, kept],
        facts=_with_noise(facts, deviation),
        pressure_facts=_with_noise(recording.pressure_facts, recording.pressure_noise),
        session=session,
        sha256=recording.log.sha256,
        changes=otherwise,
        resting=stands,
    )
    return made.without(exclude) if exclude else made


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
        longest = max(records, key=len)
        of = "a whole log" if length is None else f"a window of {length:g} s"
        raise InputError(
            f"{of} needs {min_rows} rows; {longest.name} has {len(longest)} over {longest.duration:.4g} s: choose "
            "longer windows, take a longer log, or write the time's unit in its heading"
        )
    return made


def some_of(pieces: Sequence[Window], records: Sequence[Record], budget: float) -> list[Window]:
    """Windows spread evenly over all, lasting ``budget`` s together at the most; all of them if they last less."""
    total = sum(records[w.record].time[w.last - 1] - records[w.record].time[w.first] for w in pieces)
    if total <= budget:
        return list(pieces)
    count = max(2, int(len(pieces) * budget / total))
    chosen = np.unique(np.linspace(0, len(pieces) - 1, count).round().astype(int))
    return [pieces[k] for k in chosen]


def _thinned_readings(time: Array, usable: NDArray[np.bool_], interval: float) -> NDArray[np.int64]:
    """Rows with readings at least ``interval`` apart in each channel.

    Channels that are read in turn, or seldom, have readings in rows of their own: every so many rows there may be none.
    """
    if interval <= 0.0 or float(np.mean(usable)) >= COMMON:
        return _thinned(time, interval)
    own = [np.flatnonzero(good) for good in usable.T]
    rows = [places[_thinned(time[places], interval)] for places in own if len(places)]
    every = np.unique(np.concatenate([[0], *rows, [len(time) - 1]])).astype(np.int64)
    return every[later(time[every])]


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
