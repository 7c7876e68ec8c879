"""Batches: every member as simulated alone, whatever the threads; failures keep their place."""

from __future__ import annotations

import signal
import threading
import time
import warnings

import numpy as np
import pytest

import bha
from bha import _core

LANES = [name for name in _core.instruction_sets() if name != "scalar"]


@pytest.fixture(scope="module")
def arm() -> bha.Arm:
    return bha.robots.load("bha_nominal")


def rests(arm: bha.Arm, count: int, seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(count):
        pressures = 101_325.0 + rng.uniform(0.0, 0.6e5, len(arm.inputs))
        rows.append(np.concatenate([arm.static_lengths(pressures), np.zeros(3 * arm.section_count)]))
    return np.array(rows)


def drive(arm: bha.Arm, seed: int = 0) -> bha.Input:
    rng = np.random.default_rng(seed)
    return bha.Input(np.linspace(0.0, 0.2, 5), 101_325.0 + rng.uniform(0.0, 0.8e5, (5, len(arm.inputs))))


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_members_are_as_simulated_alone(arm: bha.Arm, method: str) -> None:
    arms = [arm, arm.with_changes(gravity=(1.0, 0.0, 9.0)), arm]
    inputs = [drive(arm, seed) for seed in range(3)]
    states = rests(arm, 3)
    times = np.linspace(0.0, 0.2, 21)
    batch = bha.simulate_batch(arms, inputs, states, times=times, method=method, head_positions=True)
    n = 3 * arm.section_count
    for k in range(3):
        options = bha.Options(method=method)
        alone = bha.Simulation(arms[k], inputs[k], options, q0=states[k, :n], qd0=states[k, n:]).advance(times)
        np.testing.assert_allclose(batch.lengths[k], alone.lengths, rtol=1e-12)
        np.testing.assert_allclose(batch.velocities[k], alone.velocities, rtol=0, atol=1e-12)
        np.testing.assert_allclose(batch.head_positions[k], alone.head_positions, rtol=0, atol=1e-13)
    assert batch.succeeded.all()


def test_windows_of_one_input(arm: bha.Arm) -> None:
    """Each member from its own time and state on; rows beyond a window's end are NaN and no failure."""
    source = drive(arm)
    whole = bha.simulate(arm, source, dt=0.01, method="rk4")
    states = np.hstack([whole.lengths, whole.velocities])
    times = np.array([[0.05, 0.07, 0.10], [0.10, 0.14, np.nan]])
    batch = bha.simulate_batch(arm, source, states[[5, 10]], times=times, start=[0.05, 0.10], method="rk4")
    np.testing.assert_allclose(batch.lengths[0], whole.lengths[[5, 7, 10]], rtol=1e-10)
    np.testing.assert_allclose(batch.lengths[1, :2], whole.lengths[[10, 14]], rtol=1e-10)
    assert np.isnan(batch.lengths[1, 2]).all()
    assert batch.succeeded.all()


@pytest.mark.parametrize("instruction_set", LANES)
@pytest.mark.parametrize("interpolation", ["linear", "hold"])
def test_lanes_agree_with_single_members(arm: bha.Arm, instruction_set: str, interpolation: str) -> None:
    """Arms, inputs, states and starts that differ lane by lane, and numbers of members that fill no block."""
    rng = np.random.default_rng(5)
    count = 11
    arms = [arm.with_changes(gravity=rng.uniform(-9.0, 9.0, 3)) for _ in range(count)]
    pressures = 101_325.0 + rng.uniform(0.0, 0.8e5, (50, len(arm.inputs)))
    forces = rng.uniform(-1.0, 1.0, (50, arm.section_count, 3))
    shared = bha.Input(np.linspace(0.0, 0.5, 50), pressures, forces)
    inputs = [shared if k % 3 else bha.Input(shared.time, pressures[::-1], forces) for k in range(count)]
    start = rng.uniform(0.0, 0.1, count).round(3)
    start[3:6] = 0.05
    times = start[:, None] + np.array([0.0, 0.01, 0.013, 0.1])
    states = rests(arm, count)
    states[:, 9:] = rng.uniform(-0.1, 0.1, (count, 9))
    arguments = {
        "times": times,
        "start": start,
        "interpolation": interpolation,
        "head_positions": True,
        "method": "rk4",
    }
    alone = bha.simulate_batch(arms, inputs, states, instruction_set="scalar", **arguments)
    abreast = bha.simulate_batch(arms, inputs, states, instruction_set=instruction_set, **arguments)
    assert alone.succeeded.all()
    assert abreast.succeeded.all()
    np.testing.assert_array_equal(abreast.statistics, alone.statistics)
    for name in ("lengths", "velocities", "head_positions"):
        one, other = getattr(alone, name), getattr(abreast, name)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-12 * np.abs(one).max(), err_msg=name)


PRESSURE_EFFECTS = {
    "lag": [{"kind": "pressure_lag", "where": "all", "fill": 0.02, "vent": 0.05}],
    "delay": [{"kind": "delay", "where": "all", "time": 0.011}, {"kind": "delay", "where": "input p12", "time": 0.004}],
    "dead band": [{"kind": "valve_dead_band", "where": "all", "band": 2e3}],
    "gain, offset": [
        {"kind": "pressure_gain", "where": "all", "gain": 0.03},
        {"kind": "pressure_offset", "where": "input p21", "offset": -500.0},
    ],
    "chain": [
        {"kind": "delay", "where": "input p11", "time": 0.007},
        {"kind": "pressure_gain", "where": "input p13", "gain": -0.02},
        {"kind": "valve_dead_band", "where": "section 2", "band": 1e3},
        {"kind": "pressure_lag", "where": "all", "fill": 0.03, "vent": 0.02},
        {"kind": "pressure_lag", "where": "input p31", "fill": 0.004, "vent": 0.1},
    ],
}


@pytest.mark.parametrize("instruction_set", LANES)
@pytest.mark.parametrize("pneumatics", ["ideal", "full"])
@pytest.mark.parametrize("effects", PRESSURE_EFFECTS)
def test_effects_on_pressures_abreast(arm: bha.Arm, effects: str, pneumatics: str, instruction_set: str) -> None:
    """Every lane goes through the samples of its own input: at times of their own, from starts of their own."""
    arm = arm.with_changes(pneumatics=pneumatics).with_effects(PRESSURE_EFFECTS[effects])
    rng = np.random.default_rng(7)
    count = 11
    inputs = []
    for k in range(count):
        time = np.sort(rng.uniform(0.0, 0.12, 20 + k))
        inputs.append(bha.Input(time, 101_325.0 + rng.uniform(0.0, 0.8e5, (time.size, 9))))
    start = rng.uniform(0.0, 0.05, count)
    arguments = {"times": start[:, None] + np.array([0.0, 0.003, 0.05]), "start": start, "method": "rk4"}
    alone = bha.simulate_batch(arm, inputs, rests(arm, count), instruction_set="scalar", **arguments)
    abreast = bha.simulate_batch(arm, inputs, rests(arm, count), instruction_set=instruction_set, **arguments)
    assert alone.succeeded.all()
    assert abreast.succeeded.all()
    for name in ("lengths", "velocities"):
        one, other = getattr(alone, name), getattr(abreast, name)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-12 * np.abs(one).max(), err_msg=name)


@pytest.mark.parametrize("instruction_set", LANES)
@pytest.mark.parametrize("effects", [(), PRESSURE_EFFECTS["delay"], PRESSURE_EFFECTS["lag"]])
def test_different_steps_at_the_same_times_abreast(arm: bha.Arm, effects: list, instruction_set: str) -> None:
    """Held commands that jump together: steps end there, and at the delayed jumps too."""
    arm = arm.with_effects(effects)
    rng = np.random.default_rng(8)
    time = np.array([0.0, 0.0123, 0.04])
    inputs = [bha.Input(time, 101_325.0 + rng.uniform(0.0, 0.8e5, (3, 9))) for _ in range(9)]
    arguments = {"times": [0.0, 0.02, 0.07], "interpolation": "hold", "method": "rk4"}
    alone = bha.simulate_batch(arm, inputs, rests(arm, 9), instruction_set="scalar", **arguments)
    abreast = bha.simulate_batch(arm, inputs, rests(arm, 9), instruction_set=instruction_set, **arguments)
    np.testing.assert_array_equal(abreast.statistics, alone.statistics)
    for name in ("lengths", "velocities"):
        one, other = getattr(alone, name), getattr(abreast, name)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-12 * np.abs(one).max(), err_msg=name)


@pytest.mark.parametrize("instruction_set", LANES)
def test_a_diverged_lane_disturbs_nobody(arm: bha.Arm, instruction_set: str) -> None:
    states = rests(arm, 9)
    states[[0, 5, 8], 9:] = [40.0, -40.0, 40.0] * 3
    states[5, 9:] *= 1e150
    arguments = {"times": np.linspace(0.0, 0.1, 11), "method": "rk4"}
    alone = bha.simulate_batch(arm, drive(arm), states, instruction_set="scalar", **arguments)
    abreast = bha.simulate_batch(arm, drive(arm), states, instruction_set=instruction_set, **arguments)
    assert list(abreast.succeeded) == [k not in {0, 5, 8} for k in range(9)]
    np.testing.assert_array_equal(np.isnan(abreast.lengths), np.isnan(alone.lengths))
    for one, other in zip(alone.failures, abreast.failures, strict=True):
        assert str(one) == str(other)
    good = alone.succeeded
    np.testing.assert_allclose(abreast.lengths[good], alone.lengths[good], rtol=1e-12)


def test_independent_of_threads(arm: bha.Arm) -> None:
    arguments = {"x0": rests(arm, 13), "times": np.linspace(0.0, 0.1, 6)}
    results = [bha.simulate_batch(arm, drive(arm), threads=t, **arguments) for t in (1, 2, 3)]
    for other in results[1:]:
        np.testing.assert_array_equal(results[0].lengths, other.lengths)
        np.testing.assert_array_equal(results[0].velocities, other.velocities)


def test_a_failed_member_keeps_its_place(arm: bha.Arm) -> None:
    """One of them starts so fast that it diverges."""
    states = rests(arm, 9)
    times = np.linspace(0.0, 0.1, 11)
    good = bha.simulate_batch(arm, drive(arm), np.delete(states, 4, axis=0), times=times, method="rk4")
    states[4, 9:] = [40.0, -40.0, 40.0] * 3
    batch = bha.simulate_batch(arm, drive(arm), states, times=times, method="rk4")
    assert list(batch.succeeded) == [k != 4 for k in range(9)]
    failure = batch.failures[4]
    assert isinstance(failure, bha.SimulationError)
    reached = times <= failure.time
    assert reached.any()
    assert not reached.all()
    assert np.isfinite(batch.lengths[4, reached]).all()
    assert np.isnan(batch.lengths[4, ~reached]).all()
    np.testing.assert_allclose(np.delete(batch.lengths, 4, axis=0), good.lengths, rtol=1e-12)
    assert repr(batch) == "<Batch: 9 members, 1 failed, 11 rows, 3 sections>"


def test_no_rest_is_a_status(arm: bha.Arm) -> None:
    impossible = bha.Input.constant([1e12] * len(arm.inputs), 0.1)
    batch = bha.simulate_batch(arm, [drive(arm), impossible], times=[0.0, 0.1])
    assert list(batch.succeeded) == [True, False]
    assert np.isnan(batch.lengths[1]).all()
    assert isinstance(batch.failures[1], bha.ConvergenceError)


def test_interrupt(arm: bha.Arm) -> None:
    """Ctrl-C ends a batch that would take minutes."""
    timer = threading.Timer(0.3, lambda: signal.raise_signal(signal.SIGINT))
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            bha.simulate_batch(arm, bha.Input.constant([101_325.0] * 9, 1e4), rests(arm, 4), times=[1e4])
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, handler)


def test_an_error_in_progress_comes_back_as_itself(arm: bha.Arm) -> None:
    error = RuntimeError("enough")

    def progress(_: float) -> None:
        raise error

    started = time.monotonic()
    with pytest.raises(RuntimeError) as caught:
        bha.simulate_batch(arm, bha.Input.constant([101_325.0] * 9, 1e4), times=[1e4], progress=progress)
    assert caught.value is error
    assert time.monotonic() - started < 30.0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"times": [0.1, 0.0]}, "member 0: output times must be finite, ascend"),
        ({"times": [[0.0, np.nan, 0.1]]}, "NaN is allowed at a row's end only"),
        ({"start": np.zeros(2), "x0": np.zeros((3, 18))}, "numbers of members differ: .* x0 3, start 2"),
        ({"x0": np.zeros(17)}, r"x0: expected shape \(1, 18\), found \[1, 17\]"),
        ({"x0": np.full(18, np.nan)}, "x0: element 0 is NaN"),
        ({"threads": 0}, "threads: 0; at least 1"),
        ({"step": 0.0}, "step: 0; a positive number"),
        ({"inputs": []}, "at least one of each"),
        ({"instruction_set": "mmx"}, 'instruction_set: "mmx"; this processor has scalar'),
    ],
)
def test_wrong_arguments(arm: bha.Arm, changes: dict, text: str) -> None:
    arguments = {"inputs": drive(arm), **changes}
    with pytest.raises(bha.InputError, match=text):
        bha.simulate_batch(arm, **arguments)


def test_measured_pressures_go_past_the_pneumatics_as_in_single_runs() -> None:
    arm = bha.robots.load("bha_nominal").with_changes(pneumatics="full")
    time, pressures = np.array([0.0, 0.1, 0.3]), np.repeat([[1.1e5], [1.4e5], [1.4e5]], 9, axis=1)
    drives = [bha.Input(time, pressures, None, commanded) for commanded in (True, False)]
    batch = bha.simulate_batch(arm, drives, times=[0.0, 0.3], method="rk4")
    for member, drive in enumerate(drives):
        alone = bha.Simulation(arm, drive, bha.Options("rk4")).advance([0.0, 0.3])
        np.testing.assert_allclose(batch.lengths[member], alone.lengths, rtol=0, atol=1e-12)
    assert np.abs(batch.lengths[0] - batch.lengths[1]).max() > 1e-3


def test_a_line_says_what_it_is(arm: bha.Arm) -> None:
    batch = bha.simulate_batch(arm, [drive(arm, 0), drive(arm, 1)])
    assert repr(batch) == "<Batch: 2 members, 0 failed, 5 rows, 3 sections>"


def stiff() -> bha.Arm:
    return bha.robots.load("asu_two_section_january")


def stiff_drive(arm: bha.Arm, seed: int = 4) -> bha.Input:
    t = np.arange(0.0, 0.6, 0.01)
    p = 1.1e5 + 4e4 * np.sin(np.multiply.outer(t, 3.0 + np.arange(len(arm.inputs)))) ** 2
    return bha.Input(t, p + np.random.default_rng(seed).normal(0.0, 50.0, p.shape))


@pytest.mark.parametrize("instruction_set", LANES)
@pytest.mark.parametrize("which", ["nominal", "stiff", "stiff with effects", "lag", "full"])
def test_adaptive_members_abreast(arm: bha.Arm, which: str, instruction_set: str) -> None:
    """By default each as alone to the tolerance; with shared steps as the first one's steps make them, to rounding."""
    effects = [
        {"kind": "hysteresis", "where": "all", "amplitude": 3.0, "yield": 2e-3},
        {"kind": "creep", "where": "all", "stiffness": 400.0, "tau": 0.3},
        {"kind": "pressure_lag", "where": "all", "fill": 0.05, "vent": 0.1},
    ]
    chosen = stiff() if "stiff" in which else arm
    if "effects" in which:
        chosen = chosen.with_effects(effects)
    if which in ("lag", "full"):
        chosen = chosen.with_changes(pneumatics=which)
    source, count = stiff_drive(chosen), 11
    arms = [chosen.with_changes(gravity=(0.01 * k, 0.0, 9.81)) for k in range(count)]
    times = np.linspace(0.0, 0.5, 26)
    abreast = bha.simulate_batch(arms, source, times=times, instruction_set=instruction_set)
    assert abreast.succeeded.all()
    tolerance = 2e-5 if which in ("full", "stiff with effects") else 2e-6
    for k in (0, 10):
        alone = bha.simulate(arms[k], source, times=times)
        np.testing.assert_allclose(abreast.lengths[k], alone.lengths, rtol=0, atol=tolerance)
    one, other = (
        bha.simulate_batch(arms, source, times=times, instruction_set=name, shared_steps=True)
        for name in ("scalar", instruction_set)
    )
    np.testing.assert_array_equal(one.statistics[:, 0], other.statistics[0, 0])
    np.testing.assert_allclose(one.lengths, other.lengths, rtol=0, atol=1e-10)
    np.testing.assert_allclose(one.lengths[0], bha.simulate(arms[0], source, times=times).lengths, rtol=0, atol=1e-12)


@pytest.mark.parametrize("instruction_set", ["scalar", *LANES[-1:]])
def test_shared_steps_are_no_noise_in_a_difference(instruction_set: str) -> None:
    """Members that differ by less and less: their difference by the parameter converges, over several blocks."""
    chosen = stiff()
    source = stiff_drive(chosen)
    steps = 10.0 ** np.arange(-6, -1)
    arms = [chosen] + [chosen.with_changes(gravity=(0.0, 0.0, 9.81 + h)) for h in np.repeat(steps, 4)]
    batch = bha.simulate_batch(arms, source, times=[0.0, 0.5], shared_steps=True, instruction_set=instruction_set)
    slopes = (batch.lengths[1:, -1] - batch.lengths[0, -1]) / np.repeat(steps, 4)[:, None]
    np.testing.assert_allclose(
        slopes, np.broadcast_to(slopes[12], slopes.shape), rtol=0, atol=1e-4 * np.abs(slopes).max()
    )


@pytest.mark.parametrize("method", ["auto", "rodas4"])
def test_a_lane_that_needs_steps_too_short_is_left_behind(arm: bha.Arm, method: str) -> None:
    """Its member fails; the others go on as they would without it."""
    states = rests(arm, 9)
    states[[0, 5], 9:] = [40.0, -40.0, 40.0] * 3
    times = np.linspace(0.0, 0.1, 11)
    batch = bha.simulate_batch(arm, drive(arm), states, times=times, method=method)
    assert list(batch.succeeded) == [k not in {0, 5} for k in range(9)]
    assert all(isinstance(batch.failures[k], bha.SimulationError) for k in (0, 5))
    assert np.isnan(batch.lengths[[0, 5], -1]).all()
    others = bha.simulate_batch(arm, drive(arm), states[batch.succeeded], times=times, method=method)
    np.testing.assert_allclose(batch.lengths[batch.succeeded], others.lengths, rtol=0, atol=2e-6)


def test_members_with_clocks_of_their_own(arm: bha.Arm) -> None:
    """The same log by other clocks is the same run."""
    source = drive(arm)
    clocks = np.array([0.0, 1.7e9, -3.0])
    inputs = [bha.Input(source.time + clock, source.pressures) for clock in clocks]
    times = clocks[:, None] + np.array([0.0, 0.05, 0.2])
    batch = bha.simulate_batch(arm, inputs, times=times)
    assert batch.succeeded.all()
    # Seconds since 1970 hold a tenth of a microsecond.
    np.testing.assert_allclose(batch.lengths, np.broadcast_to(batch.lengths[0], batch.lengths.shape), rtol=0, atol=1e-6)


def test_too_many_rows_are_an_error_at_once(arm: bha.Arm) -> None:
    with pytest.raises(bha.InputError, match="rows of members; fewer at a time are needed"):
        bha.simulate_batch([arm] * 200_000, drive(arm), times=np.linspace(0.0, 0.1, 1_000_000))


def test_lengths_beyond_what_the_arm_is_made_for_are_said_once_and_counted(arm: bha.Arm) -> None:
    time = np.linspace(0.0, 0.5, 6)
    low, high = (bha.Input(time, np.full((6, len(arm.inputs)), p)) for p in (1.1e5, 3.0e5))
    rest = np.concatenate([arm.static_lengths(np.full(len(arm.inputs), 1.1e5)), np.zeros(3 * arm.section_count)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bha.simulate_batch(arm, [low, low], rest, times=time)
        bha.simulate_batch(arm, [low, high, high], rest, times=time, warn=False)
    with pytest.warns(
        bha.errors.LogWarning, match=r"of 2 of 3 members leave length_range \(the first: member 1"
    ) as said:
        bha.simulate_batch(arm, [low, high, high], rest, times=time)
    assert len(said) == 1
