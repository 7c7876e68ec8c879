"""Damping of bending and of stretching apart, where a slow arm shows that one number cannot be both.

The paper's damping acts on each bellows: c at radius r damps stretching and bending at a fixed ratio, as one spring
would stiffen both. Stiffness has a bending stiffness beside it; damping gets the effect ``bending_damping`` where held
poses show a lag across the base's axis that is clearly longer than the one along it. The times of both motions are
damping over stiffness of the arm as it stands under its mean pressures, weight and all:

    c = T_along K_l / N,    c_bending = T_across K_u - c sum r^2 cos^2,

and where an axial stiffness stands beside its springs (:mod:`bha.estimation.backbone`) an axial damping takes what of
the first the second does not need, c = min(T_along K_l / N, T_across K_u / sum r^2 cos^2), c_axial = T_along K_l - N c,
with K_l and K_u the stiffness against stretching and bending of the section alone, N bellows at radii r.
Frame: u = psi cos(phi); q_k = l - R u cos(a_k). Limits: sections whose head is seen; others stay with one damping.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import BhaError
from bha.estimation.free import FreeParameter
from bha.estimation.records import Record
from bha.estimation.statics import Statics
from bha.parameters import ArmParameters

Array = NDArray[np.float64]

KIND = "bending_damping"
#: Ratio and difference, s, of the two lags from which they count as apart. Under commands both hold the pressures' lag.
_RATIO, _DIFFERENCE = 1.03, 0.03
#: Greatest and least bending damping, N m s/rad, and the deviation of its prior as a logarithm.
_GREATEST, _LEAST, _DEVIATION = 100.0, 1e-7, math.log(30.0)
_STEP = 1e-5


@dataclass(frozen=True)
class Rates:
    """What a section's motion dies out by.

    Attributes:
        stretching: stiffness against a change of the mean length, N/m, of all its bellows together.
        bending: stiffness against a change of u, N m/rad.
        bellows: their number.
        spread: sum of r^2 cos^2 over them, m^2.
    """

    stretching: float
    bending: float
    bellows: int
    spread: float

    def dampings(self, across: float, along: float, *, axial: bool = False) -> tuple[float, float, float]:
        """Damping of one bellows, and of bending and of stretching beside it, for two times, s; none is negative.

        Only one of the last two is above zero, that of stretching only where ``axial`` says that there is one.
        """
        stretching, bending = (max(time * k, 0.0) for time, k in ((along, self.stretching), (across, self.bending)))
        damping = stretching / self.bellows
        if axial:
            damping = min(damping, bending / self.spread)
        return damping, max(bending - damping * self.spread, 0.0), stretching - damping * self.bellows


def rates(arm: Arm, pressures: Array, section: int) -> Rates | None:
    """The rates of a section where pressures hold the arm; None where they hold no pose or it would run away."""
    try:
        q = arm.static_lengths(pressures)
        columns = []
        for axis in np.eye(len(q)):
            ends = [
                arm.bias_force(x, 0.0 * q) - arm.actuation_force(x, pressures)
                for x in (q + _STEP * axis, q - _STEP * axis)
            ]
            columns.append((ends[0] - ends[1]) / (2.0 * _STEP))
    except BhaError:
        return None
    table = arm.parameters.sections[section - 1]
    place = slice(3 * (section - 1), 3 * section)
    stiffness = np.column_stack(columns)[place, place]
    bend = -table.bellows_radius * np.cos(np.deg2rad([0.0, 120.0, 240.0]))
    own = table.resolved_bellows(section)
    spread = sum((b.radius * math.cos(b.angle)) ** 2 for b in own)
    found = Rates(float(stiffness.sum()), float(bend @ stiffness @ bend), len(own), spread)
    return found if found.stretching > 0 and found.bending > 0 and spread > 0 else None


def lags_of(statics: Statics, section: int) -> tuple[float, float] | None:
    """Lags across and along of a section's head, s; None where it is not seen."""
    own = {
        sort: float(lag) for (sort, number), lag in zip(statics.sorts, statics.lags, strict=True) if number == section
    }
    return (own["across"], own["along"]) if {"across", "along"} <= own.keys() else None


def apart(parameters: ArmParameters, statics: Statics) -> tuple[int, ...]:
    """Sections whose bending lags clearly more than their stretching, and that have no bending damping yet."""
    has = {effect.where for effect in parameters.effects if effect.kind == KIND}
    found = []
    for section in range(1, len(parameters.sections) + 1):
        lags = lags_of(statics, section)
        if lags is None or has & {"all", f"section {section}"}:
            continue
        if lags[0] > max(_RATIO * lags[1], lags[1] + _DIFFERENCE):
            found.append(section)
    return tuple(found)


def with_bending_damping(
    parameters: ArmParameters, sections: Sequence[int]
) -> tuple[ArmParameters, tuple[FreeParameter, ...]]:
    """The parameters with a bending damping of some sections, and these as free parameters."""
    if not sections:
        return parameters, ()
    mapping, free = parameters.to_mapping(), []
    effects = list(mapping.get("effect", []))
    for section in sections:
        table = parameters.sections[section - 1]
        value = float(np.clip(table.damping * table.bellows_radius**2, 10.0 * _LEAST, 0.1 * _GREATEST))
        effects.append({"kind": KIND, "where": f"section {section}", "damping": value})
        prior = (value, _DEVIATION * value)
        path = f"effect.{len(effects)}.damping"
        free.append(FreeParameter(path, lower=_LEAST, upper=_GREATEST, prior=prior, logarithmic=True))
    return parameters.updated({**mapping, "effect": effects}), tuple(free)


def mean_pressures(records: Sequence[Record]) -> Array:
    """Mean of each input over all records, Pa, shape (inputs,)."""
    return np.asarray(np.mean([rec.drive.pressures.mean(axis=0) for rec in records], axis=0))
