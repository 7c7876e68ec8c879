"""``bha diagnose``: where an arm and its model disagree, and what the model lacks."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from bha.arm import Arm
from bha.cli.common import (
    INTERRUPTED,
    arm_argument,
    json_option,
    print_json,
    progress_bar,
    reports_errors,
    say,
)
from bha.cli.logs import columns_option, missing_option, pressures_option, read_logs, repair_option
from bha.diagnosis import diagnose as run
from bha.diagnosis.result import Diagnosis, Number
from bha.diagnosis.words import (
    VERDICTS,
    alike_in_words,
    commands_in_words,
    errors_in_words,
    experiment_in_words,
    headline,
    leads,
)
from bha.recordings import PressureSort


@click.command()
@arm_argument
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--holdout", metavar="LOG", multiple=True, type=click.Path(path_type=Path),
              help="A log that takes no part in any fit; may be repeated. "
                   "The last third of the logs if left out.")  # fmt: skip
@click.option("--out", metavar="DIR", required=True, type=click.Path(path_type=Path, file_okay=False),
              help="Folder for diagnosis.json, arm_diagnosed.toml and report.html.")  # fmt: skip
@pressures_option
@missing_option
@columns_option
@repair_option
@click.option("--tolerance", type=click.FloatRange(min=0.0), default=0.0, metavar="MM",
              help="What does not matter: errors that exceed noise by less are no gap [mm RMS].")  # fmt: skip
@click.option("--limit", type=click.FloatRange(min=0.0, min_open=True), metavar="SECONDS",
              help="Time after which the search ends with what it has settled, and says what it left.")  # fmt: skip
@click.option("--no-report", is_flag=True, help="Write no report.html.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of all that is drawn at random.")
@click.option("--threads", type=click.IntRange(min=1), help="Number of threads; all cores if left out.")
@json_option
@reports_errors
def diagnose(
    arm: Arm,
    logs: tuple[Path, ...],
    holdout: tuple[Path, ...],
    out: Path,
    pressures: PressureSort | None,
    missing: bool,
    mapping: Path | None,
    repair: bool,
    tolerance: float,
    limit: float | None,
    no_report: bool,
    seed: int,
    threads: int | None,
    as_json: bool,
) -> None:
    """Find where ARM (a parameter file or a shipped arm) and its LOGs disagree, and name what the model lacks.

    After Ctrl-C what was found so far is written; the exit code is then 130.
    """
    with progress_bar(hidden=as_json) as bar:
        task = bar.add_task("reading", total=None)
        read = read_logs(arm, [*logs, *holdout], pressures, missing, mapping)

        def tell(stage: str, share: float | None) -> None:
            bar.update(task, description=stage, total=None if share is None else 1.0, completed=share or 0.0)

        found = run(
            arm,
            read[: len(logs)],
            read[len(logs) :],
            out=out,
            repair=repair,
            tolerance=1e-3 * tolerance,
            limit=limit,
            report=not no_report,
            seed=seed,
            threads=threads,
            progress=tell,
            command=shlex.join(["bha", *sys.argv[1:]]),
        )
    if as_json:
        print_json(found.model_dump(mode="json", by_alias=True))
    else:
        _print(found, out)
    if not found.complete and not found.unexamined:
        raise SystemExit(INTERRUPTED)


def _print(found: Diagnosis, out: Path) -> None:
    """The diagnosis in some ten lines; the report has the rest."""
    if found.unexamined:
        say(f"Out of time before: {found.unexamined}. The same command goes on. So far:")
    elif not found.complete:
        say("Interrupted: the search is not complete; the same command goes on. So far:")
    if leads(found):
        say(f": {found.reason}", head=headline(found))
    else:
        say(f": {headline(found)}" if found.missing else f": {found.reason}", head=VERDICTS[found.verdict])
        for text in () if found.missing else commands_in_words(found):
            say(text)
    say(errors_in_words(found.gap, named=found.has_names))
    for text in found.setup:
        say(text)
    for effect in found.effects:
        numbers = ", ".join(_number(name, n) for name, n in effect.parameters.items())
        empirical = "; an empirical term, no cause" if effect.empirical else ""
        told = f": {numbers}" if numbers else ""
        kinds = f"{effect.kind} or damping" if effect.slow and effect.kind == "pressure_lag" else effect.kind
        say(f"{kinds} at {effect.where}{told}; confidence {effect.confidence:.2f}{empirical}")
        if alike := alike_in_words(effect):
            say(f"  {alike}")
    if found.residual_force is not None:
        say(found.residual_force.reason, head="force: ")
    if found.next_experiment is not None:
        say(experiment_in_words(found.next_experiment), head="next: ")
    if found.missing:
        say(found.reason)
    elif found.candidates:
        best = ", ".join(f"{c.kind} at {c.where}" for c in found.candidates[:3])
        say(f"nearest candidates: {best}")
    say(f"Written to {out}")


def _number(name: str, number: Number) -> str:
    unit = f" {number.unit}" if number.unit else ""
    interval = "" if number.ci95 is None else f" ({number.ci95[0]:.4g} to {number.ci95[1]:.4g})"
    return f"{name} {number.value:.4g}{interval}{unit}"
