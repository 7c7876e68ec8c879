"""A logger that has stopped holds all channels at once."""

from __future__ import annotations

import numpy as np
import pytest

from bha.recordings import samples, together


def test_a_logger_that_has_stopped_stops_all_channels_and_no_rest_before_is_lost() -> None:
    time, grid = np.arange(2000) * 0.02, 1e-3
    levels = np.repeat(0.03 * (np.arange(8) % 2), 250)
    motion = np.zeros(2000)
    for k in range(1, 2000):
        motion[k] = motion[k - 1] + 0.02 / 0.35 * (levels[k] - motion[k - 1])
    # The second moves too little for a jump; the third shivers on its grid until the logger stops.
    shiver = grid * (np.arange(2000) % 7 == 0)
    values = np.column_stack([np.round((part * motion + 0.2) / grid) * grid for part in (1.0, 0.06, 0.0)])
    values[:, 2] += shiver
    values[740:790] = values[740]
    judged = [samples.judge(time, f"q1{k + 1}", "m", values[:, k]) for k in range(3)]
    assert [len(facts.dropouts) for facts, _ in judged] == [1, 0, 0]
    found = together.stopped_together(time, values, judged)
    for facts, usable in found:
        assert facts.dropouts == ((pytest.approx(14.8, abs=0.15), pytest.approx(15.8)),)
        assert not usable[742:790].any()
    for _, usable in found[:2]:
        assert usable[:736].all()
        assert usable[790:].all()
    # Alone it is one sensor.
    alone = values[:, :1]
    assert together.stopped_together(time, alone, judged[:1])[0][0].dropouts[0][1] == pytest.approx(15.8)


def moving(rows: int, interval: float) -> tuple[np.ndarray, np.ndarray]:
    """Three channels of a moving arm with 0.13 mm of noise on a grid of 0.01 mm."""
    random = np.random.default_rng(3)
    time = np.arange(rows) * interval
    motion = np.column_stack([0.03 * np.sin(0.9 * time + k) for k in range(3)])
    return time, np.round((motion + 1.3e-4 * random.standard_normal(motion.shape)) / 1e-5) * 1e-5


def judged_alone(time: np.ndarray, values: np.ndarray) -> list[tuple[samples.ChannelFacts, np.ndarray]]:
    """Each channel by itself."""
    return [samples.judge(time, f"{axis}1", "m", column) for axis, column in zip("xyz", values.T, strict=True)]


def test_a_camera_that_holds_two_frames_at_ten_hertz_is_told_by_all_its_channels() -> None:
    time, values = moving(150, 0.1)
    values[61:63] = values[60]
    alone = judged_alone(time, values)
    assert not any(facts.dropouts for facts, _ in alone)
    for facts, usable in together.held_together(time, values, alone):
        assert facts.dropouts == ((pytest.approx(6.1), pytest.approx(6.3)),)
        assert not usable[61:63].any()
        assert usable[:61].all()
        assert usable[63:].all()


def test_what_noise_repeats_or_a_resting_arm_does_is_no_dropout() -> None:
    time, values = moving(150, 0.1)
    # One channel alone, by chance.
    values[61:63, 0] = values[60, 0]
    for facts, usable in together.held_together(time, values, judged_alone(time, values)):
        assert not facts.dropouts
        assert usable.all()
    # Without noise, or with a coarse grid, an arm that stands repeats itself in all channels.
    for grid in (1e-9, 1e-3):
        still = np.column_stack([0.03 * np.sin(0.9 * np.clip(time, 5.0, 9.0) + k) for k in range(3)])
        still = np.round(still / grid) * grid
        for facts, usable in together.held_together(time, still, judged_alone(time, still)):
            assert not facts.dropouts
            assert usable.all()


def test_a_channel_that_had_stopped_before_the_logger_did_has_one_dropout() -> None:
    time, values = moving(3000, 0.02)
    values[1000:1100, 0] = values[1000, 0]
    values[1060:1120] = values[1060]
    alone = judged_alone(time, values)
    assert [len(facts.dropouts) for facts, _ in alone] == [1, 1, 1]
    for k, (facts, usable) in enumerate(together.held_together(time, values, alone)):
        first = 1001 if k == 0 else 1061
        assert facts.dropouts == ((pytest.approx(time[first]), pytest.approx(time[1120])),)
        assert not usable[first:1120].any()
        assert usable[:first].all()
        assert usable[1120:].all()
