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
