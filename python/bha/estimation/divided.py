"""What is slow under commands, divided otherwise between the pressures and the arm, once a fit has ended.

An overdamped arm answers its commands through two lags in a row, that of its pressures and its own, alike if the two
change places (:mod:`bha.estimation.lags`). Each division is a valley of its own, and a search over windows may begin in
the wrong one: there the fit crawls, and numbers that have nothing to do with it (rest length, bending stiffness) make
up for what is left. From its end the other valley is a short way: the same common times, the other lag the longer one.
Source: docs/decisions/0017, 0027. Limits: one lag for all inputs; arms of which held poses have a stiffness.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError
from bha.estimation.apart import Rates, mean_pressures, rates
from bha.estimation.dynamics import SHARES, seen_times
from bha.estimation.lags import APART, PATHS, common_times
from bha.estimation.problem import Point, Problem
from bha.estimation.scales import fit_with_scales
from bha.estimation.solver import Outcome
from bha.estimation.stages import TOLERANCE

Array = NDArray[np.float64]

#: Steps in which the other valley has to become the lower one.
_STEPS = 12


def otherwise_divided(
    problem: Problem, end: Point, *, max_iterations: int, progress: Callable[[int, float], None] | None = None
) -> Outcome | None:
    """The fit of the other valley of lag and damping, where it ends lower; None where there is none, or it does not.

    Args:
        problem: of the last stage, with the scales of what its fit leaves.
        end: where that ended.
        max_iterations: most steps.
        progress: called with the number of steps and the loss.
    """
    z = other_division(problem, end.z)
    if z is None:
        return None
    try:
        found = fit_with_scales(
            problem,
            Point(z, end.states),
            max_iterations=min(_STEPS, max_iterations),
            tolerance=1e-3,
            progress=progress,
        )
        here, there = (problem.evaluated(p.z, p.states).cost for p in (end, found.point))
        if not there < here:
            return None
        return fit_with_scales(
            problem, found.point, max_iterations=max_iterations, tolerance=TOLERANCE, damping=1e-7, progress=progress
        )
    except ConvergenceError:
        return None


def other_division(problem: Problem, z: Array) -> Array | None:
    """The point with the lag of the pressures the longer one where it is the shorter, or the other way round.

    None where no lag is free, no pose tells an arm's own time, or the lag is told (:data:`bha.estimation.lags.APART`).
    """
    model = problem.model
    if not any(coordinate.path in PATHS for coordinate in model.coordinates):
        return None
    pressures = mean_pressures(model.records)
    arm = model.arm(z, model.records[0].condition)
    times = {time.section: time for time in common_times(arm, pressures)}
    if not times:
        return None
    lag = next(iter(times.values())).lag
    together = min(min(time.across, time.along) for time in times.values())
    longest = max(max(time.across, time.along) for time in times.values()) - lag
    if lag > APART * longest:
        return None

    def seen(own: Arm, section: int) -> tuple[Rates, float, float] | None:
        found = rates(own, pressures, section)
        return None if found is None or section not in times else (found, times[section].across, times[section].along)

    share = max(SHARES) if lag < 0.5 * together else min(SHARES)
    return seen_times(model.coordinates, model, z, seen, (share,))[0]
