"""Where a joint fit begins: at the file's own values where they explain the logs, else where statics and a search say.

The statics (:mod:`bha.estimation.statics`) need no simulation and lead from any guess to where the arm stands; the
search over dampings and lags (:mod:`bha.estimation.dynamics`) then finds the valley. Both are tried by simulation
against the file's own values, and the best start wins. Priors stay those of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.estimation.apart import Rates, apart, lags_of, mean_pressures, rates, with_bending_damping
from bha.estimation.dynamics import Trial, seen_times, trials, valleys
from bha.estimation.engine import Model
from bha.estimation.free import Coordinate, FreeParameter, resolve
from bha.estimation.lags import PATHS
from bha.estimation.records import Record
from bha.estimation.statics import Statics, fit_statics

Array = NDArray[np.float64]
Tell = Callable[[str, float], None]

#: Sorts of channels that show an arm's motion across its base's axis, or all of it.
_ACROSS = ("across", "length")
#: An arm that lags longer than this, s, creeps rather than swings.
_SLOW = 0.1


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
    """

    arm: Arm
    free: tuple[FreeParameter, ...]
    statics: Statics | None
    trial: Trial
    others: tuple[Trial, ...]
    from_file: bool

    @property
    def skips_short_windows(self) -> bool:
        """Whether windows shorter than a few lags would only unlearn what the statics have told of a slow arm."""
        return self.statics is not None and not self.from_file and self.statics.lag(*_ACROSS) > _SLOW


def begin(
    arm: Arm,
    records: Sequence[Record],
    free: Iterable[FreeParameter | str],
    *,
    whole: bool,
    splits: bool = False,
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
        threads: of the simulations.
        tell: called with what is being done and the fraction done.

    Raises:
        ParameterError: a path the arm does not have.
        InputError: something that does not fit together.
    """
    tell = tell or (lambda _text, _fraction: None)
    free = tuple(free)
    coordinates = resolve(arm.parameters, free)
    model = Model(arm.parameters, coordinates, tuple(records), threads=threads)
    file = np.zeros(len(coordinates))
    tell("the file's own values", 0.0)
    own = trials(model, [file], whole=whole)[0]
    if own.explains:
        return Begin(arm, _started(coordinates, file), None, own, (), True)
    tell("held poses", 0.1)
    statics = fit_statics(arm.parameters, coordinates, records)
    if statics is not None and splits:
        parameters, more = with_bending_damping(arm.parameters, apart(arm.parameters, statics))
        arm, free = Arm(parameters), (*free, *more)
        coordinates = resolve(parameters, free)
        model, file = replace(model, parameters=parameters, coordinates=coordinates), np.zeros(len(coordinates))
    points = [file, *valleys(coordinates, model, file, None)]
    if statics is not None:
        z = file.copy()
        for place, coordinate in enumerate(coordinates):
            if coordinate.name in statics.values:
                z[place] = coordinate.coordinate(statics.values[coordinate.name])
        points += valleys(coordinates, model, z, statics.lag(*_ACROSS) if _lagging(coordinates) else None)
        points += seen_times(coordinates, model, z, partial(_times, statics, mean_pressures(records)))
    tell("dampings and lags", 0.7)
    tried = sorted(trials(model, points, whole=whole), key=lambda trial: trial.merit)
    best = tried[0] if np.isfinite(tried[0].merit) else own
    return Begin(
        arm, _started(coordinates, best.z), statics, best, tuple(tried[1:]), bool(np.array_equal(best.z, file))
    )


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
            start=c.value(float(entry)),
            lower=c.lower,
            upper=c.upper,
            prior=(c.prior_mean, c.prior_deviation),
            logarithmic=c.logarithmic,
            scale=c.scale,
        )
        for c, entry in zip(coordinates, z, strict=True)
    )
