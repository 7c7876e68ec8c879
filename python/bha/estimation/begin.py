"""Where a joint fit begins: at the file's own values where they explain the logs, else where statics and a search say.

The statics (:mod:`bha.estimation.statics`) need no simulation and lead from any guess to where the arm stands; the
search over dampings and lags (:mod:`bha.estimation.dynamics`) then finds the valley. Both are tried by simulation
against the file's own values, and the best start wins. Priors stay those of the file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.estimation.apart import Rates, apart, lags_of, mean_pressures, rates, with_bending_damping
from bha.estimation.asked import (
    Asked,
    material_that_creeps,
    memory_that_slips,
    slip_factors,
    stands_elsewhere,
    unlike_chambers,
)
from bha.estimation.backbone import with_axial_stiffness, without_bending_stiffness
from bha.estimation.dynamics import LITTLE, Trial, seen_times, trials, valleys
from bha.estimation.engine import Model
from bha.estimation.free import Coordinate, FreeParameter, resolve
from bha.estimation.lags import PATHS, delayed
from bha.estimation.preload import preloads_of
from bha.estimation.records import Record
from bha.estimation.runs import Integration
from bha.estimation.statics import Statics, fit_statics, left_out, refit_statics
from bha.parameters import paths

Array = NDArray[np.float64]
Tell = Callable[[str, float], None]

#: Sorts of channels that show an arm's motion across its base's axis, or all of it.
_ACROSS = ("across", "length")
#: What an axial stiffness must gain of the merit of simulations, for each channel, to be kept, and the merit of one
#: that leaves no more than the noise.
_GAIN, _AT_NOISE = 0.05, 0.5 * math.log(2.0)
#: How many of the best points are simulated over whole logs where these must be better.
_BEST = 4
#: How many of the best points are tried with dead times of commands.
_LATE = 3
#: Part by which areas change over half of the range of lengths from which on forces must be those of their work.
_AREAS = 0.25
#: An arm that lags longer than this, s, is pushed through its poses rather than swings.
_SLOW = 0.1
#: What held poses leave lasts, of a material that creeps, longer than this, s: half a window of the joint fit. From
#: there on first states of windows would make up for it.
_LASTS = 3.0


@dataclass(frozen=True)
class Begin:
    """Where a joint fit begins.

    Attributes:
        arm: the arm whose parameters these are: the file's, or one with a damping of bending apart.
        free: the free parameters with their starts.
        statics: what held poses tell; None where the file's values were good enough not to look.
        trial: the start, as a simulation judges it.
        others: the other points that were tried, the best first.
        from_file: whether the file's own values are the start.
        said: what was made free beyond the defaults because the logs ask for it, in words.
    """

    arm: Arm
    free: tuple[FreeParameter, ...]
    statics: Statics | None
    trial: Trial
    others: tuple[Trial, ...]
    from_file: bool
    said: tuple[str, ...] = ()

    @property
    def skips_short_windows(self) -> bool:
        """Whether windows shorter than a few lags would only unlearn what the statics have told of a slow arm."""
        return self.statics is not None and not self.from_file and self.statics.lag(*_ACROSS) > _SLOW

    @property
    def creeps(self) -> bool:
        """Whether the material creeps: what holds the arm differs from log to log, or a slow arm errs for seconds."""
        if preloads_of(self.arm.parameters) is not None:
            return True
        return self.skips_short_windows and self.statics is not None and self.statics.lasts > _LASTS


def begin(
    arm: Arm,
    records: Sequence[Record],
    free: Iterable[FreeParameter | str],
    *,
    whole: bool,
    splits: bool = False,
    enough: float = LITTLE,
    known: Begin | None = None,
    threads: int | None = None,
    tell: Tell | None = None,
) -> Begin:
    """Find where to begin.

    Args:
        arm: the file's arm.
        records: what is to be fitted.
        free: what is to be estimated.
        whole: whether simulations must run over whole logs, because pressures have a memory.
        splits: whether damping of bending may become a parameter of its own (:mod:`bha.estimation.apart`).
        enough: part of each channel's motion, beyond noise, that the file's own values may leave to be the start.
        known: what the same came to with nothing that is enough, where it has been found already.
        threads: of the simulations.
        tell: called with what is being done and the fraction done.

    Raises:
        ParameterError: a path the arm does not have.
        InputError: something that does not fit together.
    """
    tell = tell or (lambda _text, _fraction: None)
    free = tuple(free)
    coordinates = resolve(arm.parameters, free)
    model = Model(arm.parameters, coordinates, tuple(records), Integration(threads=threads))
    file = np.zeros(len(coordinates))
    tell("the file's own values", 0.0)
    own = trials(model, [file], whole=whole)[0]
    if own.share < enough:
        return Begin(arm, _started(coordinates, file), None, own, (), True)
    if known is not None:
        return known
    tell("held poses", 0.1)
    found = _searched(arm, free, model, whole=whole, splits=splits)
    if splits and found.statics is not None and stands_elsewhere(records):
        tell("what holds the arm where logs begin", 0.5)
        held, said = _with_memory(found, model, whole=whole)
        if said:
            return _begun(held, held.tried[0], said)
    channels = sum(len(rec.channels) for rec in records)
    lacks = found.tried[0].merit > (_AT_NOISE + _GAIN) * channels
    if splits and lacks and (sections := _without_bending_stiffness(arm, found)):
        tell("held poses with an axial stiffness", 0.5)
        parameters, others = with_axial_stiffness(arm.parameters, free, sections)
        other = replace(model, parameters=parameters, plain=resolve(parameters, others))
        held = _searched(Arm(parameters), others, other, whole=whole, splits=splits)
        if held.tried[0].merit < found.tried[0].merit - _GAIN * channels:
            found = held
    said = []
    if splits and found.statics is not None and found.tried[0].merit > (_AT_NOISE + _GAIN) * channels:
        tell("what else the logs ask for", 0.8)
        found, said = _with_what_is_asked(found, model, whole=whole)
    return _begun(found, found.tried[0] if np.isfinite(found.tried[0].merit) else own, said)


@dataclass(frozen=True)
class _Found:
    """What a search came to: the arm, its free parameters and statics, and the points tried, the best first."""

    arm: Arm
    free: tuple[FreeParameter | str, ...]
    coordinates: tuple[Coordinate, ...]
    statics: Statics | None
    tried: tuple[Trial, ...]


def _begun(found: _Found, best: Trial, said: Sequence[str]) -> Begin:
    """The start at a point of what a search came to."""
    started = _started(found.coordinates, best.z)
    return Begin(found.arm, started, found.statics, best, found.tried[1:], not np.any(best.z), tuple(said))


def _without_bending_stiffness(arm: Arm, found: _Found) -> tuple[int, ...]:
    return () if found.statics is None else without_bending_stiffness(arm.parameters, found.statics)


def _searched(arm: Arm, free: Sequence[FreeParameter | str], model: Model, *, whole: bool, splits: bool) -> _Found:
    """Statics, then dampings and lags, from an arm's values."""
    records, coordinates = model.records, model.coordinates
    statics = fit_statics(arm.parameters, coordinates, records)
    if statics is not None and splits:
        parameters, more = with_bending_damping(arm.parameters, apart(arm.parameters, statics))
        free = (*free, *more)
        arm, coordinates = Arm(parameters), resolve(parameters, free)
        model = replace(model, parameters=parameters, plain=coordinates)
    file = np.zeros(len(coordinates))
    points = [file, *valleys(coordinates, model, file, None)]
    if statics is not None:
        for fit in (statics, *statics.rivals):
            z = _with_values(coordinates, file, fit)
            if fit is statics:
                points += valleys(coordinates, model, z, fit.lag(*_ACROSS) if _lagging(coordinates) else None)
            points += seen_times(coordinates, model, z, partial(_times, fit, mean_pressures(records)))
    tried = sorted(trials(model, points, whole=whole), key=lambda trial: trial.merit)
    if late := [point for trial in tried[:_LATE] for point in delayed(coordinates, trial.z)]:
        tried = sorted([*tried, *trials(model, late, whole=whole)], key=lambda trial: trial.merit)
    return _Found(arm, tuple(free), coordinates, statics, tuple(tried))


def _with_what_is_asked(found: _Found, model: Model, *, whole: bool) -> tuple[_Found, list[str]]:
    """The same, or with more free, and what that is."""
    records, said = model.records, []
    channels = sum(len(rec.channels) for rec in records)
    # A second look with nothing more is what more freedom is held against.
    again = _asked(found, Asked(found.arm.parameters, found.free, "", True), model, whole=whole)
    found = again if again is not None and again.tried[0].merit < found.tried[0].merit else found
    for ask in (material_that_creeps, memory_that_slips, unlike_chambers):
        if not _fits(ask, held=preloads_of(found.arm.parameters) is not None):
            continue
        asked = ask(found.arm.parameters, found.free)
        # How an arm begins otherwise from log to log is told by no single one: there it is a rest length.
        if asked is not None and asked.begins and len(records) < 2:
            continue
        more = None if asked is None else _step_by_step(found, asked, model, whole=whole)
        if asked is None or more is None or more.statics is None or found.statics is None:
            continue
        if asked.begins:
            before, after = (_over_whole_logs(one, model)[0].merit for one in (found, more))
            better = after < before - _GAIN * channels
        else:
            better = more.tried[0].merit < found.tried[0].merit - _GAIN * channels
        if asked.static:
            better &= more.statics.merit < found.statics.merit - _GAIN * found.statics.channels
        if better and asked.carries and len(records) > 1:
            before, after = (_left_out(one, records) for one in (found, more))
            better = after < before - _GAIN * found.statics.channels
        if better:
            found = _conjugate(more, model) if asked.begins else more
            said.append(asked.said)
    return found, said


def _left_out(found: _Found, records: Sequence[Record]) -> float:
    """What fits to the other records leave of each record's held poses."""
    assert found.statics is not None
    z = _with_values(found.coordinates, found.tried[0].z, found.statics)
    return left_out(found.arm.parameters, found.coordinates, records, z, found.statics.lags)


def _with_memory(found: _Found, model: Model, *, whole: bool) -> tuple[_Found, list[str]]:
    """The same for an arm that stands elsewhere after each use, and what that is; as it is where nothing comes of it.

    It is not asked what is gained: no law from pressures to poses has what such logs show, and one that has learnt
    them is wrong of all others. Whether what held the arm gives way as it moves on is told by whole logs.
    """
    said: list[str] = []
    least = np.inf
    for ask in (material_that_creeps, memory_that_slips):
        asked = ask(found.arm.parameters, found.free)
        more = None if asked is None else _step_by_step(found, asked, model, whole=whole)
        if asked is None or more is None or not np.isfinite(more.tried[0].merit):
            continue
        more = _conjugate(more, model)
        left = _over_whole_logs(more, model)[0].merit
        if left > least:
            continue
        found, least = more, left
        said.append(asked.said)
    return found, said


def _conjugate(found: _Found, model: Model) -> _Found:
    """The same with forces that are what pressures do in work, where areas change by a part worth it.

    Along the ends' axes pressures on areas that change with length make energy from nothing, and such an arm runs off
    at pressures beyond the fitted ones.
    """
    best = _started(found.coordinates, found.tried[0].z)
    slopes = [abs(f.start or 0.0) for f in best if f.path.endswith(".by_length")]
    spans = [0.5 * (s.length_range[1] - s.length_range[0]) for s in found.arm.parameters.sections]
    if max(slopes, default=0.0) * max(spans) < _AREAS:
        return found
    parameters = found.arm.parameters.updated({"force_model": "work_conjugate"})
    other = replace(found, arm=Arm(parameters))
    tried = _over_whole_logs(other, model)
    return replace(other, tried=tuple(tried)) if np.isfinite(tried[0].merit) else found


def _over_whole_logs(found: _Found, model: Model) -> list[Trial]:
    """Its best points, simulated over whole logs, the best first."""
    model = replace(model, parameters=found.arm.parameters, plain=found.coordinates)
    points = [trial.z for trial in found.tried[:_BEST]]
    return sorted(trials(model, points, whole=True), key=lambda trial: trial.merit)


def _fits(ask: Callable[..., Asked | None], *, held: bool) -> bool:
    """Whether something is asked of an arm that is, or is not, held beside its springs.

    One that stands elsewhere after each use is of a material that creeps: its areas give way, and what its chambers
    differ by does not carry over to other motions (docs/decisions/0012).
    """
    return not held or ask is not unlike_chambers


def _step_by_step(found: _Found, asked: Asked, model: Model, *, whole: bool) -> _Found | None:
    """As :func:`_asked`; where logs begin elsewhere than before, what was free already is found anew first."""
    if asked.begins:
        known = {coordinate.path for coordinate in found.coordinates}
        free = tuple(f for f in asked.free if (f if isinstance(f, str) else f.path) in known)
        found = _asked(found, replace(asked, free=free), model, whole=whole) or found
    return _asked(found, asked, model, whole=whole)


def _asked(found: _Found, asked: Asked, model: Model, *, whole: bool) -> _Found | None:
    """The best point with more free, from the best one without; None where it holds no poses."""
    assert found.statics is not None
    coordinates = resolve(asked.parameters, asked.free)
    model = replace(model, parameters=asked.parameters, plain=coordinates)
    before = {c.name: c.value(float(x)) for c, x in zip(found.coordinates, found.tried[0].z, strict=True)}
    z = np.array([c.coordinate(before.get(c.name, c.start) * _rescaled(c, coordinates, found)) for c in coordinates])
    statics = refit_statics(asked.parameters, coordinates, model.records, z, found.statics.lags)
    if statics is None:
        return None
    z = _with_values(coordinates, z, statics)
    # Where the scale of stiffnesses has moved, that of dampings has to.
    seen = seen_times(coordinates, model, z, partial(_times, statics, mean_pressures(model.records)))
    points = [z, *seen, *delayed(coordinates, z), *slip_factors(coordinates, z)]
    tried = sorted(trials(model, points, whole=whole), key=lambda trial: trial.merit)
    return _Found(Arm(asked.parameters), asked.free, coordinates, statics, tuple(tried))


def _rescaled(coordinate: Coordinate, coordinates: Sequence[Coordinate], found: _Found) -> float:
    """What a stiffness or a damping is multiplied by where the area of its section is no longer free."""
    steps = coordinate.path.split(".")
    if steps[0] != "section" or not paths.key_of(coordinate.path).endswith(("stiffness", "damping")):
        return 1.0
    name = f"section.{steps[1]}.terminal_area"
    if any(c.name == name for c in coordinates):
        return 1.0
    before = [
        c.start / c.value(float(x)) for c, x in zip(found.coordinates, found.tried[0].z, strict=True) if c.name == name
    ]
    return before[0] if before else 1.0


def _with_values(coordinates: Sequence[Coordinate], z: Array, statics: Statics) -> Array:
    """The point with what statics tell put in."""
    values, point = statics.values, z.copy()
    for place, coordinate in enumerate(coordinates):
        if coordinate.name in values:
            point[place] = coordinate.coordinate(values[coordinate.name])
    return point


def _times(statics: Statics, pressures: Array, arm: Arm, section: int) -> tuple[Rates, float, float] | None:
    """Rates of a section under these pressures and the lags that its head showed."""
    own, lags = rates(arm, pressures, section), lags_of(statics, section)
    return None if own is None or lags is None else (own, *lags)


def _lagging(coordinates: Sequence[Coordinate]) -> bool:
    return any(coordinate.path in PATHS for coordinate in coordinates)


def _started(coordinates: Sequence[Coordinate], z: Array) -> tuple[FreeParameter, ...]:
    """Free parameters that start at ``z`` and keep their bounds and priors."""
    return tuple(
        replace(
            FreeParameter(c.path, c.sessions),
            # At a bound a logarithm may round to beyond it.
            start=min(max(c.value(float(entry)), c.lower), c.upper),
            lower=c.lower,
            upper=c.upper,
            prior=(c.prior_mean, c.prior_deviation),
            logarithmic=c.logarithmic,
            scale=c.scale,
        )
        for c, entry in zip(coordinates, z, strict=True)
    )
