"""What a search for effects stands on: logs, plain model, held-out logs under it, and the noise of a right model.

What: logs are made comparable (:mod:`bha.diagnosis.preparation`), repeats among them tell noise, the plain model is
re-identified (:mod:`bha.diagnosis.plain`), and the held-out logs are predicted by it. All that is worth saying of it is
kept as notes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.baseline import Baseline
from bha.diagnosis.cache import Cache, key_of
from bha.diagnosis.decide import GapTest, Thresholds, gap_test
from bha.diagnosis.extrapolation import where_told
from bha.diagnosis.fit import evaluate, whole_logs
from bha.diagnosis.holdout import RUN_AWAY, Holdout, Prediction, Readings, rms_errors
from bha.diagnosis.noises import disturbed_outputs, mean_white_square
from bha.diagnosis.plain import FOUND, Plain, PlainFits, remembering
from bha.diagnosis.preparation import (
    cut_to,
    from_rest,
    left_open_in_words,
    preceded_in_motion,
    records_of,
    sound_records,
    thin,
    with_least_noise,
)
from bha.diagnosis.refit import Trial
from bha.diagnosis.repeats import repeats, with_repeat_noise
from bha.diagnosis.rules import Rules
from bha.diagnosis.smoothing import smoothed
from bha.estimation.asked import stands_elsewhere
from bha.estimation.records import Record, Window
from bha.estimation.steady import start_scatter
from bha.estimation.strays import in_words
from bha.recordings.beginning import preloaded

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.checkup import Finding
    from bha.recordings import Recording

Array = NDArray[np.float64]
Tell = Callable[[str, float | None], None]

#: Logs that begin alike and stand apart by this part of the sensors' noise are said to.
APART = 0.3


@dataclass(frozen=True)
class Ground:
    """What a search for effects stands on.

    Attributes:
        plain: the plain model with where it began and the faults of the setup.
        train, held: the logs of the fit and the held-out ones, as they were read.
        holdout: the held-out logs as the plain model predicts them.
        first: the plain model as the first of all trials.
        noise: RMS error of a right model on the held-out logs, m.
        beyond: mean square of their white rows beyond that of the training logs, of a right model.
        notes: what is worth saying of it.
        aside: where held-out logs do not count, in words; empty where all of them does.
        heads, lengths: whether head positions were measured, and lengths where effects of their sensors are defined.
        cache: of finished fits.
    """

    plain: Plain
    train: list[Record]
    held: list[Record]
    holdout: Holdout
    first: Trial
    noise: float
    beyond: float
    notes: list[str]
    aside: str
    heads: bool
    lengths: bool
    cache: Cache

    @property
    def baseline(self) -> Baseline:
        """The plain fit."""
        return self.plain.baseline

    @property
    def remembers(self) -> bool:
        """Whether the arm stands elsewhere under the same pressures after each use."""
        return bool(preloaded(self.baseline.fit.model.parameters))

    @property
    def is_hopeless(self) -> bool:
        """Whether faults of the setup leave so much of the motion that beside the model nothing tells an effect."""
        return bool(self.plain.faults) and self.plain.left >= FOUND

    def tested(self, plain: Trial, limits: Thresholds) -> tuple[float, GapTest]:
        """Error of the plain model on the held-out logs, m RMS, and whether it is a gap."""
        predicted = plain.prediction
        error = rms_errors(predicted)[0] if np.isfinite(predicted.mean_square) else predicted.rms
        fit = self.baseline.fit
        ratio = error / self.noise
        return error, gap_test(self.baseline.problem, plain.holdout, fit, predicted, ratio, limits, self.beyond)


def prepare(
    logs: Sequence[Recording],
    holdout_logs: Sequence[Recording],
    *,
    rules: Rules,
    kinds: Sequence[str] | None,
    faults: Sequence[Finding],
    doubts: Sequence[Finding],
    seed: int,
    threads: int | None,
    cache_folder: Path | None,
    say: Tell,
) -> Ground:
    """The ground of a search; the arguments are those of :func:`bha.diagnosis.workflow.run`."""
    arm, commanded = logs[0].arm, logs[0].pressures.sort == "commanded"
    train, held = _records(arm, logs, holdout_logs, commanded)
    repeated = repeats(train)
    train, held = with_repeat_noise(train, repeated), with_repeat_noise(held, repeated)
    heads, lengths = _measured(train, arm)
    sensors = arm.parameters.sensors and arm.parameters.sensors.model_dump(mode="json")
    inputs = json.dumps([arm.parameters.to_core(), sensors])
    cache = Cache(cache_folder, key_of(inputs, [*train, *held], (commanded, heads, seed, rules, kinds)))
    arm = remembering(arm, train)
    scatter = None if preloaded(arm.parameters) else start_scatter([*train, *held])
    plain = PlainFits(
        arm,
        train,
        commanded=commanded,
        # What a camera elsewhere would show is told by first poses.
        camera=heads and not preloaded(arm.parameters),
        faults=faults,
        doubts=doubts,
        seed=seed,
        threads=threads,
        cache=cache,
        scatter=scatter,
        tell=say,
    ).best()
    baseline = plain.baseline
    read = held
    first = Trial((), baseline.fit, _holdout(baseline, held))
    sound = sound_records(held, first.holdout.problem.records, first.prediction.outputs)
    if sound != held:
        first = Trial((), baseline.fit, _holdout(baseline, sound))
    holdout, aside = where_told(baseline.problem, first)
    first = replace(first, holdout=holdout)
    held = [record.alone for record in holdout.readings.records]
    floor, beyond = _held_out_noise(baseline, holdout, first.prediction, seed)
    notes = _of_logs(logs, holdout_logs, [*train, *held], commanded)
    notes += filter(None, map(in_words, (*train, *read), (*baseline.prepared.full, *held)))
    if scatter is not None and np.any(scatter > baseline.noise.sensor * APART):
        notes.append(
            f"logs that begin under the same pressures begin {1e3 * float(np.max(scatter)):.2g} mm apart (RMS): "
            "something sets them apart that is not logged; that counts as noise"
        )
    notes += [
        f"{r.names[0]} and {r.names[1]} have the same inputs: what sets their outputs apart, {1e3 * r.rms:.2g} mm RMS "
        "in each, counts as noise"
        for r in repeated
    ]
    return Ground(
        plain=plain,
        train=train,
        held=held,
        holdout=holdout,
        first=first,
        noise=float(np.sqrt(np.mean(floor**2))),
        beyond=beyond,
        notes=notes,
        aside=aside,
        heads=heads,
        lengths=lengths,
        cache=cache,
    )


def _of_logs(
    logs: Sequence[Recording], holdout_logs: Sequence[Recording], records: Sequence[Record], commanded: bool
) -> list[str]:
    """What is worth saying of the logs themselves; ``records`` are those of the fit and the held-out ones."""
    every = [*logs, *holdout_logs]
    notes = []
    if any(output.kind == "orientation" for log in every for output in log.outputs):
        notes.append("orientations of heads take no part in a diagnosis, which weighs all outputs in metres")
    if len(every) == 1:
        notes.append(
            "one log only: its last third certifies what the rest was searched for; both have one motion and one "
            "session, so that errors and verdict are biased by selection"
        )
    notes += [f"{log.name}: {text}" for log in every for text in (*log.notes, *log.findings)]
    notes += [
        f"{r.name}: counts from {r.drive.time[0]:.1f} s on, where the arm rests under its commands"
        for r, log in zip(records, every, strict=False)
        if commanded and r.drive.time[0] > log.time[0]
    ]
    return notes + [text for r in records if (text := left_open_in_words(r))]


def _records(
    arm: Arm, logs: Sequence[Recording], holdout_logs: Sequence[Recording], commanded: bool
) -> tuple[list[Record], list[Record]]:
    train, held = records_of(logs, holdout_logs)
    whole = with_least_noise([*train, *held])
    # Where an arm remembers, each log tells by its first pose how it stood, and under which command that was.
    if commanded and not (preloaded(arm.parameters) or stands_elsewhere(whole[: len(train)])):
        whole = [from_rest(record) for record in whole]
    whole = smoothed(whole)
    return whole[: len(train)], whole[len(train) :]


def _measured(records: Sequence[Record], arm: Arm) -> tuple[bool, bool]:
    """Whether head positions were measured, and whether lengths where effects on their sensors are defined."""
    lengths = records[0].observation.is_length
    return not all(lengths), any(lengths) and any(arm.parameters.measures_coordinates)


def _holdout(baseline: Baseline, held: Sequence[Record]) -> Holdout:
    factor = max(1, round(baseline.prepared.records[0].sample_time / min(r.sample_time for r in held)))
    model = baseline.fit.model.on([thin(r, factor) for r in held])
    records = preceded_in_motion(model, baseline.fit.x)
    model = model.on(records)
    states = model.guesses(baseline.fit.x, [Window(k, 0, len(r)) for k, r in enumerate(records)])
    readings = Readings(tuple(cut_to(r, t) for r, t in zip(held, records, strict=True)) if factor > 1 else records)
    return Holdout(whole_logs(model, baseline.noise, list(states)), list(states), readings)


def _held_out_noise(baseline: Baseline, holdout: Holdout, prediction: Prediction, seed: int) -> tuple[Array, float]:
    """Open-loop error of a right model on the held-out logs, and what of it the whitening of the training logs lacks.

    Noise of sensors and pressures, unlike repeats. What readings of pressures leave open differs from log to log.

    Returns:
        RMS error in each output, m, shape (channels,); mean square of white rows beyond that of the training logs.
    """
    noise, held = baseline.noise, holdout.problem
    if not any(doubt.any for record in held.records for doubt in record.doubts):
        return noise.floor, 0.0
    fit = evaluate(held, baseline.fit.model, baseline.fit.x, prediction.states)
    drawn = [
        baseline.bound([change for change in changes if np.max(np.abs(change), initial=0.0) < RUN_AWAY], record)
        for record, changes in zip(held.records, disturbed_outputs(held, fit, seed), strict=True)
    ]
    if not all(drawn):
        return noise.floor, 0.0
    part = np.mean([np.mean(change**2, axis=0) for changes in drawn for change in changes], axis=0)
    floor = np.sqrt(noise.sensor**2 + np.maximum(part, noise.pressure_part**2) + noise.repeat_part**2)
    return floor, max(0.0, mean_white_square(held, drawn) - baseline.shaken)
