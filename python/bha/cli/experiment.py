"""``bha experiment``: the paper's experiments on the virtual arm."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

import click
from rich.text import Text

from bha.cli.common import console, json_option, print_json, progress_bar, reports_errors, say, table
from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Outcome
from bha.support.files import make_folder

#: Name -> (module of this package, function), in the order of the document.
EXPERIMENTS = {
    "table2": ("table2", "run"),
    "fig8": ("fig8", "run"),
    "fig9": ("fig9", "run"),
    "fig10": ("fig10", "run"),
    "fig11": ("fig11", "run"),
    "fig12": ("tilts", "fig12"),
    "fig13": ("tilts", "fig13"),
    "fig14": ("fig14", "run"),
    "table3": ("table3", "run"),
    "end_force_drift": ("end_force_drift", "run"),
}


def function(name: str) -> Callable[[Laboratory], Outcome]:
    """The function that runs an experiment."""
    module, attribute = EXPERIMENTS[name]
    found: Callable[[Laboratory], Outcome] = getattr(importlib.import_module(f"bha.experiments.{module}"), attribute)
    return found


@click.command()
@click.argument("name", type=click.Choice([*EXPERIMENTS, "all"]))
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("out"), show_default=True,
              help="Folder: figures/ and, for all, experiments.md.")  # fmt: skip
@click.option("--seed", type=click.IntRange(min=0), default=2015, show_default=True,
              help="Of the virtual arm's scatter and its sensors' noise.")  # fmt: skip
@json_option
@reports_errors
def experiment(name: str, out: Path, seed: int, as_json: bool) -> None:
    """Measure on a virtual arm, follow the paper's procedure, and set its claim beside the numbers found.

    The claims are printed; figures go to OUT/figures. With "all" the whole document is written, OUT/experiments.md.
    """
    from bha.experiments.document import write_document, write_figures  # noqa: PLC0415  (matplotlib, loaded when needed)

    wanted = list(EXPERIMENTS) if name == "all" else [name]
    outcomes = []
    make_folder(out)  # before the work, lest it be lost
    with progress_bar(hidden=as_json) as bar:
        task = bar.add_task("starting", total=float(len(wanted)))
        laboratory = Laboratory(seed=seed, note=lambda text: bar.update(task, description=text))
        for each in wanted:
            bar.update(task, description=each)
            outcomes.append(function(each)(laboratory))
            bar.advance(task)
    if name == "all":
        written = [write_document(outcomes, out, laboratory.real.body, laboratory.real.sensors)]
    else:
        written = write_figures(outcomes[0], out / "figures")
    if as_json:
        print_json({outcome.name: as_mapping(outcome) for outcome in outcomes} | {"written": written})
        return
    report(outcomes, written)


def as_mapping(outcome: Outcome) -> dict[str, object]:
    """An outcome for machines."""
    claims = [{"claim": c.paper, "found": c.ours, "holds": c.holds} for c in outcome.claims]
    return {"claims": claims, "numbers": dict(outcome.numbers)}


def report(outcomes: list[Outcome], written: list[Path]) -> None:
    """Print claims and tables."""
    terminal = console()
    for outcome in outcomes:
        claims = table("Claim", "Here", "Holds", title=outcome.title, running=("Claim", "Here"))
        for claim in outcome.claims:
            claims.add_row(claim.paper, claim.ours, "yes" if claim.holds else "no")
        terminal.print(claims)
        for numbers in outcome.tables:
            shown = table(*numbers.headings)
            shown.caption = Text(numbers.caption)
            for row in numbers.rows:
                shown.add_row(*row)
            terminal.print(shown)
    if written:
        say("Written: " + ", ".join(str(path) for path in written))
