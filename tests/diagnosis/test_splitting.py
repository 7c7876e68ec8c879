"""Pressures that split a class."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bha
from bha.diagnosis.result import Alternative, Diagnosis, Effect, Gap, Number
from bha.diagnosis.splitting import Shown, apart, arms_of_class, split
from bha.diagnosis.words import experiment_in_words
from bha.diagnosis.written import NEXT_EXPERIMENT, RESULTS, experiment_of

from .synthetic import observation, one_section

NOISE = 3e-4
OBSERVATION = observation("q11", "q12", "q13")


def named(*others: Alternative) -> Effect:
    return Effect(
        kind="weak_bellows",
        where="bellows 12",
        parameters={"change": Number(value=-0.25, unit="")},
        confidence=1.0,
        one_of=list(others),
    )


def alternative(kind: str, where: str, **numbers: float) -> Alternative:
    return Alternative(kind=kind, where=where, parameters={k: Number(value=v, unit="") for k, v in numbers.items()})


TILT = alternative("base_tilt", "all", about_x=0.1, about_y=-0.05)


def diagnosis(effect: Effect) -> Diagnosis:
    gap = Gap(noise=NOISE, before=1e-3, after=NOISE, holdout=["a"], significant=True)
    return Diagnosis(
        schema="bha-diagnosis/2", verdict="one_of", reason="", effects=[effect], gap=gap, where={}, candidates=[],
        residual={}, excitation={}, plain={}, logs=[],
    )  # fmt: skip


def arm() -> bha.Arm:
    return one_section().with_effects([{"kind": "weak_bellows", "where": "bellows 12", "change": -0.25}])


def test_members_differ_in_the_effect_alone() -> None:
    other = {"kind": "creep", "where": "all", "stiffness": 100.0, "tau": 1.0}
    base = one_section().with_effects([{"kind": "weak_bellows", "where": "bellows 12", "change": -0.25}, other])
    unknown = Alternative(kind="payload", where="section 1")  # no numbers: it cannot be simulated
    impossible = alternative("payload", "section 1", mass=-3.4)  # more than the section has
    members = arms_of_class(base, named(TILT, unknown, impossible))
    assert [name for name, _ in members] == ["weak_bellows at bellows 12", "base_tilt at all"]
    assert [[e.kind for e in a.parameters.effects] for _, a in members] == [
        ["creep", "weak_bellows"],
        ["creep", "base_tilt"],
    ]


def test_distances_count_in_noise_and_a_twin_is_at_none() -> None:
    time = np.arange(0.0, 8.0, 0.01)
    pressures = 1.2e5 + 2e4 * np.sin(2 * np.pi * np.array([0.3, 0.5, 0.7]) * time[:, None])
    effect = named(TILT)
    members = [a for _, a in arms_of_class(arm(), effect)]
    far = apart(members, time, pressures, Shown(OBSERVATION, NOISE))
    assert far > 1.0
    assert apart(members, time, pressures, Shown(OBSERVATION, NOISE / 2)) == pytest.approx(2.0 * far, rel=1e-9)
    assert apart([members[0], members[0]], time, pressures, Shown(OBSERVATION, NOISE)) == 0.0
    # What a refit would take is not told: another strength of the same effect.
    stronger = arm().with_effects([{"kind": "weak_bellows", "where": "bellows 12", "change": -0.2505}])
    assert apart([members[0], stronger], time, pressures, Shown(OBSERVATION, NOISE)) < 0.02
    # Under constant pressures nothing moves, and poses alone tell next to nothing after a refit.
    still = np.repeat([[1.1e5, 1.2e5, 1.1e5]], len(time), axis=0)
    assert apart(members, time, still, Shown(OBSERVATION, NOISE)) < 1e-3 * far


def test_a_proposal_is_a_log_of_commands_within_the_range(tmp_path: Path) -> None:
    effect = named(TILT)
    proposal = split(arm(), diagnosis(effect), OBSERVATION)
    assert proposal is not None
    assert proposal.splits
    low, high = arm().parameters.sections[0].pressure_range
    assert low <= proposal.pressures.min() <= proposal.pressures.max() <= high
    said = experiment_of(proposal, tmp_path)
    assert said.file == NEXT_EXPERIMENT
    log = bha.Log.read(tmp_path / NEXT_EXPERIMENT)
    np.testing.assert_array_equal(log.pressures(arm().inputs, commanded=True), proposal.pressures)
    text = experiment_in_words(said)
    assert text.startswith("pressures would tell weak_bellows at bellows 12 or base_tilt at all")
    # What it wrote may be replaced; a measured log of that name may not.
    mark = RESULTS[NEXT_EXPERIMENT]
    assert mark.search((tmp_path / NEXT_EXPERIMENT).read_bytes())
    assert not mark.search(b"t [s],pc11 [Pa],pc12 [Pa],q11 [m]\n0,1,1,1\n")


def test_without_a_class_there_is_nothing_to_split() -> None:
    assert split(arm(), diagnosis(named()), OBSERVATION) is None


def test_a_number_on_its_bound_is_varied_to_the_other_side() -> None:
    time = np.arange(0.0, 8.0, 0.01)
    pressures = 1.2e5 + 2e4 * np.sin(2 * np.pi * np.array([0.3, 0.5, 0.7]) * time[:, None])
    greatest = {"kind": "tool_drag", "where": "section 1", "stiffness": 10000.0, "damping": 0.0, "drag": 0.0}
    members = [arm(), one_section().with_effects([greatest])]
    assert np.isfinite(apart(members, time, pressures, Shown(OBSERVATION, NOISE)))


def test_a_class_of_an_arm_with_a_number_that_no_arm_has_is_not_split() -> None:
    """Fits may end there; the diagnosis says so, and does not end with it."""
    heavy = 80.0 / one_section().parameters.sections[0].mass
    absurd = one_section({"mass": heavy}).with_effects(
        [{"kind": "weak_bellows", "where": "bellows 11", "change": -0.2}]
    )
    time, pressures = np.linspace(0.0, 1.0, 11), np.full((11, 3), 1.2e5)
    assert np.isnan(apart([absurd, absurd], time, pressures, Shown(OBSERVATION, 1e-4)))
