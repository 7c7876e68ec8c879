"""Who else does as well: other places of what does alike, and where many kinds do alike, other kinds.

Scores are taken about the plain fit, whose numbers have made up for what is missing. Where little is logged they make
up for so much that the right effect may promise nothing, and do as well as any once it is fitted. Of a rich log that
does not happen, and nobody is asked. A class of the three that were tried by chance would be a wrong name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from bha.diagnosis.abreast import abreast
from bha.diagnosis.given import Given
from bha.diagnosis.refit import Trial, added, bic, correlation_length, without
from bha.diagnosis.screen import Scored, score
from bha.diagnosis.search import Search

Key = tuple[str, str]


def complete(given: Given, search: Search) -> None:
    """Refit those that were not tried, the likeliest first, in the place of each effect that is one of several."""
    best = search.best
    if len(set(best.key)) < len(best.key):
        return
    limit = _criterion(given, search, best) + given.rules.even
    for number in range(len(best.key)):
        _complete(given, search, number, limit)


def _complete(given: Given, search: Search, number: int, limit: float) -> None:
    best, rules = search.best, given.rules
    even = {key for key, least in _rivals(given, search, number).items() if least < limit}
    if not even:
        return
    kinds = {kind for kind, _ in even} | {best.key[number][0]}
    start = _beside(given, search, number)
    if start is None:
        return
    alone = start is search.plain
    ranking = (
        search.screening if alone and search.screening else score(given.problem, start.fit, given.signatures)
    ).ranking
    found: list[Trial] = []
    if len(kinds) >= rules.crowd:
        found = _refitted(given, search, start, _next(ranking, _known(given, search, number), (), 1, rules.company))
        kinds = {t.key[-1][0] for t in found if _criterion(given, search, t) < limit}
    if kinds:
        # Of those that do as well other places are asked.
        others = _next(ranking, _known(given, search, number), kinds, rules.per_kind + 1, rules.company // 2)
        found += _refitted(given, search, start, others)
    alike = [f"{t.key[-1][0]} at {t.key[-1][1]}" for t in found if _criterion(given, search, t) < limit]
    if alike:
        kind, where = best.key[number]
        search.notes.append(f"as good as {kind} at {where}, though their scores promised little: {', '.join(alike)}")


def _criterion(given: Given, search: Search, trial: Trial) -> float:
    return bic(trial, given.problem, correlation_length(given.problem, search.best.fit.residual))


def _rivals(given: Given, search: Search, number: int) -> dict[Key, float]:
    """The least criterion of each effect that was tried in the place of one of the best set, the others being there."""
    own = search.best.key
    rest = Counter(own[:number] + own[number + 1 :])
    found: dict[Key, float] = {}
    for trial in search.trials:
        more = Counter(trial.key) - rest
        if len(trial.key) == len(own) and more.total() == 1 and (key := next(iter(more))) != own[number]:
            found[key] = min(found.get(key, float("inf")), _criterion(given, search, trial))
    return found


def _known(given: Given, search: Search, number: int) -> set[Key]:
    return {*_rivals(given, search, number), *search.best.key}


def _beside(given: Given, search: Search, number: int) -> Trial | None:
    """The best set without one of its effects, with its sensitivities; None if it diverges."""
    best = search.best
    if len(best.key) == 1:
        return search.plain
    kept = search.smaller.get(best.key[number]) if search.whole is best else None
    found = kept or without(given, best, number)
    return found if found is not None and found.fit.jacobian is not None else None


def _next(
    ranking: Sequence[Scored], known: Collection[Key], kinds: Collection[str], places: int, most: int
) -> list[Scored]:
    """The first of each place that is not known, in so many places of a kind; of all kinds, or of some."""
    chosen: dict[Key, Scored] = {}
    for scored in ranking:
        key = scored.candidate.key
        wanted = not kinds or key[0] in kinds
        if wanted and key not in known and sum(kind == key[0] for kind, _ in chosen) < places:
            chosen.setdefault(key, scored)
    return list(chosen.values())[:most]


def _refitted(given: Given, search: Search, start: Trial, chosen: Sequence[Scored]) -> list[Trial]:
    """``start`` with each of some candidates; they are kept among the trials."""

    def refit(scored: Scored) -> Trial | None:
        return added(given, start, scored.candidate, scored.strengths)

    def tell(k: int) -> None:
        own = chosen[k].candidate
        given.say(f"who else does as well: {own.kind} at {own.where} ({k + 1} of {len(chosen)})")

    found = [trial for trial in abreast(given.problem, refit, chosen, tell) if trial is not None]
    search.trials += found
    return found
