"""Which pieces of an excitation to measure after a fit: those that tell what it could not.

Pieces are chosen one after the other (Fedorov's exchange without its second half): each time the one that lowers most
the sum of variances along the directions that are not told, given all information so far; once everything is told, the
one that raises the information on all of them most. What no pressures tell (a scale of all forces) shows by a second
question: how much would the same log tell with a known mass on the last head?
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bha.identification.identifiability import UNKNOWN

Array = NDArray[np.float64]

#: Length of a piece, s, and how many there are at the most.
_LENGTH, _MOST = 5.0, 8
#: Deviation that something of which nothing is known counts with.
_FLAT = 100.0


def count_of(duration: float) -> int:
    """How many pieces a log of this duration has."""
    return int(np.clip(round(duration / _LENGTH), 1, _MOST))


def chosen(known: Array, kinds: Sequence[str], tells: Callable[[str], Array], count: int) -> list[str]:
    """The kinds of pieces that tell most of what ``known`` does not.

    Args:
        known: information so far on the coordinates, shape (p, p).
        kinds: candidates, of :data:`bha.estimation.programme.EVERY_KIND`.
        tells: information of a piece.
        count: how many are chosen; one may be chosen again.
    """
    offers = [tells(kind) for kind in kinds]
    untold = _tellable(untold_directions(known), np.asarray(count * np.mean(offers, axis=0)))
    total = known
    found: list[str] = []
    for _ in range(count):
        merits = [_merit(total + offer, untold) for offer in offers]
        best = int(np.argmin(merits))
        found.append(kinds[best])
        total = total + offers[best]
    return found


def untold_directions(known: Array) -> Array:
    """Unit vectors along which the deviation exceeds what counts as known, shape (p, k)."""
    values, vectors = np.linalg.eigh(known)
    return np.asarray(vectors[:, values < UNKNOWN**-2.0])


def _tellable(untold: Array, offered: Array) -> Array:
    """Those of the untold directions that a log of all candidates would tell: rounding must not choose for the rest."""
    values, vectors = np.linalg.eigh(untold.T @ offered @ untold)
    return np.asarray(untold @ vectors[:, values > UNKNOWN**-2.0])


def _merit(total: Array, untold: Array) -> float:
    """The smaller, the better."""
    regular = total + _FLAT**-2.0 * np.eye(len(total))
    if untold.shape[1]:
        spread = np.linalg.solve(regular, untold)
        variance = float(np.sum(untold * spread))
        if variance > untold.shape[1] * UNKNOWN**2:
            return variance
    # All is told: the volume of what is left, shifted so that it is smaller than any variance above.
    return -1e6 - float(np.linalg.slogdet(regular)[1])
