"""Valves that vent slower than they fill, or the other way round: a lag of the plain model that is a finding.

What: that commands lag is no finding, every arm's do (:mod:`bha.diagnosis.valves`). That they lag by several times as
much one way as the other is one: no damping, no dead time and no lag that is alike both ways stands for it, and an
arm's file knows it only if somebody measured pressures. It is named where the two times are told apart by more than
``UNLIKE`` and a model whose commands lag alike both ways, fitted anew, predicts the left-out logs worse by a share that
is worth it.
Limits: the lag of all inputs together. An arm that comes back slower than it bends lags unlike, too, and of an arm that
does not swing commands do not tell whose the time is: there it is the class "lag of the pressures or damping"
(:mod:`bha.diagnosis.slowness`).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import Fit, Problem, evaluate, improve
from bha.diagnosis.holdout import Holdout, Prediction, rms_errors, share_removed
from bha.diagnosis.refit import GREATEST_STEP, ITERATIONS, RENEWALS, TOLERANCE
from bha.diagnosis.result import Diagnosis, Effect
from bha.diagnosis.valves import LAG, lags_of
from bha.errors import ConvergenceError
from bha.estimation.engine import Model

Array = NDArray[np.float64]

#: Ratio of the times of filling and venting from which they are a finding: regulators of one sort, and what hoses make
#: of them, stay within it.
UNLIKE = 2.0
#: Least share of the excess error on held-out logs that lags unlike both ways remove.
SHARE = 0.1


@dataclass(frozen=True)
class Unlike:
    """What lags that are not alike both ways bring.

    Attributes:
        before: error on the held-out logs with one lag for both ways, m RMS.
        after: the same with two.
        removed: share of the excess error that they remove.
    """

    before: float
    after: float
    removed: float


def unlike(
    problem: Problem, fit: Fit, holdout: Holdout, prediction: Prediction, lag: Effect | None, noise: float
) -> Unlike | None:
    """What the plain model's lag brings by its two times; None where they are not told apart, or bring too little.

    Args:
        problem: the training logs.
        fit: the plain fit.
        holdout: the held-out logs.
        prediction: these under it.
        lag: the lag as it was found, with intervals; None where there is none.
        noise: error of a right model on the held-out logs, m RMS.
    """
    if lag is None or not _are_told_apart(lag):
        return None
    model, x = alike(fit.model, fit.x)
    other: Fit | None = None
    with suppress(ConvergenceError):
        start = evaluate(problem, model, x, fit.states)
        other = improve(
            problem, start, iterations=ITERATIONS, tolerance=TOLERANCE, renewals=RENEWALS, limit=GREATEST_STEP
        )
    if other is None:
        return None
    before, after = rms_errors(holdout.predict(other.model, other.x), prediction)
    removed = share_removed(before, after, noise)
    return Unlike(before, after, removed) if removed >= SHARE else None


def alike(model: Model, x: Array) -> tuple[Model, Array]:
    """The model with one time of its commands' lag for both ways, and its coordinates at their geometric mean."""
    fill, vent = lags_of(model)
    first, second = model.plain[fill], model.plain[vent]
    both = replace(first, members=(*first.members, *second.members))
    mean = np.sqrt(first.value(float(x[fill])) * second.value(float(x[vent])))
    moved = x.copy()
    moved[fill] = both.coordinate(float(mean))
    plain = [both if k == fill else own for k, own in enumerate(model.plain) if k != vent]
    return replace(model, plain=tuple(plain)), np.delete(moved, vent)


def with_finding(found: Diagnosis, ways: Unlike | None) -> Diagnosis:
    """The diagnosis with the lag of its commands as a name; as it is where that is none, or where setup comes first."""
    if ways is None or found.verdict == "setup":
        return found
    effects = [
        e.model_copy(update={"plain": False, "gap_removed": ways.removed}) if e.plain and e.kind == LAG else e
        for e in found.effects
    ]
    if found.has_names:
        return found.model_copy(update={"effects": effects})
    rest = f"; what is left is {ways.after / found.gap.noise:.1f} times the noise" if found.gap.significant else ""
    reason = (
        f"{100 * ways.removed:.0f} % of the excess error on held-out logs is removed by commands that lag by one time "
        f"when filling and by another when venting, against one time for both{rest}"
    )
    if found.verdict == "unexplained":
        reason = f"{reason}: {found.reason}"
    gap = found.gap.model_copy(update={"before": ways.before, "after": ways.after})
    return found.model_copy(update={"verdict": "named", "reason": reason, "effects": effects, "gap": gap})


def _are_told_apart(lag: Effect) -> bool:
    fill, vent = (lag.parameters[name] for name in ("fill", "vent"))
    if fill.ci95 is None or vent.ci95 is None:
        return False
    apart = fill.ci95[1] < vent.ci95[0] or vent.ci95[1] < fill.ci95[0]
    return apart and max(fill.value, vent.value) > UNLIKE * min(fill.value, vent.value)
