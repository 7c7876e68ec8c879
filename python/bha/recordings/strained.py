"""What slips inside an arm and is strained where a log begins.

Fabric that was bent before a log begins stands off its rest by friction. That is no constant force (effect
``preload``): it gives way once the arm moves on, and under pressures that move it far the pose forgets how the log
began. Where an arm has slipping elements (effect ``hysteresis``), what holds its first pose is therefore taken for
their strain, as far as they can hold it; the rest stays a preload.

What: the forces that hold a section at its first pose are shared among its bellows, whose elements hold so much at
most: with w from -1 to 1 for each bellows, all its elements alike, since a pose tells no more. Of all w that hold the
pose the least in squares is taken, cut at 1 in size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.parameters import ArmParameters, Place

Array = NDArray[np.float64]
#: An effect in the core's description: ``kind``, ``where`` and ``parameters``, numbers by name.
Effect = Mapping[str, Any]

KIND = "hysteresis"
_START = "start"


def free_start(effect: Effect) -> bool:
    """Whether an effect slips and how it starts is nobody's word."""
    return effect["kind"] == KIND and not effect["parameters"].get(_START, 0.0)


def slips(effects: Iterable[Effect]) -> bool:
    """Whether something may be strained where a log begins."""
    return any(map(free_start, effects))


def one_a_bellows(effects: Iterable[Effect], parameters: ArmParameters) -> list[dict[str, Any]]:
    """The effects with those elements that may be strained one a bellows, each with a ``start`` of its own, 0."""
    inputs = parameters.inputs_of_bellows
    found: list[dict[str, Any]] = []
    for effect in effects:
        place = Place.read(effect["where"])
        if not free_start(effect) or place is None:
            found.append(dict(effect))
            continue
        own = {**effect["parameters"], _START: 0.0}
        found += [{**effect, "where": str(part), "parameters": dict(own)} for part in place.parts("bellows", inputs)]
    return found


def with_starts(effects: Sequence[Effect], starts: Sequence[float] | Array) -> list[dict[str, Any]]:
    """The effects, as :func:`one_a_bellows` gives them, with these starts."""
    own = iter(starts)
    return [
        {**effect, "parameters": {**effect["parameters"], _START: float(next(own))}}
        if free_start(effect)
        else dict(effect)
        for effect in effects
    ]


def strains(
    effects: Sequence[Effect], sections: Sequence[int], needed: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Starts of the elements that may be strained, in their order, and what they do not hold.

    Args:
        effects: as :func:`one_a_bellows` gives them.
        sections: numbers of those whose first pose is to be held.
        needed: from starts the forces that hold the arm beside them, three a section, one section after the other.
    """
    where = [place for effect in effects if free_start(effect) and (place := Place.read(effect["where"])) is not None]
    at = np.array([place.section for place in where]), np.array([place.bellows for place in where])
    starts = np.zeros(len(where))
    wanted = needed(starts).reshape(-1, 3)
    # What the elements of a bellows hold at the most acts on its own section alone: those of all sections at once.
    held = {k: wanted - needed(np.where(at[1] == k, 1.0, 0.0)).reshape(-1, 3) for k in sorted(set(at[1].tolist()))}
    for row, section in enumerate(sections):
        own = sorted(set(at[1][at[0] == section].tolist()))
        if not own:
            continue
        share = np.linalg.pinv(np.column_stack([held[k][row] for k in own])) @ wanted[row]
        for k, w in zip(own, np.clip(share, -1.0, 1.0), strict=True):
            starts[(at[0] == section) & (at[1] == k)] = w
    return starts, needed(starts)
