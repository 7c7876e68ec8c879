"""What drives the arm of a log: measured or commanded pressures, held or linear between samples, how they act.

Measured pressures stand in the chambers: the arm's pneumatics lie before them and are left out. Commanded ones go
through the pneumatics, at the level that the file says. Gauge pressures are relative to the arm's own ambient pressure:
what moves a bellows is the difference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.errors import InputError, LogError
from bha.recordings.clock import later
from bha.recordings.doubt import FEWEST, GAP, NOISE_SHARE, STANDS_OUT, Doubt, Interpolant, doubt, left_out
from bha.recordings.interpolation import akima
from bha.recordings.noise import quiet_noise
from bha.recordings.samples import ChannelFacts

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.logs import Log

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
#: Which pressures of a log drive the arm.
PressureSort = Literal["measured", "commanded"]

#: A command that stands still for this long, s, for most of the time is one that is held between its changes.
HELD_SECONDS, HELD_SHARE = 0.2, 0.5
#: Readings this far apart, s, have a curve through them where that misses left-out ones by this share of the mean
#: square by which straight lines do (two thirds where pressures rise smoothly, all of it for jumps); then samples are
#: this close together, s.
SLOW, CURVED, FINE = 0.03, 0.75, 0.01
#: A quiet quarter with less than this share of the noise of the whole says that the rest was motion.
QUIET_SHARE = 0.6
#: A pressure that has changed over a dropout by this share of all its travel has done something that was missed.
MISSED_TRAVEL = 0.05


@dataclass(frozen=True)
class PressureChoice:
    """Which pressures drive the arm, and how.

    Attributes:
        sort: ``"measured"`` or ``"commanded"``.
        chosen: why this sort: ``"asked for"``, ``"the log has no others"`` or ``"the log has both"``.
        columns: names of the log's columns, in the order of the arm's inputs.
        between_samples: ``"linear"`` or ``"hold"``.
        pneumatics: level of the arm's pneumatics that acts, ``"ideal"`` for measured pressures.
        ambient_pressure: of the arm, Pa: what gauge pressures are relative to.
        gauge: columns that the file has as gauge pressures.
        between_readings: of measured pressures that are held for several samples: a ``"curve"`` through the readings
            drives, or ``"steps"`` where the arm shows that they act as they are held (:mod:`bha.recordings.stairs`).
    """

    sort: PressureSort
    chosen: str
    columns: tuple[str, ...]
    between_samples: Literal["linear", "hold"]
    pneumatics: str
    ambient_pressure: float
    gauge: tuple[str, ...]
    between_readings: Literal["curve", "steps"] = "curve"

    def to_mapping(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def commanded_name(name: str) -> str:
    """The commanded pressure of an input: ``pc11`` of ``p11``."""
    return "pc" + name.removeprefix("p")


def choose_sort(arm: Arm, log: Log, asked: PressureSort | None, origin: str) -> tuple[PressureSort, str]:
    """Which sort of pressures, and why.

    Raises:
        InputError: ``asked`` is no sort.
        LogError: the log lacks pressures of the arm; the text names the way on.
    """
    if asked is not None and asked not in get_args(PressureSort):
        raise InputError(f"pressures: found {asked!r}; allowed: 'measured' or 'commanded'")
    missing: Mapping[PressureSort, list[str]] = {
        "measured": [name for name in arm.inputs if name not in log],
        "commanded": [commanded_name(name) for name in arm.inputs if commanded_name(name) not in log],
    }
    if asked is not None:
        if missing[asked]:
            other: PressureSort = "commanded" if asked == "measured" else "measured"
            text = f"{origin}: there is no column '{missing[asked][0]}', a {asked} pressure of the arm"
            hint = f"; all {other} ones are there: --pressures {other} (in Python pressures='{other}')"
            raise LogError(text + (hint if not missing[other] else _columns(log)))
        return asked, "asked for"
    if not missing["measured"]:
        return "measured", "the log has both" if not missing["commanded"] else "the log has no others"
    if len(missing["measured"]) == len(arm.inputs) and not missing["commanded"]:
        return "commanded", "the log has no others"
    if not missing["commanded"]:
        # Some measured ones are there: one that is misspelt must not decide what drives the arm.
        lost = ", ".join(missing["measured"])
        raise LogError(
            f"{origin}: measured pressures are there, but not {lost}; all commanded ones are. Rename the column that "
            "is meant, or drive with the commanded ones: --pressures commanded (in Python pressures='commanded')"
        )
    lacking = missing["measured"] if len(missing["measured"]) <= len(missing["commanded"]) else missing["commanded"]
    # The log says itself, with the nearest name, why a column cannot be read.
    log[lacking[0]]
    raise AssertionError(lacking)


def _columns(log: Log) -> str:
    return f"; the log has: {', '.join(log.columns)}"


def is_held_between(time: Array, pressures: Array, sort: PressureSort) -> bool:
    """Whether pressures (m, inputs) stay as they are until the next sample: commands that stand still for long."""
    if sort == "measured" or len(time) < 3:
        return False
    moved = np.flatnonzero(np.any(np.diff(pressures, axis=0) != 0.0, axis=1)) + 1
    edges = np.concatenate([[0], moved, [len(time) - 1]])
    still = np.diff(time[edges])
    whole = float(time[-1] - time[0])
    return bool(whole > 0.0 and np.sum(still[still >= HELD_SECONDS]) > HELD_SHARE * whole and len(moved) > 0)


def between_fresh(
    time: Array, pressures: Array, facts: Sequence[ChannelFacts], usable: Mask
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Measured pressures by their readings: a curve through those that are held or far apart, without repeats.

    Args:
        time: of the rows, s, shape (m,).
        pressures: Pa, shape (m, inputs).
        facts: of the inputs.
        usable: which rows hold readings, shape (m, inputs).

    Returns:
        Time and pressures of the samples, and for each row its sample: the rows themselves, unless a curve needs more.
    """
    at, rows = samples_of(time, facts)
    whole = [fact.held == 0.0 and not fact.spikes and not fact.dropouts for fact in facts]
    if len(at) == len(time) and all(whole):
        return at, pressures, rows
    mended = np.empty((len(at), len(facts)))
    for k, fact in enumerate(facts):
        knots, values = (time, pressures[:, k]) if whole[k] else _readings(time, pressures[:, k], fact, usable[:, k])
        as_given = len(at) == len(time) and (whole[k] or len(knots) < 2)
        mended[:, k] = pressures[:, k] if as_given else _interpolant(fact)(at, knots, values)
    return at, mended, rows


def samples_of(time: Array, facts: Sequence[ChannelFacts]) -> tuple[Array, NDArray[np.intp]]:
    """Times of the samples that drive the arm, s, and the sample of each row: more than rows where a curve is."""
    rows = np.arange(len(time))
    if not any(fact.curved for fact in facts):
        return time, rows
    steps = np.diff(time)
    usual = float(np.median(steps))
    more = np.where(steps <= GAP * usual, np.ceil(steps / FINE - 1e-6), 1.0).astype(np.intp)
    first = np.concatenate([[0], np.cumsum(more)]).astype(np.intp)
    place = np.arange(first[-1] + 1)
    return np.interp(place, first, time), first


def with_curve(fact: ChannelFacts, time: Array, column: Array, usable: Mask) -> ChannelFacts:
    """The facts of a measured pressure read in every row, with whether a curve goes through readings far apart."""
    if fact.held > 0.0 or fact.interval < SLOW or np.min(np.diff(time), initial=1.0) <= 0.0:
        return fact
    knots, values = _readings(time, column, fact, usable)
    if len(knots) < FEWEST:
        return fact
    straight, curve = (float(np.mean(left_out(knots, values, 2, by) ** 2)) for by in (np.interp, akima))
    moves = straight > STANDS_OUT * NOISE_SHARE * fact.noise**2
    return replace(fact, curved=True) if moves and curve < CURVED * straight else fact


def left_open(
    time: Array, pressures: Array, facts: Sequence[ChannelFacts], usable: Mask, noise: Array
) -> tuple[Doubt, ...]:
    """What the readings of measured pressures, with their noise, leave open between them, one an input."""
    at, _ = samples_of(time, facts)
    return tuple(
        doubt(at, *_readings(time, pressures[:, k], fact, usable[:, k]), float(noise[k]), _interpolant(fact))
        for k, fact in enumerate(facts)
    )


def with_quiet_noise(fact: ChannelFacts, readings: Array) -> ChannelFacts:
    """The facts of a measured pressure with the noise of its quiet quarter where all the rest moves.

    What moves and is taken for noise would shake the model at every reading; what a curve misses is left open instead.
    """
    quiet = quiet_noise(readings)
    # On a coarse grid differences are steps of it or nothing.
    return replace(fact, noise=quiet) if fact.quantum < quiet < QUIET_SHARE * fact.noise else fact


def _readings(time: Array, column: Array, fact: ChannelFacts, usable: Mask) -> tuple[Array, Array]:
    """Times and values of the readings of one pressure."""
    good = np.flatnonzero(usable)
    good = good[later(time[good])]
    knots, values = time[good], column[good]
    # A reading that stays for longer than usual has been renewed by the same value: it changes at the end.
    renewed = fact.held > 0.0 and not fact.filled
    late = np.flatnonzero(np.diff(knots) > 2.5 * fact.interval) if renewed else np.empty(0, dtype=int)
    return np.insert(knots, late + 1, knots[late + 1] - fact.interval), np.insert(values, late + 1, values[late])


def _interpolant(fact: ChannelFacts) -> Interpolant:
    """Between readings that are held for several samples, or far apart, a curve, else straight lines."""
    return akima if fact.held > 0.0 or fact.curved else np.interp


def missed_spans(time: Array, pressures: Array, facts: Sequence[ChannelFacts]) -> list[tuple[float, float]]:
    """Dropouts, s, of measured pressures after which a pressure is another: what lay between is not known."""
    found = []
    for k, fact in enumerate(facts):
        travel = float(np.ptp(pressures[:, k]))
        for start, end in fact.dropouts:
            before, after = (pressures[min(int(np.searchsorted(time, t)), len(time) - 1), k] for t in (start, end))
            if abs(after - before) > max(MISSED_TRAVEL * travel, 6.0 * fact.noise):
                found.append((start, end))
    return found


def with_jumps(
    time: Array, pressures: Array, forces: Array | None
) -> tuple[Array, Array, Array | None, NDArray[np.intp]]:
    """A held input as one that is linear between samples and jumps where it changes: two samples at that time.

    Args:
        time: s, shape (m,).
        pressures: Pa, shape (m, inputs), each held until the next.
        forces: N, shape (m, n, 3), linear between samples, or None.

    Returns:
        Time, pressures and forces of the samples, and for each of the m given rows its sample.
    """
    changed = np.flatnonzero(~np.all(np.diff(pressures, axis=0) == 0.0, axis=1)) + 1
    changed = changed[time[changed] > time[changed - 1]]
    # Before each change one more sample at the same time, with what was held until then.
    order = np.insert(np.arange(len(time)), changed, changed)
    held = np.insert(np.arange(len(time)), changed, changed - 1)
    rows = np.arange(len(time)) + np.searchsorted(changed, np.arange(len(time)), side="right")
    return time[order], pressures[held], None if forces is None else forces[order], rows


def names_no_input(arm: Arm, log: Log) -> list[str]:
    """Pressures of the log that the arm has no input for."""
    known = {*arm.inputs, *(commanded_name(name) for name in arm.inputs)}
    kinds = ("pressure", "commanded_pressure")
    return [
        name
        for name in log.columns
        if (quantity := names.quantity(name)) is not None and quantity.kind in kinds and name not in known
    ]
