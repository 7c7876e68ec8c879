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


def tilting_to_and_fro(arm: Arm, *, rate: float = 1.0, times: int = 4) -> Schedule:
    """Fig. 13: bellows 1 of section 1 tilts it ``times`` times, ``rate`` times a second, smoothly."""
    end = 1.0 + times / rate
    time = np.concatenate([[0.0], np.linspace(1.0, end, 50 * times + 1), [end + 2.0]])
    wave = 0.5 - 0.5 * np.cos(2 * np.pi * rate * (np.clip(time, 1.0, end) - 1.0))
    return _corners(arm, [(float(t), 0.45 * float(w), 0.0) for t, w in zip(time, wave, strict=True)])


def _corners(arm: Arm, corners: list[tuple[float, float, float]]) -> Schedule:
    """Corners (time, pressure of bellows 1, pressure of bellows 2 and 3 of section 1), bar gauge."""
    table = np.array([(0.0, *corners[0][1:]), *corners])
    levels = np.full((len(table), len(arm.inputs)), EXTENDED)
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
