"""One effect after the other: each round refits those that promise most and takes the best in.

An effect is taken in where the best of all candidates in all places would hardly bring as much by chance
(:mod:`bha.diagnosis.screen`) and it explains enough of what the plain model or the set so far leaves.
"""

from __future__ import annotations

from collections.abc import Sequence

from bha.diagnosis.abreast import abreast
from bha.diagnosis.contenders import asks_memory, contenders, other_kinds, second_look
from bha.diagnosis.given import Given
from bha.diagnosis.kin import as_kin
from bha.diagnosis.plausible import plausible
from bha.diagnosis.ranking import by_criterion, in_order
from bha.diagnosis.refit import Trial, added, refined
from bha.diagnosis.screen import Scored, Screening, score
from bha.diagnosis.search import Search, by_chance, gain
from bha.diagnosis.slowness import LAG


def forward(given: Given, search: Search) -> None:
    """Take in effects beside those of the best set until none is worth it."""
    rules, problem, plain = given.rules, given.problem, search.plain.fit
    excess = max(0.0, plain.squares - problem.rows)
    while len(search.best.candidates) < rules.most:
        current = search.best
        given = renewed(given, current)
        first = search.screening if current is search.plain else None
        screening = first or score(problem, current.fit, given.signatures)
        search.screening = search.screening or screening
        enough = rules.enough(current.fit.squares, problem.rows) if current.candidates else rules.worth * excess
        share = f"{100.0 * enough / max(excess, 1e-9):.2g} % of the excess"
        chosen = contenders(given, current, screening, search.rivals, enough)
        if not chosen:
            search.notes.append(f"no further candidate promises {share} error")
            return
        trials = _round(given, search, screening, chosen)
        if not trials:
            return
        search.rivals.append(trials)
        best = trials[0]
        chance = screening.chance(gain(current, best))
        if chance > rules.enter:
            search.notes.append(f"not taken in: {best.label}, {by_chance(chance)}")
            return
        if current.fit.squares - best.fit.squares < enough:
            search.notes.append(f"not taken in: {best.label}, which removes less than {share}")
            return
        search.best = best
        if search.settled is None:
            search.settle()
        search.notes.append(f"taken in: {best.key[-1][0]} at {best.key[-1][1]}, {by_chance(chance)}")
        if best.fit.squares / problem.rows < rules.shows**2 and len(best.candidates) < rules.most:
            search.notes.append("what is left is no gap: no further effect is sought")
            return


def _round(given: Given, search: Search, screening: Screening, chosen: Sequence[Scored]) -> list[Trial]:
    """The trials of a round, the best first: of ``chosen``, of further looks where these leave much, and of a kin."""
    current, trust = search.best, search.plain.fit.trust
    trials = tried(given, search, chosen)
    if not trials:
        return []
    first = not current.candidates and not asks_memory(given, current, screening)
    if first and _leaves_much(given, search, trials[0]):
        others = second_look(given, screening, trials)
        trials = in_order(given, current, trust, [*trials, *tried(given, search, others, trials[0])])
        if _leaves_much(given, search, trials[0]):
            trials = in_order(given, current, trust, _from_plausible(given, search, trials))
    kin = as_kin(given, trials[0])
    if kin is not None:
        search.trials.append(kin)
        trials = in_order(given, current, trust, [*trials, kin])
    return trials


def _from_plausible(given: Given, search: Search, trials: list[Trial]) -> list[Trial]:
    """The trials of the first round, and where the plain model went astray those that begin from plausible numbers."""
    kept = plausible(given, search.plain)
    if kept is None:
        return trials
    there = given.about(kept.fit, "about plausible numbers")
    screening = score(given.problem, kept.fit, there.signatures)
    chosen = contenders(given, kept, screening, (), 0.0)
    further = tried(given, search, chosen, trials[0], kept)
    if further and further[0].fit.cost < trials[0].fit.cost:
        # It leads lower. Scores are no better there than about any plain fit: they tell the place sooner than the kind.
        known, core = {trial.key[-1] for trial in further}, given.problem.model.core
        others = other_kinds(screening.ranking, further[0].candidates[-1], known, core, given.rules.company)
        further += tried(given, search, others, further[0], kept)
    return [*trials, *further]


def renewed(given: Given, current: Trial) -> Given:
    """The same with signatures about effects that were found, where these leave a gap.

    About the plain fit they are those of another arm: beside a spring of 50 N m between its sections a delay of 0.1 s
    shows as one of a soft arm would not.
    """
    if not current.candidates or current.fit.squares < given.rules.shows**2 * given.problem.rows:
        return given
    return given.about(current.fit, f"beside {current.label}")


def _leaves_much(given: Given, search: Search, best: Trial) -> bool:
    """Whether a set leaves much of what the plain model does beyond noise on the training logs."""
    rules, rows = given.rules, given.problem.rows
    return best.fit.squares - rows > rules.open * max(0.0, search.plain.fit.squares - rows)


def tried(
    given: Given, search: Search, chosen: Sequence[Scored], beside: Trial | None = None, start: Trial | None = None
) -> list[Trial]:
    """The best set with each of ``chosen`` added, refitted; the best of them first.

    ``beside`` is the best of the round so far; ``start`` the same set with other numbers, where these are begun with.
    """
    current, rules = search.best, given.rules
    number = len(current.candidates) + 1

    def say(k: int) -> None:
        own = chosen[k].candidate
        given.say(f"effect {number}: refitting {own.kind} at {own.where} ({k + 1} of {len(chosen)})")

    def refit(scored: Scored) -> Trial | None:
        # Beside effects the numbers do not make up for all that is missing any more.
        promised = 0.0 if current.candidates else scored.score
        return added(given, start or current, scored.candidate, scored.strengths, promised, anew=start is not None)

    refitted = abreast(given.problem, refit, chosen, say)
    trials = by_criterion([trial for trial in refitted if trial is not None], given.problem)
    search.trials += trials
    near = _worth_refining(trials, current, rules.refined, beside)
    finer = abreast(
        given.problem,
        lambda t: refined(given, t, anew=start is not None),
        near,
        lambda k: given.say(f"effect {number}: refining {near[k].label}"),
    )
    search.trials += finer
    others = [trial for trial in trials if all(trial is not t for t in near)]
    return in_order(given, current, search.plain.fit.trust, [*finer, *others])


def _worth_refining(trials: Sequence[Trial], current: Trial, share: float, beside: Trial | None) -> list[Trial]:
    """The winner, and of those that bring at least ``share`` of the most the second, and the first lag.

    Beside a trial that is refined already and leaves much, those that bring as much of what it does, and the first lag.

    Their step was chosen for the strength that was expected of them. A lag has another valley, into which only
    refining looks.
    """
    drops = [current.fit.squares - t.fit.squares for t in trials]
    most = max([*drops, 0.0 if beside is None else current.fit.squares - beside.fit.squares])
    close = [k for k, drop in enumerate(drops) if drop > share * most]
    first = 0 in close or beside is None
    lags = [k for k, trial in enumerate(trials) if trial.key[-1][0] == LAG and drops[k] > 0.0]
    lag = next((k for k in lags if k in close or beside is not None), None)
    return [t for k, t in enumerate(trials) if (k == 0 and first) or (k == 1 and k in close) or k == lag]
