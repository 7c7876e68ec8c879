"""Whom a round of the search refits: the candidates that promise most, and those that only a refit tells from them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bha.diagnosis.candidate import Candidate
from bha.diagnosis.given import Given
from bha.diagnosis.places import bellows_in, place_of
from bha.diagnosis.refit import Trial, correlation_length
from bha.diagnosis.screen import Scored, Screening
from bha.recordings.beginning import preloaded
from bha.recordings.strained import KIND as MEMORY

Key = tuple[str, str]

#: Kinds that only a refit tells apart: friction begins where the range of hysteresis ends, and in a motion of one size
#: what creeps and what slips hold a bellows back alike.
KIN = {"hysteresis": ("friction", "creep"), "friction": ("hysteresis",), "creep": ("hysteresis",)}


def contenders(
    given: Given, current: Trial, screening: Screening, rivals: Sequence[Sequence[Trial]], enough: float
) -> list[Scored]:
    """The candidates that are refitted beside the effects of ``current``.

    Args:
        given: what the search is given.
        current: the set that gets one more.
        screening: of its residual.
        rivals: the trials of earlier rounds.
        enough: drop of the sum of squares that a further effect has to bring.
    """
    rules, ranking = given.rules, screening.ranking
    if asks_memory(given, current, screening):
        return memories(ranking)
    count = rules.tried[0] if not current.candidates else rules.tried[1]
    taken = [c.key for c in current.candidates]
    effective = given.problem.rows / correlation_length(given.problem, current.fit.residual)
    chosen = promising(ranking, taken, count, rules.per_kind, effective)
    # A score is linear and on a grid: a refit may bring more than it promises, though not many times more.
    least = max(0.5 * enough, rules.near * max((scored.score for scored in chosen), default=0.0))
    chosen = [scored for scored in chosen if scored.score > least]
    chosen = with_laws(with_kin(chosen, ranking, taken), ranking, taken)
    if given.problem.restarts:
        chosen = with_wider(chosen, ranking, taken)
        chosen = with_rivals(chosen, ranking, taken, rivals)
    return with_other_forms(with_one_element(chosen, ranking), ranking)


def second_look(given: Given, screening: Screening, trials: Sequence[Trial]) -> list[Scored]:
    """Whom the first round refits besides, where the best of those that promised most leaves much.

    Scores are linear and about the plain numbers: of an effect that is far from little, or that these have made up for,
    they tell the neighbourhood. Others of the catalogue in the place of the best, what brought most in every section,
    and who comes next.
    """
    rules, ranking, core = given.rules, screening.ranking, given.problem.model.core
    known = {trial.key[-1] for trial in trials}
    chosen = other_kinds(ranking, trials[0].candidates[-1], known, core, rules.beside)
    chosen += whole_places(ranking, trials, {*known, *(s.candidate.key for s in chosen)}, rules.widened)
    known |= {s.candidate.key for s in chosen}
    following = _first_of_each(s for s in ranking if s.score > 0.0 and s.candidate.key not in known)
    return chosen + following[: rules.beside]


def asks_memory(given: Given, current: Trial, screening: Screening) -> bool:
    """Whether a round asks the form of the memory alone: of an arm that stands elsewhere after each use.

    Its logs show that it remembers. What a model lacks that only begins where the memory left it, others stand in for.
    """
    if current.candidates or not preloaded(given.problem.model.parameters):
        return False
    return any(scored.candidate.key == (MEMORY, "all") for scored in screening.ranking)


def memories(ranking: Sequence[Scored]) -> list[Scored]:
    """What an arm may remember by: the bank of what slips everywhere, and what creeps.

    The bank has room for a single yield, and for friction, which is one of nothing.
    """
    chosen = with_what_slips([], ranking, ())
    return chosen + [s for s in ranking if s.candidate.key == ("creep", "all")][:1]


def with_what_slips(chosen: Sequence[Scored], ranking: Sequence[Scored], taken: Sequence[Key]) -> list[Scored]:
    """``chosen`` with the bank of what slips everywhere, for an arm that stands elsewhere after each use.

    Scores are those of small strengths, and where logs begin a small element is strained to its limit: all that it does
    is to hold less than a preload. What a strong one does only a refit tells.
    """
    own = next((s for s in ranking if s.candidate.key == (MEMORY, "all")), None)
    if own is None or own.candidate.key in taken:
        return list(chosen)
    if any(s.candidate.key == own.candidate.key and s.candidate.bank for s in chosen):
        return list(chosen)
    plan = own.candidate.plan
    bank = Candidate(plan, "all", {}, plan.bank)
    return [replace(own, candidate=bank, strengths=(0.0,) * len(plan.bank)), *chosen]


def promising(
    ranking: Sequence[Scored], taken: Sequence[Key], count: int, per_kind: int, effective: float
) -> list[Scored]:
    """The best candidates by penalised score: one shape a place, few places a kind.

    The penalty is Akaike's (1974): who is tried is no decision yet, and the one of the criterion, with an honest number
    of independent readings, would let nobody be tried beside a slow residual.
    """

    def value(scored: Scored) -> float:
        return -effective * float(np.log(max(1e-9, 1.0 - scored.share))) - 2.0 * scored.candidate.size

    chosen: list[Scored] = []
    kinds: dict[str, int] = {}
    for scored in sorted(ranking, key=value, reverse=True):
        key = scored.candidate.key
        if key in taken or any(key == c.candidate.key for c in chosen) or value(scored) <= 0.0:
            continue
        if kinds.get(key[0], 0) >= per_kind:
            continue
        kinds[key[0]] = kinds.get(key[0], 0) + 1
        chosen.append(scored)
        if len(chosen) == count:
            break
    return chosen


def other_kinds(
    ranking: Sequence[Scored], best: Candidate, known: Collection[Key], core: Mapping[str, Any], most: int
) -> list[Scored]:
    """Kinds that were not refitted, in the place of the best one that was, by score, at most so many.

    Of an effect that is far from little, scores tell the place sooner than the kind.
    """
    place = bellows_in(best.where, core)
    chosen: list[Scored] = []
    for scored in ranking:
        own = scored.candidate
        if own.key in known or scored.score <= 0.0 or any(own.kind == c.candidate.kind for c in chosen):
            continue
        if bellows_in(own.where, core) == place:
            chosen.append(scored)
        if len(chosen) == most:
            break
    return chosen


def whole_places(
    ranking: Sequence[Scored], trials: Sequence[Trial], known: Collection[Key], kinds: int
) -> list[Scored]:
    """The kinds that brought most, so many of them, in every section and everywhere.

    Of what holds a whole section back a score sees the bellows that move most, and none of it where the plain numbers
    have made up for it.
    """
    first = list(dict.fromkeys(trial.key[-1][0] for trial in trials))[:kinds]

    def wanted(kind: str, where: str) -> bool:
        return kind in first and (kind, where) not in known and place_of(where).sort in ("all", "section")

    return _first_of_each(s for s in ranking if wanted(*s.candidate.key))


def _first_of_each(ranking: Iterable[Scored]) -> list[Scored]:
    """The first of each kind and place."""
    chosen: dict[Key, Scored] = {}
    for scored in ranking:
        chosen.setdefault(scored.candidate.key, scored)
    return list(chosen.values())


def with_kin(chosen: Sequence[Scored], ranking: Sequence[Scored], taken: Sequence[Key]) -> list[Scored]:
    """``chosen`` with the kinds in the same places that only a refit tells from them."""
    result = list(chosen)
    for scored in chosen:
        for kind in KIN.get(scored.candidate.kind, ()):
            kin = (kind, scored.candidate.where)
            if kin not in [*taken, *(c.candidate.key for c in result)]:
                result += [s for s in ranking if s.candidate.key == kin][:1]
    return result


def with_laws(chosen: Sequence[Scored], ranking: Sequence[Scored], taken: Sequence[Key]) -> list[Scored]:
    """``chosen`` with every law that may stand in the place of one of the arm's: the plain numbers make up for most of
    it, so that their score, which is about these numbers, says little. They have none of their own, and are quick."""
    known = {*taken, *(c.candidate.key for c in chosen)}
    return [*chosen, *(s for s in ranking if s.candidate.plan.is_a_law and s.candidate.key not in known)]


def with_one_element(chosen: Sequence[Scored], ranking: Sequence[Scored]) -> list[Scored]:
    """``chosen`` with one element beside every bank: a refit tells whether its shape, fitted, does as well."""
    result = list(chosen)
    for scored in chosen:
        if scored.candidate.bank:
            result += [s for s in ranking if s.candidate.key == scored.candidate.key and not s.candidate.bank][:1]
    return result


def with_other_forms(chosen: Sequence[Scored], ranking: Sequence[Scored]) -> list[Scored]:
    """``chosen`` with the other forms of their kinds in the same places: a refit tells how many numbers one needs."""
    result = list(chosen)
    for scored in chosen:
        key = scored.candidate.key
        forms = {id(s.candidate.plan) for s in result if s.candidate.key == key}
        for other in ranking:
            if other.candidate.key == key and id(other.candidate.plan) not in forms:
                result.append(other)
                forms.add(id(other.candidate.plan))
    return result


def with_wider(chosen: Sequence[Scored], ranking: Sequence[Scored], taken: Sequence[Key]) -> list[Scored]:
    """``chosen``, each kind tried everywhere too: scores at a fit in a wrong valley tell less of the place."""
    result = list(chosen)
    for scored in chosen:
        everywhere = (scored.candidate.kind, scored.candidate.plan.sorts[0])
        known = [*taken, *(c.candidate.key for c in result)]
        if scored.candidate.plan.parts and everywhere not in known:
            result += [next(s for s in ranking if s.candidate.key == everywhere)]
    return result


def with_rivals(
    chosen: Sequence[Scored], ranking: Sequence[Scored], taken: Sequence[Key], rivals: Sequence[Sequence[Trial]]
) -> list[Scored]:
    """``chosen`` with the best of another kind from each earlier round.

    A refit found it worth something; where the cost has several valleys, a score at the bottom of one of them does not
    see it any more.
    """
    result = list(chosen)
    for earlier in rivals:
        kinds = {kind for kind, _ in (*taken, *(c.candidate.key for c in result))}
        key = next((t.key[-1] for t in earlier if t.key[-1][0] not in kinds), None)
        result += [s for s in ranking if s.candidate.key == key][:1]
    return result
