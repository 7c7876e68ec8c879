"""How well the parameters are known at the end of a fit.

Sources of error are put together:

- sensor noise of what was measured, through the inverse of the normal equations;
- noise of the measured pressures that drive the simulation, through simulations with redrawn noise;
- what is not known of the sizes of the noises, where these were found (:mod:`bha.estimation.noise_fit`), and what
  rounding to coarse steps does beyond a first-order process, by redrawn readings;
- whatever makes residuals correlated (a model that is not quite right, a push that is in no log), through the sandwich
  estimator with the long-run covariance of the scores (:mod:`bha.estimation.long_run`). It counts only where it is
  larger than the first two: in every direction the larger variance is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.estimation import pressure_noise
from bha.estimation.disturbed import Disturbed
from bha.estimation.long_run import long_run
from bha.estimation.noise import redrawn_errors
from bha.estimation.noise_fit import spread_of_sizes
from bha.estimation.pressure_noise import Corrected
from bha.estimation.problem import Normal, Point, Problem
from bha.estimation.rounding import Rounding

Array = NDArray[np.float64]

#: Least and greatest share of the information that is believed of readings in steps.
_SHARES = (0.5, 1.5)
#: Redrawn pressure noises.
DRAWS = 48


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of the estimated coordinates z, and what it is made of; all matrices (p, p).

    Attributes:
        covariance: all sources together.
        from_sensors: from sensor noise alone.
        from_pressures: from noise of the pressures; zero for innovations, whose own covariance has it.
        information: information on z in the data (without priors), initial states eliminated.
        inflation: median over parameters of the variance, all sources together, by that from sensor noise.
        correlation_time: time over which residuals stay correlated, s, the longest of all channels.
    """

    covariance: Array
    from_sensors: Array
    from_pressures: Array
    information: Array
    inflation: float
    correlation_time: float


@dataclass(frozen=True)
class Projection:
    """Sensitivity of a window's scaled residuals to z with the initial state's share taken out, shape (rows, C, p)."""

    sensitivity: Array
    residual: Array
    mask: NDArray[np.bool_]


def projections(normal: Normal) -> list[Projection]:
    """Per window what its residuals say about the parameters once its own initial state has been fitted."""
    assert normal.blocks is not None
    found = []
    for k, block in enumerate(normal.blocks):
        gain = np.linalg.solve(normal.h_state[k], normal.h_mixed[k])
        found.append(Projection(block.by_z - block.by_state @ gain, block.residual, block.mask))
    return found


def uncertainty(
    problem: Problem,
    point: Point,
    normal: Normal,
    better: Corrected,
    *,
    noises: Disturbed | None = None,
    seed: int = 0,
    draws: int = DRAWS,
) -> Uncertainty:
    """Covariance of the coordinates at the minimum ``point``.

    Args:
        problem: the problem.
        point: the minimum.
        normal: normal equations there, blocks kept.
        better: information without what pressure noise adds to it.
        noises: what residuals are weighed by, where they are innovations.
        seed: of redrawn pressure noises.
        draws: how many of them.
    """
    h, _ = normal.reduced()
    parts = projections(normal)
    prior = np.diag(problem.prior[1] ** -2.0)
    inverse = _inverse(better.information + prior)
    spread = inverse @ better.measured
    sensors = spread @ (h - prior) @ spread.T + inverse @ prior @ inverse
    sensitivities = [part.sensitivity * part.mask[..., None] for part in parts]
    drawn = draws if noises is None or noises.is_coarse else 0
    pressures = spread @ pressure_noise.scores(problem, point, sensitivities, seed, drawn) @ spread.T
    lasting = long_run(_by_log(problem, parts))
    covariance = sensors + pressures
    if noises is not None:
        # Innovations have all that disturbs in their own covariance, but for readings in coarse steps.
        covariance = sensors
        if noises.rounding.is_coarse:
            spread = _inverse(_with_slope(noises, better.information, parts) + prior) @ better.measured
            readings = _rounded_anew(problem, point, noises.rounding, sensitivities, seed, max(draws, DRAWS))
            covariance = larger(covariance, spread @ readings @ spread.T)
        elif noises.is_coarse:
            readings = _redrawn_readings(noises, sensitivities, seed, max(draws, DRAWS))
            covariance = larger(covariance, spread @ readings @ spread.T + pressures)
        covariance = covariance + _of_sizes(noises)
    covariance = larger(covariance, lasting.widening**2 * spread @ lasting.covariance @ spread.T)
    return Uncertainty(
        covariance=covariance,
        from_sensors=sensors,
        from_pressures=pressures,
        information=better.information,
        inflation=float(np.median(np.diag(covariance) / np.diag(inverse))),
        correlation_time=lasting.seconds,
    )


def _of_sizes(noises: Disturbed) -> Array:
    """What is not known of the sizes of the noises: how far estimates and covariance move with them, shape (p, p)."""
    beyond = spread_of_sizes(noises.likelihood, noises.found, noises.axes_of_sizes) - noises.found.judged.covariance
    values, vectors = np.linalg.eigh(0.5 * (beyond + beyond.T))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _with_slope(noises: Disturbed, information: Array, parts: list[Projection]) -> Array:
    """The information where expected readings follow the channels in steps, not evenly, shape (p, p).

    Estimates move by the inverse of what scores do with the parameters: not at all where a channel stands still in the
    middle of a step.
    """
    even, stepped = np.zeros_like(information), np.zeros_like(information)
    for piece, part in zip(noises.likelihood.pieces, parts, strict=True):
        white, own = piece.filter(noises.found.sizes), part.sensitivity * part.mask[..., None]
        by_z = piece.columns[..., 1 : 1 + len(information)]
        even += np.einsum("tcp,tcq->pq", own, white(by_z))
        stepped += np.einsum("tcp,tcq->pq", own, white(by_z * noises.rounding.slope(piece.course)[..., None]))
    values, vectors = np.linalg.eigh(0.5 * (even + even.T))
    kept = np.maximum(values, 1e-12 * values[-1])
    root, inverse_root = (vectors * kept**e @ vectors.T for e in (0.5, -0.5))
    shares, directions = np.linalg.eigh(inverse_root @ (0.5 * (stepped + stepped.T)) @ inverse_root)
    turn = inverse_root @ directions
    # From about 1 the shares of a few hundred steps scatter by some tenths.
    change = root @ directions @ np.diag(np.clip(shares, *_SHARES) ** 0.5) @ turn.T
    return np.asarray(change @ information @ change.T)


def _rounded_anew(
    problem: Problem, point: Point, rounding: Rounding, sensitivities: list[Array], seed: int, draws: int
) -> Array:
    """Covariance (p, p) of the scores with pressures, noise of the sensors and so their rounding drawn anew."""
    model, random = problem.model, np.random.default_rng([seed, 1])
    course = model.predict(point.z, problem.windows, point.states)
    scores = np.zeros((draws, len(point.z)))
    for draw in range(draws):
        shaken = pressure_noise.redrawn(model, seed, draw).predict(point.z, problem.windows, point.states)
        for window, sensitivity, true, other in zip(problem.windows, sensitivities, course, shaken, strict=True):
            shown = np.nan_to_num(other)
            left = rounding.read(true, random) - rounding.error(shown) - shown
            mask = model.records[window.record].usable[window.first : window.last]
            white = problem.residuals.white(window, left, mask)
            scores[draw] += np.einsum("tcp,tc->p", sensitivity, white)
    return scores.T @ scores / draws


def _redrawn_readings(noises: Disturbed, sensitivities: list[Array], seed: int, draws: int) -> Array:
    """Covariance (p, p) of the descent direction that noise and rounding of the readings cause, by redrawing them."""
    random = np.random.default_rng([seed, 1])
    scores = np.zeros((draws, sensitivities[0].shape[2]))
    for piece, sensitivity in zip(noises.likelihood.pieces, sensitivities, strict=True):
        noise = piece.noise(noises.found.sizes)
        errors = np.stack([redrawn_errors(noise, piece.course, random) for _ in range(draws)], axis=-1)
        white = piece.filter(noises.found.sizes)(errors)
        scores += np.einsum("tcp,tcd->dp", sensitivity, white)
    return scores.T @ scores / draws


def larger(a: Array, b: Array) -> Array:
    """The smallest symmetric matrix of a simple kind that is not below ``a`` nor ``b``: ``a``, raised along the
    directions in which ``b`` is larger, measured in units of ``a``."""
    values, vectors = np.linalg.eigh(0.5 * (a + a.T))
    values = np.maximum(values, 1e-14 * values.max())
    root, inverse_root = (vectors * values**e @ vectors.T for e in (0.5, -0.5))
    ratios, directions = np.linalg.eigh(inverse_root @ (0.5 * (b + b.T)) @ inverse_root)
    return np.asarray(root @ (directions * np.maximum(ratios, 1.0) @ directions.T) @ root)


def _by_log(problem: Problem, parts: list[Projection]) -> list[tuple[Array, Array, float]]:
    """Scores and residuals of each log, its windows joined, and the interval of its rows, s."""
    found = []
    for number, rec in enumerate(problem.model.records):
        own = [part for window, part in zip(problem.windows, parts, strict=True) if window.record == number]
        if own:
            residuals = np.concatenate([part.residual for part in own])
            scores = np.concatenate([np.einsum("tcp,tc->tp", part.sensitivity, part.residual) for part in own])
            found.append((scores, residuals, rec.duration / (len(rec) - 1)))
    return found


def _inverse(h: Array) -> Array:
    d = np.sqrt(np.diag(h))
    return np.asarray(np.linalg.pinv(h / np.outer(d, d), rcond=1e-14, hermitian=True) / np.outer(d, d))
