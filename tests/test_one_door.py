"""One log through every command: four bellows, a wire, thin air, valves, late sensors, held samples."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main
from bha.diagnosis.model import plain_model
from bha.diagnosis.preparation import prepare
from bha.estimation.runs import Integration
from bha.identification import predict, record
from bha.parameters import ArmParameters
from bha.recordings import PressureSort
from bha.sweeps.plan import make_plan

AMBIENT, NOISE, RATE = 71000.0, 2e-4, 100.0
#: A reading of the lengths is held for so many rows.
HELD = 3
PNEUMATICS: dict[str, Any] = {
    **bha.robots.parameters("bha_nominal").to_mapping()["pneumatics"],
    "fill_time": 0.12,
    "vent_time": 0.25,
    "supply_pressure": 3e5,
    "exhaust_pressure": AMBIENT,
}


def arm_of(level: str) -> bha.Arm:
    """One section of four bellows at 3,000 m with valves, a wire, and sensors that are late and off."""
    nominal = bha.robots.parameters("bha_nominal").to_mapping()
    section = {k: v for k, v in nominal["section"][0].items() if k != "provenance"}
    section |= {"bellows": [{"angle_deg": 90.0 * k} for k in range(4)], "pressure_range": [6e4, 2e5]}
    mapping = {k: v for k, v in nominal.items() if k != "provenance"}
    mapping |= {
        "name": "four",
        "section": [section],
        "ambient_pressure": AMBIENT,
        "pneumatics": {**PNEUMATICS, "level": level},
        "length_sensor": [{"name": "wire", "angle_deg": 30.0, "radius": 0.06, "sections": [1], "offset": 0.02}],
        "sensors": {"camera_position": [0.01, -0.02, 0.005]},
        "effect": [
            {"kind": "delay", "where": "sensors", "time": 0.02},
            {"kind": "length_gain", "where": "section 1", "gain": 0.03},
            {"kind": "pressure_offset", "where": "input p12", "offset": 800.0},
        ],
    }
    return bha.Arm(ArmParameters.from_mapping(mapping))


def write_log(arm: bha.Arm, path: Path) -> None:
    """A log of held commands, measured gauge pressures, lengths of four bellows and a wire that are held, and heads."""
    rng = np.random.default_rng(5)
    time = np.arange(601) / RATE
    levels = AMBIENT + rng.uniform(1e4, 6e4, (6, 4))
    command = levels[np.minimum((time / 1.0).astype(int), 5)]
    drive = bha.Input(time, command)
    run = bha.simulate(arm, drive, options=bha.Options(interpolation="hold", rtol=1e-8, atol=1e-10), dt=1.0 / RATE)
    assert run.measured_lengths is not None
    assert run.measured_head_positions is not None
    q = run.measured_lengths / 1.03
    radius = arm.parameters.sections[0].bellows_radius
    u, v = (q[:, 1] + q[:, 2] - 2 * q[:, 0]) / (3 * radius), (q[:, 2] - q[:, 1]) / (np.sqrt(3) * radius)

    def arc(angle: float, at: float) -> np.ndarray:
        return np.asarray(q.mean(axis=1) - at * (u * np.cos(angle) + v * np.sin(angle)))

    renewed = np.arange(len(time)) // HELD * HELD
    columns: dict[str, Any] = {"t [ms]": 1e3 * (1.7e9 + time)}
    columns |= {f"pc1{k + 1} [kPa(g)]": (command[:, k] - AMBIENT) / 1e3 for k in range(4)}
    columns |= {f"p1{k + 1} [kPa(g)]": (run.pressures[:, k] - AMBIENT) / 1e3 for k in range(4)}
    for k in range(4):
        length = 1.03 * arc(np.pi / 2 * k, radius) + NOISE * rng.standard_normal(len(time))
        columns[f"q1{k + 1} [mm]"] = 1e3 * length[renewed]
    wire = arc(np.pi / 6, 0.06) + 0.02 + NOISE * rng.standard_normal(len(time))
    columns["wire [mm]"] = 1e3 * wire[renewed]
    heads = run.measured_head_positions[:, 0] - [0.01, -0.02, 0.005] + NOISE * rng.standard_normal((len(time), 3))
    columns |= {f"{axis}1 [m]": heads[:, k] for k, axis in enumerate("xyz")}
    text = ",".join(columns) + "\n"
    text += "\n".join(",".join(repr(float(value)) for value in row) for row in zip(*columns.values(), strict=True))
    path.write_text(text + "\n")


# Where nothing lies between command and chamber, chambers jump as no sensor shows it.
CASES = [("ideal", "commanded"), ("lag", "measured"), ("lag", "commanded"), ("full", "measured"), ("full", "commanded")]


@dataclass(frozen=True)
class Case:
    arm: bha.Arm
    toml: Path
    csv: Path
    sort: PressureSort


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    level, sort = request.param
    folder = tmp_path_factory.mktemp(level)
    arm = arm_of(level)
    arm.save(folder / "four.toml")
    write_log(arm, folder / "log.csv")
    return Case(arm, folder / "four.toml", folder / "log.csv", sort)


CHANNELS = ("q11", "q12", "q13", "q14", "wire", "x1", "y1", "z1")


def test_simulate(case: Case) -> None:
    toml, csv, sort = case.toml, case.csv, case.sort
    done = CliRunner().invoke(main, ["simulate", str(toml), "--input", str(csv), "--pressures", sort, "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert tuple(found["output_error_rms"]) == CHANNELS
    assert max(found["output_error_rms"].values()) < 1.6 * NOISE
    recording = found["recording"]
    assert recording["pressures"]["sort"] == sort
    assert recording["pressures"]["between_samples"] == ("hold" if sort == "commanded" else "linear")
    held = {output["name"]: output["held"] for output in recording["outputs"]}
    assert held["q14"] == held["wire"] == pytest.approx(1.0 - 1.0 / HELD, abs=0.01)
    assert held["x1"] == 0.0


def test_identify(case: Case) -> None:
    arm, csv, sort = case.arm, case.csv, case.sort
    rec = record(arm, csv, pressures=sort)
    (held,) = predict(arm, [rec])
    assert rec.channels == CHANNELS
    assert np.all(held.rms < 1.3 * NOISE)


def test_diagnose(case: Case) -> None:
    arm, csv, sort = case.arm, case.csv, case.sort
    recording = bha.Recording(arm, csv, pressures=sort)
    rec = prepare(recording)
    model = plain_model(recording.acting)
    # What the arm showed lies before: at rest, where the log begins.
    state = np.concatenate(
        [recording.acting.static_lengths(rec.drive.pressures[0] + [0.0, 800.0, 0.0, 0.0]), np.zeros(3)]
    )
    (outputs,) = Integration(2e-3, threads=1).run(model.on([rec]).runs(np.zeros(model.size), [state]))
    error = np.sqrt(
        np.mean(np.where(rec.usable, rec.measured - outputs, 0.0) ** 2, axis=0) / np.mean(rec.usable, axis=0)
    )
    assert np.all(error < 1.3 * NOISE)


def test_sweep(case: Case) -> None:
    arm, toml, csv, sort = case.arm, case.toml, case.csv, case.sort
    spec = {
        "schema": "bha-sweep/1",
        "arm": str(toml),
        "kind": "monte_carlo",
        "runs": 1,
        "input": {"logs": [str(csv)], "log_pressures": sort},
        "vary": [{"what": "section.1.mass", "distribution": "uniform", "low": 0.7, "high": 0.8}],
    }
    made = make_plan(spec)
    recording = bha.Recording(arm, csv, pressures=sort)
    (drive,) = made.inputs
    np.testing.assert_array_equal(drive.pressures, recording.drive.pressures)
    np.testing.assert_array_equal(drive.time, recording.drive.time)
    assert made.arm.pneumatics_level == recording.acting.pneumatics_level


def test_python(case: Case) -> None:
    arm, csv, sort = case.arm, case.csv, case.sort
    log = bha.Log.read(csv)
    run = bha.simulate(arm, log, pressures=sort)
    recording = bha.Recording(arm, log, pressures=sort)
    error = np.sqrt(np.nanmean(recording.errors(run) ** 2, axis=0))
    assert np.all(error < 1.6 * NOISE)
    batch = bha.simulate_batch(arm, recording, times=recording.time, method="rk4", step=1e-3)
    assert batch.succeeded.all()
    single = np.column_stack([np.interp(recording.time, run.time, q) for q in run.lengths.T])
    assert np.abs(batch.lengths[0] - single).max() < 1e-3
