"""What effects remember of a motion before a log: hidden states that do not start at rest.

A bellows that slips, a material that creeps, a pressure that lags or follows only beyond a band, a wire with play:
where a log begins in motion they stand somewhere that no reading tells. Of each bellows, where between the ends of what
it can remember it stands, -1 to 1, is one more number of an initial state, behind lengths and rates: it is found and
eliminated with these, log by log. One number a bellows: what of its length, its pressure and its wire is remembered has
seen the same motion.
Limits: valves and chambers begin as they do (:mod:`bha.estimation.first_second`); so does a lag of commands.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from bha.parameters import ArmParameters, Place

Array = NDArray[np.float64]

#: Kinds that remember, and the one that under commands begins as these before the log have led to.
KINDS = frozenset({"hysteresis", "friction", "creep", "valve_dead_band", "pressure_lag", "wire_backlash"})
OF_COMMANDS = "pressure_lag"
#: Plausible distance from rest, and the greatest.
DEVIATION, MOST = 0.5, 1.0


def remembering(parameters: ArmParameters, effects: Iterable[tuple[str, str]], *, commanded: bool) -> NDArray[np.bool_]:
    """Which bellows have something that remembers, shape (bellows,).

    Args:
        parameters: of the arm.
        effects: kinds and places of its effects.
        commanded: whether commands drive it.
    """
    inputs = parameters.inputs_of_bellows
    found = [np.zeros(len(section), dtype=np.bool_) for section in inputs]
    for kind, where in effects:
        place = Place.read(where)
        if kind not in KINDS or place is None or (commanded and kind == OF_COMMANDS):
            continue
        for section, bellows in place.bellows_in(inputs):
            found[section][bellows] = True
    return np.concatenate(found)


def within(states: Array, coordinates: int) -> Array:
    """Initial states, lengths and rates first, ``coordinates`` each, with memories within what there is of them."""
    kept = states.copy()
    kept[:, 2 * coordinates :] = np.clip(kept[:, 2 * coordinates :], -MOST, MOST)
    return kept
