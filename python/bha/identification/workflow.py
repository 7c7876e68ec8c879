"""From logs to a parameter file: the whole of identification in one call."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from bha.arm import Arm
from bha.checkup import checked
from bha.errors import InputError
from bha.estimation.free import FreeParameter, camera_free, default_free
from bha.estimation.records import Record, record
from bha.estimation.refinement import Settings, refine
from bha.identification.result import Identification, identification
from bha.logs import Log
from bha.parameters import paths
from bha.recordings import Output, PressureSort, Recording


def identify(
    arm: Arm,
    logs: Sequence[Log | Recording | Record],
    free: Iterable[FreeParameter | str] | None = None,
    *,
    holdout: Sequence[Log | Recording | Record] = (),
    pressures: PressureSort | None = None,
    settings: Settings | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Identification:
    """Identify parameters of an arm from measured logs.

    Args:
        arm: where to start from; what is not free stays as it is.
        logs: logs to fit, or recordings or records of them, with pressures and lengths or heads.
        free: what to estimate, as paths (``bha.parameters.paths``) or free parameters with bounds and priors; if None
            mass, stiffness, bending stiffness and damping of each section, and the camera's frame where all logs have
            all three coordinates of some head.
        holdout: logs that take no part in the fit and are predicted before and after it.
        pressures: which pressures of the logs drive the arm, ``"measured"`` or ``"commanded"``; if None measured ones
            where the first log has them.
        settings: how to fit.
        progress: called with what is being done and the fraction done (a guess).

    Returns:
        Estimates with intervals, what the data do not tell, what is left, held-out errors, warnings. A fit that did not
        converge is returned too, with ``converged`` false.

    Raises:
        InputError: no log, a log twice, or arguments that do not fit together.
        LogError: a log lacks a pressure of the arm.
        ParameterError: a path the arm does not have.
        ConvergenceError: the simulation fails with the starting values.
    """
    if not logs:
        raise InputError("there is no log to identify from; give at least one")
    records = [item if isinstance(item, Record) else None for item in (*logs, *holdout)]
    others = [item for item in (*logs, *holdout) if not isinstance(item, Record)]
    checkup = checked(arm, others, pressures=pressures) if others else None
    made = iter([record(arm, item) for item in checkup.recordings] if checkup else [])
    every = [next(made) if rec is None else rec for rec in records]
    used, held = every[: len(logs)], every[len(logs) :]
    _check_once(used, held)
    if free is None:
        free = [*default_free(arm.parameters)]
        if all(_sees_a_head(rec.observation.outputs) for rec in used):
            free += camera_free(arm.parameters)
    fit = refine(arm, used, free, settings, progress=progress)
    return identification(arm, fit, held)


def _sees_a_head(outputs: Sequence[Output]) -> bool:
    """Whether all three coordinates of some head are measured."""
    sections = [output.section for output in outputs if output.kind == "position"]
    return any(sections.count(section) == len(paths.AXES) for section in sections)


def _check_once(used: Sequence[Record], held: Sequence[Record]) -> None:
    """A log that counts twice makes intervals too narrow; one that is fitted is no test."""
    seen: dict[str, str] = {}
    for rec, place in [*((r, "fitted") for r in used), *((r, "held out") for r in held)]:
        if rec.sha256 is None:
            continue
        if rec.sha256 in seen:
            text = f"{rec.name}: the same log is {seen[rec.sha256]} already"
            raise InputError(f"{text}, and {place} again; name every log once")
        seen[rec.sha256] = place
