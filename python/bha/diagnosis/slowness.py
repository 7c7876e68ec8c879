"""Lag of the pressures or damping: two slow stages, one after the other, and which of them is whose.

What: chambers that follow their commands with a lag, and sections whose damping outweighs their mass, are two stages of
first order in a row. Near a pose the arm answers to commands alike if the two change places (their transfer functions
commute): what commands tell is the time that both have together, and the lag alone only where it is much the longer one
(:mod:`bha.estimation.lags`, whose rule counts here too). That they fill and vent unlike tells no more: a real arm comes
back slower than it bends, behind its own measured pressures (docs/decisions/0017). Hence

- a fit with a lag is begun anew with the two exchanged, and with their time divided otherwise: it ends in whichever
  valley it began;
- a lag, a delay or a damping of bending that is named from commands on such an arm is the class "lag of the pressures
  or damping" where that rule does not tell the lag; a damping far above the file's is said to be perhaps a lag.

Validity: arms without swing; a lag that is alike for all inputs, or for those of one section.
What splits the class: pressures measured in the chambers, or the arm let go by hand under constant pressures.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import Fit, Problem, lowest
from bha.diagnosis.model import is_damping
from bha.diagnosis.places import place_of
from bha.diagnosis.result import Alternative, Diagnosis, Effect, Number, SlowSection
from bha.diagnosis.valves import NUMBERS, is_of_valves
from bha.diagnosis.words import slow_in_words
from bha.errors import BhaError
from bha.estimation.apart import mean_pressures
from bha.estimation.engine import Model
from bha.estimation.lags import CommonTime, common_with
from bha.estimation.terms import number_of
from bha.parameters import paths

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.estimation.records import Record

Array = NDArray[np.float64]

LAG = "pressure_lag"
#: Kinds that slow an arm without swing down.
SLOW = (LAG, "delay", "bending_damping")
#: Shares of the common time that a lag begins with, beside those that were found and their exchange.
SHARES = (0.4, 0.75)
#: Damping over the file's from which a lag may have been taken for it.
FAR = 3.0
#: What splits the class.
EXPERIMENT = (
    "log the pressures in the chambers beside the commands, or let the arm go by hand under constant pressures: it "
    "comes back by its damping alone"
)


def relaxation(model: Model, x: Array, sections: Collection[int]) -> float:
    """Damping over tangent stiffness of some sections, counted from 1, s: geometric mean over their places."""
    found = []
    for own, value in zip(model.plain, x, strict=False):
        if _section_of(own.path) not in sections:
            continue
        key = paths.key_of(own.path)
        if is_damping(own):
            found.append(np.log(own.value(float(value))))
        elif key == "tangent_stiffness":
            found.append(-np.log(own.value(float(value))) / _places(model, own.path))
    return float(np.exp(np.sum(found) / len(sections)))


def _section_of(path: str) -> int | None:
    """The section of a plain number, from 1; None where it is of none."""
    steps = path.split(".")
    return int(steps[1]) if steps[0] == "section" and steps[1].isdigit() else None


def _places(model: Model, path: str) -> int:
    """In how many places the tangent stiffness of the section of ``path`` is a coordinate."""
    section = path.rpartition(".")[0]
    return sum(c.path.rpartition(".")[0] == section for c in model.plain)


@dataclass(frozen=True)
class FittedLag:
    """A lag among the effects of a model.

    Attributes:
        place: of its numbers among the coordinates.
        time: geometric mean of filling and venting, s.
        sections: those whose inputs it slows down, from 1.
    """

    place: slice
    time: float
    sections: tuple[int, ...]


def lag_of(model: Model, x: Array) -> FittedLag | None:
    """The lag of all inputs, or of those of one section; None where there is not one.

    Beside that of the plain model another one is a further stage.
    """
    lags = [k for k, effect in enumerate(model.effects) if effect.kind == LAG]
    if any(is_of_valves(c) for c in model.plain) or len(lags) != 1:
        return None
    effect, place = model.effects[lags[0]], model.place(lags[0])
    where = place_of(effect.where)
    numbers = effect.elements([float(v) for v in x[place]])[0]
    if where.sort not in ("all", "section") or not numbers:
        return None
    sections = tuple(range(1, model.sections + 1)) if where.section is None else (where.section,)
    return FittedLag(place, float(np.sqrt(numbers["fill"] * numbers["vent"])), sections)


def divided(model: Model, x: Array, lag: float, relaxed: float) -> Array | None:
    """Coordinates with another lag of the pressures and another relaxation of its sections, s; None without the two.

    Masses, inertias and their centres are the file's: what makes up for a stage that is missing is absurd with it.
    """
    found = lag_of(model, x)
    if found is None:
        return None
    now = relaxation(model, x, found.sections)
    if not any(is_damping(c) for c in model.plain) or not (found.time > 0.0 and now > 0.0):
        return None
    place, other = found.place, x.copy()
    for k, own in enumerate(model.coordinates):
        value = own.value(float(x[k]))
        key = number_of(own)
        if k < len(model.plain):
            if _section_of(own.path) not in found.sections:
                continue
            if is_damping(own):
                other[k] = own.coordinate(value * relaxed / now)
            elif paths.key_of(own.path) in ("mass", "inertia", "center_of_mass"):
                other[k] = 0.0
        elif place.start <= k < place.stop and key in ("fill", "vent"):
            other[k] = own.coordinate(value * lag / found.time)
        elif own.name.startswith("bending_damping") and key == "damping":
            other[k] = own.coordinate(value * relaxed / now)
    return other


def better_way(problem: Problem, fit: Fit) -> Fit:
    """``fit``, or where the two stages are divided otherwise one that ends lower; of arms that do not swing."""
    found = lag_of(fit.model, fit.x)
    if found is None or not _is_damped(fit, found.sections):
        return fit
    lag, own = found.time, relaxation(fit.model, fit.x, found.sections)
    ways = ((own, lag), *((share * (lag + own), (1.0 - share) * (lag + own)) for share in SHARES))
    starts = (divided(fit.model, fit.x, now, relaxed) for now, relaxed in ways)
    return lowest(problem, fit, (x for x in starts if x is not None), iterations=20, tolerance=2e-3, renewals=5)


def plain_divisions(model: Model, x: Array) -> list[Array]:
    """Coordinates of a plain model with a lag of commands, its slowness divided otherwise between that and dampings.

    Once with the dampings of the file and a lag as much longer as none of its sections was faster, once with a lag of
    next to nothing and all of them as much slower.
    """
    lags = [k for k, own in enumerate(model.plain) if own.name in (NUMBERS[LAG, "fill"], NUMBERS[LAG, "vent"])]
    dampings = [k for k, own in enumerate(model.plain) if is_damping(own)]
    if not lags or len(dampings) != model.sections:
        return []
    times = [model.plain[k].value(float(x[k])) for k in lags]
    slow = [relaxation(model, x, (section,)) for section in range(1, model.sections + 1)]
    filed = x.copy()
    filed[dampings] = 0.0
    more = min(own - relaxation(model, filed, (section,)) for section, own in enumerate(slow, start=1))
    short = x.copy()
    for k, time in zip(lags, times, strict=True):
        own = model.plain[k]
        filed[k] = own.coordinate(max(time + more, own.lower))
        short[k] = own.coordinate(own.lower)
    for k, time in zip(dampings, slow, strict=True):
        own = model.plain[k]
        short[k] = own.coordinate(own.value(float(x[k])) * (time + float(np.mean(times))) / time)
    return [filed, short]


def _is_damped(fit: Fit, sections: Sequence[int]) -> bool:
    """Whether one of these sections does not swing along its axis: (3 c)^2 > 4 (3 k) m, three bellows abreast."""
    values = {c.path: c.value(float(v)) for c, v in zip(fit.model.plain, fit.x, strict=False)}
    for section in sections:
        own = {path: v for path, v in values.items() if path.startswith(f"section.{section}.")}
        stiffness = [v for path, v in own.items() if paths.key_of(path) == "tangent_stiffness"]
        damping, mass = own.get(f"section.{section}.damping", 0.0), own.get(f"section.{section}.mass", 0.0)
        if stiffness and 3.0 * damping**2 > 4.0 * float(np.mean(stiffness)) * mass:
            return True
    return False


def lag_or_damping(found: Diagnosis, arm: Arm, records: Sequence[Record]) -> Diagnosis:
    """A diagnosis from commands with what they do not tell: the class as its headline, or a sentence.

    Args:
        found: the diagnosis.
        arm: the diagnosed arm.
        records: its logs.
    """
    slow = [e for e in found.effects if e.kind in SLOW and not e.where.startswith(("input ", "bellows ", "sensors"))]
    if not found.has_names and found.verdict != "equivalent" and not slow:
        return found
    lag, error = _lag(slow)
    # A dead time of the plain model is told beside the lag that it has, and that lag beside a further stage.
    more = any(not e.plain for e in slow)
    slow = [e for e in slow if not e.plain or (e.kind == LAG and not more)]
    # Where a refit with the other sort of slowness is as good, the logs do not tell, whatever the arm that was found.
    rivals = any(other.kind in SLOW for e in slow for other in e.one_of)
    times = _times(arm, records, lag, error, swinging=rivals)
    if not times or (not rivals and all(time.told for time in times)):
        return found
    if slow:
        return _with_class(found, slow, times)
    far = [name for name, e in found.plain.items() if name.endswith(" damping") and e.start and e.value > FAR * e.start]
    if not far:
        return found
    text = (
        f"{', '.join(far)} came out at more than {FAR:.0f} times the file's: {slow_in_words(_sections(times))}; "
        f"commands alone do not tell which. What would: {EXPERIMENT}"
    )
    return found.model_copy(update={"setup": [*found.setup, text]})


def _lag(effects: Sequence[Effect]) -> tuple[float, float]:
    """Lag and delay of named effects together, s, and the relative standard error of the lag."""
    total, error = 0.0, math.inf
    for effect in effects:
        n = effect.parameters
        if effect.kind == LAG:
            mean = 0.5 * (n["fill"].value + n["vent"].value)
            total += mean
            spans = [number.ci95 for number in (n["fill"], n["vent"])]
            if all(spans) and mean > 0.0:
                error = max(high - low for low, high in (span for span in spans if span)) / (2.0 * 1.96 * mean)
        elif effect.kind == "delay":
            total += n["time"].value
    return total, error


def _times(arm: Arm, records: Sequence[Record], lag: float, error: float, *, swinging: bool) -> tuple[CommonTime, ...]:
    """The common times of an arm; none of one whose slowest motion swings, unless that is ``swinging`` all the same."""
    pressures = mean_pressures(records)
    try:
        q = arm.static_lengths(pressures)
        state, _ = arm.linearize(q, 0.0 * q, pressures)
    except BhaError:
        return ()
    modes = np.linalg.eigvals(state)
    slowest = modes[np.argmin(np.abs(modes.real))]
    still = abs(slowest.imag) < 1e-6 * abs(slowest)
    return common_with(arm, pressures, lag, error) if still or swinging else ()


def _sections(times: Sequence[CommonTime]) -> list[SlowSection]:
    return [SlowSection(section=t.section, across=t.across, along=t.along) for t in times]


def _with_class(found: Diagnosis, slow: Sequence[Effect], times: Sequence[CommonTime]) -> Diagnosis:
    """The diagnosis with its slow effects as one class."""
    first = slow[0]
    # Each section has the lag of its inputs in its own time: what all have is no longer than the shortest of these.
    having = [time for time in times if first.where in ("all", f"section {time.section}")] or times
    longest = min(max(time.across, time.along) for time in having)
    members = [Alternative(kind=e.kind, where=e.where, parameters=e.parameters) for e in slow[1:]]
    if all(e.kind != LAG for e in slow):
        own = Number(value=longest, unit="s", ci95=(0.0, longest))
        members.insert(0, Alternative(kind=LAG, where="all", parameters={"fill": own, "vent": own}))
    parameters = dict(first.parameters)
    if first.kind == LAG:
        # Anything up to the whole of the common time, which the longer way has its part of.
        mean = max(_lag([first])[0], 1e-9)
        parameters = {
            name: n.model_copy(update={"ci95": (0.0, max(longest * max(1.0, n.value / mean), *(n.ci95 or (n.value,))))})
            for name, n in first.parameters.items()
        }
    update = {
        "parameters": parameters,
        "one_of": [*members, *first.one_of],
        "slow": _sections(times),
        "experiment": EXPERIMENT,
        "confidence": max(e.confidence for e in slow),
    }
    effects = [first.model_copy(update=update), *(e for e in found.effects if all(e is not s for s in slow))]
    # The whole of the common time may be damping, too.
    more = max(time.along / max(time.along - time.lag, 1e-3 * time.along) for time in times)
    plain = {
        name: e.model_copy(update={"ci95": (0.0, max(e.ci95[1], more * e.value))})
        if name.endswith(" damping") and e.ci95
        else e
        for name, e in found.plain.items()
    }
    verdict = found.verdict if all(e.plain for e in slow) else "one_of"
    return found.model_copy(update={"verdict": verdict, "effects": effects, "plain": plain})
