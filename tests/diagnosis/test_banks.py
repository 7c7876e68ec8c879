"""Families as banks: densities of yields and spectra of times, linear in strengths that are not negative."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

import bha
from bha.diagnosis import screen
from bha.diagnosis.candidate import Candidate, core_ranges
from bha.diagnosis.catalogue import available
from bha.diagnosis.plan import together

from .slip_arm import slip_logs
from .synthetic import make_logs, one_section

PRODUCT = one_section({"mass": 0.93, "stiffness": 1.1, "rest_length": 0.9, "damping": 1.12, "bending_stiffness": 1.1})
PLANS = {plan.kind: plan for plan in available(None)}
KINDS = ("hysteresis", "creep", "friction", "quadratic_damping", "valve_dead_band", "bending_nonlinear")
YIELDS, FORCES = (1e-3, 4e-3, 10e-3, 25e-3), (2.0, 2.0, 2.0, 2.0)


def test_an_arm_of_four_slipping_elements_has_hysteresis_with_their_yields(tmp_path: Path) -> None:
    logs = slip_logs(YIELDS, FORCES, (5.0, 4.0, 4.0))
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=KINDS, out=tmp_path, report=False)
    assert [(e.kind, e.where) for e in found.effects] == [("hysteresis", "all")]
    # The true model leaves the noise. One element, smooth or not, leaves four times as much.
    assert found.gap.before > 10.0 * found.gap.noise
    assert found.gap.after < 1.3 * found.gap.noise
    (effect,) = found.effects
    assert len(effect.elements) >= 4
    forces = np.array([e["amplitude"].value for e in effect.elements])
    yields = np.array([e["yield"].value for e in effect.elements])
    assert np.all(forces > 0.0)
    assert effect.parameters["amplitude"].value == pytest.approx(np.sum(forces))
    assert np.sum(forces) == pytest.approx(sum(FORCES), rel=0.05)
    # The density: within a fifth of the whole of what yields up to any length between the true ones.
    for length in (2e-3, 6e-3, 15e-3):
        true = sum(f for y, f in zip(YIELDS, FORCES, strict=True) if y < length)
        assert np.sum(forces[yields < length]) == pytest.approx(true, abs=0.2 * sum(FORCES))
    # Each is an effect of its own in the file.
    written = bha.Arm.load(tmp_path / "arm_diagnosed.toml").parameters.effects
    assert [e.parameters["yield"] for e in written] == pytest.approx(list(yields))
    assert {e.parameters["sharpness"] for e in written} == {1.0}


def test_a_spectrum_of_times_is_creep_and_one_time_stays_one_branch() -> None:
    branches = [(60.0, 0.1), (60.0, 1.0), (60.0, 8.0)]
    hidden = [{"kind": "creep", "where": "all", "parameters": {"stiffness": k, "tau": t}} for k, t in branches]
    kinds = ("creep", "hysteresis", "quadratic_damping")
    for effects in (hidden, hidden[1:2]):
        logs = make_logs(one_section(), effects, seed=2, durations=(6.0, 4.0, 4.0))
        found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=kinds)
        assert [(e.kind, e.where) for e in found.effects] == [("creep", "all")]
        assert found.gap.after < 1.3 * found.gap.noise
        assert (len(found.effects[0].elements) > 1) == (len(effects) > 1)
    assert found.effects[0].parameters["tau"].value == pytest.approx(1.0, rel=0.05)


def test_a_bank_is_one_candidate_with_a_strength_an_element() -> None:
    plan = PLANS["hysteresis"]
    bank = Candidate(plan, "section 1", {}, plan.bank[1:4])
    assert bank.size == 3
    term, start = bank.term((1.0, 0.0, 2.0), core_ranges())
    assert start == [0.0, 0.0, 0.0]
    assert len({c.name for c in term.coordinates}) == 3
    x = [c.coordinate(value) for c, value in zip(term.coordinates, (0.5, 0.0, 3.0), strict=True)]
    assert [e["amplitude"] for e in term.elements(x)] == [0.5, 0.0, 3.0]
    assert [e["yield"] for e in term.elements(x)] == [own["yield"] for own in plan.bank[1:4]]
    # One scale, whatever the screening expects of each: it is wrong of which element acts where it is far off.
    assert {c.scale for c in term.coordinates} == {2.0}
    # A strength of nothing is no bound that the whole would sit on; strengths that are all nothing are.
    assert term.on_bound(np.array(x)) == set()
    assert term.on_bound(np.zeros(3)) == {"amplitude"}
    own = term.only([2])
    assert own.elements([x[2]]) == term.elements(x)[2:]
    finer = bank.finer()
    assert len(finer.bank) == 2 * len(plan.bank) - 1
    assert [own["yield"] for own in finer.bank] == sorted(own["yield"] for own in finer.bank)


def test_strengths_of_a_bank_are_the_best_that_are_not_negative() -> None:
    rng = np.random.default_rng(4)
    for _ in range(5):
        a, b = rng.standard_normal((30, 4)), rng.standard_normal(30)
        normal, right = a.T @ a, a.T @ b
        score, strengths = screen.together(normal, right[:, None])
        found = minimize(lambda s, a=a, b=b: float(np.sum((a @ s - b) ** 2)), np.ones(4), bounds=[(0.0, None)] * 4)
        np.testing.assert_allclose(strengths[:, 0], found.x, atol=1e-4)
        assert score[0] == pytest.approx(float(b @ b) - found.fun, abs=1e-6)


def test_elements_together_are_sums_and_means_of_logarithms() -> None:
    elements = [{"yield": 1e-3, "amplitude": 1.0, "start": 0.0}, {"yield": 4e-3, "amplitude": 3.0, "start": 0.0}]
    found = together(elements, ("amplitude",))
    assert found["amplitude"] == 4.0
    assert found["yield"] == pytest.approx(1e-3 * 4.0**0.75)
    # Stages of a lag: their times add up; a single element is itself.
    assert together([{"fill": 0.1, "vent": 0.2}, {"fill": 0.3, "vent": 0.1}], ("fill", "vent")) == {
        "fill": pytest.approx(0.4),
        "vent": pytest.approx(0.3),
    }
    assert together(elements[:1], ("amplitude",)) == elements[0]
