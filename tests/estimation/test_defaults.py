"""What is free when nobody says: one start for an identification and for the plain model of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

import bha
from bha.estimation.defaults import by_default
from bha.estimation.preload import with_preloads
from bha.estimation.records import record

from .slow_arm import TRUE, arm_of, log_of


def test_springs_curve_and_commands_pass_two_stages_and_a_dead_time() -> None:
    arm = arm_of(TRUE)
    rec = record(arm, log_of(arm, 1, duration=6.0))
    measured, free = by_default(arm, [rec])
    assert measured.parameters.sections[0].stiffness == (TRUE["stiffness"], 0.0, 0.0)
    assert measured.parameters.effects == ()
    assert {"section.1.stiffness.3", "section.1.rest_length"} <= {f.path for f in free}
    commanded, more = by_default(arm, [replace(rec, drive=replace(rec.drive, commanded=True))])
    assert [effect.kind for effect in commanded.parameters.effects] == ["delay", "pressure_lag"]
    assert len(more) == len(free) + 4


def test_what_first_poses_tell_is_not_free_and_springs_stay_as_they_are() -> None:
    arm = arm_of(TRUE)
    held = bha.Arm(with_preloads(arm.parameters))
    found, free = by_default(held, [record(held, log_of(arm, 1, duration=6.0))])
    assert found is held
    assert not any(f.path.endswith(("rest_length", "terminal_area")) or "center_of_mass" in f.path for f in free)
