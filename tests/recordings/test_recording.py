"""One log through the door: pressures, outputs, findings; what is refused, and what is said."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import bha
from bha.parameters import ArmParameters
from bha.recordings import Recording, clock, recordings

AMBIENT = 70000.0


def arm_of(bellows: tuple[float, ...] = (0.0, 120.0, 240.0), **top: Any) -> bha.Arm:
    """One section at 3,000 m of height, its bellows at some angles, degrees."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    section = {k: v for k, v in mapping["section"][0].items() if k != "provenance"}
    section["bellows"] = [{"angle_deg": angle} for angle in bellows]
    section["pressure_range"] = [5e4, 2e5]
    whole = {k: v for k, v in mapping.items() if k != "provenance"} | {
        "section": [section],
        "ambient_pressure": AMBIENT,
    }
    return bha.Arm(ArmParameters.from_mapping(whole | top))


def log_of(arm: bha.Arm, run: bha.Trajectory, heading: str = "{} [Pa]", **more: Any) -> bha.Log:
    """Pressures as absolute or gauge ones, and what else is given."""
    gauge = AMBIENT if "(g)" in heading else 0.0
    columns: dict[str, Any] = {"t [s]": run.time}
    columns |= {heading.format(name): run.pressures[:, k] - gauge for k, name in enumerate(arm.inputs)}
    return bha.Log.from_arrays(columns | more)


def moved(arm: bha.Arm, rate: float = 100.0, seconds: float = 4.0) -> bha.Trajectory:
    """A smooth motion of all bellows."""
    time = np.arange(round(seconds * rate) + 1) / rate
    phases = np.arange(len(arm.inputs))
    p = 1.0e5 + 1.5e4 * np.sin(2.0 * np.pi * 0.5 * time[:, None] + phases)
    return bha.simulate(arm, bha.Input(time, p), dt=1.0 / rate)


def lengths_at(q: np.ndarray, angles: tuple[float, ...], radius: float, own: float) -> np.ndarray:
    """Closed form of arcs beside the centre line, (4) and (7) of the paper."""
    mean = q.mean(axis=1)
    u = (q[:, 1] + q[:, 2] - 2.0 * q[:, 0]) / (3.0 * radius)
    v = (q[:, 2] - q[:, 1]) / (np.sqrt(3.0) * radius)
    return np.stack([mean - own * (u * np.cos(a) + v * np.sin(a)) for a in np.deg2rad(angles)], axis=1)


def test_gauge_pressures_are_relative_to_the_arms_own_ambient_pressure() -> None:
    arm = arm_of()
    run = moved(arm)
    for heading in ("{} [Pa]", "{} [Pa(g)]"):
        recording = Recording(arm, log_of(arm, run, heading, **{"q11 [m]": run.lengths[:, 0]}))
        np.testing.assert_allclose(recording.drive.pressures, run.pressures, rtol=1e-12)
    again = bha.simulate(arm, recording)
    assert np.abs(again.lengths - run.lengths).max() < 1e-4


@pytest.mark.parametrize("angles", [(0.0, 90.0, 180.0, 270.0), (90.0, 210.0, 330.0), (0.0, 180.0)])
def test_lengths_of_bellows_are_those_where_they_sit(angles: tuple[float, ...]) -> None:
    arm = arm_of(angles)
    run = moved(arm)
    radius = arm.parameters.sections[0].bellows_radius
    own = lengths_at(run.lengths, angles, radius, radius)
    columns = {f"q1{k + 1} [m]": own[:, k] for k in range(len(angles))}
    recording = Recording(arm, log_of(arm, run, **columns))
    assert recording.channels == tuple(f"q1{k + 1}" for k in range(len(angles)))
    assert np.abs(recording.errors(run)).max() < 1e-12
    coordinates = {f"qv1{k + 1} [m]": run.lengths[:, k] for k in range(3)}
    virtual = Recording(arm, log_of(arm, run, **coordinates))
    assert np.abs(virtual.errors(run)).max() < 1e-12


def test_a_wire_through_sections_and_a_camera_that_stands_elsewhere() -> None:
    nominal = bha.robots.parameters("bha_nominal").to_mapping()
    sensors = {"camera_position": [0.1, -0.2, 0.3], "camera_rotation_deg": [0.0, 0.0, 90.0]}
    wire = {"name": "wire1", "angle_deg": 60.0, "radius": 0.05, "sections": [1, 2], "offset": 0.03}
    arm = bha.Arm(ArmParameters.from_mapping({**nominal, "sensors": sensors, "length_sensor": [wire]}))
    run = moved(arm)
    both = [
        lengths_at(run.lengths[:, 3 * i : 3 * i + 3], (60.0,), arm.parameters.sections[i].bellows_radius, 0.05)[:, 0]
        for i in (0, 1)
    ]
    seen = run.head_positions[:, 2] - np.array([0.1, -0.2, 0.3])
    columns = {"wire1 [mm]": 1e3 * (both[0] + both[1] + 0.03)}
    columns |= {"x3 [m]": seen[:, 1], "y3 [m]": -seen[:, 0], "z3 [m]": seen[:, 2]}
    recording = Recording(arm, log_of(arm, run, **columns), warn=False)
    assert recording.channels == ("wire1", "x3", "y3", "z3")
    assert np.abs(recording.errors(run)).max() < 1e-12
    back = recording.as_trajectory()
    np.testing.assert_allclose(back.head_positions[:, 2], run.head_positions[:, 2], atol=1e-12)
    assert np.isnan(back.head_positions[:, 0]).all()


def test_sensor_errors_act_where_the_sensor_sits() -> None:
    angles = (0.0, 90.0, 180.0, 270.0)
    effects = [
        {"kind": "length_gain", "where": "section 1", "gain": 0.1},
        {"kind": "length_offset", "where": "section 1", "offset": 0.004},
    ]
    arm = arm_of(angles).with_effects(effects)
    run = moved(arm)
    radius = arm.parameters.sections[0].bellows_radius
    own = 1.1 * lengths_at(run.lengths, angles, radius, radius) + 0.004
    recording = Recording(arm, log_of(arm, run, **{f"q1{k + 1} [m]": own[:, k] for k in range(4)}))
    assert np.abs(recording.errors(run)).max() < 1e-12


def test_orientations_are_compared_whatever_their_sign() -> None:
    arm = arm_of()
    run = moved(arm)
    turns = run.head_orientations
    assert turns is not None
    signs = np.where(np.arange(len(run)) % 2, 1.0, -1.0)[:, None]
    columns = {f"o{c}1": (signs * turns[:, 0])[:, k] for k, c in enumerate("wxyz")}
    recording = Recording(arm, log_of(arm, run, **columns))
    assert {output.kind for output in recording.outputs} == {"orientation"}
    assert np.abs(recording.errors(run)).max() < 1e-12


def test_commands_that_stand_still_are_held_and_jump() -> None:
    arm = arm_of()
    time = np.arange(401) * 0.01
    command = np.repeat(np.array([[1.0e5], [1.3e5], [0.9e5], [1.1e5]]), 101, axis=0)[:401] * np.ones(3)
    columns = {"t [s]": time} | {f"pc1{k + 1} [Pa]": command[:, k] for k in range(3)}
    recording = Recording(arm, bha.Log.from_arrays(columns))
    choice = recording.pressures
    assert (choice.sort, choice.between_samples) == ("commanded", "hold")
    jumps = np.flatnonzero(np.diff(recording.drive.time) == 0.0)
    assert len(jumps) == 3
    held = bha.simulate(arm, bha.Input(time, command), options=bha.Options(interpolation="hold"), dt=0.01)
    again = bha.simulate(arm, recording.drive, dt=0.01)
    assert np.abs(again.lengths - held.lengths).max() < 1e-6
    np.testing.assert_array_equal(recording.drive.pressures[recording.drive_rows], command)


def test_measured_pressures_do_not_pass_the_valves() -> None:
    arm = arm_of(pneumatics={"level": "lag", "fill_time": 0.3, "vent_time": 0.5})
    run = moved(arm_of())
    columns = {f"pc1{k + 1} [Pa]": run.pressures[:, k] for k in range(3)}
    log = log_of(arm, run, **columns)
    measured, commanded = (Recording(arm, log, pressures=sort) for sort in ("measured", "commanded"))  # type: ignore[arg-type]
    assert Recording(arm, log).pressures.sort == "measured"
    assert measured.acting.pneumatics_level == measured.pressures.pneumatics == "ideal"
    assert commanded.acting.pneumatics_level == commanded.pressures.pneumatics == "lag"
    assert np.abs(bha.simulate(arm, measured).lengths - run.lengths).max() < 1e-4
    assert np.abs(bha.simulate(arm, commanded).lengths - run.lengths).max() > 5e-3


def refused(arm: bha.Arm, **columns: Any) -> str:
    time = np.arange(3.0)
    pressures = {f"{name} [Pa]": np.full(3, 1e5) for name in arm.inputs}
    with pytest.raises(bha.LogError) as caught:
        Recording(arm, bha.Log.from_arrays({"t [s]": time} | pressures | columns))
    return str(caught.value)


def test_names_that_the_layout_contradicts_are_errors() -> None:
    three, four = np.full(3, 0.2), arm_of((0.0, 90.0, 180.0, 270.0))
    assert "bellows at 0, 120, 240 degrees" in refused(arm_of(), **{"q14 [m]": three})
    assert "the arm has 1 section." in refused(arm_of(), **{"x2 [m]": three})
    assert "no such input" in refused(arm_of(), **{"p14 [Pa]": 5e5 * three})
    only_three = refused(four, **{f"q1{k} [m]": three for k in (1, 2, 3)})
    assert 'lengths = "coordinates"' in only_three
    assert "qv11" in only_three
    assert "ox1" in refused(arm_of(), **{"ow1": three, "oy1": three, "oz1": three})


def test_columns_that_look_like_data_are_named() -> None:
    arm = arm_of()
    run = moved(arm, seconds=1.0)
    extra = {"mx1 [N*m]": run.time, "wire1l [mm]": 100.0 + run.time, "operator": run.time}
    with pytest.warns(bha.LogWarning, match=r"'mx1 \[N\*m\]', 'wire1l \[mm\]' are used by nothing.*length_sensor"):
        recording = Recording(arm, log_of(arm, run, **extra))
    assert len(recording.findings) == 1


def test_a_quaternion_by_another_name_is_told_its_own() -> None:
    arm = arm_of()
    run = moved(arm, seconds=1.0)
    extra = {f"q{axis}1": np.full(len(run), 0.5) for axis in "wxyz"}
    with pytest.warns(bha.LogWarning, match="did you mean ow1, ox1, oy1, oz1, the orientation of head 1"):
        Recording(arm, log_of(arm, run, **extra))


@pytest.mark.parametrize(
    ("heading", "factor", "hint"),
    [("{} [bar]", 3.0, "is the unit right"), ("{} [kPa]", 0.2, "is this gauge pressure")],
)
def test_pressures_outside_of_the_range_are_named(heading: str, factor: float, hint: str) -> None:
    arm = arm_of()
    time = np.arange(101) * 0.01
    values = factor * (1.0 + 0.1 * np.sin(time)) * (1.0 if "bar" in heading else 100.0)
    columns = {"t [s]": time} | {heading.format(f"p1{k}"): values for k in (1, 2, 3)}
    with pytest.warns(bha.LogWarning) as caught:
        Recording(arm, bha.Log.from_arrays(columns))
    texts = [str(w.message) for w in caught if "pressure_range" in str(w.message)]
    assert len(texts) == 1
    assert "p11 reaches" in texts[0]
    assert "(p12, p13 leave it too)" in texts[0]
    assert hint in texts[0]


def test_frozen_pressures_are_those_under_which_the_arm_sets_out_anew() -> None:
    arm = arm_of()
    rng = np.random.default_rng(3)
    run = moved(arm, seconds=8.0)
    measured = run.pressures + 50.0 * rng.standard_normal(run.pressures.shape)
    measured[300:500] = measured[300]
    columns: dict[str, Any] = {"t [s]": run.time}
    columns |= {f"p1{k + 1} [Pa]": measured[:, k] for k in range(3)}
    columns |= {f"q1{k + 1} [m]": run.lengths[:, k] + 1e-4 * rng.standard_normal(len(run)) for k in range(3)}
    recording = Recording(arm, bha.Log.from_arrays(columns))
    assert not recording.usable[(run.time > 3.1) & (run.time < 5.9)].any()
    assert recording.usable[(run.time < 2.9) | (run.time > 6.1)].all()


def test_it_can_be_said() -> None:
    arm = arm_of()
    run = moved(arm)
    recording = Recording(arm, log_of(arm, run, **{"q11 [m]": run.lengths[:, 0]}), name="first")
    assert repr(recording).startswith(
        "<Recording first of 'bha_nominal': 401 rows, 4 s, measured pressures, outputs q11"
    )
    assert "pressures: measured (the log has no others), linear between samples" in str(recording)
    assert json.loads(recording.to_json())["pressures"]["ambient_pressure"] == AMBIENT


def test_all_recordings_of_a_call_have_one_sort_of_pressures() -> None:
    arm = arm_of()
    run = moved(arm)
    both = log_of(arm, run, **{f"pc1{k + 1} [Pa]": run.pressures[:, k] for k in range(3)})
    commands = bha.Log.from_arrays({"t [s]": run.time} | {f"pc1{k + 1} [Pa]": run.pressures[:, k] for k in range(3)})
    assert [r.pressures.sort for r in recordings(arm, [commands, both])] == ["commanded", "commanded"]
    with pytest.raises(bha.LogError, match="--pressures commanded"):
        recordings(arm, [both, commands])


@pytest.mark.parametrize(
    ("apart", "measured", "doubted"),
    [(1e4, False, True), (60.0, False, False), (10.0, True, True), (1e-7, True, True), (1e-4, True, False)],
)
def test_times_that_cannot_be_seconds_are_doubted(apart: float, measured: bool, doubted: bool) -> None:
    facts = clock.mended(apart * np.arange(50.0))[1]
    text = clock.doubt(facts, 0.0, measured=measured)
    assert (text is not None and "another unit" in text) is doubted


def test_rows_that_are_all_at_one_time_are_doubted() -> None:
    assert "all 50 rows are at 3 s" in (clock.doubt(clock.mended(np.full(50, 3.0))[1], 3.0, measured=True) or "")


@pytest.mark.parametrize(
    ("time", "said"),
    [
        (np.arange(50.0) * 0.02, None),
        (np.arange(50.0) * 20.0, "'t [ms]'"),
        (np.arange(50.0) * 1e-7, "'t [min]'"),
        (np.full(50, 3.0), "all 50 rows are at 3 s"),
        (np.array([3.0]), "one row alone"),
    ],
)
def test_rows_that_follow_no_motion_are_no_log_to_identify_from(time: np.ndarray, said: str | None) -> None:
    text = clock.follows_no_motion(clock.mended(time)[1], time[0])
    assert (text is None) is (said is None)
    assert (said or "") in (text or "")
