"""Numbers that a run is reduced to, by name. A new one is a function and a line in :data:`METRICS`.

They see the rows of the run, every ``dt``: a peak between two rows is missed. The tip is the last section's head.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Runs:
    """Rows of some runs, m of them, none of which failed; n sections. A shorter run than the longest ends in NaN.

    Attributes:
        time: s, from the run's start on, shape (m, rows).
        lengths: m, shape (m, rows, 3n).
        velocities: m/s, shape (m, rows, 3n).
        tip: position of the tip in the world, m, shape (m, rows, 3).
        last: index of each run's last row, shape (m,).
        arms: the runs' arms.
        settling_band: share of the largest distance from the end within which the tip has settled.
    """

    time: Array
    lengths: Array
    velocities: Array
    tip: Array
    last: NDArray[np.intp]
    arms: Sequence[Arm]
    settling_band: float

    def at_end(self, values: Array) -> Array:
        """The last row of each run."""
        return np.asarray(values[np.arange(len(self.last)), self.last])

    @property
    def displacement(self) -> Array:
        """Distance of the tip from where it started, m, shape (m, rows)."""
        return np.asarray(np.linalg.norm(self.tip - self.tip[:, :1], axis=-1))


@dataclass(frozen=True)
class Metric:
    """One number of a run.

    Attributes:
        unit: its unit.
        meaning: what it is, in words.
        function: the numbers of some runs, shape (m,).
    """

    unit: str
    meaning: str
    function: Callable[[Runs], Array]


def _settling_time(runs: Runs) -> Array:
    """The last crossing into the band, linear between rows.

    A run that still moves is near its end at its end; it has settled only if it stays for the last tenth of its time.
    """
    distance = np.linalg.norm(runs.tip - runs.at_end(runs.tip)[:, None], axis=-1)
    band = runs.settling_band * np.nanmax(distance, axis=1)
    times = np.zeros(len(distance))
    for k, (row, limit, last) in enumerate(zip(distance, band, runs.last, strict=True)):
        outside = np.flatnonzero(row[: last + 1] > limit)
        if not len(outside):
            continue  # it never moved
        leaving = int(outside[-1])
        share = (row[leaving] - limit) / (row[leaving] - row[leaving + 1])
        entering = runs.time[k, leaving] + share * (runs.time[k, leaving + 1] - runs.time[k, leaving])
        times[k] = entering if entering <= 0.9 * runs.time[k, last] else np.nan
    return times


def _peak_rate(runs: Runs) -> Array:
    return np.asarray(np.nanmax(np.abs(runs.velocities), axis=(1, 2)))


def _peak_tip_speed(runs: Runs) -> Array:
    if runs.time.shape[1] < 2:
        return np.zeros(len(runs.last))
    speed = np.linalg.norm(np.diff(runs.tip, axis=1), axis=-1) / np.diff(runs.time, axis=1)
    return np.asarray(np.nanmax(speed, axis=1))


def _tip_path_length(runs: Runs) -> Array:
    return np.asarray(np.nansum(np.linalg.norm(np.diff(runs.tip, axis=1), axis=-1), axis=1))


def _energy(runs: Runs, last: bool) -> Array:
    rows = runs.last if last else np.zeros_like(runs.last)
    numbers = [
        arm.energy(runs.lengths[k, row], runs.velocities[k, row]).total
        for k, (arm, row) in enumerate(zip(runs.arms, rows, strict=True))
    ]
    return np.array(numbers, dtype=np.float64)


def _peak_kinetic_energy(runs: Runs) -> Array:
    numbers = [
        max(arm.energy(runs.lengths[k, row], runs.velocities[k, row]).kinetic for row in range(int(last) + 1))
        for k, (arm, last) in enumerate(zip(runs.arms, runs.last, strict=True))
    ]
    return np.array(numbers, dtype=np.float64)


def _root_mean_square(values: Array) -> Array:
    return np.asarray(np.sqrt(np.nanmean(values**2, axis=1)))


def _tip(axis: int) -> Callable[[Runs], Array]:
    return lambda runs: runs.at_end(runs.tip)[:, axis]


#: All metrics by name.
METRICS: dict[str, Metric] = {
    "final_tip_x": Metric("m", "x of the tip at the end, in the world", _tip(0)),
    "final_tip_y": Metric("m", "y of the tip at the end, in the world", _tip(1)),
    "final_tip_z": Metric("m", "z of the tip at the end, in the world", _tip(2)),
    "final_tip_displacement": Metric(
        "m", "distance of the tip from its start at the end", lambda runs: runs.at_end(runs.displacement)
    ),
    "max_tip_displacement": Metric(
        "m", "largest distance of the tip from its start", lambda runs: np.asarray(np.nanmax(runs.displacement, axis=1))
    ),
    "rms_tip_displacement": Metric(
        "m", "root mean square of the tip's distance from its start", lambda runs: _root_mean_square(runs.displacement)
    ),
    "tip_path_length": Metric("m", "length of the tip's way, straight between rows", _tip_path_length),
    "peak_tip_speed": Metric("m/s", "largest speed of the tip, by differences between rows", _peak_tip_speed),
    "settling_time": Metric(
        "s",
        "when the tip comes within settling_band of its end for good; NaN if not within 9/10 of the run",
        _settling_time,
    ),
    "peak_rate": Metric("m/s", "largest absolute rate of a bellows length", _peak_rate),
    "min_length": Metric("m", "shortest bellows length", lambda runs: np.asarray(np.nanmin(runs.lengths, axis=(1, 2)))),
    "max_length": Metric("m", "longest bellows length", lambda runs: np.asarray(np.nanmax(runs.lengths, axis=(1, 2)))),
    "initial_energy": Metric("J", "mechanical energy at the start", lambda runs: _energy(runs, last=False)),
    "final_energy": Metric("J", "mechanical energy at the end", lambda runs: _energy(runs, last=True)),
    "peak_kinetic_energy": Metric("J", "largest kinetic energy", _peak_kinetic_energy),
}


def evaluate(names: Sequence[str], runs: Runs) -> dict[str, Array]:
    """The metrics of some runs by name, each of shape (m,)."""
    return {name: METRICS[name].function(runs) for name in names}
