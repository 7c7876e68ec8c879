"""A run in pieces, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arm import Arm
from bha.arrays import floats
from bha.errors import InputError, SimulationError
from bha.runs.formats import ARRAYS, OPTIONAL_ARRAYS
from bha.runs.input import Input
from bha.runs.options import Options
from bha.runs.trajectory import Trajectory

#: Rows between two reports of progress.
CHUNK_ROWS = 20_000


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
            drive.in_core(options.interpolation),
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
        rows, counts = self._core.advance(times), self._core.statistics
        before, self._counts = self._counts, (counts.steps, counts.rejected_steps, counts.evaluations)
        names = ("steps", "rejected_steps", "evaluations")
        trajectory = Trajectory(
            time=times[: len(rows.lengths)],
            lengths=rows.lengths,
            velocities=rows.velocities,
            pressures=rows.pressures,
            head_positions=rows.head_positions,
            head_orientations=rows.head_orientations,
            measured_lengths=rows.measured_lengths,
            measured_head_positions=rows.measured_head_positions,
            measured_head_orientations=rows.measured_head_orientations,
            input_names=self.arm.inputs,
            statistics={n: a - b for n, a, b in zip(names, self._counts, before, strict=True)},
            arm_name=self.arm.name,
            virtual_lengths=not self.arm.parameters.has_standard_bellows,
            sensors=self.arm.parameters.sensors,
        )
        if rows.failure is not None:
            rows.failure.trajectory = trajectory
            raise rows.failure
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
