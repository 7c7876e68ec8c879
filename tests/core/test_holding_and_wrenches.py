"""Bending planes, axial springs and wrenches: core against reference at random states, and by virtual work."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from random_arms import Array, fifth_degree, random_arm_text

import bha
from bha import reference as ref
from bha.errors import InputError
from bha.parameters import ArmParameters

TOLERANCE = 1e-10


def distance(found: Array, expected: Array) -> float:
    """Largest difference relative to the largest expected value."""
    return float(np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-12))


def held(text: str, rng: np.random.Generator) -> str:
    """The text of an arm with bending planes, axial springs or both in its sections."""

    def lines(_: re.Match[str]) -> str:
        planes = [
            f"cross_bending_stiffness = {fifth_degree(rng.uniform([1, 0], [6, 0.5]))}",
            f"bending_plane = {rng.uniform(-3, 3)}"
            if rng.random() < 0.5
            else f"bending_plane_deg = {rng.uniform(0, 180)}",
        ]
        axial = [
            f"axial_stiffness = {[float(x) for x in rng.uniform([200, -500, 0], [3000, 500, 9000])]}",
            f"axial_damping = {rng.uniform(0, 20)}",
        ]
        if rng.random() < 0.5:
            axial.append(f"axial_rest_length = {rng.uniform(0.1, 0.25)}")
        kind = rng.integers(3)
        return "\n".join((planes if kind != 0 else []) + (axial if kind != 1 else []) + ["length_range"])

    return re.sub("length_range", lines, text)


def wrenches_of(rng: np.random.Generator, sections: int) -> list[bha.Wrench]:
    return [
        bha.Wrench(
            int(rng.integers(1, sections + 1)),
            force=rng.uniform(-3, 3, 3),
            moment=rng.uniform(-0.5, 0.5, 3),
            fraction=float(rng.choice([0.0, rng.random(), 1.0])),
            offset=rng.uniform(-0.1, 0.1, 3),
        )
        for _ in range(2)
    ]


def as_reference(wrenches: list[bha.Wrench]) -> list[ref.Wrench]:
    return [ref.Wrench(w.section, tuple(w.force), tuple(w.moment), w.fraction, tuple(w.offset)) for w in wrenches]


def pairs(
    seed: int, count: int, per_arm: int = 25, *, varied: bool = True
) -> list[tuple[bha.Arm, ref.Arm, np.random.Generator]]:
    """Arms in both implementations, each so many times; with ``varied`` every third of arcs and anywhere."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(count // per_arm):
        force_model = ("end_force", "work_conjugate")[k % 2]
        text = held(random_arm_text(rng, 1 + k % 5, force_model, varied=varied and k % 3 == 2), rng)
        core = bha.Arm.from_parameters(ArmParameters.from_toml(text))
        made += [(core, ref.parse_arm(text, "random"), rng)] * per_arm
    return made


def state_of(arm: bha.Arm, rng: np.random.Generator, k: int) -> tuple[Array, Array, Array]:
    """Lengths, rates and pressures; every fifth state straight or nearly so."""
    n = 3 * arm.section_count
    q = rng.uniform(0.1, 0.3, n)
    if k % 5 == 0:
        q = np.repeat(q[::3], 3) + rng.choice([0.0, 1e-12, 1e-9, 1e-6, 1e-4]) * rng.normal(size=n)
    return q, rng.uniform(-0.5, 0.5, n), rng.uniform(0.7e5, 2.2e5, n)


def test_terms_and_dynamics() -> None:
    for k, (arm, reference, rng) in enumerate(pairs(20261129, 1000)):
        q, qd, p = state_of(arm, rng, k)
        f_ext, wrenches = rng.uniform(-3, 3, (arm.section_count, 3)), wrenches_of(rng, arm.section_count)
        outside = (f_ext, wrenches)
        expected_outside = (f_ext, as_reference(wrenches))
        core = arm.dynamics_terms(q, qd, p, *outside)
        expected = ref.dynamics_terms(reference, q, qd, p, *expected_outside)
        qdd = ref.forward_dynamics(reference, q, qd, p, *expected_outside)
        energy, expected_energy = arm.energy(q, qd), ref.energy(reference, q, qd)
        compared = {
            "M": (core.inertia_matrix, expected.inertia_matrix),
            "N": (core.bias_force, expected.bias_force),
            "N by itself": (arm.bias_force(q, qd, *outside), expected.bias_force),
            "tau": (core.actuation_force, expected.actuation_force),
            "q''": (arm.forward_dynamics(q, qd, p, *outside), qdd),
            "tau needed": (
                arm.inverse_dynamics(q, qd, qdd, *outside),
                ref.inverse_dynamics(reference, q, qd, qdd, *expected_outside),
            ),
            "potential energy": (np.array(energy.potential), np.array(expected_energy.potential)),
            "axial energy": (np.array(energy.axial), np.array(expected_energy.potential_axial)),
            "energy of bending": (np.array(energy.bending), np.array(expected_energy.potential_bending)),
        }
        for name, (found, wanted) in compared.items():
            assert distance(found, wanted) < TOLERANCE, name


def test_parts_add_up() -> None:
    for k, (arm, _, rng) in enumerate(pairs(3, 50)):
        q, qd, _ = state_of(arm, rng, k)
        wrenches = wrenches_of(rng, arm.section_count)
        parts = arm.bias_force_parts(q, qd, wrenches=wrenches)
        total = sum(parts.values(), np.zeros(len(q)))
        assert distance(total, arm.bias_force(q, qd, wrenches=wrenches)) < 1e-12
        assert parts["axial"].any() == any(s.axial_stiffness is not None for s in arm.parameters.sections)


def test_statics() -> None:
    for arm, reference, rng in pairs(5, 75, varied=False)[::5]:
        p = 1.05e5 + 0.1 * (rng.uniform(0.7e5, 2.2e5, len(arm.inputs)) - 1.05e5)
        wrenches = [bha.Wrench(arm.section_count, (0.5, -0.3, 0.8), (0.05, 0.02, -0.04), 0.5, (0.02, 0.0, 0.0))]
        q = arm.static_lengths(p, wrenches=wrenches)
        assert np.abs(ref.static_residual(reference, q, p, None, as_reference(wrenches))).max() < 1e-7
        alone = arm.static_lengths(p, coupled=False)
        np.testing.assert_allclose(alone, ref.decoupled_static_lengths(reference, p), rtol=0, atol=1e-9)


def test_derivatives_against_complex_steps() -> None:
    """Through the straight pose, of what depends on the state: complex steps of the reference lose no digits."""
    for k, (arm, reference, rng) in enumerate(pairs(7, 100)[::5]):
        q, qd, p = state_of(arm, rng, 5 * (k % 2))
        wrenches = wrenches_of(rng, arm.section_count)
        found = arm.forward_dynamics_derivatives(q, qd, p, wrenches=wrenches)
        for of, columns in ((0, found.by_lengths), (1, found.by_velocities)):
            for j in range(len(q)):
                step = 1e-30j * np.eye(len(q))[j]
                at = (q + step, qd, p) if of == 0 else (q, qd + step, p)
                qdd = ref.forward_dynamics(reference, *at, None, as_reference(wrenches))
                assert distance(columns[:, j], qdd.imag / 1e-30) < 1e-8, (k, of, j)


@pytest.mark.parametrize("fraction", [0.0, 0.4, 1.0])
def test_wrench_is_the_jacobian_transposed(fraction: float) -> None:
    arm = bha.robots.load("bha_nominal")
    rng = np.random.default_rng(11)
    q, qd = rng.uniform(0.12, 0.28, 9), rng.uniform(-0.3, 0.3, 9)
    for section in (1, 2, 3):
        force, moment, offset = rng.normal(size=3), rng.normal(size=3), 0.05 * rng.normal(size=3)
        wrench = bha.Wrench(section, force, moment, fraction, offset)
        generalized = arm.bias_force(q, qd) - arm.bias_force(q, qd, wrenches=[wrench])

        def pose(x: Array, section: int = section, offset: Array = offset) -> tuple[Array, Array]:
            return arm.point_pose(x, section, fraction, offset)

        expected, h = np.empty(9), 1e-6
        for j, unit in enumerate(np.eye(9)):
            (ahead, there), (behind, here) = pose(q + h * unit), pose(q - h * unit)
            spin = (ahead - behind) / (2 * h) @ pose(q)[0].T
            turn = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            expected[j] = force @ (there - here) / (2 * h) + moment @ turn
        np.testing.assert_allclose(generalized, expected, rtol=0, atol=1e-7)
        np.testing.assert_allclose(
            generalized, arm.jacobian(q, section, fraction, offset).T @ np.concatenate([force, moment]), atol=1e-12
        )


def test_simulation_under_wrenches() -> None:
    """Sampled and constant, alone and abreast; a force at the force point is f_ext by another name."""
    arm = bha.robots.load("bha_nominal")
    time = np.linspace(0.0, 0.5, 51)
    p = np.full((51, 9), 1.2e5)
    push = 2.0 * np.sin(8.0 * time)[:, None] * np.array([1.0, 0.3, 0.0])
    forces = np.zeros((51, 3, 3))
    forces[:, 2] = push
    center = arm.parameters.sections[2].center_of_mass
    named = bha.Input(time, p, forces)
    anywhere = bha.Input(time, p, wrenches=(bha.Wrench(3, push, offset=center),))
    times = np.linspace(0.0, 0.5, 11)
    expected = bha.simulate(arm, named, times=times)
    found = bha.simulate(arm, anywhere, times=times)
    assert np.abs(expected.lengths - expected.lengths[0]).max() > 1e-3
    np.testing.assert_allclose(found.lengths, expected.lengths, rtol=0, atol=1e-11)
    both = bha.Input(time, p, forces, wrenches=(bha.Wrench(2, moment=(0.0, 0.2, 0.0), fraction=0.5),))
    twisted = bha.simulate(arm, both, times=times)
    assert np.abs(twisted.lengths - expected.lengths).max() > 3e-4
    at_rest = arm.static_lengths(p[0], forces[0], wrenches=both.wrenches)
    np.testing.assert_allclose(twisted.lengths[0], at_rest, atol=1e-10)
    other = bha.Input(time, p, 0.5 * forces, wrenches=(bha.Wrench(2, moment=(0.0, -0.2, 0.0), fraction=0.5),))
    batch = bha.simulate_batch(arm, [both, other, both], times=times, method="rk4")
    for k, drive in enumerate((both, other, both)):
        alone = bha.simulate(arm, drive, times=times, method="rk4")
        np.testing.assert_allclose(batch.lengths[k], alone.lengths, rtol=0, atol=1e-11)
    mixed = bha.simulate_batch(arm, [named, anywhere, both], times=times, method="rk4")
    np.testing.assert_allclose(mixed.lengths[1], mixed.lengths[0], rtol=0, atol=1e-11)


def test_sensitivities_under_a_wrench() -> None:
    arm = bha.robots.load("bha_nominal")
    drive = bha.Input.constant(np.full(9, 1.2e5), 0.2)
    drive = bha.Input(drive.time, drive.pressures, wrenches=(bha.Wrench(3, (1.0, 0.0, 0.0), fraction=0.7),))
    start = np.concatenate([arm.static_lengths(np.full(9, 1.2e5)), np.zeros(9)])
    names = ("section.3.axial_stiffness.1", "section.2.cross_bending_stiffness.1")
    found = bha.sensitivities(arm, drive, start, times=[0.2], parameters=names, options=bha.Options("rk4"))
    values = [0.0, arm.parameters.sections[1].bending_stiffness[0]]
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        ends = [
            bha.simulate(
                arm.with_values({name: value + h}), drive, times=[0.2], q0=start[:9], qd0=start[9:], method="rk4"
            ).lengths[0]
            for h in (1e-2, -1e-2)
        ]
        np.testing.assert_allclose(
            found.by_parameters[0, :9, k], (ends[0] - ends[1]) / 2e-2, rtol=1e-5, atol=1e-12, err_msg=name
        )


def test_wrong_wrenches_are_named() -> None:
    arm = bha.robots.load("bha_nominal")
    q, qd, p = np.full(9, 0.2), np.zeros(9), np.full(9, 1.2e5)
    with pytest.raises(InputError, match=r"wrenches\[0\].section: 4; whole numbers from 1 to 3"):
        arm.forward_dynamics(q, qd, p, wrenches=[bha.Wrench(4)])
    with pytest.raises(InputError, match=r"wrenches\[0\].force"):
        arm.forward_dynamics(q, qd, p, wrenches=[bha.Wrench(1, np.zeros((5, 3)))])
    with pytest.raises(InputError, match=r"wrenches\[1\]: tuple; a bha.Wrench is needed"):
        arm.bias_force(q, qd, wrenches=[bha.Wrench(1), (1, 2)])  # type: ignore[list-item]
    with pytest.raises(InputError, match=r"wrenches: float; a list of bha\.Wrench"):
        arm.bias_force(q, qd, wrenches=1.5)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"fraction: 1.5; a number from 0"):
        bha.Wrench(1, fraction=1.5)
    with pytest.raises(InputError, match="wrench: force"):
        bha.Wrench(1, force=(math.nan, 0.0, 0.0))
    drive = bha.Input(np.array([0.0, 1.0]), np.full((2, 9), 1.2e5), wrenches=(bha.Wrench(1, np.zeros((3, 3))),))
    with pytest.raises(InputError, match=r"wrenches\[0\].force: 3 rows; one, or one for each of 2 samples"):
        bha.simulate(arm, drive)
    with pytest.raises(InputError, match=r"inputs\[0\].wrenches\[0\].section"):
        bha.simulate_batch(arm, bha.Input(np.array([0.0, 1.0]), np.full((2, 9), 1.2e5), wrenches=(bha.Wrench(9),)))
