"""Find where simulation and measurement disagree, name the missing effect, add it, show the gap shrink.

``bha.diagnose(arm, logs, holdout=...)`` checks the logs, runs the workflow and writes what it found;
``docs/guides/diagnosis.md`` explains it. ``run`` is the workflow alone, for those who want the models behind a
``Diagnosis`` too (an ``Investigation``; each ``Trial`` in it is a fit with its prediction of held-out logs) or other
``Rules``.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING

from bha.checkup import checked
from bha.errors import InputError
from bha.support.extras import import_extra
from bha.support.files import make_folder
from bha.support.later import imported_later

if TYPE_CHECKING:
    from pathlib import Path

    from bha.arm import Arm
    from bha.checkup import Checkup
    from bha.diagnosis.force_summary import Unexplained
    from bha.diagnosis.force_table import ResidualTable
    from bha.diagnosis.refit import Trial
    from bha.diagnosis.result import Diagnosis, Made
    from bha.diagnosis.rules import Rules
    from bha.diagnosis.standing import Standing
    from bha.diagnosis.words import headline
    from bha.diagnosis.workflow import Investigation, run
    from bha.logs import Log
    from bha.recordings import PressureSort, Recording

__all__ = ["Diagnosis", "Investigation", "ResidualTable", "Rules", "Trial", "diagnose", "headline", "run"]

#: Name -> its module: imported when first asked for, since SciPy is an extra.
_LATER = {
    "Diagnosis": "bha.diagnosis.result",
    "Investigation": "bha.diagnosis.workflow",
    "ResidualTable": "bha.diagnosis.force_table",
    "Rules": "bha.diagnosis.rules",
    "Trial": "bha.diagnosis.refit",
    "headline": "bha.diagnosis.words",
    "run": "bha.diagnosis.workflow",
}


if not TYPE_CHECKING:  # a checker knows all names, and that there are no others
    __getattr__ = imported_later(globals(), _LATER)


def diagnose(
    arm: Arm,
    logs: Sequence[Log | Recording],
    holdout: Sequence[Log | Recording] = (),
    *,
    out: str | os.PathLike[str] | None = None,
    pressures: PressureSort | None = None,
    repair: bool = False,
    kinds: Sequence[str] | None = None,
    tolerance: float = 0.0,
    limit: float | None = None,
    report: bool = True,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[str, float | None], None] | None = None,
    command: str = "bha.diagnose",
) -> Diagnosis:
    """Diagnose what the model of an arm lacks, from logs of the real one.

    The plain model is re-identified first; then its error on held-out logs is tested against noise, all effects of the
    registry are screened in all places, the promising ones are refitted together with the plain parameters, and those
    that earn their place on the held-out logs are named. See ``docs/guides/diagnosis.md``.

    Args:
        arm: the arm as its parameter file says; its identifiable values may be off by some 15 %.
        logs: training logs, or recordings of them, with pressures and lengths or head positions, all with the same
            outputs.
        holdout: logs that take no part in any fit; if empty, the last third of ``logs`` (of the only log's time).
        out: folder for ``diagnosis.json``, ``arm_diagnosed.toml`` and ``report.html``; nothing is written if None.
        pressures: which pressures of the logs drive the arm, ``"measured"`` or ``"commanded"``; if None measured ones
            where the first log has them.
        repair: mend first what ``bha.check`` calls a fault and a machine can mend (tubes exchanged, azimuth, camera,
            gauge, units, gravity's sign), in memory, and diagnose what is left; what was mended stands in ``setup``.
        kinds: kinds of effects that are candidates; all of the registry if None.
        tolerance: what does not matter, m RMS: errors on held-out logs that exceed noise by less are no gap
            (``equivalent``), whatever causes them. With 0 the least gap that is worth a name is 1.1 times the noise.
        limit: time after which the search for effects ends with what it has settled, s; what was not examined is said,
            and the same call into the same folder goes on. The refit under way comes to its end. None for none: then
            what comes out does not depend on how busy the machine is.
        report: write ``report.html`` too (extra ``report``).
        seed: of all that is drawn at random.
        threads: how many threads; as many as there are cores if None.
        progress: called with the stage and the share of it that is done, None where that is not known.
        command: what the result calls the command that made it.

    Returns:
        The diagnosis, see :class:`bha.diagnosis.Diagnosis`. After Ctrl-C in the search what was found so far,
        with ``complete`` false.

    Raises:
        InputError: no logs, a tolerance that is none, an unknown kind, logs without outputs or with different ones;
            another diagnosis is at work in ``out``, or a file of the results' names there is none of a diagnosis.
        FileError: a file cannot be written.
        LogError: a log lacks a pressure of the arm.
        ConvergenceError: the arm diverges under these logs.
        MissingExtraError: SciPy, or Plotly for the report, is not installed.
    """
    import_extra("scipy", extra="identify", purpose="Diagnosis")
    if out is not None and report:
        import_extra("plotly", extra="report", purpose="The report of a diagnosis")
    folder = None if out is None else make_folder(out)
    from bha.diagnosis import catalogue, force_summary, slowness, standing, workflow, written  # noqa: PLC0415  (SciPy is an extra)
    from bha.diagnosis.cache import cache_folder  # noqa: PLC0415
    from bha.diagnosis.splitting import split  # noqa: PLC0415

    if not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise InputError(f"tolerance: found {tolerance}; allowed: a finite number >= 0 (m)")
    if limit is not None and not limit > 0.0:
        raise InputError(f"limit: found {limit}; allowed: a number > 0 (s), or None")
    if not logs:
        raise InputError("logs: none; at least one is needed")
    catalogue.available(kinds)
    checkup = checked(arm, [*logs, *holdout], pressures=pressures, repair=repair)
    arm = checkup.arm
    train, held = checkup.recordings[: len(logs)], checkup.recordings[len(logs) :]
    # Held until all is written: two diagnoses into one folder would mix their results.
    with nullcontext() if folder is None else cache_folder(folder) as kept:
        if folder is not None:
            written.check_results(folder, report=report)
        if (still := standing.standing(train, held)) is not None:
            return _of_still_logs(
                checkup, still, written.made_by(command, seed, train, held), folder, tolerance, report
            )
        outcome = workflow.run(
            train,
            held,
            kinds=kinds,
            seed=seed,
            threads=threads,
            progress=progress,
            cache_folder=kept,
            faults=checkup.faults,
            doubts=checkup.doubts,
            tolerance=tolerance,
            limit=limit,
        )
        made = written.made_by(command, seed, train, held)
        diagnosed = written.diagnosed_arm(outcome.arm, outcome, [recording.log for recording in train])
        if train[0].pressures.sort == "commanded":
            told = slowness.lag_or_damping(outcome.diagnosis, diagnosed, outcome.baseline.problem.records)
            outcome = replace(outcome, diagnosis=told)
        setup = [*checkup.repairs, *outcome.diagnosis.setup]
        say = progress or (lambda text, share: None)
        say("looking for pressures that tell more", None)
        observation = outcome.holdout.problem.records[0].observation
        proposal = split(diagnosed, outcome.diagnosis, observation, seed, outcome.model.integration)
        experiment = None if proposal is None else written.experiment_of(proposal, folder)
        update = {"made": made, "setup": setup, "next_experiment": experiment}
        force: Unexplained | None = None
        if outcome.diagnosis.verdict == "unexplained" or outcome.diagnosis.disturbed:
            say("estimating the residual force", None)
            force = force_summary.unexplained(outcome, diagnosed)
            if folder is not None:
                force = force_summary.write_force(force, folder)
            update["residual_force"] = force.found
        outcome = replace(outcome, diagnosis=outcome.diagnosis.model_copy(update=update))
        if folder is not None:
            page = None
            if report:
                from bha.diagnosis.report import report_html  # noqa: PLC0415  (Plotly is an extra)

                page = report_html(outcome, diagnosed, force)
            written.write_results(folder, outcome.diagnosis, diagnosed, page)
    return outcome.diagnosis


def _of_still_logs(
    checkup: Checkup, still: Standing, made: Made, folder: Path | None, tolerance: float, report: bool
) -> Diagnosis:
    """The diagnosis of logs in which nothing moves, written where there is a folder."""
    from bha.diagnosis import standing, written  # noqa: PLC0415  (SciPy is an extra)

    found = standing.diagnosis(checkup.arm, still, checkup.faults, tolerance)
    found = found.model_copy(update={"made": made, "setup": [*checkup.repairs, *found.setup]})
    if folder is not None:
        page = None
        if report:
            from bha.diagnosis.report import standing_html  # noqa: PLC0415  (Plotly is an extra)

            page = standing_html(found, checkup.arm)
        written.write_results(folder, found, checkup.arm, page)
    return found
