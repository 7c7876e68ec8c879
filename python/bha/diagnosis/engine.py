"""Runs of a diagnosis with one step, repeated with finer ones where one of them diverges."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bha.estimation.runs import Run, outputs
from bha.runs.options import Method

Array = NDArray[np.float64]

#: Shares of the step that are tried in turn where a run diverges: the step was chosen for the nominal arm, and an
#: effect (quadratic damping, a wall) may make a stiffer one of it.
STEP_SHARES = (1.0, 0.5, 0.25)


class Engine:
    """Runs over threads with one fixed step; one that diverges gives NaN from there on.

    Where one of the runs of a log diverges, all of them are repeated with finer steps: their differences only mean
    something at the same step.
    """

    def __init__(
        self,
        step: float,
        threads: int | None = None,
        coarse: float | None = None,
        tick: Callable[[int], None] | None = None,
        method: Method = "rk4",
        shares: Sequence[float] = STEP_SHARES,
    ) -> None:
        """An engine.

        Args:
            step: step of the integration, s.
            threads: number of threads; all cores if None.
            coarse: step where only differences between runs are wanted, s: their errors cancel to first order.
            tick: told of the number of finished runs.
            method: of integration; the linearly implicit ``ros2`` for stiff arms.
            shares: shares of the step that are tried in turn where a run diverges.
        """
        self.step = step
        self.coarse = coarse or step
        self.threads = threads
        self.method: Method = method
        self.shares = tuple(shares)
        self._tick = tick

    def with_step(self, step: float, coarse: float | None = None) -> Engine:
        """An engine like this one with other steps, s."""
        return Engine(step, self.threads, coarse, self._tick, self.method, self.shares)

    def once(self) -> Engine:
        """An engine like this one that leaves a run that diverges as it is."""
        return Engine(self.step, self.threads, self.coarse, self._tick, self.method, (1.0,))

    def run(self, runs: Sequence[Run], *, coarse: bool = False, finer: int = 1) -> list[Array]:
        """Outputs of every run, shape (rows, channels), m; with the step divided by ``finer``."""
        step = (self.coarse if coarse else self.step) / finer
        groups: dict[tuple[int, int, int, float], list[int]] = {}
        for k, run in enumerate(runs):
            groups.setdefault(run.stretch, []).append(k)
        results: list[Array] = [np.empty(0)] * len(runs)
        for members in groups.values():
            alive = [k for k in members if runs[k].possible]
            for share in self.shares:
                found = outputs([runs[k] for k in members], share * step, method=self.method, threads=self.threads)
                for k, y in zip(members, found, strict=True):
                    results[k] = y
                if all(np.all(np.isfinite(results[k][-1])) for k in alive):
                    break
            if self._tick is not None:
                self._tick(len(members))
        return results
