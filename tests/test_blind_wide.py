"""The wide blind world: its plant against the core, each of its pieces against a closed form."""

import hashlib
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("numba")
ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "benches" / "blind"))

from blindgen.sealing import ANSWER, unseal  # noqa: E402
from blindgen.wide import bellows as b  # noqa: E402
from blindgen.wide import faults, hidden, sensors  # noqa: E402
from blindgen.wide.adapt import without_sensor_tables  # noqa: E402
from blindgen.wide.arms import TrueArm, build, draw_arm  # noqa: E402
from blindgen.wide.cases import build_case, write_case, write_log  # noqa: E402
from blindgen.wide.datasheets import QUALITIES, user_file  # noqa: E402
from blindgen.wide.disturbances import Disturbance, draw_sessions, ornstein_uhlenbeck  # noqa: E402
from blindgen.wide.integrate import STEP, Drive, Lag, Simulator, no_lag  # noqa: E402
from blindgen.wide.plan import GROUPS, LONGEST, WideSpec, build_plan, read_plan, write_plan  # noqa: E402
from blindgen.wide.pressures import PressureSense, chamber_pressures  # noqa: E402
from blindgen.wide.programmes import LEAD, PROGRAMMES, commands, draw_timetable  # noqa: E402
from blindgen.wide.truth import Path as PressurePath  # noqa: E402
from blindgen.wide.truth import plain_truth, read_lengths, simulate, through_path  # noqa: E402

import bha  # noqa: E402

SPEC = WideSpec(
    case="demo_0000", seed=7, subset="tune", group="single", kinds=("creep",), strengths=(3.0,), fault="", sections=1,
    layout=(4, True, True), regime="fabric", mounting="hanging", quality="tape", sensors="heads", rate="10", noise=2e-4,
    coloured=False, pressures="measured", disturbance="none", programme="rich", logs=2, total=40.0,
)  # fmt: skip


def test_first_world_is_what_it_was() -> None:
    from blindgen.cases import CaseSpec  # noqa: PLC0415
    from blindgen.plan import build_plan as first_plan  # noqa: PLC0415

    plan: list[CaseSpec] = first_plan(1)
    # Only the name of one kind has changed since.
    text = json.dumps([asdict(s) for s in plan]).replace('"taper"', '"non_constant_curvature"')
    assert hashlib.sha256(text.encode()).hexdigest().startswith("17ba1b0f1c33d627")


def arm_of(regime: str = "ringing", sections: int = 1, layout: tuple[int, bool, bool] = (3, False, False)) -> TrueArm:
    return draw_arm(np.random.default_rng(3), sections, regime, "hanging", layout)


def core_arm(arm: TrueArm) -> bha.Arm:
    """The same arm in the package under test."""
    rows = [
        {
            "mass": s.mass,
            "inertia": list(s.inertia),
            "bellows_radius": s.radius,
            "bellows_outer_radius": s.outer_radius,
            "terminal_area": s.area,
            "rest_length": s.rest_length,
            "stiffness": list(s.stiffness),
            "damping": s.damping,
            "bending_stiffness": list(s.bending),
            "length_range": list(s.length_range),
            "pressure_range": list(s.pressure_range),
            "bellows": [{"angle": x.angle, "radius": x.radius, "input": x.input} for x in s.bellows],
        }
        for s in arm.sections
    ]
    head = {"schema": "bha-arm/1", "name": "same", "gravity": list(arm.gravity), "ambient_pressure": arm.ambient}
    return bha.Arm(bha.parameters.ArmParameters.from_mapping({**head, "force_model": arm.force_model, "section": rows}))


@pytest.mark.parametrize(
    ("regime", "sections", "count", "force_model", "tolerance"),
    [
        ("ringing", 2, 4, "end_force", 1e-7),
        ("ringing", 1, 3, "work_conjugate", 1e-7),
        ("fabric", 2, 5, "work_conjugate", 1e-5),
    ],
)
def test_plant_agrees_with_the_core(regime: str, sections: int, count: int, force_model: str, tolerance: float) -> None:
    """Two codes that share nothing, one arm: bellows anywhere, shared inputs, RK4 here or the implicit method."""
    arm = replace(arm_of(regime, sections, (count, True, True)), force_model=force_model)
    simulator = Simulator(build(arm, plain=True))
    assert simulator.explicit(STEP) == (regime == "ringing")
    times = np.arange(2001) * STEP
    top = np.array([arm.sections[int(x[1]) - 1].pressure_range[1] for x in arm.inputs]) - arm.ambient
    wave = 0.4 + 0.3 * np.sin(2.0 * np.pi * times[:, None] * np.linspace(0.5, 1.5, top.shape[0]))
    pressure = arm.ambient + top * wave
    state = simulator.rest(pressure[0])
    coordinates, heads = simulator.run(state, Drive(pressure), 200)
    core = core_arm(arm)
    assert core.inputs == arm.inputs
    lengths = read_lengths(plain_truth(build(arm), len(arm.inputs)), coordinates)
    np.testing.assert_allclose(core.static_lengths(pressure[0]), lengths[0], atol=1e-9)
    run = bha.simulate(core, bha.Input(times, pressure), dt=200 * STEP)
    np.testing.assert_allclose(run.lengths, lengths, atol=tolerance)
    np.testing.assert_allclose(core.forward_kinematics(lengths[-1])[0][-1], heads[-1, -1, :3], atol=1e-9)


def row(**values: Any) -> np.ndarray:
    """One bellows of 1000 N/m and 0.2 m with some columns set."""
    out = np.zeros(b.B_COLUMNS)
    out[b.B_REST], out[b.B_STIFFNESS] = 0.2, 1000.0
    for name, value in values.items():
        column = getattr(b, name)
        numbers = np.atleast_1d(value)
        out[column : column + numbers.shape[0]] = numbers
    return out


def test_spring_area_and_damping_of_a_bellows() -> None:
    def force(bellows: np.ndarray, length: float = 0.23, speed: float = 0.0, gauge: float = 0.0, time: float = 0.0):
        return b.bellows_force(bellows, length, speed, gauge, time)

    assert force(row(B_STIFFNESS=[1000.0, 500.0, 2000.0])) == pytest.approx(-(30.0 + 0.45 + 0.054))
    assert force(row(B_HARDENING=[400.0, 0.05])) == pytest.approx(-30.0 - 20.0 * (np.sinh(0.6) - 0.6))
    assert force(row(B_WEAK=[0.2, 1.0])) == pytest.approx(-30.0 * (1.0 - 0.2 * 1.03))
    assert force(row(B_DRIFT=[0.1, 50.0]), time=50.0) == pytest.approx(-30.0 * (1.0 + 0.1 * (1.0 - np.exp(-1.0))))
    assert force(row(B_AREA=1e-3), length=0.2, gauge=5e4) == pytest.approx(50.0)
    assert force(row(B_AREA=1e-3, B_TANH=[0.1, 5e4]), 0.2, 0.0, 5e4) == pytest.approx(50.0 * (1 + 0.1 * np.tanh(1.0)))
    assert force(row(B_AREA=1e-3, B_SLOPE=2.0), 0.21, 0.0, 5e4) == pytest.approx(50.0 * 1.02 - 10.0)
    assert force(row(B_DAMPING=20.0), length=0.2, speed=0.1) == pytest.approx(-2.0)


def test_hidden_forms_along_a_bellows() -> None:
    memory = np.zeros(b.MEMORY)
    resist = b.resistance
    # A spectrum that was stretched at once relaxes as the sum of its branches.
    creep = row(B_CREEP=[100.0, 50.0, 25.0, 0.2, 1.0, 5.0])
    memory[:3] = 0.01 * np.array([100.0, 50.0, 25.0])
    wanted = 0.01 * (100.0 * np.exp(-1.5 / 0.2) + 50.0 * np.exp(-1.5) + 25.0 * np.exp(-0.3))
    assert resist(creep, 0.0, 0.0, 1.5, memory) == pytest.approx(wanted)
    # A density of yields: all of its force far out, the slope of all elements at first, less than either between.
    slip = row(B_SLIP=[8.0, 0.004])
    still = np.zeros(b.MEMORY)
    assert resist(slip, 0.0, 0.1, 1e-3, still) == pytest.approx(8.0)
    assert resist(slip, 0.0, 1e-5, 1e-3, still) == pytest.approx(8e-5 / 0.004 * np.mean(1.0 / b.SLIP_YIELDS))
    assert resist(slip, 0.0, 0.004, 1e-3, still) == pytest.approx(np.sum(np.minimum(1.0 / b.SLIP_YIELDS, 1.0)))
    # After a turn it takes twice the yields to come to the other side (Masing).
    table, memories = slip[None, :], np.zeros((1, b.MEMORY))
    b.remember(table, np.zeros(1), np.array([0.1]), 1e-3, memories)
    assert resist(slip, 0.0, -2 * 0.004, 1e-3, memories[0]) == pytest.approx(8.0 - 2 * np.sum(
        np.minimum(1.0 / b.SLIP_YIELDS, 1.0)))  # fmt: skip
    friction = row(B_BRISTLE=[2.0, 2.0, 0.01, 3e-4, 0.0])
    assert resist(friction, 0.1, 0.05, 1e-3, still) == pytest.approx(2.0, rel=1e-6)
    assert resist(row(B_POWER=[30.0, 1.5]), -0.04, 0.0, 0.0, still) == pytest.approx(-30.0 * 0.008)
    one_sided = row(B_ONE_SIDED=5.0)
    assert resist(one_sided, 0.1, 0.0, 0.0, still) == 0.0
    assert resist(one_sided, -0.1, 0.0, 0.0, still) == pytest.approx(-0.5)


def test_hidden_lag_follows_the_volume() -> None:
    """A pressure step into an arm too stiff to move, its bellows at rest length or held 30 % longer by the lag's
    power."""
    arm = arm_of("fabric")
    base = build(arm, plain=True)
    base.table[:, b.B_STIFFNESS] *= 1e4
    lengthened = base.copy()
    lengthened.table[:, b.B_REST] *= 1.0
    pressure = np.full((1001, len(arm.inputs)), arm.ambient)
    pressure[1:] += 1000.0
    lag = Lag(np.full(3, 0.1), np.full(3, 0.3), np.full(3, 1.5))
    simulator = Simulator(base, lag)
    state = simulator.rest(pressure[0])
    simulator.run(state, Drive(pressure), 1000)
    # A ramp over the first step, then exponential.
    assert state.chamber - arm.ambient == pytest.approx(1000.0 * (1.0 - np.exp(-0.5 / 0.1)), rel=5e-3)
    down = Drive(2.0 * arm.ambient - pressure)
    state = simulator.rest(down.pressure[0])
    simulator.run(state, down, 1000)
    assert arm.ambient - state.chamber == pytest.approx(1000.0 * (1.0 - np.exp(-0.5 / 0.3)), rel=5e-3)


def test_pressure_path_and_supply() -> None:
    zero = np.zeros(2)
    grid = np.where(np.arange(2000) >= 500, 2e5, 1e5)[:, None] * np.array([1.0, 0.0]) + np.array([0.0, 1.2e5])
    path = PressurePath(zero.copy(), zero.copy(), np.array([0.02, 0.0]), zero.copy())
    assert np.argmax(through_path(path, 1e5, grid, 1e-3)[:, 0] > 1.5e5) == pytest.approx(520, abs=1)
    sagging = PressurePath(zero.copy(), zero.copy(), zero.copy(), zero.copy(), 0.1, 0.25)
    out = through_path(sagging, 1e5, grid, 1e-3)
    assert 1.2e5 - out[750, 1] == pytest.approx(0.1 * 1e5 * np.exp(-1.0), rel=1e-2)
    assert out[750, 0] == pytest.approx(2e5)
    read = PressurePath(np.array([0.25, 0.0]), np.array([500.0, 0.0]), zero.copy(), zero.copy())
    assert through_path(read, 1e5, np.full((3, 2), 1.255e5), 1e-3)[:, 0] == pytest.approx(1.2e5)
    play = PressurePath(zero.copy(), zero.copy(), zero.copy(), np.array([1e3, 0.0]))
    slow = 1e5 + 5e3 * np.sin(np.arange(4000) * 5e-3)[:, None] * np.ones(2)
    assert through_path(play, 1e5, slow, 1e-3).max(axis=0) == pytest.approx([1.04e5, 1.05e5], rel=1e-4)


def test_valves_follow_commands_with_their_lag_and_dead_time() -> None:
    sense = PressureSense("commanded", 0.2, 0.1, 0.0, 0.0, "Pa")
    command_ = np.where(np.arange(6000) >= 1000, 2e5, 1e5)[:, None]
    chamber = chamber_pressures(sense, command_, 1e-3)[:, 0]
    # The area above the response is the dead time and the sum of the stages' time constants.
    assert np.sum(2e5 - chamber[1000:]) * 1e-3 / 1e5 == pytest.approx(0.3, rel=5e-3)
    assert np.all(chamber[:1100] == 1e5)


def test_unlogged_disturbances() -> None:
    x = ornstein_uhlenbeck(np.random.default_rng(0), 200_000, 1, 3.0, 0.5, 0.01)[:, 0]
    assert np.std(x) == pytest.approx(3.0, rel=0.05)
    assert np.mean(x[50:] * x[:-50]) / np.var(x) == pytest.approx(np.exp(-1.0), abs=0.05)
    calm = draw_sessions(np.random.default_rng(1), Disturbance("none"), 2, 3)
    assert calm[0] == calm[1] == calm[2]
    assert calm[0].rest == (0.0, 0.0)
    drifting = draw_sessions(np.random.default_rng(1), Disturbance("sessions"), 2, 4)
    assert 2 <= len(set(drifting)) <= 3


def test_sensors_see_what_geometry_says() -> None:
    arm = arm_of("ringing", 2)
    truth = plain_truth(build(arm), len(arm.inputs))
    coordinates = np.array([[0.3, -0.2, 0.2, 0.1, 0.4, 0.25]])
    q = read_lengths(truth, coordinates)[0]
    for k in range(3):
        wire = sensors.Wire("w", 2.0 * np.pi * k / 3.0, arm.sections[1].radius, (1,))
        assert sensors.wire_length(wire, coordinates)[0] == pytest.approx(q[3 + k])
    both = sensors.Wire("w", 0.0, 0.0, (0, 1))
    assert sensors.wire_length(both, coordinates)[0] == pytest.approx(0.45)
    heads = np.zeros((1, 2, 12))
    heads[0, :, 3:] = np.eye(3).ravel()
    heads[0, 1, :3] = 0.1, 0.2, 0.5
    seen = sensors.Sensors("poses", "100", 1e-4, 0.0, 1e-5, False, False, False, heads=(1,), camera=(0.01, 0.0, 0.0),
                           turn=(0.0, 0.0, 0.5 * np.pi))  # fmt: skip
    # The camera stands 10 mm along x and is turned by a quarter about z: its x axis is the base's y.
    out = sensors.observe(seen, truth, coordinates, heads)
    assert out.names == ("x2", "y2", "z2")
    assert out.values[0] == pytest.approx([0.2, -0.09, 0.5])
    half = np.sqrt(0.5)
    assert sensors.quaternions(out.orientations[:, 0])[0] == pytest.approx([half, 0.0, 0.0, -half])
    mirrored = sensors.observe(replace(seen, mirrored=True), truth, coordinates, heads)
    assert mirrored.values[0] == pytest.approx([0.2, 0.09, 0.5])
    assert np.linalg.det(mirrored.orientations[0, 0]) == pytest.approx(1.0)


def test_quaternions_of_every_turn() -> None:
    rng = np.random.default_rng(0)
    for angle in (0.0, 1.0, 3.1, np.pi):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        w, x, y, z = sensors.quaternions(sensors.rotation(angle * axis)[None])[0]
        assert abs(w) == pytest.approx(abs(np.cos(angle / 2)), abs=1e-9)
        assert np.abs([x, y, z]) == pytest.approx(np.abs(np.sin(angle / 2) * axis), abs=1e-9)


def clean_channels(seconds: float) -> sensors.Channels:
    times = np.arange(round(1000 * seconds) + 1) / 1000.0
    return sensors.Channels(("q11", "q12"), np.stack([0.2 + 0.05 * times, 0.3 - 0.05 * times], axis=1))


def test_logs_hold_quantise_tick_and_lie() -> None:
    quiet = sensors.Sensors("coordinates", "30 in 200", 1e-12, 0.0, 1e-9, False, False, False)
    log = sensors.measure(quiet, np.random.default_rng(0), clean_channels(4.0), 1e-3)
    assert log.time.shape[0] == 801
    assert len(np.unique(np.round(log.values[:, 0], 9))) == 121
    fresh = log.sound[:, 0]
    assert fresh.sum() == 121
    assert np.abs(log.values[fresh, 0] - 0.2 - 0.05 * log.time[fresh]).max() < 0.05 / 200 + 1e-6
    coarse = replace(quiet, rate="100", grid=1e-3, ticks=True)
    log = sensors.measure(coarse, np.random.default_rng(0), clean_channels(4.0), 1e-3)
    assert np.allclose(np.round(log.values / 1e-3), log.values / 1e-3)
    assert np.allclose(np.round(log.time / sensors.TICK), log.time / sensors.TICK)
    assert (np.diff(log.time) == 0.0).any()
    bad = replace(quiet, rate="100", outliers=True, spells=True)
    log = sensors.measure(bad, np.random.default_rng(4), clean_channels(40.0), 1e-3)
    error = np.abs(log.values - np.stack([0.2 + 0.05 * log.time, 0.3 - 0.05 * log.time], axis=1))
    assert error[log.sound].max() < 1e-6
    assert error[~log.sound].max() > 8e-3
    noisy = replace(quiet, rate="100", noise=1e-3, colour=0.1, grid=1e-9)
    still = sensors.Channels(("q11",), np.zeros((600_001, 1)))
    values = sensors.measure(noisy, np.random.default_rng(1), still, 1e-3).values[:, 0]
    assert np.std(values) == pytest.approx(1e-3, rel=0.05)
    assert np.mean(values[10:] * values[:-10]) / np.var(values) == pytest.approx(np.exp(-1.0), abs=0.05)


def test_swapped_columns() -> None:
    tubes = faults.Fault("tubes_swapped", "", ("p11", "p13"))
    assert faults.swapped(("p11", "p12", "p13"), tubes) == [2, 1, 0]
    heads = faults.Fault("sensors_swapped", "", ("1", "2"))
    assert faults.swapped(("x1", "y1", "x2", "y2"), heads) == [2, 3, 0, 1]
    assert faults.swapped(("ow1", "ox1", "ow2", "ox2"), heads) == [2, 3, 0, 1]
    assert faults.swapped(("q11", "q12"), None) == [0, 1]


@pytest.mark.parametrize("name", sorted(hidden.KINDS))
def test_every_kind_installs_and_moves_something(name: str) -> None:
    kind = hidden.KINDS[name]
    arm = arm_of("ringing", 2)
    plain = plain_truth(build(arm), len(arm.inputs))
    heads = np.random.default_rng(0).normal(size=(50, 2, 3)) * 0.05 + np.array([0.0, 0.0, 0.3])
    effect = hidden.draw_effect(name, np.random.default_rng(5), arm, heads)
    changed, filled = hidden.install(plain, arm, effect)

    def flat(truth: Any) -> np.ndarray:
        parts = [
            truth.arm.table,
            truth.arm.hidden.bellows,
            truth.arm.hidden.sections,
            truth.arm.hidden.whole,
            *truth.lag,
        ]
        parts += [np.atleast_1d(float(x)) if np.ndim(x) == 0 else x for x in vars(truth.path).values()]
        parts += [truth.reading.gain, truth.reading.offset, np.array([truth.reading.delay, float(truth.arm.end_force)])]
        return np.concatenate([np.ravel(p) for p in parts])

    assert not np.array_equal(flat(plain), flat(changed))
    assert all(np.isfinite(filled.parameters[key]) for key in kind.comparable)
    word = effect.where.split()[0]
    assert word in ("all", "section", "bellows", "input")


def test_files_are_off_as_their_quality_says() -> None:
    arm = arm_of("fabric", 1, (4, False, True))
    seen = sensors.Sensors("coordinates", "100", 1e-4, 0.0, 1e-5, False, False, False)
    for quality in QUALITIES:
        masses, springs = [], []
        for seed in range(60):
            text = user_file(np.random.default_rng(seed), arm, quality, seen, None)
            file = bha.Arm(bha.parameters.ArmParameters.from_toml(without_sensor_tables(text))).parameters.sections[0]
            masses.append(file.mass / arm.sections[0].mass)
            springs.append(file.stiffness[0] / arm.sections[0].stiffness[0])
        share = {"data_sheet": 0.10, "identified": 0.30, "tape": 0.05}[quality]
        assert 0.8 * share < np.abs(np.array(masses) - 1.0).max() <= share + 1e-5
        assert (max(springs) > 2.0) == (quality == "tape")
    assert '[sensors]\nlengths = "coordinates"' in text
    assert np.rad2deg(arm.sections[0].bellows[0].angle) % 360 == pytest.approx(
        float(text.split("angle_deg = ")[1].split()[0]), rel=1e-4
    )
    turned = user_file(np.random.default_rng(0), arm, "tape", seen, faults.Fault("azimuth", "section 1", None, 0.5))
    angles = [float(x.split()[0]) for x in turned.split("angle_deg = ")[1:]]
    assert np.deg2rad(angles[0]) == pytest.approx((arm.sections[0].bellows[0].angle + 0.5) % (2 * np.pi), rel=1e-4)


@pytest.mark.parametrize("programme", PROGRAMMES)
def test_programmes_stay_in_range_and_hold(programme: str) -> None:
    arm = arm_of("fabric", 2)
    table = draw_timetable(np.random.default_rng(1), 3, 75.0, commanded=True)
    assert sum(table.durations) == pytest.approx(75.0, abs=2.0)
    times, wanted = commands(np.random.default_rng(2), arm, programme, table, 0)
    assert times[0] == -LEAD
    low, high = np.array([arm.sections[int(x[1]) - 1].pressure_range for x in arm.inputs]).T
    assert np.all(wanted >= low - 1e-9)
    assert np.all(wanted <= high + 1e-9)
    logged = times >= 0.0
    changes = times[logged][1:][np.any(np.diff(wanted[logged], axis=0) != 0.0, axis=1)]
    assert changes.shape[0] > 2
    # Held for the dwell, at whole tenths of a second.
    assert np.allclose(np.round(10 * changes), 10 * changes)
    assert np.diff(changes).min() >= table.dwell - 1e-6


def test_plan_is_balanced_and_the_same_again(tmp_path: Path) -> None:
    plan = build_plan(1, "report", 80)
    assert plan == build_plan(1, "report")[:80]
    assert [s.group for s in plan] != [s.group for s in build_plan(2, "report", 80)]
    groups = [s.group for s in plan]
    assert {g: groups.count(g) for g in GROUPS} == {g: 2 * n for g, n in GROUPS.items()}
    assert sum(s.total > LONGEST for s in plan) == 8 - sum(s.total > LONGEST and s.rate == "1000" for s in plan) or (
        4 <= sum(s.total > LONGEST for s in plan) <= 8
    )
    assert all(s.logs * 20 <= s.total for s in plan)
    for s in plan:
        assert len(s.kinds) == {"pair": 2, "clutter": 5, "single": 1, "refused": 1, "setup_effect": 1}.get(s.group, 0)
        assert bool(s.fault) == s.group.startswith("setup")
        assert all(hidden.KINDS[k].refused == (s.group == "refused") for k in s.kinds)
        assert not any(name in s.case for name in hidden.KINDS)
    assert {s.fault for s in build_plan(1, "report")} == {"", *faults.KINDS}
    assert {k for s in build_plan(1, "report") for k in s.kinds} == set(hidden.KINDS)
    write_plan(plan, tmp_path / "plan.json")
    assert read_plan(tmp_path / "plan.json") == plan


def test_case_is_the_same_again_and_betrays_nothing(tmp_path: Path) -> None:
    out, sealed, public = tmp_path / "cases" / SPEC.case, tmp_path / "sealed", tmp_path / "public"
    answer = write_case(SPEC, out, sealed, public)
    assert sorted(p.name for p in out.iterdir()) == ["arm.toml", "holdout_1.csv", "train_1.csv"]
    text = "".join(p.read_text(encoding="utf-8") for p in out.iterdir())
    assert "creep" not in text
    assert "amplitude" not in text
    assert unseal(SPEC.case, sealed, public)["effects"][0]["kind"] == "creep"
    assert (sealed / SPEC.case / ANSWER).stat().st_size > 1000
    again = build_case(SPEC)
    assert again.file == (out / "arm.toml").read_text(encoding="utf-8")
    for log in again.logs:
        path = tmp_path / f"{log.name}.csv"
        write_log(again, log, path)
        assert path.read_bytes() == (out / f"{log.name}.csv").read_bytes()
    # The true model fed what was sensed leaves the sensors' noise; the plain one, which lacks the creep, leaves more.
    limits = answer["limits"]
    assert limits["true_model"] < 3.0 * limits["sensor_noise"]
    assert limits["ratio"] > 1.2
    arm = bha.Arm.load(out / "arm.toml")
    log = bha.Log.read(out / "train_1.csv", ambient_pressure=arm.parameters.ambient_pressure)
    assert set(arm.inputs) <= set(log.columns)
    assert {"x1", "y1", "z1"} <= set(log.columns)


@pytest.mark.parametrize(("seed", "pressures"), [(8, "measured"), (12, "measured"), (22, "commanded")])
def test_core_with_true_values_leaves_what_is_sealed(tmp_path: Path, seed: int, pressures: str) -> None:
    """From the written log to the error on it, units, gauge and all: the core with the true values against the
    answer."""
    spec = replace(
        SPEC, seed=seed, group="null", kinds=(), strengths=(), sensors="coordinates", rate="100", pressures=pressures
    )
    case = build_case(spec)
    assert case.arm.sections[0].sliced == 0.0
    assert case.arm.sections[0].hardening == (0.0, 0.0)
    write_log(case, case.logs[-1], tmp_path / "log.csv")
    log = bha.Log.read(tmp_path / "log.csv", ambient_pressure=case.arm.ambient)
    names = [x if pressures == "measured" else f"pc{x[1:]}" for x in case.arm.inputs]
    times, drive = log.time, np.stack([log[x] for x in names], axis=1)
    if pressures == "commanded":
        times = np.arange(round(log.time[-1] / 1e-3) + 1) * 1e-3
        held = drive[np.minimum((times * 100 + 1e-9).astype(int), len(drive) - 1)]
        drive = chamber_pressures(case.sense, held, 1e-3)
    assert not case.table.moving[-1]
    run = bha.simulate(core_arm(case.arm), bha.Input(times, drive), dt=0.01)
    measured = np.stack([log[f"q1{k + 1}"] for k in range(3)], axis=1)
    sound = case.logs[-1].measured.sound
    error = np.sqrt(np.mean((run.lengths[: len(measured)] - measured)[sound] ** 2))
    assert error == pytest.approx(case.answer["limits"]["true_model"], rel=0.03)
    assert case.answer["limits"]["equivalent"]


def test_static_gauge_and_true_start() -> None:
    """At rest under constant pressures nothing moves: settle, lead and log agree."""
    arm = arm_of("ringing", 1)
    truth = plain_truth(build(arm), len(arm.inputs))
    chamber = np.full((2001, 3), arm.ambient) + np.array([2e4, 0.0, 1e4])
    clean = simulate(truth, chamber, 400, STEP, 20)
    assert np.ptp(clean.coordinates, axis=0).max() < 1e-9
    assert clean.coordinates[0, 2] == pytest.approx(
        float(np.mean(core_arm(replace(arm, sections=tuple(
            replace(s, hardening=(0.0, 0.0), sliced=0.0) for s in arm.sections))).static_lengths(chamber[0]))),
        abs=5e-3,
    )  # fmt: skip
    assert no_lag(2).fill.shape == (2,)
