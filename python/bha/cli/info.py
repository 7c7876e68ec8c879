"""``bha info``: what a parameter file says, and what follows from it."""

from __future__ import annotations

from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.cli.common import arm_argument, console, json_option, print_json, reports_errors, say, table
from bha.errors import ConvergenceError
from bha.parameters import ArmParameters, StatedValue


@click.command()
@arm_argument
@json_option
@reports_errors
def info(arm: Arm, as_json: bool) -> None:
    """What the parameter file ARM (or the shipped arm of that name) says, and what follows from it."""
    facts = _facts(arm)
    if as_json:
        print_json(facts)
        return
    counts = f"{_counted(arm.section_count, 'section')}, {_counted(len(arm.inputs), 'pressure input')}"
    say(f": {counts}", head=arm.name)
    say(
        f"mass {facts['mass']:.3g} kg, force model {facts['force_model']}, "
        f"rotational energy {_word(facts['rotational_energy'])}, Coriolis forces {_word(facts['coriolis_forces'])}"
    )
    running = ("Section", "Value", "Where it comes from")
    values = table("Section", "Key", "Value", "Unit", "Where it comes from", running=running)
    for row in facts["values"]:
        values.add_row(row["place"], row["key"], row["text"], row["unit"], _origin(row))
    out = console()
    out.print(values)
    if facts["rest_lengths"] is not None:
        rest = table("Section", "Lengths at ambient pressure [mm]", "Head [mm]", running=["Section"])
        for i, (lengths, head) in enumerate(zip(facts["rest_lengths"], facts["rest_heads"], strict=True)):
            rest.add_row(str(i + 1), _millimetres(lengths), _millimetres(head))
        out.print(rest)


def _facts(arm: Arm) -> dict[str, Any]:
    parameters = arm.parameters
    lengths: NDArray[np.float64] | None = None
    heads: NDArray[np.float64] | None = None
    try:
        q = arm.static_lengths(np.full(len(arm.inputs), parameters.ambient_pressure))
        lengths, heads = q.reshape(-1, 3), arm.forward_kinematics(q)[0]
    except ConvergenceError:
        pass  # an arm without a rest at ambient pressure still has parameters to show
    return {
        "name": arm.name,
        "sections": arm.section_count,
        "inputs": list(arm.inputs),
        "mass": sum(section.total_mass for section in parameters.sections),
        "force_model": parameters.force_model,
        "rotational_energy": parameters.rotational_energy,
        "coriolis_forces": parameters.coriolis_forces,
        "values": [
            {
                "place": _place(value, parameters),
                "key": value.key,
                "value": value.value,
                "unit": value.unit,
                "text": _text(value.value),
                "status": value.provenance.status,
                "source": value.provenance.source,
            }
            for value in parameters.stated_values()
        ],
        "rest_lengths": lengths,
        "rest_heads": heads,
    }


def _place(value: StatedValue, parameters: ArmParameters) -> str:
    if value.effect is not None:
        effect = parameters.effects[value.effect - 1]
        return f"effect {value.effect}: {effect.kind}, {effect.where}"
    if value.sensor is not None:
        return value.sensor
    if value.section is None:
        return value.part or "arm"
    part = value.part if value.bellows is None else f"bellows {value.bellows}"
    return str(value.section) if part is None else f"{value.section}, {part}"


def _origin(row: dict[str, Any]) -> str:
    return f"{row['status']}: {row['source']}" if row["source"] else str(row["status"])


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _word(switch: bool) -> str:
    return "on" if switch else "off"


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(_text(entry) for entry in value)
    return str(value)


def _millimetres(values: Any) -> str:
    return ", ".join(f"{1e3 * value:.1f}" for value in values)
