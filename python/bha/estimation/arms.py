"""Arms and what shows of them, by coordinates: each made once, of values, however often it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.arm import Arm
from bha.arm.variants import Variants
from bha.errors import BhaError
from bha.estimation.conditions import Condition, conditioned
from bha.estimation.derived import described
from bha.estimation.free import Coordinate, with_values
from bha.estimation.preload import first_pose, preloads_of
from bha.estimation.records import Record
from bha.estimation.terms import EffectTerm, tables_of
from bha.parameters import ArmParameters, paths
from bha.recordings import Observation

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Case:
    """How a log looks at an arm.

    Attributes:
        condition: session and known changes.
        observation: its outputs, as the file's arm shows them.
        commanded: whether pressures are commands, which pass through the arm's pneumatics; else they stand in the
            chambers already.
        record: the log, where its first pose tells preloads (:mod:`bha.estimation.preload`).
    """

    condition: Condition
    observation: Observation
    commanded: bool = False
    record: Record | None = None


@dataclass(frozen=True, eq=False)
class Arms:
    """The arms of some cases, by coordinates.

    Attributes:
        parameters: the arm at z = 0.
        coordinates: what the values are of: numbers of the arm and of its sensors.
        cases: the cases.
        effects: what is put beside the arm's own effects; their coordinates follow the others in z.
    """

    parameters: ArmParameters
    coordinates: tuple[Coordinate, ...]
    cases: tuple[Case, ...]
    effects: tuple[EffectTerm, ...] = ()

    @cached_property
    def changed(self) -> dict[Condition, ArmParameters]:
        """The parameters under each condition."""
        return conditioned(self.parameters, (case.condition for case in self.cases))

    def at(self, z: Array, case: int) -> tuple[_core.Arm | None, Observation]:
        """The arm at ``z`` (p,) in a case and the outputs as it shows them; no arm where the values are none of one."""
        return self._at(np.asarray(z, dtype=np.float64).tobytes(), case)

    @cached_property
    def _at(self) -> Callable[[bytes, int], tuple[_core.Arm | None, Observation]]:
        # Points that differ in what does not act on a case have the same arm, or the same outputs.
        acting = [tuple(c for c in self.coordinates if c.acts_on(case.condition.session)) for case in self.cases]
        moving = [tuple(c for c in own if not paths.is_of_sensors(c.path)) for own in acting]
        changed = [self.changed[case.condition] for case in self.cases]
        on_outputs = [tuple(c for c in own if any(map(paths.acts_on_outputs, c.members))) for own in acting]

        @lru_cache(maxsize=256)
        def observation(case: int, values: tuple[float, ...]) -> Observation:
            parameters = with_values(changed[case], on_outputs[case], values)
            return Observation.of(parameters, self.cases[case].observation.outputs)

        preloads = preloads_of(self.parameters)
        on_pose = [tuple(c for c in own if any(map(paths.acts_on_pose, c.members))) for own in acting]

        @lru_cache(maxsize=256)
        def first(case: int, values: tuple[float, ...]) -> tuple[list[float], Array, Array] | None:
            rec = self.cases[case].record
            if rec is None or rec.resting is None:
                return None
            parameters = with_values(changed[case], on_pose[case], values)
            pose = first_pose(Arm(parameters), rec)
            radii = [section.bellows_radius for section in parameters.sections]
            return None if pose is None else (radii, pose, rec.resting.pressures)

        @lru_cache(maxsize=1024)
        def at(point: bytes, case: int) -> tuple[_core.Arm | None, Observation]:
            z = np.frombuffer(point)
            value = {c: c.value(float(x)) for c, x in zip(self.coordinates, z, strict=False)}
            numbers = [table["parameters"] for table in tables_of(self.effects, self.split(z)[1])]
            try:
                values = np.array([value[c] for c in moving[case]])
                stands = first(case, tuple(value[c] for c in on_pose[case])) if preloads else None
                commanded = self.cases[case].commanded
                if preloads is None or stands is None:
                    arm = _variants(changed[case], moving[case], commanded, self.effects).arm(values, numbers)
                else:
                    variants = _variants(changed[case], (*moving[case], *preloads.coordinates), commanded, self.effects)
                    free = variants.arm(np.concatenate([values, np.zeros(len(preloads.coordinates))]), numbers)
                    arm = variants.arm(np.concatenate([values, preloads.needed(free, *stands)]), numbers)
                return arm, observation(case, tuple(value[c] for c in on_outputs[case]))
            except BhaError:
                return None, self.cases[case].observation

        return at

    def split(self, z: Array) -> tuple[Array, list[Array]]:
        """Coordinates of the arm and its sensors, and those of each effect."""
        ends = np.cumsum([len(self.coordinates), *(len(e.coordinates) for e in self.effects)])
        return z[: ends[0]], [z[first:last] for first, last in pairwise(ends)]


@lru_cache(maxsize=64)
def _variants(
    parameters: ArmParameters,
    coordinates: tuple[Coordinate, ...],
    commanded: bool,
    effects: tuple[EffectTerm, ...] = (),
) -> Variants:
    """Arms by values of coordinates; measured pressures stand in the chambers already, so pneumatics go."""
    if effects:
        tables = tables_of(effects, [np.zeros(len(e.coordinates)) for e in effects])
        return _variants(parameters, coordinates, commanded).beside(tables)

    def describe(values: Array) -> dict[str, Any]:
        core = described(parameters, coordinates, values)
        return core if commanded else {key: entry for key, entry in core.items() if key != "pneumatics"}

    return Variants(describe, [c.value(0.0) for c in coordinates], [abs(c.slope(0.0)) for c in coordinates])
