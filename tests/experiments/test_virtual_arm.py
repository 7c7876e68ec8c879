"""The virtual arm: the lumped model where it must be, and sensors that do what they say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import bha
from bha import _core
from bha.errors import InputError
from bha.experiments import Schedule, VirtualArm, VirtualBody, VirtualSensors
from bha.experiments.virtual_arm import thin_disc

DESIGN = bha.robots.load("bha_nominal")
PERFECT = VirtualSensors(0.0, 1e-12, 0.0, 1e-9, 1e-9)
NOTHING = (0, 0.0, (0.0, 0.0, 0.0))


@pytest.mark.parametrize("force_model", ["end_force", "work_conjugate"])
def test_all_mass_in_the_head_plates_is_the_lumped_model(force_model: bha.parameters.ForceModel) -> None:
    arm = DESIGN.with_changes(force_model=force_model)
    twin = _core.VirtualArm(arm.parameters.to_core_json(), [NOTHING] * 3, [])
    time = np.linspace(0.0, 0.5, 51)
    pressures = 1.3e5 + 2e4 * np.sin(7.0 * time[:, None] + np.arange(9))
    forces = 3.0 * np.cos(5.0 * time[:, None] + np.arange(9))
    start = arm.static_lengths(pressures[0], forces[0].reshape(3, 3))
    np.testing.assert_allclose(twin.rest(pressures[0], forces[0].reshape(3, 3)), start, atol=1e-10)
    run = twin.run(_core.Input(time, pressures, forces), time, start, np.zeros(9), [], 1e-3)
    lumped = bha.simulate(arm, bha.Input(time, pressures, forces.reshape(-1, 3, 3)), q0=start, method="rk4", step=1e-3)
    assert np.ptp(run.lengths, axis=0).max() > 0.02
    np.testing.assert_allclose(run.lengths, lumped.lengths, atol=1e-11)
    np.testing.assert_allclose(run.velocities, lumped.velocities, atol=1e-9)


def test_mass_is_conserved_and_moves_inwards() -> None:
    """Hanging still, the springs carry the same weight at the top, less of it further down."""
    ambient = np.full(9, DESIGN.parameters.ambient_pressure)
    schedule = Schedule(np.array([0.0, 0.01]), np.vstack([ambient, ambient]))
    exact = VirtualBody(scatter=0.0, creep=())
    lumped = VirtualArm(DESIGN, dataclasses.replace(exact, plate_share=1.0), PERFECT).measure(schedule, number=0)
    spread = VirtualArm(DESIGN, exact, PERFECT).measure(schedule, number=0)
    assert lumped.lengths is not None
    assert spread.lengths is not None
    shorter = lumped.lengths[0] - spread.lengths[0]
    section = DESIGN.parameters.sections[0]
    # Of the slices of section 1 half the weight hangs on its springs: stiffness times shortening is the other half.
    extension = lumped.lengths[0, 0] - section.rest_length
    stiffness = sum((j + 1) * k * extension**j for j, k in enumerate(section.stiffness))
    missing = 9.81 * 0.5 * 0.3 * section.mass
    assert 3 * stiffness * shorter[0] == pytest.approx(missing, rel=0.02)


def test_sensors() -> None:
    ambient = np.full(9, DESIGN.parameters.ambient_pressure)
    schedule = Schedule(np.array([0.0, 0.5]), np.vstack([ambient, ambient]))
    arm = VirtualArm(DESIGN)
    log = arm.measure(schedule, number=1)
    assert log.lengths is not None
    np.testing.assert_allclose(np.diff(log.time), 1e-3)
    steps = log.lengths / arm.sensors.length_quantum
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    expected = np.hypot(arm.sensors.length_noise, arm.sensors.length_quantum / np.sqrt(12))
    assert log.lengths.std(axis=0).mean() == pytest.approx(expected, rel=0.1)
    assert log["p11"].std() == pytest.approx(np.hypot(150.0, 100.0 / np.sqrt(12)), rel=0.15)

    np.testing.assert_array_equal(log.lengths, VirtualArm(DESIGN).measure(schedule, number=1).lengths)
    assert np.any(log.lengths != arm.measure(schedule, number=2).lengths)


def test_chamber_pressure_lags() -> None:
    low, high = np.full(9, 1e5), np.full(9, 2e5)
    schedule = Schedule(np.array([0.0, 0.1, 0.1, 0.5]), np.vstack([low, low, high, high]))
    time = np.arange(501) * 1e-3
    found = VirtualArm(DESIGN).chamber_pressures(schedule, time)[:, 4]
    expected = np.where(time > 0.1, 2e5 - 1e5 * np.exp(-(time - 0.1) / 0.05), 1e5)
    np.testing.assert_allclose(found, expected, atol=0.02 * 1e5)


def test_wrong_bodies_are_refused() -> None:
    with pytest.raises(InputError, match="plate_share: 0"):
        VirtualArm(DESIGN, VirtualBody(plate_share=0.0))
    with pytest.raises(InputError, match=r"creep.*positive time"):
        VirtualArm(DESIGN, VirtualBody(creep=((0.1, 0.0),)))
    with pytest.raises(InputError, match="slices for a mass"):
        VirtualArm(DESIGN, VirtualBody(slices=0))
    core = _core.VirtualArm(DESIGN.parameters.to_core_json(), [NOTHING] * 3, [])
    with pytest.raises(InputError, match=r"expected shape \(any, 9\)"):
        core.run(_core.Input([0.0, 1.0], np.ones((2, 8))), [0.0], np.full(9, 0.2), np.zeros(9), [], 1e-3)
    assert thin_disc(2.0, 0.5) == (0.125, 0.125, 0.25)
