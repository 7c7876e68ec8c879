"""Does what no model explains follow anything that was logged, or was the arm pushed by what no log holds?

What: an arm in a laboratory is pushed by hoses, hands, a sagging supply, all of them without a column. What that leaves
is no gap of the model, however large it is beside the noise of the sensors: no equation in what was logged explains it.
Two tests ask, each by what chance brings: what regressors made of all that was logged predict of the errors on pieces
of time apart (:mod:`bha.diagnosis.follows`), on all logs; and what the candidates of the catalogue explain of the
training logs' residual through the arm's own model (:mod:`bha.diagnosis.screen`).
Physics that the model lacks is a function of what was logged; an unlogged force or pressure is not.
Validity: disturbances that are as large on the logs of the fit as on those held out. Offsets between logs are taken out
of both. A periodic force follows time: one sine a log is asked as well what it predicts of the other pieces of the log.
Noise that lets an arm ring loses its phase from piece to piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.absorbed import absorption, slopes_on
from bha.diagnosis.decide import Decision
from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.follows import Follows, follows
from bha.diagnosis.holdout import Holdout, Prediction
from bha.diagnosis.logged import cells_of, modes_of
from bha.diagnosis.rules import MATERIAL
from bha.diagnosis.screen import Screening
from bha.estimation.records import Record

Array = NDArray[np.float64]

#: Logs that last less than this together, s, tell nothing.
LEAST_TIME = 30.0
#: Pieces of a log for the sine.
QUARTERS = 4
#: Errors follow something where chance does as much with at most this p, and where it is at least this share of their
#: square: a plain model of a real arm is never quite right. A greater share is never called nothing, though chance may
#: bring it: slow errors are few independent numbers.
CHANCE, SHARE, OPEN = 0.01, 0.05, 0.3
#: Share of the errors' square that a sine predicts at most where nothing is missing, share of the excess that the best
#: effects remove, held-out over training RMS error, and the mean error of a log over the rest of its errors.
MOST_PERIODIC, MOST_REMOVED, MOST_GROWN, MOST_OFFSET = 0.35, 0.1, 1.5, 3.0
#: Where chance brings as good a candidate as the best with at most this p, refits say whether it is one: scores are
#: linear, and of a strong effect they see a part.
HINT = 0.1


@dataclass(frozen=True)
class Unlogged:
    """What errors follow.

    Attributes:
        logged: what they follow of what was logged.
        explained: share of the training residual's square that the best candidate explains beyond what the best one
            does of 95 % of residuals that have no cause.
        chance: how often such residuals have one that explains as much: p-value.
        periodic: share of their square that one frequency predicts.
        grown: RMS error about the mean of each log on those held out, over that on those of the fit.
        offset: RMS mean error of the held-out logs over the rest.
        rms: RMS error on the held-out logs about the mean of each, m.
    """

    logged: Follows
    explained: float
    chance: float
    periodic: float
    grown: float
    offset: float
    rms: float

    @property
    def follows_something(self) -> bool:
        """Whether the errors follow what was logged, or time."""
        told = self.logged.chance <= CHANCE and self.logged.share >= SHARE
        candidate = self.chance <= CHANCE and self.explained >= SHARE
        return told or candidate or self.periodic >= MOST_PERIODIC

    @property
    def is_a_disturbance(self) -> bool:
        """Whether errors follow nothing that was logged, as far as they can tell, and are the same in all logs."""
        alike = self.grown < max(MOST_GROWN, self.logged.grown) and self.offset < MOST_OFFSET
        return alike and not self.follows_something and self.logged.share < OPEN

    @property
    def may_be_a_disturbance(self) -> bool:
        """Whether errors follow much, and those that follow nothing do as much once a fit has bent to them."""
        return OPEN <= self.logged.share < self.logged.usual and not self.follows_something

    @property
    def needs_no_search(self) -> bool:
        """Whether it is a disturbance, no candidate comes near to explaining any of it, and it is no larger elsewhere:
        what only a bent fit explains may be physics as well."""
        return self.is_a_disturbance and self.chance > HINT and self.grown < MOST_GROWN

    def judge(self, decision: Decision, noise: float) -> Decision:
        """The decision; ``equivalent`` where what is unexplained is a disturbance.

        What the best effects remove of it is a part that follows what was logged.

        Args:
            decision: on the search.
            noise: RMS error of a right model on the held-out logs, m.
        """
        if decision.verdict != "unexplained" or decision.closure >= MOST_REMOVED:
            return decision
        if self.may_be_a_disturbance:
            text = (
                "these logs do not tell whether it is physics: a fit bends to what unlogged forces or pressures do, "
                "and what is missed then follows pressures, pose and their past as much with p = "
                f"{self.logged.chance:.2g}; log for longer, and faster motions"
            )
            return replace(decision, reason=f"{decision.reason}; {text}")
        if not self.is_a_disturbance:
            return decision
        text = (
            f"the re-identified plain model leaves {1e3 * self.rms:.2g} mm, {self.rms / noise:.1f} times what the "
            "noise of the sensors makes, and that follows nothing that was logged: pressures, pose, rates, their past "
            f"and time predict {100 * self.logged.share:.0f} % of it on stretches apart, as chance does with p = "
            f"{self.logged.chance:.2g}, no candidate explains more of it than chance does (p = {self.chance:.2g}), and "
            f"it is {self.grown:.2f} times as large on held-out logs as on those of the fit; it is what unlogged "
            "forces or pressures do"
        )
        return Decision("equivalent", text, decision.closure)

    def complete(self, decision: Decision, before: float, after: float) -> Decision:
        """The decision where what the best effects leave, of which this is, is a disturbance.

        ``named`` where they show; ``equivalent`` where without them hardly more is missed.

        Args:
            decision: on the search.
            before: RMS error of the plain model on the held-out logs, m.
            after: the same of the best effects, m.
        """
        if decision.verdict != "unexplained" or not self.is_a_disturbance:
            return decision
        text = (
            f"without what was found {before / after:.2f} times as much is missed on held-out logs; what it leaves, "
            f"{1e3 * self.rms:.2g} mm, follows nothing that was logged (p = {self.logged.chance:.2g}; no candidate "
            f"explains more of it than chance does, p = {self.chance:.2g}): it is what unlogged forces or pressures do"
        )
        if before < MATERIAL * after:
            return Decision("equivalent", f"{text}; what was found is not worth a name", decision.closure)
        return Decision("named", text, decision.closure)


def unlogged(
    problem: Problem,
    fit: Fit,
    holdout: Holdout,
    prediction: Prediction,
    screening: Screening,
    seed: int = 0,
) -> Unlogged | None:
    """What the errors of a model follow; None where it runs away, or too little was logged to say."""
    if sum(record.duration for record in (*problem.records, *holdout.problem.records)) < LEAST_TIME:
        return None
    logs = [*zip(problem.records, fit.outputs, strict=True)]
    held = [*zip(holdout.problem.records, prediction.outputs, strict=True)]
    if not all(np.all(np.isfinite(y)) for _, y in (*logs, *held)):
        return None
    before, after = (_scatter(part) for part in (logs, held))
    modes = modes_of(fit)
    slopes = slopes_on(problem, fit, holdout, prediction)
    tables = slopes or [None] * (len(logs) + len(held))
    found = [cells_of(r, y, modes, table) for (r, y), table in zip((*logs, *held), tables, strict=True)]
    cells = [own for own in found if own is not None]
    bent = None
    if slopes is not None and cells:
        own = [k < len(logs) for k, part in enumerate(found) if part is not None]
        bent = absorption(problem, fit, [part.slopes for part in cells if part.slopes is not None], own)
    logged = follows(cells, seed, bent)
    if logged is None or before <= 0.0:
        return None
    periodic = periodic_share([(own.errors, own.step) for own in cells])
    best = screening.ranking[0] if screening.ranking else None
    return Unlogged(
        logged,
        0.0 if best is None else best.share - float(np.quantile(screening.by_chance, 0.95)),
        1.0 if best is None else screening.chance(best.score),
        periodic,
        after / before,
        0.0 if holdout.sessions is not None else offset_of(held),
        after,
    )


def offset_of(part: Sequence[tuple[Record, Array]]) -> float:
    """RMS mean error of logs, in each channel, over the rest of their errors; of records and what a model shows."""
    return mean_error(part) / max(_scatter(part), 1e-12)


def mean_error(part: Sequence[tuple[Record, Array]]) -> float:
    """Mean error of each log and channel, RMS over these, m."""
    means = [
        np.mean((r.measured - y)[r.usable[:, c], c]) for r, y in part for c in range(y.shape[1]) if r.usable[:, c].any()
    ]
    return float(np.sqrt(np.mean(np.square(means)))) if means else 0.0


def _scatter(part: Sequence[tuple[Record, Array]]) -> float:
    """RMS error about the mean of each log and channel, m."""
    squares = [
        np.var((record.measured - y)[record.usable[:, c], c])
        for record, y in part
        for c in range(y.shape[1])
        if record.usable[:, c].any()
    ]
    return float(np.sqrt(np.mean(squares))) if squares else 0.0


def periodic_share(tables: Sequence[tuple[Array, float]]) -> float:
    """Share of the errors' square that the strongest frequency predicts, with its phase in each log.

    Args:
        tables: errors (g, C) of each log about their mean, and the step of its grid, s.
    """
    step = min(step for _, step in tables)
    slowest = 3.0 / min(len(errors) * own for errors, own in tables)
    frequencies = np.arange(slowest, 0.5 / step, 0.1 * slowest)
    power = np.zeros(len(frequencies))
    for errors, own in tables:
        waves = np.exp(-2j * np.pi * frequencies[:, None] * own * np.arange(len(errors)))
        power += np.sum(np.abs(waves @ (errors * np.hanning(len(errors))[:, None])) ** 2, axis=1)
    best = float(frequencies[int(np.argmax(power))]) if len(frequencies) else 0.0
    left = total = 0.0
    for errors, own in tables:
        phase = 2.0 * np.pi * best * own * np.arange(len(errors))
        wave = np.column_stack([np.sin(phase), np.cos(phase)])
        piece = np.arange(len(errors)) * QUARTERS // len(errors)
        for k in range(QUARTERS):
            out = piece == k
            told = np.linalg.lstsq(wave[~out], errors[~out], rcond=None)[0]
            left += float(np.sum((errors[out] - wave[out] @ told) ** 2))
        total += float(np.sum(errors**2))
    return max(0.0, 1.0 - left / total) if total > 0.0 else 0.0
