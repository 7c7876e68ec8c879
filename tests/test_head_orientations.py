"""Orientations of heads in trajectories, batches and files, heads that are measured late, virtual lengths."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha import reference
from bha.arm.geometry import bellows_length_rows, rotations_of
from bha.diagnosis import catalogue, places
from bha.errors import InputError, LogError, ParameterError
from bha.logs import Log
from bha.runs.simulation import concatenate

TORSION = {"kind": "torsion", "where": "all", "stiffness": 20.0}
DELAYS = [
    {"kind": "delay", "where": "sensors", "time": 0.0123},
    {"kind": "delay", "where": "section 2", "time": 0.05},
    {"kind": "length_offset", "where": "section 1", "offset": 2e-3},
]


@pytest.fixture(scope="module")
def arm() -> bha.Arm:
    return bha.robots.load("bha_nominal")


@pytest.fixture(scope="module")
def swing() -> bha.Input:
    time = np.linspace(0.0, 1.0, 101)
    phases = np.arange(9)
    pressures = 1.3e5 + 3e4 * np.sin(4.0 * time[:, None] + phases) * (1.0 - np.exp(-6.0 * time[:, None]))
    return bha.Input(time, pressures)


def with_four_bellows() -> bha.Arm:
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    mapping["section"] = mapping["section"][:2]
    mapping["section"][0]["bellows"] = [{"angle_deg": 45.0 + 90.0 * k} for k in range(4)]
    return bha.Arm(bha.parameters.ArmParameters.from_mapping(mapping))


def test_orientations_are_those_of_the_kinematics(arm: bha.Arm, swing: bha.Input) -> None:
    twisted = arm.with_effects([TORSION, {"kind": "taper", "where": "section 1", "change": 0.3}])
    plain = bha.simulate(arm, swing, dt=0.1, method="rk4")
    found = bha.simulate(twisted, swing, dt=0.1, method="rk4")
    for model, run in ((arm, plain), (twisted, found)):
        assert run.head_orientations is not None
        assert run.head_orientations.shape == (11, 3, 4)
        np.testing.assert_allclose(np.linalg.norm(run.head_orientations, axis=2), 1.0, atol=1e-15)
        assert (run.head_orientations[..., 0] >= 0).all()
        for q, orientations in zip(run.lengths, run.head_orientations, strict=True):
            np.testing.assert_allclose(rotations_of(orientations), model.forward_kinematics(q)[1], atol=1e-14)
    assert plain.head_orientations is not None
    assert found.head_orientations is not None
    assert np.abs(plain.head_orientations - found.head_orientations).max() > 1e-4


def test_orientations_against_the_reference_at_random_states(arm: bha.Arm, tmp_path: Path) -> None:
    arm.parameters.write(tmp_path / "arm.toml")
    ideal = reference.load_arm(tmp_path / "arm.toml")
    states = np.hstack([np.random.default_rng(4).uniform(0.12, 0.26, (6, 9)), np.zeros((6, 9))])
    still = bha.Input(np.array([0.0]), np.full((1, 9), 1.2e5))
    batch = bha.simulate_batch(arm, still, states, times=[0.0], head_orientations=True, head_positions=True)
    assert batch.head_orientations is not None
    assert batch.head_positions is not None
    for k, q in enumerate(states[:, :9]):
        positions, rotations = reference.kinematics.switched_forward_kinematics(ideal, q)
        np.testing.assert_allclose(batch.head_positions[k, 0], positions, atol=1e-12)
        np.testing.assert_allclose(rotations_of(batch.head_orientations[k, 0]), rotations, atol=1e-12)


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_delayed_heads_are_those_of_an_earlier_time(arm: bha.Arm, swing: bha.Input, method: str) -> None:
    options = bha.Options(method=method, step=1e-3, rtol=1e-9, atol=1e-11)  # type: ignore[arg-type]
    times = np.arange(0.1, 1.0, 0.03)
    twisted = arm.with_effects([TORSION])

    def run(model: bha.Arm, at: NDArray[np.float64]) -> bha.Trajectory:
        return bha.Simulation(model, swing, options, start=0.0).advance(at)

    now, late, later = (run(twisted, times - delay) for delay in (0.0, 0.0123, 0.0623))
    assert now.measured_head_positions is None
    assert now.measured_head_orientations is None
    whole = bha.Simulation(arm.with_effects([TORSION, *DELAYS]), swing, options, start=0.0)
    found = concatenate([whole.advance(part) for part in (times[:7], times[7:7], times[7:])])
    np.testing.assert_allclose(found.head_positions, now.head_positions, atol=1e-9)
    for name in ("head_positions", "head_orientations"):
        measured = getattr(found, f"measured_{name}")
        for section, expected in enumerate((late, later, late)):
            np.testing.assert_allclose(measured[:, section], getattr(expected, name)[:, section], atol=1e-6)
        assert np.abs(measured - getattr(now, name)).max() > 1e-3
        np.testing.assert_array_equal(getattr(found[3:5], f"measured_{name}"), measured[3:5])


def test_batches_give_what_is_measured_or_what_is(arm: bha.Arm, swing: bha.Input) -> None:
    arms = [arm.with_effects([*DELAYS[:1], {**DELAYS[1], "time": 0.01 * k}, DELAYS[2]]) for k in range(3)]
    times = np.linspace(0.0, 0.5, 11)
    for measured in (True, False):
        batch = bha.simulate_batch(
            arms, swing, times=times, head_positions=True, head_orientations=True, measured=measured, method="rk4"
        )
        for k, model in enumerate(arms):
            alone = bha.Simulation(model, swing, bha.Options(method="rk4")).advance(times)
            for name in ("lengths", "head_positions", "head_orientations"):
                expected = getattr(alone, f"measured_{name}" if measured else name)
                np.testing.assert_allclose(getattr(batch, name)[k], expected, rtol=0, atol=1e-12)
    plain = bha.simulate_batch(arm, swing, times=times)
    assert plain.head_orientations is None


def test_a_delay_of_a_section_does_not_delay_its_pressures(arm: bha.Arm, swing: bha.Input) -> None:
    delayed = bha.simulate(arm.with_effects([DELAYS[1]]), swing, dt=0.1, method="rk4")
    plain = bha.simulate(arm, swing, dt=0.1, method="rk4")
    np.testing.assert_allclose(delayed.lengths, plain.lengths, atol=1e-13)
    assert delayed.measured_lengths is not None
    assert np.abs(delayed.measured_lengths - plain.lengths)[:, 3:6].max() > 1e-4


@pytest.mark.parametrize("extension", ["csv", "csv.gz", "parquet"])
def test_files_hold_orientations_and_read_back_as_logs(
    arm: bha.Arm, swing: bha.Input, tmp_path: Path, extension: str
) -> None:
    if extension == "parquet":
        pytest.importorskip("pyarrow")
    run = bha.simulate(arm, swing, dt=0.1)
    log = Log.read(run.write(tmp_path / f"run.{extension}"))
    assert log.head_orientations is not None
    np.testing.assert_array_equal(log.head_orientations, run.head_orientations)
    assert log.head_positions is not None
    np.testing.assert_array_equal(log.head_positions, run.head_positions)
    np.testing.assert_array_equal(log.lengths, run.lengths)
    assert log.units["ow1"] == "1"
    log.write(tmp_path / "again.csv")
    np.testing.assert_array_equal(Log.read(tmp_path / "again.csv").head_orientations, log.head_orientations)


def test_npz_holds_orientations_if_there_are_any(arm: bha.Arm, swing: bha.Input, tmp_path: Path) -> None:
    run = bha.simulate(arm, swing, dt=0.1)
    with np.load(run.write(tmp_path / "run.npz"), allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["head_orientations"], run.head_orientations)
        assert not arrays["virtual_lengths"]
    names = ("time", "lengths", "velocities", "pressures", "head_positions")
    bare = bha.Trajectory(**{name: getattr(run, name) for name in names}, input_names=run.input_names)
    assert bare.head_orientations is None
    assert not any(heading.startswith("o") for heading in bare.columns())
    with np.load(bare.write(tmp_path / "bare.npz"), allow_pickle=False) as arrays:
        assert "head_orientations" not in arrays
    with pytest.raises(InputError, match=r"head_orientations: expected shape \(11, 3, 4\), found \(11, 3, 3\)"):
        bha.Trajectory(**{**vars(run), "head_orientations": run.head_positions})


@pytest.mark.parametrize("extension", ["csv", "parquet"])
def test_lengths_that_are_no_bellows_own_say_so(tmp_path: Path, extension: str) -> None:
    if extension == "parquet":
        pytest.importorskip("pyarrow")
    arm = with_four_bellows()
    run = bha.simulate(arm, bha.Input.constant(np.linspace(1.1e5, 1.4e5, len(arm.inputs)), 0.3), dt=0.05)
    assert run.virtual_lengths
    assert run.columns()[1:4] == ["qv11 [m]", "qv12 [m]", "qv13 [m]"]
    assert run[:2].virtual_lengths
    log = Log.read(run.write(tmp_path / f"run.{extension}"))
    assert log.lengths is None
    np.testing.assert_array_equal(log.coordinates, run.lengths)
    np.testing.assert_array_equal(log.coordinate_velocities, run.velocities)
    with np.load(run.write(tmp_path / "run.npz")) as arrays:
        assert arrays["virtual_lengths"]


def test_lengths_of_further_bellows_are_not_misplaced() -> None:
    columns = {"t [s]": [0.0, 1.0], **{f"q1{k} [mm]": [100.0, 110.0 + k] for k in (1, 2, 3, 4)}, "q21 [m]": [0.2, 0.2]}
    log = Log.from_arrays(columns)
    np.testing.assert_allclose(log["q14"], [0.1, 0.114])
    with pytest.raises(LogError, match=r"column 'q14' is of bellows 4 .* bha\.Recording\(arm, log\)"):
        _ = log.lengths
    assert log.head_orientations is None
    rates = Log.from_arrays({"t [s]": [0.0], "qd2_12 [m/s]": [0.1]})
    with pytest.raises(LogError, match="bellows 12"):
        _ = rates.velocities


def test_orientations_of_logs_need_no_unit_and_take_no_other(tmp_path: Path) -> None:
    path = tmp_path / "log.csv.gz"
    with gzip.open(path, "wt") as file:
        file.write("t [s],ow2,ox2 [1],oy2 [-],oz2 []\n0,1,0,0,0\n1,0.8,0.6,0.5,0\n")
    log = Log.read(path)
    assert log.head_orientations is not None
    assert log.head_orientations.shape == (2, 2, 4)
    assert np.isnan(log.head_orientations[:, 0]).all()
    np.testing.assert_allclose(log.head_orientations[1, 1], [0.8, 0.6, 0.5, 0.0])
    for heading, text in (
        ("ow1 [m]", "unit 'm' does not fit; expected a plain number: leave the unit out or write"),
        ("OW_1", r"did you mean 'ow1 \[1\]'\? Rename it"),
        ("ow1 (1)", r"did you mean 'ow1 \[1\]'\? Rename it"),
        ("qv 11 [mm]", r"did you mean 'qv11 \[mm\]'\? Rename it"),
        ("qvd11", r"has no unit; write it as 'qvd11 \[m/s\]'"),
    ):
        with pytest.raises(LogError, match=text):
            Log.from_arrays({"t [s]": [0.0], heading: [1.0]})


@pytest.mark.parametrize("kind", ["delay", "length_gain", "length_offset"])
def test_sensors_of_single_bellows_are_those_of_coordinates(kind: str) -> None:
    arm = with_four_bellows()
    table = {"kind": kind, "time" if kind == "delay" else kind.removeprefix("length_"): 0.01}
    for where in ("section 1", "bellows 21"):
        arm.with_effects([{**table, "where": where}])
    for where in ("bellows 12", "bellows 14"):
        with pytest.raises(ParameterError, match=r'effect 1: where: found "bellows 1[24]"; .* allowed: "section 1"'):
            arm.with_effects([{**table, "where": where}])
    as_coordinates = bha.Arm(arm.parameters.updated({"sensors": {"lengths": "coordinates"}}))
    as_coordinates.with_effects([{**table, "where": "bellows 12"}])
    core = json.loads(arm.parameters.to_core_json())
    plan = next(plan for plan in catalogue.available() if plan.kind == "length_offset")
    second = ["bellows 21", "bellows 22", "bellows 23"]
    assert places.places(plan, core, arm.parameters.measures_coordinates) == second
    everywhere = as_coordinates.parameters.measures_coordinates
    assert places.places(plan, core, everywhere) == ["bellows 11", "bellows 12", "bellows 13", *second]


def test_a_common_offset_of_sensors_is_one_of_every_bellows() -> None:
    """What acts on all coordinates of a section alike acts on its bellows alike, wherever these are."""
    arm = with_four_bellows()
    rows = bellows_length_rows(arm.parameters.sections[0], 0, 2)
    q = np.random.default_rng(3).uniform(0.12, 0.2, 6)
    np.testing.assert_allclose(rows @ (q + 0.01), rows @ q + 0.01, atol=1e-15)
    np.testing.assert_allclose(rows @ (1.02 * q), 1.02 * (rows @ q), atol=1e-15)
