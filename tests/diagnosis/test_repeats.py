from dataclasses import replace

import numpy as np
import pytest

from bha.diagnosis.repeats import repeats, with_repeat_noise
from bha.estimation.bands import Whitener, noise_model
from bha.estimation.records import Record

from .synthetic import record_of

SAMPLE_TIME, ROWS = 0.02, 3000
SENSOR, WANDER = 1e-4, 1e-3


def steps(time: np.ndarray) -> np.ndarray:
    return 1.2e5 + 5e4 * np.column_stack([np.sin(0.7 * time) > 0.0, np.sin(0.4 * time) > 0.3, np.cos(time) > 0.0])


def log(rng: np.random.Generator, name: str, *, late: float = 0.0, pressures: np.ndarray | None = None) -> Record:
    """A log of an arm that answers to its inputs and wanders besides, as it does not wander again."""
    time = np.arange(ROWS) * SAMPLE_TIME
    clock = time - late
    common = np.column_stack([np.sin(0.7 * clock + k) for k in range(3)]) * 0.03
    drift = np.empty((ROWS, 3))
    drift[0] = WANDER * rng.standard_normal(3)
    keep = np.exp(-SAMPLE_TIME / 0.5)
    for k in range(1, ROWS):
        drift[k] = keep * drift[k - 1] + WANDER * np.sqrt(1.0 - keep**2) * rng.standard_normal(3)
    outputs = common + drift + SENSOR * rng.standard_normal((ROWS, 3))
    return record_of(time, outputs, steps(clock) if pressures is None else pressures, SENSOR, name=name)


def test_logs_with_the_same_inputs_are_found_whatever_their_clocks() -> None:
    rng = np.random.default_rng(3)
    first, second, late = log(rng, "a"), log(rng, "b"), log(rng, "c", late=0.83)
    other = log(rng, "d", pressures=steps(1.7 * first.time))
    found = repeats([first, other, second, late])
    assert [r.names for r in found] == [("a", "b"), ("a", "c"), ("b", "c")]
    for repeat in found:
        # Half the power of a difference belongs to each log; the motion they share is gone.
        assert repeat.rms == pytest.approx(np.hypot(SENSOR, WANDER), rel=0.15)


def test_constant_pressures_make_no_repeats() -> None:
    rng = np.random.default_rng(4)
    still = np.full((ROWS, 3), 1.3e5)
    assert repeats([log(rng, "a", pressures=still), log(rng, "b", pressures=still)]) == []
    noisy = [log(rng, n, pressures=still + 200.0 * rng.standard_normal((ROWS, 3))) for n in "ab"]
    noisy = [replace(r, pressure_facts=tuple(replace(f, noise=200.0) for f in r.pressure_facts)) for r in noisy]
    assert repeats(noisy) == []


def test_what_an_arm_does_otherwise_each_time_is_white_noise_of_the_model() -> None:
    rng = np.random.default_rng(5)
    plain = [log(rng, name) for name in "abc"]
    records = with_repeat_noise(plain, repeats(plain))
    model = noise_model(records, [[] for _ in records])
    assert model.floor == pytest.approx(np.full(3, np.hypot(SENSOR, WANDER)), rel=0.15)
    others = [log(rng, f"new {k}") for k in range(8)]
    right = np.column_stack([np.sin(0.7 * others[0].time + k) for k in range(3)]) * 0.03
    squares = [np.mean(Whitener(r, model)(r.measured - right) ** 2) for r in others]
    assert np.mean(squares) == pytest.approx(1.0, abs=0.15)
    # By the noise of the sensors alone the same error would be a gap.
    sensors = noise_model(plain, [[] for _ in plain])
    assert np.mean(Whitener(others[0], sensors)(others[0].measured - right) ** 2) > 50.0
