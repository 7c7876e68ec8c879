"""The workflow from logs to a verdict: prepare, re-identify, screen, refit, decide, describe."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis import catalogue
from bha.diagnosis.baseline import Baseline
from bha.diagnosis.candidate import core_ranges
from bha.diagnosis.decide import Decision, GapTest, Thresholds, decide, tolerant, untold, without_faults
from bha.diagnosis.describe import describe
from bha.diagnosis.fit import Problem, with_sensitivities
from bha.diagnosis.given import Given
from bha.diagnosis.ground import Ground, prepare
from bha.diagnosis.holdout import Holdout, rms_errors
from bha.diagnosis.intervals import coordinate_draws, form_deviation, intervals, is_there
from bha.diagnosis.refit import Trial
from bha.diagnosis.remembered import remembered, with_memory
from bha.diagnosis.result import Diagnosis
from bha.diagnosis.rules import NOISE_LEFT, Rules
from bha.diagnosis.screen import Signatures, probe, score
from bha.diagnosis.search import OutOfTime, Search
from bha.diagnosis.select import search
from bha.diagnosis.sessions import LACKS, excused, leaves_noise, stand_apart, stands_off
from bha.diagnosis.unlogged import Unlogged, unlogged
from bha.diagnosis.ways import unlike, with_finding
from bha.diagnosis.where import locate
from bha.estimation.engine import Model
from bha.support.shown import short_repr

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.checkup import Finding
    from bha.recordings import Recording

Array = NDArray[np.float64]
#: Called with what is being done and the share of the stage that is done, or None where that is not known.
Progress = Callable[[str, float | None], None]

#: What errors do not count where logs stand apart.
OF_SESSIONS = "other rest lengths and another place of the camera, of each log its own"
OF_DAYS = "what is another number on another day"


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


@dataclass(frozen=True)
class Course:
    """How a diagnosis goes: its rules, its seed, its time, and whom it tells what it does.

    Attributes:
        rules: of the search.
        limits: thresholds of the verdict.
        tolerance: error that does not matter, m.
        seed: of all that is drawn.
        begin: when it began, s on the monotonic clock.
        limit: how long a search may go on from there, s.
        progress: told what is being done.
    """

    rules: Rules
    limits: Thresholds
    tolerance: float
    seed: int
    begin: float
    limit: float | None
    progress: Progress | None

    def say(self, text: str, share: float | None = None) -> None:
        """Tell what is being done."""
        if self.progress is not None:
            self.progress(text, share)

    def timely(self, text: str) -> None:
        """Tell what is being done, if there is time for it.

        Raises:
            OutOfTime: there is none.
        """
        if self.limit is not None and self.seconds > self.limit:
            raise OutOfTime(text)
        self.say(text)

    @property
    def seconds(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self.begin


def run(
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
    rules, limits = rules or Rules(), limits or Thresholds()
    course = Course(rules, limits, tolerance, seed, time.monotonic(), limit, progress)
    course.say("preparing the logs")
    ground = prepare(
        logs,
        holdout_logs,
        rules=rules,
        kinds=kinds,
        faults=faults,
        doubts=doubts,
        seed=seed,
        threads=threads,
        cache_folder=cache_folder,
        say=course.say,
    )
    # Names of many effects would mend what the file has wrong; one may hint at a fault that is none.
    rules = replace(rules, most=1) if ground.plain.faults else rules
    # Of an arm that remembers nothing but the form of that is asked: for the rest of it others would stand in.
    rules = replace(rules, most=1, thorough=False) if ground.remembers else rules
    course = replace(course, rules=rules, limits=tolerant(limits, tolerance, ground.noise))
    found = _searched(ground, course, kinds)
    decision, errors = _decided(ground, course, found)
    diagnosis, final = _described(ground, course, found, decision, errors)
    if found.state.complete:
        ground.cache.clear()
    return Investigation(
        arm=ground.plain.arm,
        diagnosis=diagnosis,
        model=final.trial.fit.model,
        x=final.trial.fit.x,
        plain=found.state.plain,
        best=found.state.best,
        holdout=found.state.plain.holdout,
        baseline=ground.baseline,
        uncertainty=final.uncertainty,
    )


@dataclass(frozen=True)
class Found:
    """What a search has found.

    Attributes:
        state: the search.
        signatures: what each candidate would do.
        gap: whether there is one.
        before: error of the plain model on the held-out logs, m RMS.
        beside: what of the gap follows nothing that was logged; None where that was not asked.
        apart: what is to be said of held-out logs that stand elsewhere as a whole; empty where they do not.
    """

    state: Search
    signatures: Signatures
    gap: GapTest
    before: float
    beside: Unlogged | None
    apart: str


def _set_out(ground: Ground, course: Course, state: Search) -> tuple[Search, float, GapTest, str]:
    """A search as it begins, the error of the plain model on the held-out logs, m RMS, and whether it is a gap.

    Errors count beyond what sets sessions apart where the plain model lacks nothing else; what is to be said of that is
    the last.
    """
    before, gap = ground.tested(state.plain, course.limits)
    away = state.plain.prediction.ran_away
    lacks = ground.baseline.fit.squares > LACKS * ground.baseline.problem.rows
    if gap.significant and not (away or lacks or ground.remembers) and excused(state.plain, ground.train):
        moved, text = state.on_their_days()
        error, other = ground.tested(moved.plain, course.limits)
        training = ground.baseline.fit.squares / ground.baseline.problem.rows
        if leaves_noise(other, training, course.limits.material):
            return moved, error, other, f"{stands_off(state.plain)}; errors count beyond {OF_DAYS} ({text})"
    return state, before, gap, ""


def _in_sessions(state: Search, gap: GapTest, noise: float) -> tuple[Search, str]:
    """A search with errors beyond what sets sessions apart, and what is to be said of it; empty where nothing does."""
    if not gap.significant or state.best.prediction.ran_away:
        return state, ""
    moved = state.in_sessions()
    return moved, stand_apart(state.best, moved.best, noise)


@dataclass(frozen=True)
class Final:
    """The model that is described: the best set where it is named, else the plain model.

    Attributes:
        trial: the set, its fit with sensitivities.
        draws: of what the logs leave open of its coordinates.
        uncertainty: 95 % interval of each.
    """

    trial: Trial
    draws: Array
    uncertainty: list[tuple[float, float]]


def _searched(ground: Ground, course: Course, kinds: Sequence[str] | None) -> Found:
    """Test the gap, screen all candidates, and search where there is something to be found."""
    problem, fit = ground.baseline.problem, ground.baseline.fit
    state = Search(ground.first, ground.first, notes=list(ground.notes))
    course.say("testing the gap")
    state, before, gap, apart = _set_out(ground, course, state)
    if ground.remembers:
        state.notes.append("the arm remembers: beside the form of its memory no further effect is sought")
    noise = max(float(np.max(record.pressure_noise)) for record in ground.train)
    plans = catalogue.beyond_noise(catalogue.available(kinds), noise)
    plans = [p for p in plans if (ground.heads or not p.needs_heads) and (ground.lengths or not p.needs_lengths)]
    signatures = Signatures((), (), np.empty((problem.rows, 0), dtype=np.float32))
    beside: Unlogged | None = None
    try:
        signatures = probe(
            problem, fit, plans, lambda share: course.say("screening all candidates", share), ground.cache
        )
        state.screening = score(problem, fit, signatures)
        wanted = gap.significant and np.isfinite(gap.mean_square) and not ground.is_hopeless
        if wanted:
            beside = unlogged(problem, fit, ground.holdout, state.plain.prediction, state.screening, course.seed)
        if wanted and not (beside is not None and beside.needs_no_search):
            rules = _beside(beside, course.rules)
            search(Given(problem, ground.holdout, signatures, core_ranges(), rules, ground.noise, course.timely), state)
        else:
            # No gap, or one that follows nothing that was logged: there is nothing to be refitted.
            state.complete = True
    except KeyboardInterrupt:
        state.notes.append("interrupted during the screening")
    moved, text = _in_sessions(state, gap, ground.noise)
    apart = apart or text
    if apart and state.best.candidates:
        # What differs from day to day may hide an effect; where nothing is named, it may as well be one.
        error, other = ground.tested(moved.plain, course.limits)
        if decide(moved, other, ground.noise, course.limits).verdict == "named":
            state, before, gap = moved, error, other
            apart += f"; errors count beyond an offset of each channel and {OF_SESSIONS}"
    state.notes += [apart] if apart else []
    return Found(state, signatures, gap, before, beside, apart)


def _decided(ground: Ground, course: Course, found: Found) -> tuple[Decision, tuple[float, float]]:
    """The verdict, and errors of the plain model and of the best set on the held-out logs, m RMS."""
    state = found.state
    before, after = _compared(state, found.before)
    # All over the same blocks: those in which no model has run away.
    until = [min(ends) for ends in zip(state.plain.prediction.until, state.best.prediction.until, strict=True)]
    state.notes += [
        f"{record.name}: compared up to {end:.1f} s; after that a model runs away"
        for record, end in zip(ground.held, until, strict=True)
        if np.isfinite(end)
    ]
    decision = decide(state, found.gap, ground.noise, course.limits, course.tolerance)
    if decision.verdict == "unexplained" and ground.is_hopeless:
        decision = replace(decision, reason="no effect is sought before")
    if decision.verdict != "named" and found.apart:
        decision = replace(decision, reason=f"{decision.reason}; {found.apart}")
    if found.beside is not None and state.complete:
        decision = found.beside.judge(decision, ground.noise)
        decision = _completed(decision, ground, found, (before, after), course.seed)
    if ground.aside:
        decision = replace(decision, reason=f"{decision.reason}; {ground.aside}")
    return decision, (before, after)


def _described(
    ground: Ground, course: Course, found: Found, decision: Decision, errors: tuple[float, float]
) -> tuple[Diagnosis, Final]:
    """The diagnosis as it is written, and the model that it describes; ``errors`` are those of :func:`_decided`."""
    state, (before, after) = found.state, errors
    baseline, prediction = ground.baseline, state.plain.prediction
    problem, fit, seed = baseline.problem, baseline.fit, course.seed
    course.say("locating the error")
    radius = [float(s["bellows_radius"]) for s in fit.model.core["section"]]
    where = locate(problem, baseline.noise, fit.outputs, fit.residual, seed, radius)
    course.say("intervals and report")
    best, closure = state.best if decision.verdict == "named" else state.plain, decision.closure
    final, is_told = _known(problem, best, found.signatures, seed, closure)
    if not is_told:
        decision = untold(decision, final.trial.label)
        final, _ = _known(problem, state.plain, found.signatures, seed, closure)
    faults = ground.plain.faults
    verdict = without_faults(decision, faults)
    diagnosis = describe(
        baseline,
        state.plain.holdout,
        state,
        found.signatures,
        found.gap,
        verdict,
        where,
        final.trial,
        final.uncertainty,
        final.draws,
        (ground.noise, before, after if verdict.verdict == "named" else before),
        seed,
        (ground.train, ground.held),
        lambda trial: rms_errors(prediction, trial.prediction)[1],
        course.tolerance,
    )
    lag = next((effect for effect in diagnosis.of_commands if effect.kind == "pressure_lag"), None)
    first = ground.first.prediction
    diagnosis = with_finding(diagnosis, unlike(problem, fit, ground.holdout, first, lag, ground.noise))
    diagnosis = with_memory(diagnosis, remembered(problem, fit, ground.holdout, first, ground.noise, course.limits))
    update = {
        "setup": [*(fault.in_a_line() for fault in faults), *ground.plain.said, *diagnosis.setup],
        "disturbed": found.gap.significant and verdict.verdict == "equivalent",
        "unexamined": state.unexamined,
        "complete": state.complete,
        "seconds": round(course.seconds, 3),
    }
    return diagnosis.model_copy(update=update), final


def _beside(left: Unlogged | None, rules: Rules) -> Rules:
    """The rules of a search: beside a disturbance one effect at most shows."""
    return replace(rules, most=1) if left is not None and left.is_a_disturbance else rules


def _compared(state: Search, plain: float) -> tuple[float, float]:
    """Errors of the plain model and of the best set on the held-out logs, m RMS, over the same blocks.

    ``plain`` is that of the plain model alone. A set that runs away before anything is compared is refuted.
    """
    best, prediction = state.best, state.plain.prediction
    if not best.candidates or not np.isfinite(prediction.mean_square):
        return plain, plain
    before, after = rms_errors(prediction, best.prediction)
    if np.isfinite(before) and np.isfinite(after):
        return before, after
    state.notes.append(f"dropped: {best.label} (the model with it runs away on the held-out logs)")
    state.best = state.plain
    return plain, plain


def _known(problem: Problem, trial: Trial, signatures: Signatures, seed: int, closure: float) -> tuple[Final, bool]:
    """A set with its sensitivities, draws of what the logs leave open of it and its intervals, and whether there is
    some of what it names (:func:`bha.diagnosis.intervals.is_there`)."""
    if not trial.candidates:
        draws = coordinate_draws(problem, trial.fit, seed)
        return Final(trial, draws, intervals(trial.fit, draws)), True
    trial = replace(trial, fit=with_sensitivities(problem, trial.fit))
    form = form_deviation(problem, trial.fit, signatures, seed)
    draws = coordinate_draws(problem, trial.fit, seed, form)
    return Final(trial, draws, intervals(trial.fit, draws)), is_there(problem, trial, form, seed, closure=closure)


def _completed(decision: Decision, ground: Ground, found: Found, errors: tuple[float, float], seed: int) -> Decision:
    """The decision where effects explain a part of a gap: what they leave is asked whether it follows something.

    What does is the effect's form, if it is named, and the search is marked as inexact.
    """
    problem, state = ground.baseline.problem, found.state
    best, named = state.best, decision.verdict == "named"
    exact = best.fit.squares / problem.rows < NOISE_LEFT
    if decision.verdict not in ("named", "unexplained") or (named and exact):
        return decision
    # Of several each has to be there for itself: what is left tells of the form of all of them together.
    several = len(set(best.key)) > 1
    if not best.candidates or best.fit.jacobian is None or (several and (named or state.doubtful)):
        return decision
    screening = score(problem, best.fit, found.signatures)
    left = unlogged(problem, best.fit, state.plain.holdout, best.prediction, screening, seed)
    if left is None:
        return decision
    state.inexact = named and left.follows_something
    return decision if state.second else left.complete(decision, *errors)
