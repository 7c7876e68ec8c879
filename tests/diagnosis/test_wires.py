"""Wires that do not run quite where the file has them: a matter of the setup, told from what the arm does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis.model import of_wire, plain_model
from bha.diagnosis.preparation import prepare
from bha.estimation.runs import Integration
from bha.estimation.scale import wires_free
from bha.parameters import ArmParameters
from bha.recordings import Observation

from .synthetic import one_section, pressures, run_of

#: Azimuths, deg, and radii, m, of three wires, as they run and as the file has them.
TRUE, FILED = ((31.5, 0.0905), (148.8, 0.0872), (270.9, 0.0893)), ((30.0, 0.09), (150.0, 0.09), (270.0, 0.09))
CREEP = {"kind": "creep", "where": "all", "parameters": {"stiffness": 120.0, "tau": 1.5}}
KINDS = ("creep", "pressure_offset", "base_tilt")


def wired(places: tuple[tuple[float, float], ...], **provenance: str) -> bha.Arm:
    """The section with three wires."""
    wires = [
        {"name": f"wire{k}", "angle_deg": angle, "radius": radius, "sections": [1]}
        for k, (angle, radius) in enumerate(places, start=1)
    ]
    if provenance:
        wires = [wire | {"provenance": provenance} for wire in wires]
    return bha.Arm(ArmParameters.from_mapping(one_section().parameters.to_mapping() | {"length_sensor": wires}))


def logs_of(effects: list[dict[str, Any]], noise: float = 5e-5) -> list[bha.Log]:
    """Three logs of the arm as its wires run."""
    arm, logs = wired(TRUE), []
    names = [f"wire{k}" for k in (1, 2, 3)]
    for number in range(3):
        rng = np.random.default_rng([6, number])
        time = np.arange(1201) * 5e-3
        p = pressures(time, "multisine" if number == 1 else "steps", rng)
        lengths = run_of(arm, time, p, effects).lengths
        seen = Observation.of(arm.parameters, outputs_of(arm, names)).predicted(lengths, None, None)
        columns = {"t [s]": time, **{f"p1{k + 1} [Pa]": p[:, k] for k in range(3)}}
        columns |= {f"{name} [m]": seen[:, k] + noise * rng.standard_normal(len(time)) for k, name in enumerate(names)}
        logs.append(bha.Log.from_arrays(columns))
    return logs


def outputs_of(arm: bha.Arm, names: list[str]) -> Any:
    """The outputs of wires, as a log that has them is read."""
    columns = {"t [s]": np.arange(60) * 5e-3, **{f"p1{k} [Pa]": np.full(60, 101325.0) for k in (1, 2, 3)}}
    log = bha.Log.from_arrays(columns | {f"{name} [m]": np.full(60, 0.3) for name in names})
    return prepare(bha.Recording(arm, log)).observation.outputs


def test_wires_elsewhere_hide_no_effect_and_are_written(tmp_path: Path) -> None:
    logs = logs_of([CREEP])
    found = bha.diagnose(wired(FILED), logs[:2], logs[2:], out=tmp_path, kinds=KINDS, report=False)
    assert [(e.kind, e.where) for e in found.effects] == [("creep", "all")]
    assert found.effects[0].parameters["stiffness"].value == pytest.approx(120.0, rel=0.1)
    assert found.gap.after < 1.5 * found.gap.noise < 0.1 * found.gap.before
    # Weight tells how they lie by each other; that all are turned alike and the section the other way, nothing does.
    written = bha.Arm.load(tmp_path / "arm_diagnosed.toml").parameters.length_sensors
    apart = np.diff([np.degrees(wire.angle_rad) for wire in written])
    assert apart == pytest.approx(np.diff([angle for angle, _ in TRUE]), abs=0.7)
    assert all(wire.provenance[key].status == "identified" for wire in written for key in ("angle", "radius"))


def test_a_run_is_shown_by_its_own_wires_and_simulated_once() -> None:
    arm = wired(FILED)
    record = prepare(bha.Recording(arm, logs_of([], 0.0)[0]))
    model = plain_model(arm, wires=tuple(wires_free(arm.parameters, [record]))).on([record])
    places = [k for k, c in enumerate(model.plain) if of_wire(c)]
    wanted = [f"length_sensor.{k}.{name}" for k in (1, 2, 3) for name in ("angle", "radius")]
    assert [model.plain[k].path for k in places] == wanted
    still, moved = np.zeros(model.size), np.zeros(model.size)
    for k, (angle, radius) in zip(places[::2], TRUE, strict=True):
        moved[k] = model.plain[k].coordinate(np.radians(angle))
        moved[k + 1] = model.plain[k + 1].coordinate(radius)
    assert model.shown(moved, 0)[0] is model.shown(still, 0)[0]
    state = np.concatenate([arm.static_lengths(record.drive.pressures[0]), np.zeros(3)])
    plain, seen = Integration(5e-3, threads=1).run([model.runs(z, [state])[0] for z in (still, moved)])
    true = plain_model(wired(TRUE)).on([record])
    (own,) = Integration(5e-3, threads=1).run(true.runs(np.zeros(true.size), [state]))
    assert np.allclose(seen, own, rtol=0.0, atol=1e-12)
    assert np.max(np.abs(plain - own)) > 1e-4


def test_wires_that_are_published_stay() -> None:
    arm = wired(FILED, angle_deg="published", radius="published")
    record = prepare(bha.Recording(arm, logs_of([], 0.0)[0]))
    assert not wires_free(arm.parameters, [record])
