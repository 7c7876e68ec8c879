from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.checkup.held import that_move
from bha.checkup.rivals import _rivals
from bha.parameters import EFFECT_KINDS

from .made_logs import arm_of, log_of, nominal, steps


@pytest.mark.parametrize("see", ["lengths", "heads"])
@pytest.mark.parametrize("stands", [False, True])
def test_an_arm_of_three_sections_that_hangs_the_other_way(see: str, stands: bool) -> None:
    """By what the outer section's weight does to the inner one, whatever rest lengths and stiffness are."""
    mapping = nominal(3)
    for section in mapping["section"]:
        section["stiffness"] = [1.3 * k for k in section["stiffness"]]
        section["rest_length"] = 0.155  # as much as the weight stretches
    real = arm_of(mapping).with_changes(gravity=[0.0, 0.0, -9.81 if stands else 9.81])
    filed = arm_of(nominal(3))
    for arm, wrong in ((filed.with_changes(gravity=real.parameters.gravity), False),
                       (filed.with_changes(gravity=[0.0, 0.0, 9.81 if stands else -9.81]), True)):  # fmt: skip
        found = bha.check(arm, log_of(real, *steps(filed), see=see, noise=3e-4))
        assert [f.kind for f in found.faults] == ["gravity"] * wrong
        if wrong:
            assert found.faults[0].explanations[0].repair == f"gravity = [0, 0, {-9.81 if stands else 9.81}]"


def column(**other: object) -> bha.Arm:
    """A soft heavy arm of one section with four chambers."""
    mapping = nominal(1)
    mapping["section"][0].update(
        mass=0.43, inertia=[1.5e-3, 1.5e-3, 4e-4], bellows_radius=0.03, bellows_outer_radius=0.02, terminal_area=6e-4,
        rest_length=0.29, stiffness=[600.0], damping=15.0, bending_stiffness=[0.5], length_range=[0.2, 0.42],
        pressure_range=[1.0e5, 1.6e5], bellows=[{"angle_deg": 90.0 * k, "input": f"p1{k + 1}"} for k in range(4)],
    )  # fmt: skip
    mapping["section"][0].update(other)
    return arm_of(mapping)


def test_what_a_rest_length_explains_as_well_is_no_gravity() -> None:
    """A column that hangs, longer than a tape measure said: as much as its weight reversed would shorten it."""
    arm = column()
    found = bha.check(column(rest_length=0.286), log_of(arm, *steps(arm), see="lengths"))
    assert found.faults == ()
    assert any("sign of gravity" in text for text in found.untold)


@pytest.mark.parametrize(
    "pull",
    [
        {"kind": "tool_drag", "where": "section 1", "stiffness": 15.0, "anchor_x": -0.3, "anchor_z": 0.3},
        {"kind": "weak_bellows", "where": "bellows 11", "change": -0.4},
        {"kind": "pressure_offset", "where": "input p12", "offset": 8e3},
    ],
    ids=["hose", "weak bellows", "pressure"],
)
@pytest.mark.parametrize("gravity", [[9.81, 0.0, 0.0], [0.0, 0.0, 9.81]], ids=["lies", "hangs"])
def test_physics_that_pulls_the_arm_is_no_gravity(pull: dict[str, object], gravity: list[float]) -> None:
    """A hose that holds an arm up, a bellows that gives way: as strong as its weight, and another force than it."""
    arm = column().with_changes(gravity=gravity)
    found = bha.check(arm, log_of(arm.with_effects([pull]), *steps(arm), see="lengths"))
    assert [f for f in found.findings if f.kind == "gravity"] == [], str(found)


def test_a_spring_between_sections_carries_over_and_is_no_gravity() -> None:
    """What one section bends its neighbour by has the sign that gravity reversed would give it."""
    arm = arm_of(nominal(2))
    coupled = arm.with_effects([{"kind": "section_coupling", "where": "section 1", "stiffness": 6.0}])
    found = bha.check(arm, log_of(coupled, *steps(arm), see="lengths"))
    assert [f for f in found.findings if f.kind == "gravity"] == [], str(found)


def test_a_log_at_rest_is_no_evidence() -> None:
    arm = column()
    time, pressures = steps(arm)
    moving = log_of(arm, time, pressures, see="lengths")
    still = log_of(arm, time, np.full_like(pressures, 1.2e5), see="lengths")
    short = log_of(arm, time[:30], pressures[:30], see="lengths")
    made = [bha.Recording(arm, log, warn=False) for log in (still, moving, short)]
    assert that_move(made) == [made[1]]


def test_an_arm_that_lies_sags_the_other_way() -> None:
    arm = column(rest_length=0.286, stiffness=[900.0]).with_changes(gravity=[9.81, 0.0, 0.0])
    plant = column()
    for sign in (1.0, -1.0):
        log = log_of(plant.with_changes(gravity=[sign * 9.81, 0.0, 0.0]), *steps(arm), see="lengths")
        found = bha.check(arm, log)
        assert [f.kind for f in found.faults] == ["gravity"] * (sign < 0.0), str(found)
    assert found.faults[0].explanations[0].repair == "gravity = [-9.81, 0, 0]"


def test_the_head_of_one_section_does_not_tell_and_that_is_said() -> None:
    arm = arm_of(nominal(1))
    log = log_of(arm.with_changes(gravity=[0.0, 0.0, -9.81]), *steps(arm), see="heads")
    found = bha.check(arm, log)
    assert found.faults == ()
    assert any("sign of gravity" in text for text in found.untold)


def test_rival_physics_is_what_an_effect_may_be_of_any_arm() -> None:
    """A large arm resists its bending by more than a spring between sections may, and is filled to more."""
    mapping = nominal(2)
    for section in mapping["section"]:
        section.update(stiffness=[9e5], bellows_radius=0.4, pressure_range=[1.0e5, 9.0e5])
    allowed = {(kind, n.name): (n.low, n.high) for kind in EFFECT_KINDS for n in EFFECT_KINDS[kind].parameters}
    for arm, free in _rivals(arm_of(mapping)):
        kind = arm.parameters.effects[-1].kind
        for own in free:
            low, high = allowed[kind, own.path.rpartition(".")[2]]
            assert own.lower is not None
            assert own.upper is not None
            assert low <= own.lower <= own.upper <= high
