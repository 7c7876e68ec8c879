"""What is done to the arm in each measurement. Pressures in bar here, gauge; Pa absolute in the schedules."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.experiments.virtual_arm import Schedule

BAR = 1e5

#: Both extended sections in Figs. 12 and 13, bar gauge.
EXTENDED = 0.5


def even_elongation(arm: Arm, *, hold: float = 2.0, ramp: float = 1.0) -> Schedule:
    """Fig. 8: all bellows evenly from -0.3 to 1.0 bar and back, so that no section bends."""
    up = np.array([-0.3, -0.1, 0.1, 0.3, 0.5, 0.7, 0.85, 1.0])
    steps = np.concatenate([up, up[-2::-1]])
    return Schedule.holds(_absolute(arm, np.tile(steps[:, None], len(arm.inputs))), hold, ramp)


def bending(arm: Arm, section: int, *, hold: float = 2.0, ramp: float = 1.0) -> Schedule:
    """Fig. 9: in one section bellows 2 and 3 evenly against bellows 1, to both sides; the others straight."""
    quarter = np.array([0.15, 0.3, 0.45, 0.6, 0.45, 0.3, 0.15])
    steps = np.concatenate([[0.0], quarter, [0.0], -quarter, [0.0]])
    levels = np.full((len(steps), len(arm.inputs)), 0.3)
    first = 3 * (section - 1)
    levels[:, first] -= 2 / 3 * steps
    levels[:, first + 1 : first + 3] += steps[:, None] / 3
    return Schedule.holds(_absolute(arm, levels), hold, ramp)


def swing(arm: Arm, *, force: float = 10.0, free: float = 6.0) -> Schedule:
    """Fig. 10: a force along x at the tool loses contact; pressures stay as they are."""
    time = np.array([0.0, 0.5, 0.5, 0.5 + free])
    forces = np.zeros((4, arm.section_count, 3))
    forces[:2, -1, 0] = force
    levels = np.full((4, len(arm.inputs)), 0.3)
    return Schedule(time, _absolute(arm, levels), forces)


def tilt(arm: Arm) -> Schedule:
    """Fig. 12: pressure of bellows 1 of section 1, then of all of section 1; the other sections are extended."""
    return _corners(arm, [(1.0, 0.0, 0.0), (1.5, 0.45, 0.0), (4.0, 0.45, 0.0), (4.5, 0.45, 0.45), (7.0, 0.45, 0.45),
                          (7.5, 0.0, 0.0), (10.0, 0.0, 0.0)])  # fmt: skip


def tilt_of_one_bellows(arm: Arm) -> Schedule:
    """Fig. 13: section 1 is tilted by its bellows 1, there and back and there again."""
    return _corners(arm, [(1.0, 0.0, 0.0), (1.4, 0.45, 0.0), (3.0, 0.45, 0.0), (3.4, 0.0, 0.0), (5.0, 0.0, 0.0),
                          (6.0, 0.5, 0.0), (8.0, 0.5, 0.0)])  # fmt: skip


def _corners(arm: Arm, corners: list[tuple[float, float, float]]) -> Schedule:
    """Corners (time, pressure of bellows 1, pressure of bellows 2 and 3 of section 1), bar gauge."""
    levels = np.full((len(corners) + 1, len(arm.inputs)), EXTENDED)
    table = np.array([(0.0, *corners[0][1:]), *corners])
    levels[:, 0], levels[:, 1], levels[:, 2] = table[:, 1], table[:, 2], table[:, 2]
    return Schedule(table[:, 0], _absolute(arm, levels))


def _absolute(arm: Arm, gauge_bar: NDArray[np.float64]) -> NDArray[np.float64]:
    parameters = arm.parameters
    pressures = parameters.ambient_pressure + BAR * gauge_bar
    lowest = max(section.pressure_range[0] for section in parameters.sections)
    highest = min(section.pressure_range[1] for section in parameters.sections)
    if pressures.min() < lowest or pressures.max() > highest:
        raise InputError(
            f"{arm.name}: this experiment needs {pressures.min():.0f} to {pressures.max():.0f} Pa; "
            f"its pressure_range allows {lowest:.0f} to {highest:.0f} Pa"
        )
    return np.asarray(pressures)
