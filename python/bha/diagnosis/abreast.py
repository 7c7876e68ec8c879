"""Refits that do not depend on each other, on several threads.

What: a refit is a chain of simulations of a few runs each, which fills one core; the core's interpreter lock is free
while it simulates. What each gives does not depend on how many go abreast.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import TypeVar

from bha.diagnosis.fit import Problem

Item = TypeVar("Item")
Result = TypeVar("Result")


def abreast(
    problem: Problem, work: Callable[[Item], Result], items: Sequence[Item], tell: Callable[[int], None]
) -> list[Result]:
    """``work`` of each item, as many at once as the problem's simulations may have threads.

    Args:
        problem: the logs; its fits end where it is told to stop.
        work: what is done; calls of it share nothing that they change.
        items: what with.
        tell: called with the number of each item when its turn comes, in this thread.

    Returns:
        The results in the order of the items.
    """
    threads = min(problem.model.integration.threads or os.cpu_count() or 1, len(items))
    if threads < 2:
        found = []
        for k, item in enumerate(items):
            tell(k)
            found.append(work(item))
        return found
    futures: list[Future[Result]] = []
    with _stopping(problem), ThreadPoolExecutor(threads) as pool:
        try:
            for k, item in enumerate(items):
                tell(k)
                futures.append(pool.submit(work, item))
                _watch(futures, threads - 1)
            _watch(futures, 0)
            return [future.result() for future in futures]
        except BaseException:
            # The others end at their next step.
            problem.stop.set()
            raise


def _watch(futures: Sequence[Future[Result]], most: int) -> None:
    """Wait until at most so many are not done; what one of the others has raised is raised here."""
    while True:
        for future in futures:
            if future.done():
                future.result()
        running = [future for future in futures if not future.done()]
        if len(running) <= most:
            return
        wait(running, return_when=FIRST_COMPLETED)


@contextmanager
def _stopping(problem: Problem) -> Iterator[None]:
    """After which fits of the problem go on again."""
    try:
        yield
    finally:
        problem.stop.clear()
