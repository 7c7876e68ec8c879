"""Arms and simulated logs for the tests of checks; quick to simulate."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bha
from bha import names
from bha.parameters import ArmParameters

Array = NDArray[np.float64]
AMBIENT = 101325.0


def arm_of(mapping: dict[str, Any]) -> bha.Arm:
    return bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))


def nominal(sections: int) -> dict[str, Any]:
    """The mapping of the first sections of the nominal arm; lengths in logs are the coordinates."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    mapping["section"] = mapping["section"][:sections]
    mapping["sensors"] = {"lengths": "coordinates"}
    return copy.deepcopy(mapping)


def turned(mapping: dict[str, Any], section: int, degrees: float) -> dict[str, Any]:
    """The arm with the three chambers of a section (from 1) at another azimuth."""
    made = copy.deepcopy(mapping)
    made["section"][section - 1]["bellows"] = [{"angle_deg": 120.0 * k + degrees} for k in range(3)]
    return made


def steps(arm: bha.Arm, *, duration: float = 20.0, rate: float = 50.0, seed: int = 0) -> tuple[Array, Array]:
    """Random steps at every input on ramps of 0.2 s, within the pressure range: times and pressures."""
    random = np.random.default_rng(seed)
    low = np.array([arm.parameters.sections[0].pressure_range] * len(arm.inputs))
    for i, section in enumerate(arm.parameters.sections, start=1):
        for bellows in section.resolved_bellows(i):
            low[arm.inputs.index(bellows.input)] = section.pressure_range
    time = np.arange(round(duration * rate) + 1) / rate
    unit = np.zeros((len(time), len(arm.inputs)))
    for column in unit.T:
        row = 0
        while row < len(time):
            last = row + int(random.uniform(1.0, 3.0) * rate)
            column[row:last] = random.uniform() * (random.random() < 0.7)
            row = last
    ramp = np.ones(10) / 10
    unit = np.column_stack([np.convolve(np.concatenate([np.full(9, u[0]), u]), ramp, "valid") for u in unit.T])
    return time, low[:, 0] + (low[:, 1] - low[:, 0]) * (0.15 + 0.5 * unit)


def log_of(
    plant: bha.Arm,
    time: Array,
    pressures: Array,
    *,
    see: str = "both",
    feeds: Sequence[int] | None = None,
    lengths: Callable[[Array], Array] | None = None,
    heads: Callable[[Array], Array] | None = None,
    pressure_unit: tuple[str, Callable[[Array], Array]] = ("Pa", lambda p: p),
    noise: float = 5e-4,
    hold: int = 1,
    commanded: bool = False,
    seed: int = 0,
) -> bha.Log:
    """A log of a simulated arm.

    Args:
        plant: the arm as it is.
        time: s.
        pressures: that act.
        see: ``"lengths"``, ``"heads"``, ``"both"`` or ``"tip"``.
        feeds: column j holds the pressure of input ``feeds[j]``.
        lengths: what the sensors make of the lengths (m, 3n).
        heads: what the camera makes of the heads (m, n, 3).
        pressure_unit: unit of the headings, and what is written for pressures in Pa absolute.
        noise: of lengths and heads, m.
        hold: sensors renew every so many rows.
        commanded: whether the columns are commands.
        seed: of the noise.
    """
    run = bha.simulate_batch(
        plant, bha.Input(time, pressures, None, False), times=time, method="ros2", step=5e-3, head_positions=True
    )
    assert run.failures[0] is None
    assert run.head_positions is not None
    random = np.random.default_rng(seed)
    rows = (np.arange(len(time)) // hold) * hold

    def sensed(values: Array) -> Array:
        return (values + noise * random.standard_normal(values.shape))[rows]

    n = plant.section_count
    columns: dict[str, Array] = {"t [s]": time}
    unit, written = pressure_unit
    order = range(len(plant.inputs)) if feeds is None else feeds
    for name, j in zip(plant.inputs, order, strict=True):
        heading = ("pc" if commanded else "p") + name.removeprefix("p")
        columns[f"{heading} [{unit}]"] = written(pressures[:, j])
    if see in ("lengths", "both"):
        table = sensed((lengths or (lambda q: q))(run.lengths[0]))
        for k in range(3 * n):
            columns[f"{names.length_name(k // 3 + 1, k % 3 + 1)} [m]"] = table[:, k]
    if see != "lengths":
        places = sensed((heads or (lambda h: h))(run.head_positions[0]))
        for i in range(n):
            if see != "tip" or i == n - 1:
                for axis, name in enumerate(names.position_names(i + 1)):
                    columns[f"{name} [m]"] = places[:, i, axis]
    return bha.Log.from_arrays(columns)


def about_z(degrees: float) -> Array:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
