"""Lag and dead time of commanded pressures as ordinary free parameters: time constants of filling and venting, a delay.

A chamber follows its command as p' = (command - p) / T, after the dead time of bus, valve and hose, and through a
second stage: a spool, a tube. With one stage a dead time stands for the other, up to 80 ms too long, and an arm
that rings is missed by several noises (docs/decisions/0020). Under measured pressures the pneumatics are left
out, and so is this. An overdamped arm under commands follows through two lags in a row, that of its pressures and its
own, damping over stiffness; what is told of the two is the time S that they have together. The lag alone comes from
how the response bends, which is their product P: lag = (S + sqrt(S^2 - 4 P)) / 2, so that an error of P, dP / P,
becomes dP / P * own / (lag - own). No model's form is right to more than about a tenth of P (inertia, a second lag),
and the lag counts as told where that comes to no more than a tenth: where it is twice the own time of every motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.estimation.apart import KIND, rates
from bha.estimation.free import Coordinate, FreeParameter
from bha.estimation.records import Record
from bha.parameters import ArmParameters, paths
from bha.parameters.provenance import published

#: The time constants: paths, and how far (as a factor's logarithm, in deviations of the prior) nobody knows them.
PATHS = ("pneumatics.fill_time", "pneumatics.vent_time")
#: What stands for a second stage.
SECOND = "pressure_lag"
#: Start where the file gives none, s, and the range in which they are sought.
START, LEAST, GREATEST = 0.1, 2e-3, 20.0
_DEVIATION = 2.0
#: Dead times that are tried, s, the greatest that is sought, and the standard deviation of its prior about none, s.
DELAYS, LATEST, DELAY_SPREAD = (0.02, 0.05, 0.1, 0.2), 2.0, 0.1
#: Second stage of the valves: where it begins, s, the range in which it is sought, in that, and the standard deviation
#: of its logarithm. What a chamber fills through (spool, tube) is shorter than its own time, and not nothing.
STAGE, STAGES, STAGE_SPREAD = 0.02, (0.05, 50.0), 1.5
#: Standard error of a lag, in itself, below which it counts as told, and how many own times it must be.
TOLD, APART = 0.1, 2.0


@dataclass(frozen=True)
class CommonTime:
    """What an overdamped section shows of two lags in a row, its pressures' and its own; times in s.

    Attributes:
        section: its number.
        lag: of its pressures, the mean of filling and venting, all stages together.
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
    lag = 0.5 * (table.fill_time + table.vent_time) + second_stage(arm.parameters)
    return common_with(arm, pressures, lag, error)


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


def with_lag(arm: Arm, records: Sequence[Record], *, second: bool = False) -> tuple[Arm, tuple[FreeParameter, ...]]:
    """The arm with a lag and a dead time of its commanded pressures, and their free parameters.

    With a ``second`` stage of the lag too, where the file has none. The same arm and none where no record is driven by
    commands, and where the file says the full pneumatics.
    """
    if not any(rec.drive.commanded for rec in records) or arm.pneumatics_level == "full":
        return arm, ()
    table = arm.parameters.to_mapping().get("pneumatics", {})
    pneumatics = arm.parameters.pneumatics
    known = set() if pneumatics is None else published(pneumatics.provenance)
    stated = {name: table.get(name, START) for name in ("fill_time", "vent_time")}
    if arm.pneumatics_level != "lag":
        table = {**table, **stated, "level": "lag"}
        arm = Arm(arm.parameters.updated({**arm.parameters.to_mapping(), "pneumatics": table}))
    free = [
        FreeParameter(
            f"pneumatics.{name}", lower=LEAST, upper=GREATEST, prior=(value, _DEVIATION * value), logarithmic=True
        )
        for name, value in stated.items()
        if name not in known
    ]
    if not any(effect.kind == "delay" for effect in arm.parameters.effects):
        arm = arm.with_effects([*arm.parameters.effects, {"kind": "delay", "where": "all", "time": 0.0}])
        path = f"effect.{len(arm.parameters.effects)}.time"
        late = FreeParameter(path, lower=0.0, upper=LATEST, prior=(0.0, DELAY_SPREAD), logarithmic=False)
        free.append(replace(late, scale=DELAY_SPREAD))
    if second and not any(effect.kind == SECOND for effect in arm.parameters.effects):
        stage = {"kind": SECOND, "where": "all", "fill": STAGE, "vent": STAGE}
        arm = arm.with_effects([*arm.parameters.effects, stage])
        low, high = STAGES
        path = f"effect.{len(arm.parameters.effects)}.*"
        free.append(FreeParameter(path, lower=low, upper=high, prior=(1.0, STAGE_SPREAD), logarithmic=True))
    return arm, tuple(free)


def second_stage(parameters: ArmParameters) -> float:
    """Time of the stages behind the first one of all commands, s."""
    own = [e.parameters for e in parameters.effects if e.kind == SECOND and e.where == "all"]
    return float(sum(0.5 * (numbers["fill"] + numbers["vent"]) for numbers in own))


def delayed(coordinates: Sequence[Coordinate], z: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Points like ``z`` with dead times, each with the lag as it is and shorter by as much; none where none is free."""
    made: list[NDArray[np.float64]] = []
    if not any(paths.is_dead_time(c.path) for c in coordinates):
        return made
    for delay in DELAYS:
        for share in (0.0, 1.0):
            point = z.copy()
            for k, coordinate in enumerate(coordinates):
                if paths.is_dead_time(coordinate.path):
                    point[k] = coordinate.coordinate(delay)
                elif coordinate.path in PATHS:
                    lag = coordinate.value(float(z[k])) - share * delay
                    point[k] = coordinate.coordinate(max(lag, coordinate.lower))
            made.append(point)
    return made
