"""The innovations of a window: what is left of its residuals once everything before them has been used.

A right model errs by more than white noise of the sensors: pressures that are in no log move the arm, and sensors may
have colour. Both are first-order processes (Ornstein and Uhlenbeck 1930), and near a pose the arm answers linearly, so
that residuals are the output of a linear system

    d = (deviation of lengths and rates, unlogged pressures, coloured part of the sensors),    r = H d + white noise,

and Kalman's filter takes them to innovations: white, with variance one once divided by their own size. That is the
prediction error of the model in innovation form to first order in what disturbs it, and exactly the Gaussian likelihood
of the residuals (Ljung 1999, chapters 4 and 7; Schweppe 1965). Where nothing disturbs the gain is 0, and innovations
are residuals in units of the sensors' noise: output error.

The filter is linear in the residuals, so that derivatives are filtered as residuals are: with gains that depend on
nothing but times, masks and the sizes of the noises. They are those of the whole transient, and constant from where
they have become so. What is not read is left out, row by row and channel by channel.

An arm answers otherwise in every pose: rows have the linear model of the nearest of some poses along the window.
Limits: what disturbs is small, and alike in all poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_continuous_lyapunov

from bha import _core
from bha.errors import ConvergenceError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Times between rows are equal if they differ by less than this, s.
_SAME_TIME = 1e-7
#: The slowest decay that a state of an arm is taken to have, 1/s: one near the edge of stability has no own variance.
_SLOWEST = 0.05


class Whitening(Protocol):
    """Takes the residuals of a window, and what is linear in them, to numbers that a right model leaves white."""

    def __call__(self, values: Array) -> Array:
        """White rows of ``values`` (rows, C, ...), zero where nothing was read: as many rows, or fewer, (r, C, ...)."""
        ...


@dataclass(frozen=True)
class Disturbed:
    """The linear system whose output are the residuals of a window.

    Attributes:
        state: d' = state d + driving, shape (s, s), 1/s.
        driving: intensity of the white noise that drives d, shape (s, s).
        shown: residuals that a state shows, shape (C, s).
        white: variance of the white noise of each channel, shape (C,).
        lengths: states that are forgotten with the way that a channel goes instead of with time, by the length over
            which they are; infinite for the others, shape (s,).
        channels: the channel whose way that is, shape (s,).
        sizes: variance of such states, shape (s,).
    """

    state: Array
    driving: Array
    shown: Array
    white: Array
    lengths: Array
    channels: NDArray[np.int64]
    sizes: Array

    @cached_property
    def stationary(self) -> Array:
        """Covariance of a state about which nothing has been read, shape (s, s)."""
        rates = np.linalg.eigvals(self.state).real
        # What does not die out has no stationary size: it is given one by a slow decay of all.
        shift = max(0.0, float(rates.max(initial=-np.inf)) + _SLOWEST)
        stable = self.state - shift * np.eye(len(self.state))
        covariance = solve_continuous_lyapunov(stable, -self.driving) if len(stable) else stable
        return np.asarray(0.5 * (covariance + covariance.T) + np.diag(self.sizes))

    def over(self, seconds: float) -> tuple[Array, Array]:
        """Transition and covariance of what is added over a time, s (Van Loan 1978).

        Over a part of it that is short beside the fastest mode, then doubled: over all of it the exponential of a mode
        that dies out within it a thousand times, as in a stiff arm, turned round in time, is beyond all numbers.
        """
        count = len(self.state)
        fastest = float(np.linalg.norm(self.state, 2)) * seconds if count else 0.0
        doublings = max(0, int(np.ceil(np.log2(max(fastest, 1.0)))))
        short = seconds / 2.0**doublings
        block = np.zeros((2 * count, 2 * count))
        block[:count, :count] = -self.state * short
        block[:count, count:] = self.driving * short
        block[count:, count:] = self.state.T * short
        exponential = expm(block)
        transition = exponential[count:, count:].T
        added = transition @ exponential[:count, count:]
        for _ in range(doublings):
            added = added + transition @ added @ transition.T
            transition = transition @ transition
        return transition, 0.5 * (added + added.T)


class Innovations:
    """The filter of one window."""

    def __init__(
        self,
        systems: Sequence[Disturbed],
        places: NDArray[np.intp],
        time: Array,
        mask: Mask,
        ways: Array,
    ) -> None:
        """Prepare the filter.

        Args:
            systems: what makes the residuals, one for each pose; alike but in ``state``, ``driving`` and ``shown``.
            places: the system of each row, shape (rows,).
            time: of the rows, s, shape (rows,).
            mask: which channels were read, shape (rows, C).
            ways: how far each channel has gone since the first row, shape (rows, C).
        """
        self._systems, self._mask = tuple(systems), mask
        self._rows = np.flatnonzero(mask.any(axis=1))
        self._places = places[self._rows]
        self._steps = np.round(np.diff(time[self._rows], append=np.nan) / _SAME_TIME)
        # The last row leads nowhere.
        self._steps[-1:] = self._steps[-2:-1] if len(self._rows) > 1 else 1.0
        self._ways = ways[self._rows]

    @cached_property
    def _kinds(self) -> tuple[list[int], Array, Array, Array]:
        """Kind of each row, and transitions, what is added over them and what is shown, kind by kind."""
        pairs, kinds = np.unique(np.column_stack([self._places, self._steps]), axis=0, return_inverse=True)
        systems = [self._systems[int(place)] for place, _ in pairs]
        over = [system.over(float(step) * _SAME_TIME) for system, (_, step) in zip(systems, pairs, strict=True)]
        transitions, added = (np.stack([pair[k] for pair in over]).reshape(len(pairs), -1) for k in (0, 1))
        shown = np.stack([system.shown for system in systems]).reshape(len(pairs), -1)
        return kinds.ravel().tolist(), transitions, added, shown

    @cached_property
    def _kept(self) -> Array:
        """What is kept of each state from row to row, shape (rows read, s)."""
        system = self._systems[0]
        kept = np.ones((len(self._rows), len(system.state)))
        forgotten = np.flatnonzero(np.isfinite(system.lengths))
        gone = np.diff(self._ways[:, system.channels[forgotten]], axis=0)
        kept[:-1, forgotten] = np.exp(-np.abs(gone) / system.lengths[forgotten])
        return kept

    def __call__(self, values: Array) -> Array:
        """White rows of residuals or of what is linear in them, shape (rows, C, ...)."""
        return self.judged(values)[0]

    def judged(self, values: Array) -> tuple[Array, float]:
        """The same, and the logarithm of the determinant of the residuals' covariance.

        Raises:
            ConvergenceError: that is not positive.
        """
        if not np.all(np.isfinite(values)):
            # A simulation that failed: nothing to judge, and said by what comes back.
            return np.full_like(values, np.nan), np.nan
        system, read = self._systems[0], self._mask[self._rows]
        found = np.zeros_like(values)
        if not len(system.state) or not len(self._rows):
            sizes = np.where(self._mask, np.sqrt(system.white), np.inf)
            white = values / sizes.reshape(*sizes.shape, *[1] * (values.ndim - 2))
            return white, float(2.0 * np.sum(np.log(sizes[self._mask])))
        kinds, transitions, added, shown = self._kinds
        first = self._systems[int(self._places[0])]
        rows = values[self._rows].reshape(len(self._rows), -1)
        judged = _core.innovations(
            transitions,
            added,
            kinds,
            self._kept,
            system.sizes,
            shown,
            system.white,
            read.ravel().tolist(),
            first.stationary.ravel(),
            rows,
        )
        if judged is None:
            raise ConvergenceError("the covariance of what a fit leaves is not positive")
        found[self._rows] = judged[0].reshape(len(self._rows), *values.shape[1:])
        return found, judged[1]
