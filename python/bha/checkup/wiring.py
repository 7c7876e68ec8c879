"""How well an assignment of tubes, chambers, sensors and camera explains the motions of a log.

What: an :class:`Assignment` says which chamber each column of pressures feeds, and by which angle (and whether
    mirrored)
the bending of each section is seen. From the geometry alone follows which way each pressure bends each section and that
it lengthens it; two factors a section, how easily it bends and lengthens, are free, but not negative. What is explained
of each motion with these is the whole evidence.
Validity: directions, not sizes: stiffness, damping and lag may be wrong by any factor. Sections are taken to move by
their own chambers; what weight carries over from other sections is left as not explained.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bha.checkup.layout import Layout
from bha.checkup.response import BANK, MOST_ROWS, Filter, Moments, Signals, free_map, moments
from bha.checkup.seen import Linear, Seen, shape_rows, signals

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Key = tuple[str, int, str]

#: Share of a motion that no assignment is expected to explain: below it, shares left over are all the same.
FLOOR = 0.02
#: A motion counts if free linear maps explain this share of it.
LEAST_FREE = 0.4
#: And if its standard deviation is at least so large: rad of bending, share of the length range.
LEAST_BENDING, LEAST_LENGTH = 4e-3, 0.004
#: A section whose own chambers are driven less than this share of what the most driven section has is judged only if it
#: bends by this share of what the model says for the log's greatest pressure in one chamber, or by its mean length if
#: that changes more than those of all sections that are driven: chambers lengthen their own section alone. One that
#: bends must lengthen by this share of the most that a driven section does, too (one chamber of five lengthens its
#: section by a quarter of what four lengthen theirs): soft sections bend under what others carry over.
LEAST_DRIVE, LEAST_PREDICTED, LEAST_LENGTHENED = 0.25, 0.3, 0.2
#: A log with fewer rows of the grid in which all is known tells nothing.
FEWEST_ROWS = 30
#: An input counts as moved from this share of its pressure range on (standard deviation).
LEAST_PRESSURE = 0.02
#: Chambers that work against each other leave no bending to tell a direction from: least share of what they could do.
LEAST_BALANCE = 0.25
#: What is added to the power of each drive, where a motion is divided among those of all sections: drives that are the
#: same, as of shared inputs, halve it.
ALIKE_DRIVES = 1e-3


@dataclass(frozen=True)
class Assignment:
    """Who is who.

    Attributes:
        feeds: for each column of pressures the input that it really is, shape (J,).
        turns: group -> angle of each section, rad, shape (n,): the bending is seen turned by it.
        mirrored: group -> which sections are seen mirrored (v changes its sign, before the turn), shape (n,).
        sources: group -> for each section the section whose motion its columns really show, shape (n,).
        channels: group -> for each linear channel the one that its column really shows.
    """

    feeds: tuple[int, ...]
    turns: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    mirrored: Mapping[str, tuple[bool, ...]] = field(default_factory=dict)
    sources: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    channels: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Agreement:
    """Second moments of a bending seen by heads, h, and one seen by lengths, w, means taken out.

    Attributes:
        straight: mean of h conj(w).
        mirrored: mean of h w.
        heads: mean of |h|^2.
        lengths: mean of |w|^2.
    """

    straight: complex
    mirrored: complex
    heads: float
    lengths: float

    def explained(self, turn: float, mirrored: bool) -> float:
        """Share of h that w explains, turned by an angle, rad, and perhaps mirrored."""
        along = float(np.real((self.mirrored if mirrored else self.straight) * np.exp(-1j * turn)))
        power = self.heads * self.lengths
        return max(along, 0.0) ** 2 / power if power > 0.0 else 0.0


@dataclass(frozen=True)
class Evidence:
    """Second moments of all motions with the pressures behind the filters that explain most.

    Attributes:
        layout: of the arm.
        blocks: moments of the bending and mean length of the sections, by (group, section, kind).
        channels: moments of linear channels, by group.
        linear: what linear channels mean.
        informative: keys of blocks that count.
        free: share of each block that a free linear map explains.
        filters: the filter of each motion.
        moved: which inputs moved, shape (J,).
        size: standard deviation of each block.
        length_places: for each section the lengths measured within it alone: name to angle, rad.
        agreement: for (i, k) how the bending of section i by heads goes with that of section k by lengths.
    """

    layout: Layout
    blocks: Mapping[Key, Moments]
    channels: Mapping[str, tuple[Moments, ...]]
    linear: Mapping[str, Linear]
    informative: frozenset[Key]
    free: Mapping[Key, float]
    filters: Mapping[Key, Filter]
    moved: NDArray[np.bool_]
    size: Mapping[Key, float]
    length_places: Mapping[int, Mapping[str, float]]
    agreement: Mapping[tuple[int, int], Agreement]

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups of motions that count: ``"lengths"``, ``"heads"``."""
        return tuple(dict.fromkeys([*(key[0] for key in sorted(self.informative)), *self.channels]))


def evidence(layout: Layout, logs: Sequence[Seen]) -> Evidence:
    """What the logs tell together."""
    made: list[Signals] = []
    linear: dict[str, Linear] = {}
    for seen in logs:
        one, meaning = signals(layout, seen, max(300, MOST_ROWS // len(logs)))
        if one.good.sum() < FEWEST_ROWS:
            continue
        for group, own in meaning.items():
            # Channels of logs that measure others than the first are not summed up with its own.
            if linear.setdefault(group, own).names != own.names:
                for c in range(len(own.names)):
                    one.motions.pop((group, c, "channel"), None)
        made.append(one)
    measured = next((seen for seen in logs if seen.length_names), logs[0])
    return from_signals(layout, made, linear, length_places(layout, measured))


def length_places(layout: Layout, seen: Seen) -> dict[int, dict[str, float]]:
    """For each section the lengths measured within it alone: name to angle, rad."""
    found: dict[int, dict[str, float]] = {i: {} for i in range(layout.section_count)}
    for name, row in zip(seen.length_names, shape_rows(layout, seen.length_rows), strict=True):
        within = [i for i in range(layout.section_count) if np.any(row[i])]
        if len(within) == 1:
            found[within[0]][name] = float(np.arctan2(-row[within[0], 1], -row[within[0], 0]))
    return found


def from_signals(
    layout: Layout,
    made: Sequence[Signals],
    linear: Mapping[str, Linear],
    places: Mapping[int, Mapping[str, float]],
) -> Evidence:
    """The same from motions on grids."""
    span = layout.pressure_range[:, 1] - layout.pressure_range[:, 0]
    moved = _deviation(layout, made) > LEAST_PRESSURE * span
    found = moments(list(made))
    size = {key: float(np.sqrt(per_filter[0].total()[2])) for key, per_filter in found.items()}
    shares = {key: np.array([free_map(m)[1] for m in per_filter]) for key, per_filter in found.items()}
    chosen: dict[Key, int] = {}
    # A section follows its pressures in one way, whoever watches it; linear channels, which mix sections, each in its
    # own.
    for place in {_place(key) for key in found}:
        keys = [key for key in found if _place(key) == place]
        large = [key for key in keys if size[key] > _least(layout, key)] or keys
        left = np.array([np.log(FLOOR + 1.0 - np.minimum(shares[key], 1.0)) for key in large])
        best = int(np.argmin(left.sum(axis=0)))
        chosen |= dict.fromkeys(keys, best)
    free = {key: float(shares[key][chosen[key]]) for key in found}
    blocks = {key: per_filter[chosen[key]] for key, per_filter in found.items()}
    channels: dict[str, tuple[Moments, ...]] = {}
    kept: dict[str, Linear] = {}
    for group, meaning in linear.items():
        told = [c for c in range(len(meaning.names)) if free.get((group, c, "channel"), 0.0) > LEAST_FREE]
        if told and moved.any():
            channels[group] = tuple(blocks[group, c, "channel"] for c in told)
            kept[group] = Linear(tuple(meaning.names[c] for c in told), meaning.rows[told])
    own = [key for key in blocks if key[2] != "channel"]
    return Evidence(
        layout=layout,
        blocks={key: blocks[key] for key in own},
        channels=channels,
        linear=kept,
        informative=frozenset(
            key
            for key in own
            if size[key] > _least(layout, key) and free[key] > LEAST_FREE and _told(layout, key, made, size)
        ),
        free=free,
        filters={key: BANK[k] for key, k in chosen.items()},
        moved=moved,
        size=size,
        length_places=places,
        agreement=_agreement(layout, made),
    )


def _agreement(layout: Layout, made: Sequence[Signals]) -> dict[tuple[int, int], Agreement]:
    """How the heads and the lengths go together, over all logs."""
    found = {}
    total = sum(int(s.good.sum()) for s in made)
    for i in range(layout.section_count):
        for k in range(layout.section_count):
            keys = (("heads", i, "bending"), ("lengths", k, "bending"))
            both = [s for s in made if all(key in s.motions for key in keys)]
            if not both:
                continue
            sums: Complex = np.zeros(4, dtype=np.complex128)
            for s in both:
                h, w = (s.motions[key][s.good] - s.motions[key][s.good].mean() for key in keys)
                sums += [np.vdot(w, h), w @ h, np.vdot(h, h), np.vdot(w, w)]
            sums /= total
            found[i, k] = Agreement(complex(sums[0]), complex(sums[1]), float(sums[2].real), float(sums[3].real))
    return found


def _deviation(layout: Layout, made: Sequence[Signals]) -> Array:
    """Standard deviation of each input within logs, Pa, shape (J,)."""
    if not made:
        return np.zeros(len(layout.inputs))
    return np.asarray(np.sqrt(np.mean([np.var(s.pressures, axis=0) for s in made], axis=0)))


def _told(layout: Layout, key: Key, made: Sequence[Signals], size: Mapping[Key, float]) -> bool:
    """Whether a section moves by chambers, by what was driven or by its size, and is not only shaken by others."""
    deviation = _deviation(layout, made)
    if not np.any(deviation > LEAST_PRESSURE * np.ptp(layout.pressure_range, axis=1)):
        return False
    strength = np.sqrt(np.sum(np.abs(layout.bending) ** 2 * deviation**2, axis=1))
    driven = strength >= LEAST_DRIVE * strength.max()
    if driven[key[1]]:
        return True
    lengthened = size.get((key[0], key[1], "length"))
    most = max(size.get((key[0], int(i), "length"), 0.0) for i in np.flatnonzero(driven))
    if key[2] == "length" and size[key] > most:
        return True
    if lengthened is not None and lengthened < LEAST_LENGTHENED * most:
        return False
    strongest = np.max(np.abs(layout.bending[key[1]])) * deviation.max()
    bent = size.get((key[0], key[1], "bending"), 0.0)
    return bool(bent > LEAST_PREDICTED * np.nan_to_num(layout.bending_gain[key[1]], nan=np.inf) * strongest)


def _place(key: Key) -> tuple[int, str]:
    return (key[1], key[0] + key[2]) if key[2] == "channel" else (key[1], key[2])


def _least(layout: Layout, key: Key) -> float:
    """Least size of a motion that counts."""
    if key[2] == "bending":
        return LEAST_BENDING
    return LEAST_LENGTH * float(np.ptp(layout.length_range[key[1]])) if key[2] == "length" else 0.0


def as_filed(layout: Layout) -> Assignment:
    """The assignment of the arm's file."""
    return Assignment(tuple(range(len(layout.inputs))))


def drives(layout: Layout, assignment: Assignment) -> tuple[Complex, Array]:
    """Bending and lengthening of each section by each column of pressures, shapes (n, J), in its own frame."""
    return layout.bending[:, list(assignment.feeds)], layout.axial[:, list(assignment.feeds)]


def seen_drive(layout: Layout, assignment: Assignment, group: str) -> tuple[Complex, Array]:
    """The same as a group of sensors sees it."""
    bending, axial = drives(layout, assignment)
    if group in assignment.sources:
        source = list(assignment.sources[group])
        bending, axial = bending[source], axial[source]
    mirrored = np.array(assignment.mirrored.get(group, (False,) * len(bending)))
    turns = np.array(assignment.turns.get(group, (0.0,) * len(bending)))
    return np.where(mirrored[:, None], bending.conj(), bending) * np.exp(1j * turns)[:, None], axial


def explained(block: Moments, drive: Complex | Array) -> float:
    """Share of a motion that ``drive`` (J,) times a factor that is not negative explains."""
    pp, yp, yy = block.total()
    power = float(np.real(drive.conj() @ pp @ drive))
    along = float(np.real(np.vdot(drive, yp)))
    # Pressures that stood still but for rounding explain nothing.
    told = power > float(np.sum(np.abs(drive) ** 2)) and yy > 0.0
    return min(1.0, max(along, 0.0) ** 2 / (power * yy)) if told else 0.0


def direction(block: Moments, drive: Complex, others: Complex) -> tuple[float, float]:
    """By which angle, rad, a motion is turned against ``drive``, and the share that it explains when so turned.

    What a section does with ``others``, shape (k, J), the drives of other sections, is no turn of its own: weights and
    springs carry it over, and in a short log the drives go together by chance.
    """
    pp, yp, yy = block.total()
    power = float(np.real(drive.conj() @ pp @ drive))
    along = complex(np.vdot(drive, yp))
    told = power > float(np.sum(np.abs(drive) ** 2)) and yy > 0.0
    share = min(1.0, abs(along) ** 2 / (power * yy)) if told else 0.0
    if told:
        # The own one first; those that did not move have no part in it.
        table = np.stack([drive, *others])
        normal, right = table.conj() @ pp @ table.T, table.conj() @ yp
        size = np.sqrt(np.maximum(np.real(np.diag(normal)), 1e-300))
        moved = np.real(np.diag(normal)) > np.sum(np.abs(table) ** 2, axis=1)
        normal = (normal / np.outer(size, size))[np.ix_(moved, moved)] + ALIKE_DRIVES * np.eye(int(moved.sum()))
        along = complex(np.linalg.solve(normal, (right / size)[moved])[0])
    return float(np.angle(along)), share


def direction_error(block: Moments, drive: Complex, others: Complex) -> float:
    """Standard error of that angle, rad, by leaving out one piece of time after the other."""
    pieces = len(block.yy)
    if pieces < 3:
        return float("inf")
    whole, _ = direction(block, drive, others)
    off = [np.angle(np.exp(1j * (direction(block.without(k), drive, others)[0] - whole))) for k in range(pieces)]
    return float(np.sqrt((pieces - 1) / pieces * np.sum(np.square(off))))


def balance(block: Moments, drive: Complex) -> float:
    """How much of what the moved chambers could do is left when they work together, 0 (nothing) to 1 and above."""
    pp, _, _ = block.total()
    could = float(np.sum(np.abs(drive) ** 2 * np.diag(pp)))
    return float(np.sqrt(np.real(drive.conj() @ pp @ drive) / could)) if could > 0.0 else 0.0


def explained_shares(found: Evidence, assignment: Assignment, only: Sequence[int] | None = None) -> dict[Key, float]:
    """Share of each motion that counts which an assignment explains; of some sections alone if ``only`` says which."""
    told: dict[Key, float] = {}
    for group in found.groups:
        bending, axial = seen_drive(found.layout, assignment, group)
        for key in found.informative:
            if key[0] == group and (only is None or key[1] in only):
                drive = bending[key[1]] if key[2] == "bending" else axial[key[1]]
                told[key] = explained(found.blocks[key], drive)
    return told


def score(found: Evidence, assignment: Assignment, only: Sequence[int] | None = None) -> float:
    """How much an assignment leaves unexplained: sum of logarithms of shares over motions; lower is better.

    Args:
        found: the evidence.
        assignment: what is tried.
        only: sections that count; all if None.
    """
    total = sum(float(np.log(FLOOR + 1.0 - share)) for share in explained_shares(found, assignment, only).values())
    return total + linear_score(found, assignment) + _disagreement(found, assignment, only)


def linear_score(found: Evidence, assignment: Assignment) -> float:
    """The part of the score that is that of linear channels."""
    return sum(
        linear_weight(found, group) * float(np.log(FLOOR + 1.0 - explained_linear(found, assignment, group)))
        for group in found.channels
    )


def _disagreement(found: Evidence, assignment: Assignment, only: Sequence[int] | None) -> float:
    """What lengths leave unexplained of the heads' bending, whatever the pressures are: no chamber plays a part."""
    n = found.layout.section_count
    total = 0.0
    for i in range(n):
        key = ("heads", i, "bending")
        if key not in found.size or found.size[key] <= LEAST_BENDING or (only is not None and i not in only):
            continue
        source = assignment.sources.get("lengths", tuple(range(n)))
        agreement = found.agreement.get((i, source.index(i)))
        if agreement is None or agreement.lengths <= LEAST_BENDING**2:
            continue
        turn_h, turn_l = (assignment.turns.get(group, (0.0,) * n)[i] for group in ("heads", "lengths"))
        flip_h, flip_l = (assignment.mirrored.get(group, (False,) * n)[i] for group in ("heads", "lengths"))
        flip = flip_h != flip_l
        share = agreement.explained(turn_h + turn_l if flip else turn_h - turn_l, flip)
        total += float(np.log(FLOOR + 1.0 - share))
    return total


def linear_weight(found: Evidence, group: str) -> float:
    """As how many motions the linear channels of a group count: no more than sections can move."""
    return float(min(len(found.channels[group]), 2 * found.layout.section_count))


def explained_linear(found: Evidence, assignment: Assignment, group: str) -> float:
    """Share of the linear channels of a group that an assignment explains, of their squares together."""
    bending, axial = seen_drive(found.layout, assignment, group)
    rows = found.linear[group].rows
    if group in assignment.channels:
        rows = rows[list(assignment.channels[group])]
    n = found.layout.section_count
    normal: Array = np.zeros((2 * n, 2 * n))
    right: Array = np.zeros(2 * n)
    whole = 0.0
    for c, block in enumerate(found.channels[group]):
        pp, yp, yy = block.total()
        if yy <= 0.0:
            continue
        # Channel c under a unit factor of each section's bending and lengthening: weights of the pressures.
        parts = [rows[c, i, 0] * bending[i].real + rows[c, i, 1] * bending[i].imag for i in range(n)]
        parts += [rows[c, i, 2] * axial[i] for i in range(n)]
        table = np.array(parts)
        normal += table @ pp @ table.T
        right += table @ yp.real
        whole += yy
    if whole == 0.0:
        return 0.0
    factors = not_negative(normal, right)
    gained = float(2.0 * right @ factors - factors @ normal @ factors)
    return min(1.0, gained / whole)


def not_negative(normal: Array, right: Array) -> Array:
    """x >= 0 with the least x normal x / 2 - right x, by sweeps over its entries."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    matrix, vector = normal / np.outer(scale, scale), right / scale
    x = np.zeros(len(vector))
    for _ in range(100):
        before = x.copy()
        for k in range(len(x)):
            if matrix[k, k] > 0.0:
                x[k] = max(0.0, x[k] + (vector[k] - matrix[k] @ x) / matrix[k, k])
        if np.allclose(x, before, rtol=1e-6, atol=1e-9 * np.abs(vector).max(initial=1.0)):
            break
    return np.asarray(x / scale)
