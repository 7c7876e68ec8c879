"""The command that an arm stood under before its log begins.

Loggers are often started by the first step itself: the first row has the new command, and the arm still stands where
the one before held it. A simulation begins at rest under the first command, here the wrong one. The log itself says
which was the right one where the arm comes back to it: of the commands that are held, that at the end of whose holds
the arm was seen nearest to where it stands at first.
Limits: only commands that the log holds for a second, the first one for 0.3 s, are known (where the arm is seen near
its first pose after none of them, nothing is); a dead time longer than 0.3 s looks like a command that holds; a ramp of
one sample takes the place of the step.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bha.runs.input import Input

Array = NDArray[np.float64]

#: Least time of a hold, s, and the part of it at its end that counts, s.
_HOLD, _END = 1.0, 0.3
#: How much nearer its pose must be than that of the first command, and how near, in the log's greatest motion.
_NEARER, _NEAR = 0.5, 0.3
#: How near, in the same, an arm is still that stands under a first command of less than a second.
_STILL = 0.05


def stood_under(drive: Input, time: Array, channels: Array, first: Array) -> Input | None:
    """The commands with the first sample that the arm stood under; None where the log does not tell it.

    Args:
        drive: the commands, Pa.
        time: of the readings, s, shape (m,).
        channels: lengths and heads, shape (m, C); NaN where nothing was read.
        first: what they show where the log begins and the arm stands, shape (C,).
    """
    changes = np.flatnonzero(np.any(np.diff(drive.pressures, axis=0) != 0.0, axis=1)) + 1
    motion = max(float(np.ptp(column[np.isfinite(column)])) for column in channels.T if np.isfinite(column).any())
    edges = [0, *changes.tolist(), len(drive.time)]
    own: float | None = None
    best: tuple[float, Array] | None = None
    for start, stop in pairwise(edges):
        ends = float(drive.time[min(stop, len(drive.time) - 1)])
        # Where the arm stands on through the first command, that is the one it stood under, however soon it ends.
        if ends - drive.time[start] < (_HOLD if start else _END):
            continue
        late = (time > ends - _END) & (time <= ends)
        if not late.any():
            continue
        far = _distance(channels[late], first)
        if start == 0:
            own = far
            if ends - drive.time[0] < _HOLD and far > _STILL * motion:
                continue
        if best is None or far < best[0]:
            best = far, drive.pressures[start]
    if best is None or best[0] > _NEAR * motion:
        return None
    if np.array_equal(best[1], drive.pressures[0]) or (own is not None and best[0] > _NEARER * own):
        return drive
    return replace(drive, pressures=np.vstack([best[1], drive.pressures[1:]]))


def _distance(rows: Array, first: Array) -> float:
    """Root mean square over channels of how far the mean of some rows is from where the arm stood, m."""
    counts = np.isfinite(rows).any(axis=0) & np.isfinite(first)
    if not counts.any():
        return np.inf
    return float(np.sqrt(np.mean((np.nanmean(rows[:, counts], axis=0) - first[counts]) ** 2)))
