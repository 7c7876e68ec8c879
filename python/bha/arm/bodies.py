"""Where the bellows of an arm run in space: for pictures.

A bellows lies parallel to the centre line of its section, at the place that the file says; along arcs that taper it
comes nearer to that line, or goes away from it. Poses come from the core (:meth:`bha.Arm.point_pose`), so that what is
drawn is what is computed. Lengths and positions are in m, in the world.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.parameters.along import mean_radius

if TYPE_CHECKING:
    from bha.arm.arm import Arm
    from bha.parameters import SectionParameters

Array = NDArray[np.float64]


def offsets_of(section: SectionParameters, number: int) -> Array:
    """Places of the bellows of a section, counted from 1, in its cross section, m, shape (bellows, 2)."""
    return np.array(
        [[b.radius * np.cos(b.angle), b.radius * np.sin(b.angle)] for b in section.resolved_bellows(number)]
    )


def spread_at(section: SectionParameters, fractions: Array) -> Array:
    """How far bellows are from the centre line at fractions of its length, relative to their places, shape (m,)."""
    if not section.arcs:
        return np.ones(len(fractions))
    ends = np.cumsum([arc.length for arc in section.arcs])
    arc = np.minimum(np.searchsorted(ends, fractions), len(section.arcs) - 1)
    return np.array([section.arcs[k].relative_radius for k in arc]) / mean_radius(section.arcs)


def centre_line(arm: Arm, number: int, lengths: Array, count: int) -> tuple[Array, Array]:
    """Axes (count + 1, 3, 3) and origins (count + 1, 3), m, along the bending part of a section, counted from 1."""
    poses = [arm.point_pose(lengths, number, k / count) for k in range(count)]
    # The point at fraction 1 is the head, with the rigid piece before it.
    head_offset = arm.parameters.sections[number - 1].head_offset
    poses.append(arm.point_pose(lengths, number, 1.0, (0.0, 0.0, -head_offset)))
    return np.stack([rotation for rotation, _ in poses]), np.stack([position for _, position in poses])


def bellows_lines(arm: Arm, number: int, lengths: Array, count: int) -> Array:
    """Lines through the middles of the bellows of a section, counted from 1, m, shape (bellows, count + 1, 3)."""
    section = arm.parameters.sections[number - 1]
    rotations, positions = centre_line(arm, number, lengths, count)
    spread = spread_at(section, np.arange(count + 1) / count)
    across = np.einsum("kij,bj->bki", rotations[:, :, :2], offsets_of(section, number))
    return np.asarray(positions + spread[:, None] * across)


def up_direction(arm: Arm) -> Array:
    """The direction against gravity, shape (3,); z where there is none."""
    gravity = np.asarray(arm.parameters.gravity, dtype=np.float64)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
