"""Where sensors are, as maps: lengths of bellows and wires over the coordinates, heads into a camera's frame and back.

Lengths. A line parallel to a section's centre line, at radius r and angle a about its z axis, has the length
l - r (u cos a + v sin a), u and v the bending components of the arc and l its length. In the coordinates q_k, the
lengths at ``bellows_radius`` r_b and a_k = 0, 120, 240 degrees, that is sum_k (1/3 + (2/3) (r / r_b) cos(a - a_k)) q_k:
linear, at any bending (paper, (4) and (7), solved for another place; exact for a constant curvature).

Cameras. A camera's frame has its origin at ``camera_position`` and its axes along the columns of R A, where A has the
signed axes of ``camera_axes`` as columns and R is the rotation by the vector ``camera_rotation``. What is at p in the
base frame is at (R A)^T (p - position) in the camera's. Orientations are unit quaternions (w, x, y, z) of the head's
axes in the camera's frame, (R A)^T R_head. In a mirrored (left-handed) frame no rotation says that; there the head has
mirrored axes too, those of ``camera_axes``, as everything has in a left-handed system: (R A)^T R_head A.

Signs. q and -q are the same orientation. Here a quaternion of a camera's frame is the one whose counterpart in the
base frame has w >= 0: that has w = 1 for the straight arm, however the camera is turned, so that the choice is far from
where it jumps. :meth:`CameraFrame.steady` gives measured ones that sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.parameters import ArmParameters, LengthSensorParameters, SectionParameters, SensorsParameters
from bha.parameters.section import STANDARD_ANGLES_DEG

Array = NDArray[np.float64]

_COORDINATE_ANGLES = np.radians(STANDARD_ANGLES_DEG)
# Entries this near to 0 and 1 are 0 and 1 but for rounding: a bellows at a coordinate's place is that coordinate.
_ROUNDING = 1e-12


def arc_row(angle: float, radius: float, bellows_radius: float) -> Array:
    """What the length at an angle, rad, and radius, m, of one section is of its three coordinates, shape (3,)."""
    row = 1.0 / 3.0 + 2.0 / 3.0 * (radius / bellows_radius) * np.cos(angle - _COORDINATE_ANGLES)
    nearest = np.round(row)
    exact = (np.abs(row - nearest) < _ROUNDING) & (np.abs(nearest) <= 1.0)
    return np.where(exact, nearest + 0.0, row)


def bellows_length_rows(section: SectionParameters, index: int, section_count: int) -> Array:
    """Lengths of a section's bellows as rows over the coordinates of the whole arm, shape (bellows, 3 section_count).

    Args:
        section: the section.
        index: its place in the arm, from 0.
        section_count: number of sections of the arm.
    """
    layout = section.resolved_bellows(index + 1)
    rows = np.zeros((len(layout), 3 * section_count))
    for row, bellows in zip(rows, layout, strict=True):
        row[3 * index : 3 * index + 3] = arc_row(bellows.angle, bellows.radius, section.bellows_radius)
    return rows


def wire_row(parameters: ArmParameters, sensor: LengthSensorParameters) -> Array:
    """A length sensor's arcs as a row over the coordinates, shape (3n,); its reading is this and its ``offset``."""
    row = np.zeros(3 * len(parameters.sections))
    for number in sensor.sections:
        section = parameters.sections[number - 1]
        row[3 * number - 3 : 3 * number] = arc_row(sensor.angle_rad, sensor.radius, section.bellows_radius)
    return row


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """A frame in which heads are measured. Equal to itself alone.

    Attributes:
        matrix: its axes as columns in the world, shape (3, 3): orthogonal; of determinant -1 where it is mirrored.
        position: its origin in the world, m, shape (3,).
        quaternion_map: takes quaternions (w, x, y, z) of the world to the camera's, shape (4, 4): orthogonal.
    """

    matrix: Array
    position: Array
    quaternion_map: Array

    @property
    def is_base(self) -> bool:
        """Whether it is the frame of the world itself."""
        return not self.position.any() and np.array_equal(self.matrix, np.eye(3))

    @property
    def is_mirrored(self) -> bool:
        """Whether it is left-handed."""
        return bool(np.linalg.det(self.matrix) < 0.0)

    def positions(self, positions: ArrayLike) -> Array:
        """Positions (..., 3), m, of the world in the camera's."""
        given = np.asarray(positions, dtype=np.float64)
        return given if self.is_base else _rows_by(given - self.position, self.matrix)

    def base_positions(self, positions: ArrayLike) -> Array:
        """Positions (..., 3), m, of the camera's frame in the world."""
        given = np.asarray(positions, dtype=np.float64)
        return given if self.is_base else np.asarray(given @ self.matrix.T + self.position)

    def orientations(self, quaternions: ArrayLike) -> Array:
        """Orientations (..., 4) of the world in the camera's; the sign is carried over."""
        given = np.asarray(quaternions, dtype=np.float64)
        return given if self.is_base else _rows_by(given, self.quaternion_map.T)

    def base_orientations(self, quaternions: ArrayLike) -> Array:
        """Orientations (..., 4) of the camera's frame in the world; the sign is carried over."""
        given = np.asarray(quaternions, dtype=np.float64)
        return given if self.is_base else np.asarray(given @ self.quaternion_map)

    def steady(self, quaternions: ArrayLike) -> Array:
        """Measured orientations (..., 4) of this frame as unit quaternions of the sign that the module says.

        NaN where a quaternion has no direction.
        """
        given = np.asarray(quaternions, dtype=np.float64)
        size = np.linalg.norm(given, axis=-1, keepdims=True)
        flip = np.where(given @ self.quaternion_map[:, :1] < 0.0, -1.0, 1.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.where(size > 0.0, flip * given / size, np.nan))


def camera_frame(sensors: SensorsParameters | None) -> CameraFrame:
    """The frame that a ``[sensors]`` table says; that of the world without one."""
    stated = sensors or SensorsParameters()
    axes = np.column_stack([_axis(axis) for axis in stated.camera_axes])
    turn = np.asarray(stated.camera_rotation_rad)
    angle = float(np.linalg.norm(turn))
    half = np.sinc(angle / (2.0 * np.pi)) / 2.0  # sin(angle / 2) / angle, also at 0
    rotation = np.array([np.cos(angle / 2.0), *(half * turn)])
    mirrored = np.linalg.det(axes) < 0.0
    own = quaternions_of(-axes if mirrored else axes)
    to_camera = _product_from_left(_conjugate(own)) @ _product_from_left(_conjugate(rotation))
    if mirrored:
        to_camera = to_camera @ _product_from_right(own)
    return CameraFrame(rotations_of(rotation) @ axes, np.asarray(stated.camera_position), to_camera)


def rotations_of(quaternions: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4), scalar first."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, dtype=np.float64), -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternions_of(rotations: ArrayLike) -> Array:
    """Unit quaternions (..., 4), scalar first and not negative, of rotation matrices (..., 3, 3).

    As the core has them: Shepperd's way, by the largest entry; at w = 0 the first entry that is not zero is positive.
    """
    given = np.asarray(rotations, dtype=np.float64)
    ((a, b, c), (d, e, f), (g, h, i)) = (tuple(given[..., j, k] for k in range(3)) for j in range(3))
    products = np.stack(
        [
            np.stack([1.0 + a + e + i, h - f, c - g, d - b], axis=-1),
            np.stack([h - f, 1.0 + a - e - i, b + d, c + g], axis=-1),
            np.stack([c - g, b + d, 1.0 - a + e - i, f + h], axis=-1),
            np.stack([d - b, c + g, f + h, 1.0 - a - e + i], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    first = np.take_along_axis(row, np.argmax(row != 0.0, axis=-1)[..., None], axis=-1)
    return np.asarray(np.where(first < 0.0, -row, row) / np.linalg.norm(row, axis=-1, keepdims=True) + 0.0)


def _rows_by(table: Array, matrix: Array) -> Array:
    """``table @ matrix`` as one product, shape (..., n): of a stack NumPy makes one for each of its tables."""
    return np.asarray((table.reshape(-1, table.shape[-1]) @ matrix).reshape(table.shape))


def _axis(signed: str) -> Array:
    axis = np.zeros(3)
    axis["xyz".index(signed[-1])] = -1.0 if signed.startswith("-") else 1.0
    return axis


def _conjugate(quaternion: Array) -> Array:
    return np.asarray(quaternion * np.array([1.0, -1.0, -1.0, -1.0]))


def _product_from_left(p: Sequence[float] | Array) -> Array:
    """The matrix of q -> p q."""
    w, x, y, z = p
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def _product_from_right(p: Sequence[float] | Array) -> Array:
    """The matrix of q -> q p."""
    w, x, y, z = p
    return np.array([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]])
