"""An arm that remembers: what it did before a log says where it stands, and that is a finding whatever its form.

What: under the same pressures such an arm stands elsewhere after each use. Its plain model takes what holds it where a
log begins from that log's first pose (:func:`bha.diagnosis.plain.remembering`); no law from pressures to poses, and no
data sheet, has that. The same model that is held alike in all logs, by forces fitted anew, and begins held-out logs
where it has the arm under their first pressures (:func:`begun_by_law`), is what a law can do. Where it misses held-out
logs by so much more that the memory is at least half of its excess error, as is asked of one effect, the family is
named: what slips (hysteresis, friction) or creeps. Which of them it is first poses do not tell.
Limits: logs that begin at rest; how the hold gives way as the arm moves on is left to the search.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.diagnosis.decide import Thresholds
from bha.diagnosis.fit import Fit, Problem, evaluate, improve
from bha.diagnosis.holdout import Holdout, Prediction, error_of, rms_errors, share_removed, up_to_run_away
from bha.diagnosis.refit import GREATEST_STEP, ITERATIONS, RENEWALS, TOLERANCE
from bha.diagnosis.result import Alternative, Diagnosis, Effect
from bha.errors import BhaError, ConvergenceError
from bha.estimation.engine import Model
from bha.estimation.free import Coordinate, FreeParameter, resolve
from bha.estimation.preload import of_record
from bha.estimation.records import Record
from bha.parameters import paths
from bha.recordings.beginning import preloaded

Array = NDArray[np.float64]

#: The family, the one that has been found most in fabric first.
FAMILY = ("hysteresis", "friction", "creep")
#: Least plausible distance of what holds all logs alike, N and N m, and as a share of itself.
LEAST_HOLD, HOLD_SPREAD = 1e-2, 0.5
#: What splits the family.
EXPERIMENT = (
    "bend the arm and let it come back to the same pressures, then wait there for minutes: what creeps goes on, what "
    "slips stands still"
)


@dataclass(frozen=True)
class Remembered:
    """What it brings to know how each log begins.

    Attributes:
        apart: greatest distance between first poses under like pressures in one output, m.
        before: error on the held-out logs of the model that is held alike in all logs, m RMS.
        after: the same, held in each as its first pose tells.
        removed: share of the excess error that this removes.
    """

    apart: float
    before: float
    after: float
    removed: float


def remembered(
    problem: Problem, fit: Fit, holdout: Holdout, prediction: Prediction, noise: float, limits: Thresholds
) -> Remembered | None:
    """What an arm's memory brings; None where it has none that logs show, or too little to be named.

    Args:
        problem: the training logs.
        fit: the plain fit.
        holdout: the held-out logs.
        prediction: these under it.
        noise: error of a right model on the held-out logs, m RMS.
        limits: share of the excess from which an effect is named.
    """
    if not preloaded(fit.model.parameters):
        return None
    model, x = held_alike(fit.model, fit.x, problem.records)
    known, held = forgetful(problem), forgetful(holdout.problem)
    other: Fit | None = None
    with suppress(ConvergenceError):
        other = improve(
            known,
            evaluate(known, model, x, fit.states),
            iterations=ITERATIONS,
            tolerance=TOLERANCE,
            renewals=RENEWALS,
            limit=GREATEST_STEP,
        )
    if other is None:
        return None
    states = list(prediction.states)
    logs = Holdout(held, states, holdout.readings, blocks=holdout.blocks, sessions=holdout.sessions)
    without = begun_by_law(logs, other)
    if without is None:
        return None
    before, after = rms_errors(without, prediction)
    removed = share_removed(before, after, noise)
    first = np.array([record.resting.values for record in problem.records if record.resting is not None])
    return Remembered(float(np.max(np.ptp(first, axis=0))), before, after, removed) if removed >= limits.half else None


def begun_by_law(logs: Holdout, fit: Fit) -> Prediction | None:
    """Held-out logs under a model that begins each where its law has the arm under the log's first pressures.

    Without that a damping beyond all measure remembers how each log began. None where no pose is held.
    """
    model, states = fit.model.on(logs.problem.records), []
    for number, record in enumerate(logs.problem.records):
        arm, _ = model.shown(fit.x, number)
        if arm is None:
            return None
        with suppress(BhaError):
            lengths = np.asarray(arm.static_lengths(record.drive.pressures[0]))
            states.append(np.concatenate([lengths, np.zeros(len(fit.states[0]) - len(lengths))]))
    if len(states) < len(logs.problem.records):
        return None
    outputs = logs.problem.simulate(model, fit.x, states)
    kept, until = up_to_run_away(logs.problem, outputs)
    return logs.compared(kept, tuple(states), until, error_of(logs.problem, outputs))


def forgetful(problem: Problem) -> Problem:
    """The problem with logs that do not tell how they begin."""
    records = tuple(replace(record, resting=None) for record in problem.records)
    return replace(problem, model=problem.model.on(records))


def held_alike(model: Model, x: Array, records: Sequence[Record]) -> tuple[Model, Array]:
    """The model with one hold of each section for all logs, free about the mean of theirs, and its coordinates."""
    arm = Arm(model.parameters)
    told = [numbers for record in records if (numbers := of_record(arm, record))]
    holds = {path: np.array([numbers[path] for numbers in told]) for path in (told[0] if told else ())}
    means = {path: float(np.mean(values)) for path, values in holds.items()}
    parameters = paths.with_values(model.parameters, means)
    free = [_hold(path, values) for path, values in holds.items()]
    more: tuple[Coordinate, ...] = resolve(parameters, free) if free else ()
    plain = (*model.plain, *more)
    return replace(model, parameters=parameters, plain=plain), np.concatenate([x, np.zeros(len(more))])


def _hold(path: str, values: Array) -> FreeParameter:
    mean = float(np.mean(values))
    spread = max(float(np.std(values)), HOLD_SPREAD * abs(mean), LEAST_HOLD)
    return FreeParameter(path, prior=(mean, spread), logarithmic=False, scale=spread)


def with_memory(found: Diagnosis, memory: Remembered | None) -> Diagnosis:
    """The diagnosis with the family of what an arm remembers by as a name; as it is where setup comes first.

    Where one of the family is named already, that is the name.
    """
    if memory is None or found.verdict == "setup" or any(effect.kind in FAMILY for effect in found.missing):
        return found
    kind, *others = FAMILY
    effect = Effect(
        kind=kind,
        where="all",
        parameters={},
        confidence=1.0,
        one_of=[Alternative(kind=other, where="all") for other in others],
        experiment=EXPERIMENT,
        gap_removed=memory.removed,
    )
    if found.has_names:
        return found.model_copy(update={"verdict": "one_of", "effects": [effect, *found.effects]})
    rest = f"; what is left is {memory.after / found.gap.noise:.1f} times the noise" if found.gap.significant else ""
    reason = (
        f"the arm remembers: under the same pressures it stands up to {1e3 * memory.apart:.2g} mm elsewhere where logs "
        f"begin, and {100 * memory.removed:.0f} % of the excess error on held-out logs is removed by what each log's "
        f"first pose tells of it, against forces that are alike in all logs{rest}"
    )
    if found.verdict == "unexplained":
        reason = f"{reason}: {found.reason}"
    gap = found.gap.model_copy(update={"before": memory.before, "after": memory.after})
    return found.model_copy(
        update={"verdict": "one_of", "reason": reason, "effects": [effect, *found.effects], "gap": gap}
    )
