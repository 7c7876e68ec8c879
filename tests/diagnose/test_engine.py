"""Simulations for a diagnosis: a step that is too coarse for a stiffer arm is made finer."""

from __future__ import annotations

import json

import numpy as np

from bha.diagnose.engine import Engine, Job
from bha.diagnose.model import plain_model
from bha.diagnose.records import Record, prepare

from .synthetic import make_logs, one_section

ARM = one_section()


def stiff_job() -> tuple[Job, Record]:
    """The arm with a quadratic damping that 5 ms cannot hold."""
    (log,) = make_logs(ARM, [], durations=(2.0,))
    record = prepare(ARM, log)
    core = plain_model(ARM).core | {
        "effect": [{"kind": "quadratic_damping", "where": "all", "parameters": {"damping": 300.0}}]
    }
    state = np.concatenate([record.outputs[0], np.zeros(3)])
    return Job(json.dumps(core), record, state), record


def test_runs_that_the_step_cannot_hold_are_repeated_with_a_finer_one() -> None:
    stiff, record = stiff_job()
    plain = Job(json.dumps(plain_model(ARM).core), record, stiff.state)
    step = 0.005
    together = Engine(step, 1).run([plain, stiff])
    assert all(np.all(np.isfinite(y)) for y in together)
    # Both of the log at the finer step, so that differences between them have no error of the step in them.
    finer = Engine(step / 2, 1).run([plain, stiff])
    for a, b in zip(together, finer, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(Engine(step, 1).run([plain])[0], finer[0])


def test_parameters_without_a_model_give_nan_and_leave_the_others_alone() -> None:
    stiff, record = stiff_job()
    core = json.loads(stiff.arm)
    core["section"][0]["mass"] = -1.0
    found, wrong = Engine(0.0025, 1).run([stiff, Job(json.dumps(core), record, stiff.state)])
    assert np.all(np.isfinite(found))
    assert np.all(np.isnan(wrong))
