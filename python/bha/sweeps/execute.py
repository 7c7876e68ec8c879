"""Running the missing partitions of a sweep on this computer, over threads."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotYet
from itertools import groupby
from typing import Any

from bha.errors import InputError
from bha.sweeps.group import groups, joined, run_group
from bha.sweeps.plan import Plan

#: Called with the number of runs that were simulated since the last call.
Tick = Callable[[int], None]
#: How long at most until Ctrl-C is noticed, s.
_PATIENCE = 0.2


class _StoppedError(Exception):
    """The work is not wanted any more."""


def on_this_computer(
    plan: Plan, wanted: Iterable[int], threads: int | None, tick: Tick
) -> Iterator[tuple[int, dict[str, Any]]]:
    """The tables of the partitions ``wanted``, in that order, over ``threads`` threads (all processors if None).

    One thread simulates one group of runs; the interpreter is free meanwhile. A few groups more than threads are under
    way, so that memory does not grow with the number of runs.

    Raises:
        InputError: ``threads`` is less than 1.
    """
    count = _processors() if threads is None else threads
    if count < 1:
        raise InputError(f"threads: {threads}; at least 1 is needed")
    stop = threading.Event()

    def watch(_: float) -> None:
        if stop.is_set():
            raise _StoppedError

    tasks = ((partition, group) for partition in wanted for group in groups(plan, partition))
    pool = ThreadPoolExecutor(count, thread_name_prefix="sweep")

    def results() -> Iterator[tuple[int, dict[str, Any]]]:
        pending: deque[tuple[int, Future[dict[str, Any]]]] = deque()
        for partition, group in tasks:
            pending.append((partition, pool.submit(run_group, plan, *group, watch)))
            if len(pending) >= 2 * count:
                first, future = pending.popleft()
                yield first, _result(future)
        for partition, future in pending:
            yield partition, _result(future)

    try:
        for partition, pieces in groupby(results(), key=lambda result: result[0]):
            tables = []
            for _, table in pieces:
                tick(len(table["run"]))
                tables.append(table)
            yield partition, joined(tables)
    finally:
        stop.set()
        pool.shutdown(cancel_futures=True)


def _result(future: Future[dict[str, Any]]) -> dict[str, Any]:
    # In short waits: some systems do not let Ctrl-C into a long one.
    while True:
        try:
            return future.result(timeout=_PATIENCE)
        except NotYet:
            if future.done():
                return future.result()


def _processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
