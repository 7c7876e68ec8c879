"""Property tests follow a fixed profile: the same examples everywhere, and no clock judges them.

``HYPOTHESIS_PROFILE=long`` tries many more examples, drawn anew each time.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import pytest
from hypothesis import settings

settings.register_profile("fixed", deadline=None, derandomize=True)
settings.register_profile("long", deadline=None, derandomize=False, max_examples=20_000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))


@pytest.fixture
def in_child() -> Callable[[Callable[[], bytes]], bytes]:
    """Does some work in a forked child and gives its result; a child that fails or hangs fails the test."""

    def call(work: Callable[[], bytes]) -> bytes:
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            status = 1
            try:
                os.write(writer, work())
                status = 0
            finally:
                os._exit(status)
        os.close(writer)
        for _ in range(300):
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                break
            time.sleep(0.1)
        else:
            os.kill(child, 9)
            os.waitpid(child, 0)
            pytest.fail("the child hangs")
        assert status == 0
        with os.fdopen(reader, "rb") as stream:
            return stream.read()

    return call
