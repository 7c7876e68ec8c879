"""Heads in a frame that is not the base's: the camera is identified with the arm, unless it is named otherwise."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.arm.geometry import camera_frame
from bha.identification import Settings, identify
from bha.parameters.sensors import SensorsParameters

from .identify_logs import measured, multisine, off, one_section

POSITION, TURN = (0.012, -0.009, 0.004), (0.02, -0.01, 0.03)


def test_the_camera_is_identified_by_default_where_heads_are_measured() -> None:
    arm = one_section()
    start = off(arm, {"section.1.mass": 1.15, "section.1.stiffness.1": 0.9, "section.1.damping": 1.3})
    # The scale rests on the areas then; else on the masses, and a mass that is 15 % off would be believed.
    mapping = start.parameters.to_mapping()
    mapping["section"][0].setdefault("provenance", {})["terminal_area"] = "published"
    start = bha.Arm(start.parameters.updated(mapping))
    log = measured(arm, multisine(arm, 8.0, 100.0, 3), heads=True)
    camera = camera_frame(SensorsParameters(camera_position=POSITION, camera_rotation=TURN))
    seen = camera.positions(np.column_stack([log[f"{axis}1"] for axis in "xyz"]))
    columns = {f"p1{k} [Pa]": log[f"p1{k}"] for k in (1, 2, 3)}
    columns |= {f"{axis}1 [m]": seen[:, k] for k, axis in enumerate("xyz")}
    heads = bha.Log.from_arrays({"t [s]": log.time, **columns})
    settings = Settings(windows=(0.75, 4.0), draws=0)
    found = identify(start, [heads], settings=settings)
    values = {e.path: e for e in found.estimates}
    assert values["section.1.mass"].value == pytest.approx(0.75, rel=0.03)
    for k, axis in enumerate("xyz"):
        assert values[f"sensors.camera_position.{axis}"].value == pytest.approx(POSITION[k], abs=1e-3)
        assert values[f"sensors.camera_rotation.{axis}"].value == pytest.approx(TURN[k], abs=5e-3)
    assert max(r.rms / r.noise for r in found.residuals) < 1.3
    sensors = found.parameters().sensors
    assert sensors is not None
    assert sensors.provenance["camera_position"].status == "identified"
    # Lengths alone tell of no camera.
    lengths = {f"q1{k} [m]": log[f"q1{k}"] for k in (1, 2, 3)} | dict(list(columns.items())[:3])
    only = identify(start, [bha.Log.from_arrays({"t [s]": log.time, **lengths})], settings=settings)
    assert not any(e.path.startswith("sensors") for e in only.estimates)
