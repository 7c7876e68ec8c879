"""Pressures that are held between readings: stairs that act as such, and smooth ones that a slow sensor has read."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bha
from bha.parameters import ArmParameters, paths
from bha.recordings import Recording
from bha.recordings.stairs import ripple

NOISE = 2e-4


def arm_of(**factors: float) -> bha.Arm:
    """One section, some of its numbers times a factor."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    parameters = ArmParameters.from_mapping({**mapping, "section": mapping["section"][:1]})
    changed = {f"section.1.{name}": f * paths.get_value(parameters, f"section.1.{name}") for name, f in factors.items()}
    return bha.Arm(paths.with_values(parameters, changed))


def plant(renewal: float, *, steps: bool, rate: float = 200.0, heads: bool = False, still: bool = False) -> bha.Log:
    """Readings of pressures that are held; the arm got these stairs, or what is smooth. Five seconds."""
    arm, fine = arm_of(), np.arange(5001) / 1000.0
    moving = np.clip(fine - 1.5, 0.0, None) if still else fine
    smooth = 1.3e5 + 2.0e4 * np.sin(2.0 * np.pi * np.outer(moving, [0.5, 0.7, 0.9]) + [0.0, 1.0, 2.0])
    hold = round(1000.0 * renewal)
    held = smooth[np.arange(5001) // hold * hold]
    options = bha.Options(interpolation="hold" if steps else "linear")
    run = bha.simulate(arm, bha.Input(fine, held if steps else smooth), times=fine, options=options)
    rows = np.arange(0, 5001, round(1000.0 / rate))
    noise = NOISE * np.random.default_rng(1).standard_normal((len(rows), 3))
    shown = (run.head_positions[rows, 0] if heads else run.lengths[rows]) + noise
    names = ("x1", "y1", "z1") if heads else ("q11", "q12", "q13")
    columns: dict[str, Any] = {"t [s]": fine[rows]}
    columns |= {f"{n} [Pa]": held[rows, k] for k, n in enumerate(arm.inputs)}
    return bha.Log.from_arrays(columns | {f"{n} [m]": shown[:, k] for k, n in enumerate(names)})


ARMS = {"right": {}, "heavy": {"mass": 1.4, "damping": 1.5}, "light": {"mass": 0.7, "damping": 0.6}}

#: How long a reading is held, s, and rows a second.
RENEWALS = [(0.02, 1000.0), (0.03, 200.0), (0.06, 100.0)]


@pytest.mark.parametrize("wrong", ARMS)
@pytest.mark.parametrize(("renewal", "rate"), RENEWALS)
def test_stairs_that_act_are_held_and_jump(renewal: float, rate: float, wrong: str) -> None:
    recording = Recording(arm_of(**ARMS[wrong]), plant(renewal, steps=True, rate=rate))
    choice = recording.pressures
    assert (choice.sort, choice.between_readings) == ("measured", "steps")
    assert choice.between_samples == "hold" or renewal * rate > 10.0
    rows = recording.drive.pressures[recording.drive_rows]
    np.testing.assert_array_equal(rows, recording.log.pressures(recording.arm.inputs))
    assert any("held as they are" in note for note in recording.notes)


@pytest.mark.parametrize("wrong", ARMS)
@pytest.mark.parametrize(("renewal", "rate"), RENEWALS)
def test_smooth_pressures_of_a_slow_sensor_are_a_curve(renewal: float, rate: float, wrong: str) -> None:
    recording = Recording(arm_of(**ARMS[wrong]), plant(renewal, steps=False, rate=rate))
    assert (recording.pressures.between_readings, recording.pressures.between_samples) == ("curve", "linear")
    assert any("the curve between its readings drives" in note for note in recording.notes)


@pytest.mark.parametrize("steps", [True, False])
def test_heads_tell_it_too(steps: bool) -> None:
    recording = Recording(arm_of(mass=1.2), plant(0.04, steps=steps, heads=True))
    assert recording.pressures.between_readings == ("steps" if steps else "curve")


def test_what_the_arm_then_does_is_noise() -> None:
    arm = arm_of()
    recording = Recording(arm, plant(0.04, steps=True))
    left = recording.errors(bha.simulate(arm, recording))
    assert np.sqrt(np.nanmean(left**2)) == pytest.approx(NOISE, rel=0.1)


def test_stairs_that_stand_still_are_no_dropouts() -> None:
    recording = Recording(arm_of(), plant(0.04, steps=True, still=True))
    assert recording.pressures.between_readings == "steps"
    assert all(not fact.dropouts and fact.noise == 0.0 for fact in recording.pressure_facts)
    assert recording.usable.all()


def test_who_cannot_tell_keeps_the_curve() -> None:
    arm, log = arm_of(), plant(0.04, steps=True)
    alone = {"t [s]": log.time} | {f"{n} [Pa]": log[n] for n in arm.inputs}
    held = np.arange(len(log)) // 8 * 8
    slow = alone | {f"q1{k} [m]": log[f"q1{k}"][held] for k in (1, 2, 3)}
    for columns in (alone, slow):
        choice = Recording(arm, bha.Log.from_arrays(columns)).pressures
        assert (choice.between_readings, choice.between_samples) == ("curve", "linear")


def test_stairs_too_small_for_the_noise_are_said_to_be_untold() -> None:
    recording = Recording(arm_of(), plant(0.01, steps=True))
    assert recording.pressures.between_readings == "curve"
    assert any("the outputs do not tell them apart" in note for note in recording.notes)


def test_a_ripple_is_what_repeats_within_a_renewal() -> None:
    time = np.arange(4000) / 1000.0
    inside = slice(200, -200)
    slow, saw = np.sin(2.0 * np.pi * time), (time / 0.04) % 1.0 - 0.5
    assert np.abs(ripple(time, slow, 0.04)[inside]).max() < 1e-4
    np.testing.assert_allclose(ripple(time, slow + saw, 0.04)[inside], saw[inside], atol=0.05)
