"""Recordings as a diagnosis compares them with simulations: one :class:`Record` a log.

What: the channels that a simulation can be compared with (lengths, head positions), the rows that may be used, and the
noise of every channel, all from the log's :class:`bha.Recording`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.errors import InputError
from bha.recordings import ChannelFacts, Observation
from bha.runs.input import Input

if TYPE_CHECKING:
    from bha.arm.geometry import CameraFrame
    from bha.recordings import Recording
    from bha.recordings.doubt import Doubt

Array = NDArray[np.float64]

#: Fewest rows of a log.
FEWEST_ROWS = 50
#: Least noise of an output that is assumed, as a share of what the outputs of its kind travel: no arm is described more
#: finely by sections of constant curvature, whatever the sensor resolves.
LEAST_NOISE_SHARE = 3e-4
#: An arm rests if no output travels by more than this share of what the outputs travel, within this time, s, under
#: pressures that have been constant for as long; sought in the first share of a log.
REST_TRAVEL, REST_TIME, REST_SHARE = 5e-3, 1.0, 0.5


@dataclass(frozen=True, eq=False)
class Record:
    """One log, ready for comparison with simulations. Equal to itself alone: what belongs to a log can be kept by it.

    Attributes:
        name: file name, or a number where the log has no file.
        time: s, shape (m,), all samples of the inputs.
        pressures: Pa absolute, shape (m, inputs).
        forces: N, shape (m, n, 3), or None.
        rows: indices of the rows to compare, shape (k,).
        outputs: measured outputs at these rows, shape (k, channels), m.
        good: which of them count, shape (k, channels).
        observation: the outputs as functions of coordinates and heads.
        facts: noise and flaws of the outputs.
        pressure_facts: noise and flaws of the inputs.
        thinning: every how many rows one is compared, after low-pass filtering.
        doubts: what the readings of each input leave open between them; none of any if empty.
        pressure_taps: the filter that the pressures went through, None for none; ``pressure_facts`` are from before.
    """

    name: str
    time: Array
    pressures: Array
    forces: Array | None
    rows: NDArray[np.intp]
    outputs: Array
    good: NDArray[np.bool_]
    observation: Observation
    facts: tuple[ChannelFacts, ...]
    pressure_facts: tuple[ChannelFacts, ...]
    thinning: int = 1
    pressure_taps: Array | None = None
    doubts: tuple[Doubt, ...] = ()

    @cached_property
    def drive(self) -> _core.Input:
        """What drives an arm as it did the log's, made once."""
        return self.driven_by(self.pressures)

    def driven_by(self, pressures: Array) -> _core.Input:
        """The same with other pressures, Pa absolute, shape (m, inputs)."""
        return Input(self.time, pressures, self.forces).in_core()

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.observation.names

    @property
    def output_time(self) -> Array:
        """Times of the compared rows, s, shape (k,)."""
        return np.asarray(self.time[self.rows])

    @property
    def sample_time(self) -> float:
        """Median distance of the compared rows, s."""
        return float(np.median(np.diff(self.output_time)))

    @property
    def noise(self) -> Array:
        """Noise of the outputs, m, shape (channels,)."""
        return np.array([fact.noise for fact in self.facts])

    @property
    def repeat_noise(self) -> Array:
        """What the arm does otherwise each time, m, shape (channels,)."""
        return np.array([fact.repeat_noise for fact in self.facts])

    @property
    def has_unsure_pressures(self) -> bool:
        """Whether pressures have noise, or may be others between their readings."""
        return bool(np.any(self.pressure_noise > 0.0)) or any(doubt.any for doubt in self.doubts)

    def pressure_errors(self, rng: np.random.Generator) -> Array:
        """One draw of what the pressures may be besides those that are known, Pa, shape (m, inputs)."""
        errors = self.pressure_noise * rng.standard_normal(self.pressures.shape)
        for k, doubt in enumerate(self.doubts):
            if doubt.any:
                errors[:, k] += doubt.drawn(self.time, rng)
        return errors

    def left_open_in_words(self) -> str:
        """What the readings of the pressures leave open, for the notes; empty where that is nothing."""
        found = [
            f"{fact.name} {np.sqrt(np.mean(doubt.scale**2)):.2g} Pa"
            for fact, doubt in zip(self.pressure_facts, self.doubts, strict=False)
            if doubt.any
        ]
        text = "pressures between their readings are known to within (RMS)"
        return f"{self.name}: {text} {', '.join(found)}; that counts as noise" if found else ""

    @property
    def pressure_noise(self) -> Array:
        """Noise of the inputs, Pa, shape (inputs,)."""
        return np.array([fact.noise for fact in self.pressure_facts])

    def seen_by(self, camera: CameraFrame | None) -> Record:
        """The same log, its heads measured in another frame; as it is for None."""
        return self if camera is None else replace(self, observation=self.observation.seen_by(camera))

    def between(self, start: float, end: float) -> Record:
        """The part from ``start`` to ``end``, s."""
        keep = np.flatnonzero((self.time >= start) & (self.time <= end))
        if len(keep) == 0:
            raise InputError(f"{self.name}: no row between {start} and {end} s")
        first, last = int(keep[0]), int(keep[-1])
        inside = (self.rows >= first) & (self.rows <= last)
        return replace(
            self,
            time=self.time[first : last + 1],
            pressures=self.pressures[first : last + 1],
            forces=None if self.forces is None else self.forces[first : last + 1],
            rows=self.rows[inside] - first,
            outputs=self.outputs[inside],
            good=self.good[inside],
            doubts=tuple(doubt.between(first, last) for doubt in self.doubts),
        )


def sensed_noise(recordings: Sequence[Recording]) -> Array:
    """Noise of the readings of each pressure, Pa: of the log in which it is least; 0 where none tells.

    The sensors are the same in all; what moves all the time hides its own noise.
    """
    found = np.array([[fact.noise for fact in recording.pressure_facts] for recording in recordings])
    least = np.min(np.where(found > 0.0, found, np.inf), axis=0)
    return np.asarray(np.where(np.isfinite(least), least, 0.0))


def prepare(recording: Recording, *, name: str | None = None, pressure_noise: Array | None = None) -> Record:
    """A :class:`Record` of a recording.

    Orientations take no part: a diagnosis weighs all its outputs in metres.

    Args:
        recording: the log as the arm sees it.
        name: what reports call it; that of the recording if None.
        pressure_noise: of the readings, Pa, see :func:`sensed_noise`; that of this recording alone if None.

    Raises:
        InputError: the log has neither lengths nor head positions, or fewer than 50 rows.
    """
    origin = name or recording.name
    if len(recording) < FEWEST_ROWS:
        raise InputError(f"{origin}: {len(recording)} rows; at least {FEWEST_ROWS} are needed for a diagnosis")
    kept = [k for k, output in enumerate(recording.outputs) if output.kind != "orientation"]
    if not kept:
        raise InputError(
            f"{origin}: neither bellows lengths (q11 ...) nor head positions (x1 y1 z1 ...) of the arm were measured; "
            "a diagnosis needs one of them"
        )
    chosen, outputs, good = recording.aligned
    outputs, good = outputs[:, kept], good[:, kept]
    if len(chosen) < FEWEST_ROWS:
        raise InputError(f"{origin}: {len(chosen)} rows hold a reading that counts; at least {FEWEST_ROWS} are needed")
    drive = recording.drive
    forces = None if drive.forces is None or not np.any(drive.forces) else np.array(drive.forces)
    noise = sensed_noise([recording]) if pressure_noise is None else pressure_noise
    return Record(
        name=origin,
        time=np.array(drive.time),
        pressures=np.array(drive.pressures),
        forces=forces,
        rows=recording.drive_rows[chosen],
        outputs=outputs,
        good=good,
        observation=Observation.of(recording.arm.parameters, [recording.outputs[k] for k in kept]),
        facts=tuple(recording.facts[k] for k in kept),
        pressure_facts=tuple(
            replace(fact, noise=float(v))
            for fact, v in zip(recording.pressure_facts, recording.acting_noise(noise), strict=True)
        ),
        doubts=recording.left_open(noise),
    )


def from_rest(record: Record) -> Record:
    """The record from where the arm first rests under its pressures; as it is if it does so at once, or never.

    For commanded pressures: what the chambers hold when a log begins is not known, unless the arm has come to rest.
    """
    time, outputs = record.output_time, record.outputs
    least = np.maximum(
        REST_TRAVEL * np.ptp(np.quantile(outputs, [0.02, 0.98], axis=0), axis=0).max(), 6.0 * record.noise
    )
    constant_since = time[0]
    changes = iter(record.time[1:][np.any(np.diff(record.pressures, axis=0) != 0.0, axis=1)])
    change = next(changes, np.inf)
    for row, now in enumerate(time):
        while change <= now:
            constant_since, change = change, next(changes, np.inf)
        end = int(np.searchsorted(time, now + REST_TIME))
        if end >= len(time) or now > time[0] + REST_SHARE * (time[-1] - time[0]):
            break
        # A command that has just come shows in the arm only later.
        rested = row == 0 or now - constant_since >= REST_TIME
        if rested and change > time[end] and np.all(np.ptp(outputs[row:end], axis=0) <= least):
            return record if row == 0 else record.between(float(now), float(record.time[-1]))
    return record


def with_least_noise(records: Sequence[Record]) -> list[Record]:
    """The records with no output's noise below ``LEAST_NOISE_SHARE`` of the travel of its kind (lengths, positions)."""
    travel = {True: 0.0, False: 0.0}
    for record in records:
        spans = np.ptp(np.quantile(record.outputs, [0.02, 0.98], axis=0), axis=0)
        for is_length, span in zip(record.observation.is_length, spans, strict=True):
            travel[bool(is_length)] = max(travel[bool(is_length)], float(span))
    least = [LEAST_NOISE_SHARE * travel[bool(is_length)] for is_length in records[0].observation.is_length]
    return [
        replace(r, facts=tuple(replace(f, noise=max(f.noise, v)) for f, v in zip(r.facts, least, strict=True)))
        for r in records
    ]


def split(records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """Training and held-out records if the user names none: the last third of the logs, or of the only log's time."""
    if len(records) > 1:
        held = max(1, len(records) // 3)
        return list(records[:-held]), list(records[-held:])
    only = records[0]
    start, end = float(only.time[0]), float(only.time[-1])
    cut = start + (end - start) * 2.0 / 3.0
    first, last = only.between(start, cut), only.between(cut, end)
    return [replace(first, name=f"{only.name} (first two thirds)")], [replace(last, name=f"{only.name} (last third)")]
