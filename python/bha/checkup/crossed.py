"""Length sensors exchanged that no turn or mirror image describes: of two sections, or wires at odd angles of one.

A pair of two sections mixes their motions, and wires that are not spread evenly show another bending each: the columns
are exchanged back, the motions formed anew, and what the file leaves unexplained of them is compared.
Decision: as for other exchanges, with a larger gain: many pairs are tried, and the best of many is easily good.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bha.checkup.causes import symmetries
from bha.checkup.explain import LEAST_EXPLAINED, MOST_SPOILED, Verdict
from bha.checkup.finding import Explanation, Finding
from bha.checkup.layout import Layout
from bha.checkup.mend import Mend
from bha.checkup.seen import Seen
from bha.checkup.wiring import Evidence, as_filed, evidence, explained_shares, score

#: Logarithm of how much less must be left unexplained: than by the file, and than by what explains it best otherwise.
GAIN, BETTER = 1.0, 0.5
#: A section is doubted of whose motion by lengths the file explains less than this.
DOUBTED = 0.9


@dataclass(frozen=True)
class Crossed:
    """A pair of length sensors exchanged.

    Attributes:
        names: of the two columns.
        sections: that they belong to, from 0.
        gain: logarithm of how many times less is left unexplained with them exchanged back.
        before: share of each section's motions, at the least, that the file explains as they are.
        after: the same with them exchanged back.
    """

    names: tuple[str, str]
    sections: tuple[int, int]
    gain: float
    before: tuple[float, float]
    after: tuple[float, float]

    def finding(self, where: str) -> Finding:
        """What is to be said of it."""
        a, b = self.names
        which = sorted(set(self.sections))
        where_in = f"section{'s' * (len(which) > 1)} {' and '.join(str(i + 1) for i in which)}"
        repair = f"in the log's heading rename {a} to {b}, {b} to {a}"
        shares = "; ".join(
            f"section {i + 1} by lengths: the file explains {100 * x:.0f} % of its motion, this {100 * y:.0f} %"
            for i, x, y in dict.fromkeys(zip(self.sections, self.before, self.after, strict=True))
        )
        return Finding(
            "fault",
            "wiring",
            where,
            f"lengths of {where_in} move as chambers push only with two of them exchanged",
            shares,
            {"gain": self.gain},
            (Explanation(f"length sensors exchanged: {a} and {b}", repair, Mend(renames={a: b, b: a})),),
            ("pull one length sensor by hand and watch which column changes",),
        )


def crossed(layout: Layout, logs: Sequence[Seen], found: Evidence, verdict: Verdict) -> Crossed | None:
    """The pair of length sensors that explains the motions better than all else, if any does."""
    names = logs[0].length_names
    own = {name: i for i, places in found.length_places.items() for name in places}
    doubted = _doubted(layout, found)
    if not doubted or any(log.length_names != names for log in logs):
        return None
    best: Crossed | None = None
    for a, first in enumerate(names):
        for b in range(a):
            second = names[b]
            sections = (own.get(second), own.get(first))
            if None in sections or not doubted >= set(sections):
                continue
            pair = tuple(int(i) for i in sections if i is not None)
            if pair[0] == pair[1] and symmetries(np.array(list(found.length_places[pair[0]].values()))):
                continue  # an exchange is a turn or a mirror image, and is tried as one
            tried = _tried(layout, logs, found, verdict, (b, a), (pair[0], pair[1]))
            if tried is not None and (best is None or tried.gain > best.gain):
                best = tried
    return best


def _tried(
    layout: Layout,
    logs: Sequence[Seen],
    found: Evidence,
    verdict: Verdict,
    columns: tuple[int, int],
    sections: tuple[int, int],
) -> Crossed | None:
    order = list(range(len(logs[0].length_names)))
    order[columns[0]], order[columns[1]] = columns[1], columns[0]
    other = evidence(
        layout,
        [replace(log, lengths=log.lengths[:, order], lengths_good=log.lengths_good[:, order]) for log in logs],
    )
    common = found.informative & other.informative
    if not common:
        return None
    filed = as_filed(layout)
    before, after = replace(found, informative=common), replace(other, informative=common)
    base = min(score(before, assignment) for assignment in (filed, *(c.assignment for c in verdict.causes[:1])))
    left = score(after, filed)
    if score(before, filed) - left < GAIN or base - left < (BETTER if verdict.causes else GAIN):
        return None
    shares = [[_least_explained(layout, one, i) for i in sections] for one in (before, after)]
    # An arm that swings follows its pressures by no linear map: what one explains is what there is to be explained.
    could = [_least_explained(layout, after, i, of_free=True) for i in sections]
    if min(could) < LEAST_EXPLAINED or any(y < x - MOST_SPOILED for x, y in zip(*shares, strict=True)):
        return None
    named = logs[0].length_names
    return Crossed(
        (named[columns[0]], named[columns[1]]),
        sections,
        score(before, filed) - left,
        (shares[0][0], shares[0][1]),
        (shares[1][0], shares[1][1]),
    )


def _least_explained(layout: Layout, found: Evidence, section: int, *, of_free: bool = False) -> float:
    """The least share of a section's motions by lengths that the file explains; 1 where none counts.

    With ``of_free`` the share of what a free linear map of the pressures does.
    """
    told = explained_shares(found, as_filed(layout), (section,))
    own = [(key, share) for key, share in told.items() if key[0] == "lengths"]
    return min((share / max(found.free[key], share) if of_free else share for key, share in own), default=1.0)


def _doubted(layout: Layout, found: Evidence) -> set[int]:
    return {i for i in range(layout.section_count) if _least_explained(layout, found, i) < DOUBTED}
