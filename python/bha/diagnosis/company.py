"""Who else does as well: other places of what does alike, and where many kinds do alike, other kinds.

Scores are taken about the plain fit, whose numbers have made up for what is missing. Where little is logged they make
up for so much that the right effect may promise nothing, and do as well as any once it is fitted. Of a rich log that
does not happen, and nobody is asked. A class of the three that were tried by chance would be a wrong name.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from bha.diagnosis.abreast import abreast
from bha.diagnosis.given import Given
from bha.diagnosis.refit import Trial, added, correlation_length
from bha.diagnosis.rivals import rivals_of
from bha.diagnosis.screen import Scored, score
from bha.diagnosis.search import Search

Key = tuple[str, str]


def complete(given: Given, search: Search) -> None:
    """Refit those that were not tried, the likeliest first, in the place of each effect that is one of several."""
    if len(set(search.best.key)) == len(search.best.key):
        for number in range(len(search.best.key)):
            _complete(given, search, number)


def _complete(given: Given, search: Search, number: int) -> None:
    best, rules, own = search.best, given.rules, search.best.key[number]
    correlation = correlation_length(given.problem, best.fit.residual)

    def tried() -> dict[Key, float]:
        return {r.key: r.distance for r in rivals_of(search, best, number, given.problem, correlation)}

    before = tried()
    kinds = {kind for (kind, _), distance in before.items() if distance < rules.even}
    start = _start(given, search, number) if kinds else None
    if start is None:
        return
    alone = search.screening if start is search.plain else None
    ranking = (alone or score(given.problem, start.fit, given.signatures)).ranking
    kinds.add(own[0])
    if len(kinds) >= rules.crowd:
        _refit(given, search, start, _next(ranking, {*before, *best.key}, (), 1, rules.company))
        kinds = {key[0] for key, distance in tried().items() if distance < rules.even and key not in before}
    if kinds:
        # Of those that do as well other places are asked.
        places = rules.per_kind + 1
        _refit(given, search, start, _next(ranking, {*tried(), *best.key}, kinds, places, rules.company // 2))
    alike = [f"{key[0]} at {key[1]}" for key, d in tried().items() if d < rules.even and key not in before]
    if alike:
        as_good = f"as good as {own[0]} at {own[1]}, though their scores promised little"
        search.notes.append(f"{as_good}: {', '.join(alike)}")


def _start(given: Given, search: Search, number: int) -> Trial | None:
    """The best set without one of its effects, with its sensitivities; None where it has none."""
    if len(search.best.key) == 1:
        return search.plain
    found = search.without(given, number)
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


def _refit(given: Given, search: Search, start: Trial, chosen: Sequence[Scored]) -> None:
    """``start`` with each of some candidates, among the trials."""

    def refit(scored: Scored) -> Trial | None:
        return added(given, start, scored.candidate, scored.strengths)

    def tell(k: int) -> None:
        own = chosen[k].candidate
        given.say(f"who else does as well: {own.kind} at {own.where} ({k + 1} of {len(chosen)})")

    search.trials += [trial for trial in abreast(given.problem, refit, chosen, tell) if trial is not None]
