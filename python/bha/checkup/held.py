"""How well an arm explains the poses of logs once everything is free that a file may have wrong without a fault.

What: masses, stiffnesses, areas, rest lengths and the camera's frame are fitted to the poses that the pressures hold,
behind a lag (:mod:`bha.estimation.statics`). A fault of the setup is believed where an arm, or logs, mended as it says
leave less of the poses than the file does, with the same numbers free in both: what a plain number explains as well is
none. The measure is the gain: the logarithm of how many times less is left, the mean over the channels.
Limits: swings count as errors of both alike. Sections of more than ``MOST_SECTIONS`` are not fitted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bha.errors import BhaError
from bha.estimation.free import FreeParameter, resolve
from bha.estimation.records import Record, record
from bha.estimation.scale import AREA, REST_LENGTH, default_free_of
from bha.estimation.statics import Statics, near_statics
from bha.parameters import paths

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.recordings import Recording

#: Arms of more sections than this are not fitted: they take too long.
MOST_SECTIONS = 6
#: Standard deviation of the logarithm of a mass and of an area, and the factor either way that none is off by. What a
#: section weighs against what its pressures push must stay what a scale and a tape measure say: a mass that may be
#: anything makes of a force of any kind a weight, upside down or not.
WEIGHED = {"mass": (0.3, 2.0), "terminal_area": (AREA, 4.0)}
#: A log whose outputs move by less than this share of another one's rests; one that lasts less than this share of all
#: is hardly a pose.
RESTS, SHORT = 0.1, 0.05
#: Share of the outputs' motion that a fit may leave which has found the poses of an arm.
FOUND = 0.25


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
        free = (*_plain(arm, records), *more)
        return near_statics(arm.parameters, resolve(arm.parameters, free), records, start)
    except BhaError:
        return None  # too few rows, numbers that no arm has: nothing is told


def _plain(arm: Arm, records: Sequence[Record]) -> Iterator[FreeParameter]:
    """What a file may have wrong without a fault; weights as far as a scale and a tape measure go (:data:`WEIGHED`)."""
    names = set()
    for free in default_free_of(arm.parameters, records):
        names.add(free.path)
        key = paths.key_of(free.path)
        if key in WEIGHED:
            value, (deviation, factor) = paths.get_value(arm.parameters, free.path), WEIGHED[key]
            prior = (value, deviation * value)
            yield FreeParameter(free.path, lower=value / factor, upper=value * factor, prior=prior)
        else:
            yield free
    for number, section in enumerate(arm.parameters.sections, start=1):
        path = f"section.{number}.rest_length"
        if path not in names:
            yield FreeParameter(path, prior=(section.rest_length, REST_LENGTH * section.rest_length))


def gain(filed: Statics | None, other: Statics | None) -> float:
    """How much less ``other`` leaves: logarithm, mean over the channels; NaN where one of them holds no poses."""
    if filed is None or other is None:
        return math.nan
    return (filed.merit - other.merit) / filed.channels


def surely(arm: Arm, made: Sequence[Recording], filed: Statics | None, other: Statics | None) -> Statics | None:
    """The better one of the fits of the file's arm, ``filed`` and one that begins at the numbers of ``other``.

    A search that ended in a valley of its own is no evidence.
    """
    fits = [fit for fit in (filed, held_fit(arm, made, (), other)) if fit is not None]
    return min(fits, key=lambda fit: fit.merit, default=None)


def sure_gain(arm: Arm, made: Sequence[Recording], filed: Statics | None, other: Statics | None, least: float) -> float:
    """The gain, where it exceeds ``least`` that over the better fit of the file's arm (:func:`surely`).

    NaN where the file's arm leaves more than the outputs moved, as it has found no poses of the arm, unless ``other``
    does find them.
    """
    found = gain(filed, other)
    if not found > least:
        return found
    best = surely(arm, made, filed, other)
    lost = best is not None and best.spread > motion(made) and not (other is not None and finds(made, other))
    return math.nan if lost else gain(best, other)


def finds(made: Sequence[Recording], fit: Statics) -> bool:
    """Whether a fit has found the poses of logs: it leaves a small part of their motion."""
    return fit.spread <= FOUND * motion(made)


def weighs_as_filed(fit: Statics) -> bool:
    """Whether all masses and areas stay within what a file may have wrong: another one stands in for another force."""
    return not any(
        coordinate.at_bound(float(z))
        for coordinate, z in zip(fit.coordinates, fit.z, strict=True)
        if paths.key_of(coordinate.path) in WEIGHED
    )


def that_move(made: Sequence[Recording]) -> list[Recording]:
    """The logs in which something moves, and for long enough: a single pose any number may hit or miss by luck."""
    least = RESTS * max((motion([one]) for one in made), default=0.0)
    shortest = SHORT * sum(one.clock.duration for one in made)
    return [one for one in made if motion([one]) >= least and one.clock.duration >= shortest]


def motion(made: Sequence[Recording]) -> float:
    """By how much the outputs of logs move: standard deviation, m, root mean square over outputs."""
    told = [np.where(m.usable, m.measured, np.nan) for m in made]
    spreads = [np.nanvar(column) for table in told for column in table.T if np.isfinite(column).any()]
    return float(np.sqrt(np.mean(spreads))) if spreads else 0.0
