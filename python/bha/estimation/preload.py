"""Preloads in an estimation: each log has those that its first pose tells, see :mod:`bha.recordings.beginning`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.arm import Arm
from bha.estimation.free import Coordinate, FreeParameter, resolve
from bha.estimation.records import Record
from bha.parameters import ArmParameters, paths
from bha.recordings import Observation
from bha.recordings.beginning import KIND, NUMBERS, first_lengths, holding, preloaded, preloads_there

Array = NDArray[np.float64]


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
        """The numbers under which pressures, Pa, hold a pose (:func:`bha.recordings.beginning.holding`)."""
        return holding(arm, radii, self.sections, pose, pressures)


def preloads_of(parameters: ArmParameters) -> Preloads | None:
    """The preloads of single sections that an arm has; None without any."""
    places = preloaded(parameters)
    free = [FreeParameter(f"effect.{k}.{name}", logarithmic=False, scale=1.0) for k in places for name in NUMBERS]
    return Preloads(tuple(places.values()), resolve(parameters, free)) if free else None


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
    if rec.resting is None:
        return None
    return first_lengths(arm, Observation.of(arm.parameters, rec.observation.outputs), rec.resting)


def of_record(arm: Arm, rec: Record) -> dict[str, float]:
    """The preloads that a record's first pose tells of an arm that has some: paths and numbers; empty for none."""
    if rec.resting is None or not preloaded(arm.parameters):
        return {}
    return preloads_there(arm, Observation.of(arm.parameters, rec.observation.outputs), rec.resting)


def typical(arm: Arm, records: Sequence[Record]) -> ArmParameters:
    """The parameters with the means of the records' preloads: what holds the arm where a log does not tell it."""
    found = [numbers for rec in records if (numbers := of_record(arm, rec))]
    if not found:
        return arm.parameters
    return paths.with_values(arm.parameters, {p: float(np.mean([own[p] for own in found])) for p in found[0]})
