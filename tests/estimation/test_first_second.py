"""How logs of commands begin in motion: what stood in the chambers is told by the first second."""

from __future__ import annotations

import numpy as np

import bha
from bha.estimation.engine import Model
from bha.estimation.first_second import START_SECONDS, first_second, unsure_of_pressures
from bha.estimation.integration import by
from bha.estimation.records import Window, record
from bha.identification import predict
from bha.parameters import ArmParameters

LAG, NOISE = 0.25, 1e-4
LEVELS = np.random.default_rng(5).uniform(1.1e5, 1.8e5, (8, 3))


def arm_of(lag: float) -> bha.Arm:
    mapping = bha.robots.load("bha_nominal").parameters.to_mapping()
    pneumatics = {"level": "lag", "fill_time": lag, "vent_time": lag}
    return bha.Arm(ArmParameters.from_mapping({**mapping, "section": mapping["section"][:1], "pneumatics": pneumatics}))


def log_of(arm: bha.Arm, begins: float) -> bha.Log:
    """Commands held for 0.8 s, from ``begins`` s on, with all lengths at 100 Hz."""
    time = np.arange(0.0, 6.0, 0.01)
    drive = bha.Input(time, LEVELS[np.floor(time / 0.8 + 1e-9).astype(int)], commanded=True, interpolation="hold")
    lengths = bha.simulate(arm, drive, times=time, method="rk4", step=1e-3).lengths
    lengths = lengths + NOISE * np.random.default_rng(6).standard_normal(lengths.shape)
    kept = time >= begins
    columns = {f"pc{name[1:]} [Pa]": p for name, p in zip(arm.inputs, drive.pressures[kept].T, strict=True)}
    columns |= {f"q1{k + 1} [m]": q for k, q in enumerate(lengths[kept].T)}
    return bha.Log.from_arrays({"t [s]": time[kept], **columns})


def test_a_log_that_begins_behind_a_step_is_predicted_from_what_stood_before() -> None:
    arm = arm_of(LAG)
    rec = record(arm, log_of(arm, begins=1.65), pressures="commanded")
    assert unsure_of_pressures(arm.parameters, rec)
    # As if the chambers stood at the first command the first second is off by 6.4 mm, and 12 in its first quarter.
    error = predict(arm, [rec])[0].error
    assert np.sqrt(np.mean(error[rec.time < rec.time[0] + START_SECONDS] ** 2)) < 1.3 * NOISE
    model = Model(arm.parameters, (), (rec,))
    model = by(model, step=2e-3)
    guess = model.guesses(np.zeros(0), [Window(0, 0, len(rec))])[0]
    told = first_second(model, np.zeros(0), 0, guess)[0].drive.pressures[0]
    before, after = LEVELS[1], LEVELS[2]  # changed 0.05 s before the log begins
    np.testing.assert_allclose(told, after + (before - after) * np.exp(-0.05 / LAG), atol=2e3)


def test_pressures_before_a_log_take_its_first_rows_nowhere() -> None:
    arm = arm_of(LAG)
    rec = record(arm, log_of(arm, begins=1.65), pressures="commanded")
    told = rec.preceded_by(np.full(3, 1.3e5), late=0.1)
    np.testing.assert_array_equal(told.time, rec.time)
    np.testing.assert_array_equal(told.drive.pressures[told.rows], rec.drive.pressures[rec.rows])
    np.testing.assert_array_equal(told.alone.drive.pressures, rec.drive.pressures)
    again = told.preceded_by(np.full(3, 1.4e5), late=0.2)
    assert len(again.drive.time) == len(rec.drive.time) + 3
    assert again.drive.time[0] < rec.time[0] - 0.2


def test_a_log_that_begins_at_rest_leaves_nothing_open() -> None:
    arm = arm_of(LAG)
    rec = record(arm, log_of(arm, begins=0.0), pressures="commanded")
    assert not unsure_of_pressures(arm.parameters, rec)


def test_first_commands_may_come_with_the_log_itself() -> None:
    late = 0.15
    arm = arm_of(LAG).with_effects([{"kind": "delay", "where": "all", "time": late}])
    # Its first command came with its first row: the chambers know nothing of that for another 0.15 s.
    rec = record(arm, log_of(arm, begins=1.6), pressures="commanded")
    error = predict(arm, [rec])[0].error
    # As if it had come a dead time before that is off by 2.3 mm; what is left is of the command before the last one.
    assert np.sqrt(np.mean(error[rec.time < rec.time[0] + START_SECONDS] ** 2)) < 5.0 * NOISE
