"""Where the arm's base stands in the world: the ``[base]`` table of a parameter file, (12) of the paper.

::

    [base]
    position = [0.0, 0.0, 1.2]
    rotation_deg = [0.0, 90.0, 0.0]

The base's z axis is that of the straight arm. Gravity, external forces, walls and anchors of effects, the camera and
the poses of heads are in the world's frame; without the table world and base are one.
"""

from __future__ import annotations

import math
from typing import Self

import numpy as np
import numpy.typing as npt
from pydantic import model_validator

from bha.parameters.base import Table, Vector3, key, table_error
from bha.parameters.provenance import ProvenanceTable, check_provenance, provenance_key


class BaseParameters(Table):
    """The ``[base]`` table: position and rotation of the base in the world."""

    position: Vector3 = key(
        "[x, y, z], numbers (m)", "the origin of the base's frame, in the world", unit="m", default=(0.0, 0.0, 0.0)
    )
    rotation: Vector3 | None = key(
        "[x, y, z], numbers (rad)",
        "rotation vector in the world, by which the base's axes are turned; give rotation or rotation_deg",
        left_out="[0, 0, 0]",
        unit="rad",
        default=None,
    )
    rotation_deg: Vector3 | None = key(
        "[x, y, z], numbers (degrees)",
        "the same in degrees; give rotation or rotation_deg",
        left_out="[0, 0, 0]",
        unit="deg",
        default=None,
    )
    provenance: ProvenanceTable = provenance_key()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.rotation is not None and self.rotation_deg is not None:
            raise table_error("found both of rotation and rotation_deg; allowed: one of them", "rotation_deg")
        stated = {name: value for name, value in self if value is not None and name != "provenance"}
        check_provenance(self.provenance, stated)
        return self

    @property
    def rotation_rad(self) -> tuple[float, float, float]:
        """Rotation vector of the base in the world, rad."""
        if self.rotation_deg is not None:
            x, y, z = self.rotation_deg
            return (math.radians(x), math.radians(y), math.radians(z))
        return self.rotation or (0.0, 0.0, 0.0)

    @property
    def rotation_matrix(self) -> npt.NDArray[np.float64]:
        """The axes of the base in the world as columns; shape (3, 3)."""
        x, y, z = self.rotation_rad
        angle = math.hypot(x, y, z)
        if angle == 0.0:
            return np.eye(3)
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / angle
        rotation: npt.NDArray[np.float64] = np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K
        return rotation

    def from_world(self, positions: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Positions (..., 3), m, of the world in the base's frame."""
        moved = np.asarray(positions, dtype=np.float64) - self.position
        return np.asarray(moved @ self.rotation_matrix)

    def in_world(self, positions: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Positions (..., 3), m, of the base's frame in the world."""
        return np.asarray(np.asarray(positions, dtype=np.float64) @ self.rotation_matrix.T + self.position)
