"""Damping from free swings after a lost contact, paper section IV-E (Fig. 10).

Two steps. The tip's lateral deflection in each swing is fitted with one decaying oscillation, which gives the frequency
and the damping ratio of its slowest mode. Then the damping is sought with which the model's swing, from the same state
and under the same pressures, decays alike. One swing gives one number: the ratio of damping to stiffness of the
bellows, taken as a property of their material and the same in all sections.

Frames: deflections are along the direction in which a head swings most, in the frame in which it is seen; only their
course in time is compared. Limits: stiffness and bending stiffness are the arm's, found before (section IV-C and D);
an arm that comes back without swinging through has no oscillation to fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError, InputError
from bha.estimation.initial import guess_of, pose_of
from bha.estimation.long_run import correlation_length
from bha.estimation.records import Record
from bha.estimation.stretches import Stretch, steady_state, stretch_between, swings
from bha.parameters import ArmParameters
from bha.parameters.tables import AXES
from bha.runs.input import Input
from bha.simulation.single import simulate
from bha.support.extras import import_extra
from bha.support.shown import short_repr

Array = NDArray[np.float64]

#: What is averaged before an arm that rests is let go, s.
REST = 0.1
#: Rows of a simulated swing are so far apart, s.
INTERVAL = 5e-3
#: Ratios of damping to stiffness that are tried, s, and how well the one is found, relative to itself.
LEAST_RATIO, GREATEST_RATIO, _TOLERANCE = 1e-6, 1.0, 1e-4


@short_repr
@dataclass(frozen=True)
class Oscillation:
    """A damped oscillation y = middle + e^(-decay t) (a cos(omega t) + b sin(omega t)) fitted to a deflection.

    Attributes:
        time: from the first row of the swing, s, shape (m,).
        deflection: from the middle, m, shape (m,).
        fitted: the oscillation, m, shape (m,).
        frequency: omega / (2 pi), Hz.
        decay: 1/s.
        decay_error: its standard error, 1/s, with what is left taken as correlated as it is.
    """

    time: Array
    deflection: Array
    fitted: Array
    frequency: float
    decay: float
    decay_error: float

    @property
    def damping_ratio(self) -> float:
        """decay / sqrt(omega^2 + decay^2)."""
        return float(self.decay / np.hypot(2.0 * np.pi * self.frequency, self.decay))

    @property
    def amplitude(self) -> float:
        """Greatest deflection, m."""
        return float(np.abs(self.deflection).max())

    @property
    def residual(self) -> float:
        """What the oscillation leaves, RMS, m."""
        return float(np.sqrt(np.mean((self.deflection - self.fitted) ** 2)))


@short_repr
@dataclass(frozen=True)
class FreeSwing:
    """A swing as it was measured.

    Attributes:
        stretch: where.
        time: from its first row, s, shape (m,).
        heads: the heads' paths, m, shape (m, n, 3); NaN where they are not known.
        pressures: means over it, Pa, shape (inputs,).
        state: lengths and rates that it begins with, shape (6n,).
    """

    stretch: Stretch
    time: Array
    heads: Array
    pressures: Array
    state: Array

    @property
    def tip(self) -> int:
        """The last section, from 1, whose head's path is known."""
        known = np.flatnonzero(np.all(np.isfinite(self.heads).mean(axis=0) > 0.0, axis=1))
        if not len(known):
            raise InputError(
                f"{self.stretch.record}: no head's path is known; a log of all lengths, or of x, y and z of a head is "
                "needed to see the arm swing"
            )
        return int(known[-1]) + 1


@short_repr
@dataclass(frozen=True)
class SwingFit:
    """Damping from swings.

    Attributes:
        swings: as they were measured.
        measured: the oscillation in each.
        modelled: that of the model with its own ratio, one a swing.
        ratios: ratio of damping to linear stiffness that each asks for, s, and its standard error; shape (swings, 2).
        ratio: that of all, s, and its standard error.
        damping: estimate and standard error of each damping by its path, N s/m.
    """

    swings: tuple[FreeSwing, ...]
    measured: tuple[Oscillation, ...]
    modelled: tuple[Oscillation, ...]
    ratios: Array
    ratio: tuple[float, float]
    damping: dict[str, tuple[float, float]]

    @property
    def used(self) -> tuple[Stretch, ...]:
        """Where the swings are."""
        return tuple(swing.stretch for swing in self.swings)

    def applied(self, arm: Arm) -> Arm:
        """The arm with these dampings; provenance of old ones is dropped."""
        return with_ratio(arm, self.ratio[0])


def swing_damping(
    arm: Arm,
    records: Sequence[Record],
    *,
    stretches: Sequence[Stretch] | None = None,
    at_rest: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> SwingFit:
    """Dampings of an arm from free swings.

    Args:
        arm: everything else about the arm, stiffness and bending stiffness above all.
        records: the logs.
        stretches: where the swings are; found in the logs if None.
        at_rest: whether the arm rests until the first row of each stretch; if not its state there is guessed from the
            rows around.
        progress: called with what is being done and the fraction done.

    Raises:
        InputError: no swing was found, or no head's path is known in one.
        ConvergenceError: no damping lets the model swing as the arm does.
    """
    found = [
        free_swing(arm, rec, stretch, at_rest=at_rest)
        for rec in records
        for stretch in (swings(rec) if stretches is None else stretches)
        if stretch.record == rec.name
    ]
    if not found:
        raise InputError(
            f"no free swing was found in {', '.join(rec.name for rec in records)}: let the arm swing for a few seconds "
            "under constant pressures after an external force lets go"
        )
    measured, modelled, ratios = [], [], []
    for number, swing in enumerate(found):
        if progress is not None:
            progress(f"swing at {swing.stretch.start:g} s of {swing.stretch.record}", number / len(found))
        seen = oscillation(swing.time, deflection(swing.heads, swing.tip))
        ratio, model = _matched(arm, swing, seen)
        measured.append(seen)
        modelled.append(model)
        ratios.append((ratio, ratio * seen.decay_error / abs(seen.decay)))
    table = np.array(ratios)
    ratio, error = _mean(table)
    damping = {
        f"section.{k}.damping": (ratio * s.stiffness[0], error * s.stiffness[0])
        for k, s in enumerate(arm.parameters.sections, start=1)
    }
    return SwingFit(tuple(found), tuple(measured), tuple(modelled), table, (ratio, error), damping)


def free_swing(arm: Arm, rec: Record, stretch: Stretch, *, at_rest: bool = False) -> FreeSwing:
    """A stretch of a record as a swing.

    Raises:
        InputError: the arm is said to rest before it, and there is no row before it.
    """
    rows = slice(stretch.first, stretch.last)
    pressures = np.array([np.interp(rec.time[rows], rec.drive.time, p).mean() for p in rec.drive.pressures.T])
    if at_rest:
        before = steady_state(arm, rec, stretch_between(rec, stretch.start - REST, stretch.start))
        deviation = rec.noise / np.sqrt(before.stretch.last - before.stretch.first)
        q = pose_of(arm, rec, before.channels, deviation, pressures)
        state = np.concatenate([q, np.zeros_like(q)])
    else:
        state = guess_of(arm, rec, stretch.first)
    time = rec.time[rows] - rec.time[stretch.first]
    return FreeSwing(stretch, time, head_paths(arm, rec, stretch), pressures, state)


def head_paths(arm: Arm, rec: Record, stretch: Stretch) -> Array:
    """Paths of the heads over a stretch, m, shape (rows, n, 3): as measured, else by (14) from measured lengths.

    NaN for a head that neither shows, and in rows that do not count.
    """
    rows, seen = slice(stretch.first, stretch.last), rec.observation
    values = np.where(rec.usable[rows], rec.measured[rows], np.nan)
    heads = np.full((len(values), arm.section_count, 3), np.nan)
    table = seen.rows
    if len(table) and np.linalg.matrix_rank(table) == table.shape[1]:
        lengths = (values[:, : len(table)] - seen.shifts) / seen.gains - seen.offsets
        known = np.all(np.isfinite(lengths), axis=1)
        heads[known] = arm.forward_kinematics(lengths[known] @ np.linalg.pinv(table).T)[0]
    for section in range(1, arm.section_count + 1):
        own = [k for k, o in enumerate(seen.outputs) if o.kind == "position" and o.section == section]
        if len(own) == len(AXES):
            heads[:, section - 1] = values[:, own]
    return heads


def deflection(heads: Array, section: int) -> Array:
    """Deflection of a head along the direction in which it moves most, m, shape (rows,).

    The direction has the sign of its greatest component.
    """
    path = heads[:, section - 1]
    known = np.all(np.isfinite(path), axis=1)
    from_middle = path - path[known].mean(axis=0)
    direction = np.linalg.svd(from_middle[known], full_matrices=False)[2][0]
    return np.asarray(from_middle @ (direction * np.sign(direction[np.argmax(np.abs(direction))])))


def oscillation(time: Array, values: Array) -> Oscillation:
    """Fit a damped oscillation to a deflection by least squares; NaN are left out.

    Raises:
        InputError: too few rows.
    """
    optimize = import_extra("scipy.optimize", extra="identify", purpose="Fitting swings")
    known = np.isfinite(values)
    t, y = time[known] - time[0], values[known]
    if len(t) < 8:
        raise InputError(f"{len(t)} rows of a swing; at least 8 are needed")

    def parts(rates: Array) -> tuple[Array, Array]:
        # The linear part (middle, a, b) follows from decay and frequency.
        phase, envelope = 2.0 * np.pi * rates[1] * t, np.exp(-rates[0] * t)
        basis = np.column_stack([np.ones_like(t), envelope * np.cos(phase), envelope * np.sin(phase)])
        return basis, np.linalg.lstsq(basis, y, rcond=None)[0]

    def left(rates: Array) -> Array:
        basis, linear = parts(rates)
        return np.asarray(basis @ linear - y)

    fit = optimize.least_squares(left, [0.5, _strongest_line(t, y)], x_scale=[0.5, 0.1])
    decay, frequency = (float(rate) for rate in fit.x)
    basis, linear = parts(fit.x)
    variance = float(np.mean(fit.fun**2)) * correlation_length([fit.fun])
    return Oscillation(
        time=t,
        deflection=y - linear[0],
        fitted=basis[:, 1:] @ linear[1:],
        frequency=abs(frequency),
        decay=decay,
        decay_error=float(np.sqrt(variance * np.linalg.pinv(fit.jac.T @ fit.jac)[0, 0])),
    )


def simulated_swing(arm: Arm, swing: FreeSwing) -> tuple[Array, Array, Array]:
    """Times (m,) s, heads (m, n, 3) m and lengths (m, 3n) m of the model's swing: same start, same pressures."""
    n = len(swing.state) // 2
    drive = Input.constant(swing.pressures, float(swing.time[-1]))
    run = simulate(arm, drive, dt=INTERVAL, q0=swing.state[:n], qd0=swing.state[n:])
    return run.time, run.head_positions, run.lengths


def with_ratio(arm: Arm, ratio: float) -> Arm:
    """The arm with dampings that are this part of the linear stiffnesses, s."""
    mapping = arm.parameters.to_mapping()
    for number, table in enumerate(mapping["section"], start=1):
        if not table["stiffness"][0] > 0.0:
            raise InputError(
                f"section {number}: linear stiffness {table['stiffness'][0]:g} N/m; a positive one is needed, for "
                "damping is told in parts of it: fit the stiffness first"
            )
        for each in [table, *(bellows for bellows in table.get("bellows", ()) if "damping" in bellows)]:
            each["damping"] = ratio * float(each.get("stiffness", table["stiffness"])[0])
            each.get("provenance", {}).pop("damping", None)
    return Arm(ArmParameters.from_mapping(mapping, origin=arm.name))


def _matched(arm: Arm, swing: FreeSwing, seen: Oscillation) -> tuple[float, Oscillation]:
    """The ratio of damping to stiffness with which the model's swing has the damping ratio that was seen."""
    optimize = import_extra("scipy.optimize", extra="identify", purpose="Fitting swings")
    made: dict[float, Oscillation] = {}

    def too_much(ratio: float) -> float:
        time, heads, _ = simulated_swing(with_ratio(arm, ratio), swing)
        made[ratio] = oscillation(time, deflection(heads, swing.tip))
        return made[ratio].damping_ratio - seen.damping_ratio

    # The damping ratio is about half of this times the circular frequency.
    guess = float(np.clip(seen.damping_ratio / (np.pi * seen.frequency), 10 * LEAST_RATIO, 0.1 * GREATEST_RATIO))
    low, high = 0.5 * guess, 2.0 * guess
    while too_much(low) > 0.0 and low > LEAST_RATIO:
        low *= 0.25
    while too_much(high) < 0.0 and high < GREATEST_RATIO:
        high *= 2.0
    if too_much(low) > 0.0 or too_much(high) < 0.0:
        raise ConvergenceError(
            f"{swing.stretch.record}: no damping between {low:.2g} and {high:.2g} s times the stiffness lets the model "
            f"swing with a damping ratio of {seen.damping_ratio:.3g} as the arm does at {seen.frequency:.3g} Hz; check "
            "stiffness, bending stiffness and mass"
        )
    ratio = float(optimize.brentq(too_much, low, high, rtol=_TOLERANCE, xtol=1e-9))
    too_much(ratio)
    return ratio, made[ratio]


def _mean(ratios: Array) -> tuple[float, float]:
    """Mean of estimates with standard errors, and its own: from theirs, or from how they differ where that is more."""
    weights = np.maximum(ratios[:, 1], 1e-6 * ratios[:, 0]) ** -2.0
    mean = float(weights @ ratios[:, 0] / weights.sum())
    error = float(weights.sum() ** -0.5)
    if len(ratios) > 1:
        spread = weights @ (ratios[:, 0] - mean) ** 2 / weights.sum() / (len(ratios) - 1)
        error = max(error, float(np.sqrt(spread)))
    return mean, error


def _strongest_line(t: Array, y: Array) -> float:
    """Frequency of the strongest line of the spectrum, Hz, samples made even first."""
    count = len(t)
    even = np.linspace(t[0], t[-1], count)
    values = np.interp(even, t, y)
    spectrum = np.abs(np.fft.rfft(values - values.mean(), 8 * count))
    frequencies = np.fft.rfftfreq(8 * count, (t[-1] - t[0]) / (count - 1))
    # Below one period in the stretch there is drift, not swing.
    spectrum[frequencies * t[-1] < 1.0] = 0.0
    return float(frequencies[np.argmax(spectrum)])
