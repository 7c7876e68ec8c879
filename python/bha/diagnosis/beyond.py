"""Numbers of effects on the bound of nothing beyond which the logs ask to go: then it is not this kind.

What: a lag that fills at once and would have to fill before it is told, a damping that would have to drive. What an
effect leaves is asked, by its own signature, whether less than nothing of the number explains a part of it, and more
than the best of all candidates does by chance.
Source: the sign of a multiplier at a bound, Nocedal and Wright 2006, chapter 12.
Example: damping that acts one way only is a lag that vents slowly and fills at once, but for what such a lag leaves.
"""

from __future__ import annotations

from bha.diagnosis.given import Given
from bha.diagnosis.refit import Trial
from bha.diagnosis.screen import Screening, Signatures, score
from bha.diagnosis.search import Search
from bha.estimation.terms import number_of

Key = tuple[str, str]


def refute(given: Given, search: Search) -> None:
    """Drop effects of the best set that the logs ask for less than none of."""
    while wrong := less_than_none(given, search.best):
        key, number, share = wrong
        rest = tuple(other for other in search.best.key if other != key)
        smaller = search.fitted(rest) if rest else search.plain
        if smaller is None:
            return
        search.notes.append(
            f"dropped: {key[0]} at {key[1]} (less than no {number} would explain {100 * share:.0f} % of what it leaves)"
        )
        search.best = smaller


def less_than_none(given: Given, trial: Trial) -> tuple[Key, str, float] | None:
    """The effect of a trial that the logs ask for less than none of, by which number, and the share that brings."""
    model = trial.fit.model
    screening: Screening | None = None
    for index, candidate in enumerate(trial.candidates):
        term, x = model.effects[index], trial.fit.x[model.place(index)]
        none = {number_of(c) for c, v in zip(term.coordinates, x, strict=True) if c.value(float(v)) <= c.lower}
        for strength, number in enumerate(candidate.plan.one_sided_numbers):
            if number not in none or trial.fit.jacobian is None:
                continue
            screening = screening or score(given.problem, trial.fit, given.signatures)
            gained = _gained(screening, given.signatures, candidate.key, strength)
            share = gained / max(screening.total, 1e-300)
            if share >= given.rules.element and screening.chance(gained) <= given.rules.chance:
                return candidate.key, number, share
    return None


def _gained(screening: Screening, signatures: Signatures, key: Key, strength: int) -> float:
    """Greatest drop of the sum of squares by a negative strength of a kind in a place, over its shapes."""
    most = 0.0
    for candidate, columns in zip(signatures.candidates, signatures.columns, strict=True):
        if candidate.key == key and strength < len(columns):
            own = list(columns[strength])
            right, normal = float(screening.inner[own].sum()), float(screening.gram[own][:, own].sum())
            if right < 0.0 < normal:
                most = max(most, right**2 / normal)
    return most
