"""States at the start of a window, from what was measured around it: the one way to a first state.

A parabola through the measurements around the start gives positions and rates of the channels; lengths and rates follow
from those by least squares on the forward kinematics, paper (11) and (14), drawn weakly to the pose that the pressures
hold (:mod:`bha.recordings.pose`).
Limits: initial states are estimated with the parameters.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.arm import Arm
from bha.estimation.records import SMOOTHING_SECONDS, Record
from bha.parameters import ArmParameters
from bha.recordings import Observation
from bha.recordings.pose import LEAST_DEVIATION, pose

Array = NDArray[np.float64]


def guess_of(arm: Arm, rec: Record, row: int) -> Array:
    """Lengths and rates of an arm at a row of a record, shape (6n,), its sensors where its own file has them."""
    return guess_state(arm, arm.parameters, Observation.of(arm.parameters, rec.observation.outputs), rec, row)


def guess_state(arm: _core.Arm, parameters: ArmParameters, observation: Observation, rec: Record, row: int) -> Array:
    """Lengths and rates of an arm at a row of a record, shape (6n,).

    Args:
        arm: the arm.
        parameters: how many sections it has, and how long they may be.
        observation: the outputs as this arm shows them.
        rec: the record.
        row: of it.
    """
    values, rates, deviation = _local_fit(rec, row)
    drive, time = rec.drive, rec.time[row]
    pressures = np.array([np.interp(time, drive.time, p) for p in drive.pressures.T])
    forces = None if drive.forces is None else drive.forces[int(rec.rows[row])]
    q = pose(arm, parameters, observation, values, deviation, pressures, forces)
    seen, weight = np.isfinite(values), 1.0 / np.maximum(deviation, LEAST_DEVIATION)
    _, jacobian = observation.at(arm, q)
    lhs = np.vstack([jacobian[seen] * weight[seen, None], np.eye(len(q))])
    rhs = np.concatenate([rates[seen] * weight[seen], np.zeros(len(q))])
    return np.concatenate([q, np.linalg.lstsq(lhs, rhs, rcond=None)[0]])


def pose_of(arm: Arm, rec: Record, values: Array, deviation: Array, pressures: Array) -> Array:
    """As :func:`pose`, for an arm whose sensors are where its own file has them."""
    observation = Observation.of(arm.parameters, rec.observation.outputs)
    return pose(arm, arm.parameters, observation, values, deviation, pressures)


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
