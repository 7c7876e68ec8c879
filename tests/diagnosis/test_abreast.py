"""Refits on several threads."""

from threading import Barrier, Event, get_ident
from types import SimpleNamespace
from typing import Any

import pytest

from bha.diagnosis.abreast import abreast


def problem(threads: int) -> Any:
    return SimpleNamespace(model=SimpleNamespace(integration=SimpleNamespace(threads=threads)), stop=Event())


def test_as_many_go_abreast_as_there_are_threads_and_results_keep_their_order() -> None:
    both, told = Barrier(2, timeout=10.0), []

    def work(number: int) -> int:
        both.wait()  # passes only where two are here at once
        return number**2

    assert abreast(problem(2), work, range(4), told.append) == [0, 1, 4, 9]
    assert told == [0, 1, 2, 3]


def test_with_one_thread_all_is_done_in_this_one() -> None:
    assert abreast(problem(1), lambda number: get_ident(), range(3), lambda k: None) == [get_ident()] * 3


@pytest.mark.parametrize("interrupted", [KeyboardInterrupt, ZeroDivisionError])
def test_where_one_is_interrupted_the_others_are_told_to_stop(interrupted: type[BaseException]) -> None:
    own = problem(2)
    ended = []

    def work(number: int) -> None:
        if number == 1:
            raise interrupted
        ended.append(own.stop.wait(10.0))

    with pytest.raises(interrupted):
        abreast(own, work, range(2), lambda k: None)
    assert ended == [True]
    assert not own.stop.is_set()
