"""The measurements of all experiments and the arm identified from them, each made when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha import robots
from bha.arm import Arm
from bha.experiments import schedules
from bha.experiments.measured import after_release, holds, recorded, seen, with_sections
from bha.experiments.virtual_arm import Schedule, VirtualArm, VirtualBody
from bha.identification.stiffness import StiffnessFit, bending_stiffness, longitudinal_stiffness
from bha.identification.swing import SwingFit, swing_damping
from bha.logs import Log
from bha.runs.trajectory import Trajectory

Array = NDArray[np.float64]

#: Masses that stand for what is spread along a section.
PLACES = 3


class Laboratory:
    """One virtual arm, what was measured on it, and the model identified from that by the paper's section IV."""

    def __init__(
        self,
        *,
        seed: int = 2015,
        hold: float = 2.0,
        swing_time: float = 6.0,
        body: VirtualBody | None = None,
        note: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Name the arm's seed and how long measurements take.

        Args:
            seed: of the bellows' scatter and the sensors' noise.
            hold: how long each pose of the static measurements is held, s.
            swing_time: how long a swing is recorded, s.
            body: in what the arm differs from the lumped model; as :class:`VirtualBody` has it if None.
            note: told what is being measured or identified.
        """
        self.design = robots.load("bha_nominal")
        self.seed = seed
        self.real = VirtualArm(self.design, body, seed=seed)
        self.hold, self.swing_time = hold, swing_time
        self.note = note
        #: Steps of the virtual arm's integration, s: creeping along in the static measurements, faster in the others.
        self.static_step, self.dynamic_step = 1e-3, 5e-4

    @cached_property
    def lumped(self) -> Laboratory:
        """The same measurements of the arm as the paper has it: each section's mass in its head, all else alike."""
        body = replace(self.real.body, plate_share=1.0)
        note = self.note
        other = Laboratory(
            seed=self.seed,
            hold=self.hold,
            swing_time=self.swing_time,
            body=body,
            note=lambda text: note(f"{text} (mass at the heads)"),
        )
        other.static_step, other.dynamic_step = self.static_step, self.dynamic_step
        return other

    @cached_property
    def even_elongation(self) -> tuple[Schedule, Log]:
        """Fig. 8: staircase of even pressures."""
        schedule = schedules.even_elongation(self.design, hold=self.hold)
        return schedule, self._measure("even elongation", schedule, 1, self.static_step)

    @cached_property
    def bending(self) -> list[tuple[Schedule, Log]]:
        """Fig. 9: one staircase for each section."""
        return [self.measure_bending(section) for section in range(1, self.design.section_count + 1)]

    @cached_property
    def swing(self) -> tuple[float, Log]:
        """Fig. 10: time of the release and the log."""
        schedule = schedules.swing(self.design, free=self.swing_time)
        return float(schedule.time[1]), self._measure("lateral swing", schedule, 2)

    @cached_property
    def second_swing(self) -> tuple[float, Log]:
        """Fig. 14: another swing than the one that the damping was identified from."""
        schedule = schedules.swing(self.design, force=7.0, free=self.swing_time)
        return float(schedule.time[1]), self._measure("second lateral swing", schedule, 3)

    @cached_property
    def tilt(self) -> Log:
        """Fig. 12."""
        return self._measure("tilt", schedules.tilt(self.design), 4)

    @cached_property
    def tilting(self) -> Log:
        """Fig. 13."""
        return self._measure("tilting to and fro", schedules.tilting_to_and_fro(self.design), 5)

    @cached_property
    def paper(self) -> Identified:
        """The model by section IV as it stands: the sections' mass at the centre of their heads."""
        return Identified(self, [{}] * self.design.section_count)

    @cached_property
    def balanced(self) -> Identified:
        """The same with each section's mass at its centre of mass, as found by balancing it at its mean length."""
        spread = 1.0 - self.real.body.plate_share
        means = [sum(s.length_range) / 2 for s in self.design.parameters.sections]
        return Identified(self, [{"center_of_mass": [0.0, 0.0, -round(spread * mean / 2, 3)]} for mean in means])

    @cached_property
    def spread(self) -> Identified:
        """The same with each section's mass where it lies: its head plate weighed, the rest in places along its arc."""
        plate = self.real.body.plate_share
        sections = self.design.parameters.sections
        return Identified(self, [_spread(round(plate * s.mass, 3), round((1 - plate) * s.mass, 3)) for s in sections])

    @property
    def is_spread(self) -> bool:
        """Whether some of the sections' mass is not in their heads, so that models can have it elsewhere."""
        return self.real.body.plate_share < 1.0

    @property
    def weighed(self) -> Arm:
        """What is known of the arm before any measurement."""
        return self.paper.weighed

    @property
    def identified(self) -> Arm:
        """The full model of the experiments."""
        return self.paper.arm

    @cached_property
    def reduced(self) -> Arm:
        """The reduced model, (58)-(61): without rotational energy and Coriolis forces."""
        return self.identified.with_changes(rotational_energy=False, coriolis_forces=False)

    def measured(self, log: Log) -> Trajectory:
        """A log as a trajectory: heads follow from measured lengths by (14), velocities were not measured."""
        found = seen(self.weighed, log)
        heads = np.array([self.weighed.forward_kinematics(q)[0] for q in found.lengths])
        return replace(found, head_positions=heads, arm_name="virtual arm")

    def measure_bending(self, section: int) -> tuple[Schedule, Log]:
        """The staircase that bends one section, counted from 1."""
        schedule = schedules.bending(self.design, section, hold=self.hold)
        return schedule, self._measure(f"bending of section {section}", schedule, 10 + section, self.static_step)

    def _measure(self, what: str, schedule: Schedule, number: int, step: float | None = None) -> Log:
        self.note(f"measuring: {what}")
        return self.real.measure(schedule, number=number, step=step or self.dynamic_step)


class Identified:
    """The steps of section IV, each from the one before and from the laboratory's measurements."""

    def __init__(self, laboratory: Laboratory, masses: Sequence[Mapping[str, Any]]) -> None:
        """Start from where each section's mass lies: keys of its table that differ from a mass in its head."""
        self._laboratory = laboratory
        self._masses = masses

    @cached_property
    def weighed(self) -> Arm:
        """What is known before any pressure is applied: geometry, masses (weighed to 1 g), inertia by (56)."""
        unknown = {"inertia": None, "stiffness": [1.0], "damping": 0.0, "bending_stiffness": [0.0]}
        changes = [
            {**unknown, "mass": round(section.mass, 3), "center_of_mass": [0.0, 0.0, 0.0], **lies}
            for section, lies in zip(self._laboratory.design.parameters.sections, self._masses, strict=True)
        ]
        return with_sections(self._laboratory.design, changes, "identified")

    @cached_property
    def stiffness(self) -> list[StiffnessFit]:
        """Section IV-C."""
        schedule, log = self._laboratory.even_elongation
        self._laboratory.note("identifying longitudinal stiffness")
        arm, rec = self.weighed, recorded(self.weighed, log, "even elongation")
        where, numbers = holds(rec, schedule), range(1, arm.section_count + 1)
        return [longitudinal_stiffness(arm, [rec], k, rest_length=True, holds=where) for k in numbers]

    @cached_property
    def sprung(self) -> Arm:
        """The arm after section IV-C."""
        return _with_laws(self.weighed, self.stiffness)

    @cached_property
    def bending_stiffness(self) -> list[StiffnessFit]:
        """Section IV-D."""
        logs = self._laboratory.bending
        self._laboratory.note("identifying bending stiffness")
        return [fit_bending(self.sprung, i + 1, log, s) for i, (s, log) in enumerate(logs)]

    @cached_property
    def undamped(self) -> Arm:
        """The arm after section IV-D."""
        return _with_laws(self.sprung, self.bending_stiffness)

    @cached_property
    def damping(self) -> SwingFit:
        """Section IV-E."""
        release, log = self._laboratory.swing
        arm = self.undamped
        self._laboratory.note("identifying damping")
        rec = recorded(arm, log, "lateral swing")
        return swing_damping(arm, [rec], stretches=[after_release(rec, release)], at_rest=True)

    @cached_property
    def arm(self) -> Arm:
        """The arm after all of section IV."""
        return self.damping.applied(self.undamped)


def fit_bending(arm: Arm, section: int, log: Log, schedule: Schedule) -> StiffnessFit:
    """Section IV-D on one staircase: a line through the moments of its holds."""
    rec = recorded(arm, log, f"bending of section {section}")
    return bending_stiffness(arm, [rec], section, offset=True, holds=holds(rec, schedule))


def _with_laws(arm: Arm, laws: Sequence[StiffnessFit]) -> Arm:
    for law in laws:
        arm = law.applied(arm)
    return arm


def _spread(plate: float, rest: float) -> dict[str, Any]:
    """Keys of a section that weighs ``plate`` kg in its head and ``rest`` kg evenly along its arc."""
    if not rest:
        return {}
    shares = (np.arange(PLACES) + 0.5) / PLACES
    return {"mass": plate, "masses": [{"share": float(share), "mass": rest / PLACES} for share in shares]}
