"""The workflow from logs to a verdict: prepare, re-identify, screen, refit, decide, describe."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis import catalogue, excitation
from bha.diagnosis.baseline import (
    Baseline,
    Prepared,
    cut_to,
    disturbed_outputs,
    fit_baseline,
    mean_white_square,
    prepare_runs,
    thin,
)
from bha.diagnosis.cache import Cache, key_of
from bha.diagnosis.camera import moved, with_camera
from bha.diagnosis.candidate import core_ranges
from bha.diagnosis.decide import Decision, GapTest, Thresholds, decide, gap_test, without_faults
from bha.diagnosis.engine import Engine, Job
from bha.diagnosis.fit import Fit, Problem, evaluate, with_sensitivities
from bha.diagnosis.holdout import RUN_AWAY, Holdout, Prediction
from bha.diagnosis.intervals import confidences, coordinate_draws, intervals
from bha.diagnosis.model import EffectTerm, Model, plain_model
from bha.diagnosis.noise import Whitener
from bha.diagnosis.places import nested
from bha.diagnosis.records import Record, from_rest, prepare, sensed_noise, split, with_least_noise
from bha.diagnosis.refit import Trial, bic, correlation_length
from bha.diagnosis.repeats import repeats, with_repeat_noise
from bha.diagnosis.residual import describe_residual
from bha.diagnosis.result import CandidateLine, Correction, Diagnosis, Effect, Gap, Number, plain
from bha.diagnosis.screen import Signatures, probe, score
from bha.diagnosis.select import Rules, Search, search
from bha.diagnosis.smoothing import smoothed
from bha.diagnosis.start import first_state
from bha.diagnosis.steady import start_scatter
from bha.diagnosis.where import locate
from bha.errors import InputError

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.checkup import Finding
    from bha.recordings import Recording

Array = NDArray[np.float64]
#: Called with what is being done and the share of the stage that is done, or None where that is not known.
Progress = Callable[[str, float | None], None]


@dataclass(frozen=True)
class Investigation:
    """A diagnosis with what the report and the new parameter file need.

    Attributes:
        diagnosis: the result.
        model: the last model, the plain one unless effects were named.
        x: its coordinates.
        plain: the re-identified plain model on the held-out logs.
        best: the best set of effects on the held-out logs, named or not.
        holdout: the held-out logs.
        baseline: the plain fit.
        uncertainty: 95 % interval of every coordinate of ``model``.
    """

    diagnosis: Diagnosis
    model: Model
    x: Array
    plain: Trial
    best: Trial
    holdout: Holdout
    baseline: Baseline
    uncertainty: list[tuple[float, float]]


def run(  # noqa: PLR0915  (the steps of the diagnosis in their order, each one call)
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
) -> Investigation:
    """Diagnose the arm of ``logs``; see :func:`bha.diagnose`."""
    arm, commanded = logs[0].acting, logs[0].pressures.sort == "commanded"
    begin = time.monotonic()
    rules, limits = rules or Rules(), limits or Thresholds()

    def say(text: str, share: float | None = None) -> None:
        if progress is not None:
            progress(text, share)

    say("preparing the logs")
    train, held = _records(logs, holdout_logs, commanded)
    repeated = repeats(train)
    train, held = with_repeat_noise(train, repeated), with_repeat_noise(held, repeated)
    heads, lengths = _measured(train, arm)
    model = with_camera(plain_model(arm), arm) if heads else plain_model(arm)
    say("choosing the integration step")
    prepared = prepare_runs(model, train, lambda step, method: Engine(step, threads, method=method, shares=(1.0,)))
    engine = Engine(prepared.step, threads, prepared.coarse, method=prepared.method)
    say("re-identifying the plain model")
    options = (commanded, seed, rules, prepared.step, kinds)
    sensors = model.sensors and model.sensors.model_dump(mode="json")
    cache = Cache(cache_folder, key_of(json.dumps([model.core, sensors]), [*train, *held], options))
    scatter = start_scatter([*train, *held])
    baseline = fit_baseline(model, prepared, engine, seed, cache, scatter)
    problem, plain_fit, engine = baseline.problem, baseline.fit, baseline.problem.engine
    holdout = _holdout(baseline, prepared, held, engine)
    held = [cut_to(r, t) for r, t in zip(held, holdout.problem.records, strict=True)]
    prediction = holdout.predict(plain_fit.model, plain_fit.x)
    first = Trial((), plain_fit, prediction)
    state = Search(first, first, rules)
    if any(output.kind == "orientation" for log in logs for output in log.outputs):
        state.notes.append("orientations of heads take no part in a diagnosis, which weighs all outputs in metres")
    state.notes += [f"{log.name}: {text}" for log in (*logs, *holdout_logs) for text in (*log.notes, *log.findings)]
    state.notes += [
        f"{r.name}: counts from {r.time[0]:.1f} s on, where the arm rests under its commands"
        for r, log in zip([*train, *held], [*logs, *holdout_logs], strict=False)
        if commanded and r.time[0] > log.time[0]
    ]
    state.notes += [text for r in (*train, *held) if (text := r.left_open_in_words())]
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
    comparable = np.isfinite(prediction.mean_square)
    before = open_loop_error(held, engine, first, prediction.until if comparable else [np.inf] * len(held))
    gap = gap_test(problem, holdout, plain_fit, prediction, before / noise_rms, limits, more)
    say("locating the error")
    radius = [float(s["bellows_radius"]) for s in model.core["section"]]
    where = locate(problem, baseline.noise, plain_fit.outputs, plain_fit.residual, seed, radius)
    ranges = core_ranges()
    plans = [p for p in catalogue.available(kinds) if (heads or not p.needs_heads) and (lengths or not p.needs_lengths)]
    signatures = Signatures((), (), np.empty((problem.rows, 0), dtype=np.float32))
    try:
        signatures = probe(problem, plain_fit, plans, lambda share: say("screening all candidates", share), cache)
        if gap.significant and np.isfinite(gap.mean_square):
            search(problem, holdout, plain_fit, signatures, ranges, rules, say, state)
        else:
            state.screening = score(problem, plain_fit, signatures)
            state.complete = True
    except KeyboardInterrupt:
        state.notes.append("interrupted during the screening")
    # Both over the same rows: those before either model runs away.
    until = [min(ends) for ends in zip(prediction.until, state.best.prediction.until, strict=True)]
    after = before
    if state.best.candidates:
        before, after = (open_loop_error(held, engine, trial, until) for trial in (first, state.best))
    for record, end in zip(held, until, strict=True):
        if np.isfinite(end):
            state.notes.append(f"{record.name}: compared up to {end:.1f} s; after that a model runs away")
    verdict = without_faults(decide(state, gap, after / noise_rms, limits), faults)
    errors = (before, after if verdict.verdict == "named" else before)
    say("intervals and report")
    final = state.best if verdict.verdict == "named" else state.plain
    fit = final.fit if final is state.plain else with_sensitivities(problem, final.fit)
    uncertainty = intervals(problem, fit, seed)
    diagnosis = _describe(
        baseline,
        holdout,
        state,
        signatures,
        gap,
        verdict,
        where,
        replace(final, fit=fit),
        uncertainty,
        (noise_rms, *errors),
        seed,
        (train, held),
    )
    if state.complete:
        cache.clear()
    diagnosis = diagnosis.model_copy(update={"complete": state.complete, "seconds": round(time.monotonic() - begin, 3)})
    return Investigation(diagnosis, fit.model, fit.x, state.plain, state.best, holdout, baseline, uncertainty)


def _records(
    logs: Sequence[Recording], holdout_logs: Sequence[Recording], commanded: bool
) -> tuple[list[Record], list[Record]]:
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
    if not held:
        train, held = split(train)
    whole = with_least_noise([*train, *held])
    if commanded:
        whole = [from_rest(record) for record in whole]
    whole = smoothed(whole)
    return whole[: len(train)], whole[len(train) :]


def _measured(records: Sequence[Record], arm: Arm) -> tuple[bool, bool]:
    """Whether head positions were measured, and whether lengths where effects on their sensors are defined."""
    lengths = records[0].observation.is_length
    return not all(lengths), any(lengths) and arm.parameters.has_standard_bellows


def _holdout(baseline: Baseline, prepared: Prepared, held: Sequence[Record], engine: Engine) -> Holdout:
    from bha import _core  # noqa: PLC0415

    factor = max(1, round(prepared.records[0].sample_time / min(r.sample_time for r in held)))
    records = tuple(thin(r, factor) for r in held)
    model, x = baseline.fit.model, baseline.fit.x
    arm, camera = _core.Arm(model.arm(x)), model.camera(x)
    states = [first_state(arm, r.seen_by(camera), model.sections) for r in records]
    return Holdout(Problem(records, tuple(Whitener(r, baseline.noise) for r in records), engine), states)


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
        [change for change in changes if np.max(np.abs(change), initial=0.0) < RUN_AWAY]
        for changes in disturbed_outputs(held, fit, seed)
    ]
    if not all(drawn):
        return noise.floor, 0.0
    part = np.mean([np.mean(change**2, axis=0) for changes in drawn for change in changes], axis=0)
    floor = np.sqrt(noise.sensor**2 + np.maximum(part, noise.pressure_part**2) + noise.repeat_part**2)
    return floor, max(0.0, mean_white_square(held, drawn) - baseline.shaken)


def open_loop_error(records: Sequence[Record], engine: Engine, trial: Trial, until: Sequence[float]) -> float:
    """Open-loop RMS error on the rows of the held-out logs before ``until``, m; from the trial's initial states."""
    model, x = trial.fit.model, trial.fit.x
    arm, camera = model.arm(x), model.camera(x)
    runs = zip(records, trial.prediction.states, strict=True)
    outputs = engine.run([Job(arm, r, s, finer=model.finer, camera=camera) for r, s in runs])
    squares, count = 0.0, 0
    for record, y, end in zip(records, outputs, until, strict=True):
        error = (record.outputs - y)[record.good & (record.output_time < end)[:, None]]
        squares += float(np.sum(error**2)) if np.all(np.isfinite(error)) else np.inf
        count += error.size
    return min(float(np.sqrt(squares / max(count, 1))), 1e6)


def _describe(
    baseline: Baseline,
    holdout: Holdout,
    state: Search,
    signatures: Signatures,
    gap: GapTest,
    verdict: Decision,
    where: dict[str, Any],
    final: Trial,
    uncertainty: Sequence[tuple[float, float]],
    errors: tuple[float, float, float],
    seed: int,
    records: tuple[Sequence[Record], Sequence[Record]],
) -> Diagnosis:
    problem = baseline.problem
    named = final.candidates if verdict.verdict == "named" else ()
    best = excitation.best_by_key(state.screening, signatures) if state.screening is not None else {}
    correlation = correlation_length(problem, final.fit.residual)
    lines = _candidates(state, best, problem, correlation)
    weak = excitation.weakest(best, np.sqrt(correlation))
    alike = excitation.Likenesses((), np.empty((0, 0)))
    if state.screening is not None and best:
        alike = excitation.compare(state.screening, signatures, best)
    effects = _effects(state, alike, final, uncertainty, problem, correlation, seed) if named else []
    confused = [e.kind for e in effects if e.confusable_with]
    confused += [c.partition(" at ")[0] for e in effects for c in e.confusable_with]
    values = {
        c.name: Number(value=c.value(float(v)), unit=c.unit, ci95=uncertainty[k], at_bound=c.at_bound(float(v)))
        for k, (c, v) in enumerate(zip(final.fit.model.plain, final.fit.x, strict=False))
    }
    train, held = records
    return Diagnosis.model_validate(
        {
            "schema": "bha-diagnosis/1",
            "verdict": verdict.verdict,
            "reason": verdict.reason,
            "effects": effects,
            "gap": Gap(
                noise=errors[0],
                before=errors[1],
                after=errors[2],
                holdout=[r.name for r in held],
                significant=gap.significant,
                excess=max(0.0, min(gap.mean_square - gap.expected, 1e12)),
                excess_limit=gap.limit - gap.expected,
            ),
            "where": where,
            "candidates": lines,
            "residual": plain(describe_residual(holdout, state.best, state.plain, seed) | {"notes": state.notes}),
            "excitation": plain(
                {
                    "classes": alike.classes()[:20],
                    "least_visible": [{"kind": k, "detectable_over_typical": r} for k, r in weak[:10]],
                    "next_experiment": excitation.next_experiment(confused, weak),
                }
            ),
            "plain": values,
            "setup": [text for text in [moved(final.fit.model, uncertainty, final.fit.x)] if text],
            "logs": [plain(_log_facts(r, "training")) for r in train]
            + [plain(_log_facts(r, "held out")) for r in held],
        }
    )


def _log_facts(record: Record, part: str) -> dict[str, Any]:
    return {
        "name": record.name,
        "part": part,
        "rows": len(record.time),
        "duration": float(record.time[-1] - record.time[0]),
        "channels": [asdict(f) for f in (*record.facts, *record.pressure_facts)],
    }


def _candidates(
    state: Search, best: dict[tuple[str, str], excitation.Best], problem: Problem, correlation: float
) -> list[CandidateLine]:
    """All kinds and places by score, with what a refit of them alone gave."""
    reference = bic(state.plain, problem, correlation)
    refitted: dict[tuple[str, str], Trial] = {}
    for trial in state.trials:
        if len(trial.candidates) == 1:
            refitted[trial.key[0]] = trial
    criteria = {key: bic(trial, problem, correlation) - reference for key, trial in refitted.items()}
    least = min(criteria.values(), default=0.0)
    lines = []
    for key, entry in best.items():
        strengths = entry.scored.candidate.plan.strengths
        detectable = 3.0 * entry.scored.deviation * np.sqrt(correlation)
        alone = refitted.get(key)
        rms = alone.prediction.rms if alone is not None else None
        lines.append(
            CandidateLine(
                kind=key[0],
                where=key[1],
                score=entry.scored.share,
                holdout=rms if rms is not None and np.isfinite(rms) else None,
                bic=criteria.get(key),
                distance=criteria[key] - least if key in criteria else None,
                detectable=float(detectable) if strengths and np.isfinite(detectable) else None,
                unit=core_ranges()(key[0], strengths[0].name)[0] if strengths else "",
            )
        )
    return sorted(lines, key=lambda c: (c.bic if c.bic is not None else 0.0, -c.score))


def _effects(
    state: Search,
    looks: excitation.Likenesses,
    final: Trial,
    uncertainty: Sequence[tuple[float, float]],
    problem: Problem,
    correlation: float,
    seed: int,
) -> list[Effect]:
    result = []
    draws = coordinate_draws(problem, final.fit, seed)
    places: dict[tuple[str, str], list[int]] = {}
    for number, candidate in enumerate(final.candidates):
        places.setdefault(candidate.key, []).append(number)
    # Rivals were refitted without further elements: they are compared with the set that had none either.
    chosen = state.chosen if state.chosen is not None else final
    for numbers in places.values():
        number, candidate = numbers[0], final.candidates[numbers[0]]
        elements = [_Element.of(final.fit, k, draws) for k in numbers]
        parameters = _numbers(elements, candidate.plan.adding if len(numbers) > 1 else ())
        spans = [
            interval
            for e in elements
            for c, interval in zip(e.term.coordinates, uncertainty[e.place], strict=True)
            if str(c.path[-1]) in candidate.plan.passive
        ]
        empirical = any(e.term.on_bound(e.x) for e in elements) or any(high < 0.0 for _, high in spans)
        rivals = _rivals(state, chosen, number, problem, correlation)
        alike = [f"{t.key[number][0]} at {t.key[number][1]}" for t, distance in rivals if distance < 6.0]
        refitted = {t.key[number] for t, _ in rivals}
        alike += [
            f"{kind} at {where}"
            for kind, where, _ in looks.alike(candidate.key, 0.98)[:5]
            if (kind, where) not in refitted
        ]
        shares = confidences(problem, [chosen, *(t for t, _ in rivals[:5])], seed) if rivals else np.ones(1)
        kinds = [candidate.kind, *dict.fromkeys(a.partition(" at ")[0] for a in alike)]
        result.append(
            Effect(
                kind=candidate.kind,
                where=candidate.where,
                parameters=parameters,
                elements=[_numbers([e]) for e in elements] if len(elements) > 1 else [],
                confidence=float(shares[0]),
                confusable_with=list(dict.fromkeys(alike)),
                empirical=empirical,
                experiment=excitation.next_experiment(kinds, []) if alike else "",
                gap_removed=state.shares.get(candidate.key, 0.0),
            )
        )
    # The most important one first, whatever the order in which they were found.
    result.sort(key=lambda e: -e.gap_removed)
    return _gathered(result, final.fit.model.core)


def _gathered(effects: Sequence[Effect], core: Mapping[str, Any]) -> list[Effect]:
    """Effects of one kind at nested places as one: the most important of them with the others as its corrections."""
    result: list[Effect] = []
    for effect in effects:
        for k, main in enumerate(result):
            if main.kind == effect.kind and nested(main.where, effect.where, core):
                more = [Correction(where=effect.where, parameters=p) for p in effect.elements or [effect.parameters]]
                result[k] = main.model_copy(update={"corrections": [*main.corrections, *more]})
                break
        else:
            result.append(effect)
    return result


@dataclass(frozen=True)
class _Element:
    """One term of the model with its coordinates, their bootstrap changes, and where they stand in the vector."""

    term: EffectTerm
    x: Array
    draws: Array
    place: slice

    @classmethod
    def of(cls, fit: Fit, number: int, draws: Array) -> _Element:
        place = fit.model.place(number)
        return cls(fit.model.effects[number], fit.x[place], draws[:, place], place)


def _numbers(elements: Sequence[_Element], adding: Sequence[str] = ()) -> dict[str, Number]:
    """The numbers of the parameter file with their intervals, whatever coordinates they were fitted in.

    Of several elements the numbers ``adding`` are sums, the others those of the first.
    """
    ranges = core_ranges()
    values = [e.term.parameters([float(v) for v in e.x]) for e in elements]
    repeats = [[e.term.parameters([float(v) for v in e.x + d]) for d in e.draws] for e in elements]
    term = elements[0].term
    result = {}
    for name in values[0]:
        counted = range(len(elements)) if name in adding else range(1)
        found = np.sum([[r[name] for r in repeats[k]] for k in counted], axis=0)
        interval = None
        if name not in term.fixed and np.any(found != found[0]):
            low, high = np.quantile(found, [0.025, 0.975])
            interval = (float(low), float(high))
        result[name] = Number(
            value=float(sum(values[k][name] for k in counted)),
            unit=ranges(term.kind, name)[0],
            ci95=interval,
            at_bound=any(name in elements[k].term.on_bound(elements[k].x) for k in counted),
        )
    return result


def _rivals(
    state: Search, final: Trial, number: int, problem: Problem, correlation: float
) -> list[tuple[Trial, float]]:
    """Trials that differ from the final one in one effect only, with the distance of their criterion."""
    mine = bic(final, problem, correlation)
    found: dict[tuple[tuple[str, str], ...], tuple[Trial, float]] = {}
    for trial in state.trials:
        if len(trial.key) == len(final.key) and trial.key != final.key:
            different = [k for k in range(len(final.key)) if trial.key[k] != final.key[k]]
            if different == [number]:
                found[trial.key] = (trial, bic(trial, problem, correlation) - mine)
    return sorted(found.values(), key=lambda f: f[1])
