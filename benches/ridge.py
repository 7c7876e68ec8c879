"""A black box to beat: ridge regression of head positions on pressures with lags, plays and products.

Each pressure comes as it is, behind three first-order lags and through four plays (hysteresis operators); with it go
all products of two pressures. The penalty is chosen by leaving out each log of the training set in turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import bha
from bha.recordings import PressureSort

Array = NDArray[np.float64]

#: Time constants of the lags, s, and half widths of the plays, Pa.
LAGS = (0.3, 1.0, 3.0)
PLAYS = (2e3, 5e3, 1e4, 2e4)
PENALTIES = tuple(10.0**k for k in range(-4, 5))
#: Distance of the rows, s.
INTERVAL = 0.05
HEADS = ("x1", "y1", "z1", "x2", "y2", "z2")
INPUTS = tuple(f"{s}{k}" for s in (1, 2) for k in (1, 2, 3))


@dataclass(frozen=True)
class Ridge:
    """Heads as linear functions of scaled features."""

    pressures: PressureSort
    middle: Array
    scale: Array
    weights: Array
    offset: Array

    def tip_error(self, log: bha.Log, start: float, *, from_first_pose: bool = False) -> float:
        """RMS distance of the last head from where it was measured, m, once ``start`` s of the log have passed.

        ``from_first_pose``: both heads shifted all along by what they are off in the first row.
        """
        time, features, heads = rows(log, self.pressures)
        error = (features - self.middle) / self.scale @ self.weights + self.offset - heads
        if from_first_pose:
            error -= error[0]
        late = time >= time[0] + start
        return float(np.sqrt(np.mean(np.sum(error[late, 3:] ** 2, axis=1))))


def fitted_ridge(logs: Sequence[bha.Log], pressures: PressureSort) -> Ridge:
    """Fitted to some logs, the penalty chosen among them."""
    tables = [rows(log, pressures)[1:] for log in logs]
    scores = []
    for penalty in PENALTIES:
        left = []
        for k in range(len(tables)):
            others = [t for j, t in enumerate(tables) if j != k] or tables
            model = _fit(others, penalty, pressures)
            features, heads = tables[k]
            error = (features - model.middle) / model.scale @ model.weights + model.offset - heads
            left.append(np.mean(np.sum(error[:, 3:] ** 2, axis=1)))
        scores.append(float(np.mean(left)))
    return _fit(tables, PENALTIES[int(np.argmin(scores))], pressures)


def rows(log: bha.Log, pressures: PressureSort) -> tuple[Array, Array, Array]:
    """Times (m,), features (m, f) and heads (m, 6) on an even grid."""
    time = np.arange(log.time[0], log.time[-1], INTERVAL)
    prefix = "p" if pressures == "measured" else "pc"
    raw = np.column_stack([np.interp(time, log.time, log[f"{prefix}{name}"]) for name in INPUTS])
    parts = [raw, *(_lagged(raw, lag) for lag in LAGS), *(_play(raw, width) for width in PLAYS)]
    first, second = np.triu_indices(raw.shape[1])
    parts.append(1e-5 * raw[:, first] * raw[:, second])
    heads = np.column_stack([np.interp(time, log.time, log[name]) for name in HEADS])
    return time, np.column_stack(parts), heads


def _fit(tables: Sequence[tuple[Array, Array]], penalty: float, pressures: PressureSort) -> Ridge:
    features = np.vstack([f for f, _ in tables])
    heads = np.vstack([h for _, h in tables])
    middle, scale = features.mean(axis=0), features.std(axis=0)
    scale[scale < 1e-9 * np.abs(middle).max()] = np.inf
    z, offset = (features - middle) / scale, heads.mean(axis=0)
    weights = np.linalg.solve(z.T @ z + penalty * len(z) * np.eye(z.shape[1]), z.T @ (heads - offset))
    return Ridge(pressures, middle, scale, weights, offset)


def _lagged(table: Array, lag: float) -> Array:
    keep = np.exp(-INTERVAL / lag)
    out = table.copy()
    for k in range(1, len(table)):
        out[k] = keep * out[k - 1] + (1.0 - keep) * table[k]
    return out


def _play(table: Array, width: float) -> Array:
    """The play operator: follows only once its input has moved by its width."""
    out = table.copy()
    for k in range(1, len(table)):
        out[k] = np.clip(out[k - 1], table[k] - width, table[k] + width)
    return out
