"""The workflow from logs to a verdict: prepare, re-identify, screen, refit, decide, describe."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis import catalogue
from bha.diagnosis.baseline import Baseline, Prepared, preceded_in_motion
from bha.diagnosis.cache import Cache, key_of
from bha.diagnosis.candidate import core_ranges
from bha.diagnosis.decide import Decision, GapTest, Thresholds, decide, gap_test, tolerant, untold, without_faults
from bha.diagnosis.describe import describe
from bha.diagnosis.fit import Fit, Problem, evaluate, whole_logs, with_sensitivities
from bha.diagnosis.given import Given
from bha.diagnosis.holdout import RUN_AWAY, Holdout, Prediction, Readings, rms_errors
from bha.diagnosis.intervals import coordinate_draws, form_deviation, intervals, is_there
from bha.diagnosis.noises import disturbed_outputs, mean_white_square
from bha.diagnosis.plain import FOUND, fit_plain, remembering
from bha.diagnosis.preparation import (
    cut_to,
    from_rest,
    left_open_in_words,
    records_of,
    sound_records,
    thin,
    with_least_noise,
)
from bha.diagnosis.refit import Trial
from bha.diagnosis.remembered import remembered, with_memory
from bha.diagnosis.repeats import repeats, with_repeat_noise
from bha.diagnosis.result import Diagnosis
from bha.diagnosis.rules import NOISE_LEFT, Rules
from bha.diagnosis.screen import Signatures, probe, score
from bha.diagnosis.search import OutOfTime, Search
from bha.diagnosis.select import search
from bha.diagnosis.sessions import stand_apart
from bha.diagnosis.smoothing import smoothed
from bha.diagnosis.unlogged import Unlogged, unlogged
from bha.diagnosis.ways import unlike, with_finding
from bha.diagnosis.where import locate
from bha.estimation.asked import stands_elsewhere
from bha.estimation.engine import Model
from bha.estimation.records import Record, Window
from bha.estimation.steady import start_scatter
from bha.estimation.strays import in_words
from bha.recordings.beginning import preloaded
from bha.support.shown import short_repr

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.checkup import Finding
    from bha.recordings import Recording

Array = NDArray[np.float64]
#: Called with what is being done and the share of the stage that is done, or None where that is not known.
Progress = Callable[[str, float | None], None]


@short_repr
@dataclass(frozen=True)
class Investigation:
    """A diagnosis with what the report and the new parameter file need.

    Attributes:
        arm: the arm from whose values the plain model began: the file's, or one moved from it.
        diagnosis: the result.
        model: the last model, the plain one unless effects were named.
        x: its coordinates.
        plain: the re-identified plain model on the held-out logs.
        best: the best set of effects on the held-out logs, named or not.
        holdout: the held-out logs.
        baseline: the plain fit.
        uncertainty: 95 % interval of every coordinate of ``model``.
    """

    arm: Arm
    diagnosis: Diagnosis
    model: Model
    x: Array
    plain: Trial
    best: Trial
    holdout: Holdout
    baseline: Baseline
    uncertainty: list[tuple[float, float]]


def run(  # noqa: PLR0912, PLR0915  (the steps of the diagnosis in their order, each one call)
    logs: Sequence[Recording],
    holdout_logs: Sequence[Recording] = (),
    *,
    seed: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    cache_folder: Path | None = None,
    kinds: Sequence[str] | None = None,
    rules: Rules | None = None,
    limits: Thresholds | None = None,
    faults: Sequence[Finding] = (),
    doubts: Sequence[Finding] = (),
    tolerance: float = 0.0,
    limit: float | None = None,
) -> Investigation:
    """Diagnose the arm of ``logs``; see :func:`bha.diagnose`."""
    arm, commanded = logs[0].arm, logs[0].pressures.sort == "commanded"
    begin = time.monotonic()
    rules, limits = rules or Rules(), limits or Thresholds()

    def say(text: str, share: float | None = None) -> None:
        if progress is not None:
            progress(text, share)

    def timely(text: str) -> None:
        if limit is not None and time.monotonic() - begin > limit:
            raise OutOfTime(text)
        say(text)

    say("preparing the logs")
    train, held = _records(arm, logs, holdout_logs, commanded)
    repeated = repeats(train)
    train, held = with_repeat_noise(train, repeated), with_repeat_noise(held, repeated)
    heads, lengths = _measured(train, arm)
    sensors = arm.parameters.sensors and arm.parameters.sensors.model_dump(mode="json")
    inputs = json.dumps([arm.parameters.to_core(), sensors])
    cache = Cache(cache_folder, key_of(inputs, [*train, *held], (commanded, heads, seed, rules, kinds)))
    arm = remembering(arm, train)
    scatter = None if preloaded(arm.parameters) else start_scatter([*train, *held])
    plain = fit_plain(
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
    )
    faults = plain.faults
    baseline = plain.baseline
    prepared = baseline.prepared
    model = baseline.fit.model
    problem, plain_fit = baseline.problem, baseline.fit
    holdout = _holdout(baseline, prepared, held)
    before_strays = held
    sound = sound_records(held, holdout.problem.records, holdout.predict(model, plain_fit.x).outputs)
    if sound != held:
        holdout = _holdout(baseline, prepared, sound)
    held = [record.alone for record in holdout.readings.records]
    first = Trial((), plain_fit, holdout)
    prediction = first.prediction
    state = Search(first, first)
    if any(output.kind == "orientation" for log in logs for output in log.outputs):
        state.notes.append("orientations of heads take no part in a diagnosis, which weighs all outputs in metres")
    if len(logs) + len(holdout_logs) == 1:
        state.notes.append(
            "one log only: its last third certifies what the rest was searched for; both have one motion and one "
            "session, so that errors and verdict are biased by selection"
        )
    state.notes += [f"{log.name}: {text}" for log in (*logs, *holdout_logs) for text in (*log.notes, *log.findings)]
    state.notes += [
        f"{r.name}: counts from {r.drive.time[0]:.1f} s on, where the arm rests under its commands"
        for r, log in zip([*train, *held], [*logs, *holdout_logs], strict=False)
        if commanded and r.drive.time[0] > log.time[0]
    ]
    state.notes += [text for r in (*train, *held) if (text := left_open_in_words(r))]
    state.notes += filter(None, map(in_words, (*train, *before_strays), (*prepared.full, *held)))
    if scatter is not None and np.any(scatter > baseline.noise.sensor * 0.3):
        state.notes.append(
            f"logs that begin under the same pressures begin {1e3 * float(np.max(scatter)):.2g} mm apart (RMS): "
            "something sets them apart that is not logged; that counts as noise"
        )
    state.notes += [
        f"{r.names[0]} and {r.names[1]} have the same inputs: what sets their outputs apart, {1e3 * r.rms:.2g} mm RMS "
        "in each, counts as noise"
        for r in repeated
    ]
    floor, more = _held_out_noise(baseline, holdout, prediction, seed)
    noise_rms = float(np.sqrt(np.mean(floor**2)))
    say("testing the gap")
    limits = tolerant(limits, tolerance, noise_rms)

    def tested(own: Search) -> tuple[float, GapTest]:
        """Error of the plain model on the held-out logs, m RMS, and whether it is a gap."""
        predicted = own.plain.prediction
        error = rms_errors(predicted)[0] if np.isfinite(predicted.mean_square) else predicted.rms
        return error, gap_test(problem, own.plain.holdout, plain_fit, predicted, error / noise_rms, limits, more)

    before, gap = tested(state)
    memory = remembered(problem, plain_fit, holdout, prediction, noise_rms, limits)
    # Names of many effects would mend what the file has wrong; one may hint at a fault that is none.
    rules = replace(rules, most=1) if faults else rules
    # Of an arm that remembers nothing but the form of that is asked: for the rest of it others would stand in.
    if remembers := bool(preloaded(model.parameters)):
        rules = replace(rules, most=1, thorough=False)
    # Beside a model that shows no more than a part of the motion nothing tells an effect.
    hopeless = bool(faults) and plain.left >= FOUND
    if remembers:
        state.notes.append("the arm remembers: beside the form of its memory no further effect is sought")
    say("locating the error")
    radius = [float(s["bellows_radius"]) for s in model.core["section"]]
    where = locate(problem, baseline.noise, plain_fit.outputs, plain_fit.residual, seed, radius)
    plans = [p for p in catalogue.available(kinds) if (heads or not p.needs_heads) and (lengths or not p.needs_lengths)]
    signatures = Signatures((), (), np.empty((problem.rows, 0), dtype=np.float32))
    beside: Unlogged | None = None
    try:
        signatures = probe(problem, plain_fit, plans, lambda share: say("screening all candidates", share), cache)
        state.screening = score(problem, plain_fit, signatures)
        wanted = gap.significant and np.isfinite(gap.mean_square) and not hopeless
        beside = unlogged(problem, plain_fit, holdout, prediction, state.screening, seed) if wanted else None
        if wanted and not (beside is not None and beside.needs_no_search):
            rules = _beside(beside, rules)
            search(Given(problem, holdout, signatures, core_ranges(), rules, noise_rms, timely), state)
        else:
            # No gap, or one that follows nothing that was logged: there is nothing to be refitted.
            state.complete = True
    except KeyboardInterrupt:
        state.notes.append("interrupted during the screening")
    apart = stand_apart(state.best) if gap.significant else ""
    if apart and state.best.candidates:
        # What differs from day to day may hide an effect; where nothing is named, it may as well be one.
        moved = state.about_means()
        error, other = tested(moved)
        if decide(moved, other, noise_rms, limits).verdict == "named":
            state, before, gap = moved, error, other
            holdout, prediction = moved.plain.holdout, moved.plain.prediction
            apart += "; errors count about the mean of each log and channel"
    state.notes += [apart] if apart else []
    before, after = _compared(state, prediction, before)
    # All over the same blocks: those in which no model has run away.
    until = [min(ends) for ends in zip(prediction.until, state.best.prediction.until, strict=True)]
    state.notes += [
        f"{record.name}: compared up to {end:.1f} s; after that a model runs away"
        for record, end in zip(held, until, strict=True)
        if np.isfinite(end)
    ]
    decision = decide(state, gap, noise_rms, limits, tolerance)
    if hopeless and decision.verdict == "unexplained":
        decision = replace(decision, reason="no effect is sought before")
    if apart and decision.verdict == "unexplained":
        decision = replace(decision, reason=f"{decision.reason}; {apart}")
    if beside is not None and state.complete:
        decision = beside.judge(decision, noise_rms)
        decision = _completed(decision, state, problem, holdout, signatures, (before, after), seed)
    say("intervals and report")
    final = state.best if decision.verdict == "named" else state.plain
    fit, draws, uncertainty, told = _known(problem, final, signatures, seed)
    if not told:
        decision = untold(decision, final.label)
        final = state.plain
        fit, draws, uncertainty, _ = _known(problem, final, signatures, seed)
    verdict = without_faults(decision, faults)
    errors = (before, after if verdict.verdict == "named" else before)
    diagnosis = describe(
        baseline,
        holdout,
        state,
        signatures,
        gap,
        verdict,
        where,
        replace(final, fit=fit),
        uncertainty,
        draws,
        (noise_rms, *errors),
        seed,
        (train, held),
        lambda trial: rms_errors(prediction, trial.prediction)[1],
        tolerance,
    )
    lag = next((effect for effect in diagnosis.of_commands if effect.kind == "pressure_lag"), None)
    diagnosis = with_finding(diagnosis, unlike(problem, plain_fit, holdout, prediction, lag, noise_rms))
    diagnosis = with_memory(diagnosis, memory)
    setup = [*(fault.in_a_line() for fault in faults), *plain.said, *diagnosis.setup]
    disturbed = gap.significant and verdict.verdict == "equivalent"
    diagnosis = diagnosis.model_copy(update={"setup": setup, "disturbed": disturbed, "unexamined": state.unexamined})
    if state.complete:
        cache.clear()
    diagnosis = diagnosis.model_copy(update={"complete": state.complete, "seconds": round(time.monotonic() - begin, 3)})
    return Investigation(
        arm=plain.arm,
        diagnosis=diagnosis,
        model=fit.model,
        x=fit.x,
        plain=state.plain,
        best=state.best,
        holdout=holdout,
        baseline=baseline,
        uncertainty=uncertainty,
    )


def _beside(left: Unlogged | None, rules: Rules) -> Rules:
    """The rules of a search: beside a disturbance one effect at most shows."""
    return replace(rules, most=1) if left is not None and left.is_a_disturbance else rules


def _compared(state: Search, prediction: Prediction, plain: float) -> tuple[float, float]:
    """Errors of the plain model and of the best set on the held-out logs, m RMS, over the same blocks.

    ``plain`` is that of the plain model alone. A set that runs away before anything is compared is refuted.
    """
    best = state.best
    if not best.candidates or not np.isfinite(prediction.mean_square):
        return plain, plain
    before, after = rms_errors(prediction, best.prediction)
    if np.isfinite(before) and np.isfinite(after):
        return before, after
    state.notes.append(f"dropped: {best.label} (the model with it runs away on the held-out logs)")
    state.best = state.plain
    return plain, plain


def _known(
    problem: Problem, trial: Trial, signatures: Signatures, seed: int
) -> tuple[Fit, Array, list[tuple[float, float]], bool]:
    """The fit of a set with its sensitivities, draws of what the logs leave open of it, its intervals, and whether
    there is some of what it names (:func:`bha.diagnosis.intervals.is_there`)."""
    if not trial.candidates:
        draws = coordinate_draws(problem, trial.fit, seed)
        return trial.fit, draws, intervals(trial.fit, draws), True
    fit = with_sensitivities(problem, trial.fit)
    form = form_deviation(problem, fit, signatures, seed)
    draws = coordinate_draws(problem, fit, seed, form)
    return fit, draws, intervals(fit, draws), is_there(problem, replace(trial, fit=fit), form, seed)


def _completed(
    decision: Decision,
    state: Search,
    problem: Problem,
    holdout: Holdout,
    signatures: Signatures,
    errors: tuple[float, float],
    seed: int,
) -> Decision:
    """The decision where one effect explains a part of a gap: what it leaves is asked whether it follows something.

    What does is the effect's form, if it is named, and the search is marked as inexact.
    """
    best, named = state.best, decision.verdict == "named"
    exact = best.fit.squares / problem.rows < NOISE_LEFT
    if decision.verdict not in ("named", "unexplained") or (named and exact):
        return decision
    if len(set(best.key)) != 1 or best.fit.jacobian is None:
        return decision
    left = unlogged(problem, best.fit, holdout, best.prediction, score(problem, best.fit, signatures), seed)
    if left is None:
        return decision
    state.inexact = named and left.follows_something
    return decision if state.second else left.complete(decision, *errors)


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


def _holdout(baseline: Baseline, prepared: Prepared, held: Sequence[Record]) -> Holdout:
    factor = max(1, round(prepared.records[0].sample_time / min(r.sample_time for r in held)))
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
