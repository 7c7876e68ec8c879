"""Dynamics after statics: damping, and the lag of commanded pressures, searched over their valleys.

The loss of a simulation has several valleys in damping: at much too little an arm swings that in truth creeps, at much
too much it hardly moves. Each is a minimum of its own or a slope that leads nowhere. The dampings are therefore tried
over decades of the time that they give an arm, damping over stiffness; under commands each with several shares that the
pressures' lag takes of the lag that the statics saw. One batch of simulations over some windows judges them all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import BhaError
from bha.estimation.apart import Rates
from bha.estimation.engine import Model
from bha.estimation.free import Coordinate
from bha.estimation.integration import by
from bha.estimation.lags import PATHS
from bha.estimation.records import Window, some_of, windows
from bha.parameters import paths

Array = NDArray[np.float64]

#: Times damping over stiffness that are tried, s, and shares of the lag seen that pressures take.
RELAXATIONS = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0)
SHARES = (0.05, 0.35, 0.65, 0.95)
#: Dampings of a section, and the stiffness that each belongs to.
_HOLDS = {"damping": "stiffness", "axial_damping": "axial_stiffness"}
#: Length of the windows, s, and of all of them together.
_WINDOW, _BUDGET = 6.0, 36.0
#: Rows this far apart are enough, s, and the step of the integrator.
_INTERVAL, _STEP = 0.05, 0.01
#: What a point leaves of a channel within so many noises is nothing; this part of its motion is little.
_NOISES, LITTLE = 3.0, 0.05


@dataclass(frozen=True)
class Trial:
    """A point that was tried.

    Attributes:
        z: coordinates of all free parameters, shape (p,).
        merit: sum over channels of the logarithm of what a simulation leaves, in noises; infinite where it fails.
        spread: the root mean square over channels of what it leaves, m.
        share: the greatest part of a channel's motion that it leaves, beyond a few noises; infinite where it fails.
    """

    z: Array
    merit: float
    spread: float
    share: float


def trials(model: Model, starts: Sequence[Array], *, whole: bool) -> list[Trial]:
    """Judge points by simulation over some windows, or over whole logs; in their order."""
    thin = replace(model, records=tuple(rec.thinned(_INTERVAL) for rec in model.records))
    thin = by(thin, method="ros2", step=_STEP)
    pieces = windows(thin.records, None if whole else _WINDOW)
    pieces = pieces if whole else some_of(pieces, thin.records, _BUDGET)
    states = [_states(thin, z, pieces) for z in starts]
    possible = [(z, own) for z, own in zip(starts, states, strict=True) if own is not None]
    shown = iter(thin.predict_each(possible, pieces))
    return [
        _judged(thin, z, pieces, None if own is None else next(shown)) for z, own in zip(starts, states, strict=True)
    ]


def valleys(coordinates: Sequence[Coordinate], model: Model, z: Array, lag: float | None) -> list[Array]:
    """Points like ``z`` with dampings over decades and, where ``lag`` (s) is given, shares of it for the pressures.

    Points at which nothing free changes are not repeated.
    """
    made: list[Array] = []
    lagging = [k for k, c in enumerate(coordinates) if c.path in PATHS]
    shares = SHARES if lagging and lag is not None else (None,)
    for relaxation in RELAXATIONS:
        for share in shares:
            point = z.copy()
            for k, coordinate in enumerate(coordinates):
                if _is_damping(coordinate):
                    point[k] = _damped(coordinate, coordinates, model, z, relaxation)
                elif k in lagging and share is not None and lag is not None:
                    point[k] = coordinate.coordinate(max(share * lag, coordinate.lower))
            point = _within(coordinates, point)
            if not any(np.array_equal(point, other) for other in made):
                made.append(point)
    return made


def seen_times(
    coordinates: Sequence[Coordinate],
    model: Model,
    z: Array,
    times: Callable[[Arm, int], tuple[Rates, float, float] | None],
    shares: Sequence[float] = SHARES,
) -> list[Array]:
    """Points like ``z`` whose dampings give the times that held poses saw, for each share of the pressures' lag.

    ``times`` says of an arm and a section its rates and the lags across and along, s.
    """
    lagging = [k for k, c in enumerate(coordinates) if c.path in PATHS]
    made = []
    for share in shares if lagging else (0.0,):
        point = z.copy()
        arm = model.arm(z, model.records[0].condition)
        for section in range(1, arm.section_count + 1):
            seen = times(arm, section)
            if seen is None:
                continue
            own, across, along = seen
            lag = share * min(across, along)
            axial = arm.parameters.sections[section - 1].axial_stiffness is not None
            damping, bending, stretching = own.dampings(across - lag, along - lag, axial=axial)
            bends = [
                k for k, effect in enumerate(arm.parameters.effects, start=1) if effect.where == f"section {section}"
            ]
            values = {f"section.{section}.damping": damping, f"section.{section}.axial_damping": stretching}
            values |= {f"effect.{k}.damping": bending for k in bends}
            values |= dict.fromkeys(PATHS, lag) if lagging else {}
            for k, coordinate in enumerate(coordinates):
                if coordinate.path in values:
                    point[k] = coordinate.coordinate(max(values[coordinate.path], coordinate.lower))
        made.append(_within(coordinates, point))
    return made


def _is_damping(coordinate: Coordinate) -> bool:
    """Whether it is a damping of bellows, or of the mean length."""
    return paths.key_of(coordinate.members[0]) in _HOLDS and coordinate.members[0].startswith("section.")


def _damped(
    coordinate: Coordinate, coordinates: Sequence[Coordinate], model: Model, z: Array, relaxation: float
) -> float:
    """The coordinate at which a section's damping is its stiffness times a time."""
    step, key = coordinate.members[0].split(".")[1], paths.key_of(coordinate.members[0])
    section, holds = model.parameters.sections[int(step) - 1], _HOLDS[key]
    own = [c for c in coordinates if c.path == f"section.{step}.{holds}.1"]
    stated = (getattr(section, holds) or (0.0,))[0]
    stiffness = own[0].value(float(z[list(coordinates).index(own[0])])) if own else stated
    damping = max(stiffness, 1e-9) * relaxation
    group = paths.is_group(coordinate.path)
    return coordinate.coordinate(damping / max(getattr(section, key), 1e-12) if group else damping)


def _within(coordinates: Sequence[Coordinate], point: Array) -> Array:
    low, high = np.array([c.bounds for c in coordinates]).T
    return np.asarray(np.clip(point, low, high))


def _states(model: Model, z: Array, pieces: Sequence[Window]) -> Array | None:
    """Initial states of the windows as they were measured, shape (windows, 6n); None where no arm has such values."""
    try:
        return model.guesses(z, pieces)
    except BhaError:
        return None


def _judged(model: Model, z: Array, pieces: Sequence[Window], shown: Sequence[Array] | None) -> Trial:
    """What a simulation leaves."""
    failed = Trial(z, math.inf, math.inf, math.inf)
    if shown is None or not all(np.all(np.isfinite(table)) for table in shown):
        return failed
    merit, squares, share = 0.0, [], 0.0
    for number, rec in enumerate(model.records):
        own = [(w, table) for w, table in zip(pieces, shown, strict=True) if w.record == number]
        if not own:
            continue
        measured, usable = (np.concatenate([x[w.first : w.last] for w, _ in own]) for x in (rec.measured, rec.usable))
        errors = np.where(usable, measured - np.concatenate([table for _, table in own]), np.nan)
        motion = np.where(usable, measured, np.nan)
        for c in np.flatnonzero(usable.any(axis=0)):
            left, noise = float(np.nanmean(errors[:, c] ** 2)), float(rec.noise[c])
            squares.append(left)
            merit += 0.5 * math.log(1.0 + left / noise**2)
            if (beyond := left - (_NOISES * noise) ** 2) > 0.0:
                share = max(share, math.sqrt(beyond) / max(float(np.nanstd(motion[:, c])), 1e-9))
    return Trial(z, merit, float(np.sqrt(np.mean(squares))), share) if squares else failed
