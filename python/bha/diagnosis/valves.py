"""What lies between a command and its chamber, as numbers of the plain model: a lag and a dead time of all inputs.

What: every arm whose logs hold commands alone has both, so that they are no finding of a search: they are free beside
masses and stiffnesses from the start (:mod:`bha.estimation.lags` has their ranges, and says why the lag has a second
stage). They stand as effects ``pressure_lag``, once more for its second stage, and ``delay`` at ``all`` among the arm's
own. Where they begin a search by simulations says: the loss
has a valley for each way of dividing an arm's slowness into lag, dead time and damping, and a local fit ends in the one
it began in.
Limits: one lag and one dead time for all inputs. Gains and offsets of all inputs together act as areas and rest lengths
do, and are not free. An arm whose file has ``level = "lag"`` keeps it there; one with ``"full"`` has its pneumatics
from the file alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.diagnosis.model import coordinate, is_damping
from bha.diagnosis.result import Effect, Number
from bha.diagnosis.shortcuts import PressureProbe, acting_pressures
from bha.estimation.dynamics import trials
from bha.estimation.engine import Model
from bha.estimation.free import resolve
from bha.estimation.lags import DELAY_SPREAD, GREATEST, LATEST, LEAST, PATHS, STAGE_SPREAD, STAGES, START
from bha.estimation.lags import STAGE as SHORT
from bha.estimation.runs import Integration
from bha.estimation.terms import number_of
from bha.parameters import paths
from bha.parameters.provenance import published

if TYPE_CHECKING:
    from bha.estimation.free import Coordinate
    from bha.estimation.records import Record
    from bha.parameters import ArmParameters, EffectParameters

Array = NDArray[np.float64]

LAG, DELAY = "pressure_lag", "delay"
#: The same lag once more, by one time for both ways: what stands behind its number is the second effect of its kind.
STAGE = "second stage"
#: Numbers of the two, with what reports call them.
NUMBERS = {
    (LAG, "fill"): "lag of commands, filling",
    (LAG, "vent"): "lag of commands, venting",
    (DELAY, "time"): "dead time of commands",
    (STAGE, "fill"): "second stage of commands",
}
#: How far a lag's logarithm plausibly is from where it begins; least, greatest and spread of each, s.
LAG_SPREAD = 2.0
_RANGES = {
    LAG: (LEAST, GREATEST, LAG_SPREAD),
    DELAY: (0.0, LATEST, DELAY_SPREAD),
    STAGE: (STAGES[0] * SHORT, STAGES[1] * SHORT, STAGE_SPREAD),
}
#: Lags and dead times from which the fit may begin, s, and factors on the file's damping at which they are tried.
LAGS, DELAYS, DAMPINGS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6), (0.0, 0.05, 0.1, 0.2), (0.2, 1.0, 5.0, 30.0)
#: How many of them are fitted.
STARTS = 2
#: Standard deviation of a coordinate, in that of its prior, from which it is the model's error that leaves it open. A
#: prior alone makes 1, and its draws, some hundreds, are off by a tenth of that at the most.
BEYOND = 1.5
#: A time of less than this, s, is none.
SHORTEST = 4e-3


def with_valves(arm: Arm) -> Arm:
    """The arm with a lag, of two stages, and a dead time of its inputs, where its file has none that stand for them."""
    own = {effect.kind for effect in arm.parameters.effects if effect.where == "all"}
    added = []
    lagging = LAG in own or arm.pneumatics_level != "ideal"
    if not lagging:
        added.append({"kind": LAG, "where": "all", "fill": START, "vent": START})
    if DELAY not in own and arm.pneumatics_level != "full":
        added.append({"kind": DELAY, "where": "all", "time": 0.0})
    if not lagging:
        added.append({"kind": LAG, "where": "all", "fill": SHORT, "vent": SHORT})
    return arm.with_effects([*arm.parameters.effects, *added]) if added else arm


def coordinates_of(parameters: ArmParameters) -> tuple[Coordinate, ...]:
    """The free numbers of what lies between command and chamber; what the file calls published is known and stays."""
    found = []
    for path, kind, number in _paths(parameters):
        value = float(paths.get_value(parameters, path))
        low, high, spread = _RANGES[kind]
        own = coordinate(
            NUMBERS[kind, number],
            path,
            "s",
            min(max(value, low), high),
            spread,
            logarithmic=kind != DELAY,
            low=low,
            high=high,
        )
        members = (path, f"{path.rpartition('.')[0]}.vent") if kind == STAGE else (path,)
        found.append(replace(own, members=members))
    return tuple(found)


def lags_of(model: Model) -> tuple[int, int]:
    """Where the times of filling and venting stand among the plain coordinates of a model that has both."""
    names = [own.name for own in model.plain]
    return names.index(NUMBERS[LAG, "fill"]), names.index(NUMBERS[LAG, "vent"])


def is_of_valves(own: Coordinate) -> bool:
    """Whether a plain coordinate is of a lag or a dead time of commands."""
    return own.name in NUMBERS.values()


@dataclass(frozen=True)
class Start:
    """Where a plain fit may begin: times of valves by their paths, s, and the factor on the file's dampings."""

    times: Mapping[str, float]
    damping: float


def starts_of(arm: Arm, records: Sequence[Record], threads: int | None) -> list[Start]:
    """Lags and dead times that simulations of the logs like best, of a grid of them: the best first, most ``STARTS``.

    Dampings take what a lag leaves. How the two divide an arm's slowness only fits tell: the starts differ in damping.
    """
    valves = coordinates_of(arm.parameters)
    dampings = resolve(arm.parameters, [f"section.{k + 1}.damping" for k in range(arm.section_count)])
    free = (*valves, *dampings)
    model = Model(arm.parameters, free, tuple(records), Integration(threads=threads))
    points, starts = [], []
    for late, lag, factor in product(DELAYS, LAGS, DAMPINGS):
        times = {c.path: late if number_of(c) == "time" else lag for c in valves if c.name != NUMBERS[STAGE, "fill"]}
        values = [times.get(c.path, factor * c.start) for c in free]
        points.append(np.array([c.coordinate(value) for c, value in zip(free, values, strict=True)]))
        starts.append(Start(times, factor))
    found: list[Start] = []
    for trial, start in sorted(zip(trials(model, points, whole=True), starts, strict=True), key=lambda t: t[0].merit):
        if np.isfinite(trial.merit) and all(start.damping != other.damping for other in found):
            found.append(start)
    return found[:STARTS]


def begun(arm: Arm, start: Start) -> Arm:
    """The arm with these times of its valves."""
    return arm.with_parameters(paths.with_values(arm.parameters, start.times))


def at(model: Model, start: Start) -> Array:
    """Coordinates of a plain model at a start, all else as its file has it."""
    x = np.zeros(model.size)
    for k, own in enumerate(model.plain):
        if is_damping(own):
            x[k] = own.coordinate(start.damping * own.start)
        elif own.path in start.times:
            x[k] = own.coordinate(start.times[own.path])
    return x


def without_valves(model: Model) -> Model:
    """The plain model of an arm whose logs hold the pressures that :func:`through` gives."""
    left = [effect for effect in model.parameters.effects if not _stands_for_valves(effect)]
    plain = tuple(c for c in model.plain if not is_of_valves(c))
    return replace(model, parameters=Arm(model.parameters).with_effects(left).parameters, plain=plain)


def through(parameters: ArmParameters, record: Record) -> Record:
    """The record driven by what an arm's lag and dead time make of its commands, at its samples.

    For stretches of a log, which know nothing of the commands before they begin.
    """
    inputs = tuple(range(record.drive.pressures.shape[1]))
    for effect in parameters.effects:
        if _stands_for_valves(effect):
            probe = PressureProbe(effect.kind, inputs, effect.parameters)
            acting = acting_pressures(record, [probe], parameters.ambient_pressure)[0]
            record = replace(record, drive=record.driven_by(acting))
    return record


def found_valves(model: Model, x: Array, draws: Array) -> list[Effect]:
    """What lies between command and chamber as effects with their numbers: those that are clearly there.

    A lag of two stages is said by the times of both together, which are what commands tell: one stage may be longer
    and the other shorter.

    Args:
        model: the model.
        x: its coordinates.
        draws: what the logs leave open of them, shape (draws, size).
    """
    own = {name: key for key, name in NUMBERS.items()}
    times: dict[tuple[str, str], tuple[float, Array, bool]] = {}
    for k, c in enumerate(model.plain):
        if c.name in own:
            value = float(x[k])
            open_ = drawn(c, value, draws[:, k])
            times[own[c.name]] = (c.value(value), open_, c.at_bound(value))
    second = times.pop((STAGE, "fill"), None)
    found = []
    for kind in (LAG, DELAY):
        stages = [{name: time for (of, name), time in times.items() if of == kind}]
        # A short second stage is what is assumed of valves where nothing tells it: no lag of its own.
        if not any(_is_there(_number(*time)) for time in stages[0].values()):
            continue
        if kind == LAG and second is not None and _is_there(_number(*second)):
            stages.append(dict.fromkeys(stages[0], second))
        numbers = [{name: _number(*time) for name, time in stage.items()} for stage in stages]
        whole = numbers[0]
        if len(stages) > 1:
            sums = {name: tuple(stage[name] for stage in stages) for name in stages[0]}
            whole = {name: _number(a[0] + b[0], a[1] + b[1], a[2] and b[2]) for name, (a, b) in sums.items()}
        elements = numbers if len(stages) > 1 else []
        found.append(Effect(kind=kind, where="all", parameters=whole, elements=elements, confidence=1.0, plain=True))
    return found


def drawn(own: Coordinate, value: float, draws: Array) -> Array:
    """A time at each draw of its coordinate, s.

    Where a model's own error leaves more of it open than its prior, logarithms reach to anything that is allowed. What
    logs show is linear in a time that is short against the rest of the way, as of a dead time: there the time is drawn.
    """
    if not own.logarithmic or np.std(draws) <= BEYOND:
        return np.array([own.value(value + float(d)) for d in draws])
    return np.asarray(np.clip(own.value(value) * (1.0 + own.scale * draws), own.lower, own.upper))


def _number(value: float, draws: Array, at_bound: bool) -> Number:
    """A time with the interval that draws of it have, s."""
    low, high = np.quantile(draws, [0.025, 0.975])
    return Number(value=value, unit="s", ci95=(float(low), float(high)), at_bound=at_bound)


def _is_there(number: Number) -> bool:
    """Whether a time is more than none."""
    assert number.ci95 is not None
    return not number.at_bound and number.value > SHORTEST and number.ci95[0] > 0.5 * SHORTEST


def _stands_for_valves(effect: EffectParameters) -> bool:
    return effect.where == "all" and effect.kind in (LAG, DELAY)


def _paths(parameters: ArmParameters) -> list[tuple[str, str, str]]:
    """Path, kind and number of each time that is free."""
    found = []
    if parameters.pneumatics is not None and parameters.pneumatics.level == "lag":
        known = published(parameters.pneumatics.provenance)
        found += [
            (p, LAG, n) for p, n in zip(PATHS, ("fill", "vent"), strict=True) if p.rpartition(".")[2] not in known
        ]
    stages = int(parameters.pneumatics is not None and parameters.pneumatics.level == "lag")
    seen: set[str] = set()
    for k, effect in enumerate(parameters.effects, start=1):
        if not _stands_for_valves(effect):
            continue
        kind = DELAY if effect.kind == DELAY else (LAG, STAGE)[min(stages, 1)]
        stages += kind != DELAY
        if kind in seen:
            continue
        seen.add(kind)
        known = published(effect.provenance)
        found += [
            (f"effect.{k}.{number}", kind, number) for own, number in NUMBERS if own == kind and number not in known
        ]
    return found
