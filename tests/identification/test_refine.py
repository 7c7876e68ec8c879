"""Joint refinement by output error on synthetic logs: recovery, intervals, robustness, both force models."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.estimation.problem import Problem
from bha.identification import FreeParameter, Settings, default_free, identification, record, refine
from bha.parameters import paths

from .identify_logs import measured, multisine, off, one_section

FREE = ("section.1.mass", "section.1.stiffness.1", "section.1.bending_stiffness.1", "section.1.damping")
FACTORS = dict(zip(FREE, (1.3, 0.8, 1.35, 1.6), strict=True))
FAST = Settings(windows=(0.75, 3.0), draws=8)


def errors_in_deviations(arm: bha.Arm, fit: bha.identification.Refinement) -> np.ndarray:
    true = np.array([paths.get_value(arm.parameters, c.path) for c in fit.coordinates])
    return np.asarray((fit.values - true) / fit.standard_errors)


@pytest.mark.parametrize("force_model", ["end_force", "work_conjugate"])
def test_recovery_from_a_wrong_start(force_model: str) -> None:
    arm = one_section().with_changes(force_model=force_model)  # type: ignore[arg-type]
    start = off(arm, FACTORS)
    fit = refine(start, [record(start, measured(arm, multisine(arm, 6.0, 100.0, 1)))], FREE, FAST)
    assert fit.outcome.converged
    off_by = errors_in_deviations(arm, fit)
    assert np.all(np.abs(off_by) < 4.0), off_by
    assert np.all(fit.standard_errors / fit.values < 0.03)
    inside = fit.intervals[:, 0] < fit.values
    assert np.all(inside & (fit.values < fit.intervals[:, 1]))


def test_a_number_that_logs_do_not_tell_stays_within_its_bounds_and_is_assumed() -> None:
    """A damping far too small to act, with a prior that is wide open."""
    arm = one_section()
    rec = record(arm, measured(arm, multisine(arm, 3.0, 50.0, 1)))
    mapping = arm.parameters.to_mapping()
    mapping["effect"] = [{"kind": "quadratic_damping", "where": "all", "damping": 1e-6}]
    start = bha.Arm(arm.parameters.updated(mapping))
    wide = FreeParameter("effect.1.damping", prior=(1e-6, 1e-4), logarithmic=True, lower=1e-12, upper=1e-6)
    fit = refine(start, [rec], ["section.1.mass", "section.1.damping", wide], Settings(windows=(1.5,), draws=0))
    low, high = fit.intervals[2]
    assert 1e-12 <= low <= high <= 1e-6
    found = identification(start, fit)
    status = {e.path: e.identified for e in found.estimates}
    assert not status["effect.1.damping"]
    assert found.parameters().effects[0].provenance["damping"].status == "assumed"


def test_head_positions_tell_as_well() -> None:
    arm = one_section()
    start = off(arm, FACTORS)
    log = measured(arm, multisine(arm, 6.0, 100.0, 2), heads=True)
    fit = refine(start, [record(start, log, channels=["x1", "y1", "z1"])], FREE, FAST)
    assert fit.outcome.converged
    assert np.all(np.abs(errors_in_deviations(arm, fit)) < 4.0)


def test_a_long_window_alone_locks_into_a_wrong_minimum_and_short_ones_do_not() -> None:
    arm = one_section(damping=1.0)
    start = off(arm, {"section.1.mass": 2.2, "section.1.damping": 2.0})
    recs = [record(start, measured(arm, multisine(arm, 6.0, 100.0, 3)))]
    free = ("section.1.mass", "section.1.damping")
    staged = refine(start, recs, free, Settings(windows=(0.4, 6.0), draws=0))
    assert np.all(np.abs(errors_in_deviations(arm, staged)) < 5.0)


def test_outliers_do_not_decide() -> None:
    arm = one_section()
    start = off(arm, FACTORS)
    random = np.random.default_rng(5)

    def spoil(lengths: np.ndarray) -> np.ndarray:
        hit = random.random(lengths.shape) < 0.02
        return lengths + hit * random.uniform(-0.05, 0.05, lengths.shape)

    log = measured(arm, multisine(arm, 6.0, 100.0, 4), change=spoil)
    robust = refine(start, [record(start, log)], FREE, FAST)
    plain = refine(start, [record(start, log)], FREE, Settings(windows=(0.75, 3.0), draws=0, huber=float("inf")))
    true = np.array([paths.get_value(arm.parameters, p) for p in FREE])
    assert np.all(np.abs(errors_in_deviations(arm, robust)) < 4.5)
    assert np.linalg.norm(robust.values / true - 1) < 0.5 * np.linalg.norm(plain.values / true - 1)


def test_pressure_noise_widens_the_intervals() -> None:
    arm = one_section()
    log = measured(arm, multisine(arm, 4.0, 100.0, 6), pressure_noise=1500.0)
    fit = refine(arm, [record(arm, log)], FREE, Settings(windows=(3.0,), draws=16, prediction_error=False))
    assert fit.uncertainty is not None
    share = np.diag(fit.uncertainty.from_pressures) / np.diag(fit.uncertainty.from_sensors)
    # The pressures' noise is in what is left, too, which weighs by how long it lasts: that part is the sensors' here.
    assert share.max() > 0.5
    assert np.all(np.abs(errors_in_deviations(arm, fit)) < 4.0)


def test_same_seed_same_result_whatever_the_threads() -> None:
    arm = one_section()
    start = off(arm, FACTORS)
    rec = record(start, measured(arm, multisine(arm, 3.0, 100.0, 7)))
    one, two = (refine(start, [rec], FREE, Settings(windows=(1.5,), draws=4, threads=threads)) for threads in (1, 2))
    assert np.array_equal(one.values, two.values)
    assert np.array_equal(one.standard_errors, two.standard_errors)


def test_derivatives_agree_with_central_differences() -> None:
    arm = one_section()
    rec = record(arm, measured(arm, multisine(arm, 2.0, 100.0, 8)))
    fit = refine(arm, [rec], FREE, Settings(windows=(1.0,), draws=0))
    problem: Problem = fit.problem
    model, point = problem.model, fit.outcome.point
    (_, by_z, by_state), *_ = model.linearize(point.z, problem.windows, point.states)
    for k in range(len(FREE)):
        h = 1e-4 * np.eye(len(FREE))[k]
        ahead, behind = (model.predict(point.z + s * h, problem.windows[:1], point.states[:1])[0] for s in (1, -1))
        central = (ahead - behind) / 2e-4
        assert np.allclose(by_z[..., k], central, rtol=1e-3, atol=1e-4 * np.abs(central).max())
    assert by_state.shape == (*by_z.shape[:2], 6)


def test_an_iteration_too_few_is_not_converged_but_better() -> None:
    arm = one_section()
    start = off(arm, FACTORS)
    rec = record(start, measured(arm, multisine(arm, 3.0, 100.0, 9)))
    fit = refine(start, [rec], FREE, Settings(windows=(None,), draws=0, max_iterations=1))
    assert not fit.outcome.converged
    assert "not converged" in fit.outcome.message


def test_a_start_that_cannot_be_simulated() -> None:
    arm = one_section()
    rec = record(arm, measured(arm, multisine(arm, 2.0, 100.0, 10)))
    wild = FreeParameter("section.1.stiffness.3", start=-1e7, lower=-1e9)
    with pytest.raises(bha.ConvergenceError, match="starting values"):
        refine(arm, [rec], [wild], FAST)


def test_default_parameters_of_an_arm_from_ten_seconds() -> None:
    arm = one_section()
    free = default_free(arm.parameters)
    start = off(arm, dict.fromkeys(free, 1.15))
    fit = refine(start, [record(start, measured(arm, multisine(arm, 8.0, 100.0, 11)))], free, FAST)
    result = identification(start, fit)
    assert result.converged
    assert result.unknown == ()
    assert np.all(np.abs(errors_in_deviations(arm, fit)) < 4.0)
