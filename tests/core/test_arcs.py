"""Several arcs a section, masses along it, taper and base pose in the core: against slices, itself, complex steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from random_arms import Case, random_cases

import bha
from bha import reference as ref
from bha.parameters import ArmParameters

Array = NDArray[np.float64]
SLICES = 200
ARCS = [
    {"length": 0.3, "bending": 0.6, "relative_radius": 1.1},
    {"length": 0.2, "bending": 0.25},
    {"length": 0.5, "bending": 0.15, "relative_radius": 0.8},
]


def nominal(changes: dict[str, Any] | None = None, **section: Any) -> bha.Arm:
    """The nominal arm with other top-level keys and with keys added to its second section."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping() | (changes or {})
    mapping["section"][1] |= section
    return bha.Arm(ArmParameters.from_mapping(mapping))


def states(count: int, seed: int = 0) -> list[tuple[Array, Array, Array]]:
    rng = np.random.default_rng(seed)
    bent = [(rng.uniform(0.1, 0.3, 9), rng.uniform(-0.5, 0.5, 9), rng.uniform(0.7e5, 2.2e5, 9)) for _ in range(count)]
    return [*bent, (np.full(9, 0.2), *bent[0][1:]), (0.2 + 1e-9 * bent[0][0], *bent[0][1:])]


def rotation_by(x: float, y: float, z: float) -> Array:
    return ref.parameters.rotation_by_vector((x, y, z))


def rigid(turn: Array, way: Array) -> Array:
    H = np.eye(4)
    H[:3, :3], H[:3, 3] = turn, way
    return H


def slices_up_to(share: float, lengths: Array, radius: float) -> Array:
    """Pose of a part of the section of ``ARCS``: small rigid slices that turn half before and half behind."""
    phi, kappa, length = ref.kinematics.specific_mapping(lengths, radius)
    H, start = np.eye(4), 0.0
    for arc in ARCS:
        for k in range(SLICES):
            low, high = start + arc["length"] * k / SLICES, start + arc["length"] * (k + 1) / SLICES
            part = min(max((share - low) / (high - low), 0.0), 1.0)
            angle = part * arc["bending"] / SLICES * kappa * length
            half = rotation_by(-math.sin(phi) * angle / 2, math.cos(phi) * angle / 2, 0.0)
            H = H @ rigid(half @ half, half @ [0.0, 0.0, part * (high - low) * length])
        start += arc["length"]
    return H


def test_section_of_arcs_against_rigid_slices() -> None:
    """Heads, any point, the drawn shape, and Jacobians: all follow the arcs."""
    arm = nominal(arcs=ARCS, base_offset=0.01, head_offset=0.02)
    radius = arm.parameters.sections[1].bellows_radius
    for q, qd, _ in states(4):
        positions, rotations = arm.forward_kinematics(q)
        below = rigid(rotations[0], positions[0]) @ rigid(np.eye(3), np.array([0.0, 0.0, 0.01]))
        for share in (0.0, 0.21, 0.5, 0.93):
            rotation, position = arm.point_pose(q, 2, share)
            expected = below @ slices_up_to(share, q[3:6], radius)
            np.testing.assert_allclose(position, expected[:3, 3], atol=2e-6)
            # (7b) loses digits next to the straight pose.
            np.testing.assert_allclose(rotation, expected[:3, :3], atol=1e-7)
            ahead, behind = (arm.point_pose(q + e * qd, 2, share)[1] for e in (1e-6, -1e-6))
            np.testing.assert_allclose(arm.jacobian(q, 2, share)[:3] @ qd, (ahead - behind) / 2e-6, atol=1e-8)
        head = below @ slices_up_to(1.0, q[3:6], radius) @ rigid(np.eye(3), np.array([0.0, 0.0, 0.02]))
        np.testing.assert_allclose(positions[1], head[:3, 3], atol=2e-6)
        shape = arm.shape(q, 10)
        np.testing.assert_allclose(shape[12 + 1 + 5], arm.point_pose(q, 2, 0.5)[1], atol=1e-12)
        np.testing.assert_allclose(shape[-1], positions[2], atol=1e-12)


def terms(arm: bha.Arm, state: tuple[Array, Array, Array]) -> dict[str, Array]:
    found = arm.dynamics_terms(*state)
    return {
        "M": found.inertia_matrix,
        "C": found.coriolis_matrix @ state[1],
        "N": found.bias_force,
        "tau": found.actuation_force,
        "q''": arm.forward_dynamics(*state),
        "tau needed": arm.inverse_dynamics(state[0], state[1], np.arange(9.0)),
        "heads": arm.forward_kinematics(state[0])[0],
    }


def assert_same(found: bha.Arm, expected: bha.Arm, tolerance: float) -> None:
    for state in states(20):
        a, b = terms(found, state), terms(expected, state)
        for name, wanted in b.items():
            assert np.abs(a[name] - wanted).max() <= tolerance * np.abs(wanted).max(), name


@pytest.mark.parametrize("force_model", ["end_force", "work_conjugate"])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_equal_arcs_are_one_arc(count: int, force_model: str) -> None:
    changes = {"force_model": force_model}
    arcs = [{"length": 1 / count, "bending": 1 / count, "relative_radius": 3.0} for _ in range(count)]
    assert_same(nominal(changes, arcs=arcs), nominal(changes), 1e-13 if count == 1 else 1e-12)


def test_a_mass_at_the_end_is_the_mass_at_the_head() -> None:
    plain = nominal(head_offset=0.02)
    half = plain.parameters.sections[1].mass / 2
    J = [x / 2 for x in plain.parameters.sections[1].resolved_inertia()]
    end = {"share": 1.0, "mass": half, "inertia": J, "offset": [0.0, 0.0, 0.02]}
    assert_same(nominal(head_offset=0.02, mass=half, inertia=J, masses=[end]), plain, 1e-12)


def test_base_turned_with_gravity_moves_alike() -> None:
    """Invariance: base, gravity and forces turned together give the same motion and turned heads."""
    turn, way = rotation_by(0.3, -0.8, 0.5), np.array([0.4, -1.0, 2.0])
    section = {"arcs": ARCS, "masses": [{"share": 0.4, "mass": 0.2}]}
    base = {"position": way.tolist(), "rotation": [0.3, -0.8, 0.5]}
    gravity = np.array([1.0, -2.0, 9.0])
    arm = nominal({"gravity": gravity.tolist()}, **section)
    moved = nominal({"gravity": (turn @ gravity).tolist(), "base": base}, **section)
    f_ext = np.random.default_rng(1).uniform(-2, 2, (3, 3))
    for q, qd, p in states(5):
        expected = arm.forward_dynamics(q, qd, p, f_ext)
        found = moved.forward_dynamics(q, qd, p, f_ext @ turn.T)
        np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
        (r, R), (r_moved, R_moved) = arm.forward_kinematics(q), moved.forward_kinematics(q)
        np.testing.assert_allclose(r_moved, r @ turn.T + way, atol=1e-14)
        np.testing.assert_allclose(R_moved, turn @ R, atol=1e-14)
        np.testing.assert_allclose(moved.shape(q), arm.shape(q) @ turn.T + way, atol=1e-14)
        jacobian = arm.jacobian(q, 3, 0.3)
        np.testing.assert_allclose(moved.jacobian(q, 3, 0.3)[:3], turn @ jacobian[:3], atol=1e-13)
    in_degrees = nominal(
        {"base": {"position": base["position"], "rotation_deg": np.rad2deg(base["rotation"]).tolist()}}
    )
    q = states(1)[0][0]
    np.testing.assert_allclose(in_degrees.forward_kinematics(q)[0], moved_heads(q, turn, way), atol=1e-14)


def moved_heads(q: Array, turn: Array, way: Array) -> Array:
    return nominal(arcs=[]).forward_kinematics(q)[0] @ turn.T + way


def test_tilt_turns_base_and_heads() -> None:
    """``base_tilt`` is a base pose: gravity stays, the heads move against a camera in the world."""
    tilt = [{"kind": "base_tilt", "where": "all", "about_x": 0.2, "about_y": -0.1}]
    tilted = nominal().with_effects(tilt)
    stated = nominal({"base": {"rotation": [-0.2, 0.1, 0.0]}})
    assert_same(tilted, stated, 1e-12)
    q = np.full(9, 0.2)
    assert np.abs(tilted.forward_kinematics(q)[0] - nominal().forward_kinematics(q)[0]).max() > 0.1


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return random_cases(7, 60, states_per_arm=6, varied=True)


def test_derivatives_against_complex_steps(cases: list[Case]) -> None:
    """Duals of the core against the reference in complex numbers, straight poses included."""
    for case in cases:
        state = (case.q, case.qd, case.p)
        found = case.core.forward_dynamics_derivatives(*state, case.f_ext)
        for k, matrix in ((0, found.by_lengths), (1, found.by_velocities)):
            for j in range(len(case.q)):
                moved = [x.astype(complex) for x in state]
                moved[k][j] += 1e-30j
                expected = ref.forward_dynamics(case.reference, *moved, case.f_ext).imag / 1e-30
                assert np.abs(matrix[:, j] - expected).max() < 1e-9 * max(np.abs(matrix).max(), 1.0)


def test_derivatives_by_numbers_of_base_and_masses() -> None:
    masses = [{"share": 0.4, "mass": 0.2, "offset": [0.01, 0.0, 0.0], "inertia": [1e-3, 1e-3, 2e-3]}]
    arm = nominal({"base": {"rotation": [0.1, 0.2, -0.3]}}, masses=masses)
    paths = ("base.rotation.y", "section.2.masses.1.mass", "section.2.masses.1.share")
    for q, qd, p in states(2)[:2]:
        found = arm.forward_dynamics_derivatives(q, qd, p, parameters=paths).by_parameters
        for path, column in zip(paths, found.T, strict=True):
            value, h = bha.parameters.paths.get_value(arm.parameters, path), 1e-5
            ahead, behind = (arm.with_values({path: value + e}).forward_dynamics(q, qd, p) for e in (h, -h))
            np.testing.assert_allclose(column, (ahead - behind) / (2 * h), atol=1e-6 * np.abs(column).max())


@pytest.mark.parametrize("stated", ["arcs", "effects"])
def test_energy_of_a_free_swing_is_kept(stated: str) -> None:
    """Springs and gravity alone, work_conjugate: arcs, areas, masses and the effects that make them lose nothing."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping() | {"force_model": "work_conjugate"}
    for section in mapping["section"]:
        section["damping"] = 0.0
        if stated == "arcs":
            section["arcs"] = [arc | {"relative_area": 1.0 - 0.2 * k} for k, arc in enumerate(ARCS)]
            section["masses"] = [{"share": 0.5, "mass": 0.1, "inertia": [1e-4, 1e-4, 2e-4]}]
    if stated == "effects":
        mapping["effect"] = [
            {"kind": "taper", "where": "all", "change": 0.4},
            {"kind": "distributed_mass", "where": "section 2", "share": 0.6},
        ]
    arm = bha.Arm(ArmParameters.from_mapping(mapping))
    still = bha.Input(np.array([0.0]), np.full((1, 9), arm.parameters.ambient_pressure))
    q0 = arm.static_lengths(np.full(9, arm.parameters.ambient_pressure)) + np.tile([0.02, -0.01, -0.01], 3)
    options = bha.Options(method="dopri5", rtol=1e-10, atol=1e-12)
    run = bha.simulate(arm, still, q0=q0, t_end=1.0, dt=0.05, options=options)
    total = [arm.energy(q, qd).total for q, qd in zip(run.lengths, run.velocities, strict=True)]
    kinetic = max(arm.energy(q, qd).kinetic for q, qd in zip(run.lengths, run.velocities, strict=True))
    assert kinetic > 0.05
    assert np.ptp(total) < 1e-6 * kinetic


def test_pressure_work_of_tapered_bellows_is_pressure_times_volume() -> None:
    """Chambers behind valves and the force on the arm see one volume: what the air gives the arm gets."""
    arcs = [arc | {"relative_area": 1.3 - 0.3 * k} for k, arc in enumerate(ARCS)]
    arm = nominal({"force_model": "work_conjugate"}, arcs=arcs)
    with_lever = arm.actuation_matrix(np.full(9, 0.2))[3:6, 3:6]
    plain = nominal({"force_model": "work_conjugate"}).actuation_matrix(np.full(9, 0.2))[3:6, 3:6]
    # Lengthening all alike: the mean area; bending: the mean of area times radius.
    np.testing.assert_allclose(with_lever.sum(axis=0), plain.sum(axis=0), rtol=1e-12)
    mean = {name: sum(a["bending"] * a.get(name, 1.0) for a in arcs) for name in ("relative_radius", "relative_area")}
    area = sum(a["length"] * a["relative_area"] for a in arcs)
    both = sum(a["bending"] * a.get("relative_radius", 1.0) * a["relative_area"] for a in arcs)
    lever = both / mean["relative_radius"] / area
    bending = np.array([-2.0, 1.0, 1.0])
    np.testing.assert_allclose(bending @ with_lever, lever * bending @ plain, rtol=1e-12)
    assert abs(lever - 1.0) > 0.02
