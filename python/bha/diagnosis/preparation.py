"""Recordings made ready for a diagnosis: one :class:`bha.estimation.records.Record` a log.

What: the channels that a diagnosis weighs (lengths, head positions) at rows in which all of them are known, the noise
of every channel, and rows thinned as far as the band that counts allows, all from the log's :class:`bha.Recording`.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin

from bha.errors import ConvergenceError, InputError
from bha.estimation.first_second import preceded, unsure_of_pressures
from bha.estimation.records import Record, reading_noise
from bha.estimation.strays import without_strays
from bha.recordings import Observation
from bha.recordings.beginning import beginning
from bha.recordings.clock import follows_no_motion

if TYPE_CHECKING:
    from bha.estimation.engine import Model
    from bha.recordings import Recording

Array = NDArray[np.float64]

#: Fewest rows of a log.
FEWEST_ROWS = 50
#: Least noise of an output that is assumed, as a share of what the outputs of its kind travel: no arm is described more
#: finely by sections of constant curvature, whatever the sensor resolves.
LEAST_NOISE_SHARE = 3e-4
#: An arm rests if no output travels by more than this share of what the outputs travel, within this time, s, under
#: pressures that have been constant for as long; sought in the first share of a log.
REST_TRAVEL, REST_TIME, REST_SHARE = 5e-3, 1.0, 0.5


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
        InputError: the log has neither lengths nor head positions, fewer than 50 rows, or rows that follow no motion.
    """
    origin = name or recording.name
    if len(recording) < FEWEST_ROWS:
        raise InputError(f"{origin}: {len(recording)} rows; at least {FEWEST_ROWS} are needed for a diagnosis")
    if (fault := follows_no_motion(recording.clock, recording.time[0])) is not None:
        raise InputError(f"{origin}: {fault}")
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
    stands, drive = beginning(recording, kept)
    if drive.forces is not None and not np.any(drive.forces):
        drive = replace(drive, forces=None)
    noise = sensed_noise([recording]) if pressure_noise is None else pressure_noise
    made = Record(
        name=origin,
        drive=drive,
        rows=recording.drive_rows[chosen],
        observation=Observation.of(recording.arm.parameters, [recording.outputs[k] for k in kept]),
        measured=outputs,
        usable=good,
        facts=tuple(recording.facts[k] for k in kept),
        pressure_facts=recording.pressure_facts,
        sha256=recording.log.sha256,
        doubts=recording.left_open(noise),
        resting=stands,
    )
    return made.with_noise(reading_noise(made.facts)).with_pressure_noise(recording.acting_noise(noise))


def records_of(logs: Sequence[Recording], holdout_logs: Sequence[Recording]) -> tuple[list[Record], list[Record]]:
    """Training and held-out records of the logs of one diagnosis; split (:func:`split`) where none are held out.

    Raises:
        InputError: a log is none that can be diagnosed, or they do not have the same outputs.
    """
    noise = sensed_noise([*logs, *holdout_logs])
    train = [prepare(log, pressure_noise=noise) for log in logs]
    held = [prepare(log, pressure_noise=noise) for log in holdout_logs]
    for record in [*train, *held]:
        if record.channels != train[0].channels:
            raise InputError(
                f"{record.name}: measures {', '.join(record.channels)}; "
                f"{train[0].name} measures {', '.join(train[0].channels)}; "
                "the logs of one diagnosis need the same outputs"
            )
    return (train, held) if held else split(train)


def from_rest(record: Record) -> Record:
    """The record from where the arm first rests under its pressures; as it is if it does so at once, or never.

    For commanded pressures: what the chambers hold when a log begins is not known, unless the arm has come to rest.
    """
    start = _rests_from(record)
    return record if start in (None, record.time[0]) else record.between(float(start), float(record.drive.time[-1]))


def begins_at_rest(record: Record) -> bool:
    """Whether the arm rests under its pressures where the record begins."""
    return record.resting is not None or _rests_from(record.alone) == record.time[0]


def _rests_from(record: Record) -> float | None:
    """Time from which on the arm first rests under its pressures, s; None where it never does."""
    time, outputs, drive = record.time, record.measured, record.drive
    least = np.maximum(
        REST_TRAVEL * np.ptp(np.quantile(outputs, [0.02, 0.98], axis=0), axis=0).max(), 6.0 * record.noise
    )
    constant_since = time[0]
    changes = iter(drive.time[1:][np.any(np.diff(drive.pressures, axis=0) != 0.0, axis=1)])
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
            return float(now)
    return None


def with_least_noise(records: Sequence[Record]) -> list[Record]:
    """The records with no output's noise below ``LEAST_NOISE_SHARE`` of the travel of its kind (lengths, positions)."""
    travel = {True: 0.0, False: 0.0}
    for record in records:
        spans = np.ptp(np.quantile(record.measured, [0.02, 0.98], axis=0), axis=0)
        for is_length, span in zip(record.observation.is_length, spans, strict=True):
            travel[bool(is_length)] = max(travel[bool(is_length)], float(span))
    least = [LEAST_NOISE_SHARE * travel[bool(is_length)] for is_length in records[0].observation.is_length]
    return [r.with_noise(np.maximum(r.noise, least)) for r in records]


def split(records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """Training and held-out records if the user names none: the last third of the logs, or of the only log's time."""
    if len(records) > 1:
        held = max(1, len(records) // 3)
        return list(records[:-held]), list(records[-held:])
    only = records[0]
    start, end = float(only.drive.time[0]), float(only.drive.time[-1])
    cut = start + (end - start) * 2.0 / 3.0
    # What drove the arm before the second part is known, and a lag still has it there.
    first, last = only.between(start, cut), replace(only.kept(only.time >= cut), resting=None)
    return [replace(first, name=f"{only.name} (first two thirds)")], [replace(last, name=f"{only.name} (last third)")]


def thin(record: Record, factor: int) -> Record:
    """Every ``factor``-th compared row, the outputs low-pass filtered without shift beforehand (zero-phase FIR).

    The filter's half length is lost at either end: whatever continues a motion there would be taken for an error.
    """
    if factor == 1:
        return record
    taps = firwin(12 * factor + 1, 0.72 / factor)
    half = len(taps) // 2
    keep = slice(half, len(record.rows) - half, factor)
    columns = [np.convolve(y, taps, mode="valid") for y in record.measured.T]
    # A row that does not count spoils those that its filter reaches.
    bad = [np.convolve(~y, np.ones(len(taps)), mode="valid") > 0.5 for y in record.usable.T]
    return replace(
        record,
        rows=record.rows[keep],
        measured=np.column_stack(columns)[::factor],
        usable=~np.column_stack(bad)[::factor],
        thinning=record.thinning * factor,
    )


def cut_to(record: Record, thinned: Record) -> Record:
    """The rows of ``record`` from the first to the last of ``thinned``."""
    return record.kept((record.time >= thinned.time[0]) & (record.time <= thinned.time[-1]))


def sound_records(full: Sequence[Record], thinned: Sequence[Record], shown: Sequence[Array]) -> list[Record]:
    """The records without stray readings (:mod:`bha.estimation.strays`), by what a model shows of each, (rows, C).

    As they are where any had to be thinned: readings are so dense then that strays showed by their shape.
    """
    if any(len(record) != len(own) for record, own in zip(full, thinned, strict=True)):
        return list(full)
    return without_strays(thinned, shown)


def left_open_in_words(record: Record) -> str:
    """What the readings of the pressures leave open, for the notes; empty where that is nothing."""
    found = [
        f"{fact.name} {np.sqrt(np.mean(doubt.scale**2)):.2g} Pa"
        for fact, doubt in zip(record.pressure_facts, record.doubts, strict=False)
        if doubt.any
    ]
    text = "pressures between their readings are known to within (RMS)"
    return f"{record.name}: {text} {', '.join(found)}; that counts as noise" if found else ""


def preceded_in_motion(model: Model, x: Array) -> tuple[Record, ...]:
    """The records of a model, those of commands that begin in motion with what stood in the chambers before.

    As they are where a simulation of their first second fails.
    """
    records = list(model.records)
    moving = [k for k, record in enumerate(records) if unsure_of_pressures(model.parameters, record)]
    moving = [k for k in moving if not begins_at_rest(records[k])]
    if moving:
        with suppress(ConvergenceError):
            found = preceded(model.on([records[k] for k in moving]), x).records
            for k, record in zip(moving, found, strict=True):
                records[k] = record
    return tuple(records)
