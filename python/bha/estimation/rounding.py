"""What rounding to coarse steps adds to a reading on average, given where the channel is.

A reading in steps of q of a channel at y with white noise of deviation s is y and, on average over the noise,

    c(y) = sum over k of (-1)^k q / (pi k) exp(-2 pi^2 k^2 s^2 / q^2) sin(2 pi k y / q)

(Fourier's series of the saw-tooth, each term dithered by the noise; Widrow 1961). Where s is far below q a channel that
stands still is read with the same error all the time, up to half a step, and one that comes back errs the same again:
no noise, but a function of where the model has the channel, which can be taken off. What is left is white.

The simulation that says where the channel is is shaken by the noise of the logged pressures, with a deviation r that
the channel does not have. Over that, a term exp(-2 pi^2 k^2 s^2 / q^2) becomes smaller by exp(-2 pi^2 k^2 r^2 / q^2);
so that it is right on average, it is taken greater by as much (a corrected score: Nakamura 1990, Stefanski 1989).
Terms that would have to be taken greater by more than ``_MOST`` are left out, and stay noise.

s is told by how often readings are one step off where the model is near an edge: the likeliest deviation of what sets
readings apart from the model, each reading being an interval (Stewart 1983), less what shakes the simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import log_ndtr

from bha.estimation.pressure_noise import redrawn
from bha.estimation.problem import Point, Problem
from bha.estimation.records import Record

Array = NDArray[np.float64]

#: Deviation of all that sets readings apart from the model, in steps, from which on rounding is as good as white: the
#: first term is a seventh of its full size there.
COARSE = 0.31
#: Terms of the series, and what one is taken greater by at the most.
_ORDERS, _MOST = 6, 6.0
#: Least deviation of the sensor's noise, in steps.
_LEAST = 0.02
#: Distance of the points between which slopes are taken, m.
_NEAR = 1e-7
#: Simulations with redrawn pressures that tell what they shake.
_DRAWS = 4


@dataclass(frozen=True)
class Rounding:
    """How the channels of records are rounded.

    Attributes:
        quantum: step of each channel, in its unit, shape (C,); 0 for those whose rounding is left to the noise.
        offset: of the grid that its readings lie on, shape (C,).
        white: deviation of the sensor's noise, shape (C,).
        shaken: deviation by which noise of the pressures shakes the simulation, shape (C,).
    """

    quantum: Array
    offset: Array
    white: Array
    shaken: Array

    @property
    def is_coarse(self) -> bool:
        """Whether rounding of some channel is more than noise."""
        return bool(np.any(self.quantum > 0.0))

    def error(self, shown: Array) -> Array:
        """What rounding adds on average where a simulation shows the channels, shape (rows, C)."""
        step = np.where(self.quantum > 0.0, self.quantum, 1.0)
        phase = 2.0 * np.pi * (shown - self.offset) / step
        found = np.zeros(np.shape(shown))
        for k in range(1, _ORDERS + 1):
            by = 2.0 * np.pi**2 * k**2 / step**2
            size = np.exp(-by * (self.white**2 - self.shaken**2))
            size = np.where(np.exp(by * self.shaken**2) <= _MOST, size, 0.0)
            found += (-1.0) ** k * step / (np.pi * k) * size * np.sin(k * phase)
        return np.where(self.quantum > 0.0, found, 0.0)

    def slope(self, shown: Array) -> Array:
        """By how much what a reading is expected to be grows with the channel, shape (rows, C): 1 for fine steps."""
        return 1.0 + (self.error(shown + _NEAR) - self.error(shown - _NEAR)) / (2.0 * _NEAR)

    def read(self, course: Array, random: np.random.Generator) -> Array:
        """Readings of channels at ``course`` (rows, C), with new noise."""
        step = np.where(self.quantum > 0.0, self.quantum, 1.0)
        noisy = course + self.white * random.standard_normal(course.shape)
        return np.where(self.quantum > 0.0, step * np.round((noisy - self.offset) / step) + self.offset, noisy)

    def taken_off(self, record: Record, error: Array) -> Record:
        """The record with an error, (rows, C), taken off its readings, and no steps of these channels any more."""
        facts = tuple(
            replace(fact, quantum=0.0) if own else fact
            for fact, own in zip(record.facts, self.quantum > 0.0, strict=True)
        )
        return replace(record, measured=record.measured - error, facts=facts)


def rounding_of(problem: Problem, point: Point) -> Rounding:
    """How coarse the channels are, by what is left at a point; records have the same channels."""
    model = problem.model
    shown = model.predict(point.z, problem.windows, point.states)
    quantum = np.min([rec.quantum for rec in model.records], axis=0)
    read, left = ([] for _ in range(2))
    for window, predicted in zip(problem.windows, shown, strict=True):
        rec, rows = model.records[window.record], slice(window.first, window.last)
        values = np.where(rec.usable[rows], rec.measured[rows], np.nan)
        read.append(values)
        left.append(values - predicted)
    measured, errors = np.concatenate(read), np.concatenate(left)
    shaken = _shaken(problem, point, shown) if np.any(quantum > 0.0) else np.zeros(len(quantum))
    size, offset = np.zeros(len(quantum)), np.zeros(len(quantum))
    for c, step in enumerate(quantum):
        own = errors[np.isfinite(errors[:, c]), c]
        size[c] = np.inf if step <= 0.0 or len(own) == 0 else _likeliest(own, float(step))
        if np.isfinite(size[c]):
            turned = np.exp(2j * np.pi * measured[np.isfinite(measured[:, c]), c] / step)
            offset[c] = step * np.angle(np.mean(turned)) / (2.0 * np.pi)
    kinds = [output.kind for output in model.records[0].observation.outputs]
    size = _of_sorts(size, [(kind, round(float(step), 12)) for kind, step in zip(kinds, quantum, strict=True)])
    coarse = size < COARSE * quantum
    white = np.where(coarse, np.sqrt(np.maximum(size**2 - shaken**2, (_LEAST * quantum) ** 2)), 0.0)
    return Rounding(np.where(coarse, quantum, 0.0), offset, white, np.where(coarse, shaken, 0.0))


def logarithm(e: Array, half: Array | float) -> Array:
    """Logarithm of the chance of a reading ``e`` deviations off, in steps of twice ``half`` deviations."""
    size = np.abs(e)
    near = log_ndtr(half - size)
    return np.asarray(near + np.log1p(-np.exp(log_ndtr(-half - size) - near)))


def _likeliest(errors: Array, step: float) -> float:
    """Deviation under which readings in steps are likeliest; far ones count as some steps off."""
    spread = float(np.median(np.abs(errors))) / 0.6745
    kept = np.clip(errors, -step - 4.0 * spread, step + 4.0 * spread)

    def loss(log_size: float) -> float:
        size = float(np.exp(log_size))
        return -float(np.sum(logarithm(kept / size, step / (2.0 * size))))

    bounds = (np.log(_LEAST * step), np.log(max(2.0 * spread, step)))
    return float(np.exp(minimize_scalar(loss, bounds=bounds, method="bounded", options={"xatol": 1e-3}).x))


def _of_sorts(size: Array, sorts: Sequence[object]) -> Array:
    """The median of each sort of channels, shape (C,)."""
    found = size.copy()
    for sort in set(sorts):
        own = np.array([other == sort for other in sorts])
        found[own] = np.median(size[own])
    return found


def _shaken(problem: Problem, point: Point, shown: Sequence[Array]) -> Array:
    """Root mean square of what redrawn noise of the pressures changes of the channels, shape (C,)."""
    squares = []
    for draw in range(_DRAWS):
        other = redrawn(problem.model, 0, draw).predict(point.z, problem.windows, point.states)
        squares += [np.mean(np.nan_to_num(b - a) ** 2, axis=0) for a, b in zip(shown, other, strict=True)]
    return np.asarray(np.sqrt(np.mean(squares, axis=0)))
