"""What is free of an arm when nobody says: the arm that an identification begins with, and its free parameters.

One function for `bha identify` and for the plain model of a diagnosis, which both start from a file that knows some
numbers well, others by a tape measure and some not at all: springs that curve (:mod:`bha.estimation.scale`), what lies
between commands and chambers (:mod:`bha.estimation.lags`), and what first poses tell of an arm that stands elsewhere
after each use, which is then not free (:mod:`bha.estimation.preload`).
"""

from __future__ import annotations

from collections.abc import Sequence

from bha.arm import Arm
from bha.estimation.asked import holds_off, stands_elsewhere
from bha.estimation.free import FreeParameter
from bha.estimation.lags import with_lag
from bha.estimation.records import Record
from bha.estimation.scale import default_free_of, with_curved_springs
from bha.recordings.beginning import preloaded


def by_default(arm: Arm, records: Sequence[Record]) -> tuple[Arm, tuple[FreeParameter, ...]]:
    """The arm of a file as an identification of these records begins with it, and what is free of it.

    Springs of one number are curved, but where the logs show a memory: what an arm remembers would become curves.
    Under commands it has a lag of two stages and a dead time.
    """
    held_off = bool(preloaded(arm.parameters))
    if not (held_off or stands_elsewhere(records)):
        arm = with_curved_springs(arm)
    arm, lags = with_lag(arm, records, second=True)
    free = (*default_free_of(arm.parameters, records), *lags)
    return arm, tuple(f for f in free if not (held_off and holds_off(f.path)))
