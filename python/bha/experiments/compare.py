"""Models beside a measurement: how far apart they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]


def tool_error(model: Trajectory, measured: Trajectory) -> float:
    """RMS distance between the tools of two trajectories with the same rows, m."""
    distance = np.linalg.norm(model.head_positions[:, -1] - measured.head_positions[:, -1], axis=1)
    return float(np.sqrt(np.mean(distance**2)))


def greatest_tool_error(model: Trajectory, measured: Trajectory) -> float:
    """Greatest distance between the tools of two trajectories with the same rows, m."""
    return float(np.linalg.norm(model.head_positions[:, -1] - measured.head_positions[:, -1], axis=1).max())


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


def of_both_arms(at_heads: Mapping[str, float], along: Mapping[str, float]) -> dict[str, float]:
    """Numbers of the arm with its mass in the heads, by names that say so, and of the one with it along its arcs."""
    return {f"at_heads_{name}": value for name, value in at_heads.items()} | dict(along)
