"""Intervals: what is left in them, with its memory, and what the logs disagree about."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bha.diagnosis.candidate import Candidate, core_ranges
from bha.diagnosis.catalogue import available
from bha.diagnosis.intervals import _between_logs, coordinate_draws, form_deviation, is_told
from bha.diagnosis.screen import Signatures

from .test_statistics import STEP, slow

Array = NDArray[np.float64]


def fitted(jacobians: list[Array], measured: list[Array], channels: int = 1) -> tuple[Any, Any]:
    """A linear model at its minimum over some logs without initial states, and without a prior to speak of."""
    jacobian, target = np.concatenate(jacobians), np.concatenate(measured)
    ends = np.cumsum([0, *(len(y) for y in measured)])
    best = np.linalg.lstsq(jacobian, target, rcond=None)[0]
    residual = target - jacobian @ best
    whiteners = [SimpleNamespace(kept=len(y) // channels, time=STEP * np.arange(len(y) // channels)) for y in measured]
    problem = SimpleNamespace(
        records=[None] * len(measured),
        whiteners=whiteners,
        rows=len(target),
        state_precision=np.ones(1),
        slices=lambda: [slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)],  # noqa: RUF007
    )
    coordinate = SimpleNamespace(prior_weight=1e-9, value=float, coordinate=float)
    fit = SimpleNamespace(
        x=best,
        residual=residual,
        squares=float(residual @ residual),
        jacobian=jacobian,
        state_jacobians=tuple(np.zeros((len(y), 1)) for y in measured),
        trust=1.0,
        model=SimpleNamespace(coordinates=[coordinate] * jacobian.shape[1], size=jacobian.shape[1]),
    )
    return problem, fit


def test_logs_that_ask_for_different_numbers_widen_the_interval() -> None:
    # Three logs that ask for 0, 3 and 6: without one of them 4.5, 3 and 1.5 for 3 with all. The jackknife's standard
    # error is the root of 2/3 of 2 * 1.5^2, and with two degrees of freedom Student's 95 % is 4.303 of it.
    problem, fit = fitted([np.ones((8, 1))] * 3, [np.full(8, v) for v in (0.0, 1.5, 3.0)])
    found = _between_logs(problem, fit)
    assert found[0] == pytest.approx(4.30265 / 1.95996 * np.sqrt(2.0 / 3.0 * 2.0 * 0.75**2), rel=1e-4)


def test_logs_that_agree_add_nothing() -> None:
    problem, fit = fitted([np.ones((8, 1))] * 3, [np.tile([-1.0, 1.0], 4)] * 3)
    assert _between_logs(problem, fit)[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("tau", [0.0, 0.5, 3.0])
def test_intervals_hold_whatever_the_memory_of_what_is_left(tau: float) -> None:
    """95 % or more, of 4 numbers in 30 residuals that all channels share."""
    rng = np.random.default_rng(8)
    rows, channels, held = 300, 6, []
    for seed in range(30):
        jacobians = [
            np.column_stack([slow(rng, rows, 1.0, channels, False).ravel() for _ in range(4)]) for _ in range(3)
        ]
        true = rng.standard_normal(4)
        measured = [j @ true + slow(rng, rows, tau, channels, True).ravel() for j in jacobians]
        problem, fit = fitted(jacobians, measured, channels)
        low, high = np.quantile(coordinate_draws(problem, fit, seed), [0.025, 0.975], axis=0)
        held.append((fit.x + low <= true) & (true <= fit.x + high))
    assert np.mean(held) >= 0.92


def with_candidate(rng: np.random.Generator, strength: float) -> tuple[Any, Any, Signatures, Array, Array]:
    """A fit that lacks a candidate of some strength, of which its sensitivities can do a part; and what is measured."""
    rows, channels = 300, 2
    jacobians = [slow(rng, rows, 0.5, channels, False).reshape(-1, 1) for _ in range(3)]
    lacks = [0.6 * j[:, 0] + slow(rng, rows, 0.5, channels, False).ravel() for j in jacobians]
    measured = [strength * y + rng.standard_normal(len(y)) for y in lacks]
    problem, fit = fitted(jacobians, measured, channels)
    plan = next(p for p in available(None) if p.kind == "length_offset")
    table = np.concatenate(lacks)[:, None].astype(np.float32)
    signatures = Signatures((Candidate(plan, "bellows 11", {}),), (((0,),),), table)
    return problem, fit, signatures, np.concatenate(jacobians), np.concatenate(measured)


def test_what_the_catalogue_could_still_add_moves_a_number_by_what_a_refit_with_it_does() -> None:
    """A form that is wrong alike in all logs: neither the residual's memory nor the logs' disagreement shows it."""
    problem, fit, signatures, jacobian, measured = with_candidate(np.random.default_rng(6), 1.0)
    found = form_deviation(problem, fit, signatures, 0)
    both = np.linalg.lstsq(np.column_stack([jacobian, signatures.table]), measured, rcond=None)[0]
    assert found[0] == pytest.approx(abs(both[0] - fit.x[0]), rel=1e-4)
    assert found[0] > 5.0 * np.std(coordinate_draws(problem, fit, 0)[:, 0])
    draws = coordinate_draws(problem, fit, 0, found)
    assert np.std(draws[:, 0]) == pytest.approx(np.hypot(found[0], np.std(coordinate_draws(problem, fit, 0))), rel=0.1)


def test_where_nothing_is_missing_nothing_could_be_added() -> None:
    problem, fit, signatures, _, _ = with_candidate(np.random.default_rng(6), 1.0)
    for share, moved in ((1.01, False), (1.03, True)):
        fit.squares = share * problem.rows
        assert (form_deviation(problem, fit, signatures, 0)[0] > 0.0) == moved


def test_what_chance_explains_as_well_moves_nothing() -> None:
    moved = 0
    for seed in range(10):
        problem, fit, signatures, _, _ = with_candidate(np.random.default_rng(seed), 0.0)
        moved += bool(form_deviation(problem, fit, signatures, seed)[0] > 0.0)
    assert moved <= 5  # two are expected


@pytest.mark.parametrize(("value", "deviation", "told"), [(0.2, 0.05, True), (-0.2, 0.05, True), (0.1, 0.1, False)])
def test_an_effect_of_which_there_may_be_none_is_not_told(value: float, deviation: float, told: bool) -> None:
    (plan,) = available(("pressure_gain",))
    candidate = Candidate(plan, "input p11", {})
    term, _ = candidate.term([0.2], core_ranges())
    (own,) = term.coordinates
    model = SimpleNamespace(coordinates=(own, own), place=lambda number: slice(1, 2))
    fit = SimpleNamespace(model=model, x=np.array([0.0, own.coordinate(value)]))
    draws = np.random.default_rng(2).standard_normal((4000, 2)) * deviation / own.scale
    trial: Any = SimpleNamespace(candidates=(candidate,), fit=fit)
    assert is_told(trial, draws) is told
    assert is_told(SimpleNamespace(candidates=(), fit=fit), draws)  # type: ignore[arg-type]


@pytest.mark.parametrize(("together", "told"), [(-0.99, True), (0.99, False)])
def test_two_strengths_that_do_nearly_the_same_are_told_together(together: float, told: bool) -> None:
    """An area that changes by pressure and by length, of which the logs tell the sum."""
    (plan,) = available(("effective_area",))
    candidate = Candidate(plan, "all", {})
    term, _ = candidate.term([0.2, 0.2], core_ranges())
    model = SimpleNamespace(coordinates=term.coordinates, place=lambda number: slice(0, 2))
    trial: Any = SimpleNamespace(candidates=(candidate,), fit=SimpleNamespace(model=model, x=np.array([1.0, 1.0])))
    covariance = [[1.0, together], [together, 1.0]]
    draws = np.random.default_rng(1).multivariate_normal([0.0, 0.0], covariance, 4000)
    assert is_told(trial, draws) is told


def test_a_wall_is_there_however_stiff_it_may_be() -> None:
    """From some stiffness on more does hardly more: its interval holds none, to first order, and there is a wall."""
    (plan,) = available(("contact",))
    candidate = Candidate(plan, "section 1", {"angle": 0.0, "distance": 0.85})
    term, start = candidate.term([500.0], core_ranges())
    model = SimpleNamespace(coordinates=term.coordinates, place=lambda number: slice(0, len(start)))
    trial: Any = SimpleNamespace(candidates=(candidate,), fit=SimpleNamespace(model=model, x=np.array(start)))
    draws = np.random.default_rng(3).standard_normal((4000, len(start))) * (2.0 + np.abs(np.array(start)))
    assert is_told(trial, draws)
    assert [strength.name for strength in plan.strengths if strength.hard] == ["stiffness"]
