"""The procedures of section IV on simulated steady states and swings."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.identification import (
    Settings,
    bending_stiffness,
    inertia,
    longitudinal_stiffness,
    record,
    steady_states,
    swing_damping,
    swings,
)
from bha.parameters import paths

from .identify_logs import holds, measured, off, one_section

LEVELS = [0.85e5, 1.0e5, 1.15e5, 1.3e5, 1.45e5]


def release(arm: bha.Arm, duration: float = 4.0, rate: float = 500.0) -> bha.Input:
    """A sideways force, as of a hand, that lets go after a second: 3 mm at the bellows, ten times the noise."""
    time = np.arange(0.0, duration + 1.0, 1.0 / rate)
    forces = np.zeros((len(time), arm.section_count, 3))
    forces[time < 1.0, -1, 0] = 10.0
    return bha.Input(time, np.full((len(time), len(arm.inputs)), 1.2e5), forces)


def test_steady_states_are_found() -> None:
    arm = one_section()
    drive = holds([[p] * 3 for p in LEVELS])
    found = steady_states(arm, record(arm, measured(arm, drive)))
    assert len(found) == len(LEVELS)
    for state, level in zip(found, LEVELS, strict=True):
        assert state.pressures == pytest.approx(level, abs=50.0)
        assert state.channels == pytest.approx(arm.static_lengths([level] * 3), abs=2e-4)


def test_longitudinal_stiffness() -> None:
    arm = one_section()
    rec = record(arm, measured(arm, holds([[p] * 3 for p in LEVELS])))
    wrong = off(arm, {"section.1.stiffness.1": 0.7, "section.1.stiffness.3": 2.0})
    fit = longitudinal_stiffness(wrong, [rec], 1)
    elongations = np.linspace(fit.abscissa.min(), fit.abscissa.max(), 9)
    true = 1300.0 * elongations + 1500.0 * elongations**2 + 12000.0 * elongations**3
    assert fit.curve(elongations) == pytest.approx(true, abs=0.4)
    assert len(fit.used) == len(LEVELS)
    assert np.abs(fit.residual).max() < 0.3
    applied = fit.applied(wrong)
    assert applied.parameters.sections[0].stiffness == pytest.approx(tuple(fit.coefficients))


@pytest.mark.parametrize("force_model", ["end_force", "work_conjugate"])
def test_bending_stiffness(force_model: str) -> None:
    arm = one_section().with_changes(force_model=force_model)  # type: ignore[arg-type]
    poses = [[1.2e5 - d, 1.2e5 + d / 2, 1.2e5 + d / 2] for d in (-3e4, -2e4, -1e4, 1e4, 2e4, 3e4)]
    rec = record(arm, measured(arm, holds(poses)))
    fit = bending_stiffness(off(arm, {"section.1.bending_stiffness.1": 3.0}), [rec], 1)
    assert fit.coefficients[0] == pytest.approx(4.0, rel=0.02)
    assert fit.abscissa.min() < 0 < fit.abscissa.max()
    assert len(fit.used) == len(poses)


def test_too_few_steady_states() -> None:
    arm = one_section()
    rec = record(arm, measured(arm, holds([[1.2e5] * 3])))
    with pytest.raises(bha.InputError, match="inflate all of its bellows evenly"):
        longitudinal_stiffness(arm, [rec], 1)
    with pytest.raises(bha.InputError, match="evenly against bellows 1"):
        bending_stiffness(arm, [rec], 1)


def test_swing_damping() -> None:
    arm = one_section()
    start = off(arm, {"section.1.damping": 1.5, "section.1.bending_stiffness.1": 1.1})
    drive = release(arm)
    log = measured(arm, drive)
    # The log has no force columns; the record gets the force, as one that was measured.
    rec = record(start, log)
    rec = type(rec)(**{**vars(rec), "drive": bha.Input(drive.time, rec.drive.pressures, drive.forces)})
    (stretch,) = swings(rec)
    assert stretch.start == pytest.approx(1.0, abs=0.2)
    fit = swing_damping(start, [rec], settings=Settings(windows=(0.75, 4.0), draws=0))
    value, error = fit.damping["section.1.damping"]
    assert abs(value - 18.0) < 4.0 * error
    assert error < 1.0
    (wave,) = fit.oscillations
    assert np.std(wave.measured - wave.fitted) == pytest.approx(3e-4, rel=0.1)
    # The slowest modes are those of the linearized arm, not of the fit's start.
    pressures = np.full(3, 1.2e5)
    rest = arm.static_lengths(pressures)
    values = np.linalg.eigvals(arm.linearize(rest, np.zeros(3), pressures)[0])
    slowest = values[values.imag > 0][np.argmin(np.abs(values[values.imag > 0]))]
    assert wave.frequency == pytest.approx(slowest.imag / (2 * np.pi), rel=0.1)
    assert wave.decay == pytest.approx(-slowest.real, rel=0.2)


def test_no_swing() -> None:
    arm = one_section()
    rec = record(arm, measured(arm, holds([[1.2e5] * 3])))
    with pytest.raises(bha.InputError, match="no free swing"):
        swing_damping(arm, [rec])


def test_inertia_by_56_and_57() -> None:
    (found,) = inertia(one_section().parameters)
    mass, radius, mean, longest = 0.75, 0.13, 0.2, 0.3
    assert found.cylinder[0] == pytest.approx(mass * (radius**2 / 4 + mean**2 / 12))
    assert found.cylinder[2] == pytest.approx(mass * radius**2 / 2)
    assert found.upper_bound == pytest.approx((mass * (radius**2 / 2 + longest**2 / 12),) * 2 + (mass * radius**2,))
    assert found.plausible
    assert not inertia(
        paths.with_values(one_section().parameters, {"section.1.inertia.x": 1.0 / 20, "section.1.inertia.y": 1.0 / 20})
    )[0].plausible
