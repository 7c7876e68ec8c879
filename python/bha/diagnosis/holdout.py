"""Prediction of logs that took no part in the fit: open loop, from an initial state estimated on each of them.

What: outputs, errors by block, and the one metric of a diagnosis: the RMS error in metres over the blocks that count,
and the share of its square beyond noise that effects remove (:func:`rms_errors`, :func:`share_removed`). The gap, the
closure, the shares of single effects and the errors of candidates are all made of it.
Open loop near the edge of stability a right model may run away while the arm does not; it is compared up to there, and
a few blocks in which it errs by more than the plain model does anywhere count for neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from bha.diagnosis.days import OF_A_SESSION, Day, day_of, on_days
from bha.diagnosis.fit import Fit, Problem, columns, evaluate, sensitivities, state_columns
from bha.diagnosis.model import of_sensors
from bha.diagnosis.where import block_edges
from bha.errors import ConvergenceError
from bha.estimation.engine import Model
from bha.estimation.memories import within
from bha.estimation.records import Record
from bha.parameters import paths
from bha.recordings.pose import tells_state

Array = NDArray[np.float64]

#: Length of a block, s, and its least length where the logs are too short for enough of them.
HOLDOUT_BLOCK, SHORTEST_BLOCK = 1.0, 0.3
#: Blocks that there are at least, where the logs are long enough.
ENOUGH_BLOCKS = 10
#: An arm that is this far off has run away, m; what it did in the last second before that does not count either.
RUN_AWAY, BEFORE_RUN_AWAY = 0.3, 1.0
#: Least share of the readings of a block that count, so that it does.
LEAST_COUNTED = 0.3
#: Share of the blocks before a model runs away that is enough to compare it.
LEAST_VALID = 0.4
#: A block in which a model errs by so many times what the plain model does in its worst one is one of a swing that ran
#: off, and does not count, if these are no more than a few: this share of the blocks.
RAN_OFF, FEW = 2.0, 0.1


@dataclass(frozen=True)
class Prediction:
    """A model on the held-out logs.

    Attributes:
        outputs: simulated outputs of each log.
        states: estimated initial states.
        white: white residual of all logs.
        blocks: mean square of the white residual of each block with readings; NaN where the model has run away.
        squares: sum of the squared errors of each such block over all channels, m^2; NaN where it has run away.
        counts: number of readings in each.
        rms: error over all readings of all logs and channels, run away or not, m.
        until: time of each log up to which the model has not run away, s; infinite where it never does.
    """

    outputs: tuple[Array, ...]
    states: tuple[Array, ...]
    white: Array
    blocks: Array
    squares: Array
    counts: Array
    rms: float
    until: tuple[float, ...]

    @property
    def ran_away(self) -> bool:
        """Whether the model has run away in some log."""
        return bool(np.isfinite(self.until).any())

    @property
    def mean_square(self) -> float:
        """Mean square of the white residual; one for a right model, infinite for one that runs away early."""
        valid = np.isfinite(self.blocks)
        return float(np.mean(self.blocks[valid])) if np.mean(valid) >= LEAST_VALID else np.inf


@dataclass(frozen=True)
class Readings:
    """What errors in metres are counted on.

    Attributes:
        records: the logs at all their rows, where fits have fewer and smoother ones.
    """

    records: tuple[Record, ...]

    def at(self, log: int, time: Array, outputs: Array) -> Array:
        """Simulated outputs of a log at its readings; between the rows of the fit they are smooth."""
        own = self.records[log].time
        return outputs if len(own) == len(time) else np.asarray(CubicSpline(time, outputs)(own))


@dataclass(frozen=True)
class Block:
    """A stretch of a log in which errors are counted.

    Attributes:
        log: number of the log.
        white: its white rows, of those of the log.
        readings: its readings, of those of the log.
        count: how many of these there are, over all channels.
    """

    log: int
    white: slice
    readings: slice
    count: int


class Holdout:
    """The held-out logs with their whitening and the sensitivities of their initial states."""

    def __init__(
        self,
        problem: Problem,
        states: Sequence[Array],
        readings: Readings,
        *,
        blocks: Sequence[Block] | None = None,
        sessions: tuple[Array, ...] | None = None,
        days: tuple[Day, ...] | None = None,
    ) -> None:
        """The logs, first guesses of their initial states, and what errors are counted on.

        ``blocks`` are those in which they are counted; all that have readings if None. Where logs stand apart errors
        count beyond that: ``sessions`` are what numbers that differ from day to day do to each log, (rows, C, numbers),
        and errors those beyond what these make of them; ``days`` are what these numbers are for each log, as it is
        simulated. None where logs do not stand apart.
        """
        self.problem = problem
        self.readings = readings
        self.blocks = blocks_of(problem, readings) if blocks is None else tuple(blocks)
        self.sessions = sessions
        self.days = days
        self._states = tuple(states)
        self._sensitivities: tuple[Array, ...] | None = None
        self._changes: tuple[Array, ...] | None = None
        self._slopes: tuple[Fit, Fit, Array] | None = None

    def predict(self, model: Model, x: Array) -> Prediction:
        """Open-loop prediction; rows from where a run runs away do not count."""
        fit, until, rms = self._evaluate(model, x, self._begin(model, x))
        if self._sensitivities is None and np.isfinite(fit.cost):
            self._sensitivities = state_columns(self.problem, fit)
        sensitivities = self._sensitivities
        if np.isfinite(fit.cost) and any(np.any(fit.model.memories(window)) for window in self.problem.windows):
            sensitivities = state_columns(self.problem, fit)
        for _ in range(2):
            if sensitivities is None or not np.isfinite(fit.cost):
                break
            trial, later, error = self._evaluate(model, x, self._improved(fit, sensitivities))
            if not trial.cost < fit.cost:
                break
            fit, until, rms = trial, later, error
        return self._compared(fit.outputs, fit.states, fit.residual, until, rms)

    def in_sessions(self, fit: Fit, states: Sequence[Array]) -> Holdout:
        """The same with errors counted beyond what sets sessions apart, as a model is changed by it.

        That are other rest lengths, another place of the camera, and an offset of each channel.

        Args:
            fit: the model; of the first one asked for counts how it is changed.
            states: initial states of the logs under it.
        """
        if self._changes is None:
            which = [k for k, c in enumerate(fit.model.plain) if paths.key_of(c.path) in OF_A_SESSION]
            self._changes = sensitivities(self.problem, fit, states, which)
        eyes = (np.tile(np.eye(own.shape[1]), (len(own), 1, 1)) for own in self._changes)
        tables = tuple(np.concatenate(both, axis=2) for both in zip(eyes, self._changes, strict=True))
        return Holdout(self.problem, self._states, self.readings, blocks=self.blocks, sessions=tables)

    def on_their_days(self, fit: Fit, states: Sequence[Array]) -> Holdout:
        """The same with each log simulated as its day was: the numbers of a day as the model ``fit`` shows it best.

        Args:
            fit: the model.
            states: initial states of the logs under it.
        """
        found = [day_of(fit, record, state) for record, state in zip(self.seen, states, strict=True)]
        records = [replace(day.record, usable=r.usable) for day, r in zip(found, self.problem.records, strict=True)]
        model = self.problem.model.on(records)
        problem = replace(self.problem, model=model)
        states = [day.state for day in found]
        return Holdout(problem, states, self.readings, blocks=self.blocks, days=tuple(found))

    def counted_in(self, blocks: Sequence[Block]) -> Holdout:
        """The same with errors counted in some blocks; what is known of the plain model stays."""
        found = Holdout(self.problem, self._states, self.readings, blocks=blocks)
        found._sensitivities, found._slopes = self._sensitivities, self._slopes
        return found

    def slopes(self, fit: Fit, states: Sequence[Array]) -> tuple[Fit, Array]:
        """A model on the logs, and their white sensitivities by its coordinates, shape (rows, size); kept for the last.

        Args:
            fit: the model.
            states: initial states of the logs as it predicts them.
        """
        if self._slopes is None or self._slopes[0] is not fit:
            here = evaluate(self.problem, fit.model, fit.x, states)
            self._slopes = fit, here, columns(self.problem, here, range(fit.model.size))
        return self._slopes[1:]

    @property
    def seen(self) -> tuple[Record, ...]:
        """The logs of which no readings but those that are counted are to be used."""
        found = []
        for log, record in enumerate(self.problem.records):
            time, own = self.problem.whiteners[log].time, [block.white for block in self.blocks if block.log == log]
            edges = np.concatenate([[-np.inf], time[1:], [np.inf]])
            spans = [(edges[white.start], edges[white.stop]) for white in own]
            within = np.any([(record.time >= begin) & (record.time < end) for begin, end in spans], axis=0)
            found.append(replace(record, usable=record.usable & np.reshape(within, (-1, 1))))
        return tuple(found)

    @property
    def rows(self) -> NDArray[np.bool_]:
        """Which white numbers count, shape (rows,)."""
        which = np.zeros(self.problem.rows)
        parts = self.problem.split(which)
        for block in self.blocks:
            parts[block.log][block.white] = 1.0
        return which > 0.0

    def compared(
        self, outputs: tuple[Array, ...], states: tuple[Array, ...], until: tuple[float, ...], rms: float
    ) -> Prediction:
        """The prediction with these outputs."""
        return self._compared(outputs, states, self.problem.residual(self._counted(outputs, until)), until, rms)

    def _compared(
        self, outputs: tuple[Array, ...], states: tuple[Array, ...], white: Array, until: tuple[float, ...], rms: float
    ) -> Prediction:
        counted = self._counted(outputs, until)
        found = predicted(self.problem, self.readings, self.blocks, counted, states, white, until, rms)
        return replace(found, outputs=outputs)

    def _counted(self, outputs: tuple[Array, ...], until: Sequence[float]) -> tuple[Array, ...]:
        """The outputs of which errors count."""
        if self.sessions is None:
            return outputs
        return tuple(map(in_its_session, self.problem.records, outputs, until, self.sessions))

    def _begin(self, model: Model, x: Array) -> Sequence[Array]:
        """Guesses of the initial states; as the model's camera and wires see them where these are free: others have
        another pose.

        Without that a model that is seen otherwise is held to a state that is off by as much.
        """
        records, free = self.problem.records, any(of_sensors(c) for c in model.plain)
        if self.days is not None or not free or not tells_state(records[0].observation, model.sections):
            return self._states
        try:
            return list(model.on(records).guesses(x, self.problem.windows))
        except ConvergenceError:
            return self._states

    def _evaluate(self, model: Model, x: Array, states: Sequence[Array]) -> tuple[Fit, tuple[float, ...], float]:
        """The model at ``x`` up to where it runs away, and its error over all rows, m."""
        if self.days is None:
            raw = self.problem.simulate(model, x, states)
        else:
            raw = on_days(model.on(self.problem.records), x, states, self.days)
        outputs, until = up_to_run_away(self.problem, raw)
        # A log that stands apart begins as far apart.
        residual = self.problem.residual(self._counted(outputs, until))
        fit = Fit(model.on(self.problem.records), x, tuple(states), outputs, residual, float(residual @ residual))
        return fit, until, error_of(self.problem, raw)

    def _improved(self, fit: Fit, sensitivities: Sequence[Array]) -> list[Array]:
        states = []
        for part, jacobian, state in zip(self.problem.slices(), sensitivities, fit.states, strict=True):
            states.append(state + state_step(self.problem, jacobian, fit.residual[part]))
        return list(within(np.stack(states), 3 * fit.model.sections))


def state_step(problem: Problem, jacobian: Array, left: Array) -> Array:
    """Change of a log's initial state that its white residual ``left`` asks for, by white sensitivities, (6n,)."""
    # A model with a gap errs everywhere; the state must not bend to it more than it is uncertain.
    weight = max(1.0, float(np.mean(left**2)))
    normal = jacobian.T @ jacobian / weight + np.diag(problem.state_precision)
    return np.asarray(np.linalg.solve(normal, jacobian.T @ left / weight))


def up_to_run_away(problem: Problem, outputs: Sequence[Array]) -> tuple[tuple[Array, ...], tuple[float, ...]]:
    """Simulated outputs of each log, from where they run away on those measured, so that nothing is made of them.

    The second are the times from which on they are, s; infinite where that is never.
    """
    kept, until = [], []
    for record, y in zip(problem.records, outputs, strict=True):
        far = ~np.all(np.abs(y - record.measured) < RUN_AWAY, axis=1)
        time = record.time
        end = float(time[np.argmax(far)]) - BEFORE_RUN_AWAY if np.any(far) else np.inf
        kept.append(np.where((time < end)[:, None], y, record.measured))
        until.append(end)
    return tuple(kept), tuple(until)


def error_of(problem: Problem, outputs: Sequence[Array]) -> float:
    """RMS error over all readings, m; a million where a run diverged."""
    errors = [(r.measured - y)[r.usable] for r, y in zip(problem.records, outputs, strict=True)]
    found = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    return min(found, 1e6) if np.isfinite(found) else 1e6


def in_its_session(record: Record, outputs: Array, until: float, session: Array) -> Array:
    """Outputs of a log, (rows, C), as they are up to a time, s, were what differs from day to day that of its day.

    ``session`` has how changes of its numbers show, (rows, C, numbers).
    """
    counts = record.usable & (record.time < until)[:, None]
    if not counts.any() or not session.shape[2]:
        return outputs
    scale = np.sqrt(np.maximum(np.mean(session[counts] ** 2, axis=0), 1e-300))
    told = np.linalg.lstsq(session[counts] / scale, (record.measured - outputs)[counts], rcond=1e-6)[0]
    return np.asarray(outputs + (session / scale) @ told)


def blocks_of(problem: Problem, readings: Readings) -> tuple[Block, ...]:
    """The blocks in which errors are counted; one without readings says nothing, of any model."""
    found = []
    length = block_length([float(np.ptp(w.time)) for w in problem.whiteners])
    for log, whitener in enumerate(problem.whiteners):
        record = readings.records[log]
        edges = block_edges(whitener.time, length)
        ends = [*np.searchsorted(record.time, [whitener.time[s.start] for s in edges[1:]]), len(record.time)]
        begin = 0
        for s, stop in zip(edges, ends, strict=True):
            own, begin = slice(begin, int(stop)), int(stop)
            number = int(np.count_nonzero(record.usable[own]))
            if number >= LEAST_COUNTED * max(1, record.usable[own].size):
                found.append(Block(log, s, own, number))
    return tuple(found)


def predicted(
    problem: Problem,
    readings: Readings,
    blocks: Sequence[Block],
    outputs: tuple[Array, ...],
    states: tuple[Array, ...],
    white: Array,
    until: tuple[float, ...],
    rms: float,
) -> Prediction:
    """A prediction from its outputs, with its errors block by block."""
    errors = []
    for log, y in enumerate(outputs):
        record = readings.records[log]
        errors.append(np.where(record.usable, record.measured - readings.at(log, problem.records[log].time, y), 0.0))
    rows = problem.split(white)
    valid = [problem.whiteners[b.log].time[b.white][-1] < until[b.log] for b in blocks]
    means = [float(np.mean(rows[b.log][b.white] ** 2)) for b in blocks]
    sums = [float(np.sum(errors[b.log][b.readings] ** 2)) for b in blocks]
    counts = np.array([b.count for b in blocks])
    return Prediction(
        outputs, states, white, np.where(valid, means, np.nan), np.where(valid, sums, np.nan), counts, rms, until
    )


def block_length(durations: Sequence[float]) -> float:
    """Length of the blocks of logs of these durations, s: shorter than usual where there were too few."""
    return float(np.clip(sum(durations) / ENOUGH_BLOCKS, SHORTEST_BLOCK, HOLDOUT_BLOCK))


def counted(plain: Prediction, *others: Prediction) -> NDArray[np.bool_]:
    """Which blocks count when ``others`` are compared with the plain model: the same for all of them."""
    compared = (plain, *others)
    valid = np.all([np.isfinite(p.squares) for p in compared], axis=0)
    if not np.any(valid):
        return np.asarray(valid)
    worst = np.max(plain.squares[valid] / plain.counts[valid])
    with np.errstate(invalid="ignore"):
        off = valid & np.any([p.squares / p.counts > RAN_OFF**2 * worst for p in compared], axis=0)
    return np.asarray(valid & ~off if np.mean(off[valid]) <= FEW else valid)


def rms_errors(plain: Prediction, *others: Prediction) -> list[float]:
    """RMS errors of the plain model and of others, m, over the blocks in which none has run away.

    Infinite where these are too few: such models have been compared with nothing.
    """
    which = counted(plain, *others)
    if np.mean(which) < LEAST_VALID:
        return [np.inf for _ in (plain, *others)]
    readings = float(np.sum(plain.counts[which]))
    return [float(np.sqrt(np.sum(p.squares[which]) / readings)) for p in (plain, *others)]


def excess(error: float, noise: float) -> float:
    """What an RMS error holds beyond that of noise, in squares, m^2: squares of what is independent add up."""
    return max(0.0, error**2 - noise**2)


def share_removed(before: float, after: float, noise: float) -> float:
    """Share of the excess of the error ``before`` that is gone in ``after``, all RMS, m; 0 where there was none."""
    if not np.isfinite(before) or not np.isfinite(after) or excess(before, noise) == 0.0:
        return 0.0
    return 1.0 - excess(after, noise) / excess(before, noise)


def share_brought(plain: Prediction, smaller: Prediction, larger: Prediction, noise: float) -> float:
    """Share of the plain model's excess that is gone with a larger set and is not with a smaller; ``noise`` RMS, m."""
    before, more, less = rms_errors(plain, smaller, larger)
    if not np.isfinite(before) or excess(before, noise) == 0.0:
        return 0.0
    return (excess(more, noise) - excess(less, noise)) / excess(before, noise)


def thinned(prediction: Prediction, factor: int) -> Prediction:
    """The prediction with every ``factor``-th row, for figures."""
    return replace(prediction, outputs=tuple(y[::factor] for y in prediction.outputs))
