"""Simulate an arm under measured or made-up pressures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arrays import floats
from bha.errors import InputError, SimulationError
from bha.log import Log
from bha.recordings import PressureSort, Recording
from bha.trajectory import Trajectory
from bha.trajectory_formats import ARRAYS, OPTIONAL_ARRAYS

if TYPE_CHECKING:
    from bha.arm import Arm

Method = Literal["dopri5", "rk4", "ros2"]
Interpolation = Literal["linear", "hold"]

#: Rows between two reports of progress.
CHUNK_ROWS = 20_000


@dataclass(frozen=True)
class Input:
    """What drives an arm: pressures and, optionally, external forces, sampled at irregular times.

    Attributes:
        time: sample times, s, shape (m,), ascending; two equal times are a jump.
        pressures: Pa absolute, shape (m, inputs), in the order of ``arm.inputs``.
        forces: force at each section's centre of mass in the base frame, N, shape (m, n, 3), or None.
        commanded: whether the pressures are commands, which act through the arm's pneumatics; else they are those in
            the bellows and act as they are.
    """

    time: NDArray[np.float64]
    pressures: NDArray[np.float64]
    forces: NDArray[np.float64] | None = None
    commanded: bool = True

    @property
    def force_rows(self) -> NDArray[np.float64] | None:
        """The forces with one row a sample, N, shape (m, 3n), or None."""
        return None if self.forces is None else np.reshape(self.forces, (len(self.time), -1))

    @classmethod
    def constant(cls, pressures: ArrayLike, duration: float) -> Input:
        """The same ``pressures`` (inputs,), Pa absolute, from 0 to ``duration`` s."""
        row = floats(pressures, "pressures", (None,))
        return cls(np.array([0.0, duration]), np.vstack([row, row]))

    @classmethod
    def from_log(cls, arm: Arm, log: Log, *, pressures: PressureSort | None = None) -> Input:
        """What drives an arm in a measured log: ``drive`` of its :class:`bha.Recording`."""
        return Recording(arm, log, pressures=pressures).drive


@dataclass(frozen=True)
class Options:
    """How to integrate.

    Attributes:
        method: ``"dopri5"``, adaptive Dormand-Prince 5(4) with dense output, or ``"rk4"``, fixed step, or ``"ros2"``,
            linearly implicit with fixed step, for arms whose damping makes them stiff.
        step: longest step of ``rk4`` and ``ros2``, s; steps end on every output and on every jump of the input.
        rtol: relative tolerance of ``dopri5``.
        atol: absolute tolerance of ``dopri5``, m and m/s.
        min_step: shortest step of ``dopri5``, s; needing a shorter one is an error.
        max_step: longest step of ``dopri5``, s.
        max_steps: most steps in all; None is no limit.
        interpolation: what holds between two samples, the straight line or the earlier one.
    """

    method: Method = "dopri5"
    step: float = 1e-3
    rtol: float = 1e-6
    atol: float = 1e-8
    min_step: float = 1e-10
    max_step: float = float("inf")
    max_steps: int | None = None
    interpolation: Interpolation = "linear"


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
            interpolation=options.interpolation,
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


def output_times(drive: Input, dt: float | None, t_end: float | None = None) -> NDArray[np.float64]:
    """Times of the output rows: the samples' own, or every ``dt`` s, from the first sample to ``t_end`` (the last).

    Raises:
        InputError: ``dt`` or ``t_end`` is not allowed.
    """
    time = floats(drive.time, "time", (None,))
    if len(time) == 0:
        raise InputError("the input has no samples; at least one is needed")
    end = float(time[-1]) if t_end is None else float(t_end)
    if not np.isfinite(end) or end < time[0]:
        raise InputError(f"t_end: {end} s lies before the first sample at {time[0]} s")
    if dt is None:
        kept = time[time <= end]
        return kept if kept[-1] == end else np.append(kept, end)
    if not np.isfinite(dt) or dt <= 0:
        raise InputError(f"dt: {dt}; a positive number of seconds is needed")
    count = int(np.floor((end - time[0]) / dt + 1e-9)) + 1
    return np.asarray(time[0] + dt * np.arange(count), dtype=np.float64)


def simulate(
    arm: Arm,
    drive: Input | Log | Recording | Callable[[float], ArrayLike],
    *,
    t_end: float | None = None,
    dt: float | None = None,
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
        drive: an :class:`Input`, a measured :class:`bha.Log` or :class:`bha.Recording` (pressures and external forces),
            or a function of time that returns the pressures (inputs,), Pa absolute; a function is sampled every ``dt``
            (1 ms) beforehand.
        t_end: end, s; the last sample if None (needed for a function).
        dt: distance of the output rows, s; the samples' own times if None.
        q0: initial lengths (3n,), m; at rest under the first pressures if None.
        qd0: initial rates (3n,), m/s; zero if None.
        pressures: which pressures of a log drive the arm, ``"measured"`` or ``"commanded"``; if None measured ones
            where it has them.
        options: how to integrate; ``method`` and ``step`` override it.
        method: ``"dopri5"``, ``"rk4"`` or ``"ros2"``.
        step: step of ``rk4``, s.
        progress: called with the fraction done.

    Returns:
        The trajectory, a row at each output time.

    Raises:
        InputError: an argument is not allowed.
        LogError: the log lacks a pressure of the arm.
        ConvergenceError: no rest to start from.
        SimulationError: the run diverged; ``error.trajectory`` holds the rows until then.
    """
    options = options or Options()
    changes = {key: value for key, value in (("method", method), ("step", step)) if value is not None}
    if changes:
        options = Options(**{**options.__dict__, **changes})
    source = as_input(arm, drive, t_end=t_end, dt=dt, pressures=pressures)
    times = output_times(source, dt, t_end)
    run = Simulation(arm, source, options, q0=q0, qd0=qd0)
    pieces: list[Trajectory] = []
    try:
        for piece in run.run(times):
            pieces.append(piece)
            if progress is not None:
                progress(sum(map(len, pieces)) / len(times))
    except SimulationError as error:
        error.trajectory = concatenate(pieces)
        raise
    return concatenate(pieces)


def as_input(
    arm: Arm,
    drive: Input | Log | Recording | Callable[[float], ArrayLike],
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
    if isinstance(drive, Log):
        return Input.from_log(arm, drive, pressures=pressures)
    if callable(drive):
        if t_end is None:
            raise InputError("t_end: an end time is needed where the pressures are a function of time")
        time = np.arange(int(np.ceil(t_end / (dt or 1e-3))) + 1, dtype=np.float64) * (dt or 1e-3)
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
