"""What errors may follow: what was logged and its past, also through the motions in which the arm itself swings.

What: errors, and banks of regressors beside them, as means over cells of time. Physics that a model lacks is a function
of pressures, pose, rates, their past and of time, which an arm near a pose answers to as it does to any force: in its
modes. So that a bank holds, to first order, whatever one sort of physics leaves:

| bank | holds |
|---|---|
| pose | outputs, pressures, and their squares: springs, areas, offsets, gains |
| past | pressures and their squares behind lags: creep, lags |
| rates | signs, sizes and squares of rates and outputs behind lags: friction, damping, hysteresis |
| time | time, and its product with outputs and pressures: drift |
| swings | pressures through the arm's modes: lag, delay, inertia, what acts on some pressures only |
| rubbing | signs and sizes of rates through the arm's modes: the same of an arm that swings |

Limits: one pose stands for all in the modes; products of two outputs are in no bank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bha.arm.derivatives import linearized
from bha.diagnosis.fit import Fit
from bha.estimation.initial import guess_state
from bha.estimation.records import Record
from bha.estimation.slow import cell_means, lag_response

Array = NDArray[np.float64]
Modes = NDArray[np.complex128]

#: Length of a cell, s: it holds what changes with up to 4 Hz.
CELL = 0.125
#: Fewest cells of a log.
FEWEST_CELLS = 16
#: Least share of a log's cells and channels that are known; others are filled by straight lines.
LEAST_KNOWN = 0.5
#: Lags of pressures, and of what follows rates, s.
PRESSURE_LAGS, RATE_LAGS = (0.0, 0.15, 0.6, 2.5), (0.0, 0.15, 0.6)
#: Rate, over the RMS of all rates, about which its sign changes.
SIGN = 0.3
#: Slowest decay that a mode is taken to have, 1/s.
SLOWEST = 0.05


@dataclass(frozen=True)
class Cells:
    """Errors of a log and what they may follow, as means over g cells, each about its mean in the log.

    Attributes:
        errors: m, shape (g, C).
        banks: name -> regressors, shape (g, F).
        step: length of a cell, s.
        slopes: how what the model shows changes with its coordinates, shape (g, C, K), if asked for.
    """

    errors: Array
    banks: dict[str, Array]
    step: float
    slopes: Array | None = None


def modes_of(fit: Fit) -> Modes:
    """Eigenvalues of the plain model near the pose in the middle of its first log, 1/s; one of each conjugate pair."""
    record, outputs = fit.model.records[0], fit.outputs[0]
    arm, observation = fit.model.shown(fit.x, 0)
    assert arm is not None
    row = int(np.argmin(np.sum((outputs - outputs.mean(axis=0)) ** 2, axis=1)))
    lengths = guess_state(arm, fit.model.parameters, observation, record, row)[: 3 * fit.model.sections]
    drive, time = record.drive, record.time[row]
    pressures = np.array([np.interp(time, drive.time, p) for p in drive.pressures.T])
    state, _ = linearized(arm, lengths, np.zeros_like(lengths), pressures)
    values = np.linalg.eigvals(state)
    return np.asarray(values[values.imag >= 0.0], dtype=np.complex128)


def cells_of(record: Record, outputs: Array, modes: Modes, slopes: Array | None = None) -> Cells | None:
    """Cells of a log, of what a model shows of it, (rows, C), and how that changes with its coordinates, (rows, C, K).

    None for a few cells, or none that count.
    """
    time = record.time
    count = int((time[-1] - time[0]) / max(CELL, 2.0 * record.sample_time))
    if count < FEWEST_CELLS:
        return None
    step = float(time[-1] - time[0]) / count
    errors = cell_means(time, np.where(record.usable, record.measured - outputs, np.nan), step, count)
    y = _standard(_filled(cell_means(time, outputs, step, count)), 1e-12)
    p = _standard(_filled(cell_means(time, record.drive.pressures[record.rows], step, count)), 1.0)
    rates = np.gradient(y, step, axis=0)
    signs = np.tanh(rates / np.maximum(SIGN * rates.std(axis=0), 1e-12))
    sizes = np.abs(rates)
    passed = np.linspace(-1.0, 1.0, count)[:, None]
    bent = np.column_stack([y**2, signs, sizes])
    rubbing = np.column_stack([signs, sizes])
    banks = {
        "pose": [y, y**2, p, p**2],
        "past": [y, rates, *(lag_response(lag, step, values) for lag in PRESSURE_LAGS for values in (p, p**2))],
        "rates": [y, rates, *(lag_response(lag, step, bent) for lag in RATE_LAGS)],
        "time": [y, passed, passed * y, passed * p],
        "swings": [p, *(mode_response(mode, step, p) for mode in modes.tolist())],
        "rubbing": [rates, *(mode_response(mode, step, rubbing) for mode in modes.tolist())],
    }
    known = np.isfinite(errors)
    if np.min(known.sum(axis=0)) < FEWEST_CELLS or np.mean(known) < LEAST_KNOWN:
        return None
    regressors = {name: np.column_stack(parts) for name, parts in banks.items()}
    # Cells left at zero would show in errors and regressors alike, and draws have none.
    told = None
    if slopes is not None:
        flat = _filled(cell_means(time, slopes.reshape(len(slopes), -1), step, count))
        told = _about_mean(flat).reshape(count, *slopes.shape[1:])
    tables = {name: _about_mean(table) for name, table in regressors.items()}
    return Cells(_about_mean(_filled(errors)), tables, step, told)


def mode_response(mode: complex, step: float, values: Array) -> Array:
    """What follows ``values`` (g, J) on an even grid as a mode of an arm does, shape (g, J) or, if it swings, (g, 2J).

    z' = mode z + values, at rest at the first of them, exact for values that go straight from one to the next; times
    the size of ``mode``, so that slow and fast modes are alike in size.
    """
    mode = complex(min(mode.real, -SLOWEST), mode.imag)
    kept = np.exp(mode * step)
    whole, rising = (kept - 1.0) / mode, (kept - 1.0 - mode * step) / (mode**2 * step)
    change = values - values[0]
    driven = (whole - rising) * change[:-1] + rising * change[1:]
    z = lfilter([1.0], [1.0, -kept], driven, axis=0) * abs(mode)
    z = np.concatenate([np.zeros((1, values.shape[1])), z])
    return np.asarray(np.hstack([z.real, z.imag]) if mode.imag > 0.0 else z.real)


def _filled(table: Array) -> Array:
    """The columns with cells of which nothing is known filled by straight lines between the others."""
    cells, known = np.arange(len(table)), np.isfinite(table)
    columns = zip(table.T, known.T, strict=True)
    return np.column_stack([np.interp(cells, cells[good], column[good]) for column, good in columns])


def _about_mean(table: Array) -> Array:
    return np.asarray(table - table.mean(axis=0))


def _standard(table: Array, least: float) -> Array:
    """The columns about their means over their standard deviations."""
    return np.asarray((table - table.mean(axis=0)) / np.maximum(table.std(axis=0), least))
