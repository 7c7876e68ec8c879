"""Several arcs a section, masses along it, tapered bellows and the base pose, against what they are made of."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from reference_states import State, central_difference, random_state, with_arcs

from bha import reference as ref
from bha.errors import ParameterError
from bha.reference import kinematics
from bha.reference.transformations import arcs_pose, bending_coordinates

SLICES = 200


@pytest.fixture
def section(arms: dict[str, ref.Arm]) -> ref.Section:
    return with_arcs(arms["random_3"].sections[0])


def slices(section: ref.Section, lengths: np.ndarray, share: float = 1.0) -> np.ndarray:
    """Pose at a share of a section's arcs, put together from rigid slices.

    Each turns half its angle before and half behind a straight piece: exact but for (its angle)^2 / 24 of its length.
    """
    phi, kappa, length = kinematics.specific_mapping(lengths, section.bellows_radius)
    H = np.eye(4)
    for start, end, turn in edges(section, share):
        half = ref.parameters.rotation_by_vector(
            (-np.sin(phi) * turn * kappa * length / 2, np.cos(phi) * turn * kappa * length / 2, 0.0)
        )
        slice_pose = np.eye(4)
        slice_pose[:3, :3] = half @ half
        slice_pose[:3, 3] = half @ [0.0, 0.0, (end - start) * length]
        H = H @ slice_pose
    return H


def edges(section: ref.Section, share: float) -> list[tuple[float, float, float]]:
    """(start, end, share of the bending) of ``SLICES`` slices an arc, up to a share of the length."""
    found, start = [], 0.0
    for arc in section.arcs:
        for k in range(SLICES):
            low, high = start + arc.length * k / SLICES, start + arc.length * (k + 1) / SLICES
            part = min(max((share - low) / (high - low), 0.0), 1.0)
            found.append((low, low + part * (high - low), part * arc.bending / SLICES))
        start += arc.length
    return found


@pytest.mark.parametrize("share", [0.0, 0.17, 0.3, 0.77, 1.0])
def test_arcs_against_rigid_slices(section: ref.Section, share: float) -> None:
    for seed in range(5):
        lengths = random_state(1, seed).q
        found, _, _ = arcs_pose(section, bending_coordinates(lengths, section.bellows_radius), 0, share)
        np.testing.assert_allclose(found, slices(section, lengths, share), atol=2e-6)


def test_head_pose_with_the_papers_switch(arm: ref.Arm, state: State) -> None:
    """(7), (9) and (11) for every arc, as the paper writes them."""
    for found, expected in zip(
        ref.forward_kinematics(arm, state.q), kinematics.switched_forward_kinematics(arm, state.q), strict=True
    ):
        np.testing.assert_allclose(found, expected, atol=1e-7)


@pytest.mark.parametrize("count", [1, 2, 7])
def test_equal_arcs_are_one_arc(arm: ref.Arm, state: State, count: int) -> None:
    def split(section: ref.Section) -> ref.Section:
        share = 1.0 / count
        return dataclasses.replace(
            section, arcs=(ref.SectionArc(share, share, section.bellows_radius, section.terminal_area),) * count
        )

    single = dataclasses.replace(arm, sections=tuple(dataclasses.replace(s, arcs=()) for s in arm.sections))
    several = dataclasses.replace(arm, sections=tuple(split(s) for s in arm.sections))
    np.testing.assert_allclose(
        ref.forward_dynamics(several, state.q, state.qd, state.p, state.f_ext),
        ref.forward_dynamics(single, state.q, state.qd, state.p, state.f_ext),
        rtol=1e-9,
    )


def test_the_base_moves_everything_with_it(arm: ref.Arm, state: State) -> None:
    """Base, gravity and external forces turned together: the same motion, the heads turned."""
    turn = ref.parameters.rotation_by_vector((0.3, 0.9, -0.4))
    rotation = turn @ arm.base_pose[:3, :3]
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    angle = np.arctan2(np.linalg.norm(axis) / 2, (np.trace(rotation) - 1) / 2)
    moved = dataclasses.replace(
        arm,
        base_rotation=tuple(axis / np.linalg.norm(axis) * angle),
        base_position=tuple(turn @ arm.base_pose[:3, 3] + [1.0, 2.0, 3.0]),
        gravity=tuple(turn @ np.array(arm.gravity)),
    )
    np.testing.assert_allclose(
        ref.forward_dynamics(moved, state.q, state.qd, state.p, state.f_ext @ turn.T),
        ref.forward_dynamics(arm, state.q, state.qd, state.p, state.f_ext),
        rtol=1e-9,
    )
    (r, R), (r_moved, R_moved) = ref.forward_kinematics(arm, state.q), ref.forward_kinematics(moved, state.q)
    np.testing.assert_allclose(r_moved, r @ turn.T + [1.0, 2.0, 3.0], atol=1e-13)
    np.testing.assert_allclose(R_moved, turn @ R, atol=1e-13)


def test_a_mass_at_the_end_is_a_mass_at_the_head(arm: ref.Arm, state: State) -> None:
    """Half of a head's mass at share 1, behind the rigid piece, moves as the whole did."""

    def halved(section: ref.Section) -> ref.Section:
        x, y, z = section.center_of_mass
        half = tuple(J / 2 for J in section.inertia)
        end = ref.PointMass(1.0, section.mass / 2, half, (x, y, z + section.head_offset))
        return dataclasses.replace(section, mass=section.mass / 2, inertia=half, masses=(*section.masses, end))

    split = dataclasses.replace(arm, sections=tuple(halved(s) for s in arm.sections))
    for name in ("inertia_matrix", "coriolis_matrix", "bias_force", "actuation_force"):
        found = getattr(ref.dynamics_terms(split, state.q, state.qd, state.p), name)
        expected = getattr(ref.dynamics_terms(arm, state.q, state.qd, state.p), name)
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_complex_step_is_the_derivative(arm: ref.Arm, state: State) -> None:
    def qdd(q: np.ndarray) -> np.ndarray:
        return ref.forward_dynamics(arm, q, state.qd, state.p, state.f_ext)

    steps = [qdd(state.q + 1e-30j * direction).imag / 1e-30 for direction in np.eye(9)]
    expected = central_difference(qdd, state.q)
    np.testing.assert_allclose(steps, expected, atol=1e-7 * np.abs(expected).max())


def test_volume_of_tapered_bellows(section: ref.Section) -> None:
    """The pressure force is the derivative of the volume, over the arcs area times length off the centre."""
    areas = [section.terminal_area * k for k in (1.2, 1.0, 0.88)]
    section = dataclasses.replace(
        section, arcs=tuple(dataclasses.replace(a, area=k) for a, k in zip(section.arcs, areas, strict=True))
    )
    arm = ref.Arm((section,), (0.0, 0.0, 9.81), 1e5, force_model="work_conjugate")
    state = random_state(1, 4)

    def volumes(q: np.ndarray) -> np.ndarray:
        phi, kappa, length = kinematics.specific_mapping(q, section.bellows_radius)
        out = np.zeros(3)
        for k, angle in enumerate(ref.parameters.BELLOWS_ANGLES):
            for arc in section.arcs:
                own = arc.length * length - arc.radius * arc.bending * kappa * length * np.cos(phi - angle)
                out[k] += arc.area * own
        return out

    expected = central_difference(volumes, state.q) @ (state.p - 1e5)
    np.testing.assert_allclose(ref.actuation_force(arm, state.q, state.p), expected, rtol=1e-8)
    with pytest.raises(ParameterError, match="end_force with areas that differ along a section"):
        dataclasses.replace(arm, force_model="end_force")


def test_a_file_says_shares_and_ratios(arms: dict[str, ref.Arm], oracle: dict) -> None:
    text = str(oracle["arms"]["bha_nominal"]) + (
        "[[section.arcs]]\nlength = 0.5\nbending = 0.75\nrelative_radius = 1.1\n"
        "[[section.arcs]]\nlength = 0.5\nbending = 0.25\nrelative_radius = 0.9\n"
        "[[section.masses]]\nshare = 0.5\nmass = 0.1\n"
        "[base]\nposition = [0.0, 0.0, 1.0]\nrotation_deg = [0.0, 90.0, 0.0]\n"
    )
    arm = ref.parse_arm(text)
    section = arm.sections[2]
    assert sum(a.bending * a.radius for a in section.arcs) == pytest.approx(section.bellows_radius, rel=1e-14)
    assert section.arcs[0].radius / section.arcs[1].radius == pytest.approx(1.1 / 0.9)
    assert section.masses == (ref.PointMass(0.5, 0.1),)
    np.testing.assert_allclose(arm.base_pose[:3, 2], [1.0, 0.0, 0.0], atol=1e-15)
    for wrong, message in [
        (text.replace("bending = 0.25", "bending = 0.3"), "bending: found shares that do not add up to 1"),
        (text.replace("share = 0.5", "share = 1.5"), "masses 1: share: found 1.5"),
        (text.replace("share = 0.5", "place = 0.5"), "share: missing"),
        (text.replace("rotation_deg", "rotation_grad"), "base: rotation_grad: unknown key"),
    ]:
        with pytest.raises(ParameterError, match=message):
            ref.parse_arm(wrong)
