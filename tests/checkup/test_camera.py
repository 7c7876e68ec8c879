from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from estimation import slow_arm

import bha
from bha.checkup.camera import signed_axes
from bha.checkup.words import axes_text, rotation_text

from .made_logs import about_z, arm_of, log_of, nominal, steps

ARM = arm_of(nominal(2))
RIGHT = steps(ARM)


def check(see: str, camera: Callable[[np.ndarray], np.ndarray]) -> bha.Checkup:
    return bha.check(ARM, log_of(ARM, *RIGHT, see=see, heads=camera))


def repaired(found: bha.Checkup, see: str, camera: Callable[[np.ndarray], np.ndarray]) -> bha.Checkup:
    """The check again, with the first line of ``[sensors]`` of the finding in the arm's file."""
    lines = [e.repair for f in found.faults for e in f.explanations if e.repair.startswith("[sensors]")]
    mapping = nominal(2)
    for entry in lines[0].removeprefix("[sensors] ").split(", camera_"):
        key, value = entry.split(" = ")
        key = key if key.startswith("camera_") else f"camera_{key}"
        mapping["sensors"][key] = json.loads(value)
    return bha.check(arm_of(mapping), log_of(ARM, *RIGHT, see=see, heads=camera))


CAMERAS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "mirrored x": lambda h: h * [-1.0, 1.0, 1.0],
    "mirrored y": lambda h: h * [1.0, -1.0, 1.0],
    "x and y exchanged": lambda h: h[..., [1, 0, 2]],
    "turned by 90": lambda h: h @ about_z(90.0).T,
    "turned by -35": lambda h: h @ about_z(-35.0).T,
    "mirrored and turned": lambda h: (h * [1.0, -1.0, 1.0]) @ about_z(50.0).T,
    "z reversed": lambda h: h * [1.0, 1.0, -1.0],
    "half a turn about x": lambda h: h * [1.0, -1.0, -1.0],
    "y up": lambda h: h[..., [0, 2, 1]],
    "z, x, y": lambda h: h[..., [2, 0, 1]],
}


@pytest.mark.parametrize("see", ["heads", "both"])
@pytest.mark.parametrize("name", CAMERAS)
def test_a_camera_is_found_and_its_line_repairs_it(name: str, see: str) -> None:
    found = check(see, CAMERAS[name])
    assert len(found.faults) == 1
    assert found.faults[0].kind in ("camera", "wiring")
    again = repaired(found, see, CAMERAS[name])
    assert again.faults == ()


def test_an_arm_on_a_wall_is_looked_at_from_its_base() -> None:
    """Base pose: right heads are right, and a camera turned about the arm's axis is mended in the world."""
    mapping = nominal(2)
    mapping["base"] = {"position": [0.4, 0.1, 1.3], "rotation_deg": [0.0, 90.0, 0.0]}
    mapping["gravity"] = [9.81, 0.0, 0.0]  # along the arm, as for the hanging one
    arm = arm_of(mapping)
    assert bha.check(arm, log_of(arm, *RIGHT, see="both")).faults == ()
    base = arm.parameters.base_pose.rotation_matrix
    camera = base @ about_z(90.0) @ base.T
    log = log_of(arm, *RIGHT, see="both", heads=lambda h: h @ camera)
    (fault,) = bha.check(arm, log).faults
    repairs = [e.repair for e in fault.explanations if e.repair.startswith("[sensors]")]
    key, value = repairs[0].removeprefix("[sensors] ").split(" = ")
    mapping["sensors"][key] = json.loads(value)
    assert bha.check(arm_of(mapping), log).faults == ()


def test_a_camera_that_is_a_little_off_is_no_fault() -> None:
    turn = about_z(5.0)
    found = check("both", lambda h: h @ turn.T + np.array([0.02, 0.0, 0.015]))
    assert found.faults == ()


def test_a_camera_somewhere_else_is_a_warning_with_its_place() -> None:
    found = check("heads", lambda h: h + np.array([2.0, 0.0, 1.0]))
    (warning,) = [f for f in found.findings if f.severity == "warning"]
    position = np.array(warning.numbers["position"])
    # The model's pose under mean pressures is not the mean pose.
    np.testing.assert_allclose(position, [-2.0, 0.0, -1.0], atol=0.15)
    assert found.faults == ()


def test_heads_exchanged() -> None:
    found = check("heads", lambda h: h[:, ::-1])
    (fault,) = found.faults
    assert "rename x2 to x1, y2 to y1, z2 to z1, x1 to x2" in fault.explanations[0].repair


def test_heads_in_millimetres_read_as_metres() -> None:
    found = check("heads", lambda h: 1e3 * h)
    assert any("m for mm" in e.what for f in found.faults for e in f.explanations)


def test_one_coordinate_in_millimetres_read_as_metres_is_further_than_the_arm_reaches() -> None:
    (fault,) = check("heads", lambda h: h * [1e3, 1.0, 1.0]).faults
    assert fault.kind == "unit"
    assert fault.what.endswith(": x1, x2")
    assert "m for mm" in fault.explanations[0].what
    assert fault.numbers["travel"] > fault.numbers["reach"]
    assert check("heads", lambda h: h).faults == ()


def test_texts_of_axes_and_rotations() -> None:
    assert len(signed_axes()) == 48
    assert axes_text(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])) == '["y", "-x", "z"]'
    assert rotation_text(about_z(30.0)) == "[0.0, 0.0, 30.0]"
    assert rotation_text(about_z(180.0)) in ("[0.0, 0.0, 180.0]", "[0.0, 0.0, -180.0]")
    assert rotation_text(np.eye(3)) == "[0.0, 0.0, 0.0]"


def test_an_arm_that_bends_anywhere_by_its_file_makes_no_fault_of_the_camera() -> None:
    factors = {"stiffness": 1 / 3, "terminal_area": 3.0, "bending_stiffness": 0.5}
    guess = slow_arm.arm_of({key: factors.get(key, 1.0) * x for key, x in slow_arm.TRUE.items()})
    found = bha.check(guess, slow_arm.log_of(slow_arm.arm_of(slow_arm.TRUE), 2, duration=15.0))
    assert found.faults == ()
