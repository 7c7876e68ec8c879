"""What a search found, described: effects with their numbers, rivals and confidence, candidates, facts of the logs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis import excitation
from bha.diagnosis.baseline import Baseline
from bha.diagnosis.candidate import core_ranges
from bha.diagnosis.decide import Decision, GapTest
from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.holdout import Holdout, share_brought
from bha.diagnosis.intervals import confidences
from bha.diagnosis.model import said_of_camera
from bha.diagnosis.places import nested
from bha.diagnosis.plan import together
from bha.diagnosis.refit import Trial, bic, correlation_length
from bha.diagnosis.residual import describe_residual
from bha.diagnosis.result import Alternative, CandidateLine, Correction, Diagnosis, Effect, Estimate, Gap, Number, plain
from bha.diagnosis.rivals import Rival, rivals_of
from bha.diagnosis.screen import Signatures
from bha.diagnosis.search import Search, told
from bha.diagnosis.valves import found_valves, is_of_valves
from bha.estimation.records import Record
from bha.estimation.terms import element_of, number_of

Array = NDArray[np.float64]

#: Difference of criteria below which an effect in place of another is not told from it: twice the logarithm of the odds
#: e^3, "positive" evidence at most in the table of Kass and Raftery (1995).
ALIKE = 6.0
#: The same is told from it where, were the other one right, the set that was chosen would be so much better by chance
#: with this probability at most; asked of so many that are nearest.
TOLD, MOST_RIVALS = 0.05, 5
#: Nor is it told where what is left follows something that was logged, and the other leaves, beyond the noise, at most
#: so many times as much: a form that errs by so much itself rules no other out that errs by a little more.
FORM = 1.5
#: The same where what is left is little, in mean square over the noise, and may be anything: a lag beside a camera that
#: is a millimetre off leaves a little less than the delay that it is not.
LITTLE, LITTLE_FORM = 1.3, 1.1


def describe(
    baseline: Baseline,
    holdout: Holdout,
    state: Search,
    signatures: Signatures,
    gap: GapTest,
    verdict: Decision,
    where: dict[str, Any],
    final: Trial,
    uncertainty: Sequence[tuple[float, float]],
    draws: Array,
    errors: tuple[float, float, float],
    seed: int,
    records: tuple[Sequence[Record], Sequence[Record]],
    error_of: Callable[[Trial], float],
    tolerance: float,
) -> Diagnosis:
    """What was found, as it is written.

    Args:
        baseline: the plain fit.
        holdout: the held-out logs.
        state: the search.
        signatures: what each candidate would do.
        gap: whether there is one.
        verdict: what follows.
        where: where the plain model errs.
        final: the model to describe, with its sensitivities.
        uncertainty: 95 % interval of each of its coordinates.
        draws: of their changes, shape (draws, size).
        errors: RMS of noise, and of the held-out logs before and after, m.
        seed: of what is drawn.
        records: training and held-out logs.
        error_of: open-loop error of a trial on the held-out logs, m, as ``errors`` has it.
        tolerance: what does not matter, m.
    """
    problem = baseline.problem
    named = final.candidates if verdict.verdict == "named" else ()
    best = excitation.best_by_key(state.screening, signatures) if state.screening is not None else {}
    correlation = correlation_length(problem, final.fit.residual)
    lines = _candidates(state, best, problem, correlation, error_of)
    weak = excitation.weakest(best, np.sqrt(correlation))
    alike = excitation.Likenesses((), np.empty((0, 0)))
    if state.screening is not None and best:
        alike = excitation.compare(state.screening, signatures, best)
    effects = (
        _effects(state, alike, final, uncertainty, draws, problem, correlation, seed, best, errors[0], signatures)
        if named
        else []
    )
    confused = [e.kind for e in effects if e.one_of]
    confused += [other.kind for e in effects for other in e.one_of]
    values = {
        c.name: Estimate(
            value=c.value(float(v)),
            unit=c.unit,
            ci95=uncertainty[k],
            at_bound=c.at_bound(float(v)),
            start=c.start if np.isfinite(c.start) and not is_of_valves(c) else None,
        )
        for k, (c, v) in enumerate(zip(final.fit.model.plain, final.fit.x, strict=False))
    }
    train, held = records
    return Diagnosis.model_validate(
        {
            "schema": "bha-diagnosis/2",
            "verdict": "one_of" if any(e.one_of for e in effects) else verdict.verdict,
            "reason": verdict.reason,
            "effects": [*effects, *found_valves(final.fit.model, final.fit.x, draws)],
            "gap": Gap(
                noise=errors[0],
                before=errors[1],
                after=errors[2],
                holdout=[r.name for r in held],
                significant=gap.significant,
                excess=max(0.0, min(gap.mean_square - gap.expected, 1e12)),
                excess_limit=gap.limit - gap.expected,
                tolerance=tolerance,
            ),
            "where": where,
            "candidates": lines,
            "residual": plain(
                describe_residual(holdout, state.best, state.plain, baseline.noise) | {"notes": state.notes}
            ),
            "excitation": plain(
                {
                    "classes": alike.classes()[:20],
                    "least_visible": [{"kind": k, "detectable_over_typical": r} for k, r in weak[:10]],
                    "next_experiment": excitation.next_experiment(confused, weak),
                }
            ),
            "plain": values,
            "setup": [text for text in [said_of_camera(final.fit.model, uncertainty, final.fit.x)] if text],
            "logs": [plain(log_facts(r, "training")) for r in train] + [plain(log_facts(r, "held out")) for r in held],
        }
    )


def log_facts(record: Record, part: str) -> dict[str, Any]:
    """What the report says of a log that took part."""
    # What drove the arm before a part of a log belongs to it, and is none of its rows.
    first, time = record.time[0], record.drive.time
    return {
        "name": record.name,
        "part": part,
        "rows": int(np.count_nonzero(time >= first)),
        "duration": float(time[-1] - first),
        "channels": [asdict(f) for f in (*record.facts, *record.pressure_facts)],
    }


def _candidates(
    state: Search,
    best: dict[tuple[str, str], excitation.Best],
    problem: Problem,
    correlation: float,
    error_of: Callable[[Trial], float],
) -> list[CandidateLine]:
    """All kinds and places by score, with what a refit of them alone gave."""
    reference = bic(state.plain, problem, correlation)
    refitted: dict[tuple[str, str], Trial] = {}
    for trial in state.trials:
        if len(trial.candidates) == 1:
            refitted[trial.key[0]] = trial
    criteria = {key: bic(trial, problem, correlation) - reference for key, trial in refitted.items()}
    least = min(criteria.values(), default=0.0)
    lines = []
    for key, entry in best.items():
        strengths = entry.scored.candidate.plan.strengths
        detectable = 3.0 * entry.scored.deviation * np.sqrt(correlation)
        alone = refitted.get(key)
        rms = error_of(alone) if alone is not None else None
        lines.append(
            CandidateLine(
                kind=key[0],
                where=key[1],
                score=entry.scored.share,
                holdout=rms if rms is not None and np.isfinite(rms) else None,
                bic=criteria.get(key),
                distance=criteria[key] - least if key in criteria else None,
                detectable=float(detectable) if strengths and np.isfinite(detectable) else None,
                unit=core_ranges()(key[0], strengths[0].name)[0] if strengths else "",
            )
        )
    return sorted(lines, key=lambda c: (c.bic if c.bic is not None else 0.0, -c.score))


def _effects(
    state: Search,
    looks: excitation.Likenesses,
    final: Trial,
    uncertainty: Sequence[tuple[float, float]],
    draws: Array,
    problem: Problem,
    correlation: float,
    seed: int,
    best: dict[tuple[str, str], excitation.Best],
    noise: float,
    signatures: Signatures,
) -> list[Effect]:
    result = []
    places: dict[tuple[str, str], list[int]] = {}
    for number, candidate in enumerate(final.candidates):
        places.setdefault(candidate.key, []).append(number)
    # Rivals were refitted without further elements: they are compared with the set that had none either.
    chosen = state.chosen if state.chosen is not None else final
    for numbers in places.values():
        candidate = final.candidates[numbers[0]]
        elements = [element for k in numbers for element in _elements_of(final.fit, k, draws)]
        parameters = _numbers(elements, candidate.plan.adding if len(elements) > 1 else ())
        terms = [(final.fit.model.effects[k], final.fit.model.place(k)) for k in numbers]
        spans = [
            interval
            for term, own in terms
            for c, interval in zip(term.coordinates, uncertainty[own], strict=True)
            if number_of(c) in candidate.plan.passive
        ]
        empirical = any(term.on_bound(final.fit.x[own]) for term, own in terms)
        empirical = empirical or any(high < 0.0 for _, high in spans)
        # Refining a bank moves it to the end.
        place = chosen.key.index(candidate.key)
        rivals = rivals_of(state, chosen, place, problem, correlation)
        near = [r for r in rivals if r.distance < ALIKE][:MOST_RIVALS]
        untold = [r for r in near if told(problem, signatures, r.trial, chosen) > TOLD]
        untold += [r for r in of_like_form(state, problem, chosen, rivals) if r not in untold]
        alike = {r.key: _alternative(r) for r in untold[:MOST_RIVALS]}
        refitted = {r.key for r in rivals}
        for kind, where, _ in looks.alike(candidate.key, 0.98)[:5]:
            promised = best.get((kind, where))
            # What would help with the wrong sign only, or by more than arms have of it, is no member of the class.
            if (kind, where) not in refitted and (promised is None or promised.is_possible):
                alike.setdefault((kind, where), _promised(promised, kind, where))
        compared = rivals[:5]
        shares = confidences(problem, [chosen, *(r.trial for r in compared)], seed) if rivals else np.ones(1)
        in_class = [k for k, r in enumerate(compared, start=1) if r.key in alike]
        kinds = [candidate.kind, *dict.fromkeys(kind for kind, _ in alike)]
        result.append(
            Effect(
                kind=candidate.kind,
                where=candidate.where,
                parameters=parameters,
                elements=[_numbers([e]) for e in elements] if len(elements) > 1 else [],
                confidence=min(1.0, float(shares[0] + np.sum(shares[in_class]))),
                alone=float(shares[0]),
                one_of=list(alike.values()),
                empirical=empirical,
                experiment=excitation.next_experiment(kinds, []) if alike else "",
                gap_removed=_removed(state, candidate.key, noise),
            )
        )
    # The most important one first, whatever the order in which they were found.
    result.sort(key=lambda e: -e.gap_removed)
    return _gathered(result, final.fit.model.core)


def of_like_form(state: Search, problem: Problem, chosen: Trial, rivals: Sequence[Rival]) -> list[Rival]:
    """Rivals that err hardly more than the chosen set does, where that has not quite the arm's form (:data:`FORM`)."""
    own = chosen.fit.squares - problem.rows
    if own <= 0.0:
        return []
    if not state.inexact and chosen.fit.squares > LITTLE * problem.rows:
        return []
    form = FORM if state.inexact else LITTLE_FORM
    return [r for r in rivals if r.trial.fit.squares - problem.rows <= form * own]


def _removed(state: Search, key: tuple[str, str], noise: float) -> float:
    """Share of the excess on the held-out logs that comes back when the set is refitted without an effect."""
    smaller, larger = state.smaller.get(key), state.whole
    if smaller is None or larger is None:
        return 0.0
    return share_brought(state.plain.prediction, smaller.prediction, larger.prediction, noise)


def _alternative(rival: Rival) -> Alternative:
    """An effect of a trial in place of a named one, with its numbers as they were refitted; without intervals."""
    fit, number = rival.trial.fit, rival.number
    candidate, term = rival.trial.candidates[number], fit.model.effects[number]
    values = term.elements([float(v) for v in fit.x[fit.model.place(number)]])
    return _with_numbers(candidate.kind, candidate.where, together(values, candidate.plan.adding))


def _promised(entry: excitation.Best | None, kind: str, where: str) -> Alternative:
    """An effect that was not refitted, with the numbers that the screening promises it."""
    if entry is None:
        return Alternative(kind=kind, where=where)
    term, start = entry.scored.candidate.term(entry.scored.strengths, core_ranges())
    plan = entry.scored.candidate.plan
    # Where probes stand for something else, the start of a fit is what they promise.
    named = () if plan.probes is not None else plan.strengths
    strengths = dict(zip((s.name for s in named), entry.scored.strengths, strict=False))
    x = [
        c.coordinate(strengths[number_of(c)]) if number_of(c) in strengths else v
        for c, v in zip(term.coordinates, start, strict=True)
    ]
    return _with_numbers(kind, where, together(term.elements(x), plan.adding))


def _with_numbers(kind: str, where: str, values: Mapping[str, float]) -> Alternative:
    """An alternative with its numbers in the units of the registry, without intervals."""
    units = core_ranges()
    numbers = {name: Number(value=value, unit=units(kind, name)[0]) for name, value in values.items()}
    return Alternative(kind=kind, where=where, parameters=numbers)


def _gathered(effects: Sequence[Effect], core: Mapping[str, Any]) -> list[Effect]:
    """Effects of one kind at nested places as one: the most important of them with the others as its corrections."""
    result: list[Effect] = []
    for effect in effects:
        for k, main in enumerate(result):
            if main.kind == effect.kind and nested(main.where, effect.where, core):
                more = [Correction(where=effect.where, parameters=p) for p in effect.elements or [effect.parameters]]
                result[k] = main.model_copy(update={"corrections": [*main.corrections, *more]})
                break
        else:
            result.append(effect)
    return result


@dataclass(frozen=True)
class _Element:
    """One element of an effect: its numbers in the parameter file, in each bootstrap repeat, and those on bounds."""

    kind: str
    values: dict[str, float]
    repeats: tuple[dict[str, float], ...]
    on_bound: frozenset[str]


def _elements_of(fit: Fit, number: int, draws: Array) -> list[_Element]:
    """The elements of one effect of the model; not those of a bank that have come out as nothing."""
    term, place = fit.model.effects[number], fit.model.place(number)
    values = term.elements([float(v) for v in fit.x[place]])
    repeats = [term.elements([float(v) for v in fit.x[place] + d]) for d in draws[:, place]]
    strengths = {number_of(c) for c in term.coordinates if element_of(c) is not None}
    on_bound = frozenset(term.on_bound(fit.x[place]))
    return [
        _Element(term.kind, own, tuple(r[k] for r in repeats), on_bound)
        for k, own in enumerate(values)
        if not strengths or any(own[name] for name in strengths)
    ]


def _numbers(elements: Sequence[_Element], adding: Sequence[str] = ()) -> dict[str, Number]:
    """The numbers of elements together with their intervals, whatever coordinates they were fitted in."""
    ranges = core_ranges()
    values = together([e.values for e in elements], adding)
    repeats = [together(same, adding) for same in zip(*(e.repeats for e in elements), strict=True)]
    result = {}
    for name, value in values.items():
        found = np.array([repeat[name] for repeat in repeats])
        interval = None
        if np.any(np.abs(found - found[0]) > 1e-12 * np.abs(found[0])):
            low, high = np.quantile(found, [0.025, 0.975])
            interval = (float(low), float(high))
        result[name] = Number(
            value=value,
            unit=ranges(elements[0].kind, name)[0],
            ci95=interval,
            at_bound=any(name in e.on_bound for e in elements),
        )
    return result
