"""Curved springs and chambers that are not alike are free where logs ask for them, and only there."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.estimation.begin import Begin, begin
from bha.estimation.lags import with_lag
from bha.estimation.records import record
from bha.estimation.scale import default_free_of, with_curved_springs
from bha.logs import Log

from .slow_arm import LAG, TRUE, arm_of, log_of

GAINS, TURNS = (0.08, -0.06, 0.05, -0.07), (4.0, -3.0, -4.0, 3.0)


def begun(*logs: Log) -> Begin:
    guess = arm_of({"stiffness": 200.0, "terminal_area": 9e-5, "bending_stiffness": 0.2, "damping": 1.0})
    records = [record(guess, log) for log in logs]
    arm, lags = with_lag(guess, records)
    free = (*default_free_of(arm.parameters, records), *lags)
    return begin(arm, records, free, whole=bool(lags), splits=True)


def kinds(found: Begin) -> set[str]:
    return {effect.kind for effect in found.arm.parameters.effects}


def unlike(sign: float) -> bha.Arm:
    """The arm whose chambers differ by the gains and azimuths, or by their opposites."""
    mapping = arm_of(TRUE, apart=True).parameters.to_mapping()
    for bellows, gain, turn in zip(mapping["section"][0]["bellows"], GAINS, TURNS, strict=True):
        bellows["terminal_area"] = TRUE["terminal_area"] * (1.0 + sign * gain)
        bellows["angle_deg"] += sign * turn
    return bha.Arm(arm_of(TRUE).parameters.updated(mapping))


@pytest.mark.parametrize("seeds", [(1,), (1, 2)])
def test_chambers_that_are_not_alike_get_gains_and_azimuths(seeds: tuple[int, ...]) -> None:
    true = unlike(1.0)
    found = begun(*[log_of(true, seed, duration=20.0) for seed in seeds])
    assert "pressure_gain" in kinds(found)
    assert len(found.said) == 1
    starts = [f.start for f in found.free if f.path.endswith(".gain")]
    # Their mean is the area's, and the mean turn the camera's.
    gains = np.array([start for start in starts if start is not None])
    assert gains - gains.mean() == pytest.approx(np.array(GAINS) - np.mean(GAINS), abs=0.02)
    assert found.trial.spread < 1e-3


def test_what_chambers_differ_by_in_one_log_alone_is_not_kept() -> None:
    """No other log confirms it: a gap of the model that follows a motion looks the same and does not carry over."""
    logs = [log_of(unlike(1.0), seed, duration=20.0, driven=pair) for seed, pair in ((1, (0, 1)), (2, (2, 3)))]
    assert "pressure_gain" not in kinds(begun(*logs))


def test_powers_of_springs_are_free_where_the_file_has_one() -> None:
    arm = arm_of(TRUE)
    changed = with_curved_springs(arm)
    assert changed.parameters.sections[0].stiffness == (TRUE["stiffness"], 0.0, 0.0)
    free = {f.path: f for f in default_free_of(changed.parameters, ())}
    # A tenth of the spring's force at the ends of a range of 0.3 m.
    assert free["section.1.stiffness.2"].prior == pytest.approx((0.0, 0.1 * TRUE["stiffness"] / 0.15))
    assert free["section.1.stiffness.3"].prior == pytest.approx((0.0, 0.1 * TRUE["stiffness"] / 0.15**2))
    assert with_curved_springs(changed) is changed


def test_equal_chambers_and_prompt_commands_ask_for_nothing() -> None:
    found = begun(log_of(arm_of(TRUE, apart=True, lag=LAG), 1, commanded=True, duration=20.0))
    assert found.said == ()
    assert "pressure_gain" not in kinds(found)
    assert _late(found) <= 0.05


def test_commands_that_act_late_begin_with_a_dead_time() -> None:
    mapping = arm_of(TRUE, apart=True, lag=LAG).parameters.to_mapping()
    mapping["effect"].append({"kind": "delay", "where": "all", "time": 0.15})
    true = bha.Arm(arm_of(TRUE).parameters.updated(mapping))
    found = begun(log_of(true, 1, commanded=True, duration=20.0))
    assert 0.05 <= _late(found) <= 0.3


def _late(found: Begin) -> float:
    """The dead time with which a fit begins, s."""
    late = next(f.start for f in found.free if f.path.endswith(".time"))
    assert late is not None
    return late
