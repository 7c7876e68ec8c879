"""What explains the motions better than the file as it stands: tubes, azimuth, sensors, camera; ranked, as a class.

What: all single causes of some kinds are tried, each section's own and those of the whole arm; those that explain about
as much as the best one form the class of faults that act alike. With three equal bellows a cyclic exchange of tubes
turns the bending by 120 degrees as a turned camera does, and a swapped pair mirrors it: no log of the same sensors can
tell them apart.
Decision: an exchange is found where what it leaves unexplained is ``GAIN`` times less in some motion (``benches/
check_faults.py`` calibrates it); a turn where its angle exceeds ``LEAST_TURN`` and four of its standard errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bha.checkup.causes import GAIN, Cause, Turn, causes
from bha.checkup.wiring import (
    LEAST_BALANCE,
    Assignment,
    Evidence,
    as_filed,
    balance,
    direction,
    direction_error,
    explained,
    explained_linear,
    explained_shares,
    linear_score,
    score,
    seen_drive,
)

#: Logarithm of what sets a cause apart from the best one: below it they act alike.
ALIKE = 0.5
#: The same where only single wires or the tip of several sections are seen, and the least share explained then.
GAIN_LINEAR, LEAST_LINEAR = 1.2, 0.6
#: And how many times less must be left unexplained of them all together; below the second one all is the same.
LINEAR_RATIO, LINEAR_FLOOR = 2.3, 0.01
#: A cause is none if by it the share explained of some section's motion, well explained by the file, falls by more.
MOST_SPOILED = 0.08
#: A turn is a fault from this angle on, deg; it and a note of a smaller one must be beyond so many standard errors.
LEAST_TURN, STANDARD_ERRORS = 12.0, 4.0
#: Least share explained by an exchange that is found, and by a turn of a sure angle.
LEAST_EXPLAINED, LEAST_TURNED = 0.5, 0.35


@dataclass(frozen=True)
class Verdict:
    """What came out.

    Attributes:
        turns: each section and group as it stands.
        filed: score of the file as it stands.
        causes: the class of causes that explain the motions, best first; empty where the file explains them as well.
        gain: logarithm of how many times less the best of all causes leaves unexplained.
        not_excluded: causes that explain as much as the file does: what these logs cannot tell.
        unexplained: sections whose bending follows the pressures, but as no cause here says.
    """

    turns: tuple[Turn, ...]
    filed: float
    causes: tuple[Cause, ...]
    gain: float
    not_excluded: tuple[Cause, ...]
    unexplained: tuple[int, ...]


def judge(found: Evidence) -> Verdict:
    """Compare all causes with the file."""
    filed = as_filed(found.layout)
    turns = tuple(_turns(found, filed))
    base = score(found, filed)
    if (
        not any(t.judged for t in turns)
        and not any(key[2] == "length" for key in found.informative)
        and not found.channels
    ):
        return Verdict(turns, base, (), 0.0, (), ())
    weighed = _judged_only(found, turns)
    base = score(weighed, filed)
    tried = sorted(causes(weighed, filed, turns), key=_rank)
    best = tried[0] if tried else None
    gain = base - best.score if best is not None else 0.0
    turned = min((c.score for c in tried if c.kind == "camera" and not c.mirrored), default=base)
    significant = [c for c in tried if _significant(c, turned if c.mirrored else base, turns, weighed)]
    if significant:
        top = significant[0]
        # Several mistakes at once are as good an explanation only where they are of another kind.
        alike = [
            c
            for c in significant
            if c.score <= top.score + ALIKE and (c.count <= top.count or c.kind not in (top.kind, "azimuth"))
        ]
        # Where the chambers of a section are driven together, the tubes of both sections exchanged as a whole are
        # hardly told from any two of them; it is the mistake of one plug.
        alike.sort(key=lambda cause: cause.kind != "sections")
        return Verdict(turns, base, tuple(_thinned(alike)), base - top.score, (), ())
    same = [c for c in tried if c.score <= base + 0.1 and c.kind != "azimuth" and _differs(c)]
    unexplained = tuple(
        sorted(
            {
                t.section
                for t in turns
                if t.judged
                and max(t.explained, t.as_filed) < LEAST_EXPLAINED / 2
                and found.free[t.group, t.section, "bending"] > 0.8
            }
        )
    )
    return Verdict(turns, base, (), gain, tuple(_thinned(same)), unexplained)


def _rank(cause: Cause) -> float:
    """By what is left unexplained; with some preference for fewer mistakes, and for exchanges before odd angles."""
    odd = cause.kind in ("azimuth", "camera") and any(abs(np.sin(2.0 * a)) > 0.1 for a in cause.turns)
    return cause.score + 0.1 * cause.count + (0.4 if odd else 0.05 * (cause.kind not in ("tubes", "sections")))


def _significant(cause: Cause, base: float, turns: Sequence[Turn], found: Evidence) -> bool:
    gain = base - cause.score
    if gain <= 0.02:
        return False
    if cause.kind in ("azimuth", "camera") and not cause.mirrored:
        concerned = [
            t
            for t in turns
            if t.section in cause.sections and t.judged and (cause.kind != "camera" or t.group == "heads")
        ]
        sure = [t for t in concerned if abs(t.angle) > STANDARD_ERRORS * t.error and t.explained >= LEAST_TURNED]
        large = [a for a in cause.turns if abs(np.degrees(a)) >= LEAST_TURN]
        return bool(large) and (bool(sure) if concerned else gain >= GAIN_LINEAR and _explains(cause, found))
    if not _explains(cause, found) or _spoils(cause, found):
        return False
    by_sections = (
        base - linear_score(found, as_filed(found.layout)) - (cause.score - linear_score(found, cause.assignment))
    )
    return by_sections >= GAIN or (gain >= GAIN_LINEAR and _explains_channels(cause, found))


def _spoils(cause: Cause, found: Evidence) -> bool:
    """Whether a cause loses what the file explains well of some section's motion."""
    after = explained_shares(found, cause.assignment)
    before = explained_shares(found, as_filed(found.layout))
    return any(share >= LEAST_EXPLAINED and share - after[key] > MOST_SPOILED for key, share in before.items())


def _explains_channels(cause: Cause, found: Evidence) -> bool:
    """Whether a cause leaves far less of some group of single wires or of the tip unexplained than the file does."""
    filed = as_filed(found.layout)
    return any(
        LINEAR_FLOOR + 1.0 - explained_linear(found, filed, group)
        > LINEAR_RATIO * (LINEAR_FLOOR + 1.0 - explained_linear(found, cause.assignment, group))
        for group in found.channels
    )


def _explains(cause: Cause, found: Evidence) -> bool:
    """Whether a cause explains a fair share of the motions of the sections it concerns."""
    own = explained_shares(found, cause.assignment, cause.sections)
    linear = [explained_linear(found, cause.assignment, group) for group in found.groups if group in found.channels]
    return max(own.values()) >= LEAST_EXPLAINED if own else max(linear, default=0.0) >= LEAST_LINEAR


def _differs(cause: Cause) -> bool:
    return cause.kind != "camera" or cause.mirrored or abs(np.degrees(cause.turns[0])) > LEAST_TURN


def _turns(found: Evidence, filed: Assignment) -> Iterator[Turn]:
    for key in sorted(found.blocks):
        if key[2] != "bending":
            continue
        block = found.blocks[key]
        drives = seen_drive(found.layout, filed, key[0])[0]
        drive, others = drives[key[1]], np.delete(drives, key[1], axis=0)
        angle, share = direction(block, drive, others)
        judged = key in found.informative and balance(block, drive) >= LEAST_BALANCE
        error = direction_error(block, drive, others) if judged else float("inf")
        yield Turn(key[0], key[1], angle, error, share, explained(block, drive), judged)


def _judged_only(found: Evidence, turns: Sequence[Turn]) -> Evidence:
    """The evidence without bendings whose chambers cancel out: their direction says nothing."""
    blind = {(t.group, t.section, "bending") for t in turns if not t.judged}
    return replace(found, informative=found.informative - blind)


def _thinned(alike: Sequence[Cause]) -> list[Cause]:
    """Each cause once: sections that share their tubes say the same of them."""
    kept: list[Cause] = []
    for cause in alike:
        if not any((cause.kind, cause.assignment) == (other.kind, other.assignment) for other in kept):
            kept.append(cause)
    return kept
