"""Arms and what shows of them, by coordinates: each made once, of values, however often it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
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
from bha.estimation.preload import Preloads, first_pose, preloads_of
from bha.estimation.records import Record
from bha.estimation.terms import EffectTerm, tables_of
from bha.parameters import ArmParameters, paths
from bha.recordings import Observation
from bha.recordings.strained import free_start, one_a_bellows, slips, strains, with_starts

Array = NDArray[np.float64]

#: A start of what slips, as far as it plausibly is from none.
STRAIN = 0.5


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
        preloads = preloads_of(self.parameters)
        on_pose = [tuple(c for c in own if any(map(paths.acts_on_pose, c.members))) for own in acting]
        places = {c: k for k, c in enumerate(self.coordinates)}
        moving_at, outputs_at, pose_at = (
            [[places[c] for c in own] for own in each] for each in (moving, on_outputs, on_pose)
        )

        @lru_cache(maxsize=256)
        def observation(case: int, values: tuple[float, ...]) -> Observation:
            parameters = with_values(changed[case], on_outputs[case], values)
            return Observation.of(parameters, self.cases[case].observation.outputs)

        @lru_cache(maxsize=256)
        def first(case: int, values: tuple[float, ...]) -> tuple[list[float], Array, Array] | None:
            rec = self.cases[case].record
            if rec is None or rec.resting is None:
                return None
            parameters = with_values(changed[case], on_pose[case], values)
            pose = first_pose(Arm(parameters), rec)
            radii = [section.bellows_radius for section in parameters.sections]
            return None if pose is None else (radii, pose, rec.resting.pressures)

        @cache
        def variants(case: int) -> Variants:
            return _variants(changed[case], moving[case], self.cases[case].commanded, self.effects)

        @lru_cache(maxsize=1024)
        def made(point: bytes, case: int) -> tuple[_core.Arm | None, Observation]:
            plain, parts = self.split(np.frombuffer(point))
            value = [c.value(float(x)) for c, x in zip(self.coordinates, plain, strict=True)]
            tables = tables_of(self.effects, parts)
            try:
                values = np.array([value[k] for k in moving_at[case]])
                stands = first(case, tuple(value[k] for k in pose_at[case])) if preloads else None
                if preloads is None or stands is None:
                    arm = variants(case).arm(values, [table["parameters"] for table in tables])
                else:
                    told = (*moving[case], *preloads.coordinates)
                    commanded = self.cases[case].commanded
                    arm = _held(changed[case], told, commanded, self.effects, values, tables, preloads, stands)
                return arm, observation(case, tuple(value[k] for k in outputs_at[case]))
            except BhaError:
                return None, self.cases[case].observation

        # What first poses tell is each log's own; else logs that look alike at the arm share what is made.
        looks = [(case.condition, case.commanded, case.observation.outputs) for case in self.cases]
        like = [k if preloads else looks.index(look) for k, look in enumerate(looks)]

        def at(point: bytes, case: int) -> tuple[_core.Arm | None, Observation]:
            return made(point, like[case])

        return at

    def split(self, z: Array) -> tuple[Array, list[Array]]:
        """Coordinates of the arm and its sensors, and those of each effect."""
        ends = np.cumsum([len(self.coordinates), *(len(e.coordinates) for e in self.effects)])
        return z[: ends[0]], [z[first:last] for first, last in pairwise(ends)]


def _held(
    parameters: ArmParameters,
    coordinates: tuple[Coordinate, ...],
    commanded: bool,
    effects: tuple[EffectTerm, ...],
    values: Array,
    tables: Sequence[dict[str, Any]],
    preloads: Preloads,
    stands: tuple[list[float], Array, Array],
) -> _core.Arm:
    """The arm as its first pose tells what holds it: strains of what slips inside it first, preloads for the rest.

    Args:
        parameters: the arm.
        coordinates: those of the values, then those of the preloads.
        commanded: whether pressures pass through its pneumatics.
        effects: what is put beside its own effects.
        values: of the coordinates but for the preloads.
        tables: the effects beside it in the core's description, with their numbers.
        preloads: where they stand.
        stands: radii, pose and pressures, see :meth:`Preloads.needed`.
    """
    nothing = np.zeros(len(preloads.coordinates))
    own = [effect.to_core() for effect in parameters.effects]
    if not slips([*own, *tables]):
        make, numbers = _variants(parameters, coordinates, commanded, effects), [t["parameters"] for t in tables]
        needed = preloads.needed(make.arm(np.concatenate([values, nothing]), numbers), *stands)
        return make.arm(np.concatenate([values, needed]), numbers)
    make = _variants(parameters, coordinates, commanded, effects, slipping=True)
    if any(c.path.startswith("effect.") for c in coordinates[: len(values)]):
        own = described(parameters, coordinates, np.concatenate([values, nothing]))["effect"]
    own, more = one_a_bellows(own, parameters), one_a_bellows(tables, parameters)
    count = sum(map(free_start, own))

    def arm(left: Array, starts: Array) -> _core.Arm:
        numbers = [table["parameters"] for table in with_starts(more, starts[count:])]
        return make.arm(np.concatenate([values, left, starts[:count]]), numbers)

    def needed_beside(starts: Array) -> Array:
        return preloads.needed(arm(nothing, starts), *stands)

    starts, left = strains([*own, *more], preloads.sections, needed_beside)
    return arm(left, starts)


@lru_cache(maxsize=64)
def _variants(
    parameters: ArmParameters,
    coordinates: tuple[Coordinate, ...],
    commanded: bool,
    effects: tuple[EffectTerm, ...] = (),
    slipping: bool = False,
) -> Variants:
    """Arms by values of coordinates; measured pressures stand in the chambers already, so pneumatics go.

    ``slipping``: what slips inside the arm is there bellows by bellows, and their starts are values behind the others.
    """
    if effects:
        tables = tables_of(effects, [np.zeros(len(e.coordinates)) for e in effects])
        alone = _variants(parameters, coordinates, commanded, slipping=slipping)
        return alone.beside(one_a_bellows(tables, parameters) if slipping else tables)

    def describe(values: Array) -> dict[str, Any]:
        core = described(parameters, coordinates, values[: len(coordinates)])
        if slipping:
            each = one_a_bellows(core.get("effect", ()), parameters)
            core = {**core, "effect": with_starts(each, values[len(coordinates) :])}
        return core if commanded else {key: entry for key, entry in core.items() if key != "pneumatics"}

    start, reach = [c.value(0.0) for c in coordinates], [abs(c.slope(0.0)) for c in coordinates]
    if slipping:
        own = one_a_bellows((effect.to_core() for effect in parameters.effects), parameters)
        count = sum(map(free_start, own))
        start, reach = start + [0.0] * count, reach + [STRAIN] * count
    return Variants(describe, start, reach)
