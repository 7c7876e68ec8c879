"""Drop what helps to predict no left-out log, or may be there by chance; at last, what the held-out logs refute.

The former at each forward step would refuse a true first effect while others are still missing, so it comes after.
A further name has to answer a gap of its own, as the first one does: where the others, fitted again without it, miss
left-out logs by hardly more, it mends their form, and is no cause.
"""

from __future__ import annotations

import math

from bha.diagnosis.abreast import abreast
from bha.diagnosis.crossing import crossed, share_of_excess
from bha.diagnosis.given import Given
from bha.diagnosis.holdout import share_brought
from bha.diagnosis.refit import Trial, evaluated_without, without
from bha.diagnosis.rules import Rules
from bha.diagnosis.screen import score
from bha.diagnosis.search import Search, by_chance, gain


def prune(given: Given, search: Search) -> None:
    """Drop effects, the least needed first, until all are needed.

    Where the rest of the logs tells the numbers too little to predict what is left out, that says nothing of names:
    then the held-out logs have to confirm them.
    """
    problem, rules, trust = given.problem, given.rules, search.plain.fit.trust
    if not search.best.candidates:
        return
    plain = crossed(problem, search.plain.fit, trust)
    search.doubtful.clear()
    while search.best.candidates:
        current = search.best
        own = crossed(problem, current.fit, trust)
        is_told = own < rules.told * current.fit.squares / problem.rows
        weakest: tuple[float, Trial, str] | None = None
        for key, smaller in _each_without(given, search).items():
            less = crossed(problem, smaller.fit, trust)
            share = share_of_excess(plain, less, own)
            # An element of an effect that stays answers for what the effect does.
            beside = bool(smaller.candidates) and key not in smaller.key
            fails = _missed(rules, share, less, own, beside=beside) if is_told else ""
            if not fails:
                known = search.screening if smaller is search.plain else None
                chance = (known or score(problem, smaller.fit, given.signatures)).chance(gain(smaller, current))
                fails = by_chance(chance) if chance > (rules.enter if is_told else rules.chance) else ""
                if rules.chance < chance or not is_told:
                    search.doubtful[key] = chance
            if fails and (weakest is None or share < weakest[0]):
                weakest = (share, smaller, f"dropped: {key[0]} at {key[1]} ({fails})")
        if weakest is None:
            return
        search.best = weakest[1]
        search.notes.append(weakest[2])


def _missed(rules: Rules, share: float, less: float, own: float, *, beside: bool) -> str:
    """Why left-out logs speak against an effect, by their mean squares; empty where they do not.

    Args:
        rules: of the search.
        share: of the plain model's excess that the effect removes.
        less: under the set without the effect.
        own: under the set.
        beside: whether others are left without it: what they miss then is the excess.
    """
    if not beside:
        return f"removes {100 * share:.1f} % of the excess on left-out training logs" if share < rules.share else ""
    if less - own >= rules.enough(less, 1.0):
        return ""
    times = math.sqrt(less / own)
    return f"left-out training logs are missed by {times:.2f} times as much without it, which is no gap"


def certify(given: Given, search: Search) -> None:
    """Drop effects without which the held-out logs are predicted better, and doubtful ones that they do not confirm.

    Held-out logs add no name and choose between none: they refute.
    """
    plain, rules = search.plain.prediction, given.rules
    while search.best.candidates:
        if search.whole is not search.best:
            _each_without(given, search)
        failing: list[tuple[float, tuple[str, str], str]] = []
        for key, smaller in search.smaller.items():
            share = share_brought(plain, smaller.prediction, search.best.prediction, given.noise)
            if key in search.doubtful and share < rules.confirmed:
                failing.append((share, key, by_chance(search.doubtful[key])))
            elif share < 0.0 and len(search.best.candidates) > 1:
                failing.append((share, key, "held-out logs are predicted better without it"))
        if not failing:
            return
        _, key, why = min(failing)
        search.best = search.smaller[key]
        search.notes.append(f"dropped: {key[0]} at {key[1]} ({why})")


def _each_without(given: Given, search: Search) -> dict[tuple[str, str], Trial]:
    """The best set refitted without each of its effects, which the search keeps."""
    current = search.whole = search.best
    keys = current.key

    def refitted(k: int) -> Trial | None:
        rest = tuple(key for number, key in enumerate(keys) if number != k)
        if not rest:
            return search.plain
        known = search.fitted(rest)
        # An earlier round may have ended in another valley than the set, which with nothing refitted is better.
        if known is not None and evaluated_without(given, current, k).cost >= known.fit.cost:
            return known
        return without(given, current, k)

    def say(k: int) -> None:
        given.say(f"pruning: without {keys[k][0]} at {keys[k][1]}")

    found = zip(keys, abreast(given.problem, refitted, range(len(keys)), say), strict=True)
    search.smaller = {key: smaller for key, smaller in found if smaller is not None}
    return search.smaller
