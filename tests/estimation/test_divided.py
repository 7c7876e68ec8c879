"""Lag and damping under commands: what is slow divided otherwise, and the lower of the two valleys taken."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bha.estimation.apart import mean_pressures
from bha.estimation.divided import other_division, otherwise_divided
from bha.estimation.free import FreeParameter
from bha.estimation.lags import APART, common_times
from bha.estimation.problem import Point
from bha.estimation.records import record
from bha.estimation.refinement import refine
from bha.estimation.settings import Settings

from .slow_arm import LAG, TRUE, arm_of, log_of

LAGS = ("pneumatics.fill_time", "pneumatics.vent_time")
FREE = ("section.1.damping", "section.1.stiffness.1", *LAGS, "effect.1.damping")


def test_what_is_slow_is_divided_otherwise_and_the_lower_valley_is_taken() -> None:
    arm = arm_of(TRUE, apart=True, lag=LAG)
    seen = record(arm, log_of(arm, 1, commanded=True), pressures="commanded")
    free = [FreeParameter(path, prior=(1.0, math.inf), logarithmic=True) for path in FREE]
    fit = refine(arm, [seen], free, Settings(windows=(None,), draws=0, max_iterations=10, threads=1))
    problem, end = fit.problem, fit.outcome.point
    pressures = mean_pressures([seen])
    (before,) = common_times(fit.arm, pressures)
    assert before.lag > APART * (before.along - before.lag)
    assert before.lag == pytest.approx(LAG, rel=0.03)
    # The lag is told: nothing is to be divided otherwise.
    assert other_division(problem, end.z) is None
    # Nearly all taken for damping: together they are as long, and the lag is the longer one again.
    lag, own = 0.02, before.along - before.lag
    slow = (before.along - lag) / own
    changes = {"section.1.damping": slow, "effect.1.damping": (before.across - lag) / (before.across - before.lag)}
    changes |= dict.fromkeys(LAGS, lag / before.lag)
    z = end.z + np.log([changes.get(path, 1.0) for path in FREE])
    divided = other_division(problem, z)
    assert divided is not None
    (after,) = common_times(problem.model.arm(divided), pressures)
    assert (after.across, after.along) == pytest.approx((before.across, before.along), rel=0.05)
    assert after.lag > 0.9 * after.along
    found = otherwise_divided(problem, Point(z, end.states), max_iterations=12)
    assert found is not None
    assert problem.evaluated(found.point.z, found.point.states).cost < end.cost * 1.001
    (there,) = common_times(problem.model.arm(found.point.z), pressures)
    assert there.lag == pytest.approx(LAG, rel=0.03)
