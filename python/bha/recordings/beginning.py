"""How an arm stands where a log begins, and what held it there.

Fabric and rubber creep and stick: under the same pressures an arm stands elsewhere after each use, by more than its
sensors' noise and than any law from pressures to poses says. Which rest it begins from is told by a log's first pose,
where it begins at rest. What: the constant force and torques of each section (effect ``preload``) under which that pose
is held by the first pressures,

    Q = -M(q0) q''(q0, 0, p0),

read on the arc coordinates of each section. They follow from the arm and one pose, so that a fit has no number more,
and a log that takes no part in it is simulated in the same way. An arm that has a ``preload`` in some sections takes it
from each log that begins at rest (:class:`Beginning`); else its own numbers count. Of an arm that slips inside they are
what its slipping elements do not hold (:mod:`bha.recordings.strained`).
Limits: commands do not say what the chambers held before the log, so under commands the first one must have been held,
or be one that the log comes back to (:mod:`bha.recordings.first_command`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.arm import Arm
from bha.parameters import ArmParameters, Place
from bha.recordings.first_command import stood_under
from bha.recordings.outputs import Observation, Output
from bha.recordings.pose import pose
from bha.recordings.recording import Recording
from bha.recordings.strained import one_a_bellows, slips, strains, with_starts
from bha.runs.input import Input

Array = NDArray[np.float64]

KIND = "preload"
#: Numbers of the effect: on (u, v, l).
NUMBERS = ("to_x", "to_y", "along")
#: Deviation of a measured first pose against that which the pressures hold, m: what is measured decides.
_SURE = 1e-4
_H = math.sqrt(3.0) / 2.0


@dataclass(frozen=True, eq=False)
class Resting:
    """An arm that stands where a log begins.

    Attributes:
        values: the channels, shape (C,); NaN where nothing was measured.
        pressures: Pa, shape (inputs,).
    """

    values: Array
    pressures: Array


#: Time over which an arm at rest does not move, s, and which part of the greatest motion and how many noises do not
#: count as one.
_LOOK, _STILL, _NOISES = 0.06, 0.02, 5.0


def beginning(recording: Recording, kept: Sequence[int]) -> tuple[Resting | None, Input]:
    """Where the arm stands when a recording begins, in some of its outputs, and what drives it from there."""
    drive, stands = recording.drive, _resting(recording, kept)
    if stands is None or not drive.commanded:
        return stands, drive
    seen = np.where(recording.usable, recording.measured, np.nan)[:, kept]
    told = stood_under(drive, recording.time, seen, stands.values)
    return (None, drive) if told is None else (replace(stands, pressures=told.pressures[0]), told)


def _resting(recording: Recording, kept: Sequence[int]) -> Resting | None:
    """Where the arm stands when a log begins; None where it moves, or nothing is measured there."""
    time, drive = recording.time, recording.drive
    measured, usable = recording.measured[:, kept], recording.usable[:, kept]
    near = slice(0, max(2, int(np.searchsorted(time, time[0] + _LOOK, side="right"))))
    first = np.where(usable, measured, np.nan)[near]
    seen = np.isfinite(first).any(axis=0)
    if not seen.any():
        return None
    every = np.where(usable, measured, np.nan)[:, seen]
    motion = float(np.max(np.nanmax(every, axis=0) - np.nanmin(every, axis=0)))
    moves = np.nanmax(first[:, seen], axis=0) - np.nanmin(first[:, seen], axis=0)
    noise = np.array([recording.facts[k].noise for k in kept])[seen]
    if np.any(moves > np.maximum(_STILL * motion, _NOISES * noise)):
        return None
    values = np.full(len(kept), np.nan)
    values[seen] = np.nanmean(first[:, seen], axis=0)
    there = np.linspace(time[0], time[near][-1], 5)
    pressures = [np.interp(there, drive.time, p).mean() for p in drive.pressures.T]
    return Resting(values, np.array(pressures))


def preloaded(parameters: ArmParameters) -> dict[int, int]:
    """Number of each preload of a single section among the arm's effects -> number of its section."""
    found = {}
    for number, effect in enumerate(parameters.effects, start=1):
        place = Place.read(effect.where)
        if effect.kind == KIND and place is not None and place.section is not None:
            found[number] = place.section
    return found


def holding(arm: _core.Arm, radii: Sequence[float], sections: Sequence[int], lengths: Array, pressures: Array) -> Array:
    """The preloads of some sections under which pressures, Pa, hold a pose, lengths in m, shape (3 sections,).

    ``arm`` is without preloads, ``radii`` are those of the lengths of each section, m; three numbers a section in the
    order of :data:`NUMBERS`.
    """
    acceleration = arm.forward_dynamics(lengths, np.zeros_like(lengths), pressures)
    force = -(arm.inertia_matrix(lengths) @ acceleration)
    found = []
    for section in sections:
        f1, f2, f3 = force[3 * section - 3 : 3 * section]
        radius = radii[section - 1]
        found += [radius * (0.5 * (f2 + f3) - f1), radius * _H * (f3 - f2), f1 + f2 + f3]
    return np.array(found)


def first_lengths(arm: Arm, observation: Observation, there: Resting) -> Array:
    """Lengths of the arm where it stands at first, m, shape (3n,); ``observation`` as this arm shows its outputs."""
    return pose(arm, arm.parameters, observation, there.values, np.full(len(there.values), _SURE), there.pressures)


def preloads_there(arm: Arm, observation: Observation, there: Resting) -> dict[str, float]:
    """Paths and numbers of the preloads that hold an arm at first; ``observation`` has the outputs as it shows them.

    Of an arm that slips inside they are what its strains leave.
    """
    return dict(zip(_names(arm), map(float, _standing(arm, observation, there)[1]), strict=True))


def _names(arm: Arm) -> list[str]:
    """Paths of the numbers of an arm's preloads."""
    return [f"effect.{number}.{name}" for number in preloaded(arm.parameters) for name in NUMBERS]


def _standing(arm: Arm, observation: Observation, there: Resting) -> tuple[Arm, Array]:
    """The arm at first, what slips as strained as it is, with preloads of nothing; and the numbers that these need."""
    free = arm.with_values(dict.fromkeys(_names(arm), 0.0))
    lengths = first_lengths(free, observation, there)
    radii = [section.bellows_radius for section in arm.parameters.sections]
    sections = list(preloaded(arm.parameters).values())
    tables = [effect.to_core() for effect in free.parameters.effects]
    if not slips(tables):
        return free, holding(free, radii, sections, lengths, there.pressures)
    each = one_a_bellows(tables, arm.parameters)

    def strained(starts: Array) -> Arm:
        return free.with_effects([_table(effect) for effect in with_starts(each, starts)])

    starts, left = strains(each, sections, lambda w: holding(strained(w), radii, sections, lengths, there.pressures))
    return strained(starts), left


def _table(effect: Mapping[str, Any]) -> dict[str, Any]:
    """An effect of the core's description as a table of a file has it."""
    formula = {} if effect["force"] is None else {"force": effect["force"]}
    return {"kind": effect["kind"], "where": effect["where"], **formula, **effect["parameters"]}


@dataclass(frozen=True, eq=False)
class Beginning:
    """How a log begins: what of it an arm takes its preloads from, and what drives it from there.

    Attributes:
        stands: the pose it stands in; None where the log does not tell one.
        outputs: what that pose was seen in.
        drive: pressures and forces.
    """

    stands: Resting | None
    outputs: tuple[Output, ...]
    drive: Input

    def taken_by(self, arm: Arm) -> Arm:
        """The arm as it was when the log began: with the preloads, where it has such, that its first pose tells."""
        if self.stands is None or not preloaded(arm.parameters):
            return arm
        standing, numbers = _standing(arm, Observation.of(arm.parameters, self.outputs), self.stands)
        return standing.with_values(dict(zip(_names(standing), map(float, numbers), strict=True)))


def begins(arm: Arm, recording: Recording) -> Beginning:
    """How a recording begins for an arm; without preloads, or outputs to tell them, as the log drives it."""
    if not preloaded(arm.parameters) or not recording.outputs:
        return Beginning(None, (), recording.drive)
    stands, drive = beginning(recording, range(len(recording.outputs)))
    return Beginning(stands, recording.outputs, drive)


#: What a run says that takes its preloads from a log.
TAKEN = "preloads are those that the log's first pose tells"
