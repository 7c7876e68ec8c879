"""Logs of commands that begin in motion, in a diagnosis: what stood in the chambers before is told by them."""

from __future__ import annotations

import numpy as np
from estimation.test_first_second import LAG, NOISE, arm_of, log_of

from bha.diagnosis.preparation import begins_at_rest, preceded_in_motion
from bha.estimation.engine import Model
from bha.estimation.integration import by
from bha.estimation.records import Window, record


def test_what_stood_before_is_told_where_a_log_begins_in_motion_and_nowhere_else() -> None:
    arm = arm_of(LAG)
    moving, resting = (record(arm, log_of(arm, begins=begins), pressures="commanded") for begins in (1.65, 0.0))
    assert [begins_at_rest(rec) for rec in (moving, resting)] == [False, True]
    model = by(Model(arm.parameters, (), (moving, resting)), step=2e-3)
    told = model.on(preceded_in_motion(model, np.zeros(0)))
    assert told.records[1] is resting
    assert begins_at_rest(told.records[0]) is False

    def first_second_left(model: Model) -> float:
        window = Window(0, 0, len(moving))
        shown = model.predict(np.zeros(0), [window], np.stack(model.guesses(np.zeros(0), [window])))[0]
        return float(np.sqrt(np.mean((moving.measured - shown)[:100] ** 2)))

    assert first_second_left(model) > 20.0 * NOISE
    assert first_second_left(told) < 5.0 * NOISE
