"""Simulate an arm under measured or made-up pressures."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.arm import Arm
from bha.arrays import floats
from bha.errors import InputError, SimulationError
from bha.logs import Log
from bha.recordings import PressureSort, Recording
from bha.recordings.beginning import Beginning, begins
from bha.recordings.ranges import LengthExtremes
from bha.runs.input import Input
from bha.runs.options import Method, Options
from bha.runs.rows import check_room, given_times, output_times
from bha.runs.simulation import Simulation, concatenate
from bha.runs.trajectory import Trajectory


def row_size(arm: Arm) -> int:
    """Bytes that a row of a trajectory takes in memory, with what is computed on the way."""
    return 2 * 8 * (1 + 12 * arm.section_count + len(arm.inputs))


def simulate(
    arm: Arm,
    drive: Input | Log | Recording | str | os.PathLike[str] | Callable[[float], ArrayLike],
    *,
    t_end: float | None = None,
    dt: float | None = None,
    times: ArrayLike | None = None,
    q0: ArrayLike | None = None,
    qd0: ArrayLike | None = None,
    pressures: PressureSort | None = None,
    options: Options | None = None,
    method: Method | None = None,
    step: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate an arm, M q'' + C q' + N = tau (paper (48)).

    Args:
        arm: the arm.
        drive: an :class:`Input`, a measured :class:`bha.Log` (or the path of one) or :class:`bha.Recording` (pressures
            and external forces), or a function of time that returns the pressures (inputs,), Pa absolute; a function is
            sampled every ``dt`` (1 ms) beforehand.
        t_end: end, s; the last sample if None (needed for a function).
        dt: distance of the output rows, s. If None there is a row at each sample, and as many between samples further
            apart as make it 100 Hz.
        times: times of the output rows, s, ascending, in place of ``dt`` and ``t_end``; not before the first sample.
        q0: initial lengths (3n,), m; at rest under the first pressures if None: of a log that begins at rest an arm
            with the effect ``preload`` takes what held it there (:mod:`bha.recordings.beginning`).
        qd0: initial rates (3n,), m/s; zero if None.
        pressures: which pressures of a log drive the arm, ``"measured"`` or ``"commanded"``; if None measured ones
            where it has them.
        options: how to integrate; ``method`` and ``step`` override it.
        method: ``"auto"``, ``"dopri5"``, ``"rodas4"``, ``"rk4"`` or ``"ros2"``, see :class:`Options`.
        step: longest step of ``rk4`` and ``ros2``, s.
        progress: called with the fraction done.

    Returns:
        The trajectory, a row at each output time.

    Raises:
        InputError: an argument is not allowed.
        LogError: the log lacks a pressure of the arm.
        ConvergenceError: no rest to start from.
        SimulationError: the run diverged; ``error.trajectory`` holds the rows until then.

    Warns:
        LogWarning: the lengths leave the arm's ``length_range``.
    """
    options = options or Options()
    changes = {key: value for key, value in (("method", method), ("step", step)) if value is not None}
    if changes:
        options = Options(**{**options.__dict__, **changes})
    if times is None:
        arm, source = _begun(arm, drive, q0, t_end=t_end, dt=dt, pressures=pressures)
        rows = output_times(source, dt, t_end, row_bytes=row_size(arm))
    else:
        if dt is not None or t_end is not None:
            raise InputError("times: give them without dt and t_end, which they stand for")
        rows = given_times(times)
        arm, source = _begun(arm, drive, q0, t_end=float(rows[-1]) if len(rows) else None, pressures=pressures)
    run = Simulation(arm, source, options, q0=q0, qd0=qd0)
    pieces: list[Trajectory] = []
    try:
        for piece in run.run(rows):
            pieces.append(piece)
            if progress is not None:
                progress(sum(map(len, pieces)) / len(rows))
    except SimulationError as error:
        error.trajectory = concatenate(pieces)
        raise
    whole = concatenate(pieces)
    lengths = LengthExtremes(arm)
    lengths.add(whole.time, whole.lengths)
    lengths.warn(stacklevel=2)
    return whole


def beginning_of(
    arm: Arm,
    drive: Input | Log | Recording | str | os.PathLike[str] | Callable[[float], ArrayLike],
    **options: Any,
) -> Beginning:
    """How an arm begins that starts at rest: as a log tells, as it is under other inputs; see :func:`as_input`."""
    if isinstance(drive, Log | str | os.PathLike):
        drive = Recording(arm, drive, pressures=options.get("pressures"))
    if isinstance(drive, Recording):
        return begins(arm, drive)
    return Beginning(None, (), as_input(arm, drive, **options))


def _begun(
    arm: Arm,
    drive: Input | Log | Recording | str | os.PathLike[str] | Callable[[float], ArrayLike],
    q0: ArrayLike | None,
    **options: Any,
) -> tuple[Arm, Input]:
    """The arm as it stands where a log begins, and its input; as it is from a given pose."""
    if q0 is not None:
        return arm, as_input(arm, drive, **options)
    start = beginning_of(arm, drive, **options)
    return start.taken_by(arm), start.drive


def as_input(
    arm: Arm,
    drive: Input | Log | Recording | str | os.PathLike[str] | Callable[[float], ArrayLike],
    *,
    t_end: float | None = None,
    dt: float | None = None,
    pressures: PressureSort | None = None,
) -> Input:
    """``drive`` in any of the forms that :func:`simulate` takes, as an :class:`Input`.

    Raises:
        InputError: a function without ``t_end``, or something that is none of these forms.
        LogError: the log lacks a pressure of the arm.
    """
    if isinstance(drive, Input):
        return drive
    if isinstance(drive, Recording):
        return drive.drive
    if isinstance(drive, Log | str | os.PathLike):
        return Recording(arm, drive, pressures=pressures).drive
    if callable(drive):
        if t_end is None:
            raise InputError("t_end: an end time is needed where the pressures are a function of time")
        step = 1e-3 if dt is None else float(dt)
        if not (np.isfinite(t_end) and t_end >= 0 and np.isfinite(step) and step > 0):
            raise InputError(f"t_end: {t_end}, dt: {dt}; finite numbers of seconds, dt above 0, are needed")
        check_room(t_end / step, 64 * max(1, len(arm.inputs)), "samples of a function; a longer dt is needed.")
        time = np.arange(int(np.ceil(t_end / step)) + 1, dtype=np.float64) * step
        rows: Sequence[NDArray[np.float64]] = [floats(drive(float(t)), f"drive({t})", (len(arm.inputs),)) for t in time]
        return Input(time, np.vstack(rows))
    raise InputError(f"drive: {type(drive).__name__}; an Input, a Log, a Recording or a function of time is needed")
