"""The test of a fit: whole logs that took no part in it, predicted from their first moments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.arm import Arm
from bha.errors import ConvergenceError
from bha.identify.engine import Model
from bha.identify.initial import guess_state
from bha.identify.integration import choose_integration
from bha.identify.records import Record, Window
from bha.identify.solver import Point, Problem, Residuals, solve

Array = NDArray[np.float64]

#: From this much of a log its initial state is estimated, s; the rest is prediction.
START_SECONDS = 1.0


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
        """Root mean square distance between measured and predicted head, m, for each section whose head was measured."""
        squares: dict[int, float] = {}
        for channel, rms in zip(self.record.channels, self.rms, strict=True):
            quantity = names.quantity(channel)
            if quantity is not None and quantity.kind == "position":
                squares[quantity.section] = squares.get(quantity.section, 0.0) + float(rms) ** 2
        return {section: float(np.sqrt(square)) for section, square in squares.items()}


def predict(arm: Arm, records: Sequence[Record], *, step: float | None = None, threads: int | None = None) -> list[Prediction]:
    """Predict whole records with an arm; the initial state of each is estimated from its first second.

    A simulation that fails is reported in its place.
    """
    model = Model(arm.parameters, (), tuple(records), threads=threads)
    whole = [Window(k, 0, len(rec)) for k, rec in enumerate(records)]
    states = np.stack([guess_state(arm, rec, 0) for rec in records])
    if step is not None:
        model = replace(model, step=step)
    else:
        model = choose_integration(model, np.zeros(0), whole, states)
    states = _start_states(model, states)
    predictions = []
    for rec, predicted in zip(records, model.predict(np.zeros(0), whole, states), strict=True):
        bad = ~np.all(np.isfinite(predicted), axis=1)
        predictions.append(Prediction(rec, predicted, float(rec.time[np.argmax(bad)]) if bad.any() else None))
    return predictions


def _start_states(model: Model, guesses: Array) -> Array:
    """The initial states that fit the first second of each record best."""
    pieces = []
    for k, rec in enumerate(model.records):
        last = int(np.searchsorted(rec.time, rec.time[0] + START_SECONDS))
        pieces.append(Window(k, 0, min(max(last, 8), len(rec))))
    residuals = Residuals(tuple(rec.noise for rec in model.records), huber=np.inf)
    states = guesses.copy()
    for k, window in enumerate(pieces):
        alone = replace(model, records=(model.records[k],))
        problem = Problem(
            alone,
            (replace(window, record=0),),
            replace(residuals, scale=(residuals.scale[k],)),
            guesses[k : k + 1],
            (np.zeros(0), np.ones(0)),
        )
        try:
            states[k] = solve(problem, Point(np.zeros(0), guesses[k : k + 1]), max_iterations=6, tolerance=1e-3).point.states[0]
        except ConvergenceError:
            continue
    return states
