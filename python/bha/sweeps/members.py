"""From what a run draws to what is simulated: its arm, its input, its initial state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError, ParameterError
from bha.parameters.paths import with_values
from bha.runs.input import Input
from bha.sweeps.plan import Plan
from bha.sweeps.targets import Target

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Member:
    """A run that can be simulated.

    Attributes:
        arm: its arm.
        log: the place of its input among the plan's.
        drive: its input.
        rest: the input under whose first pressures it starts at rest; None where lengths are given.
    """

    arm: Arm
    log: int
    drive: Input
    rest: Input | None


def member(plan: Plan, draw: Array) -> Member:
    """The run that draws these numbers, one a variable.

    Raises:
        ParameterError, InputError: what it drew is not allowed.
    """
    log = next((int(x) for target, x in zip(plan.targets, draw, strict=True) if target.kind == "log"), 0)
    drive = _driven(plan, plan.inputs[log], draw)
    return Member(_arm(plan, log, draw), log, drive, _rest(plan, drive, draw))


def deviations(plan: Plan, draws: Array) -> Array | None:
    """What is added to the initial lengths and rates of some runs, shape (runs, 6n); None if nothing ever is."""
    velocities = plan.spec.initial.velocities
    columns = 3 * plan.arm.section_count
    chosen = [
        (number, int(target.places[0]) + (columns if target.kind == "initial_velocity" else 0))
        for number, target in enumerate(plan.targets)
        if target.kind in ("initial_length", "initial_velocity")
    ]
    if velocities is None and not chosen:
        return None
    added = np.zeros((len(draws), 2 * columns))
    if velocities is not None:
        added[:, columns:] = velocities
    for number, column in chosen:
        added[:, column] += draws[:, number]
    return added


def _arm(plan: Plan, log: int, draw: Array) -> Arm:
    values: dict[str, float] = {}
    for target, number in zip(plan.targets, draw, strict=True):
        if target.kind == "parameter":
            values |= _values(target, float(number))
    if not values:
        return plan.standing[log]
    return plan.beginnings[log].taken_by(Arm(with_values(plan.arm.parameters, values)))


def _values(target: Target, number: float) -> dict[str, float]:
    bases: Sequence[float] = target.bases or (1.0,) * len(target.places)
    return {str(path): base * number for path, base in zip(target.places, bases, strict=True)}


def _driven(plan: Plan, drive: Input, draw: Array) -> Input:
    """The input with its factors and additions; the very same one where there are none, so that runs share it."""
    count = len(plan.arm.inputs)
    factor, added = np.ones(count), np.zeros(count)
    varied = False
    for target, number in zip(plan.targets, draw, strict=True):
        if target.kind in ("amplitude", "offset"):
            varied = True
            columns = [int(place) for place in target.places]
            if target.kind == "amplitude":
                factor[columns] *= number
            else:
                added[columns] += number
    if not varied:
        return drive
    ambient = plan.arm.parameters.ambient_pressure
    pressures = ambient + factor * (drive.pressures - ambient) + added
    _check_pressures(plan, pressures, "the input")
    return replace(drive, pressures=pressures)


def _rest(plan: Plan, drive: Input, draw: Array) -> Input | None:
    initial = plan.spec.initial
    if initial.lengths is not None:
        return None
    pressures = np.array(drive.pressures[0] if initial.pressures is None else initial.pressures, dtype=np.float64)
    changed = initial.pressures is not None
    for target, number in zip(plan.targets, draw, strict=True):
        if target.kind == "initial_pressure":
            pressures[int(target.places[0])] += number
            changed = True
    if not changed:
        return drive
    _check_pressures(plan, pressures[None, :], "the initial state")
    forces = None if drive.forces is None else np.repeat(drive.forces[:1], 2, axis=0)
    start = float(drive.time[0])
    time, both = np.array([start, start + 1.0]), np.vstack([pressures, pressures])
    return Input(time, both, forces, drive.commanded, drive.interpolation)


def _check_pressures(plan: Plan, pressures: Array, where: str) -> None:
    if pressures.min() < 0.0:
        column = int(np.argmin(pressures.min(axis=0)))
        name = plan.arm.inputs[column]
        raise InputError(f"{where} has {pressures[:, column].min():g} Pa at {name}; allowed: a number >= 0, absolute")


#: What a run may raise that drew something that is not allowed.
NOT_ALLOWED = (ParameterError, InputError)
