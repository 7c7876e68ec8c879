"""Pressures and lengths of a recording beside the ranges that the arm's file permits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.recordings.recording import Recording

Array = NDArray[np.float64]

#: How far beyond a range counts, as a share of it: valves overshoot, and files are no better than that.
TOLERANCE = 0.15


def input_ranges(arm: Arm) -> list[tuple[str, float, float, int]]:
    """Name, lowest and highest pressure, Pa, and section of each input; the widest of the sections that it feeds."""
    found: dict[str, tuple[float, float, int]] = {}
    for number, section in enumerate(arm.parameters.sections, start=1):
        low, high = section.pressure_range
        for bellows in section.resolved_bellows(number):
            before = found.get(bellows.input, (low, high, number))
            found[bellows.input] = (min(low, before[0]), max(high, before[1]), before[2])
    return [(name, *found[name]) for name in arm.inputs]


def outside(recording: Recording) -> list[str]:
    """A text for each input and each length that leaves its range, with channel, time, value and range."""
    said = []
    values = recording.drive.pressures
    for k, (_, low, high, section) in enumerate(input_ranges(recording.arm)):
        text = _excursion(recording.drive.time, values[:, k], low, high, "Pa")
        if text is not None:
            column = recording.pressures.columns[k]
            hint = _hint(recording, column, values[:, k], low, high)
            said.append(
                f"{column} {text}; pressure_range of section {section} of {recording.arm.name} is {low:g} to "
                f"{high:g} Pa{hint}"
            )
    for k, output in enumerate(recording.outputs):
        if output.kind != "length" or output.number == 0:
            continue
        good = recording.usable[:, k]
        low, high = recording.arm.parameters.sections[output.section - 1].length_range
        text = _excursion(recording.time[good], recording.measured[good, k], low, high, "m")
        if text is not None:
            said.append(
                f"{output.name} {text}; length_range of section {output.section} of {recording.arm.name} is "
                f"{low:g} to {high:g} m: is the unit right?"
            )
    return said


def _excursion(time: Array, values: Array, low: float, high: float, unit: str) -> str | None:
    """``"reaches 6e+05 Pa at 1 s"``: the value furthest outside of the range, if any is by more than the tolerance."""
    if not len(values):
        return None
    margin = TOLERANCE * (high - low)
    above, below = int(np.argmax(values)), int(np.argmin(values))
    over, under = float(values[above]) - high, low - float(values[below])
    if max(over, under) <= margin:
        return None
    place = above if over >= under else below
    return f"reaches {values[place]:.6g} {unit} at {time[place]:.6g} s"


def _hint(recording: Recording, column: str, values: Array, low: float, high: float) -> str:
    """What the fault may be: gauge pressure read as absolute, absolute one as gauge, or another unit."""
    ambient = recording.arm.parameters.ambient_pressure
    middle = float(np.median(values))
    if column in recording.log.gauge_columns:
        if middle > high and low <= middle - ambient <= high:
            return ": is this absolute pressure? Then leave (g) out of its heading"
    elif middle < low <= middle + ambient <= high:
        return f": is this gauge pressure? Then write (g) behind its unit, as in '{column} [kPa(g)]'"
    return ": is the unit right?"
