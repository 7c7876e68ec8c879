"""A recording beside a simulation: errors of its outputs, and what was measured as a trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError
from bha.recordings.interpolation import akima
from bha.trajectory import Trajectory

if TYPE_CHECKING:
    from bha.recordings.recording import Recording

Array = NDArray[np.float64]

#: Between two readings further apart than this many usual intervals nothing was measured.
LONGEST_GAP = 3.0
#: Readings this much further apart than the rows of a simulation are not interpolated.
SPARSE = 1.2


def errors(recording: Recording, trajectory: Trajectory) -> Array:
    """Simulated minus measured outputs at the rows of a trajectory, shape (rows, C); NaN where nothing was measured.

    What is denser is interpolated, the other never: readings to the rows where they are as dense as these; else the
    simulation to the readings, whose errors then stand in the nearest rows.

    Raises:
        InputError: the trajectory lacks the heads' orientations, which were measured.
    """
    shown, rows = predicted(recording, trajectory), trajectory.time
    found = np.full(shown.shape, np.nan)
    if len(rows) < 2:
        return found
    interval = float(np.median(np.diff(rows)))
    for k, fact in enumerate(recording.facts):
        good = np.flatnonzero(recording.usable[:, k])
        good = good[(recording.time[good] >= rows[0]) & (recording.time[good] <= rows[-1])]
        if len(good) < 2:
            continue
        at, values = recording.time[good], recording.measured[good, k]
        usual = max(fact.interval, recording.clock.interval)
        if usual > SPARSE * interval:
            nearest = np.clip(np.searchsorted(rows, at), 1, len(rows) - 1)
            nearest -= at - rows[nearest - 1] < rows[nearest] - at
            found[nearest, k] = _smooth(at, rows, shown[:, k]) - values
            continue
        after = np.clip(np.searchsorted(at, rows), 1, len(at) - 1)
        near = at[after] - at[after - 1] <= LONGEST_GAP * usual * (1.0 + 1e-9)
        between = np.interp(rows, at, values, left=np.nan, right=np.nan)
        found[:, k] = np.where(near, shown[:, k] - between, np.nan)
    return found


def _smooth(at: Array, rows: Array, values: Array) -> Array:
    """A simulated output between its rows."""
    forward = np.concatenate([[True], np.diff(rows) > 0.0])
    return akima(at, rows[forward], values[forward])


def predicted(recording: Recording, trajectory: Trajectory) -> Array:
    """The outputs as the sensors would have had them in a simulation, shape (rows, C)."""
    t = trajectory
    lengths = t.lengths if t.measured_lengths is None else t.measured_lengths
    positions = t.head_positions if t.measured_head_positions is None else t.measured_head_positions
    turns = t.head_orientations if t.measured_head_orientations is None else t.measured_head_orientations
    if turns is None and recording.observation.needs_orientations:
        raise InputError(f"{recording.name}: orientations were measured, and the trajectory has none; simulate it anew")
    return recording.observation.predicted(lengths, positions, turns)


def as_trajectory(recording: Recording) -> Trajectory:
    """What was measured, a row a row of the log: heads in the base frame, coordinates where the lengths tell them.

    Velocities, and whatever was not measured, are NaN. Delays, gains and offsets of sensors are not taken back.
    """
    n, rows = recording.arm.section_count, len(recording)
    shown = np.where(recording.usable, recording.measured, np.nan)
    observation = recording.observation
    lengths = np.full((rows, 3 * n), np.nan)
    for section in range(n):
        own = slice(3 * section, 3 * section + 3)
        inside = np.flatnonzero(np.any(observation.rows[:, own] != 0.0, axis=1))
        elsewhere = np.delete(observation.rows, np.arange(3 * section, 3 * section + 3), axis=1)
        inside = inside[~np.any(elsewhere[inside] != 0.0, axis=1)]
        table = observation.rows[inside][:, own]
        if len(inside) >= 3 and int(np.linalg.matrix_rank(table)) == 3:
            values = shown[:, inside] - observation.offsets[inside]
            lengths[:, own] = np.linalg.lstsq(table, np.nan_to_num(values).T, rcond=None)[0].T
            lengths[np.any(np.isnan(values), axis=1), own] = np.nan
    heads = np.full((rows, n, 3), np.nan)
    for k, output in enumerate(recording.outputs):
        if output.kind == "position":
            heads[:, output.section - 1, output.number - 1] = shown[:, k]
    drive = recording.drive
    return Trajectory(
        time=recording.time,
        lengths=lengths,
        velocities=np.full_like(lengths, np.nan),
        pressures=drive.pressures[recording.drive_rows],
        head_positions=observation.camera.base_positions(heads),
        input_names=recording.arm.inputs,
        statistics={},
        arm_name=recording.arm.name,
    )
