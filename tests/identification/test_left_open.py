"""What the logs of a fit leave open on a held-out log, against arms that differ by it; and what is said of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from estimation.slow_arm import TRUE, arm_of, log_of
from numpy.typing import NDArray

from bha.estimation.engine import Model
from bha.estimation.free import resolve
from bha.estimation.records import record
from bha.identification import predict
from bha.identification.holdout import left_open
from bha.identification.result import HeldOut

PATHS = ("section.1.stiffness.1", "section.1.terminal_area")


def test_what_is_left_open_is_how_far_arms_differ_that_the_logs_do_not_tell_apart() -> None:
    arm = arm_of(TRUE)
    rec = record(arm, log_of(arm, 3, duration=8.0))
    model = Model(arm.parameters, resolve(arm.parameters, PATHS), (rec,))
    z, spread = np.array([c.coordinate(c.start) for c in model.coordinates]), 0.02

    def apart(direction: list[float]) -> NDArray[np.float64]:
        ends = []
        for sign in (1.0, -1.0):
            moved = z + sign * spread * np.array(direction)
            values = {c.path: c.value(float(v)) for c, v in zip(model.coordinates, moved, strict=True)}
            ends.append(predict(arm.with_values(values), [rec])[0].predicted)
        return np.asarray(np.sqrt(np.mean((0.5 * (ends[0] - ends[1])) ** 2, axis=0)))

    assert left_open(model, z, np.diag([spread**2, 0.0])) == pytest.approx(apart([1.0, 0.0]), rel=0.05)
    # What goes together is no sum of what goes alone.
    assert left_open(model, z, spread**2 * np.ones((2, 2))) == pytest.approx(apart([1.0, 1.0]), rel=0.1)


@pytest.mark.parametrize(
    ("missed", "left", "expected"),
    [
        (4e-3, 9e-3, ["q11"]),
        # Noise alone; more than is left open; nothing is left open.
        (1.2e-4, 9e-3, []),
        (4e-3, 1e-3, []),
        (4e-3, 5e-5, []),
        (4e-3, np.nan, []),
    ],
)
def test_an_error_that_the_logs_leave_open_is_said_to_be_one(missed: float, left: float, expected: list[str]) -> None:
    rec: Any = SimpleNamespace(channels=("q11",), noise=np.array([1e-4]))
    after: Any = SimpleNamespace(record=rec, rms=np.array([missed]))
    assert HeldOut(after, after, np.array([left])).asks_for_more == expected
