"""Simulations for a diagnosis: a step that is too coarse for a stiffer arm is made finer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bha.arm.variants import arm_of
from bha.diagnosis.baseline import STEP_SHARES
from bha.diagnosis.model import is_damping, plain_model
from bha.diagnosis.preparation import prepare
from bha.estimation.integration import resolved
from bha.estimation.runs import Integration, Run
from bha.recordings import Recording

from .synthetic import make_logs, one_section

ARM = one_section()


def stiff_run() -> Run:
    """The arm with a quadratic damping that 5 ms cannot hold."""
    (log,) = make_logs(ARM, [], durations=(2.0,))
    record = prepare(Recording(ARM, log, warn=False))
    core = plain_model(ARM).core | {
        "effect": [{"kind": "quadratic_damping", "where": "all", "parameters": {"damping": 300.0}}]
    }
    state = np.concatenate([record.measured[0], np.zeros(3)])
    (run,) = plain_model(ARM).on([record]).runs(np.zeros(plain_model(ARM).size), [state])
    return replace(run, arm=arm_of(core))


def test_runs_that_the_step_cannot_hold_are_repeated_with_a_finer_one() -> None:
    stiff = stiff_run()
    plain = replace(stiff, arm=ARM)
    step = 0.005
    engine = Integration(step, threads=1, shares=STEP_SHARES)
    together = engine.run([plain, stiff])
    assert all(np.all(np.isfinite(y)) for y in together)
    # Both of the log at the finer step, so that differences between them have no error of the step in them.
    finer = replace(engine, step=step / 2).run([plain, stiff])
    for a, b in zip(together, finer, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(engine.run([plain])[0], finer[0])


def test_parameters_without_a_model_give_nan_and_leave_the_others_alone() -> None:
    stiff = stiff_run()
    model = plain_model(ARM)
    mass = next(k for k, c in enumerate(model.plain) if c.path == "section.1.mass")
    plain = tuple(replace(c, logarithmic=False, scale=-1.0) if k == mass else c for k, c in enumerate(model.plain))
    model = replace(model, plain=plain).on([stiff.record])
    (negative,) = model.runs(np.eye(model.size)[mass], [stiff.state])
    found, wrong = Integration(0.0025, threads=1, shares=STEP_SHARES).run([stiff, negative])
    assert np.all(np.isfinite(found))
    assert np.all(np.isnan(wrong))


def test_a_model_stiffer_than_the_file_asks_for_finer_steps() -> None:
    stiff = stiff_run()
    record = stiff.record
    engine = Integration(0.005, threads=1, coarse=0.01, shares=STEP_SHARES)
    model = replace(plain_model(ARM).on([record]), integration=engine)
    x = np.array([np.log(15.0) / c.scale if is_damping(c) else 0.0 for c in model.coordinates])
    runs = model.runs(x, [stiff.state])
    # Repeated until they stay finite, its runs would not show that the step is too long.
    assert np.all(np.isfinite(engine.run(runs)[0]))
    assert not np.all(np.isfinite(engine.once().run(runs)[0]))
    found = resolved(model, x, [stiff.state], 1.0).integration
    assert found.finer > 1
    assert np.all(np.isfinite(found.once().run(runs)[0]))
    assert np.all(np.isfinite(found.run(runs, coarse=True)[0]))
    assert resolved(model, np.zeros(model.size), [stiff.state], 1.0).integration.finer == 1
