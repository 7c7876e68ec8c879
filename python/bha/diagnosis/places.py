"""Where on an arm an effect may sit, and which smaller places make up a larger one.

Arms are in the core's description here, places as parameter files write them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bha.diagnosis.plan import KindPlan
from bha.parameters import EFFECT_KINDS, Place


def places(plan: KindPlan, core: Mapping[str, Any], measured: Sequence[bool] = ()) -> list[str]:
    """Where the kind may sit on an arm, largest places first; not where the arm has one of it already.

    ``measured`` says for each section whether its lengths are measured as its coordinates: there their sensors are
    modelled. Of an arm with four bellows in a section they are, if its file says so.
    """
    sections = core["section"]
    result: list[Place] = []
    for sort in plan.sorts:
        if sort == "all":
            result.append(Place())
        elif sort in ("sensors", "heads"):
            result.append(Place("sensors" if sort == "sensors" else "heads"))
        elif sort == "tip":
            result.append(Place.of_section(len(sections)))
        elif sort == "section":
            count = len(sections) - (1 if plan.kind == "section_coupling" else 0)
            if count > 1 or "all" not in plan.sorts:
                result += [Place.of_section(i) for i in range(1, count + 1)]
        elif sort == "bellows":
            result += Place().parts("bellows", _inputs(core))
        elif sort == "length":
            own = [i for i, known in enumerate(measured, start=1) if known]
            result += [Place.of_bellows(i, k) for i in own for k in (1, 2, 3)]
        elif sort == "input":
            result += [Place.of_input(name) for name in core["inputs"]]
    several = plan.kind in EFFECT_KINDS and EFFECT_KINDS[plan.kind].several
    taken = {effect["where"] for effect in core.get("effect", ()) if effect["kind"] == plan.kind and not several}
    return [str(place) for place in result if str(place) not in taken]


def place_of(where: str) -> Place:
    """The place of an effect of a model."""
    place = Place.read(where)
    assert place is not None, where  # else it would be no effect of a parameter file
    return place


def members(where: str, sort: str, core: Mapping[str, Any]) -> list[str]:
    """The places of sort ``sort`` that make up the place ``where``."""
    return [str(part) for part in place_of(where).parts(sort, _inputs(core))]


def bellows_in(where: str, core: Mapping[str, Any]) -> frozenset[tuple[int, int]]:
    """The bellows that a place is, holds or feeds: section and number, both from 0."""
    return frozenset(place_of(where).bellows_in(_inputs(core)))


def nested(first: str, second: str, core: Mapping[str, Any]) -> bool:
    """Whether one of two places of the same sort of effect lies within the other."""
    sort = "input" if "input" in (place_of(first).sort, place_of(second).sort) else "bellows"
    a, b = (set(members(where, sort, core)) for where in (first, second))
    return a <= b or b <= a


def _inputs(core: Mapping[str, Any]) -> list[list[str]]:
    """For each section the input of each of its bellows."""
    return [[core["inputs"][int(b["input"])] for b in section["bellows"]] for section in core["section"]]
