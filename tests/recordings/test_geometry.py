"""Lengths of bellows and wires against arcs integrated along the arm, and cameras against rotation matrices."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha import reference
from bha.arm import geometry
from bha.parameters import ArmParameters, LengthSensorParameters, SectionParameters, SensorsParameters

Array = NDArray[np.float64]
NOMINAL = bha.robots.parameters("bha_nominal")
LAYOUT = [(0.0, 0.1), (77.0, 0.1), (200.0, 0.06), (-45.0, 0.13), (10.0, 0.0)]


def with_layout(places: list[tuple[float, float]]) -> SectionParameters:
    bellows = [{"angle_deg": angle, "radius": radius} for angle, radius in places]
    mapping = NOMINAL.to_mapping()
    mapping["section"][1]["bellows"] = bellows
    return ArmParameters.from_mapping(mapping).sections[1]


def offset_curve(section: reference.Section, q: Array, angle: float, radius: float) -> float:
    """Length of the line at a place beside a section's centre line: the sum of short chords between poses of (9)."""
    phi, kappa, length = reference.kinematics.specific_mapping(q, section.bellows_radius)
    place = np.array([radius * math.cos(angle), radius * math.sin(angle), 0.0, 1.0])
    points = [place]
    for s in np.linspace(0.0, length, 2001)[1:]:
        points.append(reference.kinematics.general_mapping(phi, kappa, float(s)) @ place)
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def test_bellows_of_any_layout_are_lines_beside_the_arc(tmp_path: Path) -> None:
    NOMINAL.write(tmp_path / "arm.toml")
    ideal = reference.load_arm(tmp_path / "arm.toml").sections[1]
    section = with_layout(LAYOUT)
    rows = geometry.bellows_length_rows(section, 1, 3)
    assert rows.shape == (5, 9)
    assert not rows[:, [0, 1, 2, 6, 7, 8]].any()
    rng = np.random.default_rng(5)
    for _ in range(4):
        q = rng.uniform(0.12, 0.24, 9)
        expected = [offset_curve(ideal, q[3:6], math.radians(a), r) for a, r in LAYOUT]
        np.testing.assert_allclose(rows @ q, expected, atol=2e-7)


def test_bellows_at_the_coordinates_are_the_coordinates() -> None:
    for index, section in enumerate(NOMINAL.sections):
        rows = geometry.bellows_length_rows(section, index, 3)
        np.testing.assert_array_equal(rows, np.eye(9)[3 * index : 3 * index + 3])
    # Turned by a third of a turn they are the coordinates in another order.
    turned = with_layout([(120.0, 0.093), (240.0, 0.093), (0.0, 0.093)])
    assert not turned.has_standard_bellows
    np.testing.assert_array_equal(geometry.bellows_length_rows(turned, 0, 1), np.eye(3)[[1, 2, 0]])
    assert with_layout([(0.0, 0.093), (-240.0, 0.093), (240.0, 0.093)]).has_standard_bellows
    assert not with_layout([(0.0, 0.093), (120.0, 0.093), (240.0, 0.09)]).has_standard_bellows
    assert not with_layout([(90.0 * k, 0.093) for k in range(4)]).has_standard_bellows
    # Opposite bellows: their mean is the centre line.
    four = geometry.bellows_length_rows(with_layout([(45.0 + 90.0 * k, 0.05) for k in range(4)]), 0, 1)
    np.testing.assert_allclose(four[0] + four[2], np.full(3, 2.0 / 3.0), atol=1e-15)


def test_wires_add_up_over_their_sections() -> None:
    sensor = LengthSensorParameters(name="wire1", angle_deg=30.0, radius=0.12, sections=(1, 3), offset=0.04)
    row = geometry.wire_row(NOMINAL, sensor)
    q = np.random.default_rng(2).uniform(0.12, 0.25, 9)
    expected = 0.0
    for i in (0, 2):
        own, mean = q[3 * i : 3 * i + 3], q[3 * i : 3 * i + 3].mean()
        share = sensor.radius / NOMINAL.sections[i].bellows_radius
        angles = np.radians([0.0, 120.0, 240.0])
        expected += mean + 2 / 3 * share * float(((own - mean) * np.cos(math.radians(30.0) - angles)).sum())
    assert row @ q == pytest.approx(expected, abs=1e-15)
    assert not row[3:6].any()


def rotation_matrix(vector: Array) -> Array:
    """Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def all_axes() -> list[tuple[str, str, str]]:
    orders = itertools.permutations("xyz")
    signs = list(itertools.product(("", "-"), repeat=3))
    return [tuple(s + a for s, a in zip(sign, order, strict=True)) for order in orders for sign in signs]


@pytest.mark.parametrize("axes", all_axes(), ids=",".join)
def test_cameras_however_they_stand(axes: tuple[str, str, str]) -> None:
    turn, origin = np.array([0.4, -1.1, 0.3]), np.array([0.2, -0.4, 1.3])
    sensors = SensorsParameters(camera_position=tuple(origin), camera_rotation=tuple(turn), camera_axes=axes)
    camera = geometry.camera_frame(sensors)
    unit = {"x": [1.0, 0, 0], "y": [0, 1.0, 0], "z": [0, 0, 1.0]}
    signed = np.column_stack([np.array(unit[a[-1]]) * (-1.0 if a[0] == "-" else 1.0) for a in axes])
    matrix = rotation_matrix(turn) @ signed
    np.testing.assert_allclose(camera.matrix, matrix, atol=1e-15)
    assert camera.is_mirrored == (np.linalg.det(matrix) < 0)
    arm = bha.Arm(NOMINAL)
    heads = [arm.forward_kinematics(q) for q in np.random.default_rng(1).uniform(0.13, 0.24, (4, 9))]
    positions = np.array([h[0] for h in heads])
    rotations = np.array([h[1] for h in heads])
    seen = camera.positions(positions)
    assert seen.shape == (4, 3, 3)
    np.testing.assert_allclose(seen[2, 1], matrix.T @ (positions[2, 1] - origin), atol=1e-15)
    np.testing.assert_allclose(camera.base_positions(seen), positions, atol=1e-15)
    # In a left-handed frame heads have left-handed axes too.
    expected = matrix.T @ rotations @ (signed if camera.is_mirrored else np.eye(3))
    quaternions = geometry.quaternions_of(rotations)
    turned = camera.orientations(quaternions)
    np.testing.assert_allclose(geometry.rotations_of(turned), expected, atol=1e-14)
    np.testing.assert_allclose(camera.base_orientations(turned), quaternions, atol=1e-15)
    # Measured ones come with any sign, and rounded.
    signs = np.where(np.arange(4) % 2, 1.0, -1.0)[:, None, None]
    np.testing.assert_allclose(camera.steady(1.001 * signs * turned), turned, atol=1e-15)
    assert np.isnan(camera.steady(np.zeros(4))).all()


def test_a_left_handed_system_sees_the_straight_arm_unturned() -> None:
    mirrored = geometry.camera_frame(SensorsParameters(camera_axes=("y", "x", "z")))
    np.testing.assert_allclose(mirrored.orientations([1.0, 0.0, 0.0, 0.0]), [1.0, 0.0, 0.0, 0.0], atol=1e-15)


def test_without_a_table_heads_are_in_the_base_frame() -> None:
    for sensors in (None, SensorsParameters(), SensorsParameters(camera_rotation_deg=(0.0, 0.0, 0.0))):
        camera = geometry.camera_frame(sensors)
        assert camera.is_base
        given = np.random.default_rng(0).normal(size=(5, 2, 3))
        np.testing.assert_array_equal(camera.positions(given), given)
        np.testing.assert_array_equal(camera.orientations(given), given)


def test_quaternions_at_half_turns() -> None:
    given = np.array([[0.0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1], [0, -0.6, 0.8, 0], [-1, 0, 0, 0]])
    expected = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0.6, -0.8, 0], [1, 0, 0, 0]])
    np.testing.assert_allclose(geometry.quaternions_of(geometry.rotations_of(given)), expected, atol=1e-15)
    degrees = geometry.camera_frame(SensorsParameters(camera_rotation_deg=(0.0, 90.0, 0.0)))
    np.testing.assert_allclose(degrees.matrix, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)
