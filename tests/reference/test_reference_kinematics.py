"""The paper's own map (7), (9), (11) against the one without the switch, and both against geometry."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from reference_states import State, random_state

from bha import reference as ref
from bha.reference import kinematics
from bha.reference.homogeneous import along_z
from bha.reference.transformations import arc_functions, bending_coordinates, bending_coordinates_jacobian

R_B = 0.1


def test_quarter_circle() -> None:
    # Bellows 1 short: the section bends towards it, phi = 0, in the x-z plane, with l = 0.2 and psi = pi/2.
    length, psi = 0.2, np.pi / 2
    lengths = length - R_B * psi * np.cos(np.deg2rad([0.0, 120.0, 240.0]))
    phi, kappa, backbone = kinematics.specific_mapping(lengths, R_B)
    assert phi == pytest.approx(0.0, abs=1e-15)
    assert kinematics.bending_angle(kappa, backbone) == pytest.approx(psi, rel=1e-14)
    radius = length / psi
    expected = [[0, 0, 1, radius], [0, 1, 0, 0], [-1, 0, 0, radius], [0, 0, 0, 1]]
    np.testing.assert_allclose(kinematics.general_mapping(phi, kappa, backbone), expected, atol=1e-15)


@pytest.mark.parametrize("seed", range(20))
def test_switched_and_unswitched_map_agree(arm: ref.Arm, seed: int) -> None:
    q = random_state(3, seed).q
    for found, expected in zip(
        ref.forward_kinematics(arm, q), kinematics.switched_forward_kinematics(arm, q), strict=True
    ):
        np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("bend", [0.0, 1e-9, 1e-7, 1e-5, 1e-3])
def test_the_switch_costs_at_most_what_its_docstring_says(arm: ref.Arm, bend: float) -> None:
    q = np.tile(0.2 + bend * np.array([0.7, -0.4, 0.1]), 3)
    found, _ = ref.forward_kinematics(arm, q)
    expected, _ = kinematics.switched_forward_kinematics(arm, q)
    # Three sections, each up to l psi / 2 at psi = 1e-6 l, and its tilt over the length of the arm above it.
    np.testing.assert_allclose(found, expected, atol=3 * 1e-6 * 0.2 * 0.7)


def test_linear_form_of_the_specific_mapping() -> None:
    lengths = np.array([0.17, 0.21, 0.29])
    phi, kappa, length = kinematics.specific_mapping(lengths, R_B)
    psi = kinematics.bending_angle(kappa, length)
    x = bending_coordinates(lengths, R_B)
    np.testing.assert_allclose(x, [psi * np.cos(phi), psi * np.sin(phi), length], rtol=1e-13)
    np.testing.assert_allclose(bending_coordinates_jacobian(R_B) @ lengths, x, rtol=1e-13)


def test_equal_lengths_are_exactly_straight() -> None:
    assert (bending_coordinates(np.full(3, 0.1 + 0.2), R_B)[:2] == 0.0).all()
    phi, kappa, _ = kinematics.specific_mapping(np.full(3, 0.1 + 0.2), R_B)
    assert (phi, kappa) == (0.0, 0.0)


def test_rigid_pieces_stand_before_and_after_the_arc(arm: ref.Arm) -> None:
    bare = dataclasses.replace(arm.sections[0], base_offset=0.0, head_offset=0.0)
    whole = dataclasses.replace(bare, base_offset=0.03, head_offset=0.05)
    lengths = np.array([0.15, 0.2, 0.3])
    expected = along_z(0.03) @ kinematics.switched_section_pose(bare, lengths) @ along_z(0.05)
    np.testing.assert_allclose(kinematics.switched_section_pose(whole, lengths), expected, atol=1e-16)
    expected = arm.base_pose @ expected
    one = dataclasses.replace(arm, sections=(whole,))
    positions, rotations = ref.forward_kinematics(one, lengths)
    np.testing.assert_allclose(positions[0], expected[:3, 3], atol=1e-15)
    np.testing.assert_allclose(rotations[0], expected[:3, :3], atol=1e-15)


@pytest.mark.parametrize("s", [0.0, 1e-12, 1e-3, 0.3, 0.999, 1.0, 2.5, 9.0, 30.0])
def test_arc_functions(s: float) -> None:
    # Sum of the series in exact rational arithmetic would be the same; 60 terms of it in long double are enough.
    expected = np.zeros((2, 3), dtype=np.longdouble)
    for row, first in enumerate((1, 2)):
        coefficient = np.longdouble(1) / (1 if first == 1 else 2)
        for k in range(60):
            powers = [
                np.longdouble(s) ** k,
                k * np.longdouble(s) ** (k - 1) if k >= 1 else 0,
                k * (k - 1) * np.longdouble(s) ** (k - 2) if k >= 2 else 0,
            ]
            expected[row] += coefficient * np.array(powers, dtype=np.longdouble)
            coefficient *= np.longdouble(-1) / ((2 * k + first + 1) * (2 * k + first + 2))
    np.testing.assert_allclose(np.array(arc_functions(s)), expected.astype(float), rtol=1e-13, atol=1e-15)


def test_turning_the_arm_by_120_degrees_permutes_the_bellows(arms: dict[str, ref.Arm], state: State) -> None:
    arm = arms["bha_nominal"]
    turn = np.array([[-0.5, -np.sqrt(0.75), 0], [np.sqrt(0.75), -0.5, 0], [0, 0, 1]])
    q = state.q.reshape(3, 3)
    positions, rotations = ref.forward_kinematics(arm, q.reshape(-1))
    turned_positions, turned_rotations = ref.forward_kinematics(arm, np.roll(q, 1, axis=1).reshape(-1))
    np.testing.assert_allclose(turned_positions, positions @ turn.T, atol=1e-14)
    np.testing.assert_allclose(turned_rotations, turn @ rotations @ turn.T, atol=1e-14)
