from dataclasses import replace

import numpy as np
import pytest

from bha.estimation import bands
from bha.estimation.problem import Residuals
from bha.estimation.records import Record, Window

from .synthetic import record_of


def record(outputs: np.ndarray, sample_time: float, deviation: float) -> Record:
    time = np.arange(len(outputs)) * sample_time
    return record_of(time, outputs, np.zeros((len(outputs), 3)), deviation)


def test_white_rows_have_variance_one_where_noise_is_white_and_shaped() -> None:
    rng = np.random.default_rng(5)
    rows, sample_time = 4000, 0.01

    def shaped() -> np.ndarray:
        drive = rng.standard_normal(rows)
        slow = np.empty(rows)
        slow[0] = drive[0]
        for k in range(1, rows):
            slow[k] = 0.9 * slow[k - 1] + np.sqrt(1 - 0.81) * drive[k]
        return np.outer(slow, [1.0, -0.5, 0.3]) * 3e-4

    measured = record(2e-4 * rng.standard_normal((rows, 3)) + shaped(), sample_time, 2e-4)
    model = bands.noise_model([measured], [[shaped() for _ in range(6)]])
    white = bands.Whitener(measured, model)(measured.measured)
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.06)
    correlation = np.mean(white[1:] * white[:-1])
    assert abs(correlation) < 0.05
    assert abs(np.mean(white[:, 0] * white[:, 1])) < 0.05
    assert np.sqrt(np.mean(measured.measured**2)) == pytest.approx(np.sqrt(np.mean(model.floor**2)), rel=0.1)


def test_whitening_is_linear_and_drops_what_lies_above_the_band() -> None:
    rng = np.random.default_rng(6)
    measured = record(1e-4 * rng.standard_normal((2000, 2)), 5e-3, 1e-4)
    white = bands.Whitener(measured, bands.noise_model([measured], [[]]))
    a, b = rng.standard_normal((2, 2000, 2))
    np.testing.assert_allclose(white(a + 2 * b), white(a) + 2 * white(b), atol=1e-6)
    time = measured.time[:, None]
    fast = np.sin(2 * np.pi * 70.0 * time) * np.ones((1, 2))
    slow = np.sin(2 * np.pi * 2.0 * time) * np.ones((1, 2))
    assert np.sum(white(fast) ** 2) < 1e-3 * np.sum(white(slow) ** 2)


def test_a_masked_row_counts_for_nothing() -> None:
    rng = np.random.default_rng(7)
    measured = record(1e-4 * rng.standard_normal((500, 1)), 0.01, 1e-4)
    good = measured.usable.copy()
    good[100:200] = False
    masked = replace(measured, usable=good)
    window = Window(0, 0, len(masked))
    white = bands.Whitener(masked, bands.noise_model([measured], [[]]))
    residuals = Residuals((masked.noise,), np.inf, {window: white})
    spoilt = measured.measured.copy()
    spoilt[100:200] += 1.0
    found = [residuals.white(window, values, good) for values in (spoilt, measured.measured)]
    np.testing.assert_allclose(*found, atol=1e-9)


def test_derivatives_are_whitened_as_residuals_are() -> None:
    rng = np.random.default_rng(9)
    measured = record(1e-4 * rng.standard_normal((700, 2)), 0.01, 1e-4)
    white = bands.Whitener(measured, bands.noise_model([measured], [[1e-4 * rng.standard_normal((700, 2))]]))
    table = rng.standard_normal((700, 2, 3, 4))
    found = white(table)
    for k in range(3):
        np.testing.assert_allclose(found[:, :, k, 1], white(table[:, :, k, 1]), atol=1e-9)


@pytest.mark.parametrize(("share", "time"), [(0.0, 0.0), (0.5, 0.03)])
def test_coloured_noise_is_told_from_white(share: float, time: float) -> None:
    rng = np.random.default_rng(8)
    frequency = np.linspace(15.0, 94.0, 59)
    truth = bands.SensorNoise(1.0, share, time)
    # Averages over some hundred coefficients each.
    spectra = truth.density(frequency, 5e-3) * rng.chisquare(400, len(frequency)) / 400
    found = bands.sensor_noise(spectra, np.full(len(frequency), 400.0), frequency, 5e-3, 1.0)
    if share == 0.0:
        assert found.share == 0.0
    else:
        assert found.share == pytest.approx(share, abs=0.15)
        assert found.deviation == pytest.approx(1.0, abs=0.15)
        assert found.time == pytest.approx(time, rel=0.5)


@pytest.mark.parametrize(("time", "told"), [(0.15, True), (0.4, False)])
def test_what_is_as_slow_as_an_arm_is_no_colour_of_a_sensor(time: float, told: bool) -> None:
    """What slips leaves errors of some tenths of a second in all channels alike, and hid as a colour of 0.26 s."""
    rng = np.random.default_rng(8)
    frequency = np.geomspace(0.5, 20.0, 59)
    spectra = bands.SensorNoise(1.0, 0.9, time).density(frequency, 2e-2) * rng.chisquare(400, len(frequency)) / 400
    found = bands.sensor_noise(spectra, np.full(len(frequency), 400.0), frequency, 2e-2, 0.4)
    assert (found.share > 0.0) is told
    assert found.deviation == pytest.approx(1.0 if told else 0.4, rel=0.1)


def test_a_gap_a_hundred_times_the_noise_counts_alike_where_every_fourth_reading_is_missing() -> None:
    # A zero in each place would be a spike as high as the gap.
    rng = np.random.default_rng(8)
    time = 0.03 * np.arange(800)
    gap = np.column_stack([1e-2 * np.sin(2 * np.pi * 0.1 * time), 5e-3 * np.cos(2 * np.pi * 0.2 * time)])
    measured = record(gap + 1e-4 * rng.standard_normal(gap.shape), 0.03, 1e-4)
    model = bands.noise_model([measured], [[]])
    holed = replace(measured, usable=rng.random(gap.shape) > 0.25)
    whole, in_part = (
        Residuals((r.noise,), np.inf, {Window(0, 0, 800): bands.Whitener(r, model)}).white(
            Window(0, 0, 800), r.measured, r.usable
        )
        for r in (measured, holed)
    )
    assert np.sum(whole**2) > 1e3 * whole.size
    assert np.sum(in_part**2) == pytest.approx(np.sum(whole**2), rel=0.01)
    fast = [np.sum((rows[1:] - rows[:-1]) ** 2) for rows in (whole, in_part)]
    assert fast[1] < 1.1 * fast[0]


def test_what_was_not_read_is_on_the_line_between_readings_and_the_next_one_at_the_ends() -> None:
    values = np.array([[9.0, 1.0], [2.0, 9.0], [9.0, 9.0], [9.0, 4.0], [5.0, 9.0], [9.0, 9.0]])
    read = np.array([[0, 1], [1, 0], [0, 0], [0, 1], [1, 0], [0, 0]], dtype=bool)
    wanted = np.array([[2.0, 1.0], [2.0, 2.0], [3.0, 3.0], [4.0, 4.0], [5.0, 4.0], [5.0, 4.0]])
    np.testing.assert_allclose(bands.on_lines(values, read), wanted)
    np.testing.assert_allclose(bands.on_lines(values[..., None], read)[..., 0], wanted)
    np.testing.assert_array_equal(bands.on_lines(values, np.zeros_like(read)), values)
