"""``bha robots``: the arms that ship with the package."""

from __future__ import annotations

from collections import Counter
from importlib import resources
from typing import Any

import click

from bha import robots as shipped
from bha.arm import Arm
from bha.cli.common import console, json_option, print_json, reports_errors, say, table
from bha.control.stepper import stable_step
from bha.errors import ConvergenceError

#: An arm whose explicit steps must be shorter than this is called stiff, s.
_STIFF_BELOW = 1e-3


@click.command()
@json_option
@reports_errors
def robots(as_json: bool) -> None:
    """List the arms that ship with the package; their names stand for a parameter file in every command."""
    found = [_facts(name) for name in shipped.names()]
    if as_json:
        print_json({"robots": found})
        return
    listed = table(
        "Arm", "Sections", "Bellows", "Inputs", "Stiff", "Values", "What it is", running=("Values", "What it is")
    )
    for facts in found:
        bellows = "+".join(str(count) for count in facts["bellows"])
        origins = ", ".join(f"{count} {status}" for status, count in facts["values"].items())
        stiff = {True: "yes", False: "no", None: "?"}[facts["stiff"]]
        listed.add_row(facts["name"], facts["sections"], bellows, len(facts["inputs"]), stiff, origins, facts["about"])
    console().print(listed)
    say("Stiff: where explicit methods need steps below 1 ms. bha info ARM shows the values of one.")


def _facts(name: str) -> dict[str, Any]:
    arm = shipped.load(name)
    parameters = arm.parameters
    step = explicit_step(arm)
    return {
        "name": name,
        "sections": arm.section_count,
        "bellows": [len(s.resolved_bellows(number)) for number, s in enumerate(parameters.sections, start=1)],
        "inputs": list(arm.inputs),
        "explicit_step": step,
        "stiff": None if step is None else step < _STIFF_BELOW,
        "values": dict(Counter(value.provenance.status for value in parameters.stated_values())),
        "about": _about(name),
    }


def explicit_step(arm: Arm) -> float | None:
    """The longest step with which rk4 is stable near the arm's rest at ambient pressure, s; None without a rest."""
    try:
        return stable_step(arm)
    except ConvergenceError:
        return None


def _about(name: str) -> str:
    """The first sentence of the comment that the arm's file begins with."""
    lines = resources.files(shipped.__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8").splitlines()
    comment = []
    for line in lines:
        if not line.startswith("#") or line.strip() == "#":
            break
        comment.append(line.strip("# "))
    return " ".join(comment).partition(". ")[0].rstrip(".")
