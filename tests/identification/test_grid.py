"""A window simulated on a grid of steps agrees with the simulation of its rows."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.estimation.engine import Model
from bha.estimation.grid import averaged, grid_of
from bha.estimation.records import Window
from bha.estimation.runs import Integration
from bha.identification import record

from .identify_logs import measured, multisine, one_section


def test_polynomials_of_degree_five_are_exact() -> None:
    random = np.random.default_rng(1)
    rows = np.sort(random.uniform(2.0, 3.0, 40))
    grid = grid_of(rows, 0.03)
    assert grid.time[0] == rows[0]
    assert grid.time[-1] >= rows[-1] - 1e-12
    assert np.diff(grid.time) == pytest.approx(0.03)
    law = np.polynomial.Polynomial(random.standard_normal(6), domain=[2.0, 3.0])
    found = grid.at_rows(law(grid.time)[:, None])
    assert found[:, 0] == pytest.approx(law(rows), rel=1e-10)


def test_a_window_shorter_than_six_steps() -> None:
    grid = grid_of(np.array([1.0, 1.01, 1.025]), 0.02)
    assert len(grid.time) == 6
    assert grid.at_rows(grid.time[:, None] ** 2)[:, 0] == pytest.approx([1.0, 1.01**2, 1.025**2])


def test_averages_of_a_polygon() -> None:
    random = np.random.default_rng(2)
    time = np.cumsum(random.uniform(0.5e-3, 1.5e-3, 1000))
    drive = bha.Input(time, 1e5 + 1e3 * random.standard_normal((1000, 2)))
    step = 0.02
    found = averaged(drive, step)
    assert np.diff(found.time)[:-1] == pytest.approx(step / 2)
    fine = np.linspace(found.time[5] - step / 4, found.time[5] + step / 4, 100_001)
    for k in range(2):
        expected = np.trapezoid(np.interp(fine, time, drive.pressures[:, k]), fine) / (step / 2)
        assert found.pressures[5, k] == pytest.approx(expected, rel=1e-8)
    assert found.pressures.std() < 0.5 * drive.pressures.std()
    assert averaged(drive, 1e-3) is drive


def test_predictions_agree_with_a_simulation_that_stops_at_every_row() -> None:
    arm = one_section()
    random = np.random.default_rng(3)
    time = np.concatenate([[0.0], np.sort(random.uniform(0.0, 2.0, 150)), [2.0]])
    smooth = multisine(arm, 2.0, 1000.0, 3)
    drive = bha.Input(time, np.column_stack([np.interp(time, smooth.time, p) for p in smooth.pressures.T]))
    rec = record(arm, measured(arm, drive, heads=True, pressure_noise=0.0))
    x0 = np.concatenate([arm.static_lengths(drive.pressures[0]), np.zeros(3)])
    window = Window(0, 0, len(rec))
    (found,) = Model(arm.parameters, (), (rec,), Integration(5e-3)).predict(np.zeros(0), [window], x0[None])
    run = bha.simulate(arm, drive, times=drive.time)
    expected = np.hstack([run.lengths, run.head_positions[:, 0]])
    # Pressures have kinks within steps; the rest is a thirtieth of a draw wire's noise at its worst.
    assert np.abs(found - expected).max() < 1e-5
    assert np.sqrt(np.mean((found - expected) ** 2)) < 2e-6
