"""How far a fit is and how long it will take: by the work of its steps, at the speed they have had so far.

The work of a step is the time that its linearization simulates: sets of parameters and initial states, times seconds
of the windows. How many steps a stage takes is not known before; what is expected is what most fits take, and a step
more than that is always expected to be the last. The speed is that of the present stage, before its first step that of
the one before; before any step nothing is said.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

Progress = Callable[[str, float], None]

#: Steps that are expected of the first stage, of those between, and of the last one, which begins where the one before
#: ended.
FIRST, BETWEEN, LAST = 6, 4, 2


@dataclass
class Pace:
    """The pace of one fit.

    Attributes:
        tell: called with what is being done and the fraction done.
        work: of a step of each stage.
        after: work after the last stage, in steps of it.
        clock: seconds.
    """

    tell: Progress
    work: list[float]
    after: float
    clock: Callable[[], float] = time.perf_counter
    _began: float = field(init=False)
    _done: float = 0.0
    _entered: float = 0.0
    _speed: float | None = None

    def __post_init__(self) -> None:
        """Begin to count."""
        self._began = self.clock()

    def expected(self, stage: int) -> int:
        """Steps that are expected of a stage."""
        if stage == len(self.work) - 1 and stage > 0:
            return LAST
        return FIRST if stage == 0 else BETWEEN

    def step(self, text: str, stage: int, number: int) -> None:
        """Step ``number`` (from 0) of a stage begins."""
        now = self.clock()
        if number == 0:
            self._entered = now
        elif now > self._entered:
            self._speed = (now - self._entered) / (number * self.work[stage])
        left = self.left(stage, number)
        self._tell(text if left is None else f"{text}, {spoken_time(left)} left", left)

    def last(self, text: str) -> None:
        """What follows the last stage begins."""
        left = None if self._speed is None else self._speed * self.after * self.work[-1]
        self._tell(text if left is None else f"{text}, {spoken_time(left)} left", left)

    def note(self, text: str) -> None:
        """Something without steps is done."""
        self._tell(text, None)

    def finish(self) -> None:
        """All is done."""
        self.tell("done", 1.0)

    def left(self, stage: int, number: int) -> float | None:
        """Seconds that are left when a step begins; None before any is known."""
        if self._speed is None:
            return None
        work = max(self.expected(stage) - number, 1) * self.work[stage] + self.after * self.work[-1]
        work += sum(self.expected(k) * self.work[k] for k in range(stage + 1, len(self.work)))
        return self._speed * work

    def _tell(self, text: str, left: float | None) -> None:
        elapsed = self.clock() - self._began
        if left is not None and elapsed + left > 0.0:
            # A bar that runs back says less than one that waits.
            self._done = max(self._done, elapsed / (elapsed + left))
        self.tell(text, self._done)


def spoken_time(seconds: float) -> str:
    """``about 12 s``, ``about 3 min``; two digits would be a promise."""
    if seconds < 1.5:
        return "about 1 s"
    if seconds < 90.0:
        return f"about {seconds if seconds < 20.0 else 5.0 * round(seconds / 5.0):.0f} s"
    return f"about {seconds / 60.0:.0f} min"
