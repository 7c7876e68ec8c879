from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.checkup.held import held_fit
from bha.checkup.turned import Turned, turned_sections
from bha.recordings import recordings

from .made_logs import arm_of, log_of, nominal, steps, turned


def sections(filed: bha.Arm, plant: bha.Arm) -> Turned | None:
    """What the poses alone say of a log of heads; what single sections say takes no part."""
    made = recordings(filed, [log_of(plant, *steps(filed), see="heads", noise=3e-4)], warn=False)
    found = bha.check(filed, made)
    assert found.evidence is not None
    assert found.verdict is not None
    return turned_sections(filed, made, found.evidence, found.verdict, held_fit(filed, made))


def test_poses_of_the_whole_arm_tell_how_a_section_is_turned() -> None:
    mapping = nominal(2)
    for section in mapping["section"]:
        section["stiffness"] = [1.5 * k for k in section["stiffness"]]
    found = sections(arm_of(nominal(2)), arm_of(turned(mapping, 2, -30.0)))
    assert found is not None
    assert found.cause.sections == (1,)
    assert np.degrees(found.cause.turns[0]) == pytest.approx(-30.0, abs=4.0)


def test_chambers_where_the_file_has_them_are_not_turned_by_other_numbers() -> None:
    mapping = nominal(2)
    for section in mapping["section"]:
        section["stiffness"] = [1.5 * k for k in section["stiffness"]]
        section["rest_length"] *= 0.98
    assert sections(arm_of(nominal(2)), arm_of(turned(mapping, 2, 4.0))) is None
