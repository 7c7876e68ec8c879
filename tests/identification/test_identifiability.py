from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.estimation.free import resolve
from bha.identification import Settings, identify, unknown_combinations
from bha.identification.words import spoken
from bha.parameters import paths

from .identify_logs import measured, multisine, off, one_section

NOMINAL = bha.robots.parameters("bha_nominal")


def information(*known: tuple[list[float], float]) -> np.ndarray:
    """Information made of directions and how precisely each is known."""
    return sum(np.outer(v, v) / d**2 for v, d in known) + 1e-9 * np.eye(len(known[0][0]))


def test_only_the_ratio() -> None:
    coordinates = resolve(NOMINAL, ["section.3.mass", "section.3.stiffness.1"])
    (found,) = unknown_combinations(coordinates, information(([1.0, -1.0], 0.01)))
    assert found.text in (
        "mass of section 3 and linear stiffness of section 3: only their ratio",
        "linear stiffness of section 3 and mass of section 3: only their ratio",
    )


def test_only_the_product() -> None:
    coordinates = resolve(NOMINAL, ["section.3.mass", "section.3.stiffness.1"])
    (found,) = unknown_combinations(coordinates, information(([1.0, 1.0], 0.01)))
    assert found.text.endswith("only their product")


def test_one_alone_and_none() -> None:
    coordinates = resolve(NOMINAL, ["section.1.damping", "section.1.mass"])
    (found,) = unknown_combinations(coordinates, information(([0.0, 1.0], 0.01), ([1.0, 0.0], 2.0)))
    assert found.text == "damping of section 1: not told by these data"
    assert found.deviation == pytest.approx(2.0, rel=1e-3)
    assert unknown_combinations(coordinates, information(([0.0, 1.0], 0.01), ([1.0, 0.0], 0.01))) == ()


def test_one_scale_of_all_forces() -> None:
    """Without gravity a log cannot tell a heavy, stiff, damped arm with large areas from a light one."""
    arm = one_section().with_changes(gravity=[0.0, 0.0, 0.0])

    log = measured(arm, multisine(arm, 4.0, 100.0, 0))
    names = ["mass", "terminal_area", "stiffness.1", "bending_stiffness.1", "damping", "inertia.x"]
    free = ["section.1.mass", "section.1.terminal_area", "section.*.stiffness.*", "section.1.bending_stiffness.1"]
    free += ["section.1.damping"]
    arm = arm.with_changes(rotational_energy=False)
    result = identify(arm, [log], free, settings=Settings(windows=(2.0,), draws=0))
    assert len(names) > len(result.unknown) == 1
    assert set(result.unknown[0].names) == set(free)
    assert result.unknown[0].text.endswith("only their ratios")
    assert not any(e.identified for e in result.estimates)


def test_one_slow_log_does_not_tell_mass_and_damping() -> None:
    arm = one_section()
    time = np.arange(0.0, 12.0, 0.02)
    slow = 1.3e5 + 2e4 * np.sin(2 * np.pi * np.array([0.08, 0.1, 0.13]) * time[:, None])
    log = measured(arm, bha.Input(time, slow))
    free = ["section.1.inertia.z", "section.1.damping", "section.1.stiffness.1", "section.1.bending_stiffness.1"]
    result = identify(arm, [log], free, settings=Settings(windows=(6.0,), draws=0))
    told = {e.path: e.identified for e in result.estimates}
    assert told["section.1.stiffness.1"]
    assert not told["section.1.inertia.z"]
    (estimate,) = [e for e in result.estimates if e.path == "section.1.inertia.z"]
    assert estimate.interval[1] / estimate.interval[0] > 5.0
    assert any("inertia" in warning for warning in result.warnings)


def test_words() -> None:
    assert spoken("section.1.bellows.2.rest_length") == "rest length of bellows 2 of section 1"
    assert spoken("section.*.stiffness.*") == "stiffness of all sections"
    assert spoken("gravity.x") == "gravity along x"
    assert spoken("effect.1.tau") == "tau of effect 1"
    assert spoken("effect.2.*") == "all numbers of effect 2"


def test_noise_of_the_pressures_is_not_taken_for_excitation() -> None:
    """One slow log: the noise of measured pressures shakes the simulated arm, not the real one, and tells nothing."""
    arm = one_section()
    time = np.arange(0.0, 12.0, 0.05)
    wave = np.sin(2.0 * np.pi * time[:, None] / 12.0 + np.array([0.0, 2.1, 4.2]))
    log = measured(arm, bha.Input(time, 1.2e5 + 2e4 * wave), pressure_noise=150.0)
    free = [f"section.1.{key}" for key in ("mass", "stiffness.1", "bending_stiffness.1", "damping")]
    start = off(arm, dict(zip(free, (0.9, 1.1, 0.9, 1.15), strict=True)))
    found = identify(start, [log], free, settings=Settings(windows=(4.0,), step=5e-3, draws=8))
    told = {e.path: e.identified for e in found.estimates}
    assert not told["section.1.damping"]
    assert found.unknown
    for e in found.estimates:
        true = paths.get_value(arm.parameters, e.path)
        assert abs(e.value - true) < 3.0 * e.standard_error
    naive = identify(start, [log], free, settings=Settings(windows=(4.0,), step=5e-3, draws=0))
    assert all(e.identified for e in naive.estimates), "else the log would prove nothing"
