"""An arm and a law near rest: what they are linearly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from bha.arm import Arm

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WorkingPoint:
    """An arm at rest and its linear model q'' = stiffness q + damping q' + input p in deviations.

    Attributes:
        lengths: (m,), m.
        pressures: (inputs,), Pa absolute.
        by_lengths: d q''/d q, (m, m), 1/s^2.
        by_rates: d q''/d q', (m, m), 1/s.
        by_pressures: d q''/d p, (m, inputs), m/(s^2 Pa).
        inertia: inertia matrix, (m, m), kg.
        pressures_by_force: pseudo-inverse of the actuation matrix, (inputs, m), Pa/N.
    """

    lengths: Floats
    pressures: Floats
    by_lengths: Floats
    by_rates: Floats
    by_pressures: Floats
    inertia: Floats
    pressures_by_force: Floats

    @classmethod
    def at(cls, arm: Arm, lengths: ArrayLike, pressures: ArrayLike) -> WorkingPoint:
        """Of ``arm`` at ``lengths`` (m,), m, under ``pressures`` (inputs,), Pa absolute."""
        q, p = np.asarray(lengths, dtype=np.float64), np.asarray(pressures, dtype=np.float64)
        m = len(q)
        a, b = arm.linearize(q, np.zeros(m), p)
        inverse = np.asarray(np.linalg.pinv(arm.actuation_matrix(q)), dtype=np.float64)
        return cls(q, p, a[m:, :m], a[m:, m:], b[m:], arm.inertia_matrix(q), inverse)

    @property
    def pressures_by_lengths(self) -> Floats:
        """Pressures that hold the arm at other lengths by the static model, (inputs, m), Pa/m."""
        return -self.pressures_by_force @ self.inertia @ self.by_lengths


@dataclass(frozen=True, eq=False)
class Feedback:
    """A law near a working point: p = -(proportional q + derivative q' + integral int q + disturbance d).

    In deviations from the reference, d the acceleration that the observer finds unexplained; each (inputs, m).
    """

    proportional: Floats
    derivative: Floats
    integral: Floats
    disturbance: Floats

    @classmethod
    def of(cls, proportional: Floats, derivative: Floats, integral: Floats | None = None) -> Feedback:
        """Without the rest, which is zero."""
        zero = np.zeros_like(proportional)
        return cls(proportional, derivative, zero if integral is None else integral, zero)


def mean_lengths(arm: Arm, *, weighted: bool = False) -> Floats:
    """Mean length of the bellows of each input as a linear map of the lengths, (inputs, 3n), a plain number.

    With ``weighted`` the sum of terminal area times length instead, m^2: volumes from lengths.
    """
    index = {name: k for k, name in enumerate(arm.inputs)}
    out, counts = np.zeros((len(index), 3 * arm.section_count)), np.zeros(len(index))
    places = 2 * np.pi / 3 * np.arange(3)
    for number, section in enumerate(arm.parameters.sections, start=1):
        for b in section.resolved_bellows(number):
            share = (1 + 2 * b.radius / section.bellows_radius * np.cos(b.angle - places)) / 3
            out[index[b.input], 3 * number - 3 : 3 * number] += share * (b.terminal_area if weighted else 1.0)
            counts[index[b.input]] += 1
    return out if weighted else out / np.maximum(counts, 1)[:, None]
