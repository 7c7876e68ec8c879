"""How well an arm explains the poses of logs once everything is free that a file may have wrong without a fault.

What: masses, stiffnesses, areas, rest lengths and the camera's frame are fitted to the poses that the pressures hold,
behind a lag (:mod:`bha.estimation.statics`). A fault of the setup is believed where an arm, or logs, mended as it says
leave less of the poses than the file does, with the same numbers free in both: what a plain number explains as well is
none. The measure is the gain: the logarithm of how many times less is left, the mean over the channels.
Limits: swings count as errors of both alike. Sections of more than ``MOST_SECTIONS`` are not fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bha.errors import BhaError
from bha.estimation.free import FreeParameter, resolve
from bha.estimation.records import record
from bha.estimation.scale import REST_LENGTH, default_free_of
from bha.estimation.statics import Statics, near_statics

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.recordings import Recording

#: Arms of more sections than this are not fitted: they take too long.
MOST_SECTIONS = 6
#: Share of the outputs' motion that a fit may leave which has found the poses of an arm.
FOUND = 0.3


def held_fit(
    arm: Arm, made: Sequence[Recording], more: Sequence[FreeParameter] = (), start: Statics | None = None
) -> Statics | None:
    """An arm fitted to the poses of logs; None where it, or they, hold none.

    Args:
        arm: the arm, of which the recordings need not be.
        made: the logs.
        more: what is free beyond the plain numbers.
        start: a fit to begin at.
    """
    if arm.section_count > MOST_SECTIONS:
        return None
    try:
        records = [record(arm, one) for one in made]
        free = (*default_free_of(arm.parameters, records), *more)
        names = {parameter.path for parameter in free}
        lengths = [
            FreeParameter(path, prior=(section.rest_length, REST_LENGTH * section.rest_length))
            for number, section in enumerate(arm.parameters.sections, start=1)
            if (path := f"section.{number}.rest_length") not in names
        ]
        return near_statics(arm.parameters, resolve(arm.parameters, (*free, *lengths)), records, start)
    except BhaError:
        return None  # too few rows, numbers that no arm has: nothing is told


def gain(filed: Statics | None, other: Statics | None) -> float:
    """How much less ``other`` leaves: logarithm, mean over the channels; NaN where one of them holds no poses."""
    if filed is None or other is None:
        return math.nan
    return (filed.merit - other.merit) / filed.channels


def sure_gain(arm: Arm, made: Sequence[Recording], filed: Statics | None, other: Statics | None, least: float) -> float:
    """The same, but where it exceeds ``least`` the file's arm is fitted from the numbers of ``other``, too.

    A search that ended in a valley of its own is no evidence. Neither is one that leaves more than the outputs moved,
    as it has found no poses of the arm, unless ``other`` does find them (NaN then).
    """
    found = gain(filed, other)
    if not found > least:
        return found
    again = held_fit(arm, made, (), other)
    found = min(found, gain(again, other))
    best, moved = min((fit.spread for fit in (filed, again) if fit is not None), default=math.inf), motion(made)
    lost = best > moved and (other is None or other.spread > FOUND * moved)
    return math.nan if lost else found


def motion(made: Sequence[Recording]) -> float:
    """By how much the outputs of logs move: standard deviation, m, root mean square over outputs."""
    told = [np.where(m.usable, m.measured, np.nan) for m in made]
    spreads = [np.nanvar(column) for table in told for column in table.T if np.isfinite(column).any()]
    return float(np.sqrt(np.mean(spreads))) if spreads else 0.0
