"""Arms stiff in length and soft in bending: an axial stiffness where springs cannot say both."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bha
from bha.estimation.apart import Rates
from bha.estimation.backbone import with_axial_stiffness
from bha.estimation.begin import begin
from bha.estimation.records import record
from bha.estimation.scale import default_free_of
from bha.logs import Log
from bha.parameters import ArmParameters

BACKBONE, STIFFNESS, AREA, MASS = 2.5e4, 1300.0, 2.4e-4, 0.25


def arm_of(stiffness: float, area: float, backbone: float | None = None) -> bha.Arm:
    """An upright section with three chambers; without a backbone as a tape measure and a guess have it."""
    section: dict[str, Any] = {
        "mass": MASS,
        "bellows_radius": 0.0245,
        "bellows_outer_radius": 0.01,
        "terminal_area": area,
        "rest_length": 0.18,
        "stiffness": [stiffness],
        "damping": 100.0,
        "bending_stiffness": [0.3] if backbone is None else [0.0],
        "length_range": [0.11, 0.28],
        "pressure_range": [1.0e5, 3.2e5],
    }
    if backbone is not None:
        section |= {"axial_stiffness": [backbone], "axial_damping": 0.1 * backbone}
    head = {"schema": "bha-arm/1", "name": "upright", "gravity": [0.0, 0.0, -9.81], "ambient_pressure": 101325.0}
    model = {} if backbone is None else {"force_model": "work_conjugate"}
    return bha.Arm(ArmParameters.from_mapping({**head, **model, "section": [section]}))


def log_of(arm: bha.Arm, seed: int) -> Log:
    """One chamber driven in steps, the tip with 0.2 mm of noise."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 0.02)
    pressures = np.full((len(time), 3), 101325.0)
    pressures[:, 0] += random.uniform(0.0, 2.0e5, 11)[(time / 2.0).astype(int)]
    run = bha.simulate(arm, bha.Input(time, pressures), times=time, method="ros2", step=2e-3)
    tip = run.head_positions[:, 0] + 2e-4 * random.standard_normal((len(time), 3))
    columns = {"t [s]": time, **{f"p1{k + 1} [Pa]": pressures[:, k] for k in range(3)}}
    return Log.from_arrays(columns | {f"{axis}1 [m]": tip[:, k] for k, axis in enumerate("xyz")})


@pytest.mark.parametrize("guess", [800.0, 20000.0])
def test_one_driven_chamber_tells_an_arm_that_is_stiff_in_length(guess: float) -> None:
    start = arm_of(guess, 4e-4)
    records = [record(start, log_of(arm_of(STIFFNESS, AREA, BACKBONE), 1))]
    found = begin(start, records, default_free_of(start.parameters, records), whole=False, splits=True)
    (section,) = found.arm.parameters.sections
    assert section.axial_stiffness is not None
    assert section.bending_stiffness == (0.0,)
    assert found.arm.parameters.force_model == "work_conjugate"
    values = {f.path: f.start for f in found.free}
    assert "section.1.bending_stiffness.1" not in values
    stiffness, area = values["section.1.stiffness.1"], values["section.1.terminal_area"]
    assert stiffness is not None
    assert area is not None
    assert area / stiffness == pytest.approx(AREA / STIFFNESS, rel=0.05)
    axial = values["section.1.axial_stiffness.1"]
    assert axial is not None
    assert axial > 3.0 * stiffness
    assert found.trial.spread < 1e-3


def test_dampings_of_stretching_and_bending_share_what_the_bellows_have() -> None:
    rates = Rates(stretching=30000.0, bending=1.0, bellows=3, spread=9e-4)
    damping, bending, axial = rates.dampings(0.1, 0.15, axial=True)
    assert damping == pytest.approx(0.1 / 9e-4)
    assert bending == pytest.approx(0.0, abs=1e-12)
    assert axial == pytest.approx(0.15 * 30000.0 - 3 * damping)
    damping, bending, axial = Rates(600.0, 1.0, 3, 9e-4).dampings(0.3, 0.1)
    assert damping == pytest.approx(20.0)
    assert bending == pytest.approx(0.3 - 20.0 * 9e-4)
    assert axial == pytest.approx(0.0, abs=1e-12)


def test_a_stated_force_model_stays() -> None:
    stated = arm_of(800.0, 4e-4).parameters.updated(
        {**arm_of(800.0, 4e-4).parameters.to_mapping(), "force_model": "end_force"}
    )
    parameters, free = with_axial_stiffness(stated, ["section.1.mass", "section.1.bending_stiffness.1"], [1])
    assert parameters.force_model == "end_force"
    paths = [f if isinstance(f, str) else f.path for f in free]
    assert paths == ["section.1.mass", "section.1.axial_stiffness.1", "section.1.axial_damping"]
