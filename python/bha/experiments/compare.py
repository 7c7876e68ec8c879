"""Models beside a measurement: how far apart they are."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.trajectory import Trajectory

Array = NDArray[np.float64]


def tool_error(model: Trajectory, measured: Trajectory) -> float:
    """RMS distance between the tools of two trajectories with the same rows, m."""
    distance = np.linalg.norm(model.head_positions[:, -1] - measured.head_positions[:, -1], axis=1)
    return float(np.sqrt(np.mean(distance**2)))


def length_error(model: Trajectory, measured: Trajectory) -> float:
    """RMS difference of all bellows lengths, m."""
    return float(np.sqrt(np.mean((model.lengths - measured.lengths) ** 2)))


def tool_travel(measured: Trajectory) -> float:
    """Greatest distance of the tool from where it starts, m."""
    positions = measured.head_positions[:, -1]
    return float(np.linalg.norm(positions - positions[0], axis=1).max())


def static_trajectory(arm: Arm, measured: Trajectory, lengths: Callable[[Array, Array | None], Array]) -> Trajectory:
    """The lengths that a static model gives for each row's pressures; it is handed the row before as a start."""
    rows: list[Array] = []
    for pressures in measured.pressures:
        rows.append(lengths(pressures, rows[-1] if rows else None))
    heads = np.array([arm.forward_kinematics(q)[0] for q in rows])
    q = np.array(rows)
    return Trajectory(
        time=measured.time,
        lengths=q,
        velocities=np.full_like(q, np.nan),
        pressures=measured.pressures,
        head_positions=heads,
        input_names=measured.input_names,
        arm_name=arm.name,
    )


def oscillation(time: Array, deflection: Array) -> tuple[float, float, float]:
    """(frequency in Hz, greatest deflection in m, damping ratio) of a swing about zero.

    Frequency from the first zero crossings, damping from the extremes between them (logarithmic decrement). Extremes
    below a tenth of the greatest are left out: sensors and creep would decide there.
    """
    crossings = np.flatnonzero(np.diff(np.signbit(deflection)))
    extremes = [np.abs(deflection[a : b + 1]).max() for a, b in pairwise(crossings)]
    greatest = float(np.abs(deflection).max())
    kept: list[float] = []
    for extreme in extremes:
        if extreme < 0.1 * greatest or (kept and extreme > kept[-1]):
            break
        kept.append(float(extreme))
    # Linear interpolation of the crossings, half a period apart.
    exact = [
        time[k] + (time[k + 1] - time[k]) * deflection[k] / (deflection[k] - deflection[k + 1])
        for k in crossings[: len(kept) + 1]
    ]
    frequency = 0.5 * (len(exact) - 1) / (exact[-1] - exact[0])
    decrement = np.log(kept[0] / kept[-1]) / (len(kept) - 1) if len(kept) > 1 else np.nan
    return float(frequency), greatest, float(decrement / np.hypot(np.pi, decrement))
