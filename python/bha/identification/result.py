"""What identification gives back: estimates with intervals, what is not known, what is left, the parameter file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.estimation.disturbed import Disturbed
from bha.estimation.free import Coordinate
from bha.estimation.lags import CommonTime
from bha.estimation.preload import typical
from bha.estimation.records import Record
from bha.estimation.refinement import Refinement
from bha.estimation.strays import without_strays
from bha.identification.holdout import DEVIATIONS, NOISES, Prediction, left_open, predict
from bha.identification.identifiability import Combination, unknown_combinations
from bha.identification.provenance import Mark, marked
from bha.identification.residuals import ChannelResidual, channel_residuals
from bha.identification.words import joined, spoken
from bha.parameters import ArmParameters, paths
from bha.support.shown import frame, html_table, short_repr, span

Array = NDArray[np.float64]

#: A fit that leaves more than this many times the sensor noise lacks physics, not parameters.
GAP = 1.5
#: Mean squares of white residuals between which a noise model may be right: on both sides of one.
WHITE = (0.6, 1.6)
#: Distance from the prior's mean, in its standard deviations, that is reported.
_SURPRISE = 2.5


@dataclass(frozen=True)
class Estimate:
    """One estimated parameter, in SI units.

    Attributes:
        name: its path, with its sessions where it has some.
        path: its path in the parameter file.
        sessions: the sessions whose logs it acts on; none for all.
        unit: unit of the numbers.
        start: value the fit started from.
        value: estimate.
        standard_error: its standard error.
        interval: 95 % interval.
        identified: whether the data tell it; if not, the value is mostly that of its prior.
        at_bound: whether it stopped at one of its bounds.
    """

    name: str
    path: str
    sessions: tuple[str, ...]
    unit: str
    start: float
    value: float
    standard_error: float
    interval: tuple[float, float]
    identified: bool
    at_bound: bool


@short_repr
@dataclass(frozen=True)
class HeldOut:
    """A log that took no part in the fit, predicted before and after it.

    Attributes:
        before: prediction of the arm the fit started from.
        after: prediction of the identified arm.
        open: what the logs of the fit leave open of that, m, standard deviation RMS over the log, shape (C,); NaN where
            it is not known.
    """

    before: Prediction
    after: Prediction
    open: Array

    @property
    def asks_for_more(self) -> list[str]:
        """Channels that are missed by more than noise, and by no more than the logs of the fit leave open."""
        rec, rms = self.after.record, self.after.rms
        rest = np.sqrt(np.maximum(rms**2 - rec.noise**2, 0.0))
        asked = (rms > NOISES * rec.noise) & (self.open > rec.noise) & (rest < DEVIATIONS * self.open)
        return [channel for channel, more in zip(rec.channels, asked, strict=True) if more]


@dataclass(frozen=True)
class Identification:
    """The result of an identification.

    Attributes:
        start: the arm it started from.
        refinement: the fit.
        estimates: the parameters.
        correlation: correlation matrix of the estimates on their coordinates, shape (p, p); NaN where not known.
        unknown: combinations of parameters that the data do not tell.
        residuals: what is left, per log and channel.
        held_out: logs that took no part.
        warnings: what a reader must know before using the values.
        notes: what the values rest on: the scale of forces, and where the fit began.
        common_times: under commands, what lag of the pressures and damping come to together, section by section.
    """

    start: Arm
    refinement: Refinement
    estimates: tuple[Estimate, ...]
    correlation: Array
    unknown: tuple[Combination, ...]
    residuals: tuple[ChannelResidual, ...]
    held_out: tuple[HeldOut, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...] = ()
    common_times: tuple[CommonTime, ...] = ()

    def __repr__(self) -> str:
        """The fit in a line; ``estimates`` has the numbers."""
        told = sum(estimate.identified for estimate in self.estimates)
        logs = len(self.refinement.problem.model.records)
        outcome = self.refinement.outcome
        state = "converged" if outcome.converged else "NOT converged"
        left = max((r.rms / r.noise for r in self.residuals if r.noise), default=float("nan"))
        by = "1 log" if logs == 1 else f"{logs} logs"
        return (
            f"Identification({self.start.name!r}: {told} of {len(self.estimates)} parameters told by {by}, "
            f"{state} after {outcome.iterations} steps, leaves at most {left:.3g} times the noise)"
        )

    def _repr_html_(self) -> str:
        """Its estimates, for notebooks."""
        rows = [
            (e.name, e.unit, e.start, e.value, span(*e.interval), e.identified, e.at_bound or None)
            for e in self.estimates
        ]
        headings = ("parameter", "unit", "start", "value", "95 % interval", "told by the logs", "at a bound")
        return html_table(repr(self), headings, rows, notes=[*self.warnings, *self.notes])

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` of the estimates, one a row, with the parameter's name as index; SI units.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        columns: dict[str, list[Any]] = {
            name: [getattr(e, name) for e in self.estimates]
            for name in ("name", "unit", "start", "value", "standard_error")
        }
        columns |= {end: [e.interval[k] for e in self.estimates] for k, end in enumerate(("low", "high"))}
        columns |= {name: [getattr(e, name) for e in self.estimates] for name in ("identified", "at_bound")}
        return frame(columns, "name")

    def _information(self) -> Array | None:
        """What the logs tell of the values, SI units, without priors, shape (p, p); None where it is not known."""
        known = self.refinement.uncertainty
        if known is None:
            return None
        z = self.refinement.outcome.point.z
        slopes = np.array([c.slope(float(entry)) for c, entry in zip(self.refinement.coordinates, z, strict=True)])
        return np.asarray(known.information / known.inflation / np.outer(slopes, slopes))

    @property
    def _records(self) -> tuple[Record, ...]:
        return self.refinement.problem.model.records

    @property
    def converged(self) -> bool:
        """Whether the fit converged."""
        return self.refinement.outcome.converged

    @property
    def gap(self) -> float:
        """How many times the noise is left in the channel in which it is most; 1 where all is noise."""
        return max([1.0, *(r.rms / r.noise for r in self.residuals)])

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it; what was reached is kept."""
        return self.refinement.outcome.interrupted

    @property
    def sessions(self) -> tuple[str, ...]:
        """The sessions that have numbers of their own; none where everything is shared."""
        return tuple(dict.fromkeys(name for c in self.refinement.coordinates for name in c.sessions))

    def parameters(self, session: str = "") -> ArmParameters:
        """The identified parameters, as logs of a session see them, with provenance.

        Raises:
            InputError: numbers differ between sessions, and none of these is named.
        """
        if self.sessions and session not in self.sessions:
            of = ", ".join(c.name for c in self.refinement.coordinates if c.sessions)
            raise InputError(
                f"session {session!r}: {of} differ between sessions; name one of {', '.join(self.sessions)}"
            )
        fitted = [rec for rec in self.refinement.problem.model.records if not session or rec.session == session]
        found = typical(self.refinement.arm_of(session), fitted)
        return marked(found, _marks(found, self, session))

    def arm(self, session: str = "") -> Arm:
        """The identified arm."""
        return Arm(self.parameters(session))

    def summary(self) -> dict[str, Any]:
        """Everything as plain values, for JSON."""
        outcome = self.refinement.outcome
        return {
            "arm": self.start.name,
            "converged": outcome.converged,
            "interrupted": outcome.interrupted,
            "message": outcome.message,
            "iterations": outcome.iterations,
            "seconds": self.refinement.seconds,
            "method": self.refinement.problem.model.integration.method,
            "step": self.refinement.problem.model.integration.step,
            "parameters": [vars(e) for e in self.estimates],
            "correlation": self.correlation,
            "information": self._information(),
            "unknown": [{"text": c.text, "names": c.names, "deviation": _finite(c.deviation)} for c in self.unknown],
            "residuals": [vars(r) for r in self.residuals],
            "held_out": [_held_out_summary(h) for h in self.held_out],
            "warnings": self.warnings,
            "notes": self.notes,
            "sessions": {name: [rec.name for rec in self._records if rec.session == name] for name in self.sessions},
            "changes": {rec.name: dict(rec.changes) for rec in self._records if rec.changes},
            "common_times": [vars(time) for time in self.common_times],
        }


def identification(start: Arm, refinement: Refinement, held_out: Sequence[Record] = ()) -> Identification:
    """Judge a refinement: what is known, what is left, how well held-out logs are predicted."""
    coordinates, known = refinement.coordinates, refinement.uncertainty
    count = len(coordinates)
    correlation = np.full((count, count), np.nan)
    unknown: tuple[Combination, ...] = ()
    identified = [False] * count
    if known is not None:
        deviations = np.sqrt(np.diag(known.covariance))
        correlation = known.covariance / np.outer(deviations, deviations)
        unknown = unknown_combinations(coordinates, known.information, known.inflation)
        identified = _told(coordinates, known.information, known.inflation)
    estimates = tuple(
        Estimate(
            name=c.name,
            path=c.path,
            sessions=c.sessions,
            unit=c.unit,
            start=c.start,
            value=float(value),
            standard_error=float(error),
            interval=(float(interval[0]), float(interval[1])),
            identified=told,
            at_bound=bool(min(z - c.bounds[0], c.bounds[1] - z) < 1e-6),
        )
        for c, value, error, interval, told, z in zip(
            coordinates,
            refinement.values,
            refinement.standard_errors,
            refinement.intervals,
            identified,
            refinement.outcome.point.z,
            strict=True,
        )
    )
    residuals = tuple(_left(refinement, start))
    # Who interrupts waits for no prediction.
    held = () if refinement.outcome.interrupted else tuple(_held_out(start, refinement, held_out))
    warnings = (*_warnings(refinement, estimates, unknown, residuals), *_asking(held))
    return Identification(start, refinement, estimates, correlation, unknown, residuals, held, warnings)


def _told(coordinates: Sequence[Coordinate], information: Array, inflation: float) -> list[bool]:
    """Which parameters have a standard error below one half in z without help from their priors."""
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    values = np.maximum(values, 1e-12 * values[-1])
    variances = inflation * np.sum(vectors**2 / values, axis=1)
    return [bool(v < 0.25) for v in variances]


def _left(refinement: Refinement, arm: Arm) -> list[ChannelResidual]:
    problem, point = refinement.problem, refinement.outcome.point
    errors = []
    predictions = problem.model.predict(point.z, problem.windows, point.states)
    for window, predicted in zip(problem.windows, predictions, strict=True):
        rec = problem.model.records[window.record]
        rows = slice(window.first, window.last)
        errors.append(np.where(rec.usable[rows], rec.measured[rows] - predicted, np.nan))
    records = list(problem.model.records)
    if refinement.noises is not None:
        records = [rec.with_noise(refinement.noises.noise(k).sensor) for k, rec in enumerate(records)]
    return channel_residuals(records, problem.windows, errors, arm.inputs)


def _held_out(start: Arm, refinement: Refinement, records: Sequence[Record]) -> list[HeldOut]:
    found = []
    for rec in records:
        before = predict(start, [rec])[0]
        after = predict(refinement.arm_of(rec.session), [rec])[0]
        sound = without_strays([rec], [after.predicted])[0]
        unsure = np.full(len(rec.channels), np.nan)
        if refinement.uncertainty is not None:
            model = refinement.problem.model.on((rec,))
            unsure = left_open(model, refinement.outcome.point.z, refinement.uncertainty.covariance)
        found.append(HeldOut(replace(before, record=sound), replace(after, record=sound), unsure))
    return found


def _warnings(
    refinement: Refinement,
    estimates: Sequence[Estimate],
    unknown: Sequence[Combination],
    residuals: Sequence[ChannelResidual],
) -> list[str]:
    said = []
    outcome = refinement.outcome
    if outcome.interrupted:
        said.append(
            f"the fit was {outcome.message}: its values are those of the best point so far, without intervals; to go "
            "on, run the same command with the file that is written in the place of the arm's"
        )
    elif not outcome.converged:
        said.append(f"the fit did not converge: {outcome.message}; the values are those of its best point")
    if refinement.uncertainty is None and not outcome.interrupted:
        said.append("standard errors could not be computed at the best point")
    for c, e, z in zip(refinement.coordinates, estimates, outcome.point.z, strict=True):
        low, high = c.range
        if e.at_bound or not low <= e.value <= high:
            said.append(
                f"{e.name} = {e.value:.4g} {e.unit} is at the edge of what is physical or allowed "
                f"([{max(low, c.lower):g}, {min(high, c.upper):g}]): it stands in for something the model lacks"
            )
            continue
        mean, deviation = c.prior
        if abs(z - mean) > _SURPRISE * deviation:
            said.append(
                f"{e.name} = {e.value:.4g} {e.unit} lies {abs(z - mean) / deviation:.1f} standard deviations from its "
                "prior: check the prior, or what the model lacks"
            )
    said += [f"not identified: {combination.text}" for combination in unknown]
    if refinement.noises is not None:
        said += _of_noises(refinement.noises, refinement.problem.model.records)
    large = [r for r in residuals if r.rms > GAP * r.noise]
    if large:
        worst = max(large, key=lambda r: r.rms / r.noise)
        said.append(
            f"the fit leaves more than the sensors' noise in {len(large)} of {len(residuals)} channels (most in "
            f"{worst.channel} of {worst.record}: {1e3 * worst.rms:.2g} mm, noise {1e3 * worst.noise:.2g} mm): the "
            "model lacks physics there, and the intervals are those of the best parameters of a model that is not "
            "quite right; `bha diagnose` names what is missing"
        )
    return said


def _asking(held_out: Sequence[HeldOut]) -> list[str]:
    """What held-out logs ask for that the logs of the fit do not tell."""
    said = []
    for held in held_out:
        if channels := held.asks_for_more:
            worst = max(channels, key=lambda channel: held.after.rms[held.after.record.channels.index(channel)])
            place = held.after.record.channels.index(worst)
            said.append(
                f"{held.after.record.name} asks for what the logs of the fit do not tell: {joined(channels)} "
                f"{'is' if len(channels) == 1 else 'are'} missed by up to {1e3 * held.after.rms[place]:.2g} mm, and "
                f"{1e3 * held.open[place]:.2g} mm have to be expected there; fit logs that move the arm so as well "
                "(bha excite proposes some)"
            )
    return said


def _of_noises(noises: Disturbed, records: Sequence[Record]) -> list[str]:
    """What the noises say of the model, and whether they are right themselves."""
    said = []
    if words := noises.unlogged_words():
        said.append(
            f"what acts on the arm and is in no log, or is not in the model, is as much as pressures of {words}; the "
            "intervals are those of a fit that knows this"
        )
    for number, rec in enumerate(records):
        squares = noises.mean_square(number)
        wrong = [c for c, s in zip(rec.channels, squares, strict=True) if not WHITE[0] < s < WHITE[1]]
        if wrong:
            said.append(
                f"{rec.name}: the noise model is wrong in {', '.join(wrong)}: mean squares of the white residual are "
                f"{', '.join(f'{s:.2g}' for s in squares)} where one is right; the intervals do not hold"
            )
    return said


def _marks(parameters: ArmParameters, result: Identification, session: str) -> Iterator[Mark]:
    """How well each number of the parameters, as logs of a session see them, is known."""
    records = result.refinement.problem.model.records
    state = "interrupted" if result.interrupted else "not converged" if not result.converged else "left without errors"
    for coordinate, estimate in zip(result.refinement.coordinates, result.estimates, strict=True):
        if coordinate.sessions and session not in coordinate.sessions:
            continue
        logs = tuple(rec for rec in records if not coordinate.sessions or rec.session in coordinate.sessions)
        for member in coordinate.members:
            value = paths.get_value(parameters, member)
            factor = value / estimate.value if paths.is_group(coordinate.path) else 1.0
            low, high = sorted((estimate.interval[0] * factor, estimate.interval[1] * factor))
            if not np.isfinite(estimate.standard_error):
                yield Mark(member, None, None, False, f"the fit was {state}: {spoken(member)}", logs)
                continue
            told = result.converged and _narrows(coordinate, estimate)
            notes = [] if result.converged else [f"the fit was {state}: {spoken(member)}"]
            notes += [] if estimate.identified else [f"not told by these logs alone: {spoken(member)}"]
            if coordinate.sessions:
                notes.append(f"of session {' and '.join(coordinate.sessions)}: {spoken(member)}")
            yield Mark(member, (low, high), abs(estimate.standard_error * factor), told, "; ".join(notes), logs)


def _narrows(coordinate: Coordinate, estimate: Estimate) -> bool:
    """Whether the interval is less than half as wide as the prior's: else the value is the prior's, and assumed.

    A prior that is wider than a factor of five, as that of a mere guess, counts as one of a factor of five.
    """
    slope = abs(estimate.value) if coordinate.logarithmic else coordinate.scale
    prior = min(coordinate.prior[1], math.log(5.0)) if coordinate.logarithmic else coordinate.prior[1]
    return estimate.standard_error < 0.5 * prior * slope


def _held_out_summary(held: HeldOut) -> dict[str, Any]:
    rec = held.after.record
    return {
        "log": rec.name,
        "channels": rec.channels,
        "noise": rec.noise,
        "rms_before": [_finite(x) for x in held.before.rms],
        "rms_after": [_finite(x) for x in held.after.rms],
        "left_open": [_finite(x) for x in held.open],
        "head_rms_before": {k: _finite(v) for k, v in held.before.head_rms.items()},
        "head_rms_after": {k: _finite(v) for k, v in held.after.head_rms.items()},
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
