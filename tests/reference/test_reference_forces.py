"""What holds a section beside its bellows, and wrenches from outside, against potentials and virtual work."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from reference_states import State, central_difference, rate

from bha import reference as ref
from bha.errors import InputError, ParameterError
from bha.reference import forces
from bha.reference.derivatives import transformations
from bha.reference.wrenches import pose_along


@pytest.fixture
def held(arm: ref.Arm) -> ref.Arm:
    """The arm with two bending planes and an axial spring in every section, all different."""
    sections = tuple(
        dataclasses.replace(
            section,
            bending_stiffness=(2.0 + i, 0.3, 0.2 - 0.1 * i),
            cross_bending_stiffness=(5.0 - i, 0.7 * i, 0.15),
            bending_plane=0.4 + 0.9 * i,
            axial_stiffness=(900.0 + 300.0 * i, 0.0, 4e3),
            axial_rest_length=0.17 + 0.01 * i,
            axial_damping=6.0 + i,
        )
        for i, section in enumerate(arm.sections)
    )
    return dataclasses.replace(arm, sections=sections, force_model="work_conjugate")


def test_every_force_that_holds_has_a_potential(held: ref.Arm, state: State) -> None:
    found = ref.bias_force(held, state.q, np.zeros(9))
    gradient = central_difference(lambda q: np.array(ref.energy(held, q, np.zeros(9)).potential), state.q)
    np.testing.assert_allclose(found, gradient, rtol=1e-8, atol=1e-8)


def test_bending_moment_in_its_planes(held: ref.Arm) -> None:
    section = held.sections[1]
    for phi, (k1, k3, k5) in (
        (section.bending_plane, section.bending_stiffness),
        (section.bending_plane + math.pi / 2, section.cross_bending_stiffness),
    ):
        for turn in (0.0, math.pi):
            direction = (math.cos(phi + turn), math.sin(phi + turn))
            moment = k1 * 0.8 + k3 * 0.8**3 + k5 * 0.8**5
            assert forces.bending_moment(section, 0.8, direction) == pytest.approx(moment, rel=1e-12)
            assert forces.bending_turning_moment(section, 0.8, direction) == pytest.approx(0.0, abs=1e-12)


def test_equal_planes_are_no_planes(held: ref.Arm, state: State) -> None:
    alike = [dataclasses.replace(s, cross_bending_stiffness=s.bending_stiffness) for s in held.sections]
    turned = [dataclasses.replace(s, bending_plane=s.bending_plane + 1.0) for s in alike]
    one, other = (dataclasses.replace(held, sections=tuple(s)) for s in (alike, turned))
    found, expected = (ref.bias_force(a, state.q, state.qd) for a in (one, other))
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)


def test_a_fabric_arm_hardly_lengthens_and_bends_easily(held: ref.Arm, state: State) -> None:
    """Springs at the bellows' radius tie lengthening (3 k) to bending (1.5 k r^2); an axial spring does not."""
    (section, *_) = held.sections
    fabric = dataclasses.replace(
        section, stiffness=(0.0,), bending_stiffness=(0.0,) * 3, cross_bending_stiffness=(0.0,) * 3
    )
    arm = dataclasses.replace(held, sections=(fabric,), gravity=(0.0, 0.0, 0.0))
    bent = np.array([-0.05, 0.01, 0.04]) + fabric.axial_rest_length
    np.testing.assert_allclose(ref.bias_force(arm, bent, np.zeros(3)), 0.0, atol=1e-12)
    stretched = np.full(3, fabric.axial_rest_length + 0.01)
    force = forces.spring_force(fabric.axial_stiffness, np.array(0.01))
    np.testing.assert_allclose(ref.bias_force(arm, stretched, np.zeros(3)), force / 3, rtol=1e-12)


@pytest.mark.parametrize("fraction", [0.0, 0.35, 1.0])
@pytest.mark.parametrize("section", [1, 3])
def test_wrenches_do_virtual_work(arm: ref.Arm, state: State, section: int, fraction: float) -> None:
    """J^T w with J by differences of the pose of the point; moments by the rotation that a coordinate makes."""
    offset = np.array([0.03, -0.02, 0.05])
    force, moment = np.array([1.3, -0.7, 2.1]), np.array([0.4, 0.2, -0.6])
    wrench = ref.Wrench(section, tuple(force), tuple(moment), fraction, tuple(offset))

    def pose(q: np.ndarray) -> np.ndarray:
        """Of the point, as position and rotation side by side."""
        if arm.sections[section - 1].arcs:
            H = pose_along(arm, transformations(arm, q), section - 1, fraction)[0]
            return np.concatenate([(H[:3, 3] + H[:3, :3] @ offset)[:, None], H[:3, :3]], axis=1)
        # The arm cut off there: shorter lengths of its last section, no rigid piece behind them.
        kept = list(arm.sections[:section])
        if fraction < 1.0:
            kept[-1] = dataclasses.replace(kept[-1], head_offset=0.0)
        lengths = q[: 3 * section].copy()
        lengths[-3:] *= fraction if fraction > 0.0 else 1e-12
        positions, rotations = ref.forward_kinematics(dataclasses.replace(arm, sections=tuple(kept)), lengths)
        return np.concatenate([(positions[-1] + rotations[-1] @ offset)[:, None], rotations[-1]], axis=1)

    R = pose(state.q)[:, 1:]
    expected = []
    for derivative in central_difference(pose, state.q):
        spin = derivative[:, 1:] @ R.T
        turn = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        expected.append(force @ derivative[:, 0] + moment @ turn)
    without = ref.bias_force(arm, state.q, state.qd, state.f_ext)
    found = without - ref.bias_force(arm, state.q, state.qd, state.f_ext, [wrench])
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-7)


def test_a_force_at_the_centre_of_mass_is_the_papers(arm: ref.Arm, state: State) -> None:
    wrenches = [
        ref.Wrench(i + 1, force=tuple(f), offset=s.center_of_mass)
        for i, (f, s) in enumerate(zip(state.f_ext, arm.sections, strict=True))
    ]
    found = ref.forward_dynamics(arm, state.q, state.qd, state.p, None, wrenches)
    expected = ref.forward_dynamics(arm, state.q, state.qd, state.p, state.f_ext)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)


def test_power_balance(held: ref.Arm, state: State) -> None:
    wrench = ref.Wrench(2, (1.0, -2.0, 0.5), (0.3, 0.1, -0.2), 0.6, (0.01, 0.02, 0.03))
    q, qd = state.q, state.qd
    qdd = ref.forward_dynamics(held, q, qd, state.p, None, [wrench])
    change = rate(lambda t: np.array(ref.energy(held, q + qd * t, qd + qdd * t).total))
    power = forces.actuation_bellows_forces(held, state.p).reshape(-1) @ qd
    power -= sum(
        s.damping * float(v @ v) + s.axial_damping * float(v.mean()) ** 2
        for s, v in zip(held.sections, qd.reshape(-1, 3), strict=True)
    )
    still = ref.bias_force(held, q, qd)
    power += float((still - ref.bias_force(held, q, qd, None, [wrench])) @ qd)
    assert change == pytest.approx(power, rel=1e-7)


def test_static_models_with_axial_springs(held: ref.Arm) -> None:
    p = np.full(9, 1.4e5)
    q = ref.static_lengths(held, p)
    np.testing.assert_allclose(ref.static_residual(held, q, p), 0.0, atol=1e-6)
    alone = ref.decoupled_static_lengths(held, p).reshape(3, 3)
    for section, lengths in zip(held.sections, alone, strict=True):
        axial = forces.spring_force(section.axial_stiffness, lengths.mean() - section.axial_rest_length)
        springs = forces.spring_force(section.stiffness, lengths - section.rest_length)
        pressure = section.terminal_area * (1.4e5 - held.ambient_pressure)
        np.testing.assert_allclose(springs + axial / 3, pressure, rtol=1e-7)


def test_files_state_them() -> None:
    text = "\n".join(
        [
            'schema = "bha-arm/1"',
            "gravity = [0.0, 0.0, 9.81]",
            "ambient_pressure = 1e5",
            "[[section]]",
            "mass = 0.5",
            "bellows_radius = 0.1",
            "bellows_outer_radius = 0.03",
            "terminal_area = 0.002",
            "rest_length = 0.15",
            "stiffness = [1000.0]",
            "damping = 10.0",
            "bending_stiffness = [2.0]",
            "length_range = [0.1, 0.3]",
        ]
    )
    plain = ref.parse_arm(text).sections[0]
    assert plain.cross_bending_stiffness == (2.0, 0.0, 0.0)
    assert (plain.axial_stiffness, plain.axial_rest_length, plain.axial_damping) == ((), 0.15, 0.0)
    more = "\ncross_bending_stiffness = [3.0, 0.5, 0.2]\nbending_plane_deg = 30.0\naxial_stiffness = [500.0]\n"
    stated = ref.parse_arm(text + more + "axial_rest_length = 0.2\naxial_damping = 4.0").sections[0]
    assert stated.cross_bending_stiffness == (3.0, 0.5, 0.2)
    assert stated.bending_plane == pytest.approx(math.pi / 6)
    assert (stated.axial_stiffness, stated.axial_rest_length, stated.axial_damping) == ((500.0,), 0.2, 4.0)
    with pytest.raises(ParameterError, match="both of bending_plane"):
        ref.parse_arm(text + more + "bending_plane = 0.5")
    with pytest.raises(InputError, match="sections 1 to 1 exist"):
        ref.bias_force(ref.parse_arm(text), np.full(3, 0.2), np.zeros(3), None, [ref.Wrench(2)])
