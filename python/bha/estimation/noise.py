"""What a right model leaves: one description of the noise of records, from 10 to 1000 rows a second.

What: of every channel white noise of its sensor, a coloured part of first order, and rounding to the grid of its
readings; of every section pressures that act and are in no log, an Ornstein-Uhlenbeck process in each chamber, alike in
size and correlation time; and the white noise of the pressures that are in the log, which drives the simulation instead
of the arm. The sizes are found together with the model (:mod:`bha.estimation.noise_fit`).

Rounding. A reading in steps of q of a channel with white noise of deviation s errs by s^2 + q^2/12 in all, but not
whitely: where the channel stands still it errs by the same all the time. The part that belongs to where the channel is
has the variance

    sum over k of q^2 / (2 pi^2 k^2) exp(-(2 pi k s / q)^2)

(Fourier's series of the saw-tooth, each term dithered by the noise; Widrow 1961) and is forgotten over a sixth of a
step, by the way that the channel goes: the slope of the saw-tooth's correlation 1 - 6 x + 6 x^2 at x = 0. The rest is
white.

Logged pressures. White samples of variance s^2 every h s, straight between, are a process of variance 2/3 s^2 with an
intensity of s^2 h: one of first order with the correlation time 3/4 h. Where the arm is slow against h it is white.

Unlogged pressure times area is the force that the model does not know: the honest size of what it lacks, in newtons.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from bha.arm import Arm
from bha.estimation.innovations import Disturbed
from bha.estimation.records import Record
from bha.recordings import Observation

Array = NDArray[np.float64]

#: Terms of the saw-tooth's series, and share of a channel's noise below which what rounding adds is white.
_ORDERS, _LEAST_ROUNDING = 6, 1e-3
#: Share of a channel's noise above which rounding is redrawn for the intervals.
_COARSE = 0.1
#: Poses that differ by less than this are one, m.
_SAME_POSE = 1e-3
#: Interval between samples, in time constants of the arm's fastest mode, below which their noise is white.
_FAST = 0.3


@dataclass(frozen=True)
class Noise:
    """The noise of one record.

    Attributes:
        white: standard deviation of the white part of each channel, in its unit, shape (C,).
        coloured: that of the coloured part, shape (C,); zeros for none.
        colour_time: its correlation time, s, shape (C,).
        unlogged: standard deviation of the unlogged pressure at each input, Pa, shape (inputs,); zeros for none.
        unlogged_time: its correlation time, s, shape (inputs,).
        logged: standard deviation of the white noise of the logged pressures, Pa, shape (inputs,).
        quantum: step of the readings of each channel, shape (C,); 0 for none.
    """

    white: Array
    coloured: Array
    colour_time: Array
    unlogged: Array
    unlogged_time: Array
    logged: Array
    quantum: Array

    @property
    def sensor(self) -> Array:
        """Standard deviation of the whole error of each channel's readings, shape (C,)."""
        return np.asarray(np.sqrt(self.white**2 + self.coloured**2 + self.quantum**2 / 12.0))

    @property
    def is_coarse(self) -> bool:
        """Whether rounding is no white noise in some channel."""
        return bool(np.any(self.rounding > _COARSE * self.sensor**2))

    @property
    def rounding(self) -> Array:
        """Variance of the part of rounding that belongs to where a channel is, shape (C,)."""
        return rounding_of(self.white, self.quantum)

    @property
    def disturbs(self) -> bool:
        """Whether anything but the sensors' noise is in the residuals."""
        return bool(np.any(self.unlogged > 0.0) or np.any(self.logged > 0.0))


@dataclass(frozen=True)
class Linear:
    """An arm near a pose as a record sees it: what pressures do to residuals.

    Attributes:
        state: of lengths and rates, shape (6n, 6n), 1/s.
        driven: by pressures, shape (6n, inputs), 1/(Pa s).
        shown: channels by lengths and rates, shape (C, 6n).
        interval: between the readings of the pressures, s.
    """

    state: Array
    driven: Array
    shown: Array
    interval: float

    @classmethod
    def of(cls, arm: Arm, rec: Record, lengths: Array, pressures: Array) -> Linear:
        """The arm near a pose, lengths (3n,), under pressures (inputs,)."""
        state, driven = arm.linearize(lengths, np.zeros_like(lengths), pressures)
        _, slopes = Observation.of(arm.parameters, rec.observation.outputs).at(arm, lengths)
        shown = np.hstack([slopes, np.zeros_like(slopes)])
        return cls(state, driven, shown, reading_interval(rec))

    def disturbed(self, noise: Noise) -> Disturbed:
        """The system whose output are the residuals of the record under its noise."""
        arm = len(self.state) if noise.disturbs else 0
        rounding = np.where(noise.rounding > _LEAST_ROUNDING * noise.sensor**2, noise.rounding, 0.0)
        unlogged, coloured = np.flatnonzero(noise.unlogged > 0.0), np.flatnonzero(noise.coloured > 0.0)
        rounded = np.flatnonzero(rounding > 0.0)
        white = np.zeros((arm, arm))
        inputs, rates, sizes = unlogged, 1.0 / noise.unlogged_time[unlogged], noise.unlogged[unlogged]
        if self._is_fast:
            # A sample of noise lasts for one interval: its intensity is its variance times that.
            shaken = self.driven[:arm] * noise.logged * np.sqrt(self.interval)
            white = shaken @ shaken.T
        else:
            logged = np.flatnonzero(noise.logged > 0.0)
            inputs = np.concatenate([inputs, logged])
            rates = np.concatenate([rates, np.full(len(logged), 1.0 / (0.75 * self.interval))])
            sizes = np.concatenate([sizes, np.sqrt(2.0 / 3.0) * noise.logged[logged]])
        rates = np.concatenate([rates, 1.0 / noise.colour_time[coloured]])
        sizes = np.concatenate([sizes, noise.coloured[coloured]])
        state = block_diag(self.state[:arm, :arm], np.diag(-rates), np.zeros((len(rounded), len(rounded))))
        state[:arm, arm : arm + len(inputs)] = self.driven[:arm, inputs]
        driving = block_diag(white, np.diag(2.0 * rates * sizes**2), np.zeros((len(rounded), len(rounded))))
        own = np.concatenate([coloured, rounded])
        shown = np.zeros((len(self.shown), len(state)))
        shown[:, :arm] = self.shown[:, :arm]
        shown[own, arm + len(inputs) + np.arange(len(own))] = 1.0
        alike = len(state) - len(rounded)
        return Disturbed(
            state=state,
            driving=driving,
            shown=shown,
            white=noise.white**2 + noise.quantum**2 / 12.0 - rounding,
            lengths=np.concatenate([np.full(alike, np.inf), noise.quantum[rounded] / 6.0]),
            channels=np.concatenate([np.zeros(alike, dtype=np.int64), rounded]),
            sizes=np.concatenate([np.zeros(alike), rounding[rounded]]),
        )

    @cached_property
    def _is_fast(self) -> bool:
        """Whether the pressures' samples come so fast that the arm takes their noise for white."""
        return bool(self.interval * np.max(np.abs(np.linalg.eigvals(self.state))) < _FAST)


@dataclass(frozen=True)
class Sizes:
    """The sizes that records share: what is estimated of the noise.

    Attributes:
        white: factor on each record's own sizes, by sort of channel (``length``, ``position``, ``orientation``).
        colour: by sort of channel the size of the coloured part, in the same units, and its time, s; none if left out.
        unlogged: by section the unlogged pressure, Pa, and its time, s; none if left out.
        logged: factor on the records' noise of the logged pressures.
    """

    white: Mapping[str, float]
    colour: Mapping[str, tuple[float, float]]
    unlogged: Mapping[int, tuple[float, float]]
    logged: float = 1.0

    def of(self, rec: Record, base: Array, sections: Sequence[int]) -> Noise:
        """The noise of a record.

        Args:
            rec: the record.
            base: size of each channel's white noise to which factors refer, shape (C,).
            sections: to which each pressure input belongs, shape (inputs,).
        """
        kinds = [output.kind for output in rec.observation.outputs]
        colours = [self.colour.get(kind, (0.0, 1.0)) for kind in kinds]
        unlogged = [self.unlogged.get(section, (0.0, 1.0)) for section in sections]
        return Noise(
            white=base * [self.white.get(kind, 1.0) for kind in kinds],
            coloured=base * [size for size, _ in colours],
            colour_time=np.array([seconds for _, seconds in colours]),
            unlogged=np.array([size for size, _ in unlogged]),
            unlogged_time=np.array([seconds for _, seconds in unlogged]),
            logged=self.logged * rec.pressure_noise,
            quantum=np.array([fact.quantum for fact in rec.facts]),
        )

    def summary(self) -> dict[str, Any]:
        """As plain values."""
        return {
            "white": dict(self.white),
            "colour": {kind: list(pair) for kind, pair in self.colour.items()},
            "unlogged": {str(section): list(pair) for section, pair in self.unlogged.items()},
            "logged": self.logged,
        }


def rounding_of(white: Array, quantum: Array) -> Array:
    """Variance of the part of rounding that belongs to where a channel is, by its white noise and its step, (C,)."""
    share = white / np.where(quantum > 0.0, quantum, np.inf)
    orders = np.arange(1, _ORDERS + 1)[:, None]
    dithered = np.exp(-((2.0 * np.pi * orders * share) ** 2)) / (2.0 * np.pi**2 * orders**2)
    return np.asarray(quantum**2 * np.sum(dithered, axis=0))


def reading_interval(rec: Record) -> float:
    """Median time between two readings of a pressure, s: what drives an arm may be drawn more densely between them."""
    return max(float(np.median(np.diff(rec.drive.time))), *(fact.interval for fact in rec.pressure_facts))


def ways_of(course: Array, quantum: Array) -> Array:
    """How far each channel has gone since the first row, shape (rows, C); turns of an eighth of a step do not count.

    Channels that are not read in steps have not gone at all. A simulation is shaken by the noise of the pressures that
    drive it, an arm is not: hence the eighth. Smoothing the pressures instead moves the course by more than a step.
    """
    ways = np.zeros_like(course)
    for c in np.flatnonzero(quantum > 0.0):
        play, at, way = quantum[c] / 8.0, float(course[0, c]), 0.0
        for k, value in enumerate(course[:, c].tolist()):
            near = min(max(at, value - play), value + play)
            way += abs(near - at)
            at, ways[k, c] = near, way
    return ways


def redrawn_errors(noise: Noise, course: Array, random: np.random.Generator) -> Array:
    """Errors of readings with another noise and another place of the grid, shape (rows, C): as rounding makes them.

    Where an arm comes back to the same pose it is read with the same error again, which no first-order process knows.
    """
    step = np.where(noise.quantum > 0.0, noise.quantum, 1.0)
    offset = step * random.uniform(size=len(step))
    noisy = course + noise.white * random.standard_normal(course.shape)
    read = np.where(noise.quantum > 0.0, step * np.round((noisy + offset) / step) - offset, noisy)
    return np.asarray(read - course)


def poses_along(lengths: Array, most: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows that stand for all poses of a window, farthest first from those before, and which is nearest to each row.

    Args:
        lengths: of the bellows along the window, shape (rows, 3n).
        most: of them.
    """
    middle = int(np.argmin(np.sum((lengths - lengths.mean(axis=0)) ** 2, axis=1)))
    chosen, away = [middle], np.sum((lengths - lengths[middle]) ** 2, axis=1)
    nearest = np.zeros(len(lengths), dtype=np.intp)
    while len(chosen) < most and away.max() > _SAME_POSE**2 * lengths.shape[1]:
        new = int(np.argmax(away))
        distance = np.sum((lengths - lengths[new]) ** 2, axis=1)
        nearest = np.where(distance < away, len(chosen), nearest)
        away = np.minimum(away, distance)
        chosen.append(new)
    return np.array(chosen, dtype=np.intp), nearest
