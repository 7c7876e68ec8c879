"""A fixed-interval smoother of several logs abreast, whose state ends with forces of first order and unknown size.

What: x_{k+1} = F_k x_k + c_k + G_k f_k + G'_k f_{k+1} + noise for the motion x, f_{k+1} = a f_k + noise for the forces
f, and rows y_k = H_k x_k + white noise. Mean and covariance of every row given all rows; the sizes of the forces and
their correlation time by expectation and maximization.
Source: Kalman 1960; backwards Bryson and Frazier 1963 (no covariance is inverted, so that states nobody disturbs do no
harm); covariance of neighbours de Jong 1989; sizes Shumway and Stoffer 1982, who give the steps for any linear system.
Limits: rows a constant time apart, as good as that; the order of logs does not matter, shorter ones end with rows
that were not read.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Least and greatest time over which forces change, over the distance of rows and over the longest log.
SHORTEST, LONGEST = 2.0, 0.5
#: Least size of a force, over the greatest of all: one that the rows do not need would shrink without end.
LEAST_SIZE = 1e-3


@dataclass(frozen=True)
class Motion:
    """The motion of L logs over K rows, and what is read of it; n states, m forces, C channels.

    Attributes:
        transitions: F of every step, shape (K - 1, L, n, n).
        offsets: c, shape (K - 1, L, n).
        now: G, by the forces at the step's start, shape (K - 1, L, n, m).
        later: G', by those at its end.
        added: covariance of what disturbs the motion beside the forces, shape (K - 1, L, n, n).
        shown: H of the motion, shape (K, L, C, n); zero where a channel was not read.
        read: y less what is constant, shape (K, L, C); zero where a channel was not read.
        noise: variance of every reading, shape (K, L, C); one where a channel was not read.
        start: mean of the first row's motion, shape (L, n).
        spread: standard deviation of it, shape (n,).
        step: between rows, s.
        lasts: rows of each log, shape (L,).
    """

    transitions: Array
    offsets: Array
    now: Array
    later: Array
    added: Array
    shown: Array
    read: Array
    noise: Array
    start: Array
    spread: Array
    step: float
    lasts: NDArray[np.intp]


@dataclass(frozen=True)
class Forces:
    """What is assumed of the forces: standard deviation of each, shape (m,), and their common correlation time, s."""

    sizes: Array
    time: float


@dataclass(frozen=True)
class Smoothed:
    """Motion and forces given all rows.

    Attributes:
        motion: mean, shape (K, L, n).
        forces: mean, shape (K, L, m).
        deviation: standard deviations of the forces, shape (K, L, m).
        mean_square: of the innovations over their variances: one where the noises are right.
        better: what the forces look like they are, from the same rows.
    """

    motion: Array
    forces: Array
    deviation: Array
    mean_square: float
    better: Forces


def smooth(motion: Motion, assumed: Forces) -> Smoothed:
    """Smooth, given sizes and time of the forces."""
    count, logs, channels, n = motion.shown.shape
    m = len(assumed.sizes)
    keep = float(np.exp(-motion.step / assumed.time))
    transition = np.zeros((count - 1, logs, n + m, n + m))
    transition[..., :n, :n], transition[..., :n, n:] = motion.transitions, motion.now + keep * motion.later
    transition[..., n:, n:] = keep * np.eye(m)
    # What is new of the forces is at work before the step's end already.
    new = np.concatenate([motion.later, np.broadcast_to(np.eye(m), (count - 1, logs, m, m))], axis=-2)
    new = new * (np.sqrt(1.0 - keep**2) * assumed.sizes)
    shown = np.concatenate([motion.shown, np.zeros((count, logs, channels, m))], axis=-1)
    mean = np.concatenate([motion.start, np.zeros((logs, m))], axis=-1)
    covariance = np.tile(np.diag(np.concatenate([motion.spread**2, assumed.sizes**2])), (logs, 1, 1))
    means = np.empty((count, logs, n + m))  # before each row is read
    covariances = np.empty((count, logs, n + m, n + m))
    weighted, errors = np.empty((count, logs, channels, n + m)), np.empty((count, logs, channels))
    squares, readings = 0.0, 0
    for k in range(count):
        means[k], covariances[k] = mean, covariance
        h = shown[k]
        seen = h @ covariance
        size = seen @ _turned(h)
        size[..., range(channels), range(channels)] += motion.noise[k]
        left = motion.read[k] - np.einsum("lcs,ls->lc", h, mean)
        solved = np.linalg.solve(size, np.concatenate([h, left[..., None], seen], axis=-1))
        weighted[k], errors[k] = solved[..., : n + m], solved[..., n + m]
        was_read = np.any(h != 0.0, axis=-1)
        squares += float(np.sum((left * errors[k])[was_read]))
        readings += int(np.count_nonzero(was_read))
        mean = mean + np.einsum("lcs,lc->ls", seen, errors[k])
        covariance = covariance - _turned(seen) @ solved[..., n + m + 1 :]
        if k + 1 < count:
            f = transition[k]
            mean = np.einsum("lst,lt->ls", f, mean)
            mean[:, :n] += motion.offsets[k]
            covariance = f @ covariance @ _turned(f) + new[k] @ _turned(new[k])
            covariance[:, :n, :n] += motion.added[k]
            covariance = 0.5 * (covariance + _turned(covariance))
    return _backwards(motion, assumed, (means, covariances, transition, shown, weighted, errors), squares / readings)


def _backwards(motion: Motion, assumed: Forces, forward: tuple[Array, ...], mean_square: float) -> Smoothed:
    means, covariances, transition, shown, weighted, errors = forward
    count, logs, _, size = shown.shape
    n, m = size - len(assumed.sizes), len(assumed.sizes)
    adjoint, information = np.zeros((logs, size)), np.zeros((logs, size, size))
    motions, forces, variances = np.empty((count, logs, n)), np.empty((count, logs, m)), np.empty((count, logs, m))
    # Second moments of forces: of a row, and of a row with the next.
    own, next_to = np.empty((count, logs, m)), np.zeros((count, logs, m))
    before = information
    for k in range(count - 1, -1, -1):
        after = before  # of the row after this one, before it was read
        h, p = shown[k], covariances[k]
        # C = I - K H, what a reading leaves of the state's deviation.
        left = np.eye(size) - (p @ _turned(h)) @ weighted[k]
        adjoint = np.einsum("lts,lt->ls", left, adjoint) - np.einsum("lcs,lc->ls", h, errors[k])
        before = _turned(left) @ information @ left + _turned(h) @ weighted[k]
        mean = means[k] - np.einsum("lst,lt->ls", p, adjoint)
        own_part = p[:, n:, :]
        motions[k], forces[k] = mean[:, :n], mean[:, n:]
        variances[k] = np.einsum("lii->li", p[:, n:, n:] - own_part @ before @ _turned(own_part))
        own[k] = forces[k] ** 2 + variances[k]
        if k + 1 < count:
            filtered = left @ p
            both = filtered[:, n:, :] @ _turned(transition[k]) @ (np.eye(size) - after @ covariances[k + 1])
            next_to[k] = forces[k] * forces[k + 1] + np.einsum("lii->li", both[:, :, n:])
        if k:
            f = transition[k - 1]
            adjoint = np.einsum("lts,lt->ls", f, adjoint)
            information = _turned(f) @ before @ f
    better = _sizes(motion, own, next_to, assumed)
    return Smoothed(motions, forces, np.sqrt(np.maximum(variances, 0.0)), mean_square, better)


def _turned(matrices: Array) -> Array:
    """The transpose of each matrix."""
    return matrices.swapaxes(-1, -2)


def _sizes(motion: Motion, own: Array, next_to: Array, assumed: Forces) -> Forces:
    """Sizes and time that make the second moments of the forces likeliest."""
    rows = np.arange(len(own))[:, None]
    inside, followed = rows < motion.lasts, rows < motion.lasts - 1
    weight = 1.0 / np.maximum(assumed.sizes**2, 1e-300)
    correlation = float(np.sum((next_to * followed[..., None]) @ weight) / np.sum((own * followed[..., None]) @ weight))
    longest = LONGEST * float(motion.lasts.max()) * motion.step
    low, high = np.exp(-1.0 / SHORTEST), np.exp(-motion.step / longest)
    time = -motion.step / float(np.log(np.clip(correlation, low, high)))
    sizes = np.sqrt(np.sum(own * inside[..., None], axis=(0, 1)) / inside.sum())
    return Forces(np.maximum(sizes, LEAST_SIZE * sizes.max()), time)
