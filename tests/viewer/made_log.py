"""An arm that leaves a gap, and its log."""

from __future__ import annotations

import numpy as np

import bha


def arm() -> bha.Arm:
    return bha.robots.load("bha_nominal")


def log(*, heads: bool = True, seconds: float = 2.0) -> bha.Log:
    """What an arm of other masses does, with its heads; from 100 s on, at 50 Hz."""
    given = arm()
    time = np.arange(0.0, seconds + 1e-9, 0.02)
    waves = 0.5 * (1.0 - np.cos(2.0 * np.pi * 0.5 * time))
    pressures = 1.05e5 + 5e4 * waves[:, None] * np.linspace(0.2, 1.0, 9)
    other = given.with_values({"section.*.mass": 0.9})
    run = bha.simulate(other, bha.Input(time, pressures), times=time)
    columns = {"t [s]": time + 100.0}
    columns |= {f"{name} [Pa]": pressures[:, k] for k, name in enumerate(given.inputs)}
    if heads:
        for head in range(3):
            for axis, name in enumerate("xyz"):
                columns[f"{name}{head + 1} [m]"] = run.head_positions[:, head, axis]
    return bha.Log.from_arrays(columns)
