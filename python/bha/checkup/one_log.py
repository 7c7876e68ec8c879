"""Each of several logs judged alone: one whose tubes were exchanged may cancel out in the sum over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bha.checkup.explain import ALIKE, Verdict, judge
from bha.checkup.layout import Layout
from bha.checkup.seen import Seen
from bha.checkup.wiring import Evidence, as_filed, evidence, score

#: Against what all logs say together a log alone must leave so many times less unexplained (logarithm), and a turn be
#: so large, deg: short logs tell little of a direction.
LEAST_GAIN, LEAST_TURN_ALONE = 2.2, 30.0


@dataclass(frozen=True)
class OneLog:
    """What one of several logs tells alone.

    Attributes:
        number: of the log, from 0.
        name: of the log.
        found: what its motions follow.
        verdict: what explains them.
    """

    number: int
    name: str
    found: Evidence
    verdict: Verdict

    @property
    def is_sure(self) -> bool:
        """Whether it is at fault beyond what a short log can make up."""
        if not self.verdict.causes or self.verdict.gain < LEAST_GAIN:
            return False
        return all(
            cause.kind not in ("azimuth", "camera")
            or cause.mirrored
            or max(abs(np.degrees(turn)) for turn in cause.turns) >= LEAST_TURN_ALONE
            for cause in self.verdict.causes
        )

    def fits_better_as_filed(self, pooled: Verdict) -> bool:
        """Whether this log speaks against what explains all logs together."""
        if self.verdict.causes or not pooled.causes:
            return False
        filed = as_filed(self.found.layout)
        return score(self.found, filed) + ALIKE < score(self.found, pooled.causes[0].assignment)


def logs_apart(layout: Layout, logs: Sequence[Seen], pooled: Verdict) -> list[OneLog]:
    """The logs that are at fault alone; none where all logs together say it, or there is one log only."""
    if len(logs) < 2:
        return []
    alone = []
    for number, log in enumerate(logs):
        found = evidence(layout, [log])
        alone.append(OneLog(number, log.name, found, judge(found)))
    if pooled.causes and not any(one.fits_better_as_filed(pooled) for one in alone):
        return []
    return [one for one in alone if one.is_sure]
