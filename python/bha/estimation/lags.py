"""The lag of commanded pressures as ordinary free parameters: time constants of filling and venting.

A chamber follows its command as p' = (command - p) / T. Under measured pressures the pneumatics are left out, and so is
this. An overdamped arm under commands follows through two lags in a row, that of its pressures and its own, damping
over stiffness; what is told of the two is the time S that they have together. The lag alone comes from how the response
bends, which is their product P: lag = (S + sqrt(S^2 - 4 P)) / 2, so that an error of P, dP / P, becomes
dP / P * own / (lag - own). No model's form is right to more than about a tenth of P (inertia, a second lag), and the
lag counts as told where that comes to no more than a tenth: where it is twice the own time of every motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.estimation.apart import KIND, rates
from bha.estimation.free import FreeParameter
from bha.estimation.records import Record

#: The time constants: paths, and how far (as a factor's logarithm, in deviations of the prior) nobody knows them.
PATHS = ("pneumatics.fill_time", "pneumatics.vent_time")
#: Start where the file gives none, s, and the range in which they are sought.
START, LEAST, GREATEST = 0.1, 2e-3, 20.0
_DEVIATION = 2.0
#: Standard error of a lag, in itself, below which it counts as told, and how many own times it must be.
TOLD, APART = 0.1, 2.0


@dataclass(frozen=True)
class CommonTime:
    """What an overdamped section shows of two lags in a row, its pressures' and its own; times in s.

    Attributes:
        section: its number.
        lag: of its pressures, the mean of filling and venting.
        across: lag and damping together, of a motion across the section's axis.
        along: the same of a motion along it.
        told: whether the lag alone is told.
    """

    section: int
    lag: float
    across: float
    along: float
    told: bool = False


def common_times(arm: Arm, pressures: NDArray[np.float64], error: float = math.inf) -> tuple[CommonTime, ...]:
    """The common times of the sections under these pressures, Pa; none without a lag, and where no pose is held.

    ``error`` is the standard error of the lag, in itself, were the form of the model right.
    """
    table = arm.parameters.pneumatics
    if table is None or table.level != "lag" or table.fill_time is None or table.vent_time is None:
        return ()
    return common_with(arm, pressures, 0.5 * (table.fill_time + table.vent_time), error)


def common_with(
    arm: Arm, pressures: NDArray[np.float64], lag: float, error: float = math.inf
) -> tuple[CommonTime, ...]:
    """The common times of the sections with a lag of their pressures, s, wherever it stands in the arm's file."""
    found = []
    for number, section in enumerate(arm.parameters.sections, start=1):
        own = rates(arm, pressures, number)
        if own is None:
            continue
        effects = [e for e in arm.parameters.effects if e.kind == KIND and e.where in ("all", f"section {number}")]
        bending = sum(effect.parameters["damping"] for effect in effects)
        across = (section.damping * own.spread + bending) / own.bending
        along = section.damping * own.bellows / own.stretching
        told = error < TOLD and lag > APART * max(across, along)
        found.append(CommonTime(number, lag, lag + across, lag + along, told))
    return tuple(found)


def with_lag(arm: Arm, records: Sequence[Record]) -> tuple[Arm, tuple[FreeParameter, ...]]:
    """The arm with a lag of its commanded pressures, and its free parameters.

    The same arm and none where no record is driven by commands, and where the file says the full pneumatics.
    """
    if not any(rec.drive.commanded for rec in records) or arm.pneumatics_level == "full":
        return arm, ()
    table = arm.parameters.to_mapping().get("pneumatics", {})
    published = {name for name, entry in table.get("provenance", {}).items() if _status(entry) == "published"}
    stated = {name: table.get(name, START) for name in ("fill_time", "vent_time")}
    if arm.pneumatics_level != "lag":
        table = {**table, **stated, "level": "lag"}
        arm = Arm(arm.parameters.updated({**arm.parameters.to_mapping(), "pneumatics": table}))
    free = [
        FreeParameter(
            f"pneumatics.{name}", lower=LEAST, upper=GREATEST, prior=(value, _DEVIATION * value), logarithmic=True
        )
        for name, value in stated.items()
        if name not in published
    ]
    return arm, tuple(free)


def _status(entry: object) -> object:
    return entry.get("status") if isinstance(entry, dict) else entry
