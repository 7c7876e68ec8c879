"""Preloads from first poses: what held an arm, log by log, where it stood when the log begins.

Fabric and rubber creep and stick: under the same pressures an arm stands elsewhere after each use, by more than its
sensors' noise and than any law from pressures to poses says. Which rest it begins from is told by a log's first pose,
where it begins at rest. What: the constant force and torques of each section (effect ``preload``) under which that pose
is held by the first pressures,

    Q = -M(q0) q''(q0, 0, p0),

read on the arc coordinates of each section. They follow from the parameters and one pose, so that a fit has no number
more, and a log that takes no part in it is predicted in the same way.
An arm that has a ``preload`` in some sections takes it from each log that begins at rest; else its own numbers count.
Limits: commands do not say what the chambers held before the log, so under commands the first one must have been held.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.arm import Arm
from bha.estimation.free import Coordinate, FreeParameter, resolve, with_values
from bha.estimation.initial import pose_of
from bha.estimation.records import Record, record
from bha.parameters import ArmParameters, Place, paths
from bha.recordings import Recording
from bha.runs.input import Input

Array = NDArray[np.float64]

KIND = "preload"
#: Numbers of the effect: on (u, v, l).
NUMBERS = ("to_x", "to_y", "along")
#: Deviation of a measured first pose against that which the pressures hold, m: what is measured decides.
_SURE = 1e-4
_H = math.sqrt(3.0) / 2.0


@dataclass(frozen=True)
class Preloads:
    """The preloads of an arm: which sections have one, and where its numbers stand.

    Attributes:
        sections: numbers of the sections, in the order of their effects.
        coordinates: their numbers, three a section in the order of :data:`NUMBERS`.
    """

    sections: tuple[int, ...]
    coordinates: tuple[Coordinate, ...]

    def needed(self, arm: _core.Arm, radii: Sequence[float], pose: Array, pressures: Array) -> Array:
        """The numbers under which pressures, Pa, hold a pose, lengths in m, shape (3 sections,).

        ``arm`` is without preloads, ``radii`` are those of the lengths of each section, m.
        """
        acceleration = arm.forward_dynamics(pose, np.zeros_like(pose), pressures)
        force = -(arm.inertia_matrix(pose) @ acceleration)
        found = []
        for section in self.sections:
            f1, f2, f3 = force[3 * section - 3 : 3 * section]
            radius = radii[section - 1]
            found += [radius * (0.5 * (f2 + f3) - f1), radius * _H * (f3 - f2), f1 + f2 + f3]
        return np.array(found)


def preloads_of(parameters: ArmParameters) -> Preloads | None:
    """The preloads of single sections that an arm has; None without any."""
    sections, free = [], []
    for number, effect in enumerate(parameters.effects, start=1):
        place = Place.read(effect.where)
        if effect.kind == KIND and place is not None and place.section is not None:
            sections.append(place.section)
            free += [FreeParameter(f"effect.{number}.{name}", logarithmic=False, scale=1.0) for name in NUMBERS]
    return Preloads(tuple(sections), resolve(parameters, free)) if free else None


def with_preloads(parameters: ArmParameters) -> ArmParameters:
    """The parameters with a preload of nothing in each section, the last of its effects; as they are with some."""
    if any(effect.kind == KIND for effect in parameters.effects):
        return parameters
    mapping = parameters.to_mapping()
    new = [{"kind": KIND, "where": f"section {k}"} | dict.fromkeys(NUMBERS, 0.0) for k in _numbers(parameters)]
    return parameters.updated({**mapping, "effect": [*mapping.get("effect", []), *new]})


def _numbers(parameters: ArmParameters) -> range:
    return range(1, len(parameters.sections) + 1)


def first_pose(arm: Arm, rec: Record) -> Array | None:
    """Lengths of the arm where a record begins at rest, m, shape (3n,); None where it moves there."""
    there = rec.resting
    return (
        None if there is None else pose_of(arm, rec, there.values, np.full(len(there.values), _SURE), there.pressures)
    )


def of_record(arm: Arm, rec: Record) -> dict[str, float]:
    """The preloads that a record's first pose tells of an arm that has some: paths and numbers; empty for none."""
    preloads = preloads_of(arm.parameters)
    if preloads is None or rec.resting is None:
        return {}
    free = Arm(with_values(arm.parameters, preloads.coordinates, np.zeros(len(preloads.coordinates))))
    q = first_pose(free, rec)
    assert q is not None
    radii = [section.bellows_radius for section in arm.parameters.sections]
    numbers = preloads.needed(free, radii, q, rec.resting.pressures)
    return {c.path: float(value) for c, value in zip(preloads.coordinates, numbers, strict=True)}


def begun(arm: Arm, recording: Recording) -> tuple[Arm, Input, str]:
    """The arm as it was when a recording begins, what drives it from there, and what was taken from it, in words."""
    if preloads_of(arm.parameters) is None or not recording.outputs:
        return arm, recording.drive, ""
    rec = record(arm, recording)
    told = of_record(arm, rec)
    if not told:
        return arm, rec.drive, ""
    return arm.with_values(told), rec.drive, "preloads are those that the log's first pose tells"


def typical(arm: Arm, records: Sequence[Record]) -> ArmParameters:
    """The parameters with the means of the records' preloads: what holds the arm where a log does not tell it."""
    found = [numbers for rec in records if (numbers := of_record(arm, rec))]
    if not found:
        return arm.parameters
    return paths.with_values(arm.parameters, {p: float(np.mean([own[p] for own in found])) for p in found[0]})
