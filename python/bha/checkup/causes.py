"""All causes that are tried: exchanged tubes and sensors, azimuths, cameras; each with what it leaves unexplained.

Each section's own exchanges one by one, the best ones of several sections together, pairs of tubes between sections,
whole sections, azimuths and cameras at the angle that explains most, length sensors and single wires.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from bha.checkup.wiring import Assignment, Evidence, direction, explained_shares, score, seen_drive

Array = NDArray[np.float64]

#: Logarithm of how much less must be left unexplained for an exchange to be found.
GAIN = 0.6
#: Angle, deg, from which on a turned section is worth a word.
NOTED_TURN = 6.0
#: A section of which the file explains less than this share of some motion may have a tube of another section.
DOUBTED = 0.9
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


def causes(found: Evidence, filed: Assignment, turns: Sequence[Turn]) -> Iterator[Cause]:
    """All causes for some evidence; ``turns`` says which sections can be judged by their direction."""
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
    # Of many sections all together only: that is what a mirrored camera looks like.
    for count in range(2, len(best) + 1) if len(best) <= MOST_PERMUTED else (len(best),):
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
    doubted = _doubted(found, filed)
    for a, b in combinations(range(len(layout.inputs)), 2):
        if not (doubted & {*layout.sections_of(a), *layout.sections_of(b)}):
            continue
        first, second = layout.sections_of(a), layout.sections_of(b)
        if first != second and (found.moved[a] or found.moved[b]):
            yield _fed(found, filed, {a: b, b: a}, "tubes_between", tuple(sorted({*first, *second})))


def _doubted(found: Evidence, filed: Assignment) -> set[int]:
    """Sections of which the file leaves a good part unexplained; all where they are not told one by one."""
    if found.channels:
        return set(range(found.layout.section_count))
    return {section for (_, section, _), share in explained_shares(found, filed).items() if share < DOUBTED}


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
            drives = seen_drive(found.layout, filed, group)[0]
            drives = drives.conj() if mirrored else drives
            angle, share = direction(found.blocks[key], drives[i], np.delete(drives, i, axis=0))
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
