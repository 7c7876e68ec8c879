"""Rows that somebody has filled in by straight lines, and readings so far apart that a curve goes through them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha.identification import record
from bha.recordings import samples

Array = NDArray[np.float64]
ROWS = np.arange(12_001) / 1e3


def resampled(at: Array, rate: float, noise: float, rng: np.random.Generator, first: float = 0.0037) -> Array:
    """A swing that is read at some rate and filled in between, at the times ``at``."""
    read = np.arange(first, at[-1], 1.0 / rate)
    values = 0.15 + 0.05 * np.sin(2.0 * np.pi * 1.3 * read) + noise * rng.standard_normal(len(read))
    return np.interp(at, read, values)


@pytest.mark.parametrize(("rate", "digits"), [(25.0, 12), (30.0, 12), (75.0, 12), (30.0, 6)])
def test_readings_are_found_among_the_rows_between(rate: float, digits: int) -> None:
    rng = np.random.default_rng(1)
    values = np.round(resampled(ROWS, rate, 2e-4, rng), digits)
    facts, usable = samples.judge(ROWS, "q11", "m", values)
    assert facts.filled
    assert facts.interval == pytest.approx(1.0 / rate, abs=1e-3)
    assert np.count_nonzero(usable) == pytest.approx(ROWS[-1] * rate, rel=0.05)
    # Rows that count are next to readings, and their noise is that of readings.
    off = (ROWS[usable] - 0.0037) * rate
    assert np.quantile(np.abs(off - np.round(off)) / rate, 0.95) < 1.01e-3
    assert facts.noise == pytest.approx(2e-4, rel=0.15)
    assert not facts.spikes


def test_what_is_straight_for_other_reasons_is_not_filled_in() -> None:
    rng = np.random.default_rng(2)
    swing = 0.15 + 0.05 * np.sin(2.0 * np.pi * 1.3 * ROWS)
    edges = np.cumsum(rng.uniform(0.3, 1.5, 40))
    ramps = np.interp(ROWS, edges, rng.uniform(1e5, 2e5, 40))
    grid = np.round(swing / 1e-3) * 1e-3
    still = np.full(len(ROWS), 0.1)
    for values in (
        swing,
        swing + 2e-4 * rng.standard_normal(len(ROWS)),
        ramps,
        grid,
        still,
        np.repeat(swing[::40], 40),
    ):
        assert not samples.judge(ROWS, "q11", "m", values[: len(ROWS)])[0].filled


def one() -> bha.Arm:
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    return bha.Arm(bha.robots.parameters("bha_nominal").updated({"section": mapping["section"][:1]}))


def rises(time: Array, width: float) -> Array:
    """Pressures in steps behind two lags of ``width``, s; jumps for 0; three inputs."""
    rng = np.random.default_rng(3)
    edges = np.arange(0.5, time[-1], 0.9) + rng.uniform(0.0, 0.2, len(np.arange(0.5, time[-1], 0.9)))
    since = np.maximum(time[:, None] - edges, 0.0)
    shape = 1.0 - (1.0 + since / width) * np.exp(-since / width) if width else 1.0 * (since > 0.0)
    return 1.4e5 + shape @ rng.normal(0.0, 1.5e4, (len(edges), 3))


def log_of(time: Array, pressures: Array) -> bha.Log:
    columns = {f"p1{k + 1} [Pa]": pressures[:, k] for k in range(3)}
    return bha.Log.from_arrays({"t [s]": time, **columns, "q11 [m]": 0.15 + 1e-4 * np.sin(time)})


def test_readings_far_apart_have_a_curve_through_them() -> None:
    true = rises(ROWS, 0.03)
    rows = slice(None, None, 40)
    read = true[rows] + 20.0 * np.random.default_rng(4).standard_normal(true[rows].shape)
    recording = bha.Recording(one(), log_of(ROWS[rows], read))
    drive = recording.drive
    assert np.array_equal(drive.time[recording.drive_rows], ROWS[rows])
    assert np.max(np.diff(drive.time)) < 0.0101
    assert np.allclose(drive.pressures[recording.drive_rows], read)
    curve, straight = (
        np.std(np.column_stack([np.interp(ROWS, at, p) for p in values.T]) - true)
        for at, values in ((drive.time, drive.pressures), (ROWS[rows], read))
    )
    assert curve < 0.8 * straight
    assert "a curve between readings" in str(recording)
    # Noise of readings is that of several samples together.
    assert recording.pressure_noise == pytest.approx([2.0 * fact.noise for fact in recording.pressure_facts], rel=0.01)
    # Of jumps no curve knows more than a line, and dense readings need none.
    for width, step in ((0.0, 100), (0.03, 10)):
        rows = slice(None, None, step)
        recording = bha.Recording(one(), log_of(ROWS[rows], rises(ROWS, width)[rows]))
        assert np.array_equal(recording.drive.time, ROWS[rows])


def test_rows_with_readings_are_kept_when_rows_are_thinned() -> None:
    rng = np.random.default_rng(5)
    columns = {f"q1{k + 1} [m]": resampled(ROWS, 30.0, 2e-4, rng, 0.004 + 0.007 * k) for k in range(3)}
    pressures = {f"p1{k + 1} [Pa]": 1.3e5 + 1e4 * np.sin(ROWS + k) for k in range(3)}
    made = record(one(), bha.Log.from_arrays({"t [s]": ROWS, **pressures, **columns}))
    thin = made.thinned(0.01)
    assert np.count_nonzero(thin.usable) == np.count_nonzero(made.usable)
    assert len(thin) < 0.1 * len(made)
