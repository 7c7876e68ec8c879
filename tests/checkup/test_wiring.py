from __future__ import annotations

import copy

import numpy as np
import pytest

import bha
from bha.arm.geometry import wire_row
from bha.checkup.causes import exchanges, symmetries
from bha.checkup.layout import layout_of
from bha.checkup.response import BANK, Filter, filtered
from bha.checkup.shape import from_heads, from_lengths, to_heads

from .made_logs import about_z, arm_of, log_of, nominal, steps, turned


def explanations(found: bha.Checkup) -> list[str]:
    return [e.what for finding in found.faults for e in finding.explanations]


def repairs(found: bha.Checkup) -> str:
    return "\n".join(e.repair for finding in found.faults for e in finding.explanations)


def one_arm() -> bha.Arm:
    return arm_of(nominal(1))


def two_arm() -> bha.Arm:
    return arm_of(nominal(2))


@pytest.mark.parametrize("name", bha.robots.names())
def test_bending_and_length_from_heads_are_those_of_the_coordinates(name: str) -> None:
    arm = bha.robots.load(name)
    layout = layout_of(arm)
    n = arm.section_count
    q = np.random.default_rng(0).uniform(0.8, 1.2, 3 * n) * np.repeat(layout.length_range.mean(axis=1), 3)
    heads, _ = arm.forward_kinematics(q)
    bending, length = from_heads(heads, layout.base_offset, layout.head_offset)
    for i in range(n):
        expected = from_lengths(q[3 * i : 3 * i + 3], 2 * np.pi / 3 * np.arange(3), [layout.coordinate_radius[i]] * 3)
        np.testing.assert_allclose(bending[i], expected[0], atol=1e-12)
        np.testing.assert_allclose(length[i], expected[1], atol=1e-12)
    np.testing.assert_allclose(to_heads(bending, length, layout.base_offset, layout.head_offset), heads, atol=1e-12)


@pytest.mark.parametrize("name", ["bha_nominal", "asu_two_section"])
def test_the_drive_points_where_the_model_bends(name: str) -> None:
    """One chamber under pressure: the direction from the geometry is that of the poses that the model holds."""
    arm = bha.robots.load(name)
    layout = layout_of(arm)
    middle = np.full(len(arm.inputs), 1.3e5)
    for j in range(len(arm.inputs)):
        (section,) = layout.sections_of(j)
        if abs(layout.bending[section, j]) < 1e-3 * np.abs(layout.bending).max():
            continue  # two chambers on opposite sides share an input
        step = np.where(np.arange(len(arm.inputs)) == j, 5e3, 0.0)
        q = arm.static_lengths(middle + step)[3 * section : 3 * section + 3]
        radius = layout.coordinate_radius[section]
        bending, _ = from_lengths(q, 2 * np.pi / 3 * np.arange(3), [radius] * 3)
        assert abs(np.angle(bending / layout.bending[section, j])) < 1e-6


def test_filters_have_gain_one_and_start_at_rest() -> None:
    held = np.full((400, 2), [1e5, 2e5])
    for through in filtered(held, 0.02):
        np.testing.assert_allclose(through, held)
    step = np.where(np.arange(4000)[:, None] < 10, 0.0, 1.0)
    (lagged,) = filtered(step, 0.02, (Filter(0.6),))
    # The closed form of a first-order lag, up to the grid.
    expected = 1.0 - np.exp(-(np.arange(4000) - 10) * 0.02 / 0.6)
    np.testing.assert_allclose(lagged[60:1000, 0], expected[60:1000], atol=0.03)
    assert len(BANK) == len(set(BANK))


def test_exchanges_of_three_are_five_and_of_six_only_pairs_and_cycles() -> None:
    assert len(list(exchanges(3))) == 5
    assert len(list(exchanges(6))) == 15 + 5


def test_three_even_lengths_have_two_turns_and_three_mirror_images() -> None:
    found = symmetries(2 * np.pi / 3 * np.arange(3))
    assert sum(not mirrored for _, mirrored in found) == 2
    assert sum(mirrored for _, mirrored in found) == 3
    assert symmetries(np.radians([0.0, 90.0, 200.0])) == []


@pytest.mark.parametrize("see", ["lengths", "heads", "both"])
def test_nothing_is_found_on_the_arms_own_logs(see: str) -> None:
    arm = two_arm()
    found = bha.check(arm, log_of(arm, *steps(arm), see=see))
    assert found.faults == ()
    assert not [f for f in found.findings if f.severity == "warning"]


@pytest.mark.parametrize("name", bha.robots.names())
def test_nothing_is_found_on_shipped_arms_that_are_stiffer_slower_and_seen_badly(name: str) -> None:
    """Three times as stiff, creeping, 1 mm of noise at 10 Hz, the camera 25 mm off and turned by 5 degrees."""
    mapping = bha.robots.parameters(name).to_mapping()
    plant = copy.deepcopy(mapping)
    for section in plant["section"]:
        for key in ("stiffness", "bending_stiffness"):
            section[key] = [3.0 * k for k in section[key]]
        section["damping"] *= 3.0
    plant["effect"] = [{"kind": "creep", "where": "all", "stiffness": 200.0, "tau": 2.0}]
    filed, real = arm_of(mapping), arm_of(plant)
    camera = about_z(5.0)
    time, pressures = steps(filed)
    log = log_of(
        real,
        time,
        pressures,
        see="heads",
        heads=lambda h: h @ camera.T + np.array([0.02, -0.015, 0.0]),
        noise=1e-3,
        hold=5,
    )
    found = bha.check(filed, log)
    assert found.faults == ()


def test_a_swapped_pair_seen_by_lengths_and_heads_is_the_tubes_alone() -> None:
    arm = two_arm()
    found = bha.check(arm, log_of(arm, *steps(arm), feeds=[1, 0, 2, 3, 4, 5]))
    assert explanations(found) == ["tubes exchanged: p11 and p12"]
    assert "rename p11 to p12, p12 to p11" in repairs(found)
    assert 'angle_deg = 0, input = "p12"; angle_deg = 120, input = "p11"' in repairs(found)


def test_a_swapped_pair_seen_by_the_head_may_be_a_mirrored_camera() -> None:
    arm = one_arm()
    found = bha.check(arm, log_of(arm, *steps(arm), see="heads", feeds=[1, 0, 2]))
    assert explanations(found)[0] == "tubes exchanged: p11 and p12"
    assert any("camera mirrored" in what for what in explanations(found))
    assert any("by hand" in split for split in found.faults[0].splits)


def test_a_swapped_pair_seen_by_lengths_may_be_swapped_sensors() -> None:
    arm = one_arm()
    for change in ({"feeds": [0, 2, 1]}, {"lengths": lambda q: q[:, [0, 2, 1]]}):
        found = bha.check(arm, log_of(arm, *steps(arm), see="lengths", **change))  # type: ignore[arg-type]
        assert set(explanations(found)) == {"tubes exchanged: p12 and p13", "length sensors exchanged: q12 and q13"}


def test_a_cycle_seen_by_the_head_is_tubes_azimuth_or_camera() -> None:
    arm = one_arm()
    found = bha.check(arm, log_of(arm, *steps(arm), see="heads", feeds=[1, 2, 0]))
    said = explanations(found)
    assert said[0].startswith("tubes exchanged: p11 feeds the chamber of p12")
    assert any("azimuth" in what and "120 deg" in what for what in said)
    assert any("camera turned by 1" in what or "camera turned by -1" in what for what in said)


def test_the_repairs_of_a_cycle_repair_it() -> None:
    """Each line of the class, written into the file, leaves nothing to find."""
    arm = one_arm()
    log = log_of(arm, *steps(arm), see="heads", feeds=[1, 2, 0])
    (fault,) = bha.check(arm, log).faults
    turn = next(cause.turns[0] for cause in bha.check(arm, log).verdict.causes if cause.kind == "azimuth")  # type: ignore[union-attr]
    assert bha.check(arm_of(turned(nominal(1), 1, float(np.degrees(turn)))), log).faults == ()
    line = next(e.repair for e in fault.explanations if "camera_rotation_deg" in e.repair)
    vector = [float(v) for v in line.split("[")[-1].rstrip("]").split(",")]
    mapping = nominal(1)
    mapping["sensors"]["camera_rotation_deg"] = vector
    assert bha.check(arm_of(mapping), log).faults == ()
    mapping = nominal(1)
    mapping["section"][0]["bellows"] = [
        {"angle_deg": 120.0 * k, "input": name} for k, name in enumerate(("p13", "p11", "p12"))
    ]
    assert 'angle_deg = 0, input = "p13"; angle_deg = 120, input = "p11"' in fault.explanations[0].repair
    assert bha.check(arm_of(mapping), log).faults == ()


@pytest.mark.parametrize("degrees", [15.0, -60.0, 180.0])
def test_an_azimuth_is_found_with_its_angle(degrees: float) -> None:
    arm, plant = two_arm(), arm_of(turned(nominal(2), 2, degrees))
    found = bha.check(arm, log_of(plant, *steps(arm), see="heads"))
    assert found.verdict is not None
    cause = next(c for c in found.verdict.causes if c.kind == "azimuth")
    assert cause.sections == (1,)
    assert abs((np.degrees(cause.turns[0]) - degrees + 180.0) % 360.0 - 180.0) < 3.0


def test_a_small_azimuth_is_a_note() -> None:
    arm, plant = one_arm(), arm_of(turned(nominal(1), 1, 8.0))
    found = bha.check(arm, log_of(plant, *steps(arm), see="heads"))
    assert found.faults == ()
    assert any("turned by 8 deg" in f.what for f in found.findings if f.severity == "note")


def test_sections_exchanged_are_found_as_a_whole() -> None:
    arm = two_arm()
    found = bha.check(arm, log_of(arm, *steps(arm), see="heads", feeds=[3, 4, 5, 0, 1, 2]))
    assert any(what.startswith("tubes of sections 1 and 2 exchanged") for what in explanations(found))


@pytest.mark.parametrize("driven", [0, 1])
@pytest.mark.parametrize("exchanged", [True, False])
def test_a_section_that_lengthens_while_the_other_is_driven(driven: int, exchanged: bool) -> None:
    """All chambers of one section together, as labs first do: what lengthens is the section whose tubes these are."""
    arm = two_arm()
    time, pressures = steps(arm)
    alone = np.tile(pressures[0], (len(time), 1))
    alone[:, 3 * driven : 3 * driven + 3] = pressures[:, [0]]
    feeds = [3, 4, 5, 0, 1, 2] if exchanged else None
    said = explanations(bha.check(arm, log_of(arm, time, alone, see="heads", feeds=feeds)))
    assert [what[:38] for what in said[:1]] == (["tubes of sections 1 and 2 exchanged as"] if exchanged else [])


def test_a_section_that_another_one_bends_is_not_judged_by_that() -> None:
    """Its pressures follow the other's by a hundredth, as those behind one supply do; it hardly lengthens."""
    arm = two_arm()
    time, pressures = steps(arm)
    pressures[:, 3:] = 1.0e5 + 0.01 * (pressures[:, :3] - 1.0e5)
    coupled = arm.with_effects([{"kind": "section_coupling", "where": "section 1", "stiffness": 40.0}])
    found = bha.check(arm, log_of(coupled, time, pressures, see="lengths"))
    assert found.evidence is not None
    assert ("lengths", 1, "bending") in found.evidence.blocks
    assert ("lengths", 1, "bending") not in found.evidence.informative
    assert found.faults == ()


def test_one_tube_of_each_section_exchanged() -> None:
    arm = two_arm()
    found = bha.check(arm, log_of(arm, *steps(arm), feeds=[0, 1, 3, 2, 4, 5]))
    assert explanations(found) == ["tubes exchanged: p13 and p21"]


def test_exchanged_sensors_are_told_from_tubes_where_heads_are_seen_too() -> None:
    arm = two_arm()
    found = bha.check(arm, log_of(arm, *steps(arm), lengths=lambda q: q[:, [0, 1, 2, 4, 3, 5]]))
    assert explanations(found) == ["length sensors exchanged: q21 and q22"]
    assert "rename q21 to q22, q22 to q21" in repairs(found)


@pytest.mark.parametrize(("sections", "a", "b"), [(2, "q13", "q21"), (3, "q12", "q33")])
def test_length_sensors_of_two_sections_exchanged(sections: int, a: str, b: str) -> None:
    arm = arm_of(nominal(sections))
    columns = [f"q{i}{k}" for i in range(1, sections + 1) for k in (1, 2, 3)]
    order = [columns.index({a: b, b: a}.get(name, name)) for name in columns]
    found = bha.check(arm, log_of(arm, *steps(arm), see="lengths", lengths=lambda q: q[:, order]))
    assert explanations(found) == [f"length sensors exchanged: {a} and {b}"]
    assert f"rename {a} to {b}, {b} to {a}" in repairs(found)
    # A tube of each section exchanged is not taken for it.
    fed = list(range(3 * sections))
    fed[2], fed[3] = 3, 2
    found = bha.check(arm, log_of(arm, *steps(arm), see="lengths", feeds=fed))
    assert explanations(found)[0].startswith("tubes exchanged: p13 and p21")


@pytest.mark.filterwarnings("ignore:simulated lengths")
def test_length_sensors_exchanged_of_an_arm_that_swings() -> None:
    """No linear map of the pressures says much of a section that is hardly driven while the others swing."""
    mapping = nominal(3)
    for section in mapping["section"]:
        section["damping"] *= 0.03
    arm = arm_of(mapping)
    columns = [f"q{i}{k}" for i in (1, 2, 3) for k in (1, 2, 3)]
    order = [columns.index({"q12": "q23", "q23": "q12"}.get(name, name)) for name in columns]
    time, pressures = steps(arm, seed=3)
    pressures[:, 3:6] = pressures[0, 3:6] + 0.1 * (pressures[:, 3:6] - pressures[0, 3:6])
    pressures[:, 5] = pressures[0, 5]
    found = bha.check(arm, log_of(arm, time, pressures, see="lengths", lengths=lambda q: q[:, order]))
    assert explanations(found) == ["length sensors exchanged: q12 and q23"]


def test_four_columns_with_two_neighbours_exchanged() -> None:
    mapping = nominal(1)
    mapping["section"][0]["bellows"] = [{"angle_deg": 90.0 * k, "input": f"p1{k + 1}"} for k in range(4)]
    arm = arm_of(mapping)
    found = bha.check(arm, log_of(arm, *steps(arm), see="heads", feeds=[1, 0, 2, 3]))
    assert explanations(found) == ["tubes exchanged: p11 and p12"]


def test_a_wire_through_both_sections_and_the_tip_alone_tell_swapped_tubes() -> None:
    arm = two_arm()
    found = bha.check(arm, log_of(arm, *steps(arm), see="tip", feeds=[0, 1, 2, 4, 3, 5]))
    assert "tubes exchanged: p21 and p22" in explanations(found)
    mapping = nominal(2)
    mapping["length_sensor"] = [
        {"name": f"wire{k}", "angle_deg": 120.0 * k, "radius": 0.09, "sections": [1, 2]} for k in range(3)
    ]
    arm = arm_of(mapping)
    time, pressures = steps(arm)
    columns = {"t [s]": time} | {
        f"{name} [Pa]": pressures[:, j] for name, j in zip(arm.inputs, [0, 1, 2, 4, 3, 5], strict=True)
    }
    run = bha.simulate_batch(arm, bha.Input(time, pressures, None, False), times=time, method="ros2", step=5e-3)
    for wire in arm.parameters.length_sensors:
        columns[f"{wire.name} [m]"] = run.lengths[0] @ wire_row(arm.parameters, wire)
    found = bha.check(arm, bha.Log.from_arrays(columns))
    assert "tubes exchanged: p21 and p22" in explanations(found)


def test_commands_will_do() -> None:
    arm = two_arm()
    log = log_of(arm, *steps(arm), see="heads", feeds=[0, 1, 2, 5, 4, 3], commanded=True)
    found = bha.check(arm, log)
    assert "tubes exchanged: pc21 and pc23" in explanations(found)
    assert "rename pc21 to pc23" in repairs(found)
    assert 'angle_deg = 0, input = "p23"' in repairs(found)


def test_one_chamber_alone_leaves_the_others_untold() -> None:
    arm = one_arm()
    time, pressures = steps(arm)
    pressures[:, 1:] = 1.2e5
    found = bha.check(arm, log_of(arm, time, pressures, see="heads"))
    assert found.faults == ()
    said = " ".join(found.untold)
    assert "p12, p13 hardly moved" in said
    assert "mirrored camera would not show" in said


def test_chambers_driven_together_tell_no_direction() -> None:
    arm = one_arm()
    time, pressures = steps(arm)
    pressures[:] = pressures[:, :1]
    found = bha.check(arm, log_of(arm, time, pressures, see="heads", feeds=[1, 0, 2]))
    assert found.faults == ()
    assert any("driven together" in text for text in found.untold)


def test_an_arm_at_rest_tells_nothing_and_is_no_fault() -> None:
    arm = one_arm()
    time, pressures = steps(arm)
    pressures[:] = 1.2e5 + 100.0 * np.random.default_rng(0).standard_normal(pressures.shape)
    found = bha.check(arm, log_of(arm, time, pressures))
    assert found.faults == ()
    assert any("nothing moved enough" in text for text in found.untold)


def test_wires_on_the_wrong_sides_are_named_and_those_on_the_right_ones_are_not() -> None:
    """Two wires a section, left and right, tell no section alone; those of section 2 run through section 1."""

    def with_wires(left: float) -> bha.Arm:
        mapping = nominal(2)
        mapping["length_sensor"] = [
            {"name": f"wire{i}{side}", "angle_deg": angle, "radius": 0.09, "sections": list(range(1, i + 1))}
            for i in (1, 2)
            for side, angle in (("l", left), ("r", left + 180.0))
        ]
        return arm_of(mapping)

    real = with_wires(0.0)
    time, pressures = steps(real)
    run = bha.simulate_batch(real, bha.Input(time, pressures, None, False), times=time, method="ros2", step=5e-3)
    columns = {"t [s]": time} | {f"{name} [Pa]": p for name, p in zip(real.inputs, pressures.T, strict=True)}
    for wire in real.parameters.length_sensors:
        columns[f"{wire.name} [m]"] = run.lengths[0] @ wire_row(real.parameters, wire)
    log = bha.Log.from_arrays(columns)
    assert bha.check(real, log).faults == ()
    found = bha.check(with_wires(180.0), log)
    assert any("wire1l" in what and "wire2r" in what for what in explanations(found))


def test_sections_that_share_their_tubes_are_named_once() -> None:
    mapping = nominal(2)
    mapping["section"][1]["bellows"] = [{"angle_deg": 120.0 * k, "input": f"p1{k + 1}"} for k in range(3)]
    arm = arm_of(mapping)
    found = bha.check(arm, log_of(arm, *steps(arm), see="heads", feeds=[1, 0, 2]))
    assert explanations(found).count("tubes exchanged: p11 and p12") == 1
    assert bha.check(arm, log_of(arm, *steps(arm), see="heads")).faults == ()


@pytest.mark.parametrize("rows", [1, 2, 5, 40])
def test_short_logs_tell_nothing_and_break_nothing(rows: int) -> None:
    arm = one_arm()
    time, pressures = steps(arm, duration=2.0)
    log = log_of(arm, time[:rows], pressures[:rows]) if rows > 1 else None
    if log is None:
        columns = {"t [s]": [0.0], "p11 [Pa]": [1.2e5], "p12 [Pa]": [1.2e5], "p13 [Pa]": [1.2e5], "q11 [m]": [0.2]}
        log = bha.Log.from_arrays(columns)
    found = bha.check(arm, log)
    assert found.faults == ()
    assert found.untold


def test_one_log_of_several_with_swapped_tubes_is_named() -> None:
    """The pool of a right and a swapped log looks like a section that does not bend; each alone tells."""
    arm = one_arm()
    logs = [
        log_of(arm, *steps(arm, seed=seed), see="lengths", feeds=feeds)
        for seed, feeds in ((0, [0, 1, 2]), (1, [1, 0, 2]), (2, [0, 1, 2]))
    ]
    named = [bha.Recording(arm, log, name=f"log{k}") for k, log in enumerate(logs)]
    found = bha.check(arm, named[:2])
    (fault,) = found.faults
    assert fault.where == "log1"
    assert fault.explanations[0].what == "tubes exchanged: p11 and p12"
    assert "log0 does not show it" in fault.evidence
    # The file is right for the others: it is the log that is to be mended.
    assert fault.explanations[0].repair == "in the log's heading rename p11 to p12, p12 to p11"
    assert [f.where for f in bha.check(arm, named).faults] == ["log1"]
    assert bha.check(arm, [named[0], named[2]]).faults == ()
    # Where all logs say the same it is said of all.
    both = [named[1], bha.Recording(arm, log_of(arm, *steps(arm, seed=3), see="lengths", feeds=[1, 0, 2]))]
    assert [f.where for f in bha.check(arm, both).faults] == ["all logs"]


@pytest.mark.parametrize("swapped", ["wires", "tubes"])
def test_two_wires_at_odd_angles_are_told_from_two_tubes(swapped: str) -> None:
    mapping = nominal(1)
    mapping["length_sensor"] = [
        {"name": f"wire{k}", "angle_deg": angle, "radius": 0.09, "sections": [1]}
        for k, angle in enumerate((20, 110, 250))
    ]
    arm = arm_of(mapping)
    time, pressures = steps(arm)
    run = bha.simulate_batch(arm, bha.Input(time, pressures), times=time, method="ros2", step=5e-3)
    order = (0, 1, 2) if swapped == "wires" else (1, 0, 2)
    columns = {"t [s]": time} | {f"p1{k + 1} [Pa]": pressures[:, j] for k, j in enumerate(order)}
    tables = [run.lengths[0] @ wire_row(arm.parameters, wire) for wire in arm.parameters.length_sensors]
    tables = [tables[k] for k in ((1, 0, 2) if swapped == "wires" else (0, 1, 2))]
    noise = 3e-4 * np.random.default_rng(0).standard_normal((len(time), 3))
    columns |= {f"wire{k} [m]": table + noise[:, k] for k, table in enumerate(tables)}
    said = explanations(bha.check(arm, bha.Log.from_arrays(columns)))
    assert said[0] == (
        "length sensors exchanged: wire0 and wire1" if swapped == "wires" else "tubes exchanged: p11 and p12"
    )
