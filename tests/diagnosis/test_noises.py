"""What a right model would leave, bounded and told by what a fit leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from bha.diagnosis.noises import bound_of, sensors_of
from bha.estimation.records import Record

from .synthetic import record_of

Array = NDArray[np.float64]
STEP, ROWS = 0.01, 4000


def sine(frequency: float, size: float, random: np.random.Generator) -> Array:
    """The same at a random phase in three channels, (ROWS, 3)."""
    phases = random.uniform(0.0, 2.0 * np.pi, 3)
    return size * np.sin(2.0 * np.pi * frequency * STEP * np.arange(ROWS)[:, None] + phases)


def record(measured: Array, noise: float) -> Record:
    """A log of still pressures."""
    time = STEP * np.arange(ROWS)
    return record_of(time, measured, np.full((ROWS, 3), 1.2e5), noise)


def test_noise_of_pressures_makes_no_more_in_any_band_than_a_fit_leaves() -> None:
    random = np.random.default_rng(1)
    log = record(sine(2.0, 1e-3, random) + sine(0.5, 1e-3, random), 1e-4)
    draws = [sine(2.0, 4e-3, random) + sine(0.5, 0.5e-3, random) for _ in range(3)]
    bound = bound_of([log], [np.zeros((ROWS, 3))], [draws])
    made = bound(draws, log)
    power = [np.abs(np.fft.rfft(own[0][:, 0])) for own in (draws, made)]
    at = [round(f * STEP * ROWS) for f in (2.0, 0.5)]
    assert power[1][at[0]] / power[0][at[0]] == pytest.approx(0.25, rel=0.25)
    assert power[1][at[1]] / power[0][at[1]] == pytest.approx(1.0, abs=0.02)


def test_no_draws_no_bound() -> None:
    log = record(np.zeros((ROWS, 3)), 1e-4)
    bound = bound_of([log], [np.zeros((ROWS, 3))], [[]])
    assert bound.least == 1.0
    assert bound([], log) == []


@pytest.mark.parametrize("time", [0.02, 0.2])
def test_colour_is_told_down_to_its_corner_where_nothing_else_is_left(time: float) -> None:
    random = np.random.default_rng(2)
    kept = np.exp(-STEP / time)
    noise = 4e-4 * lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], random.standard_normal((ROWS, 3)), axis=0)
    # Differences of neighbours find so much of it.
    seen = 4e-4 * np.sqrt(1.0 - kept)
    log = record(np.asarray(noise), seen)
    moving = log.driven_by(1.2e5 + 1e4 * np.sin(np.arange(ROWS) / 40.0)[:, None] * np.ones(3))
    log = replace(log, drive=moving)
    found = sensors_of([log], [log], [np.zeros((ROWS, 3))], [[]])
    assert found[0].deviation == pytest.approx(4e-4, rel=0.15)
    assert found[0].time == pytest.approx(time, rel=0.3)


@pytest.mark.parametrize("missing", [0.0, 1.5e-3])
def test_what_a_model_lacks_is_no_colour(missing: float) -> None:
    """Steps that are missed have a spectrum that falls, as colour has; but they are more than it would be."""
    random = np.random.default_rng(3)
    kept = np.exp(-STEP / 0.05)
    noise = 4e-4 * lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], random.standard_normal((ROWS, 3)), axis=0)
    steps = missing * np.sign(np.sin(np.arange(ROWS) / 90.0))[:, None] * np.ones(3)
    log = record(np.asarray(noise + steps), 4e-4 * np.sqrt(1.0 - kept))
    moving = log.driven_by(1.2e5 + 1e4 * np.sin(np.arange(ROWS) / 40.0)[:, None] * np.ones(3))
    found = sensors_of([replace(log, drive=moving)], [log], [np.zeros((ROWS, 3))], [[]])
    assert (found[0].share > 0.0) == (missing == 0.0)
