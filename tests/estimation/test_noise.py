"""The one noise model: sizes are found whatever the rate, and intervals know them (findings on noise, one a test)."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import bha
from bha.estimation.noise import Noise, redrawn_errors, ways_of
from bha.estimation.records import record
from bha.estimation.refinement import Refinement, refine
from bha.estimation.settings import Settings
from bha.identification import default_free

sys.path.insert(0, str(Path(__file__).parents[2]))

from benches.identify_recovery.logs import CONDITIONS, Condition, arm_of, noisy_log, start_of

ARM = arm_of(1)
FREE = default_free(ARM.parameters)


def driven(rate: float, duration: float) -> bha.Input:
    """Steps that are held for a second, each with a ramp, and a slow wave upon them."""
    time = np.arange(0.0, duration, 1.0 / rate)
    random = np.random.default_rng(5)
    levels = random.uniform(-2e4, 2e4, (int(duration) + 2, 3))
    edges = np.arange(len(levels)) + np.array([[0.0], [0.15]])
    steps = np.column_stack([np.interp(time, edges.T.ravel(), np.repeat(np.r_[0.0, c], 2)[1:-1]) for c in levels.T])
    return bha.Input(time, 1.5e5 + steps + 8e3 * np.sin(2.0 * np.pi * time[:, None] * [0.4, 0.7, 1.1]))


@cache
def fitted(name: str, duration: float = 10.0) -> Refinement:
    """A fit of the logs of a condition, from values that are 15 % off."""
    condition = next(c for c in CONDITIONS if c.name == name)
    start = start_of(ARM, FREE, 3)
    log = noisy_log(ARM, driven(condition.rate, duration), condition, 3)
    return refine(start, [record(start, log)], FREE, Settings(threads=1))


def sizes(fit: Refinement) -> Noise:
    assert fit.noises is not None
    return fit.noises.noise(0)


def covered(fit: Refinement) -> bool:
    """Whether the true values lie within four standard errors: of six parameters each, in all cells of this file."""
    true = np.array([bha.parameters.paths.get_value(ARM.parameters, p) for p in FREE])
    return bool(np.all(np.abs(fit.values - true) < 4.0 * fit.standard_errors))


def test_at_ten_hertz_motion_is_no_noise() -> None:
    fit = fitted("10 Hz", 20.0)
    assert np.all(sizes(fit).sensor < 6e-4)
    # Nor is the motion of pressures: third differences find 800 to 2600 Pa in them.
    assert sizes(fit).logged == pytest.approx(np.full(3, 150.0), rel=0.5)
    # Two-sided: white residuals far below one would say that the noise is taken for too large.
    assert fit.noises is not None
    assert fit.noises.mean_square(0) == pytest.approx(np.ones(3), abs=0.3)
    assert covered(fit)


def test_coloured_noise_is_found_with_its_time_and_is_no_gap() -> None:
    fit = fitted("colour")
    found = sizes(fit)
    assert found.sensor == pytest.approx(np.full(3, 3e-4), rel=0.25)
    assert found.colour_time[0] == pytest.approx(0.1, rel=0.35)
    assert not np.any(found.unlogged)
    assert covered(fit)


def test_rounding_is_taken_off_where_it_is_coarse() -> None:
    fit = fitted("quantised")
    found = sizes(fit)
    assert fit.noises is not None
    rounding = fit.noises.rounding
    assert rounding.quantum == pytest.approx(np.full(3, 1e-3))
    # Of what sets readings apart from the model, 0.17 mm, the noise of the sensors is a part.
    assert rounding.white == pytest.approx(np.full(3, 1e-4), rel=0.5)
    # What is left is rounding at random, and what a shaken simulation takes off too much or too little.
    assert np.all((found.sensor > 2.5e-4) & (found.sensor < 6e-4))
    assert not np.any(found.unlogged)
    assert covered(fit)


def test_a_slow_pressure_that_no_log_has_is_found_and_the_intervals_know_it() -> None:
    fit = fitted("unlogged 5 s", 20.0)
    found = sizes(fit)
    # Its increments are told well, its size and time alone hardly in twenty seconds.
    assert found.unlogged[0] ** 2 / found.unlogged_time[0] == pytest.approx(1500.0**2 / 5.0, rel=0.35)
    assert found.sensor == pytest.approx(np.full(3, 3e-4), rel=0.1)
    assert covered(fit)


def test_where_nothing_disturbs_nothing_is_kept() -> None:
    found = sizes(fitted("sensor noise"))
    assert not np.any(found.unlogged)
    assert not np.any(found.coloured)
    assert found.sensor == pytest.approx(np.full(3, 3e-4), rel=0.1)


def test_rounding_under_noise_is_what_redrawn_readings_have() -> None:
    """Variance of the part that belongs to the place, by averaging many readings at one place each."""
    places = np.linspace(0.0, 1.0, 41)[:-1]
    for share in (0.05, 0.2, 0.5):
        none = np.zeros(1)
        noise = Noise(np.array([share]), none, none + 1.0, none, none + 1.0, none, np.array([1.0]))
        random = np.random.default_rng(2)
        means = [np.mean(np.round(place + share * random.standard_normal(20_000)) - place) for place in places]
        assert noise.rounding[0] == pytest.approx(np.var(means), rel=0.05, abs=2e-4)
        drawn = np.concatenate([redrawn_errors(noise, np.full((50, 1), 0.3), random) for _ in range(400)])
        assert np.std(drawn) == pytest.approx(np.sqrt(share**2 + 1.0 / 12.0), rel=0.1)


def test_ways_do_not_count_what_shakes() -> None:
    shaken = 0.1 * np.sin(np.arange(500.0))[:, None]
    assert ways_of(shaken, np.ones(1))[-1, 0] < 0.01
    assert ways_of(np.linspace(0.0, 7.0, 500)[:, None], np.ones(1))[-1, 0] == pytest.approx(7.0, abs=0.2)


def test_a_condition_is_made_as_it_says() -> None:
    held = noisy_log(ARM, driven(200.0, 3.0), Condition("held", rate=200.0, sensor_rate=30.0), 1)
    repeats = np.diff(held["q11"]) == 0.0
    assert np.mean(repeats) == pytest.approx(1.0 - 30.0 / 200.0, abs=0.05)
