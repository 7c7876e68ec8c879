"""What samples are worth: noise, quantisation, holding, dropouts, spikes, timers; each with what must not be found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from bha.recordings import clock, samples
from bha.recordings.noise import quantum, white_noise


def moving(rows: int, rate: float) -> np.ndarray:
    """A swing of 1.3 Hz and a step, m."""
    t = np.arange(rows) / rate
    return 0.15 + 0.05 * np.sin(2 * np.pi * 1.3 * t) + 0.02 * (t > 0.35 * t[-1])


@pytest.mark.parametrize(("rate", "tolerance"), [(200.0, 0.04), (50.0, 0.06), (10.0, 0.15)])
def test_noise_is_found_at_any_rate(rate: float, tolerance: float) -> None:
    rng = np.random.default_rng(1)
    found = white_noise(moving(4000, rate) + 3e-4 * rng.standard_normal(4000))
    assert found == pytest.approx(3e-4, rel=tolerance)


def test_noise_of_a_grid_holds_that_of_its_steps() -> None:
    rng = np.random.default_rng(2)
    values = np.round((moving(4000, 200.0) + 2e-4 * rng.standard_normal(4000)) / 1e-4) * 1e-4
    assert white_noise(values) == pytest.approx(np.hypot(2e-4, 1e-4 / np.sqrt(12)), rel=0.1)
    assert quantum(values) == pytest.approx(1e-4, rel=1e-6)
    assert quantum(rng.standard_normal(2000)) == 0.0


@pytest.mark.parametrize("repeats", [2, 4, 33])
def test_a_sensor_that_holds_its_reading_renews_at_its_own_rate(repeats: int) -> None:
    rng = np.random.default_rng(4)
    time = np.arange(400 * repeats) / (30.0 * repeats)
    readings = moving(400, 30.0) + 1e-3 * rng.standard_normal(400)
    facts, usable = samples.judge(time, "x1", "m", np.repeat(readings, repeats))
    assert facts.held == pytest.approx(1.0 - 1.0 / repeats, abs=0.01)
    assert facts.interval == pytest.approx(1.0 / 30.0, rel=1e-6)
    assert facts.noise == pytest.approx(1e-3, rel=0.2)
    assert np.flatnonzero(usable).tolist() == list(range(0, len(time), repeats))


def test_chance_repeats_on_a_grid_and_slow_motion_are_no_holding() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(4000) * 5e-3
    noise = np.round(2e-4 * rng.standard_normal(4000) / 5e-4) * 5e-4
    creeping = np.round((0.1 + 0.02 * time / time[-1]) / 1e-3) * 1e-3
    for values in (noise, creeping, np.round(moving(4000, 200.0) / 1e-3) * 1e-3):
        facts, usable = samples.judge(time, "q11", "m", values)
        assert facts.held == 0.0
        assert not facts.dropouts
        assert usable.all()


def test_pressures_in_steps_are_no_holding_and_no_dropout() -> None:
    rng = np.random.default_rng(6)
    time = np.arange(3000) * 0.01
    stairs = np.repeat(rng.uniform(1e5, 2e5, 12), 250)
    for values in (stairs, np.round((stairs + 50.0 * rng.standard_normal(3000)) / 500.0) * 500.0):
        facts, usable = samples.judge(time, "p11", "Pa", values)
        assert facts.held == 0.0
        assert not facts.dropouts
        assert usable.all()


def test_dropouts_are_left_out_of_a_fine_channel() -> None:
    rng = np.random.default_rng(7)
    time = np.arange(2000) * 0.01
    values = moving(2000, 100.0) + 2e-4 * rng.standard_normal(2000)
    for first in (310, 900, 1500):
        values[first : first + 60] = values[first - 1]
    facts, usable = samples.judge(time, "q12", "m", values)
    assert facts.dropouts == tuple(
        (pytest.approx(t, abs=0.011), pytest.approx(t + 0.6, abs=0.011)) for t in (3.1, 9.0, 15.0)
    )
    assert not usable[311:370].any()
    assert usable.sum() == 2000 - 3 * 60
    assert facts.noise == pytest.approx(2e-4, rel=0.1)


def test_dropouts_of_a_sensor_that_holds_are_found_too() -> None:
    rng = np.random.default_rng(8)
    time = np.arange(4000) * 5e-3
    values = np.repeat(moving(600, 30.0) + 1e-4 * rng.standard_normal(600), 7)[:4000]
    values[2002:2150] = values[2001]
    facts, _ = samples.judge(time, "z1", "m", values)
    assert facts.held > 0.8
    assert len(facts.dropouts) == 1
    assert facts.dropouts[0][0] == pytest.approx(10.0, abs=0.05)


def test_spikes_are_left_out_and_fast_motion_is_not() -> None:
    rng = np.random.default_rng(9)
    time = np.arange(1000) * 0.01
    values = moving(1000, 100.0) + 2e-4 * rng.standard_normal(1000)
    clean, _ = samples.judge(time, "q11", "m", values)
    assert clean.spikes == ()
    spoilt = values.copy()
    for row in (61, 350, 351, 700, 701, 702):
        spoilt[row] += 0.1
    facts, usable = samples.judge(time, "q11", "m", spoilt)
    assert np.flatnonzero(~usable).tolist() == [61, 350, 351, 700, 701, 702]
    assert facts.noise == pytest.approx(2e-4, rel=0.1)


def test_a_swing_sampled_coarsely_has_no_spikes() -> None:
    time = np.arange(400) * 0.1
    swing = np.where(time % 8.0 < 4.0, 0.1, 0.0) + 0.05 * np.exp(-(time % 4.0)) * np.cos(2 * np.pi * 2.2 * time)
    facts, usable = samples.judge(time, "x1", "m", swing)
    assert facts.spikes == ()
    assert usable.all()


def test_a_command_may_stand_still() -> None:
    time = np.arange(2000) * 0.01
    command = np.repeat(np.array([1e5, 1.5e5, 1.2e5, 1.9e5]), 500)
    facts, usable = samples.judge(time, "pc11", "Pa", command, measured=False)
    assert usable.all()
    assert facts.noise == facts.held == 0.0


def test_missing_samples_do_not_count() -> None:
    rng = np.random.default_rng(10)
    time = np.arange(1000) * 0.01
    values = moving(1000, 100.0) + 1e-4 * rng.standard_normal(1000)
    values[rng.random(1000) < 0.2] = np.nan
    facts, usable = samples.judge(time, "q11", "m", values)
    assert np.array_equal(usable, np.isfinite(values))
    assert facts.missing == pytest.approx(0.2, abs=0.03)


def test_rows_that_a_coarse_timer_stamped_are_even_again() -> None:
    true = np.arange(1001) * 0.01
    stamped = np.floor(true / 0.0156) * 0.0156
    time, facts = clock.mended(stamped)
    assert facts.tick == pytest.approx(0.0156, rel=1e-6)
    assert np.max(np.abs(time - true - np.mean(time - true))) < 1e-4
    assert facts.interval == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("kind", ["even", "jittered", "gap", "repeated"])
def test_other_clocks_stay_as_they_are(kind: str) -> None:
    time = np.arange(1000) * 0.01
    if kind == "jittered":
        time = np.sort(time + np.random.default_rng(11).uniform(0.0, 0.008, 1000))
    elif kind == "gap":
        time = time + np.where(np.arange(1000) > 500, 3.0, 0.0)
    elif kind == "repeated":
        time[300] = time[299]
    found, facts = clock.mended(time)
    assert np.array_equal(found, time)
    assert facts.tick == 0.0
    assert len(facts.gaps) == (kind == "gap")


def test_a_single_small_spike_is_found_and_fast_motion_is_none() -> None:
    rng = np.random.default_rng(12)
    time = np.arange(2000) * 0.01
    swing = 0.15 + 0.05 * np.sin(2.0 * np.pi * 3.5 * time)
    values = swing + 2e-4 * rng.standard_normal(2000)
    clean, _ = samples.judge(time, "q12", "m", values)
    assert not clean.spikes
    places = [101, 640, 1203, 1777]
    values[places] += np.array([5e-3, -5e-3, 5e-3, -5e-3])
    facts, usable = samples.judge(time, "q12", "m", values)
    assert [round(100.0 * t) for t in facts.spikes] == places
    assert np.flatnonzero(~usable).tolist() == places
    # A wall stops an arm from one row to the next; it does not come back.
    stopped = np.minimum(swing, 0.18) + 2e-4 * rng.standard_normal(2000)
    assert not samples.judge(time, "q12", "m", stopped)[0].spikes
    # Pressures have kinks, and slow logs overshoots of one reading.
    assert not samples.judge(time, "p12", "Pa", 1e5 * values)[0].spikes
    assert not samples.judge(time * 10.0, "q12", "m", values)[0].spikes


def test_spikes_that_come_together_are_found_and_setting_out_is_none() -> None:
    rng = np.random.default_rng(14)
    time = np.arange(1000) * 0.02
    # An arm that sets out from one row to the next, as one under stiff springs does.
    level = 0.2 + 0.04 * (np.searchsorted([6.0, 13.0], time, side="right") % 2)
    moved = lfilter([0.3], [1.0, -0.7], level - 0.2) + 0.2
    values = np.round((moved + 1e-4 * rng.standard_normal(1000)) / 5e-4) * 5e-4
    assert not samples.judge(time, "q13", "m", values)[0].spikes
    places = [165, 168, 173]
    values[places] += np.array([-0.034, -0.022, 0.027])
    facts, usable = samples.judge(time, "q13", "m", values)
    assert [round(50.0 * t) for t in facts.spikes] == places
    assert np.flatnonzero(~usable).tolist() == places


def test_stamps_that_scatter_about_even_samples_are_mended_and_others_are_not() -> None:
    rng = np.random.default_rng(13)
    even = np.arange(1500) * 0.01
    stamps = even + rng.uniform(-3e-3, 3e-3, 1500)

    def measured(at: np.ndarray, noise: float) -> np.ndarray:
        true = np.column_stack([0.15 + 0.05 * np.sin(2.0 * np.pi * f * at) for f in (0.7, 1.9)])
        return true + noise * rng.standard_normal((1500, 2))

    found, facts = clock.mended(stamps, measured(even, 2e-4))
    assert np.max(np.abs(found - even)) < 3e-4
    assert facts.scatter == pytest.approx(3e-3 / np.sqrt(3.0), rel=0.1)
    # Samples that were taken when the stamps say; noise in which nobody can tell; even stamps; rows that are missing.
    assert np.array_equal(clock.mended(stamps, measured(stamps, 2e-4))[0], stamps)
    assert np.array_equal(clock.mended(stamps, measured(even, 2e-2))[0], stamps)
    assert clock.mended(even, measured(even, 2e-4))[1].scatter == 0.0
    assert clock.mended(np.delete(stamps, slice(300, 340)), measured(even, 2e-4)[:1460])[1].scatter == 0.0


def test_a_coarse_channel_that_has_stopped_is_told_by_the_jump_at_its_end() -> None:
    rng = np.random.default_rng(12)
    time = np.arange(3000) * 0.02
    # Steps that an arm follows slowly, on a grid of many times the noise: it stands still for seconds between them.
    levels = np.repeat(0.2 + 0.03 * (np.arange(12) % 2), 250)
    motion = levels[:1].repeat(3000)
    for k in range(1, 3000):
        motion[k] = motion[k - 1] + 0.02 / 0.35 * (levels[k] - motion[k - 1])
    grid = 1e-3
    clean = np.round((motion + 5e-5 * rng.standard_normal(3000)) / grid) * grid
    facts, usable = samples.judge(time, "q11", "m", clean)
    assert not facts.dropouts
    assert usable.all()
    stopped = clean.copy()
    # From before a step until the arm has moved by most of it; and while it stands, which nothing tells or spoils.
    for first, last in ((740, 790), (1490, 1540), (2200, 2240)):
        stopped[first:last] = stopped[first]
    facts, usable = samples.judge(time, "q11", "m", stopped)
    assert [round(end / 0.02) for _, end in facts.dropouts] == [790, 1540]
    assert not usable[751:790].any()
    assert not usable[1501:1540].any()
    assert usable[1541:].all()
