"""The sizes of the noises, by the likelihood of what a fit leaves, parameters and initial states integrated out.

Source: restricted maximum likelihood (Patterson and Thompson 1971; Harville 1974): with r the residuals, J their
derivatives by the parameters, V(s) their covariance under sizes s and P the precision of the priors,

    -2 log L(s) = log|V| + log|J' V^-1 J + P| + r' V^-1 r - b' (J' V^-1 J + P)^-1 b,     b = J' V^-1 r + P (m - z).

What parameters can explain is not taken for smallness of the noise: a slow disturbance has few independent moments in a
log, and six parameters explain a good part of them. All terms come from the innovations (one pass of the filter each).

Chosen: what is coloured and what is unlogged enter only where the likelihood gains ``GAIN`` by them; where nothing
disturbs nothing is kept. The sizes are known only so well, slow ones least: how far the estimates and their covariance
move with them is part of the intervals (:func:`spread_of_sizes`; Kass and Steffey 1989).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from bha.errors import ConvergenceError
from bha.estimation.innovations import Innovations
from bha.estimation.noise import Linear, Noise, Sizes, reading_interval
from bha.estimation.records import Record, Window

Array = NDArray[np.float64]

#: By how much -2 log L must fall for two more sizes (a size and its time).
GAIN = 10.0
#: Band of correlation times of a sensor's colour and of what is unlogged, s: faster is white, slower an offset.
COLOUR_TIMES, UNLOGGED_TIMES = (0.01, 1.0), (0.03, 10.0)
#: Where times begin: one or the other side of how fast an arm answers.
_COLOUR_STARTS, _UNLOGGED_STARTS = (0.1,), (0.1, 2.0)
#: Means and standard deviations of the logarithms of times, s: weak, for a time that a log cannot tell.
_COLOUR_PRIOR, _UNLOGGED_PRIOR = (np.log(0.1), 1.2), (np.log(0.7), 1.5)
#: Interval of samples below which the differences of pressures tell their noise, s: several in the tenth of a second in
#: which valves fill; and standard deviations of its logarithm below and above.
_TOLD_INTERVAL, _LOGGED_TOLD, _LOGGED_DOUBT = 0.03, 0.05, 1.0
#: Residuals beyond this many of their usual sizes count as this many: outliers are no noise.
_CLIP = 5.0
#: Fewest readings whose differences tell, and least share of a record's own noise that they may.
_FEW, _LEAST = 8, 1e-3
#: Rows over which sizes are estimated, all records together; more are thinned.
_ENOUGH_ROWS = 4000
#: Of the search for sizes, relative; and what stands for no filter at all.
_TOLERANCE, _WORST = 3e-7, 1e12


@dataclass(frozen=True)
class Piece:
    """What a fit leaves in a window, and what it follows from, all in the channels' units.

    Attributes:
        window: the window.
        record: its record.
        linears: the arm as the record sees it, in some poses along the window; the first is the middle one.
        places: the pose nearest to each row, shape (rows,).
        sections: section of each pressure input, (inputs,).
        areas: of a bellows that it drives, m^2, (inputs,).
        base: size of each channel's white noise to which factors refer, shape (C,).
        course: where the channels are, shape (rows, C).
        ways: how far each channel has gone in the window, shape (rows, C).
        columns: residuals, their derivatives by parameters and by the initial state, shape (rows, C, 1 + p + 6n).
        offset: distance of the initial state from its guess, in the prior's standard deviations, shape (6n,).
        deviations: standard deviations of the prior of the initial state, shape (6n,).
    """

    window: Window
    record: Record
    linears: tuple[Linear, ...]
    places: NDArray[np.intp]
    sections: tuple[int, ...]
    areas: tuple[float, ...]
    base: Array
    course: Array
    ways: Array
    columns: Array
    offset: Array
    deviations: Array

    def noise(self, sizes: Sizes) -> Noise:
        """Its noise under sizes."""
        return sizes.of(self.record, self.base, self.sections)

    def filter(self, sizes: Sizes, *, every: int = 1, whole: bool = True) -> Innovations:
        """Its filter under sizes.

        Args:
            sizes: of the noises.
            every: of how many rows one is looked at.
            whole: whether the arm is that of the pose nearest to each row, or that of the middle pose in all.
        """
        noise = self.noise(sizes)
        systems = [linear.disturbed(noise) for linear in (self.linears if whole else self.linears[:1])]
        rows = slice(self.window.first, self.window.last)
        usable = self.record.usable[rows]
        if every > 1:
            usable = usable & (np.arange(len(usable)) % every == 0)[:, None]
        places = self.places if whole else np.zeros_like(self.places)
        return Innovations(systems, places, self.record.time[rows], usable, self.ways)


@dataclass(frozen=True)
class Judged:
    """Sizes and what follows from them.

    Attributes:
        value: -2 log L, up to a constant.
        covariance: of the parameters, shape (p, p).
        step: to the parameters that are best under these sizes, shape (p,).
    """

    value: float
    covariance: Array
    step: Array


@dataclass(frozen=True)
class Likelihood:
    """The likelihood of sizes near a point.

    Attributes:
        pieces: what the fit leaves there.
        prior_step: distance of the parameters from their priors' means, shape (p,).
        prior_deviation: standard deviations of the priors, shape (p,).
    """

    pieces: tuple[Piece, ...]
    prior_step: Array
    prior_deviation: Array

    def __call__(self, sizes: Sizes, *, whole: bool = False) -> Judged:
        """Judge sizes.

        Args:
            sizes: of the noises.
            whole: whether all rows and poses are looked at; some rows and the middle pose if not, which is fast.

        Raises:
            ConvergenceError: they have no filter.
        """
        p = len(self.prior_step)
        precision = self.prior_deviation**-2.0
        h, g = np.diag(precision), precision * self.prior_step
        total = 0.0
        rows = sum(len(piece.columns) for piece in self.pieces)
        every = 1 if whole else max(1, round(rows / _ENOUGH_ROWS))
        for piece in self.pieces:
            innovations, determinant = piece.filter(sizes, every=every, whole=whole).judged(piece.columns)
            white = innovations.reshape(-1, piece.columns.shape[2])
            products = white.T @ white
            total += determinant + float(products[0, 0])
            states = slice(1 + p, None)
            h_state = products[states, states] + np.diag(piece.deviations**-2.0)
            g_state = products[states, 0] + piece.offset / piece.deviations
            mixed = products[states, 1 : 1 + p]
            gain = np.linalg.solve(h_state, np.column_stack([mixed, g_state]))
            h = h + products[1 : 1 + p, 1 : 1 + p] - mixed.T @ gain[:, :p]
            g = g + products[1 : 1 + p, 0] - mixed.T @ gain[:, p]
            total += float(np.linalg.slogdet(h_state)[1]) - float(g_state @ gain[:, p])
        scale = 1.0 / np.sqrt(np.diag(h))
        inverse = np.linalg.inv(h * np.outer(scale, scale)) * np.outer(scale, scale)
        step = inverse @ g
        return Judged(total + float(np.linalg.slogdet(h)[1]) - float(g @ step), inverse, step)


@dataclass(frozen=True)
class Found:
    """The sizes a fit was found to have.

    Attributes:
        sizes: the likeliest.
        vector: logarithms of them, as :func:`packed` orders them.
        shape: which there are.
        judged: what follows from them.
        gains: by how much -2 log L falls by what is coloured and by what is unlogged, each beside the best without.
    """

    sizes: Sizes
    vector: Array
    shape: Shape
    judged: Judged
    gains: dict[str, float]


@dataclass(frozen=True)
class Shape:
    """Which sizes there are: sorts of channels, of them coloured, sections with unlogged pressure.

    ``logged`` is the standard deviation of the logarithm of the factor on the noise of logged pressures, 0 for none.
    """

    white: tuple[str, ...]
    colour: tuple[str, ...] = ()
    unlogged: tuple[int, ...] = ()
    logged: float = 0.0

    @property
    def readings_tell(self) -> bool:
        """Whether the readings of the pressures tell their own noise, or have none."""
        return self.logged < _LOGGED_DOUBT

    def sizes(self, vector: Array) -> Sizes:
        """The sizes whose logarithms are ``vector``."""
        values = iter(np.exp(vector))
        return Sizes(
            {kind: float(next(values)) for kind in self.white},
            {kind: (float(next(values)), float(next(values))) for kind in self.colour},
            {section: (float(next(values)), float(next(values))) for section in self.unlogged},
            float(next(values)) if self.logged else 1.0,
        )

    def bounds(self) -> list[tuple[float, float]]:
        """Bounds of the logarithms."""
        found = [(-4.0, 6.0) for _ in self.white]
        for _ in self.colour:
            found += [(-4.0, 6.0), (float(np.log(COLOUR_TIMES[0])), float(np.log(COLOUR_TIMES[1])))]
        for _ in self.unlogged:
            found += [(0.0, 12.0), (float(np.log(UNLOGGED_TIMES[0])), float(np.log(UNLOGGED_TIMES[1])))]
        # Readings that move hide their noise: differences may find too much of it, not too little.
        return found + ([(-3.0, 0.1)] if self.logged else [])

    def prior(self, vector: Array) -> float:
        """What the weak priors of the times add to -2 log L."""
        first = len(self.white)
        second = first + 2 * len(self.colour)
        third = second + 2 * len(self.unlogged)
        pairs = [(vector[first + 1 : second : 2], _COLOUR_PRIOR), (vector[second + 1 : third : 2], _UNLOGGED_PRIOR)]
        if self.logged:
            pairs.append((vector[third:], (0.0, self.logged)))
        return float(sum(np.sum(((times - mean) / deviation) ** 2) for times, (mean, deviation) in pairs))


def find(likelihood: Likelihood, *, before: Found | None = None) -> Found:
    """The likeliest sizes, with what is coloured and unlogged only where it is told.

    Args:
        likelihood: of the sizes.
        before: what was found at a point nearby, to begin with and to keep the choice of.
    """
    if before is not None:
        return replace(_best(likelihood, before.shape, [before.vector]), gains=before.gains)
    kinds = tuple(dict.fromkeys(o.kind for piece in likelihood.pieces for o in piece.record.observation.outputs))
    sections = tuple(dict.fromkeys(s for piece in likelihood.pieces for s in piece.sections))
    shape = Shape(kinds, logged=_doubt_of_logged(likelihood))
    last = [0.0] if shape.logged else []
    lasts = [last] if shape.readings_tell else [last, [-1.5]]
    white = np.zeros(len(kinds))
    colours = [np.tile([0.0, np.log(seconds)], len(kinds)) for seconds in _COLOUR_STARTS]
    forces = [np.tile([np.log(300.0), np.log(seconds)], len(sections)) for seconds in _UNLOGGED_STARTS]
    plain = _best(likelihood, shape, [np.concatenate([white, last]) for last in lasts])
    last = [np.log(plain.sizes.logged)] if shape.logged else []
    coloured = _best(likelihood, replace(shape, colour=kinds), [np.concatenate([white, c, last]) for c in colours])
    pressed = _best(likelihood, replace(shape, unlogged=sections), [np.concatenate([white, f, last]) for f in forces])
    gains = {
        "colour": plain.judged.value - coloured.judged.value,
        "unlogged": plain.judged.value - pressed.judged.value,
    }
    best = plain
    if max(gains["colour"] - GAIN * len(kinds), gains["unlogged"] - GAIN * len(sections)) > 0.0:
        best, added = min(((coloured, len(sections)), (pressed, len(kinds))), key=lambda choice: choice[0].judged.value)
        found = best.sizes
        white = np.log([found.white[kind] for kind in kinds])
        colours = [np.log(np.ravel([found.colour[kind] for kind in kinds]))] if found.colour else colours
        forces = [np.log(np.ravel([found.unlogged[section] for section in sections]))] if found.unlogged else forces
        starts = [np.concatenate([white, c, f, last]) for c in colours for f in forces]
        both = _best(likelihood, replace(shape, colour=kinds, unlogged=sections), starts)
        if best.judged.value - both.judged.value > GAIN * added:
            best = both
    return replace(best, gains=gains)


def _doubt_of_logged(likelihood: Likelihood) -> float:
    """How well the readings of the pressures tell their own noise: standard deviation of its logarithm; 0 for none."""
    records = [piece.record for piece in likelihood.pieces]
    if not any(np.any(rec.pressure_noise > 0.0) for rec in records):
        return 0.0
    return _LOGGED_TOLD if all(is_dense(rec) for rec in records) else _LOGGED_DOUBT


def is_dense(rec: Record) -> bool:
    """Whether pressures are sampled so often that their differences tell their noise."""
    return reading_interval(rec) < _TOLD_INTERVAL


def spread_of_sizes(likelihood: Likelihood, found: Found, axes_of_sizes: tuple[Array, Array]) -> Array:
    """Covariance of the parameters with what is not known of the sizes in it, shape (p, p).

    The sizes' logarithms are taken as normal with the curvature of the likelihood; estimates and covariances are
    averaged over two points along each axis of it (the unscented rule, exact to third order).
    """
    center, count = found.vector, len(found.vector)
    sizes, axes = axes_of_sizes
    bounds = np.array(found.shape.bounds())
    steps, covariances = [], []
    for size, axis in zip(sizes, axes.T, strict=True):
        for sign in (1.0, -1.0):
            at = np.clip(center + sign * np.sqrt(count) * size * axis, bounds[:, 0], bounds[:, 1])
            judged = likelihood(found.shape.sizes(at))
            steps.append(judged.step)
            covariances.append(judged.covariance)
    moved = np.array(steps) - found.judged.step
    return np.asarray(np.mean(covariances, axis=0) + moved.T @ moved / len(moved))


def most_logged(found: Found, axes_of_sizes: tuple[Array, Array]) -> float:
    """Factor on the records' noise of the logged pressures that is greater than the true one, at 95 %."""
    sizes, axes = axes_of_sizes
    deviation = float(np.sqrt(np.sum((axes[-1] * sizes) ** 2)))
    return float(np.exp(min(found.vector[-1] + 1.645 * deviation, found.shape.bounds()[-1][1])))


def axes_of_sizes(likelihood: Likelihood, found: Found) -> tuple[Array, Array]:
    """Standard deviations of the sizes' logarithms along the axes of the likelihood, shape (s,), and these, (s, s)."""
    curvature = _curvature(lambda vector: _value(likelihood, found.shape, vector), found.vector)
    values, axes = np.linalg.eigh(0.5 * curvature)
    # A direction that the likelihood does not tell is as wide as the priors of times are.
    return 1.0 / np.sqrt(np.maximum(values, 1.0 / 1.5**2)), axes


def base_of(rec: Record, residual: Array, usable: NDArray[np.bool_]) -> Array:
    """White noise of each channel as third differences of residuals show it, shape (C,); a beginning."""
    found = []
    for values, good, own in zip(residual.T, usable.T, rec.noise, strict=True):
        read = values[good]
        size = float(np.sqrt(np.mean(np.diff(read, 3) ** 2) / 20.0)) if len(read) > _FEW else 0.0
        found.append(size if size > _LEAST * own else float(own))
    return np.array(found)


def clipped(residual: Array, usable: NDArray[np.bool_], least: Array | float = 0.0) -> Array:
    """Residuals with outliers cut to a few times the usual size of their channel, and no less than ``least``."""
    sizes = np.nanmedian(np.abs(np.where(usable, residual, np.nan)), axis=0) / 0.6745
    limit = _CLIP * np.where(np.isfinite(sizes) & (sizes > 0.0), sizes, np.inf)
    limit = np.maximum(limit, least)
    return np.asarray(np.clip(residual, -limit, limit))


def _value(likelihood: Likelihood, shape: Shape, vector: Array) -> float:
    try:
        value = likelihood(shape.sizes(vector)).value
    except (ConvergenceError, np.linalg.LinAlgError, ValueError):
        return _WORST
    return value + shape.prior(vector) if np.isfinite(value) else _WORST


def _best(likelihood: Likelihood, shape: Shape, starts: Sequence[Array]) -> Found:
    """The likeliest sizes of a shape from the best of some starts."""

    def value(vector: Array) -> float:
        return _value(likelihood, shape, vector)

    start = min(starts, key=value)
    bounds = shape.bounds()
    low, high = np.array(bounds).T
    options: Any = {"eps": 1e-3, "ftol": _TOLERANCE, "maxiter": 30}
    found = minimize(value, np.clip(start, low, high), method="L-BFGS-B", bounds=bounds, options=options)
    vector = np.asarray(found.x, dtype=np.float64)
    sizes = shape.sizes(vector)
    judged = likelihood(sizes)
    return Found(sizes, vector, shape, replace(judged, value=judged.value + shape.prior(vector)), {})


def _curvature(function: Callable[[Array], float], center: Array, step: float = 0.1) -> Array:
    """Second derivatives by differences, shape (k, k)."""
    count = len(center)
    at = function(center)
    alone = np.array([[function(center + sign * step * e) for sign in (1.0, -1.0)] for e in np.eye(count)])
    found = np.diag((alone.sum(axis=1) - 2.0 * at) / step**2)
    for i in range(count):
        for k in range(i):
            e = step * (np.eye(count)[i] + np.eye(count)[k])
            mixed = function(center + e) + function(center - e) - alone[i].sum() - alone[k].sum() + 2.0 * at
            found[i, k] = found[k, i] = mixed / (2.0 * step**2)
    return found
