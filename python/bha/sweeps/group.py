"""Some runs simulated and reduced to their rows of the table: a pure function of the plan and the runs' numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import BhaError, ConvergenceError, SimulationError
from bha.runs.input import Input
from bha.simulation.batch import Batch, simulate_batch
from bha.sweeps.members import NOT_ALLOWED, Member, deviations, member
from bha.sweeps.metrics import METRICS, Runs, evaluate
from bha.sweeps.plan import Plan

Array = NDArray[np.float64]
#: Called about 20 times a second; what it raises ends the work.
Watch = Callable[[float], None]

#: What became of a run: simulated; diverged or out of steps; without a rest to start from; a draw that is not allowed.
STATUSES = ("ok", "diverged", "no_rest", "not_allowed")


def columns(plan: Plan) -> dict[str, tuple[type, str, str]]:
    """The table's columns: name to type, unit and meaning."""
    table: dict[str, tuple[type, str, str]] = {"run": (int, "", "number of the run, from 0")}
    for variable, target in zip(plan.variables, plan.targets, strict=True):
        meaning = "log that drives the run" if variable.is_text else "what was drawn"
        table[variable.what] = (str if variable.is_text else float, target.unit(variable.what), meaning)
    for name in plan.spec.metrics:
        table[name] = (float, METRICS[name].unit, METRICS[name].meaning)
    table["status"] = (str, "", "one of " + ", ".join(STATUSES))
    table["reason"] = (str, "", "why, where status is not ok")
    table["failure_time"] = (float, "s", "last good time of a run that diverged, from its start")
    return table


def run_group(plan: Plan, first: int, count: int, watch: Watch | None = None) -> dict[str, Any]:
    """Simulate ``count`` runs from ``first`` on, one thread, and return their columns.

    Nothing but the plan and the runs' numbers decides what comes out, to the last digit, as long as ``first`` is a
    multiple of ``plan.group`` and ``count`` that number or what is left of the sweep.
    """
    draws = plan.draws(first, count)
    outcome = _Outcome(plan, count)
    members = outcome.attempt(range(count), lambda k: member(plan, draws[k]))
    states = _initial_states(plan, members, deviations(plan, draws), outcome, watch)
    members = {k: m for k, m in members.items() if outcome.errors[k] is None}
    if members:
        chosen = list(members)
        times = [plan.times[m.log] for m in members.values()]
        x0 = None if states is None else states[chosen]
        batch = _simulate(plan, list(members.values()), [m.drive for m in members.values()], times, x0, watch)
        outcome.take(chosen, list(members.values()), batch, times)
    return outcome.table(first, draws)


def run_partition(plan: Plan, partition: int, watch: Watch | None = None) -> dict[str, Any]:
    """All columns of a partition, group by group."""
    return joined([run_group(plan, *group, watch) for group in groups(plan, partition)])


def groups(plan: Plan, partition: int) -> list[tuple[int, int]]:
    """First run and number of runs of each group of a partition."""
    runs = plan.runs_of(partition)
    return [(first, min(plan.group, runs.stop - first)) for first in range(runs.start, runs.stop, plan.group)]


def joined(pieces: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Tables one after the other."""
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def _initial_states(
    plan: Plan, members: Mapping[int, Member], added: Array | None, outcome: _Outcome, watch: Watch | None
) -> Array | None:
    """Lengths and rates to start from, shape (count, 6n); None where each starts at rest under its own input."""
    if added is None and all(m.rest is m.drive for m in members.values()):
        return None
    columns = 3 * plan.arm.section_count
    states = np.zeros((len(outcome.errors), 2 * columns))
    if plan.spec.initial.lengths is not None:
        states[:, :columns] = plan.spec.initial.lengths
    elif members:
        chosen = list(members)
        rests = [m.rest for m in members.values() if m.rest is not None]
        starts = [rest.time[:1] for rest in rests]
        batch = _simulate(plan, list(members.values()), rests, starts, None, watch)
        states[chosen, :columns] = batch.lengths[:, 0]
        for k, failure in zip(chosen, batch.failures, strict=True):
            outcome.errors[k] = failure
    return states if added is None else states + added


def _simulate(
    plan: Plan,
    members: Sequence[Member],
    drives: Sequence[Input],
    times: Sequence[Array],
    x0: Array | None,
    watch: Watch | None,
) -> Batch:
    how = plan.spec.simulation
    rows = max(len(row) for row in times)
    padded = np.full((len(times), rows), np.nan)
    for k, row in enumerate(times):
        padded[k, : len(row)] = row
    return simulate_batch(
        [m.arm for m in members],
        list(drives),
        x0,
        times=padded,
        method=how.method,
        step=how.step,
        rtol=how.rtol,
        atol=how.atol,
        max_steps=how.max_steps,
        interpolation=how.interpolation,
        head_positions=True,
        threads=1,
        instruction_set=plan.instruction_set,
        progress=watch,
        warn=False,
    )


class _Outcome:
    """What became of the runs of a group, filled in as they go."""

    def __init__(self, plan: Plan, count: int) -> None:
        self.plan = plan
        self.errors: list[BhaError | None] = [None] * count
        self.starts = np.zeros(count)
        self.metrics = {name: np.full(count, np.nan) for name in plan.spec.metrics}

    def attempt(self, numbers: range, build: Callable[[int], Member]) -> dict[int, Member]:
        """What could be built, by number; the errors of the others are kept."""
        built: dict[int, Member] = {}
        for k in numbers:
            try:
                built[k] = build(k)
                self.starts[k] = built[k].drive.time[0]
            except NOT_ALLOWED as error:
                self.errors[k] = error
        return built

    def take(self, chosen: Sequence[int], members: Sequence[Member], batch: Batch, times: Sequence[Array]) -> None:
        """Reduce a batch to its metrics; ``chosen`` are the numbers of its members."""
        for k, failure in zip(chosen, batch.failures, strict=True):
            self.errors[k] = failure
        good = [k for k, failure in enumerate(batch.failures) if failure is None]
        if not good:
            return
        assert batch.velocities is not None
        assert batch.head_positions is not None
        runs = Runs(
            time=(batch.time - batch.time[:, :1])[good],
            lengths=batch.lengths[good],
            velocities=batch.velocities[good],
            tip=batch.head_positions[good, :, -1],
            last=np.array([len(times[k]) - 1 for k in good]),
            arms=[members[k].arm for k in good],
            settling_band=self.plan.spec.settling_band,
        )
        places = np.asarray(chosen)[good]
        for name, values in evaluate(self.plan.spec.metrics, runs).items():
            self.metrics[name][places] = values

    def table(self, first: int, draws: Array) -> dict[str, Any]:
        """The columns of :func:`columns`."""
        count = len(self.errors)
        table: dict[str, Any] = {"run": np.arange(first, first + count, dtype=np.int64)}
        for column, variable in enumerate(self.plan.variables):
            values = draws[:, column]
            if variable.is_text:
                table[variable.what] = np.array([self.plan.input_names[int(x)] for x in values], dtype=object)
            else:
                table[variable.what] = values.copy()
        table |= self.metrics
        table["status"] = np.array([_status(error) for error in self.errors], dtype=object)
        table["reason"] = np.array([None if error is None else str(error) for error in self.errors], dtype=object)
        table["failure_time"] = np.array(
            [
                error.time - start if isinstance(error, SimulationError) else np.nan
                for error, start in zip(self.errors, self.starts, strict=True)
            ]
        )
        return table


def _status(error: BhaError | None) -> str:
    match error:
        case None:
            return "ok"
        case SimulationError():
            return "diverged"
        case ConvergenceError():
            return "no_rest"
        case _:
            return "not_allowed"
