"""Commands through a lag in long fixed steps: the lag is exact over them, and they end where a command bends."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.parameters import ArmParameters

LAG = {"level": "lag", "fill_time": 0.05, "vent_time": 0.2}
GAIN = {"kind": "pressure_gain", "where": "all", "gain": 0.1}


def arm_of(*effects: dict[str, object]) -> bha.Arm:
    mapping = bha.robots.load("bha_nominal").parameters.to_mapping()
    return bha.Arm(ArmParameters.from_mapping({**mapping, "pneumatics": LAG, "effect": list(effects)}))


def staircase(arm: bha.Arm) -> bha.Input:
    """Commands held for a third of a second, as a log of 100 Hz has them."""
    time = np.arange(0.0, 2.0, 0.01)
    levels = np.random.default_rng(3).uniform(1.1e5, 1.6e5, (7, len(arm.inputs)))
    return bha.Input(time, levels[np.floor(time / 0.33).astype(int)], commanded=True)


@pytest.mark.parametrize("effects", [(), (GAIN,)])
def test_long_steps_lose_no_more_than_their_order(effects: tuple[dict[str, object], ...]) -> None:
    arm = arm_of(*effects)
    drive, times = staircase(arm), np.arange(0.0, 1.9, 0.1)
    exact = bha.simulate_batch(arm, drive, times=times, method="dopri5", rtol=1e-10, atol=1e-12).lengths[0]
    errors = []
    for step in (1e-2, 5e-3):
        run = bha.simulate_batch(arm, drive, times=times, method="rk4", step=step)
        errors.append(float(np.max(np.abs(run.lengths[0] - exact))))
        # Steps are as long as was asked for, but for those that end at a bend or a row.
        assert run.statistics[0, 0] < 1.3 * times[-1] / step
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 8.0


def test_what_reads_a_lagged_pressure_is_one_pressure() -> None:
    """A gain behind the lag is the same arm with areas, and what they do, larger by it: here a gain of the command."""
    arm, scaled = arm_of(GAIN), arm_of()
    drive, times = staircase(arm), np.arange(0.0, 1.9, 0.1)
    ambient = arm.parameters.ambient_pressure
    larger = bha.Input(drive.time, ambient + 1.1 * (drive.pressures - ambient), commanded=True)
    ours = bha.simulate_batch(arm, drive, times=times, method="rk4", step=2e-3).lengths
    theirs = bha.simulate_batch(scaled, larger, times=times, method="rk4", step=2e-3).lengths
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9)


def test_a_dead_time_behind_a_lag_is_one_of_the_commands() -> None:
    """Commands that come later, given as such, through the lag alone; the chambers fill before the dead time."""
    late, arm, delayed = 0.037, arm_of(), arm_of({"kind": "delay", "where": "all", "time": 0.037})
    drive, times = staircase(arm), np.arange(0.0, 1.9, 0.1)
    later = bha.Input(
        np.append(0.0, drive.time + late), np.vstack([drive.pressures[:1], drive.pressures]), commanded=True
    )
    for method, step in (("rk4", 2e-3), ("ros2", 1e-2)):
        ours = bha.simulate(delayed, drive, times=times, method=method, step=step)
        theirs = bha.simulate(arm, later, times=times, method=method, step=step)
        # Steps end elsewhere, too: errors of the integrators are not the same.
        least = 1e-7 if method == "rk4" else 1e-4
        np.testing.assert_allclose(ours.lengths, theirs.lengths, rtol=0.0, atol=least)
    filled = bha.simulate(arm, drive, times=times).pressures
    np.testing.assert_allclose(bha.simulate(delayed, drive, times=times).pressures, filled, rtol=1e-12)


def test_a_dead_time_behind_a_lag_takes_no_longer_steps_than_the_lag_alone() -> None:
    drive, times, steps = staircase(arm_of()), np.arange(0.0, 1.9, 0.1), []
    for effects in ((), ({"kind": "delay", "where": "all", "time": 0.037},)):
        run = bha.simulate_batch(arm_of(*effects), drive, times=times, method="rk4", step=1e-2)
        steps.append(run.statistics[0, 0])
    # Both the command and the delayed one end steps, three times a step of the staircase.
    assert steps[1] < steps[0] + 3 * 6


def test_two_stages_that_are_alike_follow_a_step_as_their_closed_form_does() -> None:
    """1 - (1 + t/T) exp(-t/T), given as a measured pressure; the first stage is the pneumatics' or an effect's."""
    stage, time, times = 0.15, np.arange(0.0, 1.5, 1e-3), np.arange(0.0, 1.4, 0.05)
    bare = bha.robots.load("bha_nominal")
    low, high = 1.1e5, 1.4e5
    since = np.maximum(time - 0.1, 0.0) / stage
    acting = low + (high - low) * (1.0 - (1.0 + since) * np.exp(-since))
    wanted = bha.simulate(
        bare, bha.Input(time, np.tile(acting[:, None], len(bare.inputs))), times=times, method="rk4", step=1e-3
    )
    command = np.where(time[:, None] < 0.1, low, high) * np.ones(len(bare.inputs))
    drive = bha.Input(time, command, commanded=True, interpolation="hold")
    lag = {"kind": "pressure_lag", "where": "all", "fill": stage, "vent": 4.0 * stage}
    table = {"level": "lag", "fill_time": stage, "vent_time": 4.0 * stage}
    mapping = bare.parameters.to_mapping()
    for arm in (
        bare.with_effects([lag, lag]),
        bha.Arm(ArmParameters.from_mapping({**mapping, "pneumatics": table, "effect": [lag]})),
    ):
        found = bha.simulate(arm, drive, times=times, method="rk4", step=1e-3)
        np.testing.assert_allclose(found.lengths, wanted.lengths, rtol=0.0, atol=2e-6)
