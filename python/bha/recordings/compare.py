"""A recording beside a simulation: errors of its outputs, and what was measured as a trajectory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.logs import Log
from bha.recordings.clock import later
from bha.recordings.interpolation import akima
from bha.recordings.outputs import Observation, observe
from bha.recordings.readings import Readings
from bha.recordings.samples import judge
from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]

#: Between two readings further apart than this many usual intervals nothing was measured.
LONGEST_GAP = 3.0
#: Readings this much further apart than the rows of a simulation are not interpolated.
SPARSE = 1.2


def errors(recording: Readings, trajectory: Trajectory) -> Array:
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
    forward = later(rows)
    return akima(at, rows[forward], values[forward])


def predicted(recording: Readings, trajectory: Trajectory) -> Array:
    """The outputs as the sensors would have had them in a simulation, shape (rows, C)."""
    t = trajectory
    lengths = t.lengths if t.measured_lengths is None else t.measured_lengths
    positions = t.head_positions if t.measured_head_positions is None else t.measured_head_positions
    turns = t.head_orientations if t.measured_head_orientations is None else t.measured_head_orientations
    if turns is None and recording.observation.needs_orientations:
        raise InputError(f"{recording.name}: orientations were measured, and the trajectory has none; simulate it anew")
    return recording.observation.predicted(lengths, positions, turns)


def as_trajectory(recording: Readings) -> Trajectory:
    """What was measured, in rows that all outputs share: heads in the world, coordinates where lengths tell them.

    Velocities, and whatever was not measured, are NaN. Delays, gains and offsets of sensors are not taken back.
    """
    rows, values, good = recording.aligned
    shown = np.where(good, values, np.nan)
    lengths = coordinates(recording.observation, shown)
    drive = recording.drive
    return Trajectory(
        time=recording.time[rows],
        lengths=lengths,
        velocities=np.full_like(lengths, np.nan),
        pressures=drive.pressures[recording.drive_rows[rows]],
        head_positions=head_positions(recording.observation, shown),
        input_names=recording.arm.inputs,
        statistics={},
        arm_name=recording.arm.name,
    )


def coordinates(observation: Observation, shown: Array) -> Array:
    """The arm's coordinates that measured lengths (m, C) tell, m, shape (m, 3n); NaN where they do not."""
    lengths = np.full((len(shown), observation.rows.shape[1]), np.nan)
    for first in range(0, lengths.shape[1], 3):
        own = slice(first, first + 3)
        inside = np.any(observation.rows[:, own] != 0.0, axis=1)
        elsewhere = np.any(np.delete(observation.rows, np.arange(first, first + 3), axis=1) != 0.0, axis=1)
        used = np.flatnonzero(inside & ~elsewhere)
        table = observation.rows[used][:, own]
        if len(used) >= 3 and int(np.linalg.matrix_rank(table)) == 3:
            values = shown[:, used] - observation.offsets[used]
            lengths[:, own] = np.linalg.lstsq(table, np.nan_to_num(values).T, rcond=None)[0].T
            lengths[np.any(np.isnan(values), axis=1), own] = np.nan
    return lengths


def head_positions(observation: Observation, shown: Array) -> Array:
    """Positions of the heads in the world out of measured outputs (m, C), m, shape (m, n, 3); NaN elsewhere."""
    heads = np.full((len(shown), observation.rows.shape[1] // 3, 3), np.nan)
    for k, output in enumerate(observation.outputs):
        if output.kind == "position":
            heads[:, output.section - 1, output.number - 1] = shown[:, k]
    return observation.camera.base_positions(heads)


def shown_by(arm: Arm, log: Log, origin: str) -> tuple[Array, Array]:
    """Coordinates (m, 3n) and head positions (m, n, 3) of a log that need not say what drives the arm: a reference.

    Between readings that count, and over what is left out, stands a curve through them.

    Raises:
        LogError: a name that the arm's layout contradicts.
    """
    observation, measured, _ = observe(arm, log, origin)
    filled = measured.copy()
    for k, output in enumerate(observation.outputs):
        fact, usable = judge(log.time, output.name, output.unit, measured[:, k])
        forward = usable & later(log.time)
        if forward.sum() >= 3 and not usable.all():
            curve = akima if fact.held > 0.0 else np.interp
            filled[:, k] = curve(log.time, log.time[forward], measured[forward, k])
    return coordinates(observation, filled), head_positions(observation, filled)
