"""Lag and dead time of commands as numbers of the plain model: where they stand, where they begin, what is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis.model import plain_model
from bha.diagnosis.valves import (
    begun,
    coordinates_of,
    drawn,
    found_valves,
    lags_of,
    starts_of,
    through,
    with_valves,
    without_valves,
)
from bha.estimation.records import record

from .synthetic import one_section

LAG, LATE = {"fill": 0.2, "vent": 0.3}, 0.06
VALVES = [{"kind": "pressure_lag", "where": "all", **LAG}, {"kind": "delay", "where": "all", "time": LATE}]


def test_a_dead_time_is_differenced_by_as_much_as_an_integrator_resolves() -> None:
    arm = with_valves(one_section())
    model = plain_model(arm, more=coordinates_of(arm.parameters))
    dead = next(k for k, c in enumerate(model.plain) if c.path.endswith(".time"))
    _, moved, step = model._moved(dead, np.zeros(model.size))
    assert step > 0.0
    assert model.plain[dead].value(float(moved[dead])) - model.plain[dead].value(0.0) == pytest.approx(1e-3)
    assert model._moved(0, np.zeros(model.size))[2] == model.differences.parameter


def commanded_log(arm: bha.Arm, seed: int, noise: float = 2e-4) -> bha.Log:
    """Held commands that an arm's effects pass on, and its lengths."""
    rng, time = np.random.default_rng([11, seed]), np.arange(601) * 0.02
    levels = 101325.0 + np.vstack([[1e4] * 3, rng.uniform(0.0, 5e4, (9, 3))])
    p = levels[np.minimum((time / 1.3).astype(int), 9)]
    run = bha.simulate(arm, bha.Input(time, p, interpolation="hold"), times=time)
    q = run.lengths + noise * rng.standard_normal(run.lengths.shape)
    columns: dict[str, Any] = {"t [s]": time} | {f"pc1{k + 1} [Pa]": p[:, k] for k in range(3)}
    return bha.Log.from_arrays(columns | {f"q1{k + 1} [m]": q[:, k] for k in range(3)})


def test_lag_and_dead_time_stand_among_the_arms_effects_unless_its_file_has_them() -> None:
    arm = one_section()
    assert [(e.kind, e.where) for e in with_valves(arm).parameters.effects] == [
        ("pressure_lag", "all"),
        ("delay", "all"),
        ("pressure_lag", "all"),
    ]
    names = [c.path for c in coordinates_of(with_valves(arm).parameters)]
    assert names == ["effect.1.fill", "effect.1.vent", "effect.2.time", "effect.3.fill"]
    # One time of the second stage for both ways.
    assert coordinates_of(with_valves(arm).parameters)[-1].members == ("effect.3.fill", "effect.3.vent")
    model = plain_model(with_valves(arm), more=coordinates_of(with_valves(arm).parameters))
    assert [model.plain[k].path for k in lags_of(model)] == names[:2]
    own = arm.with_effects([{"kind": "creep", "where": "all", "stiffness": 50.0, "tau": 1.0}, *VALVES[::-1]])
    assert with_valves(own) is own
    assert [c.path for c in coordinates_of(own.parameters)] == ["effect.2.time", "effect.3.fill", "effect.3.vent"]
    lagging = arm.with_parameters(
        arm.parameters.updated({"pneumatics": {"level": "lag", "fill_time": 0.1, "vent_time": 0.2}})
    )
    known = with_valves(lagging)
    assert [e.kind for e in known.parameters.effects] == ["delay"]
    names = [c.path for c in coordinates_of(known.parameters)]
    assert names == ["pneumatics.fill_time", "pneumatics.vent_time", "effect.1.time"]
    published = {"status": "published", "source": "data sheet"}
    known = arm.with_effects([{**VALVES[0], "provenance": {"fill": published, "vent": published}}, VALVES[1]])
    assert [c.path for c in coordinates_of(known.parameters)] == ["effect.2.time"]


def test_a_stretch_is_driven_by_what_the_effects_make_of_all_commands() -> None:
    arm = one_section()
    lagging = arm.with_effects(VALVES)
    rec = record(arm, commanded_log(lagging, 0), pressures="commanded")
    driven = through(lagging.parameters, rec)
    time = rec.time
    wanted = bha.simulate(lagging, rec.drive, times=time).lengths
    found = bha.simulate(arm, driven.drive, times=time).lengths
    assert np.max(np.abs(wanted - found)) < 0.02 * np.ptp(wanted)
    model = without_valves(plain_model(lagging, more=coordinates_of(lagging.parameters)))
    assert model.parameters.effects == ()
    assert model.size == plain_model(arm).size


def test_simulations_say_where_lag_and_dead_time_begin() -> None:
    arm = one_section()
    log = commanded_log(arm.with_effects(VALVES), 1)
    records = [record(arm, log, pressures="commanded")]
    lagging = with_valves(arm)
    starts = starts_of(lagging, records, 1)
    assert len({start.damping for start in starts}) == len(starts) == 2
    lag, late, second = begun(lagging, min(starts, key=lambda start: abs(start.damping - 1.0))).parameters.effects
    assert second == lagging.parameters.effects[2]
    assert lag.parameters["fill"] == 0.2
    assert late.parameters["time"] in (0.05, 0.1)


def test_they_are_said_and_written_and_what_is_left_is_equivalent(tmp_path: Path) -> None:
    arm = one_section()
    logs = [commanded_log(arm.with_effects(VALVES), seed) for seed in range(3)]
    off = one_section({"stiffness": 0.85, "damping": 1.3, "mass": 1.1})
    found = bha.diagnose(off, logs[:2], logs[2:], kinds=("creep",), pressures="commanded", out=tmp_path, report=False)
    assert found.verdict == "equivalent"
    assert found.gap.before < 1.1 * found.gap.noise
    assert found.missing == []
    lag, late = found.of_commands
    for name, true in LAG.items():
        low, high = lag.parameters[name].ci95 or (np.nan, np.nan)
        assert low < true < high
        assert high - low < 0.2 * true
    assert late.parameters["time"].value == pytest.approx(LATE, abs=5e-3)
    written = bha.Arm.load(tmp_path / "arm_diagnosed.toml").parameters.effects
    assert [(e.kind, e.where) for e in written] == [("pressure_lag", "all"), ("delay", "all"), ("pressure_lag", "all")]
    # These valves have one stage.
    assert written[2].parameters["fill"] == written[2].parameters["vent"] < 0.1 * LAG["fill"]
    assert written[2].provenance["vent"].status == "identified"
    assert written[0].parameters["fill"] == pytest.approx(lag.parameters["fill"].value)
    assert written[0].provenance["vent"].status == "identified"


def test_where_commands_act_at_once_nothing_is_said() -> None:
    arm = with_valves(one_section())
    model = plain_model(arm, more=coordinates_of(arm.parameters))
    x = np.zeros(model.size)
    x[[k for k, c in enumerate(model.plain) if c.path.startswith("effect.1.")]] = -10.0  # at the least lag
    draws = 0.1 * np.random.default_rng(0).standard_normal((50, model.size))
    assert found_valves(model, x, draws) == []


def test_a_lag_of_two_stages_is_said_by_the_times_of_both() -> None:
    arm = with_valves(one_section())
    model = plain_model(arm, more=coordinates_of(arm.parameters))
    wanted = {"effect.1.fill": 0.1, "effect.1.vent": 0.4, "effect.3.fill": 0.2}
    x = np.array([c.coordinate(wanted[c.path]) if c.path in wanted else 0.0 for c in model.plain])
    draws = np.zeros((50, model.size))
    # What one stage is longer by the other is shorter by.
    for path, sign in (("effect.1.fill", 1.0), ("effect.3.fill", -1.0)):
        k = next(k for k, c in enumerate(model.plain) if c.path == path)
        changed = wanted[path] + sign * np.linspace(-0.05, 0.05, 50)
        draws[:, k] = [model.plain[k].coordinate(v) - x[k] for v in changed]
    (lag,) = found_valves(model, x, draws)
    assert lag.parameters["fill"].value == pytest.approx(0.3)
    assert lag.parameters["fill"].ci95 == pytest.approx((0.3, 0.3))
    assert lag.parameters["vent"].value == pytest.approx(0.6)
    first, second = lag.elements
    assert first["fill"].value == pytest.approx(0.1)
    assert first["fill"].ci95 == pytest.approx((0.0525, 0.1475), abs=1e-3)
    assert second["vent"].value == pytest.approx(0.2)


def test_a_short_time_that_a_models_own_error_leaves_open_is_drawn_as_a_time() -> None:
    """In logarithms a standard deviation of five would reach from nothing to the greatest time that is allowed."""
    fill = coordinates_of(with_valves(one_section()).parameters)[0]
    value = fill.coordinate(0.01)
    told, open_ = np.array([-0.1, 0.0, 0.1]), np.array([-5.0, 0.0, 5.0])
    assert drawn(fill, value, told) == pytest.approx(0.01 * np.exp(fill.scale * told))
    assert drawn(fill, value, open_) == pytest.approx([fill.lower, 0.01, 0.01 * (1.0 + 5.0 * fill.scale)])
