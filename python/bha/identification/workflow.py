"""From logs to a parameter file: the whole of identification in one call."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from bha.arm import Arm
from bha.errors import BhaError, InputError
from bha.estimation.apart import mean_pressures
from bha.estimation.begin import Begin, begin
from bha.estimation.defaults import by_default
from bha.estimation.free import FreeParameter
from bha.estimation.lags import PATHS as LAG_PATHS
from bha.estimation.lags import CommonTime, common_times
from bha.estimation.records import Record
from bha.estimation.refinement import refine, remembers
from bha.estimation.scale import scale_of
from bha.estimation.settings import Settings, of_an_arm_that_creeps
from bha.estimation.strays import in_words
from bha.identification.arranged import arranged, by_session
from bha.identification.result import GAP, Identification, identification
from bha.identification.words import joined
from bha.logs import Log
from bha.recordings import PressureSort, Recording

#: Most steps of each stage of a fit that begins a second time, from the file's values.
_FEW_STEPS = 12
#: Part of the progress that finding a start is.
_BEGIN_SHARE = 0.2


def identify(
    arm: Arm,
    logs: Sequence[Log | Recording | Record],
    free: Iterable[FreeParameter | str] | None = None,
    *,
    holdout: Sequence[Log | Recording | Record] = (),
    changes: Mapping[str, Mapping[str, float]] | None = None,
    sessions: Mapping[str, Sequence[str]] | None = None,
    per_session: Iterable[FreeParameter | str] = (),
    pressures: PressureSort | None = None,
    repair: bool = False,
    settings: Settings | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Identification:
    """Identify parameters of an arm from measured logs.

    Args:
        arm: where to start from; what is not free stays as it is.
        logs: logs to fit, or recordings or records of them, with pressures and lengths or heads.
        free: what to estimate, as paths (``bha.parameters.paths``) or free parameters with bounds and priors; if None
            mass, stiffness, bending stiffness and damping of each section and what else the logs ask for
            (:func:`bha.estimation.defaults.by_default`): the camera's frame where all logs have all three
            coordinates of some head, areas and rest lengths where heads are all that is seen, lags of commands.
        holdout: logs that take no part in the fit and are predicted before and after it.
        changes: what is known to have been otherwise of the arm in some logs: name of the log (its file's) -> path ->
            number, ``{"heavy.csv": {"section.1.payload": 0.2}}``; see :mod:`bha.estimation.conditions`. Records
            may bring theirs.
        sessions: name of a session -> names of its logs.
        per_session: which parameters are estimated once a session; all others are shared.
        pressures: which pressures of the logs drive the arm, ``"measured"`` or ``"commanded"``; if None measured ones
            where the first log has them.
        repair: mend first what ``bha.check`` calls a fault and a machine can mend (tubes exchanged, azimuth, camera,
            gauge, units, gravity's sign), in memory; what was mended stands in the notes.
        settings: how to fit.
        progress: called with what is being done, with the time that is left once steps have told the pace, and the
            fraction done.

    Returns:
        Estimates with intervals, what the data do not tell, what is left, held-out errors, warnings. A fit that did not
        converge is returned too, with ``converged`` false.

    Raises:
        InputError: no log, a log twice, a number that is free and known, or arguments that do not fit together.
        LogError: a log lacks a pressure of the arm.
        ParameterError: a path the arm does not have.
        ConvergenceError: the simulation fails with the starting values.
        KeyboardInterrupt: Ctrl-C before the first step of the fit has ended. Later it ends the fit, and what was
            reached is returned: ``interrupted``, without standard errors, held-out logs left aside.
    """
    if not logs:
        raise InputError("there is no log to identify from; give at least one")
    found = arranged(arm, logs, holdout, sessions=sessions, changes=changes, pressures=pressures, repair=repair)
    arm, used, held = found.arm, found.used, found.held
    lagging, splits = arm, free is None
    if free is None:
        lagging, free = by_default(arm, used)
    free = by_session(free, per_session, used, held)
    settings = stated = settings or Settings()

    def rest(text: str, done: float) -> None:
        assert progress is not None
        progress(text, _BEGIN_SHARE + (1.0 - _BEGIN_SHARE) * done)

    start = begin(
        lagging,
        used,
        free,
        whole=remembers(lagging, used),
        splits=splits,
        threads=settings.threads,
        tell=None if progress is None else lambda text, done: progress(text, _BEGIN_SHARE * done),
    )
    if settings.windows is None and start.creeps:
        settings = of_an_arm_that_creeps(settings)
    elif settings.windows is None and start.skips_short_windows:
        settings = replace(settings, windows=(None,) if remembers(lagging, used) else (6.0,))
    fit = refine(start.arm, used, start.free, settings, progress=None if progress is None else rest)
    result = identification(arm, fit, held)
    commanded = any(rec.drive.commanded for rec in used)
    if commanded and not (start.from_file or start.creeps or fit.outcome.interrupted) and result.gap > GAP:
        tell = None if progress is None else lambda text, _done: progress(f"from the file's values: {text}", 1.0)
        other = _from_the_file(arm, lagging, used, free, stated, held, tell)
        if other is not None and other.gap < result.gap:
            start, result, fit = replace(start, arm=lagging, free=free, from_file=True), other, other.refinement
    times = common_times(fit.arm, mean_pressures(used), _lag_error(result)) if commanded else ()
    seen = [*fit.problem.model.records, *(one.after.record for one in result.held_out)]
    strays = filter(None, map(in_words, [*used, *held], seen))
    notes = (*found.faults, *found.repairs, *_notes(start, result, used), *strays, *map(_of_time, times))
    return replace(result, notes=notes, common_times=times)


def _from_the_file(
    arm: Arm,
    lagging: Arm,
    used: Sequence[Record],
    free: Iterable[FreeParameter | str],
    settings: Settings,
    held: Sequence[Record],
    progress: Callable[[str, float], None] | None,
) -> Identification | None:
    """The same from the values of the file, which under commands may lie in the right valley of lag and damping.

    Held poses take what an arm does behind its commands for a lag, be it that of the pressures or a swing: with the
    scale of a light arm they lead where its damping stands for the pressures' lag. None where it comes to nothing.
    """
    # In the right valley it is at the bottom soon; in the same one as before nothing is gained by going on.
    few = replace(settings, max_iterations=min(_FEW_STEPS, settings.max_iterations))
    try:
        fit = refine(lagging, used, free, few, progress=progress)
    except (BhaError, KeyboardInterrupt):
        return None
    return None if fit.outcome.interrupted else identification(arm, fit, held)


def _notes(start: Begin, found: Identification, used: Sequence[Record]) -> list[str]:
    """What the values rest on."""
    known = [f"{rec.name} with {rec.condition.in_words()}" for rec in used if rec.changes]
    scale = [e for e in found.estimates if e.path.endswith((".terminal_area", ".mass"))]
    areas = any(e.path.endswith(".terminal_area") for e in scale)
    if known and areas and all(e.identified for e in scale):
        notes = ["the scale of forces is told by what is known to differ between the logs"]
    else:
        notes = [scale_of(start.arm.parameters, start.free)]
    if known:
        notes.append(f"known to be otherwise: {'; '.join(known)}; what is written is the arm without these changes")
    if found.sessions:
        apart = ", ".join(dict.fromkeys(c.path for c in found.refinement.coordinates if c.sessions))
        notes.append(f"estimated session by session ({', '.join(found.sessions)}): {apart}; all else is shared")
    if not start.from_file:
        notes.append("the fit began at what held poses and a search over dampings say, not at the file's values")
    notes += start.said
    effects = start.arm.parameters.effects
    numbered = sorted({int(e.path.split(".")[1]) for e in found.estimates if e.path.startswith("effect.")})
    if numbered:
        notes.append(joined([f"effect.{n} is {effects[n - 1].kind} ({effects[n - 1].where})" for n in numbered]))
    added = effects[len(found.start.parameters.effects) :]
    if any(effect.kind == "bending_damping" for effect in added):
        notes.append("bending lags longer than stretching: a damping of bending (effect bending_damping) was added")
    if start.arm.parameters.force_model != found.start.parameters.force_model:
        notes.append(f"the force model is {start.arm.parameters.force_model}: forces are what pressures do in work")
    stiff = [k for k, s in enumerate(start.arm.parameters.sections, start=1) if s.axial_stiffness is not None]
    if any(found.start.parameters.sections[k - 1].axial_stiffness is None for k in stiff):
        notes.append(
            "bends more easily than its springs allow: an axial stiffness took the place of the bending stiffness "
            f"(section {joined(list(map(str, stiff)))}; force model {start.arm.parameters.force_model})"
        )
    return notes


def _lag_error(found: Identification) -> float:
    """Standard error of the lag of commanded pressures, in itself; infinite where it is not estimated or not told."""
    lags = [e for e in found.estimates if e.path in LAG_PATHS]
    return max((e.standard_error / e.value if e.identified else math.inf for e in lags), default=math.inf)


def _of_time(time: CommonTime) -> str:
    """Lag and damping as one class; the lag alone where the fit tells it."""
    return (
        f"section {time.section} follows commands through the lag of its pressures and its own damping, together "
        f"{time.across:.2g} s across its axis and {time.along:.2g} s along it; the lag alone is "
        + (f"{time.lag:.2g} s if the model's form is right" if time.told else "not told")
    )
