"""From lengths or head positions to how each section is bent and how long it is.

What: the bending w = u + i v, rad, and the mean length l, m, of each section. In these, what a section does is a linear
map of its pressures to good approximation, and turning or mirroring the section, its camera or its numbering turns or
mirrors w.
Frame: w in the frame of the section's base.
Source: docs/explanation/model.md, "Coordinates and pose". A head at p = (x, y, z) in the frame of its section's base,
after a rigid piece h, is bent by psi with tan(psi / 2) = |(x, y)| / (z - base_offset + h) about the normal of (x, y):
the chord of an arc makes half of its angle. Closed form, no iteration.
Validity: constant curvature; heads up to half a turn.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def length_rows(radius: float, angle: float) -> Array:
    """How a length at some radius and angle follows from (u, v, l) of its section: l - r (u cos + v sin)."""
    return np.array([-radius * np.cos(angle), -radius * np.sin(angle), 1.0])


def from_lengths(
    lengths: Array, angles: Sequence[float] | Array, radii: Sequence[float] | Array
) -> tuple[Complex, Array]:
    """Bending and mean length of a section out of three or more of its lengths, shapes (..., k), by least squares."""
    rows = np.array([length_rows(r, a) for r, a in zip(radii, angles, strict=True)])
    solved = np.asarray(lengths) @ np.linalg.pinv(rows).T
    return solved[..., 0] + 1j * solved[..., 1], solved[..., 2]


def from_heads(heads: Array, base_offset: Array, head_offset: Array) -> tuple[Complex, Array]:
    """Bending (..., n) and mean length (..., n) of n sections out of all their head positions (..., n, 3)."""
    shape, n = heads.shape[:-2], heads.shape[-2]
    rotation = np.broadcast_to(np.eye(3), (*shape, 3, 3))
    origin = np.zeros((*shape, 3))
    bending = np.empty((*shape, n), dtype=np.complex128)
    length = np.empty((*shape, n))
    for i in range(n):
        local = np.einsum("...ji,...j->...i", rotation, heads[..., i, :] - origin)
        side = local[..., 0] + 1j * local[..., 1]
        rise, piece = local[..., 2] - base_offset[i], float(head_offset[i])
        psi = 2.0 * np.arctan2(np.abs(side), rise + piece)
        chord = np.hypot(np.abs(side) - piece * np.sin(psi), rise - piece * np.cos(psi))
        length[..., i] = chord / np.sinc(psi / (2.0 * np.pi))
        bending[..., i] = psi * np.exp(1j * np.angle(side))
        rotation = rotation @ rotations(bending[..., i])
        origin = heads[..., i, :]
    return bending, length


def to_heads(bending: Complex, length: Array, base_offset: Array, head_offset: Array) -> Array:
    """Head positions (..., n, 3) of sections bent by ``bending`` (..., n) of mean length ``length`` (..., n)."""
    shape, n = bending.shape[:-1], bending.shape[-1]
    rotation = np.broadcast_to(np.eye(3), (*shape, 3, 3))
    origin = np.zeros((*shape, 3))
    heads = np.empty((*shape, n, 3))
    for i in range(n):
        psi = np.abs(bending[..., i])
        # (1 - cos psi) / psi^2 is half the square of sin(psi / 2) / (psi / 2): no difference of near numbers.
        lift = 0.5 * np.sinc(psi / (2.0 * np.pi)) ** 2
        arc = (
            np.stack([bending[..., i].real * lift, bending[..., i].imag * lift, np.sinc(psi / np.pi)], axis=-1)
            * length[..., i, None]
        )
        arc[..., 2] += base_offset[i]
        turned = rotations(bending[..., i])
        arc = arc + head_offset[i] * turned[..., :, 2]
        origin = origin + np.einsum("...ij,...j->...i", rotation, arc)
        rotation = rotation @ turned
        heads[..., i, :] = origin
    return heads


def rotations(bending: Complex) -> Array:
    """Rotation matrices (..., 3, 3) of heads against the bases of sections bent by ``bending`` (...)."""
    u, v = bending.real, bending.imag
    psi = np.abs(bending)
    b, a, c = 0.5 * np.sinc(psi / (2.0 * np.pi)) ** 2, np.sinc(psi / np.pi), np.cos(psi)
    return np.stack(
        [
            np.stack([1.0 - u * u * b, -u * v * b, u * a], axis=-1),
            np.stack([-u * v * b, 1.0 - v * v * b, v * a], axis=-1),
            np.stack([-u * a, -v * a, c], axis=-1),
        ],
        axis=-2,
    )
