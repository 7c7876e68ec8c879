"""The arm: what a parameter file says, and the model computed from it by the core.

``arm``: the class. ``derivatives``: of its dynamics, by anything. ``geometry``: where bellows, wires and cameras are.
``wrench``: what acts on it from outside.
"""

from bha.arm.arm import Arm
from bha.arm.wrench import Wrench

__all__ = ["Arm", "Wrench"]
