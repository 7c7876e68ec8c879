"""A run that begins in the middle of its input, from a given state: pressures that lag have their past."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.parameters import ArmParameters

LAG = {"level": "lag", "fill_time": 0.08, "vent_time": 0.3}
DELAY = {"kind": "delay", "where": "all", "time": 0.05}
STAGE = {"kind": "pressure_lag", "where": "all", "fill": 0.06, "vent": 0.06}
GAIN = {"kind": "pressure_gain", "where": "all", "gain": 0.1}


def arm_of(pneumatics: dict[str, object] | None, *effects: dict[str, object]) -> bha.Arm:
    mapping = bha.robots.load("bha_nominal").parameters.to_mapping()
    more = {} if pneumatics is None else {"pneumatics": pneumatics}
    return bha.Arm(ArmParameters.from_mapping({**mapping, **more, "effect": list(effects)}))


def staircase(arm: bha.Arm, interpolation: str, first: float = 0.0) -> bha.Input:
    time = first + np.arange(0.0, 2.0, 0.01)
    levels = np.random.default_rng(3).uniform(1.1e5, 1.6e5, (7, len(arm.inputs)))
    rows = levels[np.floor((time - first) / 0.33).astype(int)]
    return bha.Input(time, rows, commanded=True, interpolation=interpolation)


@pytest.mark.parametrize("interpolation", ["linear", "hold"])
@pytest.mark.parametrize(
    ("pneumatics", "effects"),
    [
        (LAG, ()),
        (LAG, (GAIN,)),
        (LAG, (DELAY,)),
        (LAG, (DELAY, STAGE)),
        (None, (STAGE,)),
    ],
)
def test_a_run_goes_on_as_the_one_that_was_cut(
    pneumatics: dict[str, object] | None, effects: tuple[dict[str, object], ...], interpolation: str
) -> None:
    arm = arm_of(pneumatics, *effects)
    drive = staircase(arm, interpolation, first=4.0)
    # Two hundredths after a step of the commands: without their past the chambers would stand where these are.
    cut, times = 4.68, 4.68 + np.arange(0.0, 1.2, 0.1)
    options = {"method": "rk4", "step": 1e-3}
    whole = bha.simulate_batch(arm, drive, times=np.append(4.0, times), **options)
    state = np.concatenate([whole.lengths[0, 1], whole.velocities[0, 1]])
    for members in (1, 3):  # alone, and in lanes
        run = bha.simulate_batch(arm, drive, np.tile(state, (members, 1)), times=times, start=cut, **options)
        np.testing.assert_allclose(run.lengths[-1], whole.lengths[0, 1:], rtol=0.0, atol=2e-6)


def test_a_run_from_rest_has_no_past() -> None:
    arm = arm_of(LAG, STAGE)
    drive = staircase(arm, "hold")
    run = bha.simulate_batch(arm, drive, times=[0.705, 0.72], start=0.705, method="rk4", step=1e-3)
    rest = arm.static_lengths(drive.pressures[70])
    np.testing.assert_allclose(run.lengths[0, 0], rest, rtol=0.0, atol=1e-9)
    assert np.max(np.abs(run.velocities[0, 1])) < 1e-6


@pytest.mark.parametrize("effects", [(), (DELAY, STAGE)])
def test_a_past_of_tenths_of_a_second_ends_where_the_run_begins(effects: tuple[dict[str, object], ...]) -> None:
    """On the clock of lanes that begin at other times a sample may round to the moment that has been reached."""
    arm = arm_of(LAG, *effects)
    time = np.arange(300) / 10
    levels = np.random.default_rng(4).uniform(1.1e5, 1.6e5, (300, len(arm.inputs)))
    drive = bha.Input(time, levels, commanded=True)
    state = np.concatenate([arm.static_lengths(levels[0]), np.zeros(3 * arm.section_count)])
    cuts = time[7:280:7]
    options = {"method": "rk4", "step": 5e-3}
    abreast = bha.simulate_batch(
        arm, drive, np.tile(state, (len(cuts), 1)), times=cuts[:, None] + [0.0, 0.05], start=cuts, **options
    )
    for cut, lengths in zip(cuts[::8], abreast.lengths[::8], strict=True):
        alone = bha.simulate_batch(arm, drive, state[None], times=cut + np.array([0.0, 0.05]), start=cut, **options)
        np.testing.assert_allclose(lengths, alone.lengths[0], rtol=0.0, atol=1e-9)
