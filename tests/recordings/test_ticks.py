"""A camera in a faster log: told by its clock, on any grid; and what must not be taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from bha.recordings import samples, together
from bha.recordings.ticks import ticks

Array = np.ndarray


def moves(seconds: float, rate: float, *, level: float = 0.04) -> tuple[Array, Array]:
    """Steps of an overdamped arm every two seconds, m."""
    time = np.arange(round(seconds * rate)) / rate
    levels = np.where((time / 2.0).astype(int) % 2 == 0, 0.0, level)
    motion = np.zeros(len(time))
    for k in range(1, len(time)):
        motion[k] = motion[k - 1] + (levels[k] - motion[k - 1]) / (0.2 * rate)
    return time, 0.2 + motion


def by_a_camera(values: Array, noise: float, grid: float, *, every: float, seed: int = 1) -> Array:
    """What a camera that renews every so many rows shows of values, held in between."""
    rng = np.random.default_rng(seed)
    frame = (np.arange(len(values)) / every + 1e-9).astype(int)
    first = np.flatnonzero(np.diff(frame, prepend=-1))
    seen = np.round((values[first] + noise * rng.standard_normal(len(first))) / grid) * grid
    return np.asarray(seen[frame])


@pytest.mark.parametrize("grid", [1e-5, 2e-4, 1e-3, 2e-3])
@pytest.mark.parametrize("every", [200.0 / 60.0, 200.0 / 30.0, 20.0])
def test_a_slower_camera_is_told_on_any_grid(grid: float, every: float) -> None:
    time, motion = moves(60.0, 200.0)
    facts, usable = samples.judge(time, "x1", "m", by_a_camera(motion, 3e-4, grid, every=every))
    assert usable.sum() == pytest.approx(len(time) / every, rel=0.01)
    assert facts.held == pytest.approx(1.0 - 1.0 / every, abs=0.01)
    if every < 10.0 and grid < 2e-3:
        assert facts.noise == pytest.approx(np.hypot(3e-4, grid / np.sqrt(12.0)), rel=0.35)
    assert not facts.dropouts


def test_rest_counts_at_the_cameras_rate_where_every_reading_is_the_same() -> None:
    time, motion = moves(60.0, 200.0)
    facts, usable = samples.judge(time, "x1", "m", by_a_camera(motion, 3e-5, 1e-3, every=200.0 / 30.0))
    resting = (time > 1.5) & (time < 2.0)
    assert usable[resting].sum() == pytest.approx(15, abs=1)
    assert facts.interval == pytest.approx(1.0 / 30.0, rel=0.02)


def test_what_is_no_clock() -> None:
    rng = np.random.default_rng(3)
    time, motion = moves(60.0, 200.0)
    coarse = np.round((motion + 3e-4 * rng.standard_normal(len(motion))) / 1e-3) * 1e-3
    quiet = np.round(motion / 1e-3) * 1e-3
    ramp = np.round((0.1 + 0.3 * time / time[-1]) / 1e-3) * 1e-3
    scattered = np.repeat(coarse[::5], rng.integers(3, 10, len(coarse[::5])))[: len(time)]
    for values in (coarse, quiet, ramp, scattered):
        fresh = np.flatnonzero(samples.changes(values))
        assert ticks(time[: len(values)], fresh, values, 1e-3) is None


def test_a_spike_of_a_coarse_camera_is_one_reading() -> None:
    time, motion = moves(60.0, 200.0)
    values = by_a_camera(motion, 3e-4, 1e-3, every=200.0 / 30.0)
    frame = (np.arange(len(time)) / (200.0 / 30.0) + 1e-9).astype(int)
    values[frame == 340] += 0.03
    facts, usable = samples.judge(time, "x1", "m", values)
    assert facts.spikes == (pytest.approx(340 / 30.0, abs=5e-3),)
    assert not usable[frame == 340].any()


def test_a_coarse_camera_that_hangs_and_jumps_home() -> None:
    time, motion = moves(60.0, 200.0)
    axes = [motion, 0.5 * motion, 0.25 * motion]
    values = np.column_stack([by_a_camera(a, 3e-4, 1e-3, every=200.0 / 30.0, seed=k) for k, a in enumerate(axes)])
    hangs = (time > 21.8) & (time < 23.2)
    values[hangs] = values[np.flatnonzero(hangs)[0]]
    judged = [samples.judge(time, f"{a}1", "m", c) for a, c in zip("xyz", values.T, strict=True)]
    found = together.held_together(time, values, together.stopped_together(time, values, judged))
    facts, usable = found[0]
    # Readings that happened to be the same just before it are one with it.
    assert facts.dropouts == ((pytest.approx(21.8, abs=0.3), pytest.approx(23.2, abs=0.06)),)
    assert not usable[(time > 21.9) & (time < 23.1)].any()
    assert all(usable[(time > 20.5) & (time < 21.5)].sum() >= 25 for _, usable in found)


def test_two_cameras_hang_by_themselves() -> None:
    time, motion = moves(60.0, 200.0)
    one = [by_a_camera(motion, 3e-4, 1e-5, every=200.0 / 30.0, seed=k) for k in range(3)]
    other = [by_a_camera(motion, 3e-4, 1e-5, every=20.0, seed=k + 9) for k in range(3)]
    values = np.column_stack([*one, *other])
    hangs = (time > 30.0) & (time < 31.0)
    values[hangs, :3] = values[np.flatnonzero(hangs)[0], :3]
    judged = [
        samples.judge(time, f"{a}{k}", "m", values[:, 3 * (k - 1) + i]) for k in (1, 2) for i, a in enumerate("xyz")
    ]
    found = together.held_together(time, values, judged)
    assert [len(facts.dropouts) for facts, _ in found] == [1, 1, 1, 0, 0, 0]


def test_what_no_reading_of_counts_is_left_as_it_is() -> None:
    time, motion = moves(10.0, 200.0)
    values = np.column_stack([by_a_camera(motion, 3e-4, 1e-5, every=20.0, seed=k) for k in range(2)])
    judged = [samples.judge(time, f"{a}1", "m", c) for a, c in zip("xy", values.T, strict=True)]
    none = [(facts, np.zeros_like(usable)) for facts, usable in judged]
    for found in (together.held_together(time, values, none), together.stopped_together(time, values, none)):
        assert not any(usable.any() for _, usable in found)


def test_a_logger_that_stops_leaves_a_slower_camera_its_own_rows() -> None:
    """Dense coarse lengths and a camera hang at once; what rests before counts as often as each is read."""
    time, motion = moves(60.0, 200.0)
    length = np.round(motion / 1e-3) * 1e-3
    camera = by_a_camera(motion, 3e-5, 1e-3, every=200.0 / 30.0)
    shivers = 0.2 + 1e-3 * (np.arange(len(time)) % 7 == 0)
    seen = by_a_camera(motion, 2e-3, 1e-3, every=200.0 / 30.0)
    values = np.column_stack([length, camera, shivers, seen])
    hangs = (time > 21.8) & (time < 22.6)
    values[hangs] = values[np.flatnonzero(hangs)[0]]
    judged = [samples.judge(time, name, "m", c) for name, c in zip(("q11", "x1", "q12", "y1"), values.T, strict=True)]
    assert [facts.held > 0.0 for facts, _ in judged] == [False, True, False, True]
    assert judged[0][0].dropouts[0][1] == judged[1][0].dropouts[0][1]
    found = together.stopped_together(time, values, judged)
    assert found[0][1].sum() > judged[0][1].sum() + 150
    assert judged[1][1].sum() + 20 < found[1][1].sum() < judged[1][1].sum() + 35


def test_a_channel_that_moves_by_a_step_at_a_time_has_the_clock_of_its_camera() -> None:
    time, motion = moves(60.0, 200.0)
    every = 200.0 / 30.0
    little = 0.2 + 0.03 * (motion - 0.2)
    columns = [
        by_a_camera(m, n, 1e-3, every=every, seed=k) for k, (m, n) in enumerate([(motion, 3e-4), (little, 2e-4)])
    ]
    elsewhere = np.round((little + 2e-4 * np.random.default_rng(5).standard_normal(len(time))) / 1e-3) * 1e-3
    values = np.column_stack([*columns, elsewhere])
    judged = [samples.judge(time, f"{axis}1", "m", column) for axis, column in zip("xyz", values.T, strict=True)]
    assert [facts.held > 0.0 for facts, _ in judged] == [True, False, False]
    found = together.on_one_clock(time, values, judged)
    assert [facts.held > 0.0 for facts, _ in found] == [True, True, False]
    assert found[2] is judged[2]
    facts, usable = found[1]
    assert facts.interval == pytest.approx(1.0 / 30.0, rel=0.02)
    assert usable.sum() == pytest.approx(1800, abs=5)
    # Each reading counts from the row in which it came.
    frame = (np.arange(len(time)) / every + 1e-9).astype(int)
    first = np.flatnonzero(np.diff(frame, prepend=-1))
    changed = np.flatnonzero(np.diff(values[:, 1]) != 0.0) + 1
    assert set(changed) <= set(np.flatnonzero(usable)) & set(first)
