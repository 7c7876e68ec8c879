"""A soft slow arm of four columns, as a tape measure and guesses have it, and logs of its tip."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import bha
from bha.logs import Log
from bha.parameters import ArmParameters

#: What a guess is wrong about: stiffness, area, bending stiffness, damping.
TRUE = {"stiffness": 60.0, "terminal_area": 4.0e-5, "bending_stiffness": 0.09, "damping": 5.0}
#: Bending damping that makes bending lag longer than stretching, N m s/rad.
BENDING_DAMPING = 0.15
LAG = 0.3


def arm_of(values: dict[str, float], *, apart: bool = False, lag: float | None = None) -> bha.Arm:
    """The arm with these numbers; ``apart``: with its bending damping; ``lag``: of commanded pressures, s."""
    section: dict[str, Any] = {
        "mass": 0.5,
        "bellows_radius": 0.028,
        "bellows_outer_radius": 0.018,
        "terminal_area": values["terminal_area"],
        "rest_length": 0.3,
        "stiffness": [values["stiffness"]],
        "damping": values["damping"],
        "bending_stiffness": [values["bending_stiffness"]],
        "length_range": [0.18, 0.48],
        "pressure_range": [1.0e5, 1.6e5],
        "bellows": [{"angle_deg": angle, "input": f"p1{k}"} for k, angle in enumerate((20, 110, 200, 290), start=1)],
    }
    table: dict[str, Any] = {
        "schema": "bha-arm/1",
        "name": "four columns",
        "gravity": [0.0, 0.0, 9.81],
        "ambient_pressure": 101325.0,
        "section": [section],
    }
    if apart:
        table["effect"] = [{"kind": "bending_damping", "where": "section 1", "damping": BENDING_DAMPING}]
    if lag is not None:
        table["pneumatics"] = {"level": "lag", "fill_time": lag, "vent_time": lag}
    return bha.Arm(ArmParameters.from_mapping(table))


def log_of(
    arm: bha.Arm,
    seed: int,
    *,
    commanded: bool = False,
    turn: float = 0.0,
    duration: float = 30.0,
    driven: tuple[int, ...] = (0, 1, 2, 3),
) -> Log:
    """Steps held for seconds in the ``driven`` inputs, the tip with 0.2 mm of noise.

    ``turn``: angle of the camera about the arm's axis, rad.
    """
    random = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 0.02)
    levels = random.uniform(0.0, 5.0e4, (int(duration / 2.5) + 1, 4))
    pressures = 101325.0 + levels[(time / 2.5).astype(int)] * np.isin(range(4), driven)
    run = bha.simulate(arm, bha.Input(time, pressures, commanded=commanded), times=time, method="ros2", step=2e-3)
    x, y, z = run.head_positions[:, 0].T
    tip: NDArray[np.float64] = np.column_stack(
        [np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x, z]
    )
    tip += 2e-4 * random.standard_normal(tip.shape)
    prefix = "pc" if commanded else "p"
    columns = {"t [s]": time, **{f"{prefix}1{k + 1} [Pa]": pressures[:, k] for k in range(4)}}
    return Log.from_arrays(columns | {f"{axis}1 [m]": tip[:, k] for k, axis in enumerate("xyz")})
