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
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

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
    linear_score,
    score,
    seen_drive,
)

Array = NDArray[np.float64]

#: Logarithm of how much less must be left unexplained for an exchange to be found, and what sets a class apart.
GAIN, ALIKE = 0.6, 0.5
#: The same where only single wires or the tip of several sections are seen, and the least share explained then.
GAIN_LINEAR, LEAST_LINEAR = 1.2, 0.6
#: And how many times less must be left unexplained of them all together; below the second one all is the same.
LINEAR_RATIO, LINEAR_FLOOR = 2.3, 0.01
#: A cause is none if by it the share explained of some section's motion, well explained by the file, falls by more.
MOST_SPOILED = 0.08
#: A turn is a fault from this angle on, deg, and worth a note from the second one; both beyond four standard errors.
LEAST_TURN, NOTED_TURN, STANDARD_ERRORS = 12.0, 6.0, 4.0
#: Least share explained by an exchange that is found, and by a turn of a sure angle.
LEAST_EXPLAINED, LEAST_TURNED = 0.5, 0.35
#: Sections with more inputs than this are tried with pairs and cyclic exchanges only.
MOST_PERMUTED = 4


@dataclass(frozen=True)
class Cause:
    """One way to explain the motions.

    Attributes:
        kind: ``"tubes"``, ``"tubes_between"``, ``"sections"``, ``"azimuth"``, ``"camera"``, ``"sensors"``,
            ``"sensor_sections"`` or ``"wires"``.
        sections: sections that it concerns, from 0.
        assignment: what it says.
        score: what it leaves unexplained, see :func:`bha.checkup.wiring.score`.
        turns: angle of each of ``sections``, rad, where it turns them.
        mirrored: whether it mirrors them.
    """

    kind: str
    sections: tuple[int, ...]
    assignment: Assignment
    score: float
    turns: tuple[float, ...] = ()
    mirrored: bool = False

    @property
    def count(self) -> int:
        """Number of separate mistakes that it supposes."""
        if self.kind == "wires":
            return sum(k != c for k, c in enumerate(self.assignment.channels["lengths"])) // 2
        return 1 if self.kind in ("camera", "sections", "tubes_between", "sensor_sections") else len(self.sections)


@dataclass(frozen=True)
class Turn:
    """How the bending of a section is seen turned against the file.

    Attributes:
        group: ``"lengths"`` or ``"heads"``.
        section: from 0.
        angle: rad.
        error: its standard error, rad.
        explained: share of the bending that is explained so.
        as_filed: share explained without the turn.
        judged: whether it can be judged: enough motion, chambers that do not cancel out.
    """

    group: str
    section: int
    angle: float
    error: float
    explained: float
    as_filed: float
    judged: bool


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
    causes = sorted(_causes(weighed, filed, turns), key=_rank)
    causes = [cause for cause in causes if cause.kind != "nothing"]
    best = causes[0] if causes else None
    gain = base - best.score if best is not None else 0.0
    turned = min((c.score for c in causes if c.kind == "camera" and not c.mirrored), default=base)
    significant = [c for c in causes if _significant(c, turned if c.mirrored else base, turns, weighed)]
    if significant:
        top = significant[0]
        # Several mistakes at once are as good an explanation only where they are of another kind.
        alike = [
            c
            for c in significant
            if c.score <= top.score + ALIKE and (c.count <= top.count or c.kind not in (top.kind, "azimuth"))
        ]
        return Verdict(turns, base, tuple(_thinned(alike)), base - top.score, (), ())
    same = [c for c in causes if c.score <= base + 0.1 and c.kind != "azimuth" and _differs(c)]
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
    filed = as_filed(found.layout)
    for group in found.groups:
        before, after = (seen_drive(found.layout, a, group) for a in (filed, cause.assignment))
        for key in found.informative:
            if key[0] == group:
                kind = 0 if key[2] == "bending" else 1
                shares = [explained(found.blocks[key], drives[kind][key[1]]) for drives in (before, after)]
                if shares[0] >= LEAST_EXPLAINED and shares[0] - shares[1] > MOST_SPOILED:
                    return True
    return False


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
    shares = []
    for group in found.groups:
        bending, axial = seen_drive(found.layout, cause.assignment, group)
        for key in found.informative:
            if key[0] == group and key[1] in cause.sections:
                drive = bending[key[1]] if key[2] == "bending" else axial[key[1]]
                shares.append(explained(found.blocks[key], drive))
    linear = [explained_linear(found, cause.assignment, group) for group in found.groups if group in found.channels]
    return max(shares) >= LEAST_EXPLAINED if shares else max(linear, default=0.0) >= LEAST_LINEAR


def _differs(cause: Cause) -> bool:
    return cause.kind != "camera" or cause.mirrored or abs(np.degrees(cause.turns[0])) > LEAST_TURN


def _turns(found: Evidence, filed: Assignment) -> Iterator[Turn]:
    for key in sorted(found.blocks):
        if key[2] != "bending":
            continue
        block = found.blocks[key]
        drive = seen_drive(found.layout, filed, key[0])[0][key[1]]
        angle, share = direction(block, drive)
        judged = key in found.informative and balance(block, drive) >= LEAST_BALANCE
        error = direction_error(block, drive) if judged else float("inf")
        yield Turn(key[0], key[1], angle, error, share, explained(block, drive), judged)


def _judged_only(found: Evidence, turns: Sequence[Turn]) -> Evidence:
    """The evidence without bendings whose chambers cancel out: their direction says nothing."""
    blind = {(t.group, t.section, "bending") for t in turns if not t.judged}
    return replace(found, informative=found.informative - blind)


def _causes(found: Evidence, filed: Assignment, turns: Sequence[Turn]) -> Iterator[Cause]:
    yield from _tubes(found, filed)
    yield from _tubes_between(found, filed)
    yield from _sections(found, filed)
    yield from _azimuths(found, filed, turns)
    if "heads" in found.groups:
        yield from _cameras(found, filed)
    if "lengths" in found.groups:
        yield from _sensors(found, filed)
        yield from _wires(found, filed)


def _tubes(found: Evidence, filed: Assignment) -> Iterator[Cause]:
    """Tubes of one section exchanged among its chambers, and the best exchanges of several sections together."""
    layout = found.layout
    best: dict[int, tuple[float, dict[int, int]]] = {}
    base = score(found, filed)
    for i in range(layout.section_count):
        own = layout.inputs_of(i)
        for exchanged in exchanges(len(own)):
            feeds = dict(zip(own, (own[k] for k in exchanged), strict=True))
            cause = _fed(found, filed, feeds, "tubes", (i,))
            if not any(found.moved[j] for j in own if feeds[j] != j):
                continue
            yield cause
            if cause.score < best.get(i, (base - 0.1, {}))[0]:
                best[i] = (cause.score, feeds)
    for count in range(2, len(best) + 1):
        for sections in combinations(sorted(best), count):
            feeds = {j: k for i in sections for j, k in best[i][1].items()}
            yield _fed(found, filed, feeds, "tubes", sections)


def exchanges(count: int) -> Iterator[tuple[int, ...]]:
    """Ways to exchange ``count`` things, without leaving all as they are; of many only pairs and cyclic ones."""
    same = tuple(range(count))
    if count <= MOST_PERMUTED:
        yield from (p for p in permutations(range(count)) if p != same)
        return
    for a, b in combinations(range(count), 2):
        yield tuple(b if k == a else a if k == b else k for k in same)
    for shift in range(1, count):
        yield same[shift:] + same[:shift]


def _fed(found: Evidence, filed: Assignment, feeds: dict[int, int], kind: str, sections: tuple[int, ...]) -> Cause:
    whole = tuple(feeds.get(j, j) for j in filed.feeds)
    assignment = replace(filed, feeds=whole)
    return Cause(kind, sections, assignment, score(found, assignment))


def _tubes_between(found: Evidence, filed: Assignment) -> Iterator[Cause]:
    """Two tubes of different sections exchanged."""
    layout = found.layout
    for a, b in combinations(range(len(layout.inputs)), 2):
        first, second = layout.sections_of(a), layout.sections_of(b)
        if first != second and (found.moved[a] or found.moved[b]):
            yield _fed(found, filed, {a: b, b: a}, "tubes_between", tuple(sorted({*first, *second})))


def _sections(found: Evidence, filed: Assignment) -> Iterator[Cause]:
    """All tubes of sections exchanged with those of others."""
    layout = found.layout
    own = [layout.inputs_of(i) for i in range(layout.section_count)]
    fed = [j for inputs in own for j in inputs]
    if layout.section_count < 2 or len({len(inputs) for inputs in own}) != 1 or len(set(fed)) != len(fed):
        return
    for order in exchanges(layout.section_count):
        feeds = {j: k for i, other in enumerate(order) for j, k in zip(own[i], own[other], strict=True)}
        yield _fed(found, filed, feeds, "sections", tuple(i for i, other in enumerate(order) if i != other))


def _azimuths(found: Evidence, filed: Assignment, turns: Sequence[Turn]) -> Iterator[Cause]:
    """Sections whose chambers sit at another azimuth, one by one and together: by sensors and camera alike."""
    n = found.layout.section_count
    angles: dict[int, float] = {}
    for i in range(n):
        own = [t for t in turns if t.section == i and t.judged]
        if own:
            angles[i] = _common_angle(found, filed, [(t.group, i) for t in own], mirrored=False)
        elif found.channels:
            angles[i] = _searched(found, filed, tuple(found.channels), i)
    for i in list(angles):
        yield _turned(found, filed, {i: angles[i]}, found.groups, "azimuth")
    large = [i for i, a in angles.items() if abs(np.degrees(a)) >= NOTED_TURN]
    if len(large) > 1:
        yield _turned(found, filed, {i: angles[i] for i in large}, found.groups, "azimuth")
    # Length sensors that sit on the bellows turn with them: then only the heads show it.
    if {"lengths", "heads"} <= set(found.groups):
        heads = {t.section: t.angle for t in turns if t.judged and t.group == "heads"}
        large = [i for i, a in heads.items() if abs(np.degrees(a)) >= NOTED_TURN]
        if large:
            yield _turned(found, filed, {i: heads[i] for i in large}, ("heads",), "azimuth")


def _turned(
    found: Evidence,
    filed: Assignment,
    angles: dict[int, float],
    groups: Sequence[str],
    kind: str,
    *,
    mirrored: bool = False,
) -> Cause:
    n = found.layout.section_count
    turn = tuple(angles.get(i, 0.0) for i in range(n))
    flip = tuple(mirrored and i in angles for i in range(n))
    assignment = replace(
        filed,
        turns={**filed.turns, **dict.fromkeys(groups, turn)},
        mirrored={**filed.mirrored, **dict.fromkeys(groups, flip)},
    )
    return Cause(kind, tuple(angles), assignment, score(found, assignment), tuple(angles.values()), mirrored)


def _cameras(found: Evidence, filed: Assignment) -> Iterator[Cause]:
    """The camera turned about the arm's axis, or mirrored: all heads alike."""
    n = found.layout.section_count
    places = [("heads", key[1]) for key in found.informative if key[0] == "heads" and key[2] == "bending"]
    for mirrored in (False, True):
        if places:
            angle = _common_angle(found, filed, places, mirrored=mirrored)
        elif "heads" in found.channels:
            angle = _searched(found, filed, ("heads",), None, mirrored=mirrored)
        else:
            continue
        yield _turned(found, filed, dict.fromkeys(range(n), angle), ("heads",), "camera", mirrored=mirrored)


def _common_angle(found: Evidence, filed: Assignment, places: Sequence[tuple[str, int]], *, mirrored: bool) -> float:
    """The angle that explains some bendings together, rad; each counts by the share that it explains."""
    total = 0j
    for group, i in places:
        key = (group, i, "bending")
        if key in found.informative:
            drive = seen_drive(found.layout, filed, group)[0][i]
            angle, share = direction(found.blocks[key], drive.conj() if mirrored else drive)
            total += share * np.exp(1j * angle)
    return float(np.angle(total)) if total else 0.0


def _searched(
    found: Evidence, filed: Assignment, groups: Sequence[str], section: int | None, *, mirrored: bool = False
) -> float:
    """The angle that explains linear channels best, rad, by a search and a parabola; of all sections if None."""
    n = found.layout.section_count
    grid = np.radians(np.arange(-180.0, 180.0, 10.0))
    sections = range(n) if section is None else (section,)

    def left(angle: float) -> float:
        return _turned(found, filed, dict.fromkeys(sections, angle), groups, "azimuth", mirrored=mirrored).score

    values = np.array([left(float(a)) for a in grid])
    best = int(np.argmin(values))
    low, middle, high = values[best - 1], values[best], values[(best + 1) % len(grid)]
    bend = low - 2.0 * middle + high
    shift = 0.5 * (low - high) / bend if bend > 1e-12 else 0.0
    return float(grid[best] + shift * np.radians(10.0))


def _sensors(found: Evidence, filed: Assignment) -> Iterator[Cause]:
    """Length sensors of a section exchanged; of whole sections exchanged."""
    layout = found.layout
    seen = {key[1] for key in found.informative if key[0] == "lengths" and key[2] == "bending"}
    base = score(found, filed)
    best: dict[int, tuple[float, float, bool]] = {}
    for i in sorted(seen):
        for turn, mirrored in symmetries(np.array(list(found.length_places[i].values()))):
            cause = _turned(found, filed, {i: turn}, ("lengths",), "sensors", mirrored=mirrored)
            yield cause
            if cause.score < best.get(i, (base - 0.1, 0.0, False))[0]:
                best[i] = (cause.score, turn, mirrored)
    if len(best) > 1:
        n = layout.section_count
        assignment = replace(
            filed,
            turns={"lengths": tuple(best[i][1] if i in best else 0.0 for i in range(n))},
            mirrored={"lengths": tuple(best[i][2] if i in best else False for i in range(n))},
        )
        turns = tuple(best[i][1] for i in sorted(best))
        yield Cause("sensors", tuple(sorted(best)), assignment, score(found, assignment), turns)
    if layout.section_count > 1 and len(seen) == layout.section_count:
        for order in exchanges(layout.section_count):
            assignment = replace(filed, sources={"lengths": order})
            sections = tuple(i for i, other in enumerate(order) if i != other)
            yield Cause("sensor_sections", sections, assignment, score(found, assignment))


def _wires(found: Evidence, filed: Assignment) -> Iterator[Cause]:
    """Single wires exchanged in pairs: the best pair, then the best one beside it, and so on."""
    linear = found.linear.get("lengths")
    count = 0 if linear is None else len(linear.names)
    order = tuple(range(count))
    best = score(found, filed)
    for _ in range(count // 2):
        tried = []
        for a, b in combinations(range(count), 2):
            if order[a] == a and order[b] == b:
                swapped = tuple(b if k == a else a if k == b else c for k, c in enumerate(order))
                assignment = replace(filed, channels={"lengths": swapped})
                tried.append(Cause("wires", (), assignment, score(found, assignment)))
        yield from tried
        top = min(tried, key=lambda cause: cause.score, default=None)
        if top is None or top.score > best - GAIN:
            return
        order, best = top.assignment.channels["lengths"], top.score


def symmetries(angles: Array) -> list[tuple[float, bool]]:
    """Turns (rad, mirrored) that bring lengths at some angles, rad, to each other's places, but for none at all."""
    count = len(angles)
    found = []
    for mirrored in (False, True):
        for k in range(count):
            turn = angles[k] + angles[0] if mirrored else angles[k] - angles[0]
            moved = (-angles if mirrored else angles) + turn
            apart = np.abs(np.angle(np.exp(1j * (moved[:, None] - angles[None, :]))))
            if np.all(apart.min(axis=1) < 0.02) and not (not mirrored and abs(np.sin(turn / 2)) < 1e-6):
                found.append((float(np.angle(np.exp(1j * turn))), mirrored))
    return found


def _thinned(causes: Sequence[Cause]) -> list[Cause]:
    """Each cause once, those that say the same by another way left out."""
    kept: list[Cause] = []
    for cause in causes:
        if not any(
            cause.kind == other.kind and cause.sections == other.sections and cause.assignment == other.assignment
            for other in kept
        ):
            kept.append(cause)
    return kept
