"""Statics first: from any guess the same arm, the scale tied to the mass, damping and lag in their valley."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bha
from bha.estimation.begin import _started, begin
from bha.estimation.free import FreeParameter, resolve
from bha.estimation.lags import with_lag
from bha.estimation.records import record
from bha.estimation.scale import default_free_of, scale_of
from bha.estimation.statics import fit_statics
from bha.identification import Settings, identify
from bha.parameters import paths

from .slow_arm import BENDING_DAMPING, LAG, TRUE, arm_of, log_of

AREA_BY_STIFFNESS = TRUE["terminal_area"] / TRUE["stiffness"]
QUICK = Settings(draws=0)


def guessed(stiffness: float) -> bha.Arm:
    return arm_of({"stiffness": stiffness, "terminal_area": 9e-5, "bending_stiffness": 0.2, "damping": 1.0})


@pytest.mark.parametrize("stiffness", [3.0, 1800.0])
def test_statics_lead_from_any_guess_to_the_same_arm(stiffness: float) -> None:
    arm = guessed(stiffness)
    records = [record(arm, log_of(arm_of(TRUE, apart=True), 1, duration=20.0))]
    found = fit_statics(arm.parameters, resolve(arm.parameters, default_free_of(arm.parameters, records)), records)
    assert found is not None
    values = found.values
    ratio = values["section.1.terminal_area"] / values["section.1.stiffness.1"]
    assert ratio == pytest.approx(AREA_BY_STIFFNESS, rel=0.03)
    assert values["section.1.mass"] == pytest.approx(0.5, rel=0.1)
    assert found.spread < 4e-4


def test_an_arm_from_a_tape_measure_is_identified_with_defaults() -> None:
    true = arm_of(TRUE, apart=True)
    found = identify(guessed(600.0), [log_of(true, 1)], holdout=[log_of(true, 2)], settings=QUICK)
    assert found.converged
    values = {e.path: e.value for e in found.estimates}
    ratio = values["section.1.terminal_area"] / values["section.1.stiffness.1"]
    # Springs may be curved, and their slope at rest is told less well than where the arm moves.
    assert ratio == pytest.approx(AREA_BY_STIFFNESS, rel=0.03)
    assert values["section.1.mass"] == pytest.approx(0.5, rel=0.1)
    # Bending lags longer than stretching: its damping is a number of its own, on the scale of the others.
    scale = values["section.1.stiffness.1"] / TRUE["stiffness"]
    assert values["effect.1.damping"] == pytest.approx(scale * BENDING_DAMPING, rel=0.1)
    assert values["section.1.damping"] == pytest.approx(scale * TRUE["damping"], rel=0.1)
    assert np.max(found.held_out[0].after.rms) < 2.6e-4
    assert any("masses" in note for note in found.notes)
    assert any("bending_damping" in note for note in found.notes)
    assert found.common_times == ()


def test_commands_act_through_a_lag_that_is_found_with_the_damping() -> None:
    true = arm_of(TRUE, apart=True, lag=LAG)
    found = identify(guessed(600.0), [log_of(true, 1, commanded=True)], settings=QUICK)
    assert any("effect.1 is delay (all)" in note for note in found.notes)
    assert found.converged
    (time,) = found.common_times
    own = arm_of(TRUE, apart=True)
    pressures = np.full(4, 101325.0 + 2.5e4)
    straight, pushed = (own.static_lengths(pressures + np.array([d, 0.0, -d, 0.0])) for d in (0.0, 2e3))
    # Bending by a couple of pressures: stiffness from the pose it holds, damping over it is the relaxation.
    couple = own.actuation_force(straight, pressures + np.array([2e3, 0.0, -2e3, 0.0])) - own.actuation_force(
        straight, pressures
    )
    change = pushed - straight
    rate = change / np.linalg.norm(change)
    damped = own.bias_force(straight, rate) - own.bias_force(straight, 0.0 * rate)
    relaxation = (rate @ damped) * np.linalg.norm(change) / (rate @ couple)
    assert time.across == pytest.approx(LAG + relaxation, rel=0.1)
    assert any("commands" in note and "together" in note for note in found.notes)
    table = found.parameters().pneumatics
    assert table is not None
    assert table.level == "lag"
    assert max(r.rms / r.noise for r in found.residuals) < 1.3


def test_a_camera_that_is_turned_by_half_is_found_and_said() -> None:
    log = log_of(arm_of(TRUE, apart=True), 3, turn=np.pi)
    with pytest.warns(bha.LogWarning, match="azimuth"):
        found = identify(guessed(200.0), [log], settings=QUICK)
    turn = next(e.value for e in found.estimates if e.path == "sensors.camera_rotation.z")
    assert abs(turn) == pytest.approx(np.pi, abs=0.05)
    assert max(r.rms / r.noise for r in found.residuals) < 1.3


def test_a_good_file_is_its_own_start() -> None:
    arm = arm_of(TRUE)
    records = [record(arm, log_of(arm, 1))]
    found = begin(arm, records, default_free_of(arm.parameters, records), whole=False)
    assert found.from_file
    assert found.statics is None
    starts = {f.path: f.start for f in found.free}
    assert starts["section.1.stiffness.1"] == TRUE["stiffness"]


def test_the_scale_rests_on_what_is_published_or_weighed() -> None:
    arm = arm_of(TRUE)
    records = [record(arm, log_of(arm, 1, duration=6.0))]
    stated = {f.path: f for f in default_free_of(arm.parameters, records)}
    assert stated["section.1.mass"].prior == pytest.approx((0.5, 0.075))
    mapping = arm.parameters.to_mapping()
    mapping["section"][0]["provenance"] = {"mass": "measured"}
    weighed = {f.path: f for f in default_free_of(arm.parameters.updated(mapping), records)}
    assert weighed["section.1.mass"].prior == pytest.approx((0.5, 0.025))
    assert "section.1.terminal_area" in weighed
    assert "masses" in scale_of(arm.parameters, tuple(weighed.values()))
    mapping["section"][0]["provenance"] = {"terminal_area": "published"}
    published = arm.parameters.updated(mapping)
    drawn = {f.path: f for f in default_free_of(published, records)}
    assert "section.1.terminal_area" not in drawn
    assert drawn["section.1.mass"].prior != weighed["section.1.mass"].prior
    assert "areas" in scale_of(published, tuple(drawn.values()))


def test_a_lag_is_free_under_commands_only() -> None:
    arm = arm_of(TRUE)
    same, none = with_lag(arm, [record(arm, log_of(arm, 1, duration=6.0))])
    assert same is arm
    assert none == ()
    commanded = [record(arm, log_of(arm, 1, commanded=True, duration=6.0))]
    lagging, free = with_lag(arm, commanded)
    assert [f.path for f in free] == ["pneumatics.fill_time", "pneumatics.vent_time", "effect.1.time"]
    assert lagging.parameters.effects[0].kind == "delay"
    assert paths.get_value(lagging.parameters, "pneumatics.vent_time") > 0


def test_a_start_at_its_bound_is_within_it() -> None:
    """ln(1e4 / 3000) and back is beyond 1e4 by rounding: what begins there must still be allowed to begin."""
    parameters = bha.robots.parameters("bha_nominal")
    coordinates = resolve(parameters, [FreeParameter("section.1.damping", start=3000.0, upper=1e4)])
    (started,) = _started(coordinates, np.array([coordinates[0].bounds[1]]))
    assert resolve(parameters, [started])[0].start == 1e4


@pytest.mark.parametrize(("drift", "creeps"), [(0.0, False), (6e-3, True)])
def test_a_slow_arm_that_errs_for_seconds_creeps(drift: float, creeps: bool) -> None:
    """What no model of held poses explains, as long as a window and longer: whole logs, not first states, bear it."""
    arm = guessed(600.0)
    rec = record(arm, log_of(arm_of(TRUE, apart=True), 1))
    records = [replace(rec, measured=rec.measured + drift * np.sin(2.0 * np.pi * rec.time[:, None] / 25.0))]
    found = begin(arm, records, default_free_of(arm.parameters, records), whole=False, splits=True)
    assert found.creeps == creeps
