"""Initial states from what was measured: heads alone tell lengths and rates, and a command's log begins at rest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis.baseline import pieces, refuse_impossible
from bha.diagnosis.model import plain_model
from bha.diagnosis.preparation import from_rest, prepare
from bha.errors import ConvergenceError
from bha.estimation.bands import Whitener, noise_model
from bha.estimation.records import Record
from bha.parameters import ArmParameters
from bha.recordings import ChannelFacts, Recording
from bha.recordings.pose import pose, tells_state

from .synthetic import observation, one_section, record_of

TIME = np.arange(321) * 0.01


def heads_of(run: bha.Trajectory) -> dict[str, np.ndarray]:
    """Columns of head positions."""
    count = run.head_positions.shape[1]
    return {f"{a}{i + 1} [m]": run.head_positions[:, i, k] for i in range(count) for k, a in enumerate("xyz")}


def test_heads_alone_tell_lengths_and_rates_anywhere_in_a_log() -> None:
    arm = bha.robots.load("bha_nominal")
    # Slow, so that a straight line through a few rows is the tangent.
    phases = np.linspace(0.0, 2.0 * np.pi, len(arm.inputs), endpoint=False)
    p = 101325.0 + 2e4 + 1.5e4 * np.sin(2.0 * np.pi * 0.2 * TIME[:, None] + phases)
    run = bha.simulate(arm, bha.Input(TIME, p), options=bha.Options(method="rk4", step=2.5e-3))
    columns = {"t [s]": TIME} | {f"{name} [Pa]": p[:, k] for k, name in enumerate(arm.inputs)} | heads_of(run)
    record = prepare(Recording(arm, bha.Log.from_arrays(columns)))
    for row in (0, 74, 180, 320):
        seen = run.head_positions[row].ravel()
        found = pose(arm, arm.parameters, record.observation, seen, np.full(9, 1e-5), p[row])
        # The pose that pressures hold draws by a ten-thousandth of the distance to it.
        assert found == pytest.approx(run.lengths[row], abs=1e-6)
    parts = pieces([record], 3)
    assert parts is not None
    assert len(parts) == 4
    model = plain_model(arm).on([record])
    states = model.guesses(np.zeros(model.size), parts)
    # The first one begins with a jump of the acceleration.
    for part, state in zip(parts[1:], states[1:], strict=True):
        assert state[:9] == pytest.approx(run.lengths[part.first], abs=3e-4)
        assert state[9:18] == pytest.approx(run.velocities[part.first], abs=0.2 * np.abs(run.velocities).max())


def test_rare_rows_make_long_pieces_and_dropouts_none() -> None:
    rng = np.random.default_rng(11)
    time = np.arange(280) * 0.1
    time = np.delete(time, np.s_[60:84])
    noise = 1e-3 * rng.standard_normal((len(time), 3))
    measured = record_of(time, 0.15 + noise, np.full((len(time), 3), 1.2e5), 1e-3)
    parts = pieces([measured], 1)
    assert parts is not None
    assert min(part.last - part.first for part in parts) >= 8
    assert sum(part.last - part.first for part in parts) > 0.9 * len(time)
    # A piece that is shorter than the least band has as many white rows as rows.
    short = replace(measured, rows=measured.rows[:5], measured=measured.measured[:5], usable=measured.usable[:5])
    white = Whitener(short, noise_model([measured], [[]]))
    assert white(short.measured).shape == (5, 3)
    assert len(white.time) == 5


def test_channels_tell_the_state_only_if_every_section_was_measured() -> None:
    assert tells_state(observation("q21", "q22", "q23", "x1", "y1", "z1", sections=2), 2)
    assert not tells_state(observation("q21", "q22", "x1", "y1", "z1", sections=2), 2)
    assert not tells_state(observation("x2", "y2", "z2", sections=2), 2)


def commanded(outputs: np.ndarray, command: np.ndarray) -> Record:
    """A record of one channel under one input."""
    time = np.arange(len(outputs)) * 0.05
    good = np.ones((len(time), 1), dtype=np.bool_)
    facts = (ChannelFacts("x1", "m", 1e-5, 0.0, 0.0),)
    rows = np.arange(len(time))
    drive = bha.Input(time, command[:, None])
    return Record("made up", drive, rows, observation("x1"), outputs[:, None], good, facts, ())


def test_a_log_of_commands_counts_from_where_the_arm_rests() -> None:
    time = np.arange(401) * 0.05
    # The command stands from the first row on; the arm follows with a second, and again after ten seconds.
    moving = 0.1 * (1.0 - np.exp(-time)) - np.where(time > 10.0, 0.1 * (1.0 - np.exp(-(time - 10.0))), 0.0)
    record = from_rest(commanded(moving, np.where(time <= 10.0, 2e5, 1e5)))
    # What is left of the first motion then goes by less than half a per cent of the travel within a second.
    assert record.drive.time[0] == pytest.approx(np.log(200.0 * (1.0 - np.exp(-1.0))), abs=0.2)
    assert record.drive.time[-1] == time[-1]
    assert np.all(record.measured[:, 0] == moving[-len(record.rows) :])
    resting = commanded(np.where(time < 10.0, 0.0, moving), np.where(time <= 10.0, 2e5, 1e5))
    assert from_rest(resting) is resting
    never = commanded(np.sin(time), np.full(len(time), 1e5))
    assert from_rest(never) is never


def test_guesses_are_off_by_factors_and_drawings_by_a_tenth() -> None:
    """A section that states one number of its springs states guesses; areas are free unless the file says otherwise."""
    mapping = one_section().parameters.to_mapping()
    section = mapping["section"][0]

    def spreads(*, identified: bool = False, **changes: Any) -> dict[str, float]:
        arm = bha.Arm(ArmParameters.from_mapping(mapping | {"section": [section | changes]}))
        return {
            c.path.removeprefix("section.1."): c.prior_deviation / c.start
            for c in plain_model(arm, identified=identified).plain
            if c.start
        }

    drawn, guessed = spreads(), spreads(stiffness=[1200.0])
    assert [drawn[k] for k in ("damping", "tangent_stiffness.1", "terminal_area")] == pytest.approx([0.6, 0.3, 0.1])
    factor = np.log(3.0)
    assert [guessed[k] for k in ("damping", "tangent_stiffness.1", "terminal_area")] == pytest.approx([factor] * 3)
    assert guessed["bending_stiffness.1"] > 4.0 * drawn["bending_stiffness.1"]
    assert guessed["mass"] == drawn["mass"] == pytest.approx(0.15)
    # What logs have told is no guess, whatever the file says of it.
    assert spreads(identified=True, stiffness=[1200.0])["tangent_stiffness.1"] == pytest.approx(0.3)
    known = spreads(stiffness=[1200.0], provenance={"stiffness": "measured", "terminal_area": "measured"})
    assert known["tangent_stiffness.1"] == pytest.approx(0.3)
    assert "terminal_area" not in known
    made = spreads(stiffness=[1200.0], provenance={"stiffness": "assumed", "terminal_area": "assumed"})
    assert made["tangent_stiffness.1"] == made["terminal_area"] == pytest.approx(factor)
    assumed = spreads(provenance={"terminal_area": "assumed"})
    assert assumed["terminal_area"] == pytest.approx(0.2)


def test_bellows_with_rest_lengths_of_their_own_keep_them() -> None:
    mapping = one_section().parameters.to_mapping()
    section = mapping["section"][0]
    section["bellows"] = [{"angle_deg": 120.0 * k, "rest_length": 0.15 + 0.01 * k} for k in range(3)]
    model = plain_model(bha.Arm(ArmParameters.from_mapping(mapping)))
    names = [c.name for c in model.plain if "rest_length" in c.name]
    assert names == ["bellows 11 rest_length", "bellows 12 rest_length", "bellows 13 rest_length"]
    x = np.zeros(model.size)
    chosen = [c.name for c in model.plain].index("bellows 12 rest_length")
    x[chosen] = model.plain[chosen].coordinate(0.2)
    lengths = [b["rest_length"] for b in model.description(x)["section"][0]["bellows"]]
    assert lengths == pytest.approx([0.15, 0.2, 0.17])


def test_a_pose_in_which_no_length_is_left_between_stiff_pieces_is_refused_by_name() -> None:
    record = record_of(TIME, np.zeros((len(TIME), 3)), np.zeros((len(TIME), 3)), name="rest.csv")
    state = np.concatenate([[0.08, 0.09, 0.1, -0.003, -0.001, -0.002], np.zeros(6)])
    with pytest.raises(ConvergenceError, match=r"rest.csv: begins where .* section 2 would be -2.0 mm long"):
        refuse_impossible([record], [state], 2)
    refuse_impossible([record], [np.abs(state)], 2)
