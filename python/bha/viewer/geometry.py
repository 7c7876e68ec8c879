"""The shape of an arm as bodies: folds of its bellows, plates and rigid pieces, from its lengths.

A bellows is drawn as a row of folds (convolutions) along its own line, which is parallel to the centre line of its
section at the place that the file says; each reaches from one point of that line to the next, so that together they are
as long as the bellows. Radii are those of the file. How many folds there are is not in the file and is chosen for the
eye. Where they run says :mod:`bha.arm.bodies`.

Frames: lengths and positions in m, in the world.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.arm.bodies import centre_line, offsets_of, spread_at
from bha.viewer.solids import Solids, together

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.parameters import SectionParameters

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Height of a fold at rest over its radius, and how many folds a bellows has; most of all bellows together.
FOLD_HEIGHT, FEWEST_FOLDS, MOST_FOLDS, MOST_FOLDS_OF_ALL = 0.45, 5, 24, 3000
#: Of the plates at both ends of a section: thickness over the radius of a bellows. Of rigid pieces: radius over theirs.
PLATE_THICKNESS, PIECE_RADIUS = 0.3, 0.6
#: Of the base: radius over that of the first plate, thickness over the radius of a bellows.
BASE_RADIUS, BASE_THICKNESS = 1.25, 0.8


@dataclass(frozen=True, eq=False)
class SectionLayout:
    """What of a section's picture stays when it moves.

    Attributes:
        number: of the section, from 1.
        offsets: places of its bellows in its cross section, m, shape (bellows, 2).
        radii: of its bellows, m, shape (bellows,).
        inputs: for each bellows the index of its input, shape (bellows,).
        spread: for each fold how far bellows are from the centre line there, relative to ``offsets``, shape (folds,).
        plate_radius: of its plates, m.
        base_offset: length of the rigid piece before the bellows, m.
        head_offset: of that after them, m.
    """

    number: int
    offsets: Array
    radii: Array
    inputs: Indices
    spread: Array
    plate_radius: float
    base_offset: float
    head_offset: float


@dataclass(frozen=True, eq=False)
class Layout:
    """What of an arm's picture stays when it moves.

    Attributes:
        arm: the arm.
        sections: of each section.
        fold_inputs: for each fold of the picture the index of the input that feeds it, shape (folds of all,).
    """

    arm: Arm
    sections: tuple[SectionLayout, ...]
    fold_inputs: Indices

    @property
    def reach(self) -> float:
        """Length of the arm with all sections at their longest, m."""
        return sum(section.greatest_length for section in self.arm.parameters.sections)

    @property
    def size(self) -> float:
        """Length of the arm at rest lengths, m."""
        return sum(s.rest_length + s.base_offset + s.head_offset for s in self.arm.parameters.sections)

    @property
    def width(self) -> float:
        """Greatest radius of a plate, m."""
        return max(section.plate_radius for section in self.sections)


@dataclass(frozen=True, eq=False)
class Picture:
    """The bodies of an arm in one pose.

    Attributes:
        folds: of all bellows; see :func:`bha.viewer.solids.convolution`.
        plates: the base, then plates and rigid pieces; see :func:`bha.viewer.solids.cylinder`.
        heads: positions of the heads, m, shape (n, 3).
        head_rotations: their axes as columns, shape (n, 3, 3).
    """

    folds: Solids
    plates: Solids
    heads: Array
    head_rotations: Array


def layout_of(arm: Arm) -> Layout:
    """What of an arm's picture stays when it moves."""
    sections = arm.parameters.sections
    bellows = sum(len(section.resolved_bellows(number)) for number, section in enumerate(sections, start=1))
    most = min(MOST_FOLDS, max(1, MOST_FOLDS_OF_ALL // bellows))
    found = tuple(_section(arm, number, section, most) for number, section in enumerate(sections, start=1))
    inputs = [np.tile(section.inputs, len(section.spread)) for section in found]
    return Layout(arm, found, np.concatenate(inputs))


def _section(arm: Arm, number: int, section: SectionParameters, most: int) -> SectionLayout:
    bellows = section.resolved_bellows(number)
    offsets = offsets_of(section, number)
    if section.bellows_outer_radius is not None:
        radii = np.full(len(bellows), section.bellows_outer_radius)
    else:
        # The file does not say. As wide as a piston of that area, but not into the neighbour.
        apart = np.linalg.norm(offsets[:, None] - offsets[None], axis=-1)
        room = np.min(apart[apart > 0.0], initial=np.inf) / 2.0
        radii = np.minimum(np.sqrt(np.array([b.terminal_area for b in bellows]) / np.pi), room)
    radius = float(radii.max())
    folds = int(np.clip(round(section.rest_length / (FOLD_HEIGHT * radius)), min(FEWEST_FOLDS, most), most))
    return SectionLayout(
        number=number,
        offsets=offsets,
        radii=radii,
        inputs=np.array([arm.inputs.index(b.input) for b in bellows]),
        spread=spread_at(section, (np.arange(folds) + 0.5) / folds),
        plate_radius=float(np.max(np.linalg.norm(offsets, axis=-1) + radii)),
        base_offset=section.base_offset,
        head_offset=section.head_offset,
    )


def picture(layout: Layout, lengths: Array) -> Picture:
    """The bodies of the arm at some lengths (the 3n coordinates), m, shape (3n,).

    Raises:
        InputError: another shape, or a value that is not finite.
    """
    folds, plates = [], []
    for section in layout.sections:
        rotations, positions = centre_line(layout.arm, section.number, lengths, len(section.spread))
        folds.append(_folds(section, rotations, positions))
        plates.append(_plates(section, rotations, positions))
    heads, turns = layout.arm.forward_kinematics(lengths)
    return Picture(together(folds), together([_base(layout), *plates]), heads, turns)


def _folds(section: SectionLayout, rotations: Array, positions: Array) -> Solids:
    """Fold by fold, in each all bellows: from a point of the bellows' line to the next one."""
    places = section.spread[:, None, None] * section.offsets  # (folds, bellows, 2)
    begin = positions[:-1, None] + np.einsum("kij,kbj->kbi", rotations[:-1, :, :2], places)
    end = positions[1:, None] + np.einsum("kij,kbj->kbi", rotations[1:, :, :2], places)
    along = end - begin
    height = np.linalg.norm(along, axis=-1, keepdims=True)
    across = np.broadcast_to((rotations[:-1, :, 0] + rotations[1:, :, 0])[:, None], along.shape)
    z = along / np.maximum(height, 1e-12)
    x = across - np.sum(across * z, axis=-1, keepdims=True) * z
    x = x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-12)
    axes = np.stack([x, np.cross(z, x), z], axis=-1)
    radii = np.broadcast_to(section.radii[:, None], height.shape)
    scales = np.concatenate([radii, radii, height], axis=-1)
    return Solids(((begin + end) / 2.0).reshape(-1, 3), axes.reshape(-1, 3, 3), scales.reshape(-1, 3))


def _plates(section: SectionLayout, rotations: Array, positions: Array) -> Solids:
    """Plates at both ends of the bending part and the rigid pieces outside of them."""
    thickness = PLATE_THICKNESS * float(section.radii.max())
    radius, thin = section.plate_radius, PIECE_RADIUS * section.plate_radius
    made = []
    for rotation, position, length, way in (
        (rotations[0], positions[0], section.base_offset, -1.0),
        (rotations[-1], positions[-1], section.head_offset, 1.0),
    ):
        z = rotation[:, 2]
        made.append((position + way * min(thickness, length) / 2.0 * z, rotation, (radius, radius, thickness)))
        if length > 0.0:
            made.append((position + way * length / 2.0 * z, rotation, (thin, thin, length)))
    return Solids(*(np.array([entry[k] for entry in made], dtype=np.float64) for k in range(3)))


def _base(layout: Layout) -> Solids:
    """What the arm stands on or hangs from."""
    first = layout.sections[0]
    thickness, radius = BASE_THICKNESS * float(first.radii.max()), BASE_RADIUS * first.plate_radius
    rotation, position = base_frame(layout.arm)
    middle = position - thickness / 2.0 * rotation[:, 2]
    return Solids(middle[None], rotation[None], np.array([[radius, radius, thickness]]))


def base_frame(arm: Arm) -> tuple[Array, Array]:
    """Axes (3, 3) as columns and origin (3,), m, of the base in the world."""
    base = arm.parameters.base
    return (np.eye(3), np.zeros(3)) if base is None else (base.rotation_matrix, np.asarray(base.position, dtype=float))


def axes_with_z(z: Array) -> Array:
    """Axes (3, 3) as columns of a right-handed frame with this z axis, shape (3,), of length 1."""
    x = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=-1)
