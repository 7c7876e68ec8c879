"""Pressures and lengths of a log beside the ranges that the arm's file permits."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.arm import Arm
from bha.errors import LogWarning
from bha.recordings.readings import Readings

Array = NDArray[np.float64]

#: Beyond a range by this share of it counts as outside: valves overshoot, sensors have offsets.
TOLERANCE = 0.15
#: A clock that begins this far from 0, s, is that of 1970 or the like: times for people are since the log's start.
FAR_CLOCK = 1e4


def input_ranges(arm: Arm) -> Array:
    """Lowest and highest pressure of each input, Pa, shape (inputs, 2): what all sections that it feeds permit."""
    found: dict[str, tuple[float, float]] = {}
    for number, section in enumerate(arm.parameters.sections, start=1):
        low, high = section.pressure_range
        for bellows in section.resolved_bellows(number):
            before = found.get(bellows.input, (low, high))
            found[bellows.input] = (max(low, before[0]), min(high, before[1]))
    return np.array([found[name] for name in arm.inputs])


def outside(recording: Readings) -> list[str]:
    """A text for each input and each length that leaves its range, with channel, value, time and range."""
    arm, choice = recording.arm, recording.pressures
    pressures, ranges = recording.drive.pressures, input_ranges(arm)
    found: dict[str, list[tuple[str, str]]] = {}
    for k, column in enumerate(choice.columns):
        for line in excursions(recording.drive.time, pressures[:, [k]], ranges[[k]], [column], "Pa"):
            hint = _hint(recording, column, pressures[:, k], ranges[k])
            # Columns that differ in the channel alone, in what they reach and when, have one cause.
            cause = line.partition(", permitted are ")[2] + hint.replace(column, "")
            found.setdefault(cause, []).append((line, hint))
    said = []
    for (line, hint), *others in found.values():
        more = f" ({_names([text.partition(' ')[0] for text, _ in others])} leave it too)" if others else ""
        said.append(f"{line} by pressure_range of {arm.name}{more}: {hint}")
    own = [k for k, output in enumerate(recording.outputs) if output.kind == "length" and output.number > 0]
    limits = np.array([arm.parameters.sections[recording.outputs[k].section - 1].length_range for k in own])
    values = np.where(recording.usable[:, own], recording.measured[:, own], np.nan)
    lengths = excursions(recording.time, values, limits, [recording.outputs[k].name for k in own], "m")
    return said + [f"{line} by length_range of {arm.name}: is the unit right?" for line in lengths]


def _names(columns: Sequence[str]) -> str:
    """``"p12, p13"``; of many the first ones."""
    most = 8
    return ", ".join(columns[:most]) + (f" and {len(columns) - most} more" if len(columns) > most else "")


class LengthExtremes:
    """The greatest and least coordinates of a simulated run, that is taken in pieces, beside ``length_range``."""

    def __init__(self, arm: Arm) -> None:
        """Nothing yet of a run of ``arm``."""
        self._arm = arm
        count = 3 * arm.section_count
        # Times and values of the least and the greatest, shape (2, 3n).
        self._time = np.zeros((2, count))
        self._values = np.array([np.full(count, np.inf), np.full(count, -np.inf)])
        self._first: float | None = None

    def add(self, time: Array, lengths: Array) -> None:
        """Take rows into account: times, s, shape (m,), and coordinates, m, shape (m, 3n)."""
        if len(time) == 0:
            return
        self._first = float(time[0]) if self._first is None else self._first
        for k, (rows, better) in enumerate(
            ((np.argmin(lengths, axis=0), np.less), (np.argmax(lengths, axis=0), np.greater))
        ):
            values = np.take_along_axis(lengths, rows[None], axis=0)[0]
            new = better(values, self._values[k])
            self._time[k] = np.where(new, time[rows], self._time[k])
            self._values[k] = np.where(new, values, self._values[k])

    def warn(self, stacklevel: int) -> None:
        """Warn of a run that has left its limits, as :func:`warnings.warn` would where this is called."""
        text = self.text()
        if text is not None:
            warnings.warn(text, LogWarning, stacklevel=stacklevel + 1)

    def worst(self) -> tuple[str, float, tuple[float, float]]:
        """The coordinate furthest outside of its limits: name, value, m, and limits, m."""
        limits = np.repeat([s.length_range for s in self._arm.parameters.sections], 3, axis=0).T
        out = np.array([limits[0] - self._values[0], self._values[1] - limits[1]])
        side, k = np.unravel_index(int(np.argmax(out)), out.shape)
        own = self._arm.parameters.sections[int(k) // 3].length_range
        return self._name(int(k)), float(self._values[side, k]), (float(own[0]), float(own[1]))

    def _name(self, k: int) -> str:
        name_of = names.length_name if self._arm.parameters.has_standard_bellows else names.coordinate_name
        return name_of(k // 3 + 1, k % 3 + 1)

    def text(self) -> str | None:
        """What is to be said of a run that leaves its limits: the first channel, how far, and the others.

        None for a run that does not.
        """
        if self._first is None:
            return None
        said = []
        for k in range(self._values.shape[1]):
            limits = np.array([self._arm.parameters.sections[k // 3].length_range])
            said += excursions(self._time[:, k], self._values[:, [k]], limits, [self._name(k)], "m", self._first)
        if not said:
            return None
        others = [text.partition(" ")[0] for text in said[1:]]
        more = f" ({_names(others)} leave theirs too)" if others else ""
        return (
            f"the simulated {said[0]} by length_range of {self._arm.name}{more}: the model is not meant for such "
            "lengths; are the pressures right?"
        )


def members_beyond(arms: Sequence[Arm], lengths: Array, counted: NDArray[np.bool_]) -> str | None:
    """What is to be said of members of a batch whose lengths leave their arm's limits; None where none does.

    Args:
        arms: of each member.
        lengths: coordinates, m, shape (members, rows, 3n); NaN where a member has no row.
        counted: which members are looked at, shape (members,).
    """
    limits = {id(arm): np.repeat([s.length_range for s in arm.parameters.sections], 3, axis=0) for arm in arms}
    low, high = np.moveaxis(np.array([limits[id(arm)] for arm in arms]), 2, 0)
    with np.errstate(invalid="ignore"):
        least = np.fmin.reduce(lengths, axis=1) < low - TOLERANCE * (high - low)
        most = np.fmax.reduce(lengths, axis=1) > high + TOLERANCE * (high - low)
    beyond = np.flatnonzero(np.any(least | most, axis=1) & counted)
    if not len(beyond):
        return None
    first = int(beyond[0])
    extremes = LengthExtremes(arms[first])
    known = np.all(np.isfinite(lengths[first]), axis=1)
    extremes.add(np.flatnonzero(known).astype(np.float64), lengths[first][known])
    name, value, limit = extremes.worst()
    return (
        f"simulated lengths of {len(beyond)} of {len(arms)} members leave length_range (the first: member {first}, "
        f"{name} of {arms[first].name} at {value:.4g} m, permitted are {limit[0]:g} to {limit[1]:g} m): the model is "
        "not meant for such lengths; are the pressures right?"
    )


def excursions(
    time: Array, values: Array, ranges: Array, columns: Sequence[str], unit: str, first: float | None = None
) -> list[str]:
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
            when = moment(at[place], time[0] if first is None else first)
            said.append(
                f"{column} reaches {_readable(given[place], unit)} at {when}, permitted are "
                f"{_readable(low, unit, bare=True)} to {_readable(high, unit)}"
            )
    return said


def _readable(value: float, unit: str, *, bare: bool = False) -> str:
    text, shown = (f"{value / 1e3:.4g}", "kPa") if unit == "Pa" else (f"{1e3 * value:.4g}", "mm")
    return text if bare else f"{text} {shown}"


def moment(time: float, first: float) -> str:
    """A time for people, s: since the log's first row where its clock is that of 1970, or another large one."""
    return f"{time:.4g} s" if abs(first) < FAR_CLOCK else f"{time - first:.4g} s after its start"


def stretches(spans: Sequence[tuple[float, float]], first: float) -> str:
    """``"from 3.1 s to 3.7 s, from 5 s to 6 s and 2 more"``; ``first`` is the time of the log's first row, s."""
    shown = ", ".join(f"from {moment(a, first)} to {moment(b, first)}" for a, b in spans[:3])
    return shown + (f" and {len(spans) - 3} more" if len(spans) > 3 else "")


def _hint(recording: Readings, column: str, values: Array, permitted: Array) -> str:
    """What the fault may be: gauge pressure read as absolute, absolute one as gauge, or another unit."""
    ambient, middle = recording.arm.parameters.ambient_pressure, float(np.median(values))
    low, high = permitted
    if column in recording.log.gauge_columns:
        if middle > high and low <= middle - ambient <= high:
            return "is this absolute pressure? Then leave (g) out of its heading"
    elif middle < low <= middle + ambient <= high:
        return f"is this gauge pressure? Then write (g) behind its unit, as in '{column} [kPa(g)]'"
    return "is the unit right?"
