"""Do errors follow what was logged? A regression judged on pieces of time apart, and by what chance brings.

What: for each bank of regressors (:mod:`bha.diagnosis.logged`) a ridge regression of the errors, fitted to all pieces
of time but one and what lies beside it, and the share of the errors' square that it predicts of that piece; once as the
errors are, once with their common spectrum made flat, as least squares want them: below a slow disturbance a small
effect at the pace of the motion shows only then.
Chance: the same of draws that have the memory of the errors, over time and channels (:mod:`bha.diagnosis.memory`),
follow nothing, and are fitted as the errors were (:mod:`bha.diagnosis.absorbed`). The statistic is the greatest share
over all banks, in standard deviations of what draws have in that bank, so that one p-value stands for all of them.
Source: generalized least squares; cross-validation by blocks (Burman, Chow and Nolan 1994); surrogates of the same
spectrum (Theiler et al. 1992).
Limits: errors that are stationary. What is true only of some pieces is not predicted from the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.absorbed import Absorption
from bha.diagnosis.logged import Cells
from bha.diagnosis.memory import Memory, memory
from bha.estimation.bands import by_frequency, frequencies

Array = NDArray[np.float64]

#: Pieces of time into which all logs are cut, and what lies beside one and takes no part in its prediction, s.
PIECES, BESIDE = 8, 2.5
#: Fewest cells of a piece.
FEWEST_CELLS = 4
#: Weights of the ridge, in rows; the best one counts, for draws as well.
WEIGHTS = tuple(np.geomspace(1e-3, 1e2, 6))
#: Draws for the chance, and the share of them that grow by less than what chance still brings.
DRAWS, GROWN = 399, 0.95
#: Least density, over the greatest one, that is made flat.
LEAST_DENSITY = 1e-3


@dataclass(frozen=True)
class Follows:
    """What errors follow.

    Attributes:
        share: of their square, about the mean of each log, that the best bank predicts on pieces apart; not below 0.
        chance: how often errors that follow nothing seem to follow some bank as clearly, p-value over all banks.
        bank: the bank that they follow most clearly.
        usual: the share that errors have which follow nothing, in half of the draws.
        grown: by how much errors that follow nothing grow from the logs of a fit to those held out, in one of twenty.
    """

    share: float
    chance: float
    bank: str
    usual: float = 0.0
    grown: float = 1.0


def follows(cells: Sequence[Cells], seed: int = 0, bent: Absorption | None = None) -> Follows | None:
    """What the errors in the cells of logs follow; None where they are too few, or none.

    Args:
        cells: of each log.
        seed: of the draws.
        bent: what a fit makes of errors; they are taken as they are if None.
    """
    lengths, steps = [len(own.errors) for own in cells], [own.step for own in cells]
    rows = sum(lengths)
    errors = np.concatenate([own.errors for own in cells]) if cells else np.empty((0, 0))
    if rows < FEWEST_CELLS * PIECES or not np.any(errors):
        return None
    parts = [own.errors for own in cells]
    remembered = _without_means(memory(parts, steps), lengths, steps)
    drawn = _draws(remembered, parts, steps, np.random.default_rng([seed, 31]))
    if bent is not None:
        drawn = bent.left(drawn)
    both = np.concatenate([errors[:, None, :], drawn], axis=1)
    flat = _flattened(both.reshape(rows, -1), remembered, lengths, steps, errors).reshape(both.shape)
    pieces = pieces_of(lengths)
    beside = round(BESIDE / float(np.median(steps)))
    names: list[str] = []
    shares: list[Array] = []
    for name in cells[0].banks:
        regressors = np.concatenate([own.banks[name] for own in cells])
        for whole, table in (
            (both, regressors),
            (flat, _flattened(regressors, remembered, lengths, steps, errors)),
        ):
            predicted = predicted_shares(whole, table, pieces, beside)
            if predicted is not None:
                names.append(name)
                shares.append(predicted)
    if not shares:
        return None
    table = np.array(shares)
    clear = (table - table[:, 1:].mean(axis=1, keepdims=True)) / table[:, 1:].std(axis=1, keepdims=True)
    greatest = clear.max(axis=0)
    chance = (1.0 + float(np.sum(greatest[1:] >= greatest[0]))) / (1.0 + DRAWS)
    share, bank = max(0.0, float(table[:, 0].max())), names[int(np.argmax(clear[:, 0]))]
    grown = 1.0 if bent is None else float(np.quantile(bent.grown(drawn), GROWN))
    return Follows(share, chance, bank, float(np.median(table[:, 1:].max(axis=0))), grown)


def pieces_of(lengths: Sequence[int]) -> NDArray[np.intp]:
    """Which piece of time each cell belongs to, logs one after the other; no piece is of two logs."""
    rows, found = sum(lengths), [np.empty(0, dtype=np.intp)]
    first = 0
    for length in lengths:
        count = max(1, round(PIECES * length / rows))
        found.append(first + np.arange(length) * count // length)
        first += count
    return np.concatenate(found)


def predicted_shares(errors: Array, regressors: Array, pieces: NDArray[np.intp], beside: int) -> Array | None:
    """Share of the square of each of some errors that regressors predict on pieces that took no part in their fit.

    Args:
        errors: shape (g, draws, C).
        regressors: shape (g, F).
        pieces: the piece of each row, shape (g,).
        beside: rows beside a piece that take no part either: what lies between neighbours would be interpolated.

    Returns:
        Shares, shape (draws,); None where a piece leaves next to nothing, or regressors are none.
    """
    size = np.sqrt(np.mean(regressors**2, axis=0))
    scaled = regressors[:, size > 0.0] / size[size > 0.0]
    count = int(pieces[-1]) + 1
    if not scaled.size or count < 2:
        return None
    flat = errors.reshape(len(errors), -1)
    left = np.zeros((len(WEIGHTS), errors.shape[1]))
    for k in range(count):
        out = pieces == k
        apart = ~np.convolve(out, np.ones(2 * beside + 1), "same").astype(bool)
        if apart.sum() < PIECES:
            return None
        along, shown, squares = _axes(scaled[apart], scaled[out], flat[apart])
        for w, weight in enumerate(WEIGHTS):
            rest = flat[out] - shown @ (along / (squares + weight * apart.sum())[:, None])
            left[w] += np.sum(rest.reshape(-1, *errors.shape[1:]) ** 2, axis=(0, 2))
    return np.asarray(1.0 - left.min(axis=0) / np.sum(errors**2, axis=(0, 2)))


def _axes(fitted: Array, other: Array, errors: Array) -> tuple[Array, Array, Array]:
    """Errors (g, E) along the axes of regressors (g, F), what other rows (h, F) show of these, and their squares."""
    if fitted.shape[0] < fitted.shape[1]:
        squares, axes = np.linalg.eigh(fitted @ fitted.T)
        return axes.T @ errors, other @ (fitted.T @ axes), np.maximum(squares, 0.0)
    squares, axes = np.linalg.eigh(fitted.T @ fitted)
    return axes.T @ (fitted.T @ errors), other @ axes, np.maximum(squares, 0.0)


def _without_means(remembered: Memory, lengths: Sequence[int], steps: Sequence[float]) -> Memory:
    """The memory with the lowest band as its other coefficients have it: the means of the logs are none of them."""
    counts = [np.sum(frequencies(n, step) < remembered.edges[0]) for n, step in zip(lengths, steps, strict=True)]
    others = sum(counts) - len(counts)
    covariance = remembered.covariance.copy()
    covariance[0] *= sum(counts) / others if others else 1.0
    return replace(remembered, covariance=covariance)


def _draws(remembered: Memory, parts: Sequence[Array], steps: Sequence[float], rng: np.random.Generator) -> Array:
    """Errors with that memory which follow nothing, about their mean in each log, shape (g, DRAWS, C)."""
    table = remembered.draws([len(part) for part in parts], steps, DRAWS, rng)
    edges = np.cumsum([part.size for part in parts])[:-1]
    logs = [log.reshape(-1, parts[0].shape[1], DRAWS).transpose(0, 2, 1) for log in np.split(table, edges)]
    return np.concatenate([log - log.mean(axis=0) for log in logs])


def _flattened(
    table: Array, remembered: Memory, lengths: Sequence[int], steps: Sequence[float], errors: Array
) -> Array:
    """Columns (g, K) with the spectrum that the errors have, on the mean over their channels, taken off."""
    sizes = np.maximum(np.mean(errors**2, axis=0), 1e-300)
    density = np.einsum("bii,i->b", remembered.covariance, 1.0 / sizes)
    gain = 1.0 / np.sqrt(np.maximum(density, LEAST_DENSITY * density.max()))
    found, first = [], 0
    for length, step in zip(lengths, steps, strict=True):
        band = np.searchsorted(remembered.edges, frequencies(length, step), side="right")
        found.append(by_frequency(table[first : first + length], gain[band][:, None]))
        first += length
    return np.concatenate(found)
