"""Find where simulation and measurement disagree, name the missing effect, add it, show the gap shrink.

``bha.diagnose(arm, logs, holdout=...)`` runs the workflow; ``docs/diagnosis.md`` explains it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bha.errors import InputError
from bha.extras import import_extra

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.diagnose.result import Diagnosis
    from bha.log import Log


def diagnose(
    arm: Arm,
    logs: Sequence[Log],
    holdout: Sequence[Log] = (),
    *,
    out: str | os.PathLike[str] | None = None,
    commanded: bool = False,
    kinds: Sequence[str] | None = None,
    report: bool = True,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[str, float | None], None] | None = None,
) -> Diagnosis:
    """Diagnose what the model of an arm lacks, from logs of the real one.

    The plain model is re-identified first; then its error on held-out logs is tested against noise, all effects of the
    registry are screened in all places, the promising ones are refitted together with the plain parameters, and those
    that earn their place on the held-out logs are named. See ``docs/diagnosis.md``.

    Args:
        arm: the arm as its parameter file says; its identifiable values may be off by some 15 %.
        logs: training logs with pressures and bellows lengths or head positions, all with the same outputs.
        holdout: logs that take no part in any fit; if empty, the last third of ``logs`` (of the only log's time).
        out: folder for ``diagnosis.json``, ``arm_diagnosed.toml`` and ``report.html``; nothing is written if None.
        commanded: take the commanded pressures (``pc..``) as what acts.
        kinds: kinds of effects that are candidates; all of the registry if None.
        report: write ``report.html`` too (extra ``report``).
        seed: of all that is drawn at random.
        threads: how many threads; as many as there are cores if None.
        progress: called with the stage and the share of it that is done, None where that is not known.

    Returns:
        The diagnosis, see :class:`bha.diagnose.result.Diagnosis`. After Ctrl-C in the search what was found so far,
        with ``complete`` false.

    Raises:
        InputError: no logs, logs without outputs or with different ones.
        LogError: a log lacks a pressure of the arm.
        ConvergenceError: the arm diverges under these logs.
        MissingExtraError: SciPy, or Plotly for the report, is not installed.
    """
    import_extra("scipy", extra="identify", purpose="Diagnosis")
    folder = None if out is None else Path(out)
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be a folder for results: {error.strerror or error}") from error
        if report:
            import_extra("plotly", extra="report", purpose="The report of a diagnosis")
    from bha.diagnose import workflow, written  # noqa: PLC0415  (SciPy is an extra)

    outcome = workflow.run(
        arm,
        logs,
        holdout,
        commanded=commanded,
        kinds=kinds,
        seed=seed,
        threads=threads,
        progress=progress,
        cache_folder=None if folder is None else folder / ".cache",
    )
    if folder is not None:
        diagnosed = written.diagnosed_arm(arm, outcome, logs)
        diagnosed.save(folder / "arm_diagnosed.toml")
        if report:
            from bha.diagnose.report import write_report  # noqa: PLC0415  (Plotly is an extra)

            write_report(outcome, arm, folder / "report.html")
        outcome.diagnosis.write(folder / "diagnosis.json")
    return outcome.diagnosis
