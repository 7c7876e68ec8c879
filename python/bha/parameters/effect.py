"""Effects that the paper's model leaves out: the ``[[effect]]`` tables of a parameter file.

The kinds, their places and their numbers come from the registry of the compiled core (``rust/src/effects``), so that a
kind added there is known here. A table says the kind, where it acts, and its numbers by name::

    [[effect]]
    kind = "creep"
    where = "section 2"
    stiffness = 120.0
    tau = 1.5

    [effect.provenance]
    tau = { status = "identified", ci95 = [1.3, 1.7] }
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self, cast

from pydantic import ConfigDict, model_validator

from bha import _core
from bha.parameters.base import GREATEST, Table, key, nearest, table_error
from bha.parameters.messages import shown
from bha.parameters.place import WRITTEN, Place, Sort
from bha.parameters.provenance import ProvenanceTable, check_provenance, provenance_key, provenance_mapping


@dataclass(frozen=True)
class EffectParameter:
    """A number of a kind of effect.

    Attributes:
        name: its key in the file.
        unit: its unit, empty for a plain number.
        low: least value allowed.
        high: greatest value allowed.
        default: value where it is left out; None where it must be given.
        meaning: what it is.
    """

    name: str
    unit: str
    low: float
    high: float
    default: float | None
    meaning: str


@dataclass(frozen=True)
class EffectKind:
    """A kind of effect, as the core's registry knows it.

    Attributes:
        kind: its name.
        summary: one line that says what it is.
        places: where it may act: "all", "section", "bellows", "input", "sensors", "heads".
        parameters: its numbers; none for a formula, whose table names its own.
        several: whether several of this kind in one place make sense.
        needs_poses: whether it is observable only where poses of heads are measured.
        changes_arm: whether it acts once, by changing the arm's parameters, and then costs nothing.
    """

    kind: str
    summary: str
    places: tuple[Sort, ...]
    parameters: tuple[EffectParameter, ...]
    several: bool
    needs_poses: bool
    changes_arm: bool


def _kinds() -> dict[str, EffectKind]:
    kinds = {}
    for info in _core.effect_kinds():
        numbers = tuple(EffectParameter(**parameter) for parameter in info["parameters"])
        kinds[info["kind"]] = EffectKind(
            info["kind"],
            info["summary"],
            cast("tuple[Sort, ...]", tuple(info["places"])),
            numbers,
            info["several"],
            info["needs_poses"],
            info["changes_arm"],
        )
    return kinds


#: All kinds of effects by name.
EFFECT_KINDS: dict[str, EffectKind] = _kinds()


class EffectParameters(Table):
    """An ``[[effect]]`` table. Its numbers are keys of the table; :attr:`parameters` has them in one place."""

    model_config = ConfigDict(frozen=True, extra="allow")

    kind: str = key("a kind of effect", "what it is", strict=True)
    where: str = key("a place: " + ", ".join(WRITTEN.values()), "where it acts", strict=True)
    force: str | None = key('a formula, with kind "formula"', "force of the bellows (N)", default=None, strict=True)
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.kind not in EFFECT_KINDS:
            raise table_error(f"found {shown(self.kind)}{nearest(self.kind, list(EFFECT_KINDS))}", "kind")
        self._check_place()
        self._check_numbers()
        if (self.force is not None) != (self.kind == "formula"):
            if self.force is None:
                raise table_error('missing; allowed: a formula such as "-c * tanh(qd / v0)" (N)', "force")
            raise table_error(f'only kind "formula" has a force; this is "{self.kind}"', "force")
        if self.force is not None and (fault := _core.formula_fault(self.force, list(self.stated_numbers))):
            raise table_error(f"found {shown(self.force)}: {fault}", "force")
        check_provenance(self.provenance, dict(self.stated_numbers))
        return self

    def _check_place(self) -> None:
        found = Place.read(self.where)
        if found is None or found.sort not in self.info.places:
            allowed = " or ".join(WRITTEN[sort] for sort in self.info.places)
            raise table_error(f"found {shown(self.where)}; allowed for {self.kind}: {allowed}", "where")

    def _check_numbers(self) -> None:
        known = {parameter.name: parameter for parameter in self.info.parameters}
        for name, value in self.stated_numbers.items():
            if self.kind != "formula" and name not in known:
                raise table_error("unknown key" + nearest(name, ["kind", "where", "provenance", *known]), (name,))
            if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= GREATEST:
                allowed = f"a finite number, at most {GREATEST:g} in size"
                raise table_error(f"found {shown(value)}; allowed: {allowed}", (name,))
            if name in known and not known[name].low <= value <= known[name].high:
                raise table_error(f"found {shown(value)}; allowed: {_allowed(known[name])}", name)
        for name, parameter in known.items():
            if parameter.default is None and name not in self.stated_numbers:
                raise table_error(f"missing; allowed: {_allowed(parameter)}", name)

    @property
    def info(self) -> EffectKind:
        """What the registry knows of the kind."""
        return EFFECT_KINDS[self.kind]

    @property
    def stated_numbers(self) -> dict[str, Any]:
        """The numbers that the table states."""
        return dict(self.__pydantic_extra__ or {})

    @cached_property
    def parameters(self) -> dict[str, float]:
        """All numbers by name, defaults filled in, in the order of the registry."""
        stated = self.stated_numbers
        if self.kind == "formula":
            return {name: float(value) for name, value in stated.items()}
        numbers: dict[str, float] = {}
        for parameter in self.info.parameters:
            value = stated.get(parameter.name, parameter.default)
            assert value is not None  # a number without a default is stated, or the effect is refused
            numbers[parameter.name] = float(value)
        return numbers

    @property
    def place(self) -> Place:
        """:attr:`where` as a place."""
        found = Place.read(self.where)
        assert found is not None  # else the effect is refused
        return found

    def to_mapping(self) -> dict[str, Any]:
        """The table as it stands in a file."""
        mapping: dict[str, Any] = {"kind": self.kind, "where": self.where}
        if self.force is not None:
            mapping["force"] = self.force
        mapping |= self.stated_numbers
        if self.provenance:
            mapping["provenance"] = provenance_mapping(self.provenance)
        return mapping

    def to_core(self) -> dict[str, Any]:
        """What the core computes with."""
        return {"kind": self.kind, "where": self.where, "parameters": self.parameters, "force": self.force}


def _allowed(parameter: EffectParameter) -> str:
    unit = f" ({parameter.unit})" if parameter.unit else ""
    return f"a number from {parameter.low:g} to {parameter.high:g}{unit}: {parameter.meaning}"


# Kinds that act on the sensor of a length where their place is a bellows; the core's sensors are those of coordinates.
_OF_LENGTH_SENSORS = ("delay", "length_gain", "length_offset", "wire_backlash")
# Kinds whose several are stages one after the other, which may be alike; side by side they would be one.
_IN_SERIES = frozenset({"pressure_lag"})


def check_effects(
    effects: Sequence[EffectParameters], bellows: Sequence[int], inputs: Sequence[str], measured: Sequence[bool]
) -> None:
    """Check that the places of ``effects`` exist on an arm and that none is given twice.

    Args:
        effects: the effects of the arm.
        bellows: number of bellows of each section.
        inputs: names of the arm's inputs.
        measured: for each section whether its measured lengths are its three coordinates.

    Raises:
        PydanticCustomError: with what is wrong; pydantic adds where.
    """
    first: dict[tuple[str, Place], int] = {}
    equal: dict[tuple[Any, ...], int] = {}
    for number, effect in enumerate(effects):
        place = effect.place
        section, number_of_bellows = place.section, place.bellows
        if section is not None and section > len(bellows):
            message = f'found "{effect.where}"; allowed: sections 1 to {len(bellows)}'
            raise table_error(message, f"effect.{number}.where")
        # A section has three length sensors, whatever the number of its bellows.
        if section is not None and number_of_bellows is not None and number_of_bellows > max(bellows[section - 1], 3):
            message = f'found "{effect.where}"; allowed: bellows 1 to {bellows[section - 1]} of section {section}'
            raise table_error(message, f"effect.{number}.where")
        sensor = number_of_bellows is not None and effect.kind in _OF_LENGTH_SENSORS
        if section is not None and sensor and not measured[section - 1]:
            raise table_error(
                f'found "{effect.where}"; the bellows of section {section} are not at 0, 120 and 240 degrees and '
                f"bellows_radius, where the sensors of single lengths are modelled; allowed: "
                f'"section {section}", or lengths = "coordinates" under [sensors] if that is what the log has',
                f"effect.{number}.where",
            )
        if place.input is not None and place.input not in inputs:
            message = f'found "{effect.where}"{nearest(place.input, inputs)}'
            raise table_error(message, f"effect.{number}.where")
        earlier = first.setdefault((effect.kind, place), number)
        if effect.kind in _IN_SERIES:
            continue
        if effect.info.several:
            what = (effect.kind, place, effect.force, *sorted(effect.parameters.items()))
            earlier = equal.setdefault(what, number)
        if earlier < number:
            message = f'"{effect.kind}" at "{effect.where}" is already effect {earlier + 1}; allowed: ' + (
                "several with different numbers" if effect.info.several else "one"
            )
            raise table_error(message, f"effect.{number}.kind")
