"""The paper's experiments (sections IV to VI) on a virtual arm: ``bha experiment all``.

``virtual_arm``: what is measured. ``laboratory``: the measurements and the arm identified from them. One module for
each figure or table, whose ``run`` returns an ``Outcome``. ``document``: the page that shows them all.
"""

from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Claim, Outcome, Table
from bha.experiments.virtual_arm import Schedule, VirtualArm, VirtualBody, VirtualSensors

__all__ = ["Claim", "Laboratory", "Outcome", "Schedule", "Table", "VirtualArm", "VirtualBody", "VirtualSensors"]
