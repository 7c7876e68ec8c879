"""A rigid chain of nine revolute joints for pinocchio, to compare with nine lengths."""

from __future__ import annotations

from typing import Any

import numpy as np


def rigid_chain(pinocchio: Any) -> tuple[Any, Any]:
    """Model and data; joints about x, y and z in turn, 0.1 m apart."""
    model = pinocchio.Model()
    joint = 0
    for k in range(9):
        axis = [pinocchio.JointModelRX(), pinocchio.JointModelRY(), pinocchio.JointModelRZ()][k % 3]
        placement = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, 0.1]))
        joint = model.addJoint(joint, axis, placement, f"joint{k}")
        inertia = pinocchio.Inertia(0.2, np.array([0.0, 0.0, 0.05]), 1e-3 * np.eye(3))
        model.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())
    return model, model.createData()
