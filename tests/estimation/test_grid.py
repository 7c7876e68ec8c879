"""Where steps of an integrator end: on the rows of a log, and close together where a run begins."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bha.estimation import grid
from bha.estimation.grid import graded, grid_of
from bha.estimation.records import record
from bha.estimation.runs import Run, outputs

from .slow_arm import TRUE, arm_of, log_of


@pytest.mark.parametrize("rows", [np.arange(0.0, 1.0, 0.02), np.array([0.0, 0.013, 0.05, 0.11, 0.2, 0.31])])
def test_a_graded_start_keeps_the_times_of_its_grid(rows: NDArray[np.float64]) -> None:
    even = grid_of(rows, 0.01)
    time, points = graded(even, 0.01)
    assert time[points] == pytest.approx(even.time, abs=1e-12)
    assert np.all(np.diff(time) > 1e-5)
    assert time[1:8] == pytest.approx(0.01 * 2.0 ** np.arange(-6, 1))


def test_a_first_rate_leaves_a_stiff_arm_where_it_should(monkeypatch: pytest.MonkeyPatch) -> None:
    """Damping that outweighs the mass: the rate is gone after 0.1 ms, what it has moved comes back within a second."""
    arm = arm_of(TRUE | {"damping": 400.0})
    rec = record(arm, log_of(arm, 3, duration=6.0))
    length = float(arm.parameters.sections[0].rest_length)
    state = np.array([length, length, length, 4.0, -2.0, 1.0])
    run = Run(arm, rec.observation, rec, state)
    late = rec.time - rec.time[0] > 0.5

    def error(step: float) -> float:
        coarse, fine = (outputs([run], own, "ros2", 1)[0][late] for own in (step, 1e-4))
        return float(np.sqrt(np.mean((coarse - fine) ** 2)))

    with_parts = error(5e-3)
    monkeypatch.setattr(grid, "_PARTS", np.array([1.0]))
    assert with_parts < 5e-4
    assert error(5e-3) > 10.0 * with_parts
