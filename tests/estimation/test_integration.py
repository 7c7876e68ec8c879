"""What a step of the integrator and a first rate are held to: what logs show and a model leaves, nothing finer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bha.estimation.engine import Model
from bha.estimation.integration import _allowed, _excess
from bha.estimation.problem import LENGTH_DEVIATION, RATE_DEVIATIONS, state_deviations
from bha.estimation.records import Record, record, windows
from bha.estimation.runs import Integration

from .slow_arm import TRUE, arm_of, log_of


def quiet_record(seed: int) -> Record:
    """A log whose noise is a micrometre, as motion capture of an arm that stands still tells it."""
    arm = arm_of(TRUE)
    made = record(arm, log_of(arm, seed, duration=12.0))
    return made.with_noise(np.full(len(made.channels), 1e-6))


def test_a_step_is_not_finer_than_the_worst_window_asks_for() -> None:
    """A model that errs by millimetres where the arm moves gains nothing from micrometres where it stands."""
    rec = quiet_record(1)
    model = Model(arm_of(TRUE).parameters, (), (rec,), Integration())
    moves, stands = windows(model.records, 6.0)
    wrong = [rec.measured[w.first : w.last] + error for w, error in ((moves, 4e-3), (stands, 2e-6))]
    allowed = _allowed(model, [moves, stands], wrong)
    assert allowed[0] == pytest.approx(0.01 * 4e-3 / 0.6745)
    assert allowed[1] == pytest.approx(0.25 * allowed[0])
    # With nothing missed the noise decides in both.
    right = [rec.measured[w.first : w.last] for w in (moves, stands)]
    assert np.concatenate(_allowed(model, [moves, stands], right)) == pytest.approx(1e-7)
    # Steps that differ by 5 um there are alike, where those of a right model are not.
    finer = [run + 5e-6 for run in wrong]
    assert _excess(model, [moves, stands], finer, wrong) < 1.0 < _excess(model, [moves, stands], finer, right)


def test_first_rates_are_those_of_the_log() -> None:
    rec = quiet_record(2)
    ramp = 0.03 * (rec.time - rec.time[0])
    moving = replace(rec, measured=np.column_stack([ramp] * len(rec.channels)), usable=np.ones_like(rec.usable))
    assert moving.rate == pytest.approx(0.03, rel=0.1)
    assert state_deviations([moving]) == pytest.approx((LENGTH_DEVIATION, moving.rate))
    still = replace(moving, measured=np.zeros_like(moving.measured))
    assert state_deviations([still])[1] == RATE_DEVIATIONS[0]
    # Logs share a deviation: the one that moves most has its say; and none is wider than ever.
    assert state_deviations([still, moving])[1] == pytest.approx(moving.rate)
    flung = replace(moving, measured=np.sin(40.0 * np.pi * moving.time[:, None]) * np.ones(len(rec.channels)))
    assert state_deviations([flung])[1] == RATE_DEVIATIONS[1]
