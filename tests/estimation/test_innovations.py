"""Innovations against dense covariances, and sizes of noises against those that made the residuals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from bha.errors import ConvergenceError
from bha.estimation.innovations import Disturbed, Innovations

RANDOM = np.random.default_rng(3)


def oscillator(white: float = 0.1) -> Disturbed:
    """Two channels of a damped oscillator that an Ornstein-Uhlenbeck process pushes, the second with colour."""
    state = np.array([[0.0, 1.0, 0.0, 0.0], [-900.0, -20.0, 900.0, 0.0], [0.0, 0.0, -2.0, 0.0], [0.0, 0.0, 0.0, -9.0]])
    return Disturbed(
        state=state,
        driving=np.diag([0.0, 0.0, 2.0 * 2.0 * 4.0, 2.0 * 9.0 * 0.5]),
        shown=np.array([[1.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 1.0]]),
        white=np.array([white, 2.0 * white]),
        lengths=np.full(4, np.inf),
        channels=np.zeros(4, dtype=np.int64),
        sizes=np.zeros(4),
    )


def dense(system: Disturbed, time: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Covariance of the readings by the matrix exponential."""
    rows, channels = mask.shape
    covariance = np.zeros((rows, channels, rows, channels))
    for i in range(rows):
        for k in range(i + 1):
            block = system.shown @ expm(system.state * (time[i] - time[k])) @ system.stationary @ system.shown.T
            covariance[i, :, k], covariance[k, :, i] = block, block.T
        covariance[i, :, i] += np.diag(system.white)
    read = mask.ravel()
    return np.asarray(covariance.reshape(rows * channels, -1)[np.ix_(read, read)])


def test_innovations_are_the_gaussian_likelihood_of_readings_at_any_times() -> None:
    time = np.asarray(np.round(np.sort(RANDOM.uniform(0.0, 3.0, 60)), 6), dtype=np.float64)
    mask = RANDOM.random((60, 2)) > 0.3
    mask[10:14] = False
    system, values = oscillator(), RANDOM.standard_normal((60, 2, 3))
    white, determinant = Innovations([system], np.zeros(60, dtype=np.intp), time, mask, np.zeros((60, 2))).judged(
        values
    )
    covariance = dense(system, time, mask)
    read = values[mask]
    assert determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-6)
    assert np.einsum("tci,tcj->ij", white, white) == pytest.approx(read.T @ np.linalg.solve(covariance, read), rel=1e-6)
    assert not np.any(white[~mask])


def test_constant_gains_are_those_of_the_whole_transient() -> None:
    time, values = 0.01 * np.arange(400.0), RANDOM.standard_normal((400, 2))
    mask = np.ones((400, 2), dtype=np.bool_)
    filtered = Innovations([oscillator()], np.zeros(400, dtype=np.intp), time, mask, np.zeros((400, 2)))
    white, determinant = filtered.judged(values)
    covariance = dense(oscillator(), time, mask)
    assert determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-7)
    expected = values.ravel() @ np.linalg.solve(covariance, values.ravel())
    assert float(np.sum(white**2)) == pytest.approx(expected, rel=1e-6)


def test_where_nothing_disturbs_innovations_are_residuals_in_units_of_their_noise() -> None:
    none, nothing = np.zeros(0), np.zeros((0, 0))
    still = Disturbed(nothing, nothing, np.zeros((2, 0)), np.array([4.0, 9.0]), none, np.zeros(0, dtype=np.int64), none)
    values, mask = RANDOM.standard_normal((5, 2)), np.array([[True, True]] * 4 + [[False, True]])
    white, determinant = Innovations([still], np.zeros(5, dtype=np.intp), np.arange(5.0), mask, values).judged(values)
    assert white == pytest.approx(np.where(mask, values / [2.0, 3.0], 0.0))
    assert determinant == pytest.approx(4 * np.log(4.0) + 5 * np.log(9.0))


def test_what_is_forgotten_by_the_way_stays_where_nothing_moves() -> None:
    """Ten readings at one place share one error of rounding: their mean is no better than one of them."""
    place = Disturbed(
        np.zeros((1, 1)),
        np.zeros((1, 1)),
        np.ones((1, 1)),
        np.array([1e-6]),
        np.array([0.1]),
        np.zeros(1, int),
        np.ones(1),
    )
    time, mask, ones = np.arange(10.0), np.ones((10, 1), dtype=np.bool_), np.ones((10, 1))
    places = np.zeros(10, dtype=np.intp)
    still = Innovations([place], places, time, mask, np.zeros((10, 1)))(ones)
    moving = Innovations([place], places, time, mask, np.arange(10.0)[:, None])(ones)
    assert float(np.sum(still**2)) == pytest.approx(1.0, rel=1e-3)
    assert float(np.sum(moving**2)) == pytest.approx(10.0, rel=1e-3)


def test_failed_simulations_come_back_as_such_and_impossible_noise_is_an_error() -> None:
    places, time, mask = np.zeros(3, dtype=np.intp), np.arange(3.0), np.ones((3, 2), dtype=np.bool_)
    assert np.all(np.isnan(Innovations([oscillator()], places, time, mask, np.zeros((3, 2)))(np.full((3, 2), np.nan))))
    with pytest.raises(ConvergenceError, match="not positive"):
        Innovations([oscillator(-1e9)], places, time, mask, np.zeros((3, 2)))(np.zeros((3, 2)))


def test_modes_that_die_out_at_once_are_no_overflow() -> None:
    """A stiff arm between readings at 10 Hz: modes of 0.1 ms and of 2 s, driven alike."""
    rates, nothing = np.array([1e4, 0.5]), np.zeros(2)
    system = Disturbed(
        state=np.diag(-rates),
        driving=np.full((2, 2), 3.0),
        shown=np.eye(2),
        white=np.ones(2),
        lengths=np.full(2, np.inf),
        channels=np.zeros(2, dtype=np.int64),
        sizes=nothing,
    )
    transition, added = system.over(0.1)
    both = rates[:, None] + rates
    np.testing.assert_allclose(np.diag(transition), np.exp(-0.1 * rates), rtol=1e-9, atol=1e-300)
    np.testing.assert_allclose(added, 3.0 * (1.0 - np.exp(-0.1 * both)) / both, rtol=1e-9)
