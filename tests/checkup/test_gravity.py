from __future__ import annotations

import pytest

import bha

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


def test_a_soft_heavy_column_is_told_by_its_poses_and_rest_length_may_be_it_instead() -> None:
    mapping = nominal(1)
    mapping["section"][0].update(
        mass=0.43, inertia=[1.5e-3, 1.5e-3, 4e-4], bellows_radius=0.03, bellows_outer_radius=0.02, terminal_area=6e-4,
        rest_length=0.29, stiffness=[600.0], damping=15.0, bending_stiffness=[0.5], length_range=[0.2, 0.42],
        pressure_range=[1.0e5, 1.6e5], bellows=[{"angle_deg": 90.0 * k, "input": f"p1{k + 1}"} for k in range(4)],
    )  # fmt: skip
    arm = arm_of(mapping)
    log = log_of(arm.with_changes(gravity=[0.0, 0.0, -9.81]), *steps(arm), see="lengths")
    (finding,) = [f for f in bha.check(arm, log).findings if f.kind == "gravity"]
    assert finding.explanations[0].repair == "gravity = [0, 0, -9.81]"
    assert "rest_length = 0.28" in finding.explanations[1].repair
    assert bha.check(arm, log_of(arm, *steps(arm), see="lengths")).faults == ()


def test_the_head_of_one_section_does_not_tell_and_that_is_said() -> None:
    arm = arm_of(nominal(1))
    log = log_of(arm.with_changes(gravity=[0.0, 0.0, -9.81]), *steps(arm), see="heads")
    found = bha.check(arm, log)
    assert found.faults == ()
    assert any("sign of gravity" in text for text in found.untold)
