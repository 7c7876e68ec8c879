"""States at the start of a window, guessed from what was measured around it.

The guess only has to lie in the right valley: initial states are estimated with the parameters. A parabola through the
measurements around the start gives positions and rates of the channels; lengths and rates follow from those by least
squares on the forward kinematics, drawn weakly to the pose that the pressures hold (which decides what is not
measured).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import BhaError
from bha.estimation.records import Record
from bha.recordings import Observation

Array = NDArray[np.float64]

#: Time around the start of a window over which channels are smoothed, s.
SMOOTHING_SECONDS = 0.06
#: How far a pose may be from the one the pressures hold before that counts against it, m.
_POSE_DEVIATION = 0.02
#: Channels are not trusted more than this, m.
_LEAST_DEVIATION = 1e-5


def guess_state(arm: Arm, rec: Record, row: int) -> Array:
    """Lengths and rates of the arm at a row of a record, shape (6n,)."""
    values, rates, deviation = _local_fit(rec, row)
    pressures = np.array([np.interp(rec.time[row], rec.drive.time, p) for p in rec.drive.pressures.T])
    q = pose(arm, rec, values, deviation, pressures)
    seen, weight = np.isfinite(values), 1.0 / np.maximum(deviation, _LEAST_DEVIATION)
    _, jacobian = _channels(arm, rec, q)
    lhs = np.vstack([jacobian[seen] * weight[seen, None], np.eye(len(q))])
    rhs = np.concatenate([rates[seen] * weight[seen], np.zeros(len(q))])
    return np.concatenate([q, np.linalg.lstsq(lhs, rhs, rcond=None)[0]])


def pose(arm: Arm, rec: Record, values: Array, deviation: Array, pressures: Array) -> Array:
    """Lengths that fit measured channels best, shape (3n,).

    Args:
        arm: the arm.
        rec: names the channels.
        values: measured channels, m, shape (C,); NaN for one that was not.
        deviation: standard deviation of each, m, shape (C,).
        pressures: Pa, shape (inputs,); the pose they hold decides what no channel tells.
    """
    n = 3 * arm.section_count
    rest = _rest(arm, pressures)
    q = rest.copy()
    weight = 1.0 / np.maximum(deviation, _LEAST_DEVIATION)
    seen = np.isfinite(values)
    for _ in range(12):
        predicted, jacobian = _channels(arm, rec, q)
        # The pull to the resting pose is weak: it decides only what no channel tells.
        lhs = np.vstack([jacobian[seen] * weight[seen, None], np.eye(n) / _POSE_DEVIATION])
        rhs = np.concatenate([(values - predicted)[seen] * weight[seen], (rest - q) / _POSE_DEVIATION])
        step = np.linalg.lstsq(lhs, rhs, rcond=None)[0]
        q = q + np.clip(step, -0.02, 0.02)
        if np.abs(step).max() < 1e-9:
            break
    return q


def _local_fit(rec: Record, row: int) -> tuple[Array, Array, Array]:
    """Value, rate and standard deviation of each channel at a row, by a parabola over the rows around it."""
    t0 = rec.time[row]
    half = SMOOTHING_SECONDS
    near = np.flatnonzero(np.abs(rec.time - t0) <= half)
    while len(near) < 7 and len(near) < len(rec):
        half *= 2.0
        near = np.flatnonzero(np.abs(rec.time - t0) <= half)
    s = (rec.time[near] - t0) / half
    degree = min(2, len(near) - 1)
    basis = np.vander(s, degree + 1, increasing=True)
    values, rates = np.full(len(rec.channels), np.nan), np.full(len(rec.channels), np.nan)
    for c in range(len(rec.channels)):
        good = rec.usable[near, c]
        if good.sum() > degree:
            fit = np.linalg.lstsq(basis[good], rec.measured[near[good], c], rcond=None)[0]
            values[c], rates[c] = fit[0], fit[1] / half if degree else 0.0
    return values, rates, rec.noise


def _rest(arm: Arm, pressures: Array) -> Array:
    """The pose that pressures hold; the middle of the range where there is none."""
    middle = np.repeat([sum(s.length_range) / 2 for s in arm.parameters.sections], 3)
    try:
        q: Array = arm.static_lengths(pressures)
    except BhaError:
        return middle
    low, high = (np.repeat([s.length_range[k] for s in arm.parameters.sections], 3) for k in (0, 1))
    return q if np.all((q > 0.5 * low) & (q < 1.5 * high)) else middle


def _channels(arm: Arm, rec: Record, q: Array) -> tuple[Array, Array]:
    """The record's channels at a pose and their derivative by the lengths."""
    # As this arm shows them: its camera may be free.
    return Observation.of(arm.parameters, rec.observation.outputs).at(arm, q)
