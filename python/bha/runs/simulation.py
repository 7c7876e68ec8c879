"""Simulate an arm under measured or made-up pressures."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arrays import floats
from bha.errors import InputError, SimulationError
from bha.logs import Log
from bha.recordings import PressureSort, Recording
from bha.recordings.ranges import LengthExtremes
from bha.runs.formats import ARRAYS, OPTIONAL_ARRAYS
from bha.runs.trajectory import Trajectory

if TYPE_CHECKING:
    from bha.arm import Arm

Method = Literal["auto", "dopri5", "rodas4", "rk4", "ros2"]
Interpolation = Literal["linear", "hold"]

#: The greatest number of steps that the core counts.
MOST_STEPS = 2**63 - 1

#: Rows between two reports of progress.
CHUNK_ROWS = 20_000

#: Longest distance of the rows that a simulation writes unasked, s: what shows the motion between sparse samples.
ROW_DISTANCE = 0.01


@dataclass(frozen=True)
class Input:
    """What drives an arm: pressures and, optionally, external forces, sampled at irregular times.

    Attributes:
        time: sample times, s, shape (m,), ascending; two equal times are a jump.
        pressures: Pa absolute, shape (m, inputs), in the order of ``arm.inputs``.
        forces: force at each section's centre of mass in the base frame, N, shape (m, n, 3), or None.
        commanded: whether the pressures are commands, which act through the arm's pneumatics; else they are those in
            the bellows and act as they are.
        interpolation: what holds between two samples, the straight line (``"linear"``) or the earlier one (``"hold"``).
    """

    time: NDArray[np.float64]
    pressures: NDArray[np.float64]
    forces: NDArray[np.float64] | None = None
    commanded: bool = True
    interpolation: Interpolation = "linear"

    def __post_init__(self) -> None:
        """Look at what holds between two samples; the core looks at the numbers."""
        if self.interpolation not in get_args(Interpolation):
            raise InputError(f'interpolation: {self.interpolation!r}; "linear" or "hold" are allowed')

    @property
    def force_rows(self) -> NDArray[np.float64] | None:
        """The forces with one row a sample, N, shape (m, 3n), or None."""
        return None if self.forces is None else np.reshape(self.forces, (len(self.time), -1))

    @classmethod
    def constant(cls, pressures: ArrayLike, duration: float) -> Input:
        """The same ``pressures`` (inputs,), Pa absolute, from 0 to ``duration`` s.

        Raises:
            InputError: a negative pressure.
        """
        row = floats(pressures, "pressures", (None,))
        # As the core says it of what is simulated, where it is written down.
        if (row < 0.0).any():
            k = int(np.argmax(row < 0.0))
            raise InputError(
                f"pressures: element {k} is {row[k]:g} Pa; pressures are absolute and not negative. Is this gauge "
                "pressure? Then add the ambient pressure"
            )
        return cls(np.array([0.0, duration]), np.vstack([row, row]))

    @classmethod
    def from_log(cls, arm: Arm, log: Log, *, pressures: PressureSort | None = None) -> Input:
        """What drives an arm in a measured log: ``drive`` of its :class:`bha.Recording`."""
        return Recording(arm, log, pressures=pressures).drive


@dataclass(frozen=True)
class Options:
    """How to integrate. What is not allowed raises an :class:`InputError` when the options are made.

    Attributes:
        method: ``"auto"``, which is ``"rodas4"`` for arms whose damping makes them stiff, ``"dopri5"`` for others; or
            one by name: ``"dopri5"``, adaptive Dormand-Prince 5(4); ``"rodas4"``, adaptive Rosenbrock 4(3), linearly
            implicit; ``"rk4"``, fixed step; ``"ros2"``, linearly implicit with fixed step.
        step: longest step of ``rk4`` and ``ros2``, s; steps end on every output and on every jump of the input.
        rtol: relative tolerance of adaptive methods.
        atol: absolute tolerance of adaptive methods, m and m/s; ``rodas4`` allows 100 times as much for rates.
        min_step: shortest step of adaptive methods, s; needing a shorter one is an error.
        max_step: longest step of adaptive methods, s.
        max_steps: most steps in all, at least 1; None is no limit.
        interpolation: what holds between two samples, in place of what the input says; as it says if None.
    """

    method: Method = "auto"
    step: float = 1e-3
    rtol: float = 1e-6
    atol: float = 1e-8
    min_step: float = 1e-10
    max_step: float = float("inf")
    max_steps: int | None = None
    interpolation: Interpolation | None = None

    def __post_init__(self) -> None:
        """Have the core look at all of them."""
        limits = (self.step, self.rtol, self.atol, self.min_step, self.max_step)
        try:
            _core.check_options(self.method, *limits, self.max_steps, self.interpolation)
        except OverflowError:
            raise InputError(f"max_steps: {self.max_steps}; allowed: 1 to {MOST_STEPS}, or none for no limit") from None
        except TypeError as error:
            raise InputError(f"options: {error}; see bha.Options for what is allowed") from None


class Simulation:
    """A run in pieces: :meth:`run` yields a :class:`Trajectory` of some rows at a time, in bounded memory."""

    def __init__(
        self,
        arm: Arm,
        drive: Input,
        options: Options | None = None,
        *,
        start: float | None = None,
        q0: ArrayLike | None = None,
        qd0: ArrayLike | None = None,
    ) -> None:
        """Prepare a run from ``start`` (the first sample) with lengths ``q0`` and rates ``qd0``.

        Without ``q0`` the arm starts at rest under the first pressures and forces (static coupled, paper (62)).

        Raises:
            InputError: an array of the wrong shape or with a value that is not finite, an option that is not allowed.
            ConvergenceError: no rest to start from.
        """
        options = options or Options()
        self.arm = arm
        self._core = _core.Simulation(
            arm if drive.commanded else arm.with_changes(pneumatics="ideal"),
            drive.time,
            drive.pressures,
            drive.force_rows,
            interpolation=options.interpolation or drive.interpolation,
            method=options.method,
            step=options.step,
            rtol=options.rtol,
            atol=options.atol,
            min_step=options.min_step,
            max_step=options.max_step,
            max_steps=options.max_steps,
            start=start,
            q=q0,
            qd=qd0,
        )
        self._counts = (0, 0, 0)

    @property
    def method(self) -> str:
        """The method in use, also where ``"auto"`` chose it."""
        return self._core.method

    def advance(self, times: ArrayLike) -> Trajectory:
        """Go on to the last of ``times`` (ascending) and return a row at each.

        Raises:
            SimulationError: the run could not go on; ``error.time`` says when, ``error.trajectory`` holds the rows
                until then.
        """
        times = floats(times, "times", (None,))
        arrays, failure = self._core.advance(times)
        before, self._counts = self._counts, self._core.statistics
        names = ("steps", "rejected_steps", "evaluations")
        trajectory = Trajectory(
            time=times[: len(arrays["lengths"])],
            **arrays,
            input_names=self.arm.inputs,
            statistics={n: a - b for n, a, b in zip(names, self._counts, before, strict=True)},
            arm_name=self.arm.name,
            virtual_lengths=not self.arm.parameters.has_standard_bellows,
            sensors=self.arm.parameters.sensors,
        )
        if failure is not None:
            failure.trajectory = trajectory
            raise failure
        return trajectory

    def run(self, times: NDArray[np.float64], chunk_rows: int = CHUNK_ROWS) -> Iterator[Trajectory]:
        """Rows at ``times``, ``chunk_rows`` at a time; of a chunk that fails the rows until then, then the error."""
        for first in range(0, len(times), chunk_rows):
            try:
                chunk = self.advance(times[first : first + chunk_rows])
            except SimulationError as error:
                yield error.trajectory
                raise
            yield chunk


def output_times(
    drive: Input, dt: float | None, t_end: float | None = None, *, row_bytes: int = 8
) -> NDArray[np.float64]:
    """Times of the output rows, from the first sample to ``t_end`` (the last).

    Every ``dt`` s; if None at the samples, with as many rows between two that are far apart as make it 100 Hz.

    Args:
        drive: the input.
        dt: distance of the rows, s, or None.
        t_end: end, s, or None.
        row_bytes: memory that a row will take.

    Raises:
        InputError: ``dt`` or ``t_end`` is not allowed, or the rows would not fit into memory.
    """
    time = floats(drive.time, "time", (None,))
    if len(time) == 0:
        raise InputError("the input has no samples; at least one is needed")
    if not np.isfinite(time).all():
        raise InputError("the input's times are not all finite numbers")
    start, end = float(time[0]), float(time[-1] if t_end is None else t_end)
    if not np.isfinite(end):
        raise InputError(f"t_end: {end}; a finite time is needed")
    if end < start:
        raise InputError(f"t_end: {end} s lies before the first sample at {start} s")
    if dt is None:
        kept = time[time <= end]
        kept = kept[np.concatenate([[True], np.diff(kept) != 0.0])]
        kept = kept if kept[-1] == end else np.append(kept, end)
        gaps = np.maximum(np.diff(kept), 0.0)
        pieces = np.maximum(np.ceil(gaps / ROW_DISTANCE * (1.0 - 1e-6)), 1.0)
        check_room(
            float(pieces.sum()) + 1.0,
            row_bytes,
            "rows at 100 Hz; is the time in another unit than seconds? Else give dt or times.",
        )
        return _divided(kept, pieces.astype(np.int64))
    if not np.isfinite(dt) or dt <= 0:
        raise InputError(f"dt: {dt}; a positive number of seconds is needed")
    rows = (end - start) / dt + 1.0
    check_room(rows, row_bytes, f"rows by dt = {dt:g} s; a longer one is needed.")
    return np.asarray(start + dt * np.arange(int(np.floor(rows + 1e-9))), dtype=np.float64)


def _divided(time: NDArray[np.float64], pieces: NDArray[np.int64]) -> NDArray[np.float64]:
    """``time`` with the way from each to the next one in so many equal ``pieces``."""
    if len(time) == 1 or pieces.max() == 1:
        return time
    first = np.repeat(np.arange(len(pieces)), pieces)
    within = np.arange(len(first)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    rows = time[first] + (time[first + 1] - time[first]) * (within / pieces[first])
    return np.append(rows, time[-1])


def check_room(count: float, size: int, what: str) -> None:
    """Refuse ``count`` pieces of ``size`` bytes that would fill more than half of this computer's memory.

    Raises:
        InputError: there are more of them than fit.
    """
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # a system that does not say
        memory = 8 << 30
    most = memory // 2 // size
    if not count <= most:
        raise InputError(f"{count:.3g} {what} At most {most:.3g} of them fit into half of this computer's memory")


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
        q0: initial lengths (3n,), m; at rest under the first pressures if None.
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
        source = as_input(arm, drive, t_end=t_end, dt=dt, pressures=pressures)
        rows = output_times(source, dt, t_end, row_bytes=row_size(arm))
    else:
        if dt is not None or t_end is not None:
            raise InputError("times: give them without dt and t_end, which they stand for")
        rows = given_times(times)
        source = as_input(arm, drive, t_end=float(rows[-1]) if len(rows) else None, pressures=pressures)
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


def given_times(times: ArrayLike) -> NDArray[np.float64]:
    """Times of rows that a caller gave, s, shape (rows,), ascending.

    Raises:
        InputError: another shape, no row, a time that is not finite, times that do not ascend.
    """
    try:
        rows = np.array(times, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"times: numbers of seconds are needed; {error}") from None
    if rows.ndim != 1 or len(rows) == 0:
        raise InputError(f"times: shape {rows.shape}; one row at least and one dimension are needed")
    if not np.isfinite(rows).all():
        raise InputError(f"times: element {int(np.argmin(np.isfinite(rows)))} is not a finite number")
    if (np.diff(rows) < 0).any():
        k = int(np.argmax(np.diff(rows) < 0)) + 1
        raise InputError(f"times: they must ascend; element {k} is {rows[k]} s after {rows[k - 1]} s")
    return rows


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


def concatenate(pieces: Sequence[Trajectory]) -> Trajectory:
    """Pieces of one run, one after the other."""
    if not pieces:
        raise InputError("there is nothing to put together")
    if len(pieces) == 1:
        return pieces[0]
    first = pieces[0]
    arrays: dict[str, Any] = {}
    for name in (*ARRAYS, *OPTIONAL_ARRAYS):
        # A piece without rows has no measured values either.
        found = [array for piece in pieces if (array := getattr(piece, name)) is not None]
        if found:
            arrays[name] = np.concatenate(found)
    statistics = {key: sum(p.statistics[key] for p in pieces) for key in first.statistics}
    return replace(first, **arrays, statistics=statistics)
