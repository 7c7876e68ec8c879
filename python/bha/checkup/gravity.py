"""The sign of gravity: an arm that hangs by its file and stands in the laboratory, or the reverse.

Two kinds of evidence. Poses: over stretches of the logs the mean pressures and the mean lengths and heads are compared
with the poses that the model holds, with gravity as in the file and reversed, each with the stiffness scaled by what
suits it best, and heads up to a common shift (the camera's origin). Rest lengths wrong by what the weight does twice
look the same, so that finding is a class. Carrying over: the weight of an outer section that bends aside bends the
inner ones too, back in an arm that hangs, further in one that stands; the bending of the inner sections under the outer
ones' pressures therefore has another sign, whatever the rest lengths are.
Limits: arms of one section are told by poses only, and by heads alone not at all; arms that are stiff for their weight
do not tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.checkup.finding import Explanation, Finding, Severity
from bha.checkup.mend import Mend
from bha.checkup.ranges import BELIEVED, gauge_mistake, inside
from bha.checkup.seen import Seen
from bha.checkup.wiring import LEAST_BALANCE, Evidence, Key, balance, explained
from bha.errors import BhaError

if TYPE_CHECKING:
    from bha.arm import Arm

Array = NDArray[np.float64]

#: Stretches of a log over which means are taken, and scales of stiffness that are tried.
STRETCHES = 12
SCALES = tuple(np.geomspace(0.25, 4.0, 41))
#: Reversed gravity must leave this many times less than the file's for a warning, and for a fault; and at most this
#: share of what the channels travel. Below the first one logs do not exclude it.
BETTER, FAR_BETTER, LEAST_FIT = 1.4, 2.0, 0.6
NOT_EXCLUDED = 0.85
#: Gauge for absolute pressure: the other way must leave this many times less.
SORT_BETTER = 2.5
#: And the file's must leave at least this, m.
LEAST_ERROR = 8e-4
#: Share of the length range by which poses must be missed before gauge and absolute pressure are thought exchanged.
LEAST_MISSED = 0.05
#: Logarithm of how many times less the bending leaves unexplained with gravity reversed (product over the sections),
#: and what it is not expected to leave below.
CARRIED, CARRIED_FLOOR = 0.4, 0.003
#: Share of a section's bending that its own chambers must explain for this.
LEAST_FOLLOWED = 0.5
#: Correlation of two sections' drives from which on they count as driven in step.
DRIVEN_ALIKE = 0.7
#: Change of pressure over which the model's response is taken, Pa.
_STEP = 2e3


@dataclass(frozen=True)
class Poses:
    """Means over stretches: pressures (s, J), lengths (s, K), heads (s, n, 3); NaN where not measured."""

    pressures: Array
    lengths: Array
    heads: Array


def gravity_findings(arm: Arm, logs: Sequence[Seen], found: Evidence, where: str) -> tuple[list[Finding], bool]:
    """Whether gravity points the other way than the file says, and whether these logs tell its sign at all."""
    gravity = np.asarray(arm.parameters.gravity)
    if not np.any(gravity) or not logs:
        return [], True
    other_arm = arm.with_changes(gravity=[float(-g) for g in gravity])
    poses = _poses(logs)
    rows = logs[0].length_rows
    as_filed, _ = _best(arm, poses, rows)
    other, other_scale = _best(other_arm, poses, rows)
    by_poses = as_filed > LEAST_ERROR and as_filed > BETTER * other and other < LEAST_FIT * _travel(poses)
    carried = carried_over(arm, other_arm, found, poses.pressures.mean(axis=0))
    by_carrying = carried > CARRIED
    # Poses against what is carried over: then something else is wrong.
    if not (by_carrying or (by_poses and carried > -CARRIED)):
        return [], carried < -CARRIED or as_filed < NOT_EXCLUDED * other
    numbers = {"error_as_filed": as_filed, "error_reversed": other, "stiffness_scale": other_scale, "carried": carried}
    evidence = (
        f"poses are missed by {1e3 * as_filed:.3g} mm RMS with gravity as in the file, by {1e3 * other:.3g} mm with it "
        "reversed, each at the stiffness that suits it best"
    )
    if by_carrying:
        evidence = (
            f"what outer sections bend the inner ones by their weight has the other sign: with gravity reversed "
            f"{np.exp(carried):.2g} times less of the bending is unexplained; {evidence}"
        )
    line = "gravity = [" + ", ".join(f"{-g + 0.0:g}" for g in gravity) + "]"
    what = "gravity points the other way: the arm hangs where the file lets it stand, or the reverse"
    explanations = [Explanation(what, line, Mend(arm={"gravity": [-float(g) + 0.0 for g in gravity]}))]
    if not by_carrying:
        shift = _rest_shift(arm, other_arm)
        rest = "; ".join(
            f"section {i + 1}: rest_length = {s.rest_length + d:.4f}"
            for i, (s, d) in enumerate(zip(arm.parameters.sections, shift, strict=True))
        )
        explanations.append(Explanation("rest lengths other than in the file, by what the weight does twice", rest))
    split = (
        "look at how the arm is mounted: the file's z axis runs along the straight arm, gravity = [0, 0, 9.81] hangs"
    )
    headline = (
        "the arm moves as if gravity were reversed" if by_carrying else "the arm rests as if gravity were reversed"
    )
    severity: Severity = "fault" if by_carrying or as_filed > FAR_BETTER * other else "warning"
    return [Finding(severity, "gravity", where, headline, evidence, numbers, tuple(explanations), (split,))], True


def sort_of_pressure_findings(
    arm: Arm, seen: Seen, ranges: Array, gauge: Sequence[str], columns: Sequence[str]
) -> list[Finding]:
    """Gauge or absolute, told by the poses: an atmosphere more in all chambers lengthens an arm by far.

    For logs whose pressures fit the ranges either way. The stiffness is scaled by what suits each best.

    Args:
        arm: the arm.
        seen: the log.
        ranges: permitted pressures of each input, Pa, shape (J, 2).
        gauge: columns that are gauge pressures in the file.
        columns: names of the columns.
    """
    ambient = arm.parameters.ambient_pressure
    is_gauge = np.array([column in gauge for column in columns])
    if ambient <= 0.0 or not (is_gauge.all() or not is_gauge.any()):
        return []
    other = replace(seen, pressures=seen.pressures + (-ambient if is_gauge.all() else ambient))
    if np.min(other.pressures) < 0.0 or inside(other.pressures, ranges) < BELIEVED:
        return []
    as_filed, _ = _best(arm, _poses([seen]), seen.length_rows, shifted=False)
    flipped, _ = _best(arm, _poses([other]), seen.length_rows, shifted=False)
    span = float(np.min(np.ptp([s.length_range for s in arm.parameters.sections], axis=1)))
    if not (flipped < as_filed / SORT_BETTER and as_filed > LEAST_MISSED * span):
        return []
    missed = f"{1e3 * as_filed:.3g} mm RMS" if np.isfinite(as_filed) else "no pose that it could hold"
    evidence = f"poses are missed by {missed} as the headings are, by {1e3 * flipped:.3g} mm the other way"
    numbers = {"error_as_filed": as_filed, "error_other": flipped}
    return [
        Finding(
            "fault",
            "gauge",
            seen.name,
            "pressures are not what their headings say",
            evidence,
            numbers,
            (gauge_mistake(columns, is_gauge),),
        )
    ]


def carried_over(arm: Arm, other: Arm, found: Evidence, pressures: Array) -> float:
    """Logarithm of how many times less of the bending ``other`` leaves unexplained than ``arm``.

    The responses are those of the model's poses to each pressure about ``pressures`` (J,), each section's times a
    factor that is not negative.
    """
    layout = found.layout
    keys = [
        key
        for key in sorted(found.informative)
        if key[2] == "bending" and balance(found.blocks[key], layout.bending[key[1]]) >= LEAST_BALANCE
    ]
    # The bending must follow the pressures as the file says in the first place.
    keys = [key for key in keys if explained(found.blocks[key], layout.bending[key[1]]) >= LEAST_FOLLOWED]
    if arm.section_count < 2 or len({key[1] for key in keys}) < 2 or _driven_alike(found, keys):
        return 0.0
    left = []
    for one in (arm, other):
        response = bending_response(one, found, pressures)
        if response is None:
            return 0.0
        shares = [explained(found.blocks[key], response[key[1]]) for key in keys]
        left.append(sum(float(np.log(CARRIED_FLOOR + 1.0 - share)) for share in shares))
    return left[0] - left[1]


def _driven_alike(found: Evidence, keys: Sequence[Key]) -> bool:
    """Whether sections were driven in step, so that what one carries over to another cannot be told from its own."""
    drives = found.layout.bending
    for k, key in enumerate(keys):
        pp, _, _ = found.blocks[key].total()
        for other in keys[:k]:
            if other[1] == key[1]:
                continue
            own, theirs = drives[key[1]], drives[other[1]]
            power = np.real(own.conj() @ pp @ own) * np.real(theirs.conj() @ pp @ theirs)
            if abs(own.conj() @ pp @ theirs) > DRIVEN_ALIKE * np.sqrt(max(float(power), 1e-300)):
                return True
    return False


def bending_response(arm: Arm, found: Evidence, pressures: Array) -> NDArray[np.complex128] | None:
    """How the model's poses bend with each pressure, rad/Pa, shape (n, J), complex; None where it holds no pose."""
    n = arm.section_count
    made = np.empty((n, len(pressures)), dtype=np.complex128)
    for j in range(len(pressures)):
        step = np.zeros(len(pressures))
        step[j] = _STEP
        try:
            more, less = (arm.static_lengths(pressures + sign * step) for sign in (1.0, -1.0))
        except BhaError:
            return None
        change = ((more - less) / (2.0 * _STEP)).reshape(n, 3)
        turned = np.sum(change * np.exp(2j * np.pi / 3 * np.arange(3)), axis=1)
        made[:, j] = -(2.0 / 3.0) * turned / found.layout.coordinate_radius
    return made


def _poses(logs: Sequence[Seen]) -> Poses:
    pressures, lengths, heads = [], [], []
    for seen in logs:
        for rows in np.array_split(np.arange(len(seen.time)), max(2, STRETCHES // len(logs))):
            if not len(rows):
                continue
            pressures.append(seen.pressures[rows].mean(axis=0))
            lengths.append(_mean(seen.lengths[rows], seen.lengths_good[rows]))
            places = [_mean(seen.heads[rows, i], seen.heads_good[rows, i, None]) for i in range(seen.heads.shape[1])]
            heads.append(np.array(places))
    return Poses(np.array(pressures), np.array(lengths), np.array(heads))


def _mean(values: Array, good: NDArray[np.bool_]) -> Array:
    counts = np.broadcast_to(good, values.shape).sum(axis=0)
    sums = np.where(good, np.nan_to_num(values), 0.0).sum(axis=0)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def _best(arm: Arm, poses: Poses, rows: Array, *, shifted: bool = True) -> tuple[float, float]:
    """Least RMS error, m, over scales of the stiffness, and that scale."""
    return min((_error(_scaled(arm, scale), poses, rows, shifted=shifted), float(scale)) for scale in SCALES)


def _scaled(arm: Arm, scale: float) -> Arm:
    """The arm with all its springs and bending stiffnesses times a factor."""
    mapping = arm.parameters.to_mapping()
    for section in mapping["section"]:
        for table in (section, *section.get("bellows", ())):
            for key in ("stiffness", "bending_stiffness"):
                if key in table:
                    table[key] = [scale * k for k in table[key]]
    return type(arm).from_parameters(type(arm.parameters).from_mapping(mapping))


def _error(arm: Arm, poses: Poses, rows: Array, *, shifted: bool) -> float:
    """RMS error of lengths, m; of heads where no length is measured, up to a common shift where ``shifted``."""
    q: Array | None = None
    left, base = [], arm.parameters.base_pose
    for pressures, lengths, heads in zip(poses.pressures, poses.lengths, poses.heads, strict=True):
        try:
            q = arm.static_lengths(pressures, start=q)
        except BhaError:
            return float("inf")
        left.append(
            lengths - rows @ q if len(rows) else (heads - base.from_world(arm.forward_kinematics(q)[0])).ravel()
        )
    table = np.array(left)
    if shifted and not len(rows):
        by_axis = table.reshape(-1, 3)
        # The camera's origin is free: a common shift of all heads in all stretches.
        known = np.isfinite(by_axis).all(axis=1)
        table = by_axis - by_axis[known].mean(axis=0) if known.any() else by_axis
    known_values = table[np.isfinite(table)]
    return float(np.sqrt(np.mean(known_values**2))) if len(known_values) else float("inf")


def _travel(poses: Poses) -> float:
    """What lengths, or else heads, travel from stretch to stretch, m, RMS."""
    table = poses.lengths if poses.lengths.shape[1] else poses.heads.reshape(len(poses.heads), -1)
    deviations = [np.std(column[np.isfinite(column)]) for column in table.T if np.isfinite(column).sum() > 1]
    return float(np.sqrt(np.mean(np.square(deviations)))) if deviations else 0.0


def _rest_shift(arm: Arm, reversed_arm: Arm) -> Array:
    """By how much the mean lengths differ between the two gravities at ambient pressure, m, shape (n,)."""
    ambient = np.full(len(arm.inputs), arm.parameters.ambient_pressure)
    try:
        difference = reversed_arm.static_lengths(ambient) - arm.static_lengths(ambient)
    except BhaError:
        return np.zeros(arm.section_count)
    return np.asarray(difference.reshape(-1, 3).mean(axis=1))
