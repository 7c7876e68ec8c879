"""Excitation: pressures that make parameters known, and how well, before anything is measured.

The pressures are a programme (:mod:`bha.estimation.programme`) within the pressure range of every section and the
lengths of the model's poses.

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
from bha.estimation.programme import KINDS, Programme, bounded, commands
from bha.estimation.records import Record, windows
from bha.estimation.solver import Point, Problem, Residuals
from bha.identification.identifiability import Combination, unknown_combinations
from bha.logs import Log
from bha.recordings import ChannelFacts, Observation
from bha.recordings.outputs import coordinate_outputs
from bha.runs.input import Input
from bha.support.shown import short_repr

Array = NDArray[np.float64]

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
        return commands(self.time, self.pressures, self.inputs, origin="<excitation>")


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
    made = bounded(arm, Programme(tuple(kinds), amplitude, highest_frequency, duration, rate, seed))
    if made is None:
        raise ConvergenceError(
            "even small pressures about the middle of the range drive the model out of its lengths; check "
            "pressure_range, length_range and stiffness of the arm"
        )
    time, pressures = made
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
