"""What is minimised: white residuals of windows over shared parameters and an initial state of each window, and priors.

The unknowns have the form of an arrow: every window has its own initial state and all share the parameters. The initial
states are therefore eliminated window by window (Schur complement), so that a hundred windows cost little more than
one. Priors hold what the data do not tell, and a Huber loss on residuals in units of their scale keeps outliers from
deciding. How residuals become white is the noise's matter (:mod:`bha.estimation.innovations`,
:mod:`bha.estimation.bands`); derivatives are whitened as residuals are.

Source: elimination as in bundle adjustment, Triggs et al. (2000), section 6.1.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bha.estimation.engine import Model, Near
from bha.estimation.innovations import Whitening
from bha.estimation.memories import DEVIATION as MEMORY_DEVIATION
from bha.estimation.records import Record, Window
from bha.estimation.steps import huber_loss

Array = NDArray[np.float64]

#: Residuals beyond this many scales count linearly, not squared (Huber).
HUBER = 3.0
#: Standard deviation of the prior on initial lengths about their guess, m: very wide.
LENGTH_DEVIATION = 0.02
#: Least and greatest standard deviation of the prior on initial rates, m/s. Between them it is what the log shows
#: (:func:`state_deviations`).
RATE_DEVIATIONS = (0.01, 0.5)


@dataclass(frozen=True)
class Residuals:
    """How predictions and measurements are compared.

    Attributes:
        scale: per record the scale of each channel's residuals, m, shape (C,).
        huber: Huber's constant in scales; infinite for plain least squares.
        whitening: what takes a window's residuals to white numbers: its innovations, or bands of frequency. Those of a
            window that has none are divided by their scale (output error under white noise).
        lasting: how many times more than noise that is another in each row counts what the model leaves, which lasts.
        pooled: whether what the model leaves counts alike in all channels of a kind and in all records.
    """

    scale: tuple[Array, ...]
    huber: float = HUBER
    whitening: Mapping[Window, Whitening] = field(default_factory=dict)
    lasting: float = 1.0
    pooled: bool = False

    def scaled(self, model: Model, window: Window, predicted: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Residuals in scales, shape (rows, C), zero where a measurement does not count, and which count."""
        rec = model.records[window.record]
        rows = slice(window.first, window.last)
        mask = rec.usable[rows]
        return self.white(window, np.where(mask, rec.measured[rows], 0.0) - predicted, mask), mask

    def white(self, window: Window, values: Array, mask: NDArray[np.bool_]) -> Array:
        """White numbers of residuals (rows, C), or of what is linear in them (rows, C, ...); zero where nothing counts.

        Their rows are those of the window, or as many as its whitening keeps.
        """
        kept = np.where(mask.reshape(*mask.shape, *[1] * (values.ndim - 2)), values, 0.0)
        if window in self.whitening:
            return self.whitening[window](kept)
        return np.asarray(kept / self.scale[window.record].reshape(-1, *[1] * (values.ndim - 2)))

    def cost(self, residuals: Array) -> float:
        """Sum of the loss; for plain least squares the sum of squares."""
        return huber_loss(residuals, self.huber)

    def weights(self, residuals: Array) -> Array:
        """Square roots of the weights that make the loss a sum of squares at this point."""
        with np.errstate(divide="ignore"):
            return np.sqrt(np.minimum(1.0, self.huber / np.abs(residuals)))


@dataclass(frozen=True)
class Point:
    """A point of the search.

    Attributes:
        z: coordinates of the parameters, shape (p,).
        states: initial states of the windows, shape (windows, 6n).
        cost: loss there, priors included.
        outputs: what the model shows there, per window (rows, C); None where it was not asked.
        left: white residuals, per window (r, C); None where it was not asked, or a simulation fails.
    """

    z: Array
    states: Array
    cost: float = np.inf
    outputs: tuple[Array, ...] | None = None
    left: tuple[Array, ...] | None = None


@dataclass(frozen=True)
class Block:
    """A window's linearization: weighed residuals (rows, C) and their derivatives by z (..., p) and state (..., 6n).

    ``weight`` are the square roots of the loss' weights, shape (rows, C).
    """

    residual: Array
    by_z: Array
    by_state: Array
    mask: NDArray[np.bool_]
    weight: Array


@dataclass(frozen=True)
class Normal:
    """Normal equations of one linearization, initial states kept apart window by window.

    Attributes:
        h: by the parameters, priors included, shape (p, p).
        g: right-hand side, shape (p,).
        h_state: by each window's initial state, shape (windows, 6n, 6n).
        g_state: right-hand sides, shape (windows, 6n).
        h_mixed: between the two, shape (windows, 6n, p).
        blocks: what they were made of, if asked for.
    """

    h: Array
    g: Array
    h_state: Array
    g_state: Array
    h_mixed: Array
    blocks: tuple[Block, ...] | None = None

    def reduced(self, damping: float = 0.0) -> tuple[Array, Array]:
        """Matrix and right-hand side for the parameters alone, initial states eliminated."""
        h = self.h + damping * np.diag(np.diag(self.h))
        h_state = self.h_state.copy()
        diagonal = np.arange(h_state.shape[1])
        h_state[:, diagonal, diagonal] *= 1.0 + damping
        gain = np.linalg.solve(h_state, self.h_mixed)
        return h - np.einsum("wsp,wsq->pq", self.h_mixed, gain), self.g - np.einsum("wsp,ws->p", gain, self.g_state)

    def after(self, dz: Array, states: Array) -> tuple[Array, Array]:
        """Right-hand sides once a step has been taken, were the model linear: shapes (p,) and (windows, 6n)."""
        g = self.g - self.h @ dz - np.einsum("wsp,ws->p", self.h_mixed, states)
        return g, self.g_state - self.h_mixed @ dz - np.einsum("wst,wt->ws", self.h_state, states)

    def promised(self, dz: Array, states: Array) -> float:
        """By how much the loss would fall with a step, were the model linear."""
        g, g_state = self.after(dz, states)
        return float((self.g + g) @ dz + np.sum((self.g_state + g_state) * states))

    def state_steps(self, dz: Array, damping: float = 0.0) -> Array:
        """Steps of the initial states that belong to a step of the parameters, shape (windows, 6n)."""
        h_state = self.h_state.copy()
        diagonal = np.arange(h_state.shape[1])
        h_state[:, diagonal, diagonal] *= 1.0 + damping
        steps = np.linalg.solve(h_state, (self.g_state - self.h_mixed @ dz)[..., None])[..., 0]
        return np.asarray(steps, dtype=np.float64)


@dataclass(frozen=True)
class Slopes:
    """White derivatives of a window by z, shape (r, C, p), and by its initial state, shape (r, C, 6n); not weighed."""

    by_z: Array
    by_state: Array


def flat(table: Array) -> Array:
    """Derivatives of white numbers, shape (r, C, k), one number after the other, shape (r C, k)."""
    return table.reshape(table.shape[0] * table.shape[1], table.shape[2])


@dataclass(frozen=True)
class Problem:
    """A model, windows of its records, how residuals are weighed, and the priors.

    Attributes:
        model: model and records.
        windows: the windows; a whole log is one.
        residuals: how residuals are weighed.
        guesses: guessed initial states, centre of their prior, shape (windows, 6n).
        prior: mean and standard deviation of the coordinates, each (p,); infinite deviations for none.
        deviations: standard deviations of the prior on initial lengths (m) and rates (m/s) about their guess.
        prior_weight: weight of the coordinates' prior against the loss.
        state_weight: weight of the initial states' prior.
    """

    model: Model
    windows: tuple[Window, ...]
    residuals: Residuals
    guesses: Array
    prior: tuple[Array, Array]
    deviations: tuple[float, float] = (LENGTH_DEVIATION, RATE_DEVIATIONS[1])
    prior_weight: float = 1.0
    state_weight: float = 1.0

    @property
    def state_deviation(self) -> Array:
        """Standard deviations of the prior on an initial state, shape (6n,)."""
        count = 3 * self.model.sections
        memories = np.full(self.guesses.shape[1] - 2 * count, MEMORY_DEVIATION)
        return np.concatenate([np.repeat(self.deviations, count), memories])

    @cached_property
    def precision(self) -> Array:
        """One over the variances of the coordinates' prior, as it is weighed, shape (p,)."""
        return np.asarray(self.prior_weight * self.prior[1] ** -2.0)

    @cached_property
    def state_precision(self) -> Array:
        """The same of an initial state, shape (6n,)."""
        return np.asarray(self.state_weight * self.state_deviation**-2.0)

    def evaluated(self, z: Array, states: Array) -> Point:
        """The point with its loss; infinite where a simulation fails."""
        outputs = tuple(self.model.predict(z, self.windows, states))
        return self.shown(Point(z, states, outputs=outputs))

    def shown(self, point: Point) -> Point:
        """A point whose outputs are known, with its residuals and its loss."""
        assert point.outputs is not None
        left = []
        for window, predicted in zip(self.windows, point.outputs, strict=True):
            residual, _ = self.residuals.scaled(self.model, window, predicted)
            if not np.all(np.isfinite(residual)):
                return replace(point, cost=np.inf, left=None)
            left.append(residual)
        return self.costed(replace(point, left=tuple(left)))

    def by_record(self, outputs: Sequence[Array]) -> list[Array]:
        """What is shown in the windows put together, per record (rows, C); NaN where no window is."""
        found = [np.full(rec.measured.shape, np.nan) for rec in self.model.records]
        for window, own in zip(self.windows, outputs, strict=True):
            found[window.record][window.first : window.last] = own
        return found

    def costed(self, point: Point) -> Point:
        """A point with its loss under these priors; infinite without residuals."""
        if point.left is None:
            return replace(point, cost=np.inf)
        loss = sum(self.residuals.cost(residual) for residual in point.left)
        return replace(point, cost=self._prior_cost(point.z, point.states) + loss)

    def there(self, normal: Normal, z: Array, states: Array) -> tuple[Point, Normal | None]:
        """A point, and ``normal`` with the descent direction of what is left there, its derivatives as they were."""
        point = self.evaluated(z, states)
        if point.left is None:
            return point, None
        assert normal.blocks is not None
        g, g_state = self._pull(point)
        for k, (block, residual) in enumerate(zip(normal.blocks, point.left, strict=True)):
            weighed = block.weight * residual
            g = g + np.einsum("tcp,tc->p", block.by_z, weighed)
            g_state[k] += np.einsum("tcs,tc->s", block.by_state, weighed)
        return point, replace(normal, g=g, g_state=g_state)

    def failing_window(self, z: Array, states: Array) -> Window | None:
        """The first window whose simulation fails, if any."""
        for window, predicted in zip(self.windows, self.model.predict(z, self.windows, states), strict=True):
            if not np.all(np.isfinite(predicted)):
                return window
        return None

    def slopes(
        self, point: Point, *, which: Sequence[int] | None = None, by_states: bool = True, near: Near | None = None
    ) -> Iterator[tuple[Array, Slopes]]:
        """What each window shows at a point, and its white derivatives; arguments as of :meth:`Model.linearize`."""
        linear = self.model.linearize(point.z, self.windows, point.states, which=which, by_states=by_states, near=near)
        for window, (predicted, by_z, by_state) in zip(self.windows, linear, strict=True):
            mask = self.model.records[window.record].usable[window.first : window.last]
            white = self.residuals.white(window, np.concatenate([by_z, by_state], axis=-1), mask)
            yield predicted, Slopes(white[..., : by_z.shape[-1]], white[..., by_z.shape[-1] :])

    def normal(self, point: Point, slopes: Sequence[Slopes] | None = None, *, keep: bool = False) -> Normal:
        """Normal equations at a point; of the gradients the descent direction, -1/2 of the loss' derivative.

        Args:
            point: where; with its residuals where ``slopes`` are given.
            slopes: white derivatives of the windows; those at the point if None.
            keep: whether the normal equations keep what they were made of.

        Raises:
            ConvergenceError: a simulation at the point fails.
        """
        blocks = []
        p, w, s = len(point.z), len(self.windows), self.guesses.shape[1]
        h = np.diag(self.precision)
        g, g_state = self._pull(point)
        h_state, h_mixed = np.empty((w, s, s)), np.empty((w, s, p))
        for k, (residual, mask, own) in enumerate(self._linear(point, slopes)):
            weight = self.residuals.weights(residual)
            by_z, by_state = own.by_z * weight[..., None], own.by_state * weight[..., None]
            block = Block(weight * residual, by_z, by_state, mask, weight)
            a, b, r = flat(by_z), flat(by_state), block.residual.ravel()
            h, g = h + a.T @ a, g + a.T @ r
            h_state[k] = b.T @ b + np.diag(self.state_precision)
            g_state[k] += b.T @ r
            h_mixed[k] = b.T @ a
            if keep:
                blocks.append(block)
        return Normal(h, g, h_state, g_state, h_mixed, tuple(blocks) if keep else None)

    def _linear(
        self, point: Point, slopes: Sequence[Slopes] | None
    ) -> Iterator[tuple[Array, NDArray[np.bool_], Slopes]]:
        """Residuals of each window, which of its readings count, and derivatives."""
        if slopes is None:
            for window, (predicted, own) in zip(self.windows, self.slopes(point), strict=True):
                residual, mask = self.residuals.scaled(self.model, window, predicted)
                yield residual, mask, own
            return
        assert point.left is not None
        for window, residual, own in zip(self.windows, point.left, slopes, strict=True):
            yield residual, self.model.records[window.record].usable[window.first : window.last], own

    def rescaled(self, residuals: Residuals) -> Problem:
        """The same problem with residuals weighed otherwise."""
        return replace(self, residuals=residuals)

    def _pull(self, point: Point) -> tuple[Array, Array]:
        """Descent direction of the priors, shapes (p,) and (windows, 6n)."""
        return self.precision * (self.prior[0] - point.z), self.state_precision * (self.guesses - point.states)

    def _prior_cost(self, z: Array, states: Array) -> float:
        return float(
            self.precision @ (z - self.prior[0]) ** 2 + np.sum(self.state_precision * (states - self.guesses) ** 2)
        )


def state_deviations(records: Sequence[Record]) -> tuple[float, float]:
    """Standard deviations of a window's initial lengths (m) and rates (m/s) about what was measured there.

    Rates are no others than those of the logs. In an arm whose damping outweighs its masses a free rate would be a
    jump of the lengths, over within milliseconds, that makes up for what the model lacks and is seen in no reading.
    """
    rates = [rec.rate for rec in records if np.isfinite(rec.rate)]
    return LENGTH_DEVIATION, float(np.clip(max(rates, default=np.inf), *RATE_DEVIATIONS))


def projected(parts: Sequence[slice], by_states: Sequence[Array], table: Array, precision: Array) -> Array:
    """White numbers on the complement of what initial states can do: these eliminated from a whole table at once.

    Args:
        parts: where the numbers of each window stand.
        by_states: white derivatives of each window by its initial state, shape (numbers, 6n).
        table: white numbers, or what is linear in them, shape (numbers in all, k).
        precision: of the prior of an initial state, shape (6n,).
    """
    result = table.copy()
    for part, own in zip(parts, by_states, strict=True):
        result[part] -= own @ np.linalg.solve(own.T @ own + np.diag(precision), own.T @ table[part])
    return result
