"""The arm: what a parameter file says, and the model computed from it by the core.

``arm``: the class. ``derivatives``: of its dynamics, by anything. ``geometry``: where bellows, wires and cameras are.
"""

from bha.arm.arm import Arm

__all__ = ["Arm"]
