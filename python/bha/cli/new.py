"""``bha new``: a commented parameter file of a new arm, by questions or by options."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

import click

from bha.cli.common import fail, load_arm, reports_errors, say
from bha.cli.quantities import Each, Quantity
from bha.errors import InputError
from bha.parameters.new_file import new_arm, renamed
from bha.parameters.tape_measure import (
    AREA,
    ARM_MEASURES,
    FEWEST_BELLOWS,
    MOST_BELLOWS,
    SECTION_MEASURES,
    USUAL_STRETCH,
    Measure,
    MeasuredArm,
    MeasuredSection,
    Mounting,
)
from bha.support.files import check_target, written_whole

_OF_SECTIONS = {measure.name: measure for measure in (*SECTION_MEASURES, AREA)}
_OF_ARM = {measure.name: measure for measure in ARM_MEASURES}
_NEEDED = ("length", "radius", "diameter", "mass", "pressure_max")
_BELLOWS = click.IntRange(FEWEST_BELLOWS, MOST_BELLOWS)


def _kind(measure: Measure) -> Quantity:
    return Quantity(measure.unit, measure.text(measure.example).replace(" ", ""))


def _option(key: str) -> str:
    return f"--{key.removesuffix('_deg').replace('_', '-')}"


def _measured(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options that are measures, in the order of the questions."""
    for measure in reversed((*_OF_SECTIONS.values(), *_OF_ARM.values())):
        kind: Any = _kind(measure)
        help_text = f"{measure.what.capitalize()}, {measure.text(measure.low)} to {measure.text(measure.high)}."
        if measure.name in _OF_SECTIONS:
            kind = Each(kind)
        how: dict[str, Any] = {"type": kind, "help": help_text, "metavar": measure.kind.upper()}
        command = click.option(_option(measure.name), measure.name, **how)(command)
    return command


@click.command()
@click.argument("name", metavar="NAME")
@click.option("--from", "source", metavar="ARM", help="Begin with a shipped arm or another file instead of measures.")
@click.option("--sections", type=click.IntRange(1, 256), help="Number of sections, from base to tip.  [default: 1]")
@click.option("--bellows", type=Each(_BELLOWS), help="Number of bellows of a section, 2 to 12.  [default: 3]")
@click.option("--first-angle", type=Each(Quantity("deg", "45deg")), metavar="ANGLE",
              help="Angle of bellows 1 about z from x.  [default: 0]")  # fmt: skip
@_measured
@click.option("--mounting", type=click.Choice(get_args(Mounting)), help="How the straight arm is mounted.")
@click.option("--force", is_flag=True, help="Overwrite a file that is there.")
@reports_errors
def new(name: str, source: str | None, force: bool, **measures: Any) -> None:
    """Write a commented parameter file of a new arm: NAME.toml.

    Without options it asks. With options nothing is asked: --length, --radius, --diameter, --mass and --pressure-max
    are needed, the others have defaults. A number has its unit (150mm, 0.5kg, 1.2bar) or is in SI; sections that differ
    have their values with commas between (--mass 0.75kg,0.6kg). What a tape measure does not tell is guessed and marked
    as assumed.
    """
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    given = {key: value for key, value in measures.items() if value is not None}
    check_target(path)
    if path.exists() and not force:
        raise InputError(f"{path}: is there already; choose another name, or overwrite it with --force")
    if source is not None:
        if given:
            named = ", ".join(map(_option, given))
            raise InputError(f"found --from and {named}; a file is made from another one or from measures")
        arm = load_arm(source)
        text = renamed(arm.parameters.to_toml(), path.stem, source)
    else:
        text = new_arm(_of_options(path.stem, given) if given else _of_answers(path.stem))
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
    say(f"Written: {path}. Next: bha info {path}")


def _of_options(name: str, given: dict[str, Any]) -> MeasuredArm:
    if missing := [_option(key) for key in _NEEDED if key not in given]:
        raise InputError(f"{name}: {', '.join(missing)} not given; give all of the needed ones, or none to be asked")
    count = given.pop("sections", None)
    if "first_angle" in given:
        given["first_angle_deg"] = given.pop("first_angle")
    known = {field.name for field in fields(MeasuredSection)}
    each = {key: value for key, value in given.items() if key in known}
    if count is None:
        count = max(len(value) for value in each.values())
    for key, value in each.items():
        if len(value) not in (1, count):
            allowed = f"one, or one for each of {count} sections"
            raise InputError(f"{_option(key)}: found {len(value)} values; allowed: {allowed}")
    sections = tuple(
        MeasuredSection(**{key: value[i if len(value) > 1 else 0] for key, value in each.items()}) for i in range(count)
    )
    return MeasuredArm(name, sections, **{key: value for key, value in given.items() if key not in known})


def _of_answers(name: str) -> MeasuredArm:
    say("Measure the arm as it is mounted, without pressure. A number has its unit, or is in SI (m, kg, Pa).")
    say("Enter takes what stands in brackets.")
    try:
        mounting: Mounting = click.prompt(
            "Mounting of the straight arm", type=click.Choice(get_args(Mounting)), default="hanging"
        )
        pressures = {key: _ask(measure, measure.example) for key, measure in _OF_ARM.items()}
        count = click.prompt("Number of sections", type=click.IntRange(1, 256), default=1)
        sections: list[MeasuredSection] = []
        for number in range(1, count + 1):
            sections.append(_section_answers(number, count, sections))
    except click.Abort:
        fail("the questions were not answered to the end; nothing is written. Options answer them too: bha new --help")
    return MeasuredArm(name, tuple(sections), mounting=mounting, **pressures)


def _section_answers(number: int, count: int, before: Sequence[MeasuredSection]) -> MeasuredSection:
    """The answers of one section; the one before it is what is proposed."""
    if count > 1:
        say(f"Section {number}, counted from the base")
    last = before[-1] if before else None
    bellows = click.prompt("Number of bellows", type=_BELLOWS, default=last.bellows if last else 3)
    angle = Quantity("deg", "45deg")
    first = click.prompt(
        "Angle of bellows 1 about z from x (deg)", type=angle, default=last.first_angle_deg if last else 0.0
    )
    answers: dict[str, float] = {}
    for measure in SECTION_MEASURES:
        proposed = getattr(last, measure.name) if last else measure.example
        if measure.name == "longest" and (last is None or answers["length"] != last.length):
            proposed = USUAL_STRETCH * answers["length"]
        answers[measure.name] = _ask(measure, proposed)
    if math.isclose(answers["longest"], USUAL_STRETCH * answers["length"], rel_tol=1e-3):
        del answers["longest"]  # what stood in brackets was not measured
    return MeasuredSection(bellows=bellows, first_angle_deg=first, **answers)


def _ask(measure: Measure, proposed: float) -> float:
    """An answer that is plausible, or that is meant although it is not."""
    span = f"{measure.text(measure.low)} to {measure.text(measure.high)}"
    while True:
        value: float = click.prompt(
            f"{measure.what[0].upper()}{measure.what[1:]} ({span})", type=_kind(measure), default=measure.text(proposed)
        )
        doubt = measure.doubt(value)
        if doubt is None or click.confirm(f"{doubt} Take it?", default=False):
            return value
