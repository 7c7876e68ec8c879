"""``bha diagnose``: where an arm and its model disagree, and what the model lacks."""

from __future__ import annotations

from pathlib import Path

import click

from bha.arm import Arm
from bha.cli.common import (
    INTERRUPTED,
    arm_argument,
    console,
    json_option,
    print_json,
    progress_bar,
    reports_errors,
    say,
    table,
)
from bha.cli.logs import missing_option, pressures_option, read_logs
from bha.diagnosis import diagnose as run
from bha.diagnosis.result import Diagnosis
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
        read = read_logs(arm, [*logs, *holdout], pressures, missing)

        def tell(stage: str, share: float | None) -> None:
            bar.update(task, description=stage, total=None if share is None else 1.0, completed=share or 0.0)

        found = run(
            arm,
            read[: len(logs)],
            read[len(logs) :],
            out=out,
            report=not no_report,
            seed=seed,
            threads=threads,
            progress=tell,
        )
    if as_json:
        print_json(found.model_dump(mode="json", by_alias=True))
    else:
        _print(found, out)
    if not found.complete:
        raise SystemExit(INTERRUPTED)


def _print(found: Diagnosis, out: Path) -> None:
    verdict = {
        "named": "A missing effect is named",
        "no_gap": "No significant gap",
        "unknown": "A gap that no known effect explains",
    }
    if not found.complete:
        say("Interrupted: the search is not complete; the same command goes on. So far:")
    say(f": {found.reason}", head=verdict[found.verdict])
    gap = found.gap
    say(
        f"open-loop error on {', '.join(gap.holdout)}: {1e3 * gap.before:.3g} mm before, "
        f"{1e3 * gap.after:.3g} mm after, noise {1e3 * gap.noise:.3g} mm"
    )
    for text in found.setup:
        say(text)
    for effect in found.effects:
        numbers = table("Number", "Value", "95 % interval", "Unit", title=f"{effect.kind} at {effect.where}")
        for name, number in effect.parameters.items():
            interval = "" if number.ci95 is None else f"{number.ci95[0]:.4g} to {number.ci95[1]:.4g}"
            numbers.add_row(name, f"{number.value:.4g}", interval, number.unit)
        console().print(numbers)
        say(f"confidence {effect.confidence:.2f}" + (", empirical term" if effect.empirical else ""))
        if effect.confusable_with:
            say("these data cannot tell it from: " + ", ".join(effect.confusable_with[:6]))
    if found.candidates and found.verdict != "named":
        best = ", ".join(f"{c.kind} at {c.where}" for c in found.candidates[:3])
        say(f"nearest candidates: {best}")
    say(f"Written to {out}")
