"""Homogeneous transformations (5) and rotation rates (22)-(24): the little algebra that every equation here uses.

A pose is a 4x4 matrix H = [[R, o], [0, 1]]; positions carry a fourth component 1, forces and directions a 0 (the
paper's footnote 3). Rotation rates are in the base frame.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def along_z(distance: float) -> Array:
    """Homogeneous translation along z; shape (4, 4)."""
    H = np.eye(4)
    H[2, 3] = distance
    return H


def rotation_part(H: Array) -> Array:
    """R of one pose (4, 4) or of a stack of them or of their derivatives (..., 4, 4); shape (..., 3, 3)."""
    return H[..., :3, :3]


def rate_operator(skew: Array) -> Array:
    """Equations (22) and (23): the linear operator Gamma, which reads w out of [w]x; (..., 3, 3) -> (..., 3).

    It takes the elements (3,2), (1,3) and (2,1), the diagonal of a product with two permutations in the paper.
    """
    return np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)


def rotation_rate(H: Array, H_dot: Array) -> Array:
    """Equation (24): w = Gamma(R' R^T), rad/s in the base frame; H_dot may be a stack of derivatives (..., 4, 4)."""
    return rate_operator(rotation_part(H_dot) @ rotation_part(H).T)


def inertia_in_base_frame(H: Array, inertia_tensor: Array) -> Array:
    """Equation (39): R J R^T of a tensor J given in the head frame; shape (3, 3), kg m^2."""
    R = rotation_part(H)
    return R @ inertia_tensor @ R.T
