"""A laboratory with short measurements; what the static measurements would identify is taken from the design."""

from __future__ import annotations

import pytest

from bha.experiments import Laboratory
from bha.experiments.measured import with_sections


@pytest.fixture(scope="session")
def laboratory() -> Laboratory:
    """Dynamic experiments need no static measurements here: springs and bending stiffness are the design's."""
    lab = Laboratory(hold=0.5, swing_time=4.0)
    lab.dynamic_step = 1e-3
    lumped = lab.lumped
    known = [
        {"rest_length": s.rest_length, "stiffness": list(s.stiffness), "bending_stiffness": list(s.bending_stiffness)}
        for s in lab.design.parameters.sections
    ]
    for steps in (each for one in (lab, lumped) for each in (one.paper, one.balanced, one.spread)):
        steps.__dict__["undamped"] = with_sections(steps.weighed, known, "identified")
    return lab
