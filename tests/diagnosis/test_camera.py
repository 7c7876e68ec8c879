"""A camera that stands beside the arm's base: a matter of the setup, told from what the arm does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha.arm.geometry import camera_frame
from bha.diagnosis.arm_figure import measured_curve
from bha.diagnosis.model import of_camera, plain_model, sensors_at
from bha.diagnosis.preparation import prepare
from bha.estimation.runs import Integration
from bha.parameters import ArmParameters
from bha.parameters.sensors import SensorsParameters
from bha.recordings import Observation

from .synthetic import observation, one_section, pressures, run_of
from .test_heads import OFF, log_of_heads

POSITION, TURN = (0.012, -0.009, 0.004), (0.02, -0.01, 0.03)
CREEP = {"kind": "creep", "where": "all", "parameters": {"stiffness": 120.0, "tau": 1.5}}
KINDS = ("creep", "pressure_offset", "base_tilt")


def seen_by_another_camera(effects: list[dict[str, Any]]) -> list[bha.Log]:
    """Three logs of heads of an arm, in a frame that is not its base's."""
    arm, logs = one_section(), []
    camera = camera_frame(SensorsParameters(camera_position=POSITION, camera_rotation=TURN))
    for number in range(3):
        time = np.arange(801) * 5e-3
        p = pressures(time, "multisine" if number == 1 else "steps", np.random.default_rng([4, number]))
        run = run_of(arm, time, p, effects)
        log = log_of_heads(arm, time, p, run, number, 2e-4)
        heads = camera.positions(np.column_stack([log[f"{axis}1"] for axis in "xyz"]))
        columns = {f"p1{k} [Pa]": log[f"p1{k}"] for k in (1, 2, 3)}
        columns |= {f"{axis}1 [m]": heads[:, k] for k, axis in enumerate("xyz")}
        logs.append(bha.Log.from_arrays({"t [s]": time, **columns}))
    return logs


def test_a_camera_elsewhere_is_equivalent_and_is_said(tmp_path: Path) -> None:
    logs = seen_by_another_camera([])
    found = bha.diagnose(one_section(OFF), logs[:2], logs[2:], out=tmp_path, kinds=KINDS, report=False)
    assert found.verdict == "equivalent"
    assert found.gap.before < 1.1 * found.gap.noise
    for axis, position, turn in zip("xyz", POSITION, TURN, strict=True):
        assert found.plain[f"camera_position {axis}"].value == pytest.approx(position, abs=1.5e-3)
        assert found.plain[f"camera_rotation {axis}"].value == pytest.approx(turn, abs=4e-3)
    (text,) = found.setup
    assert "stands 15.6 mm beside" in text
    # The new file has that camera, with its intervals.
    diagnosed = bha.Arm.load(tmp_path / "arm_diagnosed.toml")
    written = diagnosed.parameters.sensors
    assert written is not None
    assert written.camera_position == pytest.approx(POSITION, abs=1.5e-3)
    assert written.provenance["camera_position"].status == "identified"
    assert written.provenance["camera_rotation"].ci95 is not None
    # The arm is drawn beside heads as that camera sees them.
    base, head = np.zeros((1, 3)), np.array([[0.01, -0.02, 0.3]])
    seen = camera_frame(SensorsParameters(camera_position=POSITION, camera_rotation=TURN)).positions(head)
    layout = Observation.of(diagnosed.parameters, observation("x1", "y1", "z1").outputs)
    curve = measured_curve(diagnosed, layout, seen.ravel(), base)
    assert curve == pytest.approx(np.concatenate([base, head]), abs=3e-3)


def test_creep_behind_a_camera_elsewhere_is_named() -> None:
    logs = seen_by_another_camera([CREEP])
    found = bha.diagnose(one_section(OFF), logs[:2], logs[2:], kinds=KINDS)
    assert [(e.kind, e.where) for e in found.effects] == [("creep", "all")]
    assert found.effects[0].parameters["stiffness"].value == pytest.approx(120.0, rel=0.15)
    assert "camera_position" in found.setup[0]


def test_published_frames_stay_and_lengths_have_none() -> None:
    arm = one_section()
    assert [c.name for c in plain_model(arm, camera=True).plain[-6:]] == [
        f"{key} {axis}" for key in ("camera_position", "camera_rotation") for axis in "xyz"
    ]
    known = {"camera_position": [0.1, 0.0, 0.0], "provenance": {"camera_position": "published"}}
    mapping = arm.parameters.to_mapping() | {"sensors": known}
    fixed = bha.Arm(ArmParameters.from_mapping(mapping))
    model = plain_model(fixed, camera=True)
    assert [c.name for c in model.plain if of_camera(c)] == [f"camera_rotation {axis}" for axis in "xyz"]
    seen = sensors_at(model, np.zeros(model.size))
    assert seen is not None
    assert np.array_equal(seen.camera_position, [0.1, 0.0, 0.0])
    assert sensors_at(plain_model(arm), np.zeros(plain_model(arm).size)) is None


def test_a_run_is_seen_by_its_own_camera() -> None:
    arm, log = one_section(), seen_by_another_camera([])[0]
    record = prepare(bha.Recording(arm, log))
    model = plain_model(arm, camera=True)
    model = model.on([record])
    still, x = np.zeros(model.size), np.zeros(model.size)
    state = np.concatenate([arm.static_lengths(record.drive.pressures[0]), np.zeros(3)])
    x[-6:] = [1.0, -0.5, 0.2, 0.3, 0.1, -0.4]
    assert model.shown(x, 0)[0] is model.shown(still, 0)[0]
    runs = [model.runs(z, [state + d])[0] for z, d in ((still, 0.0), (x, 0.0), (still, 1e-3))]
    plain, seen, other = Integration(5e-3, threads=1).run(runs)
    sensors = sensors_at(model, x)
    assert sensors is not None
    assert np.allclose(seen, camera_frame(sensors).positions(plain), rtol=0.0, atol=1e-15)
    assert not np.array_equal(other, plain)
