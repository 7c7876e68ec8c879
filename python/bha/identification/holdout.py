"""The test of a fit: whole logs that took no part in it, predicted from their first moments.

Beside what a prediction misses stands what it has to be expected to miss, for the logs of the fit do not tell all
numbers, and an error that they leave open is no sign of physics that the model lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.arm import Arm
from bha.errors import ConvergenceError
from bha.estimation.engine import Model
from bha.estimation.first_second import first_second
from bha.estimation.integration import STEPS, by, choose_integration
from bha.estimation.records import Record, Window
from bha.estimation.runs import Integration
from bha.support.shown import short_repr

Array = NDArray[np.float64]

#: An error counts as more than the noise beyond this many times it, and is what the logs of a fit leave open where the
#: rest of it is at most this many of the standard deviations that they do.
NOISES, DEVIATIONS = 1.5, 3.0


@short_repr
@dataclass(frozen=True)
class Prediction:
    """A record predicted by simulation from its start to its end.

    Attributes:
        record: the record.
        predicted: predicted channels, m, shape (m, C); NaN from where the simulation failed.
        failed: time at which it failed, s, or None.
    """

    record: Record
    predicted: Array
    failed: float | None

    @property
    def error(self) -> Array:
        """Measured minus predicted, m, shape (m, C); NaN where a measurement does not count."""
        return np.where(self.record.usable, self.record.measured - self.predicted, np.nan)

    @property
    def rms(self) -> Array:
        """Root mean square error of each channel, m, shape (C,); NaN for a simulation that failed."""
        if self.failed is not None:
            return np.full(len(self.record.channels), np.nan)
        counts = np.maximum(self.record.usable.sum(axis=0), 1)
        return np.asarray(np.sqrt(np.nansum(self.error**2, axis=0) / counts))

    @property
    def head_rms(self) -> dict[int, float]:
        """Root mean square distance of measured and predicted head, m, for each section whose head was measured."""
        squares: dict[int, float] = {}
        for channel, rms in zip(self.record.channels, self.rms, strict=True):
            quantity = names.quantity(channel)
            if quantity is not None and quantity.kind == "position":
                squares[quantity.section] = squares.get(quantity.section, 0.0) + float(rms) ** 2
        return {section: float(np.sqrt(square)) for section, square in squares.items()}


def left_open(model: Model, z: Array, covariance: Array) -> Array:
    """What the first record of a model may show besides what it does at ``z``: standard deviations, m, shape (C,).

    RMS over the record, to first order; NaN where the simulation fails.

    Args:
        model: the model.
        z: coordinates, shape (p,).
        covariance: theirs, shape (p, p).
    """
    whole = [Window(0, 0, len(model.records[0]))]
    try:
        begun = model.guesses(z, whole)
        model = choose_integration(model, z, whole, begun)
        told, state = first_second(model, z, 0, begun[0])
        _, by_z, _ = next(model.on((told,)).linearize(z, whole, state[None], by_states=False))
    except ConvergenceError:
        return np.full(len(model.records[0].channels), np.nan)
    return np.asarray(np.sqrt(np.mean(np.einsum("mcp,pq,mcq->mc", by_z, covariance, by_z, optimize=True), axis=0)))


def predict(
    arm: Arm, records: Sequence[Record], *, step: float | None = None, threads: int | None = None
) -> list[Prediction]:
    """Predict whole records with an arm; the initial state of each is estimated from its first second.

    The integrator is chosen for each record unless ``step`` (of the classical method) is given. A simulation that fails
    is reported in its place.
    """
    return [_predict(arm, rec, step, threads) for rec in records]


def _predict(arm: Arm, rec: Record, step: float | None, threads: int | None) -> Prediction:
    model = Model(arm.parameters, (), (rec,), Integration(threads=threads))
    whole, none = [Window(0, 0, len(rec))], np.zeros(0)
    states = model.guesses(none, whole)
    if step is not None:
        model = by(model, step=step)
    else:
        try:
            model = choose_integration(model, none, whole, states)
        except ConvergenceError:
            model = by(model, step=STEPS[-1])
    try:
        told, state = first_second(model, none, 0, states[0])
        model, states = model.on((told,)), state[None]
    except ConvergenceError:
        pass  # the run from the guess fails, and says so
    predicted = model.predict(none, whole, states)[0]
    bad = ~np.all(np.isfinite(predicted), axis=1)
    return Prediction(rec, predicted, float(rec.time[np.argmax(bad)]) if bad.any() else None)
