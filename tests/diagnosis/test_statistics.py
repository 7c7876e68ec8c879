"""The statistics of the search's decisions, on residuals that are drawn: no arm is simulated."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.signal import lfilter

from bha.diagnosis import crossing, holdout
from bha.diagnosis.candidate import Candidate
from bha.diagnosis.catalogue import available
from bha.diagnosis.memory import memory, numbers_per_independent
from bha.diagnosis.preparation import cut_to, thin
from bha.diagnosis.screen import Signatures, one_sided, score
from bha.diagnosis.search import told

from .synthetic import record_of

Array = NDArray[np.float64]

STEP, CHANNELS = 0.1, 6


def slow(rng: np.random.Generator, rows: int, tau: float, channels: int, together: bool) -> Array:
    """A first-order process of variance one; all channels the same if ``together``."""
    keep = np.exp(-STEP / tau) if tau else 0.0
    lead = int(5.0 * tau / STEP) + 1
    drawn = rng.standard_normal((rows + lead, 1 if together else channels))
    made = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], drawn, axis=0)[lead:]
    return np.repeat(made, channels, axis=1) if together else np.asarray(made)


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize(("tau", "factor"), [(0.0, 1.15), (1.0, 1.5), (10.0, 3.0)])
def test_numbers_that_err_together_count_once(tau: float, factor: float, together: bool) -> None:
    """Truth: of n numbers of a first-order process n (1 - c) / (1 + c) are independent, of channels that are one, one.

    Lags cut at 2 s, each log's mean taken away and channels taken for independent made 439 of 60, and 219 of 6.
    """
    rows, keep = 1200, np.exp(-STEP / tau) if tau else 0.0
    true = rows * (1.0 - keep) / (1.0 + keep) * (1 if together else CHANNELS)
    rng = np.random.default_rng(3)
    found = [
        rows * CHANNELS / numbers_per_independent([slow(rng, rows, tau, CHANNELS, together)], [STEP]) for _ in range(40)
    ]
    assert true / factor < np.median(found) < true * factor


def test_draws_have_the_memory_of_the_residual() -> None:
    rng = np.random.default_rng(5)
    parts = [slow(rng, rows, 1.0, 2, True) + 0.3 * rng.standard_normal((rows, 2)) for rows in (900, 700)]
    drawn = memory(parts, [STEP, STEP]).draws([900, 700], [STEP, STEP], 50, rng)
    assert drawn.shape == (2 * 1600, 50)
    first = drawn[:1800].T.reshape(50, 900, 2)
    assert np.mean(first**2) == pytest.approx(np.mean(np.concatenate(parts) ** 2), rel=0.1)
    assert np.mean(first[:, :, 0] * first[:, :, 1]) == pytest.approx(1.0, rel=0.25)
    # Half a second later: exp(-0.5).
    assert np.mean(first[:, 5:, 0] * first[:, :-5, 1]) == pytest.approx(np.exp(-0.5), rel=0.25)


def screened(rng: np.random.Generator, tau: float, share: float, seed: int) -> Any:
    """The screening of a drawn residual of three logs, of which the first of 60 candidates makes up ``share``."""
    return score(*drawn_fit(rng, tau, share), seed)


def drawn_fit(rng: np.random.Generator, tau: float, share: float) -> tuple[Any, Any, Signatures]:
    """Logs, the fit that leaves such a residual, and the signatures of the candidates."""
    rows, logs, candidates = 300, 3, 60
    size = rows * CHANNELS

    def drawn(memory_time: float, together: bool) -> Array:
        return np.concatenate([slow(rng, rows, memory_time, CHANNELS, together).ravel() for _ in range(logs)])

    table = np.column_stack([drawn(0.5, False) for _ in range(candidates)])
    residual = drawn(tau, True) + np.sqrt(share / (1.0 - share)) * table[:, 0]
    nuisance = np.column_stack([drawn(0.5, False) for _ in range(4)])
    time = (np.arange(rows) + 0.5) * STEP
    problem: Any = SimpleNamespace(
        whiteners=[SimpleNamespace(kept=rows, time=time)] * logs,
        slices=lambda: [slice(k * size, (k + 1) * size) for k in range(logs)],
        state_precision=np.ones(1),
    )
    fit: Any = SimpleNamespace(
        residual=residual,
        jacobian=nuisance,
        state_jacobians=tuple(np.zeros((size, 1)) for _ in range(logs)),
        trust=1.0,
        model=SimpleNamespace(coordinates=[SimpleNamespace(prior_weight=1.0)] * nuisance.shape[1]),
    )
    plan = next(p for p in available(None) if p.kind == "length_offset")
    chosen = tuple(Candidate(plan, f"bellows {k}", {}) for k in range(candidates))
    signatures = Signatures(chosen, tuple(((k,),) for k in range(candidates)), table.astype(np.float32))
    return problem, fit, signatures


@pytest.mark.parametrize("tau", [0.0, 2.0])
def test_the_best_of_all_candidates_is_as_rare_by_chance_as_it_says(tau: float) -> None:
    """Family-wise: p at most 0.2 in a fifth of the residuals without a cause, however long their memory."""
    rng = np.random.default_rng(11)
    values = []
    for seed in range(60):
        found = screened(rng, tau, 0.0, seed)
        values.append(found.chance(found.ranking[0].score))
    assert 0.05 < np.mean(np.array(values) <= 0.2) < 0.37  # 0.2 give or take three standard deviations of 60
    assert np.mean(np.array(values) <= 0.01) <= 0.05


def test_an_effect_is_found_in_a_slow_residual() -> None:
    """A tenth of the squares beside an error of two seconds in all channels: 45 independent numbers in all."""
    rng = np.random.default_rng(12)
    for seed in range(5):
        found = screened(rng, 2.0, 0.1, seed)
        assert found.ranking[0].candidate.where == "bellows 0"
        assert found.chance(found.ranking[0].score) == 1.0 / 200.0
        # What explains nothing is nothing.
        assert found.chance(0.0) == 1.0


def test_a_rival_is_told_from_the_chosen_set_where_chance_would_not_make_it_so_much_worse() -> None:
    problem, fit, signatures = drawn_fit(np.random.default_rng(14), 2.0, 0.0)
    squares = float(fit.residual @ fit.residual)

    def trial(share: float) -> Any:
        return SimpleNamespace(fit=SimpleNamespace(**{**vars(fit), "squares": share * squares, "prior": 0.0}))

    assert told(problem, signatures, trial(1.0), trial(0.8)) <= 0.01
    assert told(problem, signatures, trial(1.0), trial(0.9999)) > 0.05
    # One that is even better is not told from it either.
    assert told(problem, signatures, trial(1.0), trial(1.1)) == 1.0


def linear(rng: np.random.Generator, lengths: tuple[int, ...]) -> tuple[Any, Any, Array]:
    """A linear model of three numbers at its minimum over logs of two channels; its problem, fit and sensitivities."""
    jacobians = [rng.standard_normal((2 * rows, 3)) for rows in lengths]
    jacobian = np.concatenate(jacobians)
    measured = jacobian @ np.array([1.0, -2.0, 0.5]) + rng.standard_normal(len(jacobian))
    ends = np.cumsum([0, *(2 * rows for rows in lengths)])
    best = np.linalg.solve(jacobian.T @ jacobian + np.eye(3), jacobian.T @ measured)
    whiteners = [SimpleNamespace(kept=rows, time=np.arange(float(rows))) for rows in lengths]
    problem = SimpleNamespace(
        records=[None] * len(lengths),
        whiteners=whiteners,
        slices=lambda: [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)],
        state_precision=np.ones(1),
    )
    coordinate = SimpleNamespace(prior_weight=1.0, value=float, coordinate=float)
    fit = SimpleNamespace(
        x=best,
        residual=measured - jacobian @ best,
        jacobian=jacobian,
        state_jacobians=tuple(np.zeros((2 * rows, 1)) for rows in lengths),
        trust=1.0,
        model=SimpleNamespace(coordinates=[coordinate] * 3),
    )
    return problem, fit, measured


@pytest.mark.parametrize(("lengths", "count"), [((30, 40, 50), 3), ((60, 50), 4), ((80,), 4)])
def test_parameters_without_a_log_are_those_of_a_fit_without_it(lengths: tuple[int, ...], count: int) -> None:
    problem, fit, measured = linear(np.random.default_rng(2), lengths)
    left_out = crossing.groups(problem)
    assert len(left_out) == count
    for group, x in zip(left_out, crossing.without_groups(problem, fit, left_out), strict=True):
        first = problem.slices()[group.log].start
        out = np.zeros(len(measured), dtype=bool)
        out[first + 2 * group.rows.start : first + 2 * group.rows.stop] = True
        kept = fit.jacobian[~out]
        expected = np.linalg.solve(kept.T @ kept + np.eye(3), kept.T @ measured[~out])
        np.testing.assert_allclose(x, expected, rtol=1e-9)


@pytest.mark.parametrize("lengths", [(30, 40, 50), (60, 50)])
def test_logs_are_predicted_by_what_the_others_give(lengths: tuple[int, ...]) -> None:
    """Of a linear model what refits without each group leave of it, to the last digit."""
    problem, fit, measured = linear(np.random.default_rng(6), lengths)
    squares = 0.0
    for group in crossing.groups(problem):
        first = problem.slices()[group.log].start
        out = np.zeros(len(measured), dtype=bool)
        out[first + 2 * group.rows.start : first + 2 * group.rows.stop] = True
        kept = fit.jacobian[~out]
        x = np.linalg.solve(kept.T @ kept + np.eye(3), kept.T @ measured[~out])
        squares += float(np.sum((measured[out] - fit.jacobian[out] @ x) ** 2))
    found = crossing.crossed(problem, fit, 1.0)
    assert found == pytest.approx(squares / len(measured), rel=1e-9)
    assert found > float(np.mean(fit.residual**2))
    assert crossing.share_of_excess(5.0, 3.0, 1.0) == 0.5
    # Where the plain model leaves no more than noise there is nothing to remove.
    assert crossing.share_of_excess(0.9, 0.9, 0.5) == 0.0


def prediction(squares: list[float], white: list[float] | None = None) -> holdout.Prediction:
    """Blocks of ten readings with these mean squares, mm^2."""
    values = np.array(squares) * 1e-6
    blocks = np.array(squares if white is None else white)
    return holdout.Prediction((), (), np.empty(0), blocks, 10.0 * values, np.full(len(values), 10), 0.0, ())


def test_gap_and_closure_are_one_number() -> None:
    """RMS in metres over the blocks that count, and the share of its square beyond noise."""
    plain, best = prediction([1.0, 25.0, 10.0, 4.0]), prediction([1.0, 3.0, 2.0, 2.0])
    before, after = holdout.rms_errors(plain, best)
    assert (before, after) == pytest.approx((np.sqrt(10.0) * 1e-3, np.sqrt(2.0) * 1e-3))
    assert holdout.share_removed(before, after, 1e-3) == pytest.approx(1.0 - 1.0 / 9.0)
    assert holdout.share_brought(plain, plain, best, 1e-3) == pytest.approx(8.0 / 9.0)
    # Where the plain model leaves nothing but noise there is nothing to remove.
    assert holdout.share_removed(before, after, 4e-3) == 0.0


def test_errors_are_counted_on_all_readings_of_a_log() -> None:
    """A fit has fewer, smoother rows, whose noise is less: the error of a right model is the noise of the readings."""
    rng = np.random.default_rng(4)
    time = np.arange(4000) * 5e-3
    motion = 0.1 * np.sin(2.0 * np.pi * np.column_stack([time, 0.7 * time, 0.3 * time]))
    record = record_of(time, motion + 1e-3 * rng.standard_normal(motion.shape), np.full((4000, 3), 1e5))
    fewer = thin(record, 3)
    rows = len(fewer.rows)
    problem: Any = SimpleNamespace(
        records=[fewer],
        whiteners=[SimpleNamespace(kept=rows, time=fewer.time)],
        split=lambda table: [table.reshape(rows, 3)],
    )
    outputs = np.column_stack([np.interp(fewer.time, time, y) for y in motion.T])
    readings = holdout.Readings((cut_to(record, fewer),))
    blocks = holdout.blocks_of(problem, readings)
    made = holdout.predicted(problem, readings, blocks, (outputs,), (), np.ones(3 * rows), (np.inf,), 0.0)
    assert holdout.rms_errors(made)[0] == pytest.approx(1e-3, rel=0.02)
    assert np.sum(made.counts) == 3 * len(readings.records[0].rows)
    assert made.mean_square == 1.0


def test_blocks_after_a_model_ran_away_count_for_neither() -> None:
    plain, best = prediction([4.0] * 10), prediction([1.0] * 8 + [np.nan] * 2)
    assert holdout.rms_errors(plain, best) == pytest.approx([2e-3, 1e-3])
    lost = prediction([1.0] + [np.nan] * 9)
    assert holdout.rms_errors(plain, lost) == [np.inf, np.inf]
    assert holdout.share_removed(np.inf, np.inf, 1e-3) == 0.0
    assert lost.mean_square == np.inf


def test_a_few_blocks_in_which_a_swing_ran_off_do_not_decide() -> None:
    plain = prediction([4.0] * 20)
    assert holdout.rms_errors(plain, prediction([1.0] * 19 + [900.0]))[1] == pytest.approx(1e-3)
    # As much as twice the plain model's worst is an error like any other, and so is what runs off all the time.
    assert holdout.rms_errors(plain, prediction([1.0] * 19 + [16.0]))[1] == pytest.approx(np.sqrt(1.75) * 1e-3)
    assert holdout.rms_errors(plain, prediction([1.0] * 15 + [900.0] * 5))[1] > 14e-3


@pytest.mark.parametrize("count", [1, 2])
def test_strengths_that_are_none_if_negative_are_those_of_non_negative_least_squares(count: int) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        table, wanted = rng.standard_normal((9, count)), rng.standard_normal((9, 7))
        normal, right = table.T @ table, table.T @ wanted
        found = one_sided(np.linalg.solve(normal, right), normal, right)
        assert found == pytest.approx(np.array([nnls(table, column)[0] for column in wanted.T]).T, abs=1e-12)


def test_a_lag_or_a_torsion_has_no_negative_strength() -> None:
    plans = {plan.kind: plan for plan in available(None)}
    one = {"pressure_lag", "torsion", "section_coupling", "creep", "friction", "delay"}
    either = {"payload", "tool_drag", "base_tilt", "pressure_gain", "effective_area"}
    assert all(plans[kind].is_one_sided for kind in one)
    assert not any(plans[kind].is_one_sided for kind in either)


def test_a_cause_that_acts_always_does_not_hide_behind_its_own_mean() -> None:
    """Errors of a second's memory beside a constant one: the mean is what they do not bring, in any of the draws."""
    rng = np.random.default_rng(8)
    errors = [slow(rng, 400, 1.0, 1, False) for _ in range(3)]
    lengths, steps = [400] * 3, [STEP] * 3

    def means(shift: float, *, with_means: bool) -> float:
        made = memory([own + shift for own in errors], steps, means=with_means)
        return float(made.draws(lengths, steps, 200, rng).reshape(3, 400, 200).mean(axis=1).std(axis=1).mean())

    # A memory of a second makes means over 40 s of sqrt(2 / 40) = 0.22; Student's t is a little wider.
    assert means(0.0, with_means=False) == pytest.approx(0.22, rel=0.5)
    assert means(3.0, with_means=False) == pytest.approx(means(0.0, with_means=False), rel=0.2)
    assert means(3.0, with_means=True) > 1.5
