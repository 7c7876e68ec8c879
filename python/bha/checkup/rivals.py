"""Physics of few numbers that acts on held poses: what a fault of the setup has to be told from.

A hose, a wall, a softer bellows, a chamber that gets less pressure pull an arm where a wrong line of its file would
have it. Each family here is such physics with a number a chamber, none of which knows how large the weight is:

- forces that stay: an offset of each input's pressure, which is a preload of its section in every direction;
- forces in proportion to pressure: a gain of each input;
- springs: each bellows softer or stiffer than its neighbours, a force in proportion to how far the arm is bent;
- springs between sections, which carry bending over as weights do.

A fault has no number of its own. It is believed where it explains more of the poses than the file does with any of
these families, and the plain numbers, free.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bha.checkup.held import held_fit
from bha.estimation.free import FreeParameter
from bha.parameters import EFFECT_KINDS, Place

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.estimation.statics import Statics
    from bha.parameters import EffectParameters, SectionParameters
    from bha.recordings import Recording

#: Standard deviations of a gain, of the change of a bellows' spring, of an offset in ranges of pressure, and of a
#: spring between sections in what a section resists its bending.
GAIN, SPRING, OFFSET, COUPLING = 0.2, 0.25, 0.1, 1.0
#: What springs between sections begin with, in the same.
STIFF = (0.0, 1.0, 4.0)


def best_rival(arm: Arm, made: Sequence[Recording], *starts: Statics | None) -> Statics | None:
    """The file's arm with the family that leaves least of the poses; None where none holds any.

    Args:
        arm: the arm of the file.
        made: the logs.
        starts: fits at which the searches begin, one after the other; one that ends in a valley of its own is no
            evidence.
    """
    found = [
        fit
        for rival, free in _rivals(arm)
        for start in starts
        if start is not None and (fit := held_fit(rival, made, free, start)) is not None
    ]
    return min(found, key=lambda fit: fit.merit, default=None)


def _rivals(arm: Arm) -> Iterator[tuple[Arm, list[FreeParameter]]]:
    """The arm with each family of effects, all of nothing, and their numbers."""
    sections = arm.parameters.sections
    fed = arm.parameters.inputs_of_bellows
    inputs, bellows, joints = (tuple(map(str, Place().parts(sort, fed))) for sort in ("input", "bellows", "section"))
    span = float(np.mean([np.ptp(section.pressure_range) for section in sections]))
    bent = float(np.mean([_bending(section, k) for k, section in enumerate(sections, start=1)]))
    for kind, places, key, spread, low, high, begin in (
        ("pressure_offset", inputs, "offset", OFFSET * span, -span, span, 0.0),
        ("pressure_gain", inputs, "gain", GAIN, -0.9, 2.0, 0.0),
        ("weak_bellows", bellows, "change", SPRING, -0.9, 2.0, 0.0),
        # Two sections that are nearly one bend otherwise than two with a weak spring between them.
        *(("section_coupling", joints[:-1], "stiffness", COUPLING * bent, 0.0, 10.0 * bent, k * bent) for k in STIFF),
    ):
        if not places:
            continue
        # Those of an arm may be more than such an effect can have.
        allowed = next(number for number in EFFECT_KINDS[kind].parameters if number.name == key)
        lower, upper = max(low, allowed.low), min(high, allowed.high)
        own = arm.parameters.effects
        effects: list[EffectParameters | Mapping[str, Any]]
        effects = [*own, *({"kind": kind, "where": place, key: min(begin, upper)} for place in places)]
        free = [
            FreeParameter(
                f"effect.{k}.{key}", lower=lower, upper=upper, prior=(0.0, spread), logarithmic=False, scale=spread
            )
            for k in range(len(own) + 1, len(effects) + 1)
        ]
        yield arm.with_effects(effects), free


def _bending(section: SectionParameters, number: int) -> float:
    """By how much a section resists its bending, by the springs of its bellows and by itself, N m."""
    of_springs = 0.5 * abs(section.stiffness[0]) * sum(b.radius**2 for b in section.resolved_bellows(number))
    return float(of_springs + section.bending_stiffness[0])
