"""Which parameters, and combinations of them, the data cannot tell: from the Fisher information's small eigenvalues.

The information is that on the coordinates z of ``bha.estimation.free``, so that an eigenvector with two entries of
equal sign on a logarithmic scale says that raising both numbers by the same factor changes nothing that was measured:
only their ratio is known. Opposite signs: only their product.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.estimation.free import Coordinate
from bha.identification.words import joined, spoken
from bha.support.shown import short_repr

Array = NDArray[np.float64]

#: A direction known worse than this (in z: 50 % of a value, or half its typical scale) is not identified.
UNKNOWN = 0.5
#: Entries of an eigenvector below this part of its largest do not belong to the combination.
_MEMBER = 0.25


@short_repr
@dataclass(frozen=True)
class Combination:
    """A direction of the parameters that the data do not tell.

    Attributes:
        text: what it means.
        names: the parameters in it, those that weigh most first.
        direction: unit vector in z, shape (p,).
        deviation: standard deviation along it, from the data alone; may be infinite.
    """

    text: str
    names: tuple[str, ...]
    direction: Array
    deviation: float


def unknown_combinations(
    coordinates: Sequence[Coordinate], information: Array, inflation: float = 1.0, *, threshold: float = UNKNOWN
) -> tuple[Combination, ...]:
    """The combinations whose standard deviation exceeds ``threshold``, the worst first.

    Args:
        coordinates: the free parameters.
        information: Fisher information on z without priors, shape (p, p).
        inflation: how much larger variances are than the inverse of the information, for residuals that are not white.
        threshold: largest standard deviation of a combination that counts as known.
    """
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        # What rounding makes negative carries no information.
        deviation = float(np.sqrt(inflation / value)) if value > 1e-12 * values[-1] else float("inf")
        if deviation > threshold:
            found.append(_combination(coordinates, vector, deviation))
    return tuple(found)


def _combination(coordinates: Sequence[Coordinate], vector: Array, deviation: float) -> Combination:
    order = np.argsort(-np.abs(vector))
    members = [int(k) for k in order if abs(vector[k]) >= _MEMBER * abs(vector[order[0]])]
    vector = vector * np.sign(vector[members[0]])
    some = [coordinates[k] for k in members]
    names = [_name(c) for c in some]
    logarithmic = all(c.logarithmic for c in some)
    if len(members) == 1:
        text = f"{names[0]}: not told by these data"
    elif logarithmic and len(members) == 2 and abs(vector[members[1]]) / vector[members[0]] > 0.5:
        what = "ratio" if vector[members[1]] > 0 else "product"
        text = f"{joined(names)}: only their {what}"
    elif logarithmic and all(vector[k] > 0.5 * vector[members[0]] for k in members):
        text = f"{joined(names)}: only their ratios"
    else:
        changes = [
            f"{n} by {_change(c, vector[k] / vector[members[0]])}" for n, c, k in zip(names, some, members, strict=True)
        ]
        text = f"{joined(names)}: not all of them; changing {joined(changes)} together leaves no trace"
    return Combination(text, tuple(c.name for c in some), vector, deviation)


def _name(coordinate: Coordinate) -> str:
    words = spoken(coordinate.path)
    return f"{words} ({', '.join(coordinate.sessions)})" if coordinate.sessions else words


def _change(coordinate: Coordinate, share: float) -> str:
    """A tenth of the leading member's change, as this member's part of it."""
    if coordinate.logarithmic:
        return f"{10.0 * share:+.2g} %"
    return f"{0.1 * share * coordinate.scale:+.2g} {coordinate.unit}".rstrip()
