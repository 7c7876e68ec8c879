"""Gauge pressures read as absolute ones, or the reverse, where the permitted range allows both: told by the poses.

What: over stretches of a log the mean pressures and the mean lengths and heads are compared with the poses that the
model holds, as the headings are and the other way, each with the stiffness scaled by what suits it best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.checkup.finding import Finding
from bha.checkup.ranges import BELIEVED, gauge_mistake, inside
from bha.checkup.seen import Seen
from bha.errors import BhaError

if TYPE_CHECKING:
    from bha.arm import Arm

Array = NDArray[np.float64]

#: Stretches of a log over which means are taken, and scales of stiffness that are tried.
STRETCHES = 12
SCALES = tuple(np.geomspace(0.25, 4.0, 41))
#: The other way must leave this many times less.
SORT_BETTER = 2.5
#: Share of the length range by which poses must be missed before gauge and absolute pressure are thought exchanged.
LEAST_MISSED = 0.05


@dataclass(frozen=True)
class Poses:
    """Means over stretches: pressures (s, J), lengths (s, K), heads (s, n, 3); NaN where not measured."""

    pressures: Array
    lengths: Array
    heads: Array


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
    as_filed, _ = _best(arm, _poses(seen), seen.length_rows)
    flipped, _ = _best(arm, _poses(other), seen.length_rows)
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


def _poses(seen: Seen) -> Poses:
    pressures, lengths, heads = [], [], []
    for rows in np.array_split(np.arange(len(seen.time)), STRETCHES):
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


def _best(arm: Arm, poses: Poses, rows: Array) -> tuple[float, float]:
    """Least RMS error, m, over scales of the stiffness, and that scale."""
    return min((_error(_scaled(arm, scale), poses, rows), float(scale)) for scale in SCALES)


def _scaled(arm: Arm, scale: float) -> Arm:
    """The arm with all its springs and bending stiffnesses times a factor."""
    mapping = arm.parameters.to_mapping()
    for section in mapping["section"]:
        for table in (section, *section.get("bellows", ())):
            for key in ("stiffness", "bending_stiffness"):
                if key in table:
                    table[key] = [scale * k for k in table[key]]
    return type(arm).from_parameters(type(arm.parameters).from_mapping(mapping))


def _error(arm: Arm, poses: Poses, rows: Array) -> float:
    """RMS error of lengths, m; of heads where no length is measured."""
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
    known_values = table[np.isfinite(table)]
    return float(np.sqrt(np.mean(known_values**2))) if len(known_values) else float("inf")
