"""What is free beyond the defaults where logs ask for it: chambers that are not alike, what creeps.

Nearly every arm is a little of both, but a number that logs do not need takes part in every combination that they do
not tell. These are therefore tried only where the defaults leave more than the noise, and kept where simulations from
the new start leave clearly less (:mod:`bha.estimation.begin`):

- gains of single inputs (areas of their chambers, sensors, regulators: they act alike) and azimuths of single chambers;
- preloads of the sections, log by log, told by where each log begins (:mod:`bha.estimation.preload`), and with them
  areas that change with the length of a chamber, as those of fabric do;
- in an arm with these, elements that slip (effect ``hysteresis``): what held the arm where a log began gives way once
  the arm moves on (:mod:`bha.recordings.strained`).

Offsets of single inputs and rest lengths of single chambers hold the arm bent, as a turned camera shows it: with heads
alone they are not told from it and are not tried.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.estimation.free import Coordinate, FreeParameter
from bha.estimation.preload import with_preloads
from bha.estimation.records import Record
from bha.estimation.statics import TURN
from bha.parameters import ArmParameters, paths
from bha.parameters.provenance import published
from bha.recordings.beginning import KIND as PRELOAD
from bha.recordings.strained import KIND as MEMORY

Array = NDArray[np.float64]

#: Standard deviations of what chambers differ by: gain, and azimuth in rad.
GAIN, AZIMUTH = 0.1, math.radians(5.0)
AREA = "effective_area"
#: Pressures are alike within this part of their travel; poses under them are others from this part of the arm's travel
#: and so many noises on (standard deviation in one channel): more than pressures so near to each other make.
ALIKE, ELSEWHERE, NOISES = 0.04, 0.05, 10.0
#: Yields of what slips, in the range of lengths; how much of the springs' force over them that is at first, factors on
#: it that are tried, and the standard deviation of its logarithm.
YIELDS, SLIPS, SLIP_FACTORS, SLIP_DEVIATION = (0.03, 0.1), 0.5, (0.25, 1.0, 3.0), 1.5
#: Standard deviation of the rest length of an arm that stands elsewhere after each use, in itself.
SETTLED = 0.3
#: Least amplitude that is begun with, N.
LEAST_AMPLITUDE = 1e-3
#: Standard deviation of what an area changes by in itself for each metre of length: a seventh for a centimetre. What a
#: fabric gains in length it loses in width: areas fall. One that grows pushes the more the longer it is, and beyond the
#: pressures of the fit the arm has no rest.
BY_LENGTH = 15.0


@dataclass(frozen=True)
class Asked:
    """Parameters with more of them free.

    Attributes:
        parameters: the arm, with the effects that stand for what is new.
        free: all that is free.
        said: what was added, in words.
        static: whether it acts on held poses, so that these must be better with it too.
        begins: whether it says where logs begin, so that simulations of whole logs must be better with it.
        carries: whether it may fit what other motions do not have, so that held poses of logs left out of the statics
            must be better with it.
    """

    parameters: ArmParameters
    free: tuple[FreeParameter | str, ...]
    said: str
    static: bool
    begins: bool = False
    carries: bool = False


def material_that_creeps(parameters: ArmParameters, free: Sequence[FreeParameter | str]) -> Asked | None:
    """Preloads told by first poses, and areas that change with length; None where the arm has some of them already.

    What holds an arm off by as much in all its poses is no longer free beside them, nor is the scale of its areas; its
    springs are about the file's again, within a factor of five: where areas fall, an arm with weak springs buckles.
    """
    if any(effect.kind in (PRELOAD, AREA) for effect in parameters.effects):
        return None
    mapping = parameters.to_mapping()
    effects, more, prior = list(mapping.get("effect", [])), [], (0.0, BY_LENGTH)
    for number in range(1, len(parameters.sections) + 1):
        effects.append({"kind": AREA, "where": f"section {number}", "by_length": 0.0})
        slope = FreeParameter(f"effect.{len(effects)}.by_length", prior=prior, logarithmic=False, scale=BY_LENGTH)
        more.append(replace(slope, lower=-3.0 * BY_LENGTH, upper=0.0))
    left = [_plainly(f) for f in free if not holds_off(f if isinstance(f, str) else f.path)]
    said = (
        "logs begin at rest in other poses than their pressures say: what holds the arm there is told by each log's "
        "first pose (effect preload; what is written is its mean), and areas change with length (effect effective_area)"
    )
    changed = with_preloads(parameters.updated({**mapping, "effect": effects}))
    return Asked(changed, (*left, *more), said, True, begins=True)


def stands_elsewhere(records: Sequence[Record]) -> bool:
    """Whether an arm stands elsewhere under the same pressures where logs begin: it remembers what was before them.

    Of the logs that begin at rest under pressures like those of the first one the poses are compared, in what the arm
    travels in all logs; in each session apart, for an arm may have been put up anew.
    """
    travel, moves = 0.0, 0.0
    for rec in records:
        travel = max(travel, float(np.max(np.ptp(rec.drive.pressures, axis=0))))
        seen = np.where(rec.usable, rec.measured, np.nan)[:, rec.usable.any(axis=0)]
        moves = max(moves, float(np.max(np.nanmax(seen, axis=0) - np.nanmin(seen, axis=0), initial=0.0)))
    for session in {rec.session for rec in records}:
        stood = [
            (rec.resting, rec.noise)
            for rec in records
            if rec.session == session and not rec.changes and rec.resting is not None
        ]
        alike = [
            (own.values, noise)
            for own, noise in stood
            if np.all(np.abs(own.pressures - stood[0][0].pressures) <= ALIKE * travel)
        ]
        if len(alike) < 2 or len({len(values) for values, _ in alike}) > 1:
            continue
        poses, noise = np.array([values for values, _ in alike]), np.max([own for _, own in alike], axis=0)
        apart = np.std(poses, axis=0, ddof=1)
        if np.any(apart > np.maximum(ELSEWHERE * moves, NOISES * noise)):
            return True
    return False


def memory_that_slips(parameters: ArmParameters, free: Sequence[FreeParameter | str]) -> Asked | None:
    """Elements that slip in every bellows, strained where logs begin; None without preloads, or with some already.

    Rest lengths are free again: preloads alone hold the arm at its first pose whatever these are, strains do not.
    """
    if not any(e.kind == PRELOAD for e in parameters.effects) or any(e.kind == MEMORY for e in parameters.effects):
        return None
    mapping, known = parameters.to_mapping(), {f if isinstance(f, str) else f.path for f in free}
    effects, more = list(mapping.get("effect", [])), []
    for number, section in enumerate(parameters.sections, start=1):
        for reach in YIELDS:
            yields = reach * (section.length_range[1] - section.length_range[0])
            most = max(SLIPS * abs(section.stiffness[0]) * yields, LEAST_AMPLITUDE)
            where = {"kind": MEMORY, "where": f"section {number}"}
            effects.append({**where, "amplitude": most, "yield": yields, "sharpness": 1.0})
            path = f"effect.{len(effects)}.amplitude"
            deviation = SLIP_DEVIATION * most
            more.append(FreeParameter(path, lower=1e-3 * most, prior=(most, deviation), logarithmic=True))
        rest = f"section.{number}.rest_length"
        if rest not in known and "rest_length" not in published(section.provenance):
            more.append(FreeParameter(rest, prior=(section.rest_length, SETTLED * section.rest_length)))
    said = (
        "what held the arm where logs begin gives way once it moves on: elements that slip in every bellows, strained "
        "as each log's first pose tells, were added (effect hysteresis)"
    )
    return Asked(parameters.updated({**mapping, "effect": effects}), (*free, *more), said, False, begins=True)


def slip_factors(coordinates: Sequence[Coordinate], z: Array) -> list[Array]:
    """Points like ``z`` with what slips holding more and less; none where nothing free does."""
    places = [k for k, c in enumerate(coordinates) if c.path.startswith("effect.") and c.path.endswith(".amplitude")]
    found = []
    for factor in SLIP_FACTORS if places else ():
        point = z.copy()
        for k in places:
            c = coordinates[k]
            point[k] = np.clip(c.coordinate(max(factor * c.value(float(z[k])), c.lower)), *c.bounds)
        found.append(point)
    return found


def _plainly(free: FreeParameter | str) -> FreeParameter | str:
    """The same, springs with the prior of a guess."""
    path = free if isinstance(free, str) else free.path
    key = paths.key_of(path)
    if key not in ("stiffness", "bending_stiffness") or not path.endswith(".1"):
        return free
    sessions = () if isinstance(free, str) else free.sessions
    return FreeParameter(path, sessions, lower=1e-3)


def holds_off(path: str) -> bool:
    """Whether a number moves or tilts the whole arm (rest length, centre of mass, camera), or is the scale of areas."""
    if paths.is_of_sensors(path):
        return path != TURN
    return paths.key_of(path) in ("rest_length", "center_of_mass", "terminal_area")


def unlike_chambers(parameters: ArmParameters, free: Sequence[FreeParameter | str]) -> Asked | None:
    """Gains of all inputs and azimuths of all chambers free; None where inputs have gains already.

    The arm's first chamber keeps its azimuth where the camera's turn is free: all azimuths together are this turn.
    """
    if any(effect.kind == "pressure_gain" for effect in parameters.effects):
        return None
    turns = TURN in {f if isinstance(f, str) else f.path for f in free}
    mapping = parameters.to_mapping()
    effects, more = list(mapping.get("effect", [])), []
    for name in parameters.inputs:
        effects.append({"kind": "pressure_gain", "where": f"input {name}", "gain": 0.0})
        path = f"effect.{len(effects)}.gain"
        more.append(FreeParameter(path, lower=-0.5, upper=1.0, prior=(0.0, GAIN), logarithmic=False, scale=GAIN))
    for number, section in enumerate(parameters.sections, start=1):
        if section.bellows is None:
            continue
        for k, bellows in enumerate(section.resolved_bellows(number), start=1):
            path = f"section.{number}.bellows.{k}.angle"
            if turns and (number, k) == (1, 1):
                continue
            more.append(FreeParameter(path, prior=(bellows.angle, AZIMUTH), logarithmic=False, scale=AZIMUTH))
    said = "chambers are not alike: gains of inputs (effect pressure_gain) and azimuths of chambers were added"
    return Asked(parameters.updated({**mapping, "effect": effects}), (*free, *more), said, True, carries=True)
