"""The procedures of section IV on simulated steady states and swings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main
from bha.estimation.stretches import stretch_between
from bha.identification import (
    Record,
    bending_stiffness,
    inertia,
    longitudinal_stiffness,
    oscillation,
    record,
    steady_states,
    swing_damping,
    swings,
)
from bha.parameters import ArmParameters, paths

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


def test_the_rest_length_is_the_zero_of_the_curve() -> None:
    """Springs and rest lengths far off: both follow from forces at lengths on both sides of rest, within errors."""
    arm = one_section()
    levels = [0.8e5, 0.9e5, 1.0e5, 1.1e5, 1.2e5, 1.3e5, 1.4e5, 1.5e5]
    rec = record(arm, measured(arm, holds([[p] * 3 for p in levels])))
    wrong = off(arm, {"section.1.stiffness.1": 0.5, "section.1.rest_length": 1.1})
    fit = longitudinal_stiffness(wrong, [rec], 1)
    assert fit.rest_shift is not None
    shift, error = fit.rest_shift
    assert error < 1e-3
    assert abs(shift + 0.015) < 4.0 * error
    for value, deviation, true in zip(fit.coefficients, fit.standard_errors, (1300.0, 1500.0, 12000.0), strict=True):
        assert abs(value - true) < 4.0 * deviation
    applied = fit.applied(wrong).parameters.sections[0]
    assert applied.rest_length == pytest.approx(0.15, abs=4.0 * error)
    # Forces of one sign do not tell it, and a wrong one is not passed on as if they did.
    stretched = record(arm, measured(arm, holds([[p] * 3 for p in levels[3:]])))
    assert longitudinal_stiffness(arm, [stretched], 1, order=2).rest_shift is None


def test_bellows_that_are_not_alike_leave_a_moment_at_angle_zero() -> None:
    """One bellows is 1 mm longer than the file says: the line keeps its slope and gets an offset."""
    arm = one_section()
    uneven = bha.Arm(paths.with_values(arm.parameters, {"section.1.bellows.1.rest_length": 0.151}))
    steps = (-3e4, -2e4, -1e4, 0.0, 1e4, 2e4, 3e4)
    poses = [[1.4e5 - d, 1.4e5 + d / 2, 1.4e5 + d / 2] for d in steps]
    rec = record(arm, measured(uneven, holds(poses)))
    fit = bending_stiffness(arm, [rec], 1)
    assert fit.coefficients[0] == pytest.approx(4.0, rel=0.05)
    # Bellows 1 pushes by 1 mm of its spring more than the law takes off, at a lever of its radius.
    extension = float(np.mean(arm.static_lengths([1.4e5] * 3))) - 0.15
    slope = 1300.0 + 3000.0 * extension + 36000.0 * extension**2
    assert abs(fit.offset) == pytest.approx(slope * 1e-3 * arm.parameters.sections[0].bellows_radius, rel=0.1)
    one_side = record(arm, measured(arm, holds(poses[4:])))
    assert bending_stiffness(arm, [one_side], 1).offset == 0.0
    with pytest.raises(bha.InputError, match="to both sides"):
        bending_stiffness(arm, [one_side], 1, offset=True)


def test_readings_that_renew_seldom_hide_no_steady_state() -> None:
    arm = one_section()
    rec = record(arm, measured(arm, holds([[p] * 3 for p in LEVELS])))
    seldom = np.zeros_like(rec.usable)
    seldom[::7] = True
    found = steady_states(arm, replace(rec, usable=rec.usable & seldom))
    assert len(found) == len(LEVELS)
    for state, level in zip(found, LEVELS, strict=True):
        assert state.channels == pytest.approx(arm.static_lengths([level] * 3), abs=3e-4)
    none = replace(rec, usable=np.zeros_like(rec.usable))
    assert steady_states(arm, none) == []


def swing_of(arm: bha.Arm) -> Record:
    drive = release(arm)
    log = measured(arm, drive)
    # The log has no force columns; the record gets the force, as one that was measured.
    rec = record(arm, log)
    return replace(rec, drive=bha.Input(drive.time, rec.drive.pressures, drive.forces))


@pytest.mark.parametrize("at_rest", [False, True])
def test_swing_damping(at_rest: bool) -> None:
    arm = one_section()
    start = off(arm, {"section.1.damping": 1.5})
    rec = swing_of(arm)
    (stretch,) = swings(rec)
    assert stretch.start == pytest.approx(1.0, abs=0.2)
    where = [stretch_between(rec, 0.999, 3.0)] if at_rest else None
    fit = swing_damping(start, [rec], stretches=where, at_rest=at_rest)
    value, error = fit.damping["section.1.damping"]
    assert abs(value - 18.0) < 4.0 * error
    assert error < 1.0
    assert fit.applied(start).parameters.sections[0].damping == pytest.approx(value)
    (wave,), (model,) = fit.measured, fit.modelled
    assert wave.residual < 0.1 * wave.amplitude
    assert model.damping_ratio == pytest.approx(wave.damping_ratio, rel=1e-3)
    # The slowest modes are those of the linearized arm, not of the fit's start.
    pressures = np.full(3, 1.2e5)
    rest = arm.static_lengths(pressures)
    values = np.linalg.eigvals(arm.linearize(rest, np.zeros(3), pressures)[0])
    slowest = values[values.imag > 0][np.argmin(np.abs(values[values.imag > 0]))]
    assert wave.frequency == pytest.approx(slowest.imag / (2 * np.pi), rel=0.1)
    assert wave.decay == pytest.approx(-slowest.real, rel=0.2)


def test_the_error_of_a_decay_is_that_of_its_scatter() -> None:
    """200 made swings in white noise: scatter of the estimates beside the error that each states."""
    time = np.arange(0.0, 2.0, 1e-2)
    clean = 0.02 * np.exp(-1.5 * time) * np.cos(2 * np.pi * 3.0 * time + 0.4)
    random = np.random.default_rng(4)
    found = [oscillation(time, clean + 5e-4 * random.standard_normal(len(time))) for _ in range(200)]
    decays, errors = np.array([f.decay for f in found]), np.array([f.decay_error for f in found])
    assert decays.mean() == pytest.approx(1.5, abs=4.0 * decays.std() / np.sqrt(200))
    assert np.median(errors) == pytest.approx(decays.std(), rel=0.2)


def test_a_model_that_cannot_decay_so_is_said() -> None:
    """Without a mass to swing no damping makes it swing: an arm of a thousandth of the mass."""
    arm = one_section()
    rec = swing_of(arm)
    with pytest.raises((bha.ConvergenceError, bha.SimulationError)):
        swing_damping(off(arm, {"section.1.mass": 1e-3, "section.1.stiffness.1": 100.0}), [rec])


def test_no_swing() -> None:
    arm = one_section()
    rec = record(arm, measured(arm, holds([[1.2e5] * 3])))
    with pytest.raises(bha.InputError, match="no free swing"):
        swing_damping(arm, [rec])


def test_section_iv_from_the_command_line_in_its_order(tmp_path: Path) -> None:
    """From geometry and mass alone to the arm: each call begins with the file of the one before, and draws its figure.

    The swing is a fast fall of pressures: no force is logged.
    """
    pytest.importorskip("matplotlib")
    arm = one_section()
    steps = (-3e4, -2e4, -1e4, 1e4, 2e4, 3e4)
    even = holds([[p] * 3 for p in (0.8e5, 0.9e5, 1.0e5, 1.1e5, 1.2e5, 1.3e5, 1.4e5)])
    measured(arm, even).write(tmp_path / "even.csv")
    measured(arm, holds([[1.2e5 - d, 1.2e5 + d / 2, 1.2e5 + d / 2] for d in steps])).write(tmp_path / "bent.csv")
    time = np.arange(0.0, 5.0, 5e-3)
    fall = np.where(time[:, None] < 1.0, [0.9e5, 1.35e5, 1.35e5], 1.2e5)
    measured(arm, bha.Input(time, fall)).write(tmp_path / "swing.csv")
    known = arm.parameters.to_mapping()
    known["section"][0] |= {"stiffness": [1.0], "bending_stiffness": [0.0], "damping": 0.0, "rest_length": 0.16}
    known["section"][0].pop("provenance", None)
    bha.Arm(ArmParameters.from_mapping(known)).save(tmp_path / "0.toml")
    calls = (("stiffness", "even.csv"), ("bending", "bent.csv"), ("damping", "swing.csv"))
    for number, (name, log) in enumerate(calls):
        out = tmp_path / f"{number + 1}.toml"
        arguments = ["identify", str(tmp_path / f"{number}.toml"), str(tmp_path / log), "--procedure", name]
        done = CliRunner().invoke(main, [*arguments, "--out", str(out), "--plot"])
        assert done.exit_code == 0, done.output
        assert (tmp_path / f"{number + 1}_{name}.pdf").stat().st_size > 5_000
    section = ArmParameters.read(tmp_path / "3.toml").sections[0]
    assert section.rest_length == pytest.approx(0.15, abs=1e-3)
    assert section.stiffness[0] == pytest.approx(1300.0, rel=0.03)
    assert section.bending_stiffness[0] == pytest.approx(4.0, rel=0.03)
    assert section.damping == pytest.approx(18.0, rel=0.06)
    for key in ("stiffness", "rest_length", "bending_stiffness", "damping"):
        assert section.provenance[key].status == "identified"
    low, high = section.provenance["damping"].ci95  # type: ignore[misc]
    assert low < section.damping < high
    assert section.provenance["damping"].logs[0].name == "swing.csv"


@pytest.mark.parametrize(
    ("extra", "text"),
    [
        (["--procedure", "stiffness"], "inflate all of its bellows evenly"),
        (["--procedure", "bending"], "evenly against bellows 1"),
        (["--procedure", "damping"], "no free swing was found"),
        (["--procedure", "stiffness", "--section", "2"], "has sections 1 to 1"),
        (["--procedure", "damping", "--section", "1"], "takes no choice of sections"),
        (["--procedure", "stiffness", "--free", "section.1.mass", "--seed", "1"], "--free, --seed: not with"),
        (["--order", "2"], "--order: only with --procedure"),
    ],
)
def test_what_a_procedure_lacks_is_said(tmp_path: Path, extra: list[str], text: str) -> None:
    arm = one_section()
    arm.save(tmp_path / "arm.toml")
    measured(arm, holds([[1.2e5] * 3])).write(tmp_path / "log.csv")
    arguments = ["identify", str(tmp_path / "arm.toml"), str(tmp_path / "log.csv"), "--out", str(tmp_path / "o.toml")]
    done = CliRunner().invoke(main, [*arguments, *extra])
    assert done.exit_code == 1, done.output
    assert text in done.output
    assert not (tmp_path / "o.toml").exists()


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
