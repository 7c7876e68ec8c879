"""Excitation: pressures that make parameters known, and how well, before anything is measured.

The pressures are a programme (:mod:`bha.estimation.programme`) within the pressure range of every section and the
lengths of the model's poses. How well each parameter would be known follows from the Fisher information of the
simulated log with the sensor noise that is asked for; nothing is fitted. After a fit the pieces are those that tell
what it could not (:mod:`bha.identification.design`), and what is known already counts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError, InputError, ParameterError
from bha.estimation.free import Coordinate, FreeParameter, resolve
from bha.estimation.programme import EVERY_KIND, KINDS, Programme, bounded, commands
from bha.estimation.scale import default_free_of
from bha.identification.design import chosen, count_of
from bha.identification.identifiability import Combination, unknown_combinations
from bha.identification.knowledge import Known, deviations, information, made_record, observation_of
from bha.identification.result import Identification
from bha.logs import Log
from bha.support.shown import short_repr

Array = NDArray[np.float64]

#: Most samples of a proposal.
MOST_SAMPLES = 5_000_000
#: A parameter is told if its deviation on its coordinate stays below this.
TOLD = 0.5
#: The known mass that is thought of, as part of the arm's own.
_PAYLOAD = 0.25


@dataclass(frozen=True)
class Prospect:
    """How well one parameter would be known.

    Attributes:
        name: its path.
        unit: unit of the numbers.
        value: value of the arm.
        standard_error: that the log would give, from sensor noise alone, with what is known already.
        told: whether the log would tell it.
        before: standard error from what is known already; None where nothing is.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    told: bool
    before: float | None = None


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
        pieces: kinds of what follows each other.
        advice: what would tell the rest, in sentences.
    """

    time: Array
    pressures: Array
    inputs: tuple[str, ...]
    prospects: tuple[Prospect, ...]
    unknown: tuple[Combination, ...]
    pieces: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()

    def log(self) -> Log:
        """The commanded pressures as a log (``pc11 [Pa]``, ...)."""
        return commands(self.time, self.pressures, self.inputs, "<excitation>")


def excite(
    arm: Arm,
    *,
    duration: float = 60.0,
    rate: float = 200.0,
    kinds: Sequence[str] | None = None,
    amplitude: float = 0.6,
    highest_frequency: float = 3.0,
    free: Iterable[FreeParameter | str] | None = None,
    noise: float = 3e-4,
    seed: int = 0,
    after: Identification | Mapping[str, Any] | None = None,
) -> Excitation:
    """Propose pressures, and predict how well each parameter would be known from a log under them.

    Args:
        arm: the arm, roughly right; after a fit the identified one.
        duration: of the whole, s.
        rate: samples a second.
        kinds: which pieces, of ``hold``, ``multisine``, ``release``, ``even`` and ``slow``; the first three in this
            order if None. After a fit those that may be chosen, all if None.
        amplitude: part of half the pressure range that is used, above 0 and up to 1; it is lowered where the model
            would leave its length range.
        highest_frequency: of the multisine, Hz.
        free: parameters to judge; if None those of the fit, or those that are free by default where lengths are
            measured (:func:`bha.estimation.scale.default_free_of`), without moments of inertia.
        noise: standard deviation of the length sensors, m; after a fit its channels and their noise count instead.
        seed: of phases and levels.
        after: the last result, or its summary (``bha identify --json``): pieces are chosen that tell what it could not,
            and standard errors are those with its logs.

    Raises:
        InputError: an argument that is not allowed, or a result without standard errors.
        ParameterError: the result has a parameter that the arm does not have.
        ConvergenceError: the arm holds no pose at the middle of its pressures.
    """
    kinds = tuple((KINDS if after is None else EVERY_KIND) if kinds is None else kinds)
    _check(duration, rate, kinds, amplitude, highest_frequency, noise)
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise InputError(f"seed: {seed}; allowed: 0 and any greater whole number")
    if not duration * rate <= MOST_SAMPLES:
        raise InputError(
            f"duration: {duration:g} s at {rate:g} samples a second; allowed: 1 to {MOST_SAMPLES / rate:.6g} s at "
            "this rate, and longer ones at a lower rate"
        )
    known = None if after is None else _known(after)
    observed = observation_of(arm, None if known is None else known.noise, noise)

    def within(pieces: tuple[str, ...], seconds: float) -> tuple[Array, Array]:
        made = bounded(arm, Programme(pieces, amplitude, highest_frequency, seconds, rate, seed))
        if made is None:
            raise ConvergenceError(
                "even small pressures about the middle of the range drive the model out of its lengths; check "
                "pressure_range, length_range and stiffness of the arm"
            )
        return made

    pieces = kinds
    if known is None:
        rec = made_record(arm, *within(pieces, duration), observed)
        # What is free beside them by a prior that is good enough is nothing to be told.
        wanted = [f for f in default_free_of(arm.parameters, [rec]) if not f.path.endswith(".inertia.*")]
        coordinates = resolve(arm.parameters, wanted if free is None else free)
        before = np.zeros((len(coordinates), len(coordinates)))
    else:
        coordinates, before = _after(arm, known, free)
        count = count_of(duration)

        def tells(kind: str) -> Array:
            return information(arm, coordinates, made_record(arm, *within((kind,), duration / count), observed))

        pieces = tuple(chosen(before, kinds, tells, count))
    time, pressures = within(pieces, duration)
    total = before + information(arm, coordinates, made_record(arm, time, pressures, observed))
    prospects = _prospects(coordinates, before if known is not None else None, total)
    unknown = unknown_combinations(coordinates, total)
    advice: tuple[str, ...] = ()
    if unknown:
        section = arm.section_count
        mass = _PAYLOAD * sum(s.total_mass for s in arm.parameters.sections)
        path = f"section.{section}.payload"
        loaded = information(arm, coordinates, made_record(arm, time, pressures, observed, {path: mass}))
        advice = _advice(coordinates, prospects, total + loaded, path, mass)
    return Excitation(time, pressures, arm.inputs, prospects, unknown, pieces, advice)


def _known(after: Identification | Mapping[str, Any]) -> Known:
    return Known.from_mapping(after.summary() if isinstance(after, Identification) else after)


def _after(arm: Arm, known: Known, free: Iterable[FreeParameter | str] | None) -> tuple[tuple[Coordinate, ...], Array]:
    """Coordinates of the fit's parameters, or of those asked for, and what is known of them."""
    try:
        coordinates = resolve(arm.parameters, known.paths)
    except ParameterError as error:
        raise ParameterError(f"{error}; give the file that this result was written to") from error
    table = known.on(coordinates)
    if free is None:
        return coordinates, table
    wanted = resolve(arm.parameters, free)
    before = np.zeros((len(wanted), len(wanted)))
    own = {c.path: k for k, c in enumerate(coordinates)}
    both = [(k, own[c.path]) for k, c in enumerate(wanted) if c.path in own]
    if both:
        places, sources = (list(side) for side in zip(*both, strict=True))
        slopes = np.array([wanted[k].slope(0.0) / coordinates[j].slope(0.0) for k, j in both])
        before[np.ix_(places, places)] = table[np.ix_(sources, sources)] * np.outer(slopes, slopes)
    return wanted, before


def _prospects(coordinates: Sequence[Coordinate], before: Array | None, total: Array) -> tuple[Prospect, ...]:
    after, earlier = deviations(total), None if before is None else deviations(before)
    return tuple(
        Prospect(
            c.name,
            c.unit,
            c.start,
            float(after[k]) * abs(c.slope(0.0)),
            bool(after[k] < TOLD),
            None if earlier is None else float(earlier[k]) * abs(c.slope(0.0)),
        )
        for k, c in enumerate(coordinates)
    )


def _advice(
    coordinates: Sequence[Coordinate], prospects: Sequence[Prospect], loaded: Array, path: str, mass: float
) -> tuple[str, ...]:
    """What a known mass would tell that no pressures do."""
    found = deviations(loaded)
    gained = [
        f"{c.name} to {100.0 * own:.2g} %" if c.logarithmic else c.name
        for c, own, prospect in zip(coordinates, found, prospects, strict=True)
        if not prospect.told and own < TOLD
    ]
    if not gained:
        return ()
    return (
        f"what no pressures tell, a known mass does: measure the same once more with {mass:.2g} kg on the last head, "
        f"and identify from both logs with --with LOG {path}={mass:.2g}; that tells {', '.join(gained)}",
    )


def _check(
    duration: float, rate: float, kinds: Sequence[str], amplitude: float, highest_frequency: float, noise: float
) -> None:
    wrong = [kind for kind in kinds if kind not in EVERY_KIND]
    if wrong or not kinds:
        raise InputError(f"kinds: {', '.join(wrong) or 'none'}; allowed: {', '.join(EVERY_KIND)}")
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
