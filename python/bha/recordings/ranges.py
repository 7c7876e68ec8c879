"""Pressures and lengths of a log beside the ranges that the arm's file permits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.recordings.recording import Recording

Array = NDArray[np.float64]

#: Beyond a range by this share of it counts as outside: valves overshoot, sensors have offsets.
TOLERANCE = 0.15


def input_ranges(arm: Arm) -> Array:
    """Lowest and highest pressure of each input, Pa, shape (inputs, 2): what all sections that it feeds permit."""
    found: dict[str, tuple[float, float]] = {}
    for number, section in enumerate(arm.parameters.sections, start=1):
        low, high = section.pressure_range
        for bellows in section.resolved_bellows(number):
            before = found.get(bellows.input, (low, high))
            found[bellows.input] = (max(low, before[0]), min(high, before[1]))
    return np.array([found[name] for name in arm.inputs])


def outside(recording: Recording) -> list[str]:
    """A text for each input and each length that leaves its range, with channel, value, time and range."""
    arm, choice = recording.arm, recording.pressures
    pressures, ranges = recording.drive.pressures, input_ranges(arm)
    said = []
    for k, column in enumerate(choice.columns):
        text = excursions(recording.drive.time, pressures[:, [k]], ranges[[k]], [column], "Pa")
        hint = _hint(recording, column, pressures[:, k], ranges[k])
        said += [f"{line} by pressure_range of {arm.name}: {hint}" for line in text]
    own = [k for k, output in enumerate(recording.outputs) if output.kind == "length" and output.number > 0]
    limits = np.array([arm.parameters.sections[recording.outputs[k].section - 1].length_range for k in own])
    values = np.where(recording.usable[:, own], recording.measured[:, own], np.nan)
    lengths = excursions(recording.time, values, limits, [recording.outputs[k].name for k in own], "m")
    return said + [f"{line} by length_range of {arm.name}: is the unit right?" for line in lengths]


def excursions(time: Array, values: Array, ranges: Array, columns: Sequence[str], unit: str) -> list[str]:
    """For each column that leaves its range by more than the tolerance: channel, value, time and range."""
    said = []
    for k, column in enumerate(columns):
        low, high = ranges[k]
        known = np.isfinite(values[:, k])
        if not known.any():
            continue
        at, given = time[known], values[known, k]
        above, below = int(np.argmax(given)), int(np.argmin(given))
        over, under = given[above] - high, low - given[below]
        if max(over, under) > TOLERANCE * (high - low):
            place = above if over >= under else below
            said.append(
                f"{column} reaches {_readable(given[place], unit)} at {moment(at[place], time[0])}, permitted are "
                f"{_readable(low, unit, bare=True)} to {_readable(high, unit)}"
            )
    return said


def _readable(value: float, unit: str, *, bare: bool = False) -> str:
    text, shown = (f"{value / 1e3:.4g}", "kPa") if unit == "Pa" else (f"{1e3 * value:.4g}", "mm")
    return text if bare else f"{text} {shown}"


def moment(time: float, first: float) -> str:
    """A time for people, s: since the log's first row where its clock is that of 1970, or another large one."""
    return f"{time:.4g} s" if abs(first) < 1e4 else f"{time - first:.4g} s after its start"


def _hint(recording: Recording, column: str, values: Array, permitted: Array) -> str:
    """What the fault may be: gauge pressure read as absolute, absolute one as gauge, or another unit."""
    ambient, middle = recording.arm.parameters.ambient_pressure, float(np.median(values))
    low, high = permitted
    if column in recording.log.gauge_columns:
        if middle > high and low <= middle - ambient <= high:
            return "is this absolute pressure? Then leave (g) out of its heading"
    elif middle < low <= middle + ambient <= high:
        return f"is this gauge pressure? Then write (g) behind its unit, as in '{column} [kPa(g)]'"
    return "is the unit right?"
