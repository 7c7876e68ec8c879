"""Sections whose chambers sit at another azimuth, told by the poses where the motions of a section alone do not tell.

What a section's own chambers push is not all that bends it: soft sections bend under the weight of those beyond them,
too, and then no single direction explains their motions. The poses of the whole arm know of that; all azimuths are
fitted to them together with the plain numbers (:mod:`bha.checkup.held`), and a section is believed to be turned where
its chambers agree about it and the arm mended so leaves less than the file's.
Limits: turns of ``LEAST_TURN`` and more; the camera's own turn is free, so that one common turn is the camera's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.checkup.causes import Cause
from bha.checkup.explain import LEAST_TURN, Verdict
from bha.checkup.held import gain, held_fit, sure_gain
from bha.checkup.layout import Layout
from bha.checkup.mend import Mend, mended_arm
from bha.checkup.wiring import Evidence, as_filed
from bha.estimation.free import FreeParameter

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.estimation.statics import Statics
    from bha.recordings import Recording

Array = NDArray[np.float64]

#: How much less the poses must leave of an arm with the sections turned (:func:`bha.checkup.held.gain`).
GAIN = 0.15
#: Standard deviation of an azimuth, rad, and by how much those of a section may differ in their turn, deg.
SPREAD, AGREE = 0.8, 20.0


@dataclass(frozen=True)
class Turned:
    """Sections that are turned.

    Attributes:
        cause: the azimuths as a cause of the motions.
        gain: how much less the poses leave with them.
    """

    cause: Cause
    gain: float


def turned_sections(
    arm: Arm, made: Sequence[Recording], found: Evidence, verdict: Verdict, filed: Statics | None
) -> Turned | None:
    """The sections whose chambers sit at another azimuth by the poses; None where the file's explain them as well."""
    if filed is None or not found.groups:
        return None
    layout = found.layout
    sections = range(layout.section_count)
    # Every chamber with a table of its own, so that it has an angle.
    whole = mended_arm(arm, Mend(angles={i: tuple(np.degrees(layout.angles[i])) for i in sections}))
    free = [
        FreeParameter(_path(i, k), prior=(float(angle), SPREAD), logarithmic=False, scale=0.1)
        for i in sections
        for k, angle in enumerate(layout.angles[i])
    ]
    fitted = held_fit(whole, made, free, filed)
    if fitted is None or gain(filed, fitted) < GAIN:
        return None
    turns = {i: turn for i in sections if (turn := _turn(layout, fitted, i)) is not None}
    if not turns:
        return None
    mended = mended_arm(arm, Mend(angles={i: tuple(np.degrees(layout.angles[i] + a)) for i, a in turns.items()}))
    gained = sure_gain(arm, made, filed, held_fit(mended, made, (), fitted), GAIN)
    if not gained >= GAIN:
        return None
    by_section = tuple(turns.get(i, 0.0) for i in sections)
    assignment = replace(as_filed(layout), turns=dict.fromkeys(found.groups, by_section))
    return Turned(Cause("azimuth", tuple(turns), assignment, verdict.filed, tuple(turns.values())), gained)


def _turn(layout: Layout, fitted: Statics, section: int) -> float | None:
    """By which angle, rad, the chambers of a section agree to be turned; None for little or none."""
    values = fitted.values
    turns = np.array([values[_path(section, k)] - angle for k, angle in enumerate(layout.angles[section])])
    common = complex(np.mean(np.exp(1j * turns)))
    apart = np.abs(np.angle(np.exp(1j * turns) * np.conj(common)))
    turn = float(np.angle(common))
    return turn if abs(np.degrees(turn)) >= LEAST_TURN and np.degrees(apart.max()) <= AGREE else None


def _path(section: int, chamber: int) -> str:
    return f"section.{section + 1}.bellows.{chamber + 1}.angle"
