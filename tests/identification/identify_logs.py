"""Arms and synthetic logs for the tests of identification."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import bha
from bha.logs import Log
from bha.names import length_name, position_names
from bha.parameters import ArmParameters, paths

Array = NDArray[np.float64]


def one_section(**changes: float) -> bha.Arm:
    """The first section of the nominal arm alone, quick to simulate; ``changes`` by the last steps of a path."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    mapping["section"] = mapping["section"][:1]
    parameters = ArmParameters.from_mapping(mapping)
    return bha.Arm(paths.with_values(parameters, {f"section.1.{k}": v for k, v in changes.items()}))


def off(arm: bha.Arm, factors: dict[str, float]) -> bha.Arm:
    """The arm with some numbers multiplied."""
    return bha.Arm(
        paths.with_values(arm.parameters, {p: f * paths.get_value(arm.parameters, p) for p, f in factors.items()})
    )


def multisine(arm: bha.Arm, duration: float, rate: float, seed: int, amplitude: float = 2e4) -> bha.Input:
    """Sums of sines up to 2.5 Hz at every input, about 1.35 bar."""
    random = np.random.default_rng(seed)
    time = np.arange(round(duration * rate) + 1) / rate
    count = len(arm.inputs)
    lines = random.uniform(0.1, 2.5, (8, count))
    phases = random.uniform(0.0, 2.0 * np.pi, lines.shape)
    signal = np.sin(2 * np.pi * lines * time[:, None, None] + phases).sum(axis=1) / 2.0
    return bha.Input(time, 1.35e5 + amplitude * signal)


def measured(
    arm: bha.Arm,
    drive: bha.Input,
    *,
    seed: int = 0,
    noise: float = 3e-4,
    pressure_noise: float = 100.0,
    heads: bool = False,
    change: Callable[[Array], Array] | None = None,
    q0: Array | None = None,
) -> Log:
    """A log of the simulated arm with white sensor noise; ``change`` acts on the lengths before the noise."""
    run = bha.simulate(arm, drive, times=drive.time, method="rk4", step=1e-3, q0=q0)
    random = np.random.default_rng(1000 + seed)
    columns: dict[str, Array] = {"t [s]": drive.time}
    for name, pressure in zip(arm.inputs, drive.pressures.T, strict=True):
        columns[f"{name} [Pa]"] = pressure + pressure_noise * random.standard_normal(len(pressure))
    lengths = run.lengths if change is None else change(run.lengths)
    for section in range(arm.section_count):
        for k in range(3):
            values = lengths[:, 3 * section + k] + noise * random.standard_normal(len(drive.time))
            columns[f"{length_name(section + 1, k + 1)} [m]"] = values
        if heads:
            for k, axis in enumerate(position_names(section + 1)):
                values = run.head_positions[:, section, k] + noise * random.standard_normal(len(drive.time))
                columns[f"{axis} [m]"] = values
    return Log.from_arrays(columns)


def holds(pressures: list[list[float]], each: float = 3.0, rate: float = 50.0) -> bha.Input:
    """Pressures held one after the other, with ramps of 0.2 s between."""
    time, rows = [0.0], [pressures[0]]
    for k, row in enumerate(pressures):
        if k:
            time.append(time[-1] + 0.2)
            rows.append(row)
        time.append(time[-1] + each)
        rows.append(row)
    grid = np.arange(0.0, time[-1], 1.0 / rate)
    table = np.array(rows, dtype=float)
    return bha.Input(grid, np.column_stack([np.interp(grid, time, column) for column in table.T]))
