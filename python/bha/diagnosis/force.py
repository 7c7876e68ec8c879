"""The residual force: what would have to act beside the arm's model for the arm to move as it was measured.

What: a force along each coordinate (the length of each bellows, where these stand at the coordinates' places), N, that
changes slowly, beside the forces of the model, M q'' + C q' + N = tau + f. Its size, section by section, and the time
over which it changes are those that make the readings likeliest; motion and force together are the mean given all
readings, with standard deviations.
Why along coordinates: that is a force between the ends of a bellows, has one unit for all, and stands beside the
length, the rate and the pressure that it may follow. Generalized forces proper would be newtons and metres mixed, and
of bending directions that nobody can point at. Sign: positive pushes the ends apart, as pressure does and as the force
of a ``formula`` does; what such a force does in a bend is the arm's own force model (:class:`Lever`).
How: the equations of motion are linear between two rows around the middle of the motion that was found before (a few
rounds), exact in the matrix exponential, so that stiff arms are as good as others; :mod:`bha.diagnosis.force_smoother`
does the rest.
Limits: it is relative to the model, whose parameters have taken what they can of it. Whatever errs is in it: a wrong
mass, a late sensor. Noise of sensors that has colour counts as white of its slowest part's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

from bha import names
from bha.arm import Arm
from bha.arm.geometry import bellows_length_rows
from bha.diagnosis.force_smoother import Forces, Motion, Smoothed, smooth
from bha.diagnosis.shortcuts import ON_PRESSURES
from bha.errors import BhaError
from bha.estimation.initial import pose_of
from bha.estimation.noise import reading_interval
from bha.estimation.records import Record
from bha.recordings import Observation
from bha.runs.simulation import Simulation, concatenate

Array = NDArray[np.float64]

#: Least distance of the rows, s, and most rows of all logs together.
LEAST_STEP, MOST_ROWS = 0.02, 3000
#: Rounds in which the motion is linearized anew, and sizes are sought within one.
ROUNDS, SIZINGS = 3, 4
#: What the force is taken for at first, as a share of what the springs do over the section's range, and its time, s.
FIRST_SHARE, FIRST_TIME = 0.05, 0.3
#: Standard deviation of lengths, m, and rates, m/s, of the first row, about what its readings say.
START_LENGTH, START_RATE = 0.02, 0.3
#: Poses a second from which the first round begins.
POSES_A_SECOND = 10.0


@dataclass(frozen=True)
class ResidualForce:
    """The residual force along logs; L logs over K rows, padded, m coordinates.

    Attributes:
        arm: the arm beside whose model it acts.
        names: of the logs.
        lasts: rows of each log, shape (L,).
        time: s, shape (K, L).
        lengths: coordinates as they were, m, shape (K, L, m).
        rates: their time derivatives, m/s, shape (K, L, m).
        pressures: that acted, Pa absolute, shape (K, L, inputs).
        force: along each coordinate, N, shape (K, L, m).
        deviation: its standard deviation, N, shape (K, L, m).
        sizes: standard deviation that the force has over time, N, shape (m,).
        correlation_time: over which it changes, s.
        mean_square: of the smoother's innovations: one where the noises are right.
    """

    arm: Arm
    names: tuple[str, ...]
    lasts: NDArray[np.intp]
    time: Array
    lengths: Array
    rates: Array
    pressures: Array
    force: Array
    deviation: Array
    sizes: Array
    correlation_time: float
    mean_square: float

    def of_log(self, table: Array, log: int) -> Array:
        """The rows of one log of a table (K, L, ...)."""
        return np.asarray(table[: self.lasts[log], log])

    @property
    def told(self) -> Array:
        """Share of the variance of each coordinate's force that the readings have taken away, shape (m,)."""
        left = [np.mean(self.of_log(self.deviation, k) ** 2, axis=0) for k in range(len(self.names))]
        return np.asarray(1.0 - np.average(left, axis=0, weights=self.lasts) / np.maximum(self.sizes**2, 1e-300))

    @property
    def rms(self) -> Array:
        """Root mean square of the force along each coordinate, N, shape (m,)."""
        squares = [np.mean(self.of_log(self.force, k) ** 2, axis=0) for k in range(len(self.names))]
        return np.asarray(np.sqrt(np.average(squares, axis=0, weights=self.lasts)))


def residual_force(arm: Arm, records: Sequence[Record], noise: Array) -> ResidualForce:
    """The residual force along records.

    Args:
        arm: the arm, whose model is taken as it is.
        records: logs with the same channels.
        noise: standard deviation of each channel's readings, m, shape (C,), taken as white.

    Raises:
        ConvergenceError: pressures reach the bellows through something that the arm's model cannot be run through.
    """
    step = max(LEAST_STEP, sum(r.duration for r in records) / MOST_ROWS, *(r.sample_time for r in records))
    tracks = [_Track(arm, record, step) for record in records]
    lasts = np.array([len(track.time) for track in tracks], dtype=np.intp)
    size = FIRST_SHARE * np.repeat(
        [
            s.resolved_bellows(i)[0].stiffness[0] * float(np.ptp(s.length_range))
            for i, s in enumerate(arm.parameters.sections, start=1)
        ],
        3,
    )
    assumed = Forces(np.maximum(size, 1e-6), FIRST_TIME)
    found: Smoothed | None = None
    for _ in range(ROUNDS):
        motion = _motion(arm, tracks, lasts, step, noise)
        for _ in range(SIZINGS):
            found = smooth(motion, assumed)
            assumed = _by_section(found.better)
        found = smooth(motion, assumed)
        m = len(size)
        for k, track in enumerate(tracks):
            track.move(found.motion[: lasts[k], k, :m], found.motion[: lasts[k], k, m:])
    assert found is not None
    # Where the readings scatter by more than their noise, so does what was found from them.
    wider = max(1.0, float(np.sqrt(found.mean_square)))
    return ResidualForce(
        arm=arm,
        names=tuple(record.name for record in records),
        lasts=lasts,
        time=_padded([track.time for track in tracks]),
        lengths=_padded([track.lengths for track in tracks]),
        rates=_padded([track.rates for track in tracks]),
        pressures=_padded([track.pressures for track in tracks]),
        force=found.forces,
        deviation=wider * found.deviation,
        sizes=assumed.sizes,
        correlation_time=assumed.time,
        mean_square=found.mean_square,
    )


def _by_section(forces: Forces) -> Forces:
    """One size a section: its bellows are alike."""
    squares = (forces.sizes**2).reshape(-1, 3).mean(axis=1)
    return Forces(np.repeat(np.sqrt(squares), 3), forces.time)


def _padded(tables: Sequence[Array]) -> Array:
    """Tables of some rows side by side, shape (K, L, ...), the last row repeated."""
    count = max(len(table) for table in tables)
    return np.stack([np.concatenate([t, np.repeat(t[-1:], count - len(t), axis=0)]) for t in tables], axis=1)


class _Track:
    """One log at rows a step apart: its readings, what acts, and the motion as far as it is known."""

    def __init__(self, arm: Arm, record: Record, step: float) -> None:
        """The track of a record, its motion that of poses which readings and pressures hold.

        Raises:
            ConvergenceError: the arm's model diverges on the way of the pressures.
        """
        rows = np.arange(0, len(record), max(1, round(step / record.sample_time)))
        self.time = record.time[rows]
        self.measured, self.usable = record.measured[rows], record.usable[rows]
        self.observation = Observation.of(arm.parameters, record.observation.outputs)
        self.pressures = acting_pressures(arm, record, self.time)
        #: Means over the steps.
        self.acting = acting_pressures(arm, record, self.time, means=True)
        self.pressure_noise, self.interval = record.pressure_noise, reading_interval(record)
        flat, middle = record.drive.force_rows, 0.5 * (self.time[1:] + self.time[:-1])
        self.external: Array | None = None
        if flat is not None:
            columns = [np.interp(middle, record.drive.time, f) for f in flat.T]
            self.external = np.column_stack(columns).reshape(len(middle), -1, 3)
        count = 2 + int(POSES_A_SECOND * np.ptp(self.time))
        few = np.unique(np.linspace(0, len(self.time) - 1, count).round().astype(int))
        values = np.where(self.usable, self.measured, np.nan)
        poses = np.stack([pose_of(arm, record, values[k], record.noise, self.pressures[k]) for k in few])
        self.lengths = np.column_stack([np.interp(self.time, self.time[few], q) for q in poses.T])
        self.rates = np.gradient(self.lengths, self.time, axis=0)

    def move(self, lengths: Array, rates: Array) -> None:
        """Take another motion for the true one."""
        self.lengths, self.rates = lengths, rates


def acting_pressures(arm: Arm, record: Record, times: Array, *, means: bool = False) -> Array:
    """Pressures in the chambers at some times, Pa absolute, as logged or as they reach them; or means between times.

    Raises:
        SimulationError: the arm's model diverges under these pressures.
    """
    drive = record.drive
    pneumatics = arm.parameters.pneumatics
    through = drive.commanded and pneumatics is not None and pneumatics.level != "ideal"
    if not through and not any(effect.kind in ON_PRESSURES for effect in arm.parameters.effects):
        if not means:
            return np.column_stack([np.interp(times, drive.time, p) for p in drive.pressures.T])
        time, tables = _without_jumps(drive.time, drive.pressures)
        sums = cumulative_trapezoid(tables, time, axis=0, initial=0)
        # Between two samples the integral is a parabola: told by a cubic through values and slopes.
        integral = CubicHermiteSpline(time, sums, tables)(times)
        return np.asarray(np.diff(integral, axis=0) / np.diff(times)[:, None])
    wanted = 0.5 * (times[1:] + times[:-1]) if means else times
    return np.asarray(concatenate(list(Simulation(arm, drive).run(wanted))).pressures)


def _without_jumps(time: Array, pressures: Array) -> tuple[Array, Array]:
    """Samples at strictly ascending times: of two at one time the later one."""
    last = np.append(np.diff(time) > 0.0, True)
    return time[last], pressures[last]


class Lever:
    """What a force of 1 N along each coordinate is in the arm's coordinates: generalized forces, pose by pose.

    It is spread over the bellows of the section in the smallest way; where bellows stand at the coordinates' places it
    is that of one bellows. How bellows act in a bend says the arm's own force model, through a constant ``formula``.
    """

    def __init__(self, arm: Arm) -> None:
        """The lever of an arm."""
        places = [
            f"bellows {names.length_name(i, k)[1:]}"
            for i, section in enumerate(arm.parameters.sections, start=1)
            for k in range(1, len(section.resolved_bellows(i)) + 1)
        ]
        own = list(arm.parameters.effects)
        self._plain = arm
        self._pushed = [arm.with_effects([*own, {"kind": "formula", "where": w, "force": "1"}]) for w in places]
        self.rows = length_rows(arm)
        self._spread = self.rows @ np.linalg.inv(self.rows.T @ self.rows)

    def at(self, q: Array, rates: Array) -> Array:
        """Generalized forces by forces along the coordinates, at a pose, shape (3n, 3n)."""
        plain = self._plain.bias_force(q, rates)
        by_bellows = np.column_stack([plain - arm.bias_force(q, rates) for arm in self._pushed])
        return np.asarray(by_bellows @ self._spread)


def length_rows(arm: Arm) -> Array:
    """Lengths of all bellows as rows over the coordinates, shape (bellows, 3n)."""
    sections = arm.parameters.sections
    return np.vstack([bellows_length_rows(section, i, len(sections)) for i, section in enumerate(sections)])


def _motion(arm: Arm, tracks: Sequence[_Track], lasts: NDArray[np.intp], step: float, noise: Array) -> Motion:
    """The linear motion around that of the tracks."""
    count, m, channels = int(lasts.max()), 3 * arm.section_count, len(noise)
    lever = Lever(arm)
    shape = (count - 1, len(tracks))
    transitions = np.tile(np.eye(2 * m), (*shape, 1, 1))
    offsets, now, later = np.zeros((*shape, 2 * m)), np.zeros((*shape, 2 * m, m)), np.zeros((*shape, 2 * m, m))
    added = np.zeros((*shape, 2 * m, 2 * m))
    shown = np.zeros((count, len(tracks), channels, 2 * m))
    read, variance = np.zeros((count, len(tracks), channels)), np.ones((count, len(tracks), channels))
    for k, track in enumerate(tracks):
        last = lasts[k]
        own = slice(last - 1)
        transitions[own, k], offsets[own, k], now[own, k], later[own, k], added[own, k] = _steps(arm, lever, track)
        for row in range(last):
            values, slopes = track.observation.at(arm, track.lengths[row])
            good = track.usable[row]
            shown[row, k, good, :m] = slopes[good]
            read[row, k, good] = (track.measured[row] - values + slopes @ track.lengths[row])[good]
            variance[row, k, good] = noise[good] ** 2
    start = np.array([np.concatenate([track.lengths[0], track.rates[0]]) for track in tracks])
    spread = np.repeat([START_LENGTH, START_RATE], m)
    return Motion(transitions, offsets, now, later, added, shown, read, variance, start, spread, step, lasts)


def _steps(arm: Arm, lever: Lever, track: _Track) -> tuple[Array, Array, Array, Array, Array]:
    """From each row to the next: transition, offset, action of the forces at both rows, what noisy pressures add."""
    lengths, rates = (0.5 * (table[1:] + table[:-1]) for table in (track.lengths, track.rates))
    seconds, m = np.diff(track.time), lengths.shape[1]
    # Motion, what is constant, forces at the start, and what they change by a second.
    constant, force, change = 2 * m, slice(2 * m + 1, 3 * m + 1), slice(3 * m + 1, 4 * m + 1)
    generator = np.zeros((len(seconds), 4 * m + 1, 4 * m + 1))
    generator[:, force, change] = np.eye(m)
    by_pressure = np.zeros((len(seconds), m, len(track.pressure_noise)))
    for k, (q, qd) in enumerate(zip(lengths, rates, strict=True)):
        p, external = track.acting[k], None if track.external is None else track.external[k]
        state, driven = arm.linearize(q, qd, p)
        flow = np.concatenate([qd, arm.forward_dynamics(q, qd, p, external)])
        generator[k, : 2 * m, : 2 * m] = state
        generator[k, : 2 * m, constant] = flow - state @ np.concatenate([q, qd])
        # That inertia and lever change beside the middle counts in the next round, whose middle is nearer.
        generator[k, m : 2 * m, force] = np.linalg.solve(arm.inertia_matrix(q), lever.at(q, qd))
        by_pressure[k] = np.linalg.lstsq(generator[k, m : 2 * m, force], driven[m:], rcond=None)[0]
    through = expm(generator * seconds[:, None, None])[:, : 2 * m]
    later = through[:, :, change] / seconds[:, None, None]
    # Of the readings' noise over a step the mean acts.
    shaken = through[:, :, force] @ by_pressure * track.pressure_noise
    shaken *= np.sqrt(track.interval / seconds)[:, None, None]
    return (
        through[:, :, : 2 * m],
        through[:, :, constant],
        through[:, :, force] - later,
        later,
        shaken @ shaken.swapaxes(-1, -2),
    )


def cannot(arm: Arm) -> str:
    """Why there is no residual force beside an arm's model, a sentence; empty where there is one."""
    memory = [f"{e.kind} at {e.where}" for e in arm.parameters.effects if e.kind in ("creep", "hysteresis", "friction")]
    if memory:
        return f"the arm's file has effects whose forces remember the motion ({', '.join(memory)})"
    return ""


def estimated(arm: Arm, records: Sequence[Record], noise: Array) -> ResidualForce | str:
    """The residual force, or a sentence on why there is none."""
    if reason := cannot(arm):
        return reason
    try:
        found = residual_force(arm, records, noise)
    except (BhaError, np.linalg.LinAlgError) as error:
        return f"the smoother fails: {error}"
    if not np.all(np.isfinite(found.force)):
        return "the smoother fails: its motion leaves the range of numbers"
    return found
