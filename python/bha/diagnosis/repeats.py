"""What repeated logs tell: how far an arm's answers to the same inputs are apart. No model can be nearer than that.

What: pairs of logs with the same pressures, and the difference of their outputs. Half its power belongs to each log.
Source: replicates as the estimate of pure error, Box, Hunter and Hunter, Statistics for Experimenters (2005), ch. 10.
Validity: logs that begin in the same state: what is left of a different start counts as a difference. Two logs of an
arm that swings freely under constant pressures are no repeats; nothing says that they began alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bha.estimation.records import Record

Array = NDArray[np.float64]

#: Greatest mean square of the difference of the pressures, as a share of their variance.
SAME_INPUTS = 0.05
#: Greatest difference of the clocks, s, and its resolution.
GREATEST_SHIFT, SHIFT_STEP = 2.0, 0.05
#: Least share of the longer log in which both were measured.
OVERLAP = 0.6


@dataclass(frozen=True)
class Repeat:
    """Two logs with the same inputs.

    Attributes:
        names: what reports call them.
        apart: RMS of the difference of each output over the square root of two, shape (channels,), m: as far as one of
            them is from what they have in common.
    """

    names: tuple[str, str]
    apart: Array

    @property
    def rms(self) -> float:
        """Over all channels, m."""
        return float(np.sqrt(np.mean(self.apart**2)))


def repeats(records: Sequence[Record]) -> list[Repeat]:
    """All pairs among ``records`` that have the same inputs, whatever their clocks."""
    found = (_pair(first, second) for first, second in combinations(records, 2))
    return [pair for pair in found if pair is not None]


def with_repeat_noise(records: Sequence[Record], repeated: Sequence[Repeat]) -> list[Record]:
    """The records with what the arm does otherwise each time, alike for all lengths and for all positions.

    An arm repeats best in the direction in which it hardly moves, but no model describes it better there.
    """
    if not repeated:
        return list(records)
    squares = np.mean([r.apart**2 for r in repeated], axis=0)
    lengths = records[0].observation.is_length
    pooled = {kind: float(np.sqrt(np.mean(squares[lengths == kind]))) for kind in np.unique(lengths)}
    each = [pooled[kind] for kind in lengths]
    return [
        replace(r, facts=tuple(replace(f, repeat_noise=v) for f, v in zip(r.facts, each, strict=True))) for r in records
    ]


def _pair(first: Record, second: Record) -> Repeat | None:
    shifts = np.arange(-GREATEST_SHIFT, GREATEST_SHIFT + SHIFT_STEP, SHIFT_STEP)
    differences = [_input_difference(first, second, s) for s in shifts]
    shift = float(shifts[int(np.argmin(differences))])
    if min(differences) > SAME_INPUTS:
        return None
    # Commands come in steps, between which their times say nothing: the outputs decide.
    near = shift + np.arange(-4, 5) * 0.25 * SHIFT_STEP
    squares = min((np.mean(_difference(first, second, s) ** 2, axis=0) for s in near), key=lambda m: float(np.mean(m)))
    return Repeat((first.name, second.name), np.sqrt(0.5 * squares))


def _common(first: Array, second: Array, step: float) -> Array:
    """Times that both records have, regular; none if they are too few."""
    start, end = max(first[0], second[0]), min(first[-1], second[-1])
    longer = max(first[-1] - first[0], second[-1] - second[0])
    return np.arange(start, end, step) if end - start >= OVERLAP * longer else np.empty(0)


def _input_difference(first: Record, second: Record, shift: float) -> float:
    """Mean square of the difference of the pressures over their variance; infinite where they never change."""
    # No finer than the clocks are compared: this is done for every shift, before anything else of a diagnosis.
    time = _common(first.drive.time, second.drive.time + shift, max(first.sample_time, SHIFT_STEP))
    if len(time) == 0:
        return np.inf
    a = _at(time, first.drive.time, first.drive.pressures)
    b = _at(time, second.drive.time + shift, second.drive.pressures)
    variance = float(np.sum(np.var(a, axis=0)))
    noise = float(np.sum(first.pressure_noise**2))
    # Constant pressures are alike in all logs and make no repeat of them.
    if variance <= 100.0 * noise or variance == 0.0:
        return np.inf
    return float(np.sum(np.mean((a - b) ** 2, axis=0))) / variance


def _difference(first: Record, second: Record, shift: float) -> Array:
    time = _common(first.time, second.time + shift, first.sample_time)
    return _at(time, first.time, first.measured) - _at(time, second.time + shift, second.measured)


def _at(time: Array, known: Array, values: Array) -> Array:
    return np.column_stack([np.interp(time, known, column) for column in values.T])
