"""What the variables of a sweep act on, by name: numbers of the arm, its input, its initial state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bha import names
from bha.arm import Arm
from bha.errors import ParameterError
from bha.parameters.base import nearest
from bha.parameters.paths import available, expand, get_value, is_group, unit_of
from bha.sweeps.spec import SweepSpec
from bha.sweeps.variable import Variable


@dataclass(frozen=True)
class Target:
    """What a variable acts on.

    Attributes:
        kind: a number of the arm, a factor of the input's pressure above ambient, an addition to the input's pressures,
            the choice of a log, or an addition to the initial pressures, lengths or rates.
        places: paths of the arm's numbers, or columns of pressures, lengths or rates.
        bases: with ``relative``, the file's numbers that the draw is a factor of; else empty.
    """

    kind: Literal["parameter", "amplitude", "offset", "log", "initial_pressure", "initial_length", "initial_velocity"]
    places: tuple[str, ...] | tuple[int, ...]
    bases: tuple[float, ...] = ()

    def unit(self, what: str) -> str:
        """Unit of the draws of a variable named ``what`` that acts on this; empty for factors."""
        match self.kind:
            case "parameter":
                return "" if self.bases else unit_of(what)
            case "offset" | "initial_pressure":
                return "Pa"
            case "initial_length":
                return "m"
            case "initial_velocity":
                return "m/s"
            case "amplitude" | "log":
                return ""


def target_of(spec: SweepSpec, arm: Arm, number: int, variable: Variable) -> Target:
    """What the variable of this number, from 0, acts on.

    Raises:
        ParameterError: the arm or the spec has nothing of that name.
    """
    what = variable.what
    place = ("vary", number, "what")
    target = _input_target(arm, what)
    if target is not None:
        if target.kind == "log":
            _check_logs(spec, number, variable)
        if variable.relative:
            raise spec.fault(("vary", number, "relative"), "found true; allowed: with parameters of the arm only")
        return target
    if what.split(".")[0] in ("input", "initial"):
        raise spec.fault(place, f'found "{what}"{nearest(what, _input_names(arm))}')
    try:
        paths = expand(arm.parameters, what)
    except ParameterError as error:
        allowed = (*_input_names(arm), *available(arm.parameters))
        raise spec.fault(place, f'found "{what}"{nearest(what, allowed)}') from error
    if is_group(what) and not variable.relative:
        text = f'"{what}" is {len(paths)} numbers; allowed: relative = true, so that the draw is a factor of each'
        raise spec.fault(("vary", number, "relative"), text)
    bases = tuple(get_value(arm.parameters, path) for path in paths) if variable.relative else ()
    return Target("parameter", paths, bases)


def _input_names(arm: Arm) -> list[str]:
    count = arm.section_count
    bellows = [(section, k) for section in range(1, count + 1) for k in (1, 2, 3)]
    return [
        "input.log",
        "input.amplitude",
        "input.offset",
        *(f"input.{kind}.{name}" for kind in ("amplitude", "offset") for name in arm.inputs),
        *(f"initial.offset.{name}" for name in arm.inputs),
        *(f"initial.offset.{names.length_name(*pair)}" for pair in bellows),
        *(f"initial.offset.{names.velocity_name(*pair)}" for pair in bellows),
    ]


def _input_target(arm: Arm, what: str) -> Target | None:
    if what not in _input_names(arm):
        return None
    match what.split("."):
        case ["input", "log"]:
            return Target("log", ())
        case ["input", "amplitude" | "offset" as kind, *rest]:
            columns = (arm.inputs.index(rest[0]),) if rest else tuple(range(len(arm.inputs)))
            return Target("amplitude" if kind == "amplitude" else "offset", columns)
    name = what.rsplit(".", 1)[1]
    if name in arm.inputs:
        return Target("initial_pressure", (arm.inputs.index(name),))
    quantity = names.quantity(name)
    assert quantity is not None
    column = 3 * (quantity.section - 1) + quantity.number - 1
    return Target("initial_length" if quantity.kind == "length" else "initial_velocity", (column,))


def _check_logs(spec: SweepSpec, number: int, variable: Variable) -> None:
    logs = spec.input.logs or ()
    if not logs:
        raise spec.fault(("vary", number, "what"), 'found "input.log"; allowed: with [input] logs only')
    for name in variable.values or ():
        if name not in logs:
            raise spec.fault(("vary", number, "values"), f'found "{name}"{nearest(str(name), logs)}')
