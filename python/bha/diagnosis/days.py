"""What is another number on another day: rest lengths, the place of the camera, the weather.

What: of one log, which values of these numbers make a model show it best, with its initial state and, under commands,
what stood in the chambers before it; all else as it was identified. Least squares with the numbers' spreads from day to
day as priors, the log simulated again at every step: a sum of derivatives is not what another rest length does to an
arm that swings.
Source: Gauss-Newton. Limits: no days among the logs of a fit; these share one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import STATE_DEVIATION
from bha.diagnosis.preparation import preceded_in_motion
from bha.errors import ConvergenceError
from bha.estimation.free import FreeParameter, resolve
from bha.estimation.memories import DEVIATION as MEMORY_DEVIATION
from bha.estimation.records import Record, Window
from bha.parameters import paths

if TYPE_CHECKING:
    from bha.diagnosis.fit import Fit
    from bha.estimation.engine import Linearized, Model

Array = NDArray[np.float64]

#: Numbers of the plain model that are others from day to day, and the pressure of the air: by how much, in their units.
SPREADS = {"rest_length": 5e-3, "camera_position": 0.02, "ambient_pressure": 1e3}
OF_A_SESSION = frozenset(SPREADS) - {"ambient_pressure"}
#: Steps at most; the share of the loss below which a step brings nothing any more.
STEPS, LITTLE = 8, 0.01


@dataclass(frozen=True)
class Day:
    """The day of a log, as a model sees it.

    Attributes:
        shift: by how much coordinates are others, those of the plain model and last that of the ambient pressure.
        record: the log, with what stood in the chambers before it.
        state: its initial state.
        text: the numbers in words.
    """

    shift: Array
    record: Record
    state: Array
    text: str


def day_of(fit: Fit, record: Record, state: Array) -> Day:
    """The day of a log under a model, from its initial state as the model of the fit's days has it.

    The fit's own day where that cannot be simulated.
    """
    model = _with_weather(fit.model.on([record]))
    count = len(model.plain)
    which = [k for k, c in enumerate(model.plain) if paths.key_of(c.path) in SPREADS]
    here = _shifted(fit.x, np.zeros(count))
    own = [(model.plain[k], float(here[k])) for k in which]
    weights = np.array([c.slope(z) / SPREADS[paths.key_of(c.path)] for c, z in own]) ** 2
    # A log whose first readings do not count does not tell how it begins.
    lengths = 3 * model.sections
    deviations = np.repeat([*STATE_DEVIATION, MEMORY_DEVIATION], [lengths, lengths, len(state) - 2 * lengths])
    weights = np.concatenate([weights, deviations**-2.0])
    found, least = Day(np.zeros(count), record, state, ""), np.inf
    begun, shift, step = state, np.zeros(count), np.zeros(len(weights))
    for _ in range(STEPS):
        shift = shift.copy()
        shift[which] += step[: len(which)]
        state = state + step[len(which) :]
        try:
            x = _shifted(fit.x, shift)
            model = model.on(preceded_in_motion(model, x))
            [shown] = model.linearize(x, [Window(0, 0, len(record))], state[None], which=which)
        except ConvergenceError:
            break
        left, table = _left(record, shown)
        moved = np.concatenate([shift[which], state - begun])
        loss = float(left @ left + weights @ moved**2)
        if not loss < least:
            break
        done, least = loss > (1.0 - LITTLE) * least, loss
        found = Day(shift, model.records[0], state, "")
        if done:
            break
        step = _step(table, left, weights, moved)
    return replace(found, text=_in_words(found, model, fit.x)) if np.isfinite(least) else found


def on_days(model: Model, x: Array, states: Sequence[Array], days: Sequence[Day]) -> list[Array]:
    """What a model shows of its records, each on its day."""
    there = _with_weather(model)
    runs = [
        there.run(_shifted(x, day.shift), Window(k, 0, len(there.records[k])), state)
        for k, (state, day) in enumerate(zip(states, days, strict=True))
    ]
    return there.integration.run(runs)


def _with_weather(model: Model) -> Model:
    """The model with the ambient pressure as its last plain coordinate."""
    return replace(model, plain=(*model.plain, *resolve(model.parameters, [FreeParameter("ambient_pressure")])))


def _shifted(x: Array, shift: Array) -> Array:
    """Coordinates of the model with the weather: those of the one without, on another day."""
    last = len(shift) - 1
    return np.concatenate([x[:last] + shift[:last], shift[last:], x[last:]])


def _left(record: Record, shown: Linearized) -> tuple[Array, Array]:
    """What a model leaves of a log, over the noise, and its derivatives by the numbers of the day and the state."""
    outputs, by_x, by_state = shown
    noise = np.broadcast_to(record.noise, record.measured.shape)[record.usable]
    left = (record.measured - outputs)[record.usable] / noise
    return left, np.concatenate([by_x, by_state], axis=2)[record.usable] / noise[:, None]


def _step(table: Array, left: Array, weights: Array, moved: Array) -> Array:
    normal, right = table.T @ table + np.diag(weights), table.T @ left - weights * moved
    scale = np.sqrt(np.diag(normal))
    return np.asarray(np.linalg.solve(normal / np.outer(scale, scale), right / scale) / scale)


def _in_words(day: Day, model: Model, x: Array) -> str:
    shift, at, texts = day.shift, _shifted(x, day.shift), []
    for k, c in enumerate(model.plain):
        if paths.key_of(c.path) in SPREADS:
            change = c.value(float(at[k])) - c.value(float(at[k] - shift[k]))
            texts.append(f"{c.name} {1e3 * change:+.2g} mm" if c.unit == "m" else f"{c.name} {change:+.2g} {c.unit}")
    return f"{day.record.name}: {', '.join(texts)}"
