"""What slips inside an arm is strained where a log begins, as far as it can hold the arm there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha.diagnosis.candidate import Candidate
from bha.diagnosis.catalogue import PLANS
from bha.diagnosis.contenders import with_what_slips
from bha.diagnosis.plain import remembering
from bha.diagnosis.preparation import prepare
from bha.diagnosis.screen import Scored
from bha.estimation.asked import stands_elsewhere
from bha.estimation.begin import begin
from bha.estimation.preload import of_record, with_preloads
from bha.estimation.records import record
from bha.estimation.scale import default_free_of
from bha.identification import predict
from bha.recordings import Recording
from bha.recordings.strained import one_a_bellows, slips, strains, with_starts

from .slow_arm import TRUE, arm_of, log_of

#: What slips.
SLIPS = {"amplitude": 1.5, "yield": 4e-3, "sharpness": 1.0}
AZIMUTHS = np.radians([20.0, 110.0, 200.0, 290.0])


def told() -> bha.Arm:
    """An arm that slips inside, strained as first poses tell."""
    plain = arm_of(TRUE, apart=True)
    effects = [*plain.parameters.effects, {"kind": "hysteresis", "where": "section 1", **SLIPS}]
    return bha.Arm(with_preloads(plain.with_effects(effects).parameters))


def log_of_strained(along: float, to_x: float, to_y: float) -> bha.Log:
    """A log of its tip under steps, from where the strain of its bellows, w even and across, holds it."""
    w = along + to_x * np.cos(AZIMUTHS) + to_y * np.sin(AZIMUTHS)
    own = [{"kind": "hysteresis", "where": f"bellows 1{k}", **SLIPS, "start": s} for k, s in enumerate(w, start=1)]
    plain = arm_of(TRUE, apart=True)
    return log_of(plain.with_effects([*plain.parameters.effects, *own]), 3)


def test_elements_share_what_they_can_hold() -> None:
    parameters = bha.robots.parameters("bha_nominal")
    effects = [
        {"kind": "hysteresis", "where": "all", "parameters": {"amplitude": 2.0, "yield": 0.01}},
        {"kind": "hysteresis", "where": "section 1", "parameters": {"amplitude": 1.0, "yield": 0.03}},
        {"kind": "creep", "where": "all", "parameters": {"stiffness": 1.0, "tau": 1.0}},
    ]
    assert slips(effects)
    each = one_a_bellows(effects, parameters)
    bellows = [f"bellows {section}{k}" for section in (1, 2, 3) for k in (1, 2, 3)]
    assert [e["where"] for e in each] == [*bellows, *bellows[:3], "all"]
    # What bellows do to arc coordinates, 3 N each in section 1 and 2 N in section 2.
    acts = np.array([[0.02, -0.01, -0.01], [0.0, 0.0173, -0.0173], [-1.0, -1.0, -1.0]])
    w = np.array([0.4, -0.2, 0.1])

    def needed(starts: NDArray[np.float64]) -> NDArray[np.float64]:
        first = acts @ (2.0 * (w - starts[:3]) + 1.0 * (w - starts[9:12]))
        return np.concatenate([first, np.array([0.0, 0.0, -18.0]) - acts @ (2.0 * starts[3:6])])

    starts, left = strains(each, (1, 2), needed)
    assert starts[:3] == pytest.approx(w)
    assert starts[9:] == pytest.approx(w)
    # None holds more than its amplitude, and what nobody asks for stays as it is.
    assert starts[3:6] == pytest.approx(np.ones(3))
    assert starts[6:9] == pytest.approx(np.zeros(3))
    assert left == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, -12.0], abs=1e-9)
    assert [e["parameters"].get("start") for e in with_starts(each, starts)] == [*starts, None]
    said = [{"kind": "hysteresis", "where": "section 1", "parameters": {"amplitude": 1.0, "start": 0.4}}]
    assert not slips(said)
    assert one_a_bellows(said, parameters) == said


@pytest.mark.parametrize("strain", [(-0.5, 0.4, 0.0), (0.3, -0.2, 0.6)])
def test_a_log_is_predicted_from_the_strain_that_its_first_pose_tells(strain: tuple[float, float, float]) -> None:
    log, arm = log_of_strained(*strain), told()

    def error(model: bha.Arm) -> float:
        return float(predict(model, [record(model, log)])[0].head_rms[1])

    effects = list(arm.parameters.effects)
    constant = arm.with_effects([e for e in effects if e.kind != "hysteresis"])
    unstrained = arm.with_effects([e for e in effects if e.kind != "preload"])
    assert error(arm) < 6e-4
    assert error(constant) > 3e-3
    assert error(unstrained) > 1.3 * error(arm)
    # Nothing is left to a constant force, for simulations as for fits.
    assert np.abs(list(of_record(arm, record(arm, log)).values())).max() < 0.05
    run = bha.simulate(arm, log, times=log["t"])
    heads = np.column_stack([log[name] for name in ("x1", "y1", "z1")])
    assert np.sqrt(np.mean((run.head_positions[:, 0] - heads) ** 2)) < 6e-4


def test_logs_that_begin_elsewhere_ask_for_what_slips() -> None:
    guess = arm_of({"stiffness": 200.0, "terminal_area": 9e-5, "bending_stiffness": 0.2, "damping": 1.0})
    first, other, again = (
        log_of_strained(*strain) for strain in ((-0.5, 0.4, 0.0), (0.3, -0.2, 0.6), (-0.5, 0.4, 0.0))
    )
    records = [record(guess, log) for log in (first, other)]
    assert stands_elsewhere(records)
    assert not stands_elsewhere([record(guess, log) for log in (first, again)])
    assert not stands_elsewhere(records[:1])
    # Put up anew, or changed, it may stand elsewhere for another reason.
    assert not stands_elsewhere([records[0], record(guess, other, session="another day")])
    found = begin(guess, records, default_free_of(guess.parameters, records), whole=False, splits=True)
    assert {"preload", "hysteresis"} <= {effect.kind for effect in found.arm.parameters.effects}
    assert len(found.said) == 2
    assert {f"section.1.{name}" for name in ("rest_length", "stiffness.1")} <= {f.path for f in found.free}


def test_a_diagnosis_of_such_logs_asks_what_slips() -> None:
    guess = arm_of(TRUE, apart=True)
    logs = [log_of_strained(*strain) for strain in ((-0.5, 0.4, 0.0), (0.3, -0.2, 0.6))]
    records = [prepare(Recording(guess, log)) for log in logs]
    found = remembering(guess, records)
    assert [effect.kind for effect in found.parameters.effects][-1] == "preload"
    assert remembering(found, records) is found
    assert remembering(guess, records[:1]) is guess
    # The bank of all bellows is refitted whatever small strengths promise; once.
    plan = next(plan for plan in PLANS if plan.kind == "hysteresis")
    bank, single = Candidate(plan, "all", {}, plan.bank), Candidate(plan, "all", {"yield": 6e-3})
    ranking = [Scored(single, 0.0, (0.0,), 0.0, 1.0)]
    first = with_what_slips([], ranking, [])
    assert [scored.candidate for scored in first] == [bank]
    assert with_what_slips(first, ranking, []) == first
    assert with_what_slips([], ranking, [("hysteresis", "all")]) == []
