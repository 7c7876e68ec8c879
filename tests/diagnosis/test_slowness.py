"""Lag of the pressures or damping, from commands: the lag where it is told, else the class with its common time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis import Diagnosis, headline
from bha.diagnosis.candidate import Candidate, core_ranges
from bha.diagnosis.catalogue import available
from bha.diagnosis.model import plain_model
from bha.diagnosis.result import Alternative
from bha.diagnosis.slowness import divided, lag_of, lag_or_damping, plain_divisions, relaxation
from bha.diagnosis.valves import coordinates_of, lags_of, with_valves
from bha.estimation.lags import common_with
from bha.estimation.records import record

from .synthetic import one_section

KINDS = ("pressure_lag", "bending_damping")
STIFFNESS = 1300.0
SAMPLE_TIME = 0.02


def slow_arm(own: float) -> bha.Arm:
    """An arm whose damping is so many seconds times its springs' stiffness."""
    return one_section({"damping": own * STIFFNESS / one_section().parameters.sections[0].damping})


def commanded_logs(arm: bha.Arm, lag: float) -> list[bha.Log]:
    """Steps of commands, heads seen, the pressures lagging behind."""
    logs = []
    lagging = arm.with_effects([{"kind": "pressure_lag", "where": "all", "fill": lag, "vent": lag}])
    for number in range(3):
        rng = np.random.default_rng([7, number])
        time = np.arange(round(12.0 / SAMPLE_TIME) + 1) * SAMPLE_TIME
        edges = np.arange(0.0, 13.0, rng.uniform(1.2, 1.8))
        levels = 101325.0 + rng.uniform(0.0, 4e4, (len(edges), 3))
        levels[:2] = 101325.0 + 1e4
        p = levels[np.searchsorted(edges, time, side="right") - 1]
        run = bha.simulate(lagging, bha.Input(time, p), times=time)
        heads = run.head_positions[:, 0] + 2e-4 * rng.standard_normal((len(time), 3))
        columns: dict[str, Any] = {"t [s]": time} | {f"pc1{k + 1} [Pa]": p[:, k] for k in range(3)}
        logs.append(bha.Log.from_arrays(columns | {f"{axis}1 [m]": heads[:, k] for k, axis in enumerate("xyz")}))
    return logs


def diagnosed(lag: float, own: float) -> Diagnosis:
    logs = commanded_logs(slow_arm(own), lag)
    # The file has 0.6 times the damping, which is half of what a plain model needs that takes the lag for damping.
    return bha.diagnose(slow_arm(0.6 * own), logs[:2], logs[2:], kinds=KINDS, pressures="commanded")


def test_a_lag_that_is_much_the_longer_one_is_told_and_leaves_nothing_to_name() -> None:
    found = diagnosed(0.6, 0.2)
    assert found.verdict == "equivalent"
    assert [(e.kind, e.where, e.plain) for e in found.effects] == [("pressure_lag", "all", True)]
    assert "; commands reach the bellows through a lag of 0.6" in headline(found)
    for number in found.effects[0].parameters.values():
        assert number.value == pytest.approx(0.6, rel=0.05)
    assert found.plain["section 1 damping"].value == pytest.approx(0.2 * STIFFNESS, rel=0.15)
    assert found.gap.after < 1.15 * found.gap.noise
    # A refit with another sort of slowness that is as good leaves nothing told, whatever the numbers say.
    other = Alternative(kind="bending_damping", where="all")
    torn = found.model_copy(update={"effects": [found.effects[0].model_copy(update={"one_of": [other]})]})
    arm = slow_arm(0.2)
    records = [record(arm, log, pressures="commanded") for log in commanded_logs(arm, 0.6)[:2]]
    assert lag_or_damping(found, arm, records) == found
    assert lag_or_damping(torn, arm, records).effects[0].slow[0].along == pytest.approx(0.6 + 0.2, rel=0.1)


def test_two_stages_alike_are_one_class_with_their_common_time_and_what_splits_it() -> None:
    lag, own = 0.3, 0.3
    found = diagnosed(lag, own)
    assert found.verdict == "equivalent"
    (effect,) = found.effects
    assert effect.plain
    (times,) = effect.slow
    p = np.full(3, 101325.0 + 2e4)
    (true,) = common_with(slow_arm(own), p, lag)
    assert times.across == pytest.approx(true.across, rel=0.1)
    assert times.along == pytest.approx(true.along, rel=0.1)
    assert "; lag of the pressures or damping (section 1: together " in headline(found)
    # Beside a gap that nothing explains the class is what was found: it comes first, with its numbers.
    lost = headline(found.model_copy(update={"verdict": "unexplained"}))
    assert lost.startswith("Lag of the pressures or damping (section 1: together ")
    assert "; as this fit divides it a lag of " in lost
    assert lost.endswith("; beside it a gap that nothing known explains")
    assert "log the pressures in the chambers" in effect.experiment
    assert {"pressure_lag"} <= {effect.kind, *(other.kind for other in effect.one_of)}
    assert found.next_experiment is None
    # Neither of the two is told: an interval that excludes the true one would say that it is.
    low, high = found.plain["section 1 damping"].ci95 or (np.nan, np.nan)
    assert low <= own * STIFFNESS <= high


def test_stages_are_divided_otherwise_at_the_same_common_time() -> None:
    arm = slow_arm(0.2)
    model = plain_model(arm)
    assert relaxation(model, np.zeros(model.size), (1,)) == pytest.approx(0.2, rel=0.35)  # its springs stiffen
    assert divided(model, np.zeros(model.size), 0.5, 0.1) is None


def test_what_is_slow_under_commands_is_divided_the_other_ways() -> None:
    arm = with_valves(slow_arm(0.2))
    model = plain_model(arm, more=coordinates_of(arm.parameters))
    fill, vent = lags_of(model)
    damping = next(k for k, c in enumerate(model.plain) if c.path == "section.1.damping")
    x = np.zeros(model.size)
    for k, time in ((fill, 0.05), (vent, 0.07)):
        x[k] = model.plain[k].coordinate(time)
    x[damping] = model.plain[damping].coordinate(5.0 * model.plain[damping].start)
    was = relaxation(model, x, (1,))
    filed, short = plain_divisions(model, x)
    assert filed[damping] == 0.0
    for k, time in ((fill, 0.05), (vent, 0.07)):
        assert model.plain[k].value(float(filed[k])) == pytest.approx(time + 0.8 * was)
        assert model.plain[k].value(float(short[k])) == model.plain[k].lower
    assert relaxation(model, short, (1,)) == pytest.approx(was + 0.06)
    still = plain_model(slow_arm(0.2))
    assert plain_divisions(still, np.zeros(still.size)) == []


def test_a_lag_of_one_section_is_exchanged_with_the_damping_of_that_section_alone() -> None:
    arm = bha.robots.load("bha_nominal")
    kind = next(plan for plan in available(("pressure_lag",)))
    term, begin = Candidate(kind, "section 2", {"tau": 0.4}).term((1.0, 1.0), core_ranges())
    plain = plain_model(arm)
    model = plain.with_effects([term])
    x = np.concatenate([np.zeros(plain.size), begin])
    found = lag_of(model, x)
    assert found is not None
    assert found.sections == (2,)
    before = {k: relaxation(model, x, (k,)) for k in (1, 2, 3)}
    other = divided(model, x, 0.1, 3.0 * before[2])
    assert other is not None
    now = lag_of(model, other)
    assert now is not None
    assert now.time == pytest.approx(0.1)
    assert {k: relaxation(model, other, (k,)) / before[k] for k in (1, 2, 3)} == pytest.approx({1: 1, 2: 3, 3: 1})


def test_filling_and_venting_told_apart_tell_no_lag_from_damping() -> None:
    """An arm that comes back slower than it bends lags unlike, too: the class, and which way is the slower one."""
    found = diagnosed(0.6, 0.2)
    fill, vent = (found.effects[0].parameters[name] for name in ("fill", "vent"))
    unlike = {
        "fill": fill.model_copy(update={"value": 0.1, "ci95": (0.08, 0.12)}),
        "vent": vent.model_copy(update={"value": 0.5, "ci95": (0.45, 0.55)}),
    }
    lag = found.effects[0].model_copy(update={"parameters": unlike, "plain": False})
    named = found.model_copy(update={"verdict": "named", "effects": [lag]})
    arm = slow_arm(0.5)
    records = [record(arm, log, pressures="commanded") for log in commanded_logs(arm, 0.3)[:2]]
    told = lag_or_damping(named, arm, records)
    assert told.verdict == "one_of"
    assert "Lag of the pressures or damping" in headline(told)
    assert "slower when venting" in headline(told)
    for number in told.effects[0].parameters.values():
        assert number.ci95 is not None
        assert number.ci95[0] == 0.0
