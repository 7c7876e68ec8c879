"""Logs of the virtual arm as estimation takes them, and arms with some keys changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.estimation.records import Record, record
from bha.estimation.stretches import Stretch, stretch_between, stretch_of
from bha.experiments.virtual_arm import Schedule
from bha.identification.swing import FreeSwing, free_swing, simulated_swing
from bha.logs import Log
from bha.parameters import ArmParameters
from bha.recordings import Recording
from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]

#: What is averaged of each hold: its last part, s.
STEADY = 0.5
#: How long the rest is measured at the end of a swing, s.
AFTER = 1.0


def with_sections(arm: Arm, changes: Sequence[Mapping[str, Any]], name: str) -> Arm:
    """The arm with some keys of each section changed; provenance of what changes is dropped."""
    mapping = arm.parameters.to_mapping()
    mapping["name"] = name
    for table, change in zip(mapping["section"], changes, strict=True):
        for key, value in change.items():
            table.get("provenance", {}).pop(key, None)
            if value is None:
                table.pop(key, None)
            else:
                table[key] = value
    return Arm(ArmParameters.from_mapping(mapping, origin=name))


def recorded(arm: Arm, log: Log, name: str) -> Record:
    """A log as estimation sees it."""
    return record(arm, Recording(arm, log, pressures="measured", name=name, warn=False))


def seen(arm: Arm, log: Log) -> Trajectory:
    """A log as the arm sees it: pressures, and the coordinates that its lengths tell."""
    return Recording(arm, log, pressures="measured", warn=False).as_trajectory()


def holds(rec: Record, schedule: Schedule) -> list[Stretch]:
    """The last part of each hold of a schedule."""
    return [stretch_between(rec, end - STEADY, end) for end in schedule.time[1::2]]


def after_release(rec: Record, release: float) -> Stretch:
    """What is left of a record from the release on."""
    return stretch_of(rec, int(np.searchsorted(rec.time, release)), len(rec))


def swing_from_release(arm: Arm, log: Log, release: float) -> tuple[FreeSwing, Trajectory]:
    """The swing of an arm that rests until its release, and what was measured from there on."""
    rec = recorded(arm, log, "swing")
    stretch = after_release(rec, release)
    return free_swing(arm, rec, stretch, at_rest=True), seen(arm, log)[stretch.first :]


def lateral(swing: FreeSwing) -> Array:
    """Lateral deflection x of every measured head from where it comes to rest, (m, n), m."""
    x = swing.heads[:, :, 0]
    return np.asarray(x - x[swing.time > swing.time[-1] - AFTER].mean(axis=0))


def simulated(arm: Arm, swing: FreeSwing) -> tuple[Array, Array, Array]:
    """Times (m,), lateral deflections of all heads from their rest (m, n) and lengths (m, 3n) of the model's swing."""
    time, heads, lengths = simulated_swing(arm, swing)
    start = swing.state[: len(swing.state) // 2]
    rest = arm.forward_kinematics(arm.static_lengths(swing.pressures, start=start))[0][:, 0]
    return time, heads[:, :, 0] - rest, lengths
