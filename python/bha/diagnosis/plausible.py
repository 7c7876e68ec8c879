"""The plain model with its numbers kept plausible: where to look once more if its best fit is none of this arm.

A ringing arm of which one bellows has gone soft swings at other frequencies than the plain model can; the least error
without them has a damping of thousands of times the file's. About such a fit all that rings looks alike, and scores
tell nothing. With the numbers that went astray held where the file has them, the plain model errs more, and by what it
lacks.
Source: docs/decisions/0028.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bha.diagnosis.fit import evaluate, improve, weighted, with_sensitivities
from bha.diagnosis.given import Given
from bha.diagnosis.model import of_sensors
from bha.diagnosis.refit import Trial
from bha.diagnosis.valves import is_of_valves
from bha.errors import ConvergenceError
from bha.estimation.free import Coordinate

#: Factor on the file's value beyond which a number is not one of this arm; those that were guessed are within three.
ASTRAY = 10.0
#: Deviations within which it is then held, as a share of its prior's.
HELD = 1e-2
_ITERATIONS, _RENEWALS = 20, 7


def plausible(given: Given, plain: Trial) -> Trial | None:
    """The plain model fitted with the numbers that went astray held as filed; None where none did.

    Its priors are those of ``plain`` again: what is added to it may move all of them.
    """
    problem, fit = given.problem, plain.fit
    coordinates = list(fit.model.plain)
    astray = [k for k, (c, x) in enumerate(zip(coordinates, fit.x, strict=True)) if _is_astray(c, float(x))]
    if not astray:
        return None
    x = fit.x.copy()
    for k in astray:
        coordinates[k] = replace(coordinates[k], prior_deviation=HELD * coordinates[k].prior_deviation)
        x[k] = 0.0
    held = replace(fit.model, plain=tuple(coordinates))
    start = evaluate(problem, held, x, fit.states)
    if not np.isfinite(start.cost):
        return None
    try:
        ended = improve(problem, with_sensitivities(problem, start), iterations=_ITERATIONS, renewals=_RENEWALS)
    except ConvergenceError:
        return None
    return Trial((), weighted(problem, with_sensitivities(problem, replace(ended, model=fit.model))), plain.holdout)


def _is_astray(coordinate: Coordinate, x: float) -> bool:
    own = not of_sensors(coordinate) and not is_of_valves(coordinate)
    return own and coordinate.logarithmic and abs(coordinate.scale * x) > math.log(ASTRAY)
