"""Setup faults: what users get wrong before any physics is to blame.

Tubes swapped, sensors swapped, the azimuth of a section 15 to 60 degrees off, gravity's sign, gauge read as absolute, a
camera mirrored. A fault changes the log's columns or the file; the arm is innocent.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .arms import TrueArm

KINDS = ("tubes_swapped", "sensors_swapped", "azimuth", "gravity_sign", "gauge_as_absolute", "camera_mirrored")


@dataclass(frozen=True)
class Fault:
    """A setup fault: its kind, where it sits, and its numbers."""

    kind: str
    where: str
    swap: tuple[str, str] | None = None
    angle: float = 0.0

    def summary(self) -> dict[str, Any]:
        """For the sealed answer."""
        return {"kind": self.kind, "where": self.where, "swap": self.swap, "angle": self.angle}


def feasible(kind: str, sections: int, sensors: str) -> bool:
    """Whether such an arm under such sensors can have the fault and show it."""
    heads = sensors in ("heads", "poses")
    if kind in ("azimuth", "camera_mirrored"):
        return heads
    if kind == "sensors_swapped":
        return not heads or sections > 1
    return True


def draw_fault(rng: np.random.Generator, kind: str, arm: TrueArm, channels: tuple[str, ...]) -> Fault:
    """Draw where a fault sits; ``channels`` are the names of the sensors' columns."""
    if kind == "tubes_swapped":
        a, b = rng.choice(len(arm.inputs), 2, replace=False)
        pair = (arm.inputs[int(a)], arm.inputs[int(b)])
        return Fault(kind, f"input {pair[0]}, input {pair[1]}", pair)
    if kind == "sensors_swapped":
        if channels[0][0] == "x":
            bodies = sorted({name[1:] for name in channels})
            a, b = rng.choice(len(bodies), 2, replace=False)
            pair = (bodies[int(a)], bodies[int(b)])
            return Fault(kind, f"head {pair[0]}, head {pair[1]}", pair)
        a, b = rng.choice(len(channels), 2, replace=False)
        pair = (channels[int(a)], channels[int(b)])
        return Fault(kind, ", ".join(pair), pair)
    if kind == "azimuth":
        i = int(rng.integers(len(arm.sections)))
        angle = float(np.deg2rad(rng.uniform(15.0, 60.0)) * rng.choice([-1.0, 1.0]))
        return Fault(kind, f"section {i + 1}", None, angle)
    return Fault(kind, "all")


def _body(name: str) -> str:
    """The number in the name of a head's coordinate, ``x2`` or ``ow2``."""
    return name[2:] if name[0] == "o" else name[1:]


def swapped(names: tuple[str, ...], fault: Fault | None) -> list[int]:
    """Order in which columns are written under their names: two of them changed places where the fault says so."""
    order = list(range(len(names)))
    if fault is None or fault.swap is None:
        return order
    other = dict([fault.swap, fault.swap[::-1]])
    for k, name in enumerate(names):
        if name in other:
            order[k] = names.index(other[name])
        elif fault.kind == "sensors_swapped" and name[0] in "xyzo" and _body(name) in other:
            body = _body(name)
            order[k] = names.index(name[: -len(body)] + other[body])
    return order
