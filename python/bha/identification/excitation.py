"""Excitation: pressures that make parameters known, and how well, before anything is measured.

Four pieces follow each other, between which the arm rests at the middle of its pressures: steps that are held, at every
input alone and all together (stiffness, rest), a multisine of all inputs at once (everything), and a release, which is
a fast fall of one side's pressures from a bent pose (damping where nobody pulls at the arm). All stay within the
pressure range of every section and within the lengths of the model's poses.

How well each parameter would be known follows from the Fisher information of the simulated log with the sensor noise
that is asked for; nothing is fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError, InputError
from bha.estimation.engine import Model
from bha.estimation.free import FreeParameter, default_free, resolve
from bha.estimation.integration import choose_integration
from bha.estimation.records import Record, windows
from bha.estimation.solver import Point, Problem, Residuals
from bha.identification.identifiability import Combination, unknown_combinations
from bha.logs import Log
from bha.recordings import ChannelFacts, Observation
from bha.recordings.outputs import coordinate_outputs
from bha.runs.input import Input
from bha.support.shown import short_repr

Array = NDArray[np.float64]

KINDS = ("hold", "multisine", "release")
#: What a valve does to a commanded step, at the least: a ramp of this length, s.
RAMP = 0.1
_SINES = 12
#: Most samples of a proposal.
MOST_SAMPLES = 5_000_000


@dataclass(frozen=True)
class Prospect:
    """How well one parameter would be known.

    Attributes:
        name: its path.
        unit: unit of the numbers.
        value: value of the arm.
        standard_error: that the log would give, from sensor noise alone.
        told: whether the log would tell it.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    told: bool


@short_repr
@dataclass(frozen=True)
class Excitation:
    """Commanded pressures over time, and what they would tell.

    Attributes:
        time: s, shape (m,).
        pressures: commanded, Pa absolute, shape (m, inputs).
        inputs: names of the inputs.
        prospects: how well each parameter would be known.
        unknown: combinations that the log would not tell.
    """

    time: Array
    pressures: Array
    inputs: tuple[str, ...]
    prospects: tuple[Prospect, ...]
    unknown: tuple[Combination, ...]

    def log(self) -> Log:
        """The commanded pressures as a log (``pc11 [Pa]``, ...)."""
        columns = {f"pc{name.removeprefix('p')} [Pa]": p for name, p in zip(self.inputs, self.pressures.T, strict=True)}
        return Log.from_arrays({"t [s]": self.time, **columns}, origin="<excitation>")


def excite(
    arm: Arm,
    *,
    duration: float = 60.0,
    rate: float = 200.0,
    kinds: Sequence[str] = KINDS,
    amplitude: float = 0.6,
    highest_frequency: float = 3.0,
    free: Iterable[FreeParameter | str] | None = None,
    noise: float = 3e-4,
    seed: int = 0,
) -> Excitation:
    """Propose pressures, and predict how well each parameter would be known from a log of lengths under them.

    Args:
        arm: the arm, roughly right.
        duration: of the whole, s.
        rate: samples a second.
        kinds: which pieces, of ``hold``, ``multisine``, ``release``.
        amplitude: part of half the pressure range that is used, above 0 and up to 1; it is lowered where the model
        would
            leave its length range.
        highest_frequency: of the multisine, Hz.
        free: parameters to judge; those of :func:`bha.identification.default_free` if None.
        noise: standard deviation of the length sensors, m.
        seed: of phases and levels.

    Raises:
        InputError: an argument that is not allowed.
        ConvergenceError: the arm holds no pose at the middle of its pressures.
    """
    _check(duration, rate, kinds, amplitude, highest_frequency, noise)
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise InputError(f"seed: {seed}; allowed: 0 and any greater whole number")
    if not duration * rate <= MOST_SAMPLES:
        raise InputError(
            f"duration: {duration:g} s at {rate:g} samples a second; allowed: 1 to {MOST_SAMPLES / rate:.6g} s at "
            "this rate, and longer ones at a lower rate"
        )
    low, high = _limits(arm)
    share = amplitude
    for _ in range(12):
        time, pressures = _signal(arm, low, high, duration, rate, kinds, share, highest_frequency, seed)
        if _stays_within(arm, time, pressures):
            break
        share *= 0.8
    else:
        raise ConvergenceError(
            "even small pressures about the middle of the range drive the model out of its lengths; check "
            "pressure_range, length_range and stiffness of the arm"
        )
    prospects, unknown = predict_knowledge(
        arm, time, pressures, default_free(arm.parameters) if free is None else free, noise
    )
    return Excitation(time, pressures, arm.inputs, prospects, unknown)


def predict_knowledge(
    arm: Arm, time: Array, pressures: Array, free: Iterable[FreeParameter | str], noise: float
) -> tuple[tuple[Prospect, ...], tuple[Combination, ...]]:
    """How well parameters would be known from a log of all lengths with some noise, m, under these pressures."""
    coordinates = resolve(arm.parameters, free)
    n = 3 * arm.section_count
    rows = np.arange(0, len(time), max(1, round(0.01 * (len(time) - 1) / (time[-1] - time[0]))))
    observation = Observation.of(arm.parameters, coordinate_outputs(arm))
    rec = Record(
        name="<excitation>",
        drive=Input(time, pressures),
        rows=rows,
        observation=observation,
        measured=np.zeros((len(rows), n)),
        usable=np.ones((len(rows), n), dtype=np.bool_),
        facts=tuple(ChannelFacts(name, "m", noise, 0.0, 0.0) for name in observation.names),
        pressure_facts=tuple(ChannelFacts(name, "Pa", 0.0, 0.0, 0.0) for name in arm.inputs),
    )
    whole = windows([rec], None)
    states = np.concatenate([arm.static_lengths(pressures[0]), np.zeros(n)])[None]
    zero = np.zeros(len(coordinates))
    model = Model(arm.parameters, coordinates, (rec,))
    model = choose_integration(model, zero, whole, states)
    # Thinned rows stand for all: their noise is that of the mean.
    thinning = len(time) / len(rec.time)
    flat = (np.zeros(len(coordinates)), np.full(len(coordinates), 1e6))
    problem = Problem(model, tuple(whole), Residuals((rec.noise / np.sqrt(thinning),), np.inf), states, flat)
    information, _ = problem.normal(Point(zero, states)).reduced()
    unknown = unknown_combinations(coordinates, information)
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    variances = np.sum(vectors**2 / np.maximum(values, 1e-12 * values[-1]), axis=1)
    prospects = tuple(
        Prospect(c.name, c.unit, c.start, float(np.sqrt(v)) * abs(c.slope(0.0)), bool(v < 0.25))
        for c, v in zip(coordinates, variances, strict=True)
    )
    return prospects, unknown


def _signal(
    arm: Arm,
    low: Array,
    high: Array,
    duration: float,
    rate: float,
    kinds: Sequence[str],
    share: float,
    highest: float,
    seed: int,
) -> tuple[Array, Array]:
    random = np.random.default_rng(seed)
    time = np.arange(round(duration * rate) + 1) / rate
    middle, reach = (low + high) / 2.0, share * (high - low) / 2.0
    unit = np.zeros((len(time), len(low)))
    edges = np.linspace(0, len(time), len(kinds) + 1).astype(int)
    makers = {"hold": _holds, "release": _releases}
    for kind, first, last in zip(kinds, edges[:-1], edges[1:], strict=True):
        if kind == "multisine":
            unit[first:last] = _multisine(random, time[first:last] - time[first], len(low), highest)
        else:
            unit[first:last] = makers[kind](random, last - first, len(low), rate)
    ramp = max(1, round(RAMP * rate))
    kernel = np.ones(ramp) / ramp
    # Smoothed from the past only, so that nothing moves before it is commanded.
    smooth = np.column_stack(
        [np.convolve(np.concatenate([np.full(ramp - 1, u[0]), u]), kernel, "valid") for u in unit.T]
    )
    return time, middle + reach * smooth


def _multisine(random: np.random.Generator, t: Array, inputs: int, highest: float) -> Array:
    """Sums of sines with random phases, others for every input, faded in and out, within -1 to 1."""
    lines = np.geomspace(max(1.0 / t[-1], 0.05), highest, _SINES * inputs).reshape(_SINES, inputs)
    phases = random.uniform(0.0, 2.0 * np.pi, lines.shape)
    signal = np.zeros((len(t), inputs))
    for line, phase in zip(lines, phases, strict=True):
        signal += np.sin(2.0 * np.pi * line * t[:, None] + phase)
    fade = np.clip(np.minimum(t, t[-1] - t) / 1.0, 0.0, 1.0)[:, None]
    return np.asarray(fade * signal / np.abs(signal).max(axis=0))


def _holds(random: np.random.Generator, count: int, inputs: int, rate: float) -> Array:
    """Levels held for a while: all inputs together first, then each alone, in random order and of random height."""
    patterns = [np.full(inputs, level) for level in (0.8, -0.6)]
    patterns += [s * np.eye(inputs)[j] for j in random.permutation(inputs) for s in (1.0, -1.0)]
    each = max(1, count // len(patterns))
    unit = np.zeros((count, inputs))
    for k, pattern in enumerate(patterns):
        level = pattern * random.uniform(0.6, 1.0)
        # Held for two thirds, then back to the middle: steps of both signs.
        unit[k * each : k * each + (2 * each) // 3] = level
    return unit


def _releases(random: np.random.Generator, count: int, inputs: int, rate: float) -> Array:
    """One side up, held, then let go at once, with time to swing."""
    repeats = max(1, min(4, int(count / rate / 4.0)))
    each = count // repeats
    unit = np.zeros((count, inputs))
    for k in range(repeats):
        unit[k * each : k * each + each // 3] = np.where(random.random(inputs) < 0.5, 1.0, -0.7)
    return unit


def _limits(arm: Arm) -> tuple[Array, Array]:
    """Lowest and highest pressure of each input, Pa: the narrowest of the sections it feeds."""
    low, high = np.zeros(len(arm.inputs)), np.full(len(arm.inputs), np.inf)
    for number, section in enumerate(arm.parameters.sections, start=1):
        for bellows in section.resolved_bellows(number):
            j = arm.inputs.index(bellows.input)
            low[j] = max(low[j], section.pressure_range[0])
            high[j] = min(high[j], section.pressure_range[1])
    return low, high


def _stays_within(arm: Arm, time: Array, pressures: Array) -> bool:
    """Whether the poses that the pressures hold keep within the lengths of the arm, with a tenth to spare outside."""
    every = max(1, len(time) // 200)
    start: Array | None = None
    ranges = np.repeat([s.length_range for s in arm.parameters.sections], 3, axis=0)
    spare = 0.1 * (ranges[:, 1] - ranges[:, 0])
    for row in pressures[::every]:
        try:
            start = arm.static_lengths(row, start=start)
        except ConvergenceError:
            return False
        if np.any(start < ranges[:, 0] - spare) or np.any(start > ranges[:, 1] + spare):
            return False
    return True


def _check(
    duration: float, rate: float, kinds: Sequence[str], amplitude: float, highest_frequency: float, noise: float
) -> None:
    wrong = [kind for kind in kinds if kind not in KINDS]
    if wrong or not kinds:
        raise InputError(f"kinds: {', '.join(wrong) or 'none'}; allowed: {', '.join(KINDS)}")
    for name, value, ok, allowed in (
        ("duration", duration, duration >= 1.0, "at least 1 s"),
        ("rate", rate, 10.0 <= rate <= 1e4, "10 to 10000 samples a second"),
        ("amplitude", amplitude, 0.0 < amplitude <= 1.0, "above 0 and up to 1"),
        (
            "highest_frequency",
            highest_frequency,
            0.05 < highest_frequency <= rate / 4,
            "above 0.05 Hz, up to a quarter of the rate",
        ),
        ("noise", noise, noise > 0.0, "a positive number (m)"),
    ):
        if not (np.isfinite(value) and ok):
            raise InputError(f"{name}: {value}; allowed: {allowed}")
