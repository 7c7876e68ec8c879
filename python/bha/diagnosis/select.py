"""Which effects: forward by training score, swaps among look-alikes, backward by prediction of logs that are left out.

What: the search over sets of effects, on training logs alone: held-out logs certify what it found and decide nothing
here. An effect is real where the best of all candidates in all places would hardly bring as much by chance
(:mod:`bha.diagnosis.screen`), and it matters where it helps to predict training logs from the others
(:mod:`bha.diagnosis.crossing`). The latter at each forward step would refuse a true first effect while others are
still missing, so it comes last.
Source: family-wise error rates by the distribution of the greatest score, Westfall and Young 1993; Schwarz 1978; rules
as measured on simulated arms (docs/explanation/diagnosis.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.candidate import Candidate, Ranges
from bha.diagnosis.crossing import crossed
from bha.diagnosis.fit import Problem, evaluate, improve, with_sensitivities
from bha.diagnosis.holdout import Holdout, Readings, share_brought
from bha.diagnosis.places import members
from bha.diagnosis.refit import Trial, bic, correlation_length, drop, refit, store, stored, without, without_idle
from bha.diagnosis.screen import Scored, Screening, Signatures, score
from bha.estimation.integration import resolved

Array = NDArray[np.float64]
Say = Callable[[str], None]

#: Mean square of the white residual below which what is left is noise.
NOISE_LEFT = 1.02
#: Kinds of one form that begin where the other's range of lengths ends.
KIN = {"hysteresis": "friction", "friction": "hysteresis"}


@dataclass(frozen=True)
class Rules:
    """Thresholds of the search; measured on tuning seeds, see docs/explanation/diagnosis.md.

    Attributes:
        most: most effects.
        tried: candidates that are refitted in the first round, and in later ones.
        per_kind: candidates of one kind among them.
        enter: greatest probability that the best of all candidates brings as much by chance, with which an effect is
            taken in: a true one stands out less while others are still missing.
        chance: the same with which it stays, and with which a further element of it is taken in.
        swap: drop of the criterion that swaps an effect for a look-alike.
        share: least share of the plain model's excess error on left-out training logs that it has to remove.
        worth: least share of the plain model's excess on the training logs for which a further effect is sought.
        rest: least share of what the effects so far leave of that excess; reaching this one is enough, too: beside a
            strong effect a weaker one counts that explains much of what the strong one does not.
        near: a candidate is refitted if it promises at least this share of what the best one does.
        like: the same for a look-alike against what it would replace.
        bound: a candidate on a bound gives way to one that is not and brings at least this share of its gain.
        element: least share of what is left of the excess error, on training logs as they are fitted and as they are
            left out, that a further branch or stage has to remove.
        refined: a runner-up is refined too if it brings at least this share of what the first one brings.
        narrow: share of its gain by which a narrower place has to be better, where the cost has several valleys.
    """

    most: int = 4
    tried: tuple[int, int] = (4, 3)
    per_kind: int = 2
    enter: float = 0.05
    chance: float = 0.01
    swap: float = 4.0
    share: float = 0.025
    worth: float = 0.02
    rest: float = 0.3
    near: float = 0.25
    like: float = 0.6
    bound: float = 0.8
    element: float = 0.1
    refined: float = 0.7
    narrow: float = 0.2


@dataclass
class Search:
    """What the search has found so far; filled as it goes on, so that an interrupted one leaves it.

    Attributes:
        plain: the plain model.
        best: the best set so far.
        rules: its thresholds.
        readings: the training logs, on which it counts errors.
        noise: RMS error of a right model there, m.
        screening: the screening of the plain residual.
        trials: all refitted sets.
        rivals: for every round its trials with one more effect than before, best first.
        notes: what was decided and why.
        smaller: the best set without each of its effects, as they were last pruned.
        chosen: the best set before further elements of its effects were sought: what rivals are compared with.
        complete: whether the search came to its end.
    """

    plain: Trial
    best: Trial
    rules: Rules
    readings: Readings
    noise: float
    screening: Screening | None = None
    trials: list[Trial] = field(default_factory=list)
    rivals: list[list[Trial]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    smaller: dict[tuple[str, str], Trial] = field(default_factory=dict)
    chosen: Trial | None = None
    complete: bool = False


def promising(
    ranking: Sequence[Scored], taken: Sequence[tuple[str, str]], count: int, per_kind: int, effective: float
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


def search(
    problem: Problem,
    holdout: Holdout,
    signatures: Signatures,
    ranges: Ranges,
    rules: Rules,
    say: Say,
    state: Search,
) -> Search:
    """Search for the set of effects; interrupted by Ctrl-C it returns what it has, marked as incomplete."""
    try:
        _forward(problem, holdout, signatures, ranges, rules, say, state)
        # What is needless goes first: swaps are only worth their time among what stays.
        _backward(problem, holdout, signatures, rules, say, state)
        if _swap(problem, holdout, signatures, ranges, rules, say, state):
            _backward(problem, holdout, signatures, rules, say, state)
        state.chosen = state.best
        _elements(problem, holdout, signatures, ranges, rules, say, state)
        state.complete = True
    except KeyboardInterrupt:
        state.notes.append("interrupted: the search is not complete")
    return state


def _forward(
    problem: Problem, holdout: Holdout, signatures: Signatures, ranges: Ranges, rules: Rules, say: Say, state: Search
) -> None:
    worth = rules.worth * max(0.0, state.plain.fit.squares - problem.rows)
    for number in range(rules.most):
        current = state.best
        known = state.screening if number == 0 else None
        screening = known or score(problem, current.fit, signatures)
        state.screening = state.screening or screening
        correlation = correlation_length(problem, current.fit.residual)
        count = rules.tried[0] if number == 0 else rules.tried[1]
        taken = [c.key for c in current.candidates]
        chosen = promising(screening.ranking, taken, count, rules.per_kind, problem.rows / correlation)
        # A score is linear and on a grid: a refit may bring more than it promises, though not many times more.
        enough = min(worth, rules.rest * max(0.0, current.fit.squares - problem.rows))
        least = max(0.5 * enough, rules.near * max((scored.score for scored in chosen), default=0.0))
        chosen = [scored for scored in chosen if scored.score > least]
        chosen = _with_kin(chosen, screening.ranking, taken)
        if problem.restarts:
            chosen = _with_wider(chosen, screening.ranking, taken)
            chosen = _with_rivals(chosen, screening.ranking, taken, state.rivals)
        chosen = _with_one_element(chosen, screening.ranking)
        if not chosen:
            share = 100.0 * enough / max(worth / rules.worth, 1e-9)
            state.notes.append(f"no further candidate promises {share:.2g} % of the excess error")
            return
        trials = _tried(problem, holdout, ranges, say, state, chosen)
        if not trials:
            return
        state.rivals.append(trials)
        chance = screening.chance(_gain(current, trials[0]))
        if chance > rules.enter:
            state.notes.append(f"not taken in: {trials[0].label}, {_by_chance(chance)}")
            return
        if current.fit.squares - trials[0].fit.squares < enough:
            share = 100.0 * enough / max(worth / rules.worth, 1e-9)
            state.notes.append(f"not taken in: {trials[0].label}, which removes less than {share:.2g} % of the excess")
            return
        state.best = trials[0]
        state.notes.append(f"taken in: {trials[0].key[-1][0]} at {trials[0].key[-1][1]}, {_by_chance(chance)}")
        if trials[0].fit.squares / problem.rows < NOISE_LEFT and number + 1 < rules.most:
            state.notes.append("what is left is noise: no further effect is sought")
            return


def _gain(smaller: Trial, larger: Trial) -> float:
    """Drop of the sum of squares from one set to another; their priors count as data."""
    before, after = (t.fit.squares + t.fit.prior * t.fit.trust for t in (smaller, larger))
    return before - after


def told(problem: Problem, signatures: Signatures, rival: Trial, chosen: Trial) -> float:
    """How likely the chosen set were so much better by chance, were its rival right: p-value over all candidates."""
    return score(problem, rival.fit, signatures).chance(_gain(rival, chosen))


def _by_chance(chance: float) -> str:
    return f"the best of all candidates brings as much by chance with p = {chance:.3f}"


def _tried(
    problem: Problem, holdout: Holdout, ranges: Ranges, say: Say, state: Search, chosen: Sequence[Scored]
) -> list[Trial]:
    """The best set with each of ``chosen`` added, refitted; the best of them first."""
    current = state.best
    number = len(current.candidates) + 1
    trials: list[Trial] = []
    for k, scored in enumerate(chosen):
        say(
            f"effect {number}: refitting {scored.candidate.kind} at {scored.candidate.where} ({k + 1} of {len(chosen)})"
        )
        candidates = [*current.candidates, scored.candidate]
        trial = refit(
            problem, holdout, current.fit, candidates, [scored.strengths], ranges, kept=len(current.candidates)
        )
        if trial is not None:
            trials.append(trial)
            state.trials.append(trial)
    # The winner and a near runner-up once more, with sensitivities of their own: the others' are those of the smaller
    # model.
    trials = _sorted(trials, problem)
    most = max((current.fit.squares - t.fit.squares for t in trials), default=0.0)
    for k, trial in enumerate(trials[:2]):
        if k == 0 or current.fit.squares - trial.fit.squares > state.rules.refined * most:
            say(f"effect {number}: refining {trial.label}")
            trials[k] = _refined(problem, holdout, trial)
            state.trials.append(trials[k])
    trials = _off_bounds_first(_sorted(trials, problem), current, problem, state.rules)
    return _widest_first(trials, current, problem, state.rules) if problem.restarts and trials else trials


def _with_kin(chosen: Sequence[Scored], ranking: Sequence[Scored], taken: Sequence[tuple[str, str]]) -> list[Scored]:
    """``chosen`` with the kinds of the same form in the same places: only a refit tells stiction from hysteresis."""
    result = list(chosen)
    for scored in chosen:
        kin = (KIN.get(scored.candidate.kind, ""), scored.candidate.where)
        if kin not in [*taken, *(c.candidate.key for c in result)]:
            result += [s for s in ranking if s.candidate.key == kin][:1]
    return result


def _with_one_element(chosen: Sequence[Scored], ranking: Sequence[Scored]) -> list[Scored]:
    """``chosen`` with one element beside every bank: a refit tells whether its shape, fitted, does as well."""
    result = list(chosen)
    for scored in chosen:
        if scored.candidate.bank:
            result += [s for s in ranking if s.candidate.key == scored.candidate.key and not s.candidate.bank][:1]
    return result


def _off_bounds_first(trials: list[Trial], current: Trial, problem: Problem, rules: Rules) -> list[Trial]:
    """The same trials, the first one, if it sits on a bound, exchanged for one that does not and is nearly as good."""
    if not trials or not _on_bound(trials[0]):
        return trials
    correlation = correlation_length(problem, trials[0].fit.residual)
    before = bic(current, problem, correlation)
    needed = rules.bound * (before - bic(trials[0], problem, correlation))
    return _first(trials, lambda t: not _on_bound(t) and before - bic(t, problem, correlation) >= needed)


def _first(trials: list[Trial], wanted: Callable[[Trial], bool]) -> list[Trial]:
    """The same trials, the first of the others that is ``wanted`` in front."""
    chosen = next((t for t in trials[1:] if wanted(t)), trials[0])
    return [chosen, *(t for t in trials if t is not chosen)]


def _on_bound(trial: Trial) -> bool:
    """Whether the newest effect of a trial has a number on a bound: then it is not this kind, or not here."""
    model = trial.fit.model
    return bool(model.effects[-1].on_bound(trial.fit.x[model.place(-1)]))


def _with_wider(chosen: Sequence[Scored], ranking: Sequence[Scored], taken: Sequence[tuple[str, str]]) -> list[Scored]:
    """``chosen``, each kind tried everywhere too: scores at a fit in a wrong valley tell less of the place."""
    result = list(chosen)
    for scored in chosen:
        everywhere = (scored.candidate.kind, scored.candidate.plan.sorts[0])
        known = [*taken, *(c.candidate.key for c in result)]
        if scored.candidate.plan.parts and everywhere not in known:
            result += [next(s for s in ranking if s.candidate.key == everywhere)]
    return result


def _with_rivals(
    chosen: Sequence[Scored],
    ranking: Sequence[Scored],
    taken: Sequence[tuple[str, str]],
    rivals: Sequence[Sequence[Trial]],
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


def _widest_first(trials: list[Trial], current: Trial, problem: Problem, rules: Rules) -> list[Trial]:
    """The same trials, the first one exchanged for one of its kind in a wider place where that is hardly worse.

    Where the cost has several valleys a small difference of the criterion is one of valleys, not of places.
    """
    best = trials[0]
    correlation = correlation_length(problem, best.fit.residual)
    before, least = bic(current, problem, correlation), bic(best, problem, correlation)
    limit = least + rules.narrow * max(0.0, before - least)
    core = best.fit.model.core
    place = set(members(best.key[-1][1], best.candidates[-1].plan.parts, core))

    def wanted(trial: Trial) -> bool:
        kind, where = trial.key[-1]
        wider = kind == best.key[-1][0] and place < set(members(where, trial.candidates[-1].plan.parts, core))
        return wider and bic(trial, problem, correlation) < limit

    return _first(trials, wanted)


def _sorted(trials: list[Trial], problem: Problem) -> list[Trial]:
    if not trials:
        return trials
    correlation = correlation_length(problem, min(trials, key=lambda t: t.fit.squares).fit.residual)
    return sorted(trials, key=lambda t: bic(t, problem, correlation))


def _refined(problem: Problem, holdout: Holdout, trial: Trial) -> Trial:
    name = f"refined {[c.name for c in trial.candidates]}"
    fit = trial.fit
    # What was found may be stiffer than what was expected.
    model = resolved(fit.model, fit.x, fit.states, problem.misfit(fit))
    if model.integration.finer != fit.model.integration.finer:
        fit = evaluate(problem, model, fit.x, fit.states, fit.trust)
    known = stored(problem, fit, name)
    fit = known or fit
    fit = with_sensitivities(problem, fit)
    if known is None:
        renew = list(range(len(fit.model.plain), fit.model.size))
        fit = improve(problem, fit, iterations=20, renew=renew, renewals=6, tolerance=1e-3)
        store(problem, fit, name)
    candidates, fit = without_idle(trial.candidates, fit)
    return Trial(candidates, fit, holdout)


def _backward(
    problem: Problem, holdout: Holdout, signatures: Signatures, rules: Rules, say: Say, state: Search
) -> None:
    """Drop what helps to predict no left-out log, or may be there by chance, the least needed first."""
    if not state.best.candidates:
        return
    plain = crossed(problem, state.plain.fit, state.readings)
    while state.best.candidates:
        current = state.best
        own = crossed(problem, current.fit, state.readings)
        state.smaller.clear()
        weakest: tuple[float, Trial, str] | None = None
        for k in range(len(current.candidates)):
            say(f"pruning: without {current.key[k][0]} at {current.key[k][1]}")
            smaller = state.plain if len(current.candidates) == 1 else without(problem, holdout, current, k)
            if smaller is None:
                continue
            state.smaller[current.key[k]] = smaller
            share = share_brought(plain, crossed(problem, smaller.fit, state.readings), own, state.noise)
            fails = (
                f"removes {100 * share:.1f} % of the excess on left-out training logs" if share < rules.share else ""
            )
            if not fails:
                known = state.screening if smaller is state.plain else None
                chance = (known or score(problem, smaller.fit, signatures)).chance(_gain(smaller, current))
                fails = _by_chance(chance) if chance > rules.chance else ""
            if fails and (weakest is None or share < weakest[0]):
                weakest = (share, smaller, f"dropped: {current.key[k][0]} at {current.key[k][1]} ({fails})")
        if weakest is None:
            return
        state.best = weakest[1]
        state.notes.append(weakest[2])


def _swap(
    problem: Problem, holdout: Holdout, signatures: Signatures, ranges: Ranges, rules: Rules, say: Say, state: Search
) -> bool:
    """Exchange effects of a set of several for look-alikes where that lowers the criterion; whether one was."""
    swapped = False
    for k in range(len(state.best.candidates)):
        if len(state.best.candidates) < 2:
            break
        current = state.best
        say(f"look-alikes of {current.key[k][0]} at {current.key[k][1]}")
        smaller = without(problem, holdout, current, k)
        if smaller is None:
            continue
        ranking = score(problem, smaller.fit, signatures).ranking
        correlation = correlation_length(problem, current.fit.residual)
        own = max((scored.score for scored in ranking if scored.candidate.key == current.key[k]), default=0.0)
        for scored in promising(ranking, current.key, 2, 1, problem.rows / correlation):
            if scored.score < rules.like * own:
                continue
            candidates = [*smaller.candidates, scored.candidate]
            kept = len(smaller.candidates)
            trial = refit(problem, holdout, smaller.fit, candidates, [scored.strengths], ranges, kept=kept)
            if trial is None:
                continue
            state.trials.append(trial)
            if bic(current, problem, correlation) - bic(trial, problem, correlation) > rules.swap:
                state.notes.append(f"{trial.label} in place of {current.label}")
                state.best = current = trial
                swapped = True
    return swapped


def _elements(
    problem: Problem,
    holdout: Holdout,
    signatures: Signatures,
    ranges: Ranges,
    rules: Rules,
    say: Say,
    state: Search,
) -> None:
    """Second branches and stages of what was named, finer banks: names stay, their form comes nearer to the arm's.

    Not where the cost has several valleys: there another stage is a way into one of them.
    """
    if problem.restarts:
        return
    for key in state.best.key:
        current = state.best
        candidate = current.candidates[current.key.index(key)]
        if current.fit.squares / problem.rows < NOISE_LEFT:
            return
        if candidate.plan.further is None:
            continue
        say(f"further elements of {candidate.kind} at {candidate.where}")
        begin = with_sensitivities(problem, current.fit)
        screening = score(problem, begin, signatures)
        own = crossed(problem, begin, state.readings)
        for start, further, strengths in _enlarged(replace(current, fit=begin), key):
            candidates = [*start.candidates, further]
            kept = len(start.candidates)
            trial = refit(problem, holdout, start.fit, candidates, [strengths], ranges, kept=kept, renewals=3)
            if trial is None:
                continue
            chance = screening.chance(_gain(current, trial))
            left, gained = current.fit.squares - problem.rows, current.fit.squares - trial.fit.squares
            needed = chance <= rules.chance and gained >= rules.element * left
            if (
                needed
                and share_brought(own, own, crossed(problem, trial.fit, state.readings), state.noise) >= rules.element
            ):
                state.notes.append(f"further elements of {candidate.kind} at {candidate.where}: {_by_chance(chance)}")
                state.best = trial
                break


def _enlarged(trial: Trial, key: tuple[str, str]) -> Iterator[tuple[Trial, Candidate, list[float]]]:
    """From where an effect gets more elements: what stays, what comes to it, and the strengths to expect of that.

    Beside one element comes another; in the place of a bank one with elements between its elements as well.
    """
    number = trial.key.index(key)
    candidate, model = trial.candidates[number], trial.fit.model
    elements = model.effects[number].elements([float(v) for v in trial.fit.x[model.place(number)]])
    plan = candidate.plan
    if candidate.bank:
        (strength,) = (s.name for s in plan.strengths)
        finer = candidate.finer()
        rest = tuple(c for k, c in enumerate(trial.candidates) if k != number)
        share = sum(e[strength] for e in elements) / len(finer.bank)
        yield replace(trial, candidates=rest, fit=drop(trial.fit, number)), finer, [share] * len(finer.bank)
        return
    assert plan.further is not None
    for shape in plan.further(elements[0]):
        strengths = [0.3 * elements[0][s.name] for s in plan.strengths] or [1.0] * len(plan.probed(shape))
        yield trial, Candidate(plan, candidate.where, shape), strengths
