import numpy as np
import pytest

from bha.diagnose import records


def test_noise_of_a_moving_channel_is_found_within_three_per_cent() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(6000) * 5e-3
    motion = 0.05 * np.sin(2 * np.pi * 0.7 * time) + np.where(time % 3.0 < 1.5, 0.02, 0.0)
    found = records.third_difference_noise(motion + 2e-4 * rng.standard_normal(len(time)))
    assert found == pytest.approx(2e-4, rel=0.03)


def test_quantum_is_that_of_the_grid() -> None:
    rng = np.random.default_rng(2)
    values = np.round((0.2 + 0.01 * rng.standard_normal(2000)) / 5e-5) * 5e-5
    assert records.quantum(values) == pytest.approx(5e-5, rel=1e-6)
    assert records.quantum(rng.standard_normal(2000)) == 0.0


def test_a_frozen_sensor_is_found_and_a_stepwise_command_is_not() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(4000) * 0.01
    values = 1e5 + 100.0 * rng.standard_normal(len(time))
    values[1000:2000] = values[1000]
    assert records.frozen_intervals(time, values) == ((pytest.approx(10.0), pytest.approx(20.0)),)
    command = np.repeat(rng.uniform(1e5, 2e5, 40), 100)
    assert records.frozen_intervals(time, command) == ()


def test_sample_and_hold_is_told_from_chance_repeats() -> None:
    rng = np.random.default_rng(4)
    held = np.repeat(rng.standard_normal(800), 4)
    facts = records.channel_facts(np.arange(3200) * 0.01, "x1", "m", held)
    assert facts.held == pytest.approx(0.75, abs=0.01)
    assert facts.noise == pytest.approx(1.0, rel=0.15)
    noise = np.round(2e-4 * rng.standard_normal(4000) / 5e-5) * 5e-5
    assert records.channel_facts(np.arange(4000) * 5e-3, "q11", "m", noise).held == 0.0
