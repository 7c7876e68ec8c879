"""Bodies of revolution and where many copies of one stand: what the picture of an arm is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles.

    Attributes:
        vertices: shape (v, 3).
        faces: indices of three vertices each, seen from outside against the clock, shape (f, 3).
    """

    vertices: Array
    faces: Faces


@dataclass(frozen=True, eq=False)
class Solids:
    """Copies of one mesh: scaled along its own axes, then turned, then moved.

    Attributes:
        positions: m, shape (k, 3).
        rotations: shape (k, 3, 3).
        scales: shape (k, 3).
    """

    positions: Array
    rotations: Array
    scales: Array

    def __len__(self) -> int:
        """Number of copies, k."""
        return len(self.positions)

    def placed(self, mesh: Mesh) -> Array:
        """The vertices of all copies, m, shape (k, v, 3)."""
        scaled = mesh.vertices * self.scales[:, None, :]
        return np.asarray(scaled @ self.rotations.transpose(0, 2, 1) + self.positions[:, None, :])


def together(parts: Sequence[Solids]) -> Solids:
    """All copies of several, one after the other."""
    return Solids(*(np.concatenate([getattr(part, name) for part in parts]) for name in Solids.__dataclass_fields__))


def turned(profile: Sequence[tuple[float, float]], sides: int) -> Mesh:
    """The body that a profile makes when it is turned about z.

    Args:
        profile: radius and z of its points, z not decreasing; closed only where it begins and ends at radius 0.
        sides: corners of its cross section.
    """
    radius, z = np.asarray(profile, dtype=np.float64).T
    around = np.arange(sides) * (2.0 * np.pi / sides)
    circle = np.stack([np.cos(around), np.sin(around)], axis=-1)
    rings = np.concatenate(
        [radius[:, None, None] * circle, np.broadcast_to(z[:, None, None], (len(z), sides, 1))], axis=-1
    )
    k = np.arange(sides)
    low, high = k, (k + 1) % sides
    faces = []
    for ring in range(len(z) - 1):
        a, b = ring * sides, (ring + 1) * sides
        if radius[ring] > 0.0:
            faces.append(np.stack([a + low, a + high, b + low], axis=-1))
        if radius[ring + 1] > 0.0:
            faces.append(np.stack([a + high, b + high, b + low], axis=-1))
    return Mesh(rings.reshape(-1, 3), np.concatenate(faces))


def convolution(sides: int = 16, rings: int = 4) -> Mesh:
    """One fold of a bellows: crest of radius 1 in the middle, roots at z = -1/2 and 1/2, where the next one begins."""
    z = np.linspace(-0.5, 0.5, rings + 1)
    return turned([(0.86 + 0.14 * np.cos(2.0 * np.pi * at), at) for at in z], sides)


def cylinder(sides: int = 32, rings: int = 1) -> Mesh:
    """A cylinder of radius 1 from z = -1/2 to 1/2, closed; the lids of so many rings."""
    radii = np.linspace(0.0, 1.0, rings + 1)
    return turned([*((r, -0.5) for r in radii), *((r, 0.5) for r in radii[::-1])], sides)


def ball(sides: int = 12, rings: int = 6) -> Mesh:
    """A ball of radius 1."""
    polar = np.linspace(0.0, np.pi, rings + 1)
    profile = [(float(np.sin(a)), float(-np.cos(a))) for a in polar]
    profile[0], profile[-1] = (0.0, -1.0), (0.0, 1.0)
    return turned(profile, sides)
