"""How motions follow pressures: second moments of motions and of pressures that went through a filter.

What: pressures are put on an even grid of time and through each filter of a bank (lags and damped oscillators of static
gain one, the ways in which an arm follows its pressures whatever its mass, damping and stiffness). For each filter the
second moments with the motions are kept; everything that is asked later (which chamber bends a section which way) is
algebra on small matrices. The filter is the one with which free linear maps explain the most, so the choice does not
depend on any hypothesis.
Sign: a filter's static gain is +1; what turns against its pressure is therefore not taken for inertia.
Limits: motions near a resonance with little damping, over a narrow band, can be explained by a filter with the wrong
sign; logs with slow parts decide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Most rows of the even grid, for all logs together, and its shortest step, s.
MOST_ROWS, SHORTEST_STEP = 6000, 0.008
#: Pieces of time of about equal length into which the logs are cut, to learn how sure a direction is.
PIECES = 10
#: Time constants of lags, s; frequencies, Hz, and shares of critical damping of oscillators.
LAGS = (0.0, 0.03, 0.07, 0.15, 0.3, 0.6, 1.2, 2.5, 5.0, 12.0)
FREQUENCIES = tuple(np.geomspace(0.4, 6.0, 10))
DAMPINGS = (0.07, 0.25, 0.6)
#: Part of the largest eigenvalue that is added to the pressures' moments: directions that did not move explain nothing.
RIDGE = 1e-4


@dataclass(frozen=True)
class Filter:
    """A lag of time constant ``lag``, s, or (where ``frequency`` is above 0) an oscillator, Hz, of some damping."""

    lag: float = 0.0
    frequency: float = 0.0
    damping: float = 0.0

    def gain(self, s: Complex) -> Complex:
        """Gain at s = i omega, rad/s."""
        if self.frequency > 0.0:
            ratio = s / (2.0 * np.pi * self.frequency)
            return np.asarray(1.0 / (1.0 + 2.0 * self.damping * ratio + ratio**2))
        return np.asarray(1.0 / (1.0 + s * self.lag))


BANK = tuple(Filter(lag) for lag in LAGS) + tuple(Filter(0.0, f, d) for f in FREQUENCIES for d in DAMPINGS)


@dataclass(frozen=True)
class Signals:
    """Motions and pressures of a log on an even grid of T times.

    Attributes:
        step: of the grid, s.
        pressures: Pa, shape (T, J).
        motions: motion of each block, complex (bending) or real (lengths), shape (T,).
        good: where all motions are known, shape (T,).
    """

    step: float
    pressures: Array
    motions: dict[tuple[str, int, str], Complex]
    good: NDArray[np.bool_]


@dataclass(frozen=True)
class Moments:
    """Second moments of one motion y with the J filtered pressures, in pieces of time; means are taken out per log.

    Attributes:
        pp: mean product of pressures, shape (pieces, J, J).
        yp: mean of y times pressure, shape (pieces, J), complex.
        yy: mean of the square of y, shape (pieces,).
    """

    pp: Array
    yp: Complex
    yy: Array

    def without(self, piece: int) -> Moments:
        """All pieces but one."""
        kept = np.arange(len(self.yy)) != piece
        return Moments(self.pp[kept], self.yp[kept], self.yy[kept])

    def total(self) -> tuple[Array, Complex, float]:
        """The moments of all pieces together."""
        return self.pp.sum(axis=0), self.yp.sum(axis=0), float(self.yy.sum())


def even_grid(time: Array, rows: int = MOST_ROWS) -> Array:
    """An even grid over the times of a log, no finer than the log, of at most ``rows`` times."""
    span = float(time[-1] - time[0])
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 1.0
    step = max(usual, SHORTEST_STEP, span / rows)
    return np.asarray(time[0] + step * np.arange(int(span / step) + 1))


def filtered(pressures: Array, step: float, bank: tuple[Filter, ...] = BANK) -> list[Array]:
    """Pressures (T, J) through each filter, from rest under the first row."""
    rest, rows = pressures[0], len(pressures)
    size = 1 << int(np.ceil(np.log2(2 * rows)))
    # What follows the last row is its value and a way back to rest that stays out of the rows that are kept.
    moved = np.zeros((size, pressures.shape[1]))
    moved[:rows] = pressures - rest
    spectrum: Complex = np.asarray(np.fft.rfft(moved, axis=0), dtype=np.complex128)
    s: Complex = np.asarray(2j * np.pi * np.fft.rfftfreq(size, step), dtype=np.complex128)
    return [rest + np.fft.irfft(spectrum * f.gain(s)[:, None], size, axis=0)[:rows] for f in bank]


def moments(signals: list[Signals], bank: tuple[Filter, ...] = BANK) -> dict[tuple[str, int, str], list[Moments]]:
    """For each motion the moments with each filter's pressures, over all logs that have it."""
    blocks = list(dict.fromkeys(key for s in signals for key in s.motions))
    total = sum(int(s.good.sum()) for s in signals)
    pieces: dict[tuple[str, int, str], list[list[tuple[Array, Complex, float]]]] = {
        key: [[] for _ in bank] for key in blocks
    }
    for signal in signals:
        good = signal.good
        rows = int(good.sum())
        cuts = np.array_split(np.arange(rows), max(1, round(PIECES * rows / max(total, 1))))
        own = [key for key in blocks if key in signal.motions]
        motions = np.column_stack([signal.motions[key][good] for key in own]) if own else np.empty((rows, 0))
        motions = motions - motions.mean(axis=0)
        # Side by side as real numbers: products of real matrices are fast.
        table = np.concatenate([motions.real, motions.imag], axis=1)
        squares = [np.sum(table[cut] ** 2, axis=0).reshape(2, -1).sum(axis=0) / total for cut in cuts]
        for k, pressures in enumerate(filtered(signal.pressures, signal.step, bank)):
            p = pressures[good]
            p = p - p.mean(axis=0)
            for cut, square in zip(cuts, squares, strict=True):
                pp = p[cut].T @ p[cut] / total
                real, imaginary = (table[cut].T @ p[cut] / total).reshape(2, len(own), -1)
                for place, key in enumerate(own):
                    pieces[key][k].append((pp, real[place] + 1j * imaginary[place], float(square[place])))
    return {
        key: [
            Moments(np.array([p[0] for p in parts]), np.array([p[1] for p in parts]), np.array([p[2] for p in parts]))
            for parts in per_filter
        ]
        for key, per_filter in pieces.items()
    }


def free_map(found: Moments) -> tuple[Complex, float]:
    """The free linear map from pressures to a motion, shape (J,), and the share of the motion that it explains."""
    pp, yp, yy = found.total()
    scale = np.sqrt(np.maximum(np.diag(pp), 1e-300))
    normal = pp / np.outer(scale, scale) + RIDGE * np.eye(len(pp))
    solved = np.linalg.solve(normal, yp / scale)
    explained = float(np.real(np.vdot(solved, yp / scale)))
    return solved / scale, explained / yy if yy > 0.0 else 0.0
