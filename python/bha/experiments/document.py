"""``docs/experiments.md``: every experiment with its picture and the paper's claims beside our numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from bha.experiments.outcome import Outcome, Table
from bha.experiments.virtual_arm import VirtualBody, VirtualSensors
from bha.plot import write_figure
from bha.support.files import make_folder, written_whole

#: Longest line of the document.
LINE = 120


def write_figures(outcome: Outcome, folder: Path) -> list[Path]:
    """Write the figures of one experiment into ``folder`` as PNG; returns their paths."""
    make_folder(folder)
    return [write_figure(figure, folder / f"{stem}.png") for stem, (figure, _) in outcome.figures.items()]


def write_document(outcomes: Sequence[Outcome], folder: Path, body: VirtualBody, sensors: VirtualSensors) -> Path:
    """Write ``experiments.md`` and its figures into ``folder``; returns the document's path."""
    for outcome in outcomes:
        write_figures(outcome, folder / "figures")
    path = folder / "experiments.md"
    with written_whole(path) as temporary:
        temporary.write_text(document(outcomes, body, sensors), encoding="utf-8", newline="\n")
    return path


def document(outcomes: Sequence[Outcome], body: VirtualBody, sensors: VirtualSensors) -> str:
    """The document's text."""
    held = sum(claim.holds for outcome in outcomes for claim in outcome.claims)
    total = sum(len(outcome.claims) for outcome in outcomes)
    branches = " and ".join(f"{100 * share:.0f} % with {constant:g} s" for share, constant in body.creep)
    parts = [
        "# The paper's experiments",
        "<!-- Written by `bha experiment all`; do not edit. -->",
        "Sections IV to VI of Falkenhahn et al., IEEE Transactions on Robotics 31(6), 2015, with a virtual arm in "
        "the place of Festo's. `make experiments` runs all of it again and writes this page; `bha experiment fig12` "
        f"runs one. {held} of {total} claims hold here.",
        "## What is measured",
        "The virtual arm is built after [`bha_nominal`](reference/parameter_files.md) and is not the model that is "
        f"judged ([model](explanation/model.md)): {100 * (1 - body.plate_share):.0f} % of each section's mass is "
        f"spread over {body.slices} slices along its arc, the rest is in the head plate; every bellows creeps (Maxwell "
        f"branches, share of its stiffness: {branches}); stiffness scatters by {100 * body.scatter:.0f} % from bellows "
        f"to bellows; bellows work on their own change of length (`{body.force_model}`); chamber pressures lag "
        f"{1e3 * sensors.pressure_lag:.0f} ms behind the commanded ones. It is integrated by code of its own. "
        f"Sensors sample every millisecond: lengths with {1e3 * sensors.length_noise:g} mm noise in steps of "
        f"{1e3 * sensors.length_quantum:g} mm, pressures with {1e-2 * sensors.pressure_noise:g} mbar noise in steps "
        f"of {1e-2 * sensors.pressure_quantum:g} mbar. All of these magnitudes are assumed.",
        "The model sees the logs only. It is the paper's: lumped masses, `end_force`, parameters identified in the "
        "order of section IV. Head positions follow from measured lengths by constant curvature, as in the paper.",
    ]
    for outcome in outcomes:
        parts += section(outcome)
    return "\n\n".join(wrapped(part) for part in parts) + "\n"


def wrapped(paragraph: str) -> str:
    """A paragraph in lines of at most 120 characters; tables, headings and pictures as they are."""
    if paragraph.startswith(("|", "#", "!", "<")):
        return paragraph
    return textwrap.fill(paragraph, LINE, break_long_words=False, break_on_hyphens=False)


def section(outcome: Outcome) -> list[str]:
    """The paragraphs of one experiment."""
    parts = [f"## {outcome.title}", outcome.text]
    for stem, (_, caption) in outcome.figures.items():
        parts += [f"![{outcome.title}](figures/{stem}.png)", f"*{caption}*"]
    if outcome.claims:
        rows = [[claim.paper, claim.ours, "yes" if claim.holds else "**no**"] for claim in outcome.claims]
        parts.append(markdown(Table(["claim", "here", "holds"], rows)))
    for table in outcome.tables:
        parts.append(markdown(table))
        if table.caption:
            parts.append(f"*{table.caption}*")
    return parts


def markdown(table: Table) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(table.headings) + " |", "|" + "---|" * len(table.headings)]
    lines += ["| " + " | ".join(row) + " |" for row in table.rows]
    return "\n".join(lines)
