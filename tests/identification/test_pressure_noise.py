"""What noise of the measured pressures moved an estimate by, and what may not move with it."""

from __future__ import annotations

import numpy as np
import pytest

from bha.estimation.engine import Model
from bha.estimation.free import FreeParameter, resolve
from bha.estimation.pressure_noise import Corrected, corrected
from bha.estimation.problem import Point, Problem, Residuals
from bha.estimation.records import record, windows
from bha.estimation.solver import solve

from .identify_logs import measured, multisine, one_section


@pytest.fixture(scope="module")
def shift() -> tuple[Problem, Point, Corrected]:
    """The problem, its minimum, and the correction, of an arm whose mass cannot hang as high as noise says."""
    arm = one_section()
    rec = record(arm, measured(arm, multisine(arm, 4.0, 100.0, 1), seed=1)).with_pressure_noise(np.full(3, 500.0))
    free = [
        *(FreeParameter(f"section.1.{name}") for name in ("mass", "stiffness.1", "bending_stiffness.1", "damping")),
        # The mass hangs in the head, the highest place allowed; noise of pressures says higher.
        FreeParameter("section.1.center_of_mass.z", lower=-0.05, upper=0.0, prior=(0.0, 0.02)),
    ]
    coordinates = resolve(arm.parameters, free)
    model = Model(arm.parameters, coordinates, (rec,))
    pieces = windows(model.records, 2.0)
    prior = tuple(np.array(values) for values in zip(*(c.prior for c in coordinates), strict=True))
    zero = np.zeros(len(coordinates))
    problem = Problem(model, tuple(pieces), Residuals((rec.noise,)), model.guesses(zero, pieces), prior)  # type: ignore[arg-type]
    point = solve(problem, Point(zero, problem.guesses)).point
    return problem, point, corrected(problem, point, problem.normal(point, keep=True))


def test_a_correction_stays_within_the_bounds(shift: tuple[Problem, Point, Corrected]) -> None:
    problem, point, better = shift
    bounds = np.array([c.bounds for c in problem.model.coordinates])
    moved = point.z + better.step
    assert np.all(moved >= bounds[:, 0] - 1e-9)
    assert np.all(moved <= bounds[:, 1] + 1e-9)
    # A step that is cut off at a bound afterwards costs hundreds here.
    loss = problem.evaluated(moved, point.states + better.state_steps).cost
    assert loss - point.cost < 20.0
