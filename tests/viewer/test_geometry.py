"""The drawn bodies against the geometry of arcs, written here by hand, and against the core's heads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bha
from bha.arm.bodies import bellows_lines, centre_line, up_direction
from bha.parameters import ArmParameters
from bha.viewer.geometry import layout_of, picture
from bha.viewer.solids import Mesh, ball, convolution, cylinder, together

NAMES = bha.robots.names()


def bent(arm: bha.Arm, seed: int = 7) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Lengths of a pose bent in every section."""
    rng = np.random.default_rng(seed)
    ranges = np.array([section.length_range for section in arm.parameters.sections])
    middle, half = ranges.mean(axis=1), np.ptp(ranges, axis=1) / 2
    return (middle[:, None] + 0.6 * half[:, None] * rng.uniform(-1.0, 1.0, (arm.section_count, 3))).ravel()


def angles_and_lengths(arm: bha.Arm, q: np.ndarray[Any, Any]) -> list[tuple[float, np.ndarray[Any, Any]]]:
    """Bending angle of each section and the lengths of its bellows: (4) and (7) of the paper, for any place."""
    found = []
    for k, section in enumerate(arm.parameters.sections):
        l1, l2, l3 = q[3 * k : 3 * k + 3]
        mean = (l1 + l2 + l3) / 3.0
        u = (l2 + l3 - 2.0 * l1) / (3.0 * section.bellows_radius)
        v = (l3 - l2) / (np.sqrt(3.0) * section.bellows_radius)
        bellows = section.resolved_bellows(k + 1)
        lengths = np.array([mean - b.radius * (u * np.cos(b.angle) + v * np.sin(b.angle)) for b in bellows])
        found.append((float(np.hypot(u, v)), lengths))
    return found


@pytest.mark.parametrize("name", NAMES)
def test_folds_are_as_long_as_their_bellows(name: str) -> None:
    """Of an arc of the angle a, K chords are together shorter than it by sin(a/2K) / (a/2K), exactly."""
    arm = bha.robots.load(name)
    layout, q = layout_of(arm), bent(arm)
    drawn, first = picture(layout, q), 0
    for section, (angle, lengths) in zip(layout.sections, angles_and_lengths(arm, q), strict=True):
        count = len(section.spread)
        heights = drawn.folds.scales[first : first + count * len(lengths), 2].reshape(count, -1)
        first += heights.size
        shorter = np.sinc(angle / (2 * count) / np.pi)
        np.testing.assert_allclose(heights.sum(axis=0), lengths * shorter, rtol=1e-9)
        assert heights.sum(axis=0) == pytest.approx(lengths, rel=2e-3)
    assert first == len(drawn.folds) == len(layout.fold_inputs)


@pytest.mark.parametrize("name", NAMES)
def test_folds_stand_end_to_end_at_the_bellows_places(name: str) -> None:
    arm = bha.robots.load(name)
    layout, q = layout_of(arm), bent(arm)
    folds, first = picture(layout, q).folds, 0
    half = folds.rotations[:, :, 2] * folds.scales[:, 2:] / 2.0
    begin, end = folds.positions - half, folds.positions + half
    for k, (section, parameters) in enumerate(zip(layout.sections, arm.parameters.sections, strict=True), start=1):
        bellows, count = parameters.resolved_bellows(k), len(section.spread)
        own = slice(first, first + count * len(bellows))
        first = own.stop
        starts, ends = (array[own].reshape(count, len(bellows), 3) for array in (begin, end))
        np.testing.assert_allclose(ends[:-1], starts[1:], atol=1e-12)
        for b, place in enumerate(bellows):
            offset = (place.radius * np.cos(place.angle), place.radius * np.sin(place.angle), 0.0)
            np.testing.assert_allclose(starts[0, b], arm.point_pose(q, k, 0.0, offset)[1], atol=1e-12)
            last = (offset[0], offset[1], -parameters.head_offset)
            np.testing.assert_allclose(ends[-1, b], arm.point_pose(q, k, 1.0, last)[1], atol=1e-12)
            # Somewhere in between it is on the bellows' line too.
            middle = arm.point_pose(q, k, 3 / count, offset)[1]
            np.testing.assert_allclose(starts[3, b], middle, atol=1e-12)
        inputs = [arm.inputs.index(place.input) for place in bellows]
        assert layout.fold_inputs[own].reshape(count, -1).tolist() == [inputs] * count
        np.testing.assert_allclose(folds.scales[own, :2], parameters.bellows_outer_radius)


def test_a_bent_section_lies_on_its_circle() -> None:
    """Bellows of a section that bends in the x-z plane: circles about one axis, of radius R - x."""
    arm = bha.robots.load("bha_nominal")
    r = arm.parameters.sections[0].bellows_radius
    angle, length = 0.8, 0.2
    radius = length / angle  # bent towards +x: the bellows at x = r is the shortest
    q = np.concatenate([length - r * angle * np.cos(np.radians([0.0, 120.0, 240.0])), np.full(6, 0.2)])
    layout = layout_of(arm)
    drawn = picture(layout, q)
    count = len(layout.sections[0].spread)
    ends = drawn.folds.positions - drawn.folds.rotations[:, :, 2] * drawn.folds.scales[:, 2:] / 2.0
    starts = ends[: 3 * count].reshape(count, 3, 3)
    for b, place in enumerate(np.radians([0.0, 120.0, 240.0])):
        about = np.hypot(starts[:, b, 0] - radius, starts[:, b, 2])
        np.testing.assert_allclose(about, radius - r * np.cos(place), atol=1e-12)
        np.testing.assert_allclose(starts[:, b, 1], r * np.sin(place), atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_heads_and_plates_stand_where_the_core_has_them(name: str) -> None:
    arm = bha.robots.load(name)
    layout, q = layout_of(arm), bent(arm)
    drawn = picture(layout, q)
    heads, rotations = arm.forward_kinematics(q)
    np.testing.assert_array_equal(drawn.heads, heads)
    np.testing.assert_array_equal(drawn.head_rotations, rotations)
    # The last body of a section ends at its head, or half a plate beyond where the plate is the last.
    for section in layout.sections:
        turns, origins = centre_line(arm, section.number, q, len(section.spread))
        head = origins[-1] + section.head_offset * turns[-1][:, 2]
        np.testing.assert_allclose(head, heads[section.number - 1], atol=1e-12)
    last, tip = drawn.plates, layout.sections[-1]
    end = last.positions[-1] + last.rotations[-1][:, 2] * last.scales[-1, 2] / 2.0
    beyond = 0.0 if tip.head_offset else last.scales[-1, 2] / 2.0
    np.testing.assert_allclose(end - beyond * rotations[-1][:, 2], heads[-1], atol=1e-12)


def test_rotations_are_rotations() -> None:
    arm = bha.robots.load("asu_two_section")
    drawn = picture(layout_of(arm), bent(arm))
    for solids in (drawn.folds, drawn.plates):
        turned = solids.rotations @ solids.rotations.transpose(0, 2, 1)
        np.testing.assert_allclose(turned, np.broadcast_to(np.eye(3), turned.shape), atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(solids.rotations), 1.0)


def test_conical_arms_are_drawn_conical() -> None:
    """Bellows of a section of two arcs stand as far apart in each as the file says."""
    arm = bha.robots.load("bha_nominal")
    table = arm.parameters.to_mapping()
    table["section"][0]["arcs"] = [
        {"length": 0.5, "bending": 0.5, "relative_radius": 1.2},
        {"length": 0.5, "bending": 0.5, "relative_radius": 0.8},
    ]
    conical = bha.Arm.from_parameters(ArmParameters.model_validate(table))
    layout = layout_of(conical)
    drawn = picture(layout, np.full(9, 0.2))
    count = len(layout.sections[0].spread)
    places = drawn.folds.positions[: 3 * count].reshape(count, 3, 3)
    apart = np.linalg.norm(places[..., :2], axis=-1)
    below, above = np.arange(count) + 0.5 < count / 2, np.arange(count) + 0.5 > count / 2
    radius = conical.parameters.sections[0].bellows_radius
    np.testing.assert_allclose(apart[below], 1.2 * radius)
    np.testing.assert_allclose(apart[above], 0.8 * radius)


def test_bellows_without_a_radius_get_one_that_fits() -> None:
    arm = bha.robots.load("bha_nominal")
    table = arm.parameters.to_mapping()
    for section in table["section"]:
        section.pop("bellows_outer_radius", None)
    layout = layout_of(bha.Arm.from_parameters(ArmParameters.model_validate(table)))
    for section, parameters in zip(layout.sections, arm.parameters.sections, strict=True):
        np.testing.assert_allclose(section.radii, np.sqrt(parameters.terminal_area / np.pi))
    table["section"][0]["terminal_area"] = 1.0
    layout = layout_of(bha.Arm.from_parameters(ArmParameters.model_validate(table)))
    radius = arm.parameters.sections[0].bellows_radius
    np.testing.assert_allclose(layout.sections[0].radii, radius * np.sqrt(3.0) / 2.0)


def test_up_is_against_gravity() -> None:
    arm = bha.robots.load("bha_nominal")
    assert up_direction(arm).tolist() == [0.0, 0.0, -1.0]
    assert up_direction(arm.with_changes(gravity=(0.0, 3.0, 0.0))).tolist() == [0.0, -1.0, 0.0]
    assert up_direction(arm.with_changes(gravity=(0.0, 0.0, 0.0))).tolist() == [0.0, 0.0, 1.0]


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.sum(np.cross(a, b) * c) / 6.0)


def test_meshes_are_closed_and_look_outwards() -> None:
    """The volume of a closed surface whose triangles are seen from outside against the clock is positive."""
    assert volume(cylinder(sides=400)) == pytest.approx(np.pi, rel=1e-3)
    assert volume(ball(sides=200, rings=100)) == pytest.approx(4.0 / 3.0 * np.pi, rel=1e-3)
    for mesh in (cylinder(), ball()):
        edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
        points = {tuple(np.round(p, 9) + 0.0): k for k, p in enumerate(mesh.vertices)}
        name = np.array([points[tuple(np.round(p, 9) + 0.0)] for p in mesh.vertices])
        named = np.sort(name[edges], axis=1)
        named = named[named[:, 0] != named[:, 1]]
        assert (np.unique(named, axis=0, return_counts=True)[1] == 2).all()
    fold = convolution()
    radii = np.hypot(fold.vertices[:, 0], fold.vertices[:, 1])
    assert radii.max() == pytest.approx(1.0)
    assert radii[fold.vertices[:, 2] == 0.5] == pytest.approx(radii[fold.vertices[:, 2] == -0.5])


def test_solids_are_placed_by_scale_turn_and_move() -> None:
    arm = bha.robots.load("bha_nominal")
    plates = picture(layout_of(arm), bent(arm)).plates
    placed = plates.placed(cylinder())
    by_hand = plates.positions[2] + plates.rotations[2] @ (plates.scales[2] * cylinder().vertices[5])
    np.testing.assert_allclose(placed[2, 5], by_hand)
    assert len(together([plates, plates])) == 2 * len(plates)


@pytest.mark.parametrize("name", NAMES)
def test_lines_of_bellows_are_as_long_as_the_bellows(name: str) -> None:
    arm = bha.robots.load(name)
    q = bent(arm)
    for number, (_, lengths) in enumerate(angles_and_lengths(arm, q), start=1):
        lines = bellows_lines(arm, number, q, 200)
        along = np.linalg.norm(np.diff(lines, axis=1), axis=-1).sum(axis=1)
        assert along == pytest.approx(lengths, rel=1e-4)
