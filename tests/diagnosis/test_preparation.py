"""What happens to logs and springs before any fit: filters, rows that are left out, numbers that stay plausible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bha
from bha.diagnosis import describe, model, preparation, smoothing
from bha.diagnosis.baseline import Prepared
from bha.estimation import derived
from bha.estimation.records import Record

from .synthetic import one_section, record_of

SAMPLE_TIME = 5e-3


def test_thinning_leaves_out_the_ends_and_keeps_a_fast_motion_where_it_was() -> None:
    time = np.arange(1000) * SAMPLE_TIME
    motion = 0.02 * np.sin(2.0 * np.pi * 4.0 * time + 0.7)[:, None]
    thinned = preparation.thin(record_of(time, motion, np.zeros((1000, 1))), 2)
    assert thinned.time[0] > 0.0
    assert thinned.time[-1] < time[-1]
    expected = 0.02 * np.sin(2.0 * np.pi * 4.0 * thinned.time + 0.7)
    np.testing.assert_allclose(thinned.measured[:, 0], expected, atol=2e-5)


def test_pressures_lose_their_noise_and_keep_what_a_chamber_does() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(4000) * SAMPLE_TIME
    true = 1.2e5 + 2e4 * np.sin(2.0 * np.pi * 2.0 * time)[:, None]
    noisy = true + 200.0 * rng.standard_normal(true.shape)
    (smooth,) = smoothing.smoothed([record_of(time, np.zeros_like(true), noisy, pressure_noise=200.0)])
    assert smooth.pressure_kept is not None
    assert np.std(smooth.drive.pressures - true) < 0.5 * 200.0
    middle = slice(100, -100)
    wave = np.sin(2.0 * np.pi * 2.0 * time[middle])
    gain = 2.0 * np.mean(smooth.drive.pressures[middle, 0] * wave) / 2e4
    assert gain == pytest.approx(1.0, abs=0.01)


def test_noise_is_gone_where_pressures_do_not_move_and_readings_apart_stay() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(4000) * SAMPLE_TIME
    slow = 1.2e5 + 2e4 * np.sin(2.0 * np.pi * 0.2 * time)[:, None]
    noisy = slow + 200.0 * rng.standard_normal(slow.shape)
    # Told far too great, as differences of few readings tell it.
    given = record_of(time, np.zeros_like(slow), noisy, pressure_noise=2000.0)
    (smooth,) = smoothing.smoothed([given])
    assert smooth.pressure_noise[0] == pytest.approx(200.0, rel=0.05)
    left = np.fft.rfft((smooth.drive.pressures - slow)[:, 0]) / np.fft.rfft((noisy - slow)[:, 0])
    ringing = slice(round(2.0 * time[-1]), round(8.0 * time[-1]))
    assert np.sqrt(np.mean(np.abs(left[ringing]) ** 2)) < 0.2
    assert np.std(smooth.drive.pressures - slow) < 0.2 * 200.0
    # What stands still for a while is still, and a step between stays as steep as it was.
    steps = np.where((time > 5.0) & (time < 10.0), 1.4e5, 1.1e5)[:, None]
    stepped = record_of(
        time, np.zeros_like(slow), steps + 200.0 * rng.standard_normal(slow.shape), pressure_noise=200.0
    )
    (found,) = smoothing.smoothed([stepped])
    still = (np.abs(time - 5.0) > 2.2) & (np.abs(time - 10.0) > 2.2)
    assert np.std((found.drive.pressures - steps)[still]) < 0.25 * 200.0
    near = np.flatnonzero(np.abs(time - 5.0) < 0.1)
    assert np.abs(found.drive.pressures - stepped.drive.pressures)[near].max() < 0.1 * 3e4
    # Draws of noise are as much less where nothing of it is left.
    left_over = smoothing.errors_left(200.0 * rng.standard_normal(slow.shape), found)
    assert np.std(left_over[still]) < 0.5 * 200.0
    # Seldom rows are filtered as well.
    few = record_of(100.0 * time, np.zeros_like(slow), noisy, pressure_noise=200.0)
    assert np.std(smoothing.smoothed([few])[0].drive.pressures - slow) < 0.8 * 200.0
    # Between readings that are farther apart than rows there is nothing to be filtered.
    facts = tuple(replace(fact, interval=20 * SAMPLE_TIME) for fact in given.pressure_facts)
    (same,) = smoothing.smoothed([replace(given, pressure_facts=facts)])
    assert same.pressure_kept is None


def test_noise_is_no_more_than_what_a_model_leaves() -> None:
    time = np.arange(400) * 0.1
    rng = np.random.default_rng(7)
    shown = 0.2 + 0.05 * np.sin(time)[:, None] * np.ones(3)
    rec = record_of(time, shown + 2e-4 * rng.standard_normal(shown.shape), np.full((400, 3), 1e5), noise=3e-3)
    prepared = Prepared((rec,), (rec,), (np.zeros(6),), 0.01, 0.01, 0.0)
    found = prepared.quieter([shown])
    assert found.records[0].noise == pytest.approx(np.full(3, 2e-4), rel=0.1)
    assert found.quieter([shown]) is found
    # Of rows that went through a filter less is left than readings are off.
    thinned = replace(rec, thinning=2)
    assert Prepared((thinned,), (rec,), (np.zeros(6),), 0.01, 0.01, 0.0).quieter([shown]).records == (thinned,)


def test_noise_free_commands_in_steps_stay_as_they_are() -> None:
    time = np.arange(1000) * SAMPLE_TIME
    steps = np.repeat(np.arange(10.0), 100)[:, None] * 1e4
    (same,) = smoothing.smoothed([record_of(time, np.zeros_like(steps), steps)])
    assert same.pressure_kept is None
    np.testing.assert_array_equal(same.drive.pressures, steps)


def test_rounded_commands_are_no_noise() -> None:
    time = np.arange(1000) * SAMPLE_TIME
    rounded = np.round(1.2e5 + 2e4 * np.sin(2.0 * np.pi * time)[:, None], -2)
    read = record_of(time, np.zeros_like(rounded), rounded, pressure_noise=100.0 / np.sqrt(12.0))
    commands = replace(read, drive=replace(read.drive, commanded=True))
    assert smoothing.smoothed([read])[0].pressure_kept is not None
    assert smoothing.smoothed([commands]) == [commands]


def test_what_stood_before_a_log_has_no_noise() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(1000) * SAMPLE_TIME
    noisy = 1.2e5 + 200.0 * rng.standard_normal((1000, 1))
    (smooth,) = smoothing.smoothed([record_of(time, np.zeros_like(noisy), noisy, pressure_noise=200.0)])
    told = smooth.preceded_by(np.full(1, 1.5e5), 0.1)
    noise = 200.0 * rng.standard_normal((1000, 1))
    left = smoothing.errors_left(np.concatenate([np.full((told.before, 1), 200.0), noise]), told)
    assert not left[: told.before].any()
    np.testing.assert_allclose(left[told.before :], smoothing.errors_left(noise, smooth))


def test_rows_are_cut_to_those_of_a_log_whose_past_is_known() -> None:
    time = np.arange(200) * 5e-3
    whole = record_of(time, np.full((200, 3), 0.2), np.full((200, 3), 2e5))
    thinned = preparation.thin(whole, 2).preceded_by(np.full(3, 1.5e5), 0.1)
    kept = preparation.cut_to(whole, thinned)
    assert kept.time[0] == pytest.approx(thinned.time[0])
    assert kept.time[-1] == pytest.approx(thinned.time[-1])


def test_one_tangent_stiffness_changes_and_the_others_stay() -> None:
    plain = model.plain_model(one_section())
    number = [c.name for c in plain.coordinates].index("section 1 tangent stiffness at +80 mm")
    x = np.zeros(plain.size)
    x[number] = 1.0
    elongations = derived.stiffness_elongations(plain.core["section"][0])
    before, after = (plain.description(v)["section"][0]["bellows"][0]["stiffness"] for v in (np.zeros(plain.size), x))
    changed = [derived.tangent_stiffness(after, e) / derived.tangent_stiffness(before, e) for e in elongations]
    expected = np.ones(4)
    expected[elongations.index(min(elongations, key=lambda e: abs(e - 0.08)))] = np.exp(0.3)
    np.testing.assert_allclose(changed, expected, rtol=1e-9)
    # At x = 0 the arm is that of the file.
    assert plain.description(np.zeros(plain.size))["section"][0]["bellows"][0]["stiffness"][:3] == pytest.approx(
        plain.core["section"][0]["bellows"][0]["stiffness"]
    )


def test_the_last_third_of_an_only_log_knows_the_commands_before_it() -> None:
    lag = {"level": "lag", "fill_time": 0.3, "vent_time": 0.3}
    arm = bha.Arm(one_section().parameters.updated({"pneumatics": lag}))
    time = np.arange(0.0, 9.0, 0.02)
    # A step just before the last third begins: its chambers are still on their way.
    pressures = np.where(time[:, None] < 5.9, [1.2e5, 1.3e5, 1.4e5], [1.7e5, 1.2e5, 1.5e5])
    options = {"method": "rk4", "step": 1e-3}
    drive = bha.Input(time, pressures, commanded=True, interpolation="hold")
    whole = bha.simulate_batch(arm, drive, times=time, **options)
    columns = {f"pc1{k + 1} [Pa]": p for k, p in enumerate(pressures.T)}
    columns |= {f"q1{k + 1} [m]": q for k, q in enumerate(whole.lengths[0].T)}
    log = bha.Log.from_arrays({"t [s]": time, **columns})
    (first,), (last,) = preparation.split([preparation.prepare(bha.Recording(arm, log))])
    assert last.time[0] - first.time[-1] == pytest.approx(0.02)
    row = int(np.searchsorted(time, last.time[0] - 1e-9))
    state = np.concatenate([whole.lengths[0, row], whole.velocities[0, row]])

    def missed(record: Record) -> float:
        run = bha.simulate_batch(arm, record.drive, [state], times=record.time, start=record.time[0], **options)
        return float(np.max(np.abs(run.lengths[0] - whole.lengths[0, row:])))

    said = describe.log_facts(last, "held out")
    assert said["rows"] == len(last)
    assert said["duration"] == pytest.approx(last.time[-1] - last.time[0])
    assert missed(last) < 1e-5
    assert missed(last.between(last.time[0], last.time[-1])) > 2e-3
