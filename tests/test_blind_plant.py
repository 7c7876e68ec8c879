"""The blind generator's plant against the oracle, and against laws that need no oracle."""

import json
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha.parameters import ArmParameters

pytest.importorskip("numba")
ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "benches" / "blind"))

from blindgen.armfile import build_plant, format_arm, parse_arm, perturb_arm  # noqa: E402
from blindgen.cases import default_arm  # noqa: E402
from blindgen.hidden import (  # noqa: E402
    B_CREEP,
    B_SLIP,
    MEMORY,
    S_COLUMNS,
    S_PAYLOAD,
    S_SPLIT,
    S_TORSION,
    SLIP_SHARE,
    SLIP_YIELD,
    Hidden,
    advance_memory,
    bellows_resistance,
    no_hidden,
)
from blindgen.integrate import DivergedError, State, run  # noqa: E402
from blindgen.motion import evaluate  # noqa: E402
from blindgen.plant import (  # noqa: E402
    P_DAMPING,
    P_MASS,
    Plant,
    arc_coordinates,
    bellows_lengths,
    make_work,
    solve_acceleration,
)

ORACLE = ROOT.parent / "shared" / "oracle" / "cases.json"


class Model:
    """Dynamics terms of the generator in bellows coordinates."""

    def __init__(self, plant: Plant, hidden: Hidden) -> None:
        self.plant, self.hidden = plant, hidden
        n = plant.sections.shape[0]
        self.work = make_work(n)
        self.to_arc = np.stack([self.arc(row) for row in np.eye(3 * n)], axis=1)

    def arc(self, lengths: np.ndarray) -> np.ndarray:
        out = np.zeros_like(lengths)
        arc_coordinates(self.plant.radius, lengths, out)
        return out

    def evaluate(self, q: Any, qd: Any, p: Any, f_ext: Any) -> None:
        q, qd, p, f_ext = (np.asarray(x, dtype=np.float64) for x in (q, qd, p, f_ext))
        d = q.shape[0]
        evaluate(
            self.plant,
            self.hidden,
            self.work,
            self.arc(q),
            self.arc(qd),
            p,
            np.zeros(3),
            f_ext,
            0.0,
            q,
            qd,
            np.zeros(d),
            0.0,
            np.zeros((d, MEMORY)),
        )


def relative(value: np.ndarray, wanted: Any) -> float:
    wanted = np.asarray(wanted)
    return float(np.abs(value - wanted).max() / np.abs(wanted).max())


@pytest.mark.skipif(not ORACLE.exists(), reason="oracle values are not here")
def test_terms_equal_the_oracle() -> None:
    data = json.loads(ORACLE.read_text(encoding="utf-8"))
    models: dict[tuple[str, str], Model] = {}
    for case in data["cases"]:
        for force_model in ("end_force", "work_conjugate"):
            key = (case["arm"], force_model)
            if key not in models:
                arm = replace(parse_arm(data["arms"][case["arm"]]), force_model=force_model)
                plant = build_plant(arm)
                models[key] = Model(plant, no_hidden(len(arm.sections), np.array(arm.gravity)))
            model = models[key]
            work, back = model.work, model.to_arc
            d = len(case["q"])
            model.evaluate(case["q"], case["qd"], np.full(d, model.plant.ambient_pressure), case["f_ext"])
            passive = -back.T @ work.force
            model.evaluate(case["q"], case["qd"], case["p"], case["f_ext"])
            assert relative(back.T @ work.matrix @ back, case["M"]) < 1e-9
            assert np.abs(back.T @ work.bias - case["C_qd"]).max() < 1e-9 * max(1.0, np.abs(case["C_qd"]).max())
            assert relative(passive, case["N"][force_model]) < 1e-9
            assert relative(back.T @ work.force + passive, case["tau"][force_model]) < 1e-9
            acceleration = np.zeros(d)
            solve_acceleration(work, 0.0, np.zeros(d), acceleration)
            assert relative(np.linalg.solve(back, acceleration), case["qdd"][force_model]) < 1e-9
            assert relative(work.head[:, :3], case["head_positions"]) < 1e-9
            assert relative(work.head[:, 6:].reshape(-1, 3, 3), case["head_rotations"]) < 1e-9


def undamped(**changes: float) -> tuple[Plant, Hidden]:
    arm = replace(default_arm(), force_model="work_conjugate")
    plant = build_plant(arm, distributed=changes.get("distributed", 0.0))
    plant.sections[:, P_DAMPING] = 0.0
    hidden = no_hidden(3, np.array(arm.gravity))
    hidden.sections[:, S_SPLIT] = changes.get("split", 0.5)
    hidden.sections[2, S_PAYLOAD : S_PAYLOAD + 4] = (changes.get("payload", 0.0), 0.01, 0.02, 0.05)
    return plant, hidden


def potential(plant: Plant, hidden: Hidden, start: np.ndarray, end: np.ndarray) -> float:
    """Work of the generalized forces from one pose to another at rest, by Gauss-Legendre along the straight path."""
    model = Model(plant, hidden)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for x, w in zip(nodes, weights, strict=True):
        q = start + 0.5 * (x + 1.0) * (end - start)
        model.evaluate(q, np.zeros(9), np.full(9, plant.ambient_pressure), np.zeros((3, 3)))
        total += 0.5 * w * float((model.to_arc.T @ model.work.force) @ (end - start))
    return total


@pytest.mark.parametrize("changes", [{}, {"distributed": 0.3}, {"payload": 0.2}, {"split": 0.7}])
def test_energy_is_kept_by_work_conjugate_forces_without_damping(changes: dict[str, float]) -> None:
    plant, hidden = undamped(**changes)
    start = np.array([0.20, 0.16, 0.15, 0.15, 0.19, 0.17, 0.16, 0.17, 0.20])
    state = State.at_rest(plant, start)
    pressure = np.full((2 * 2000 + 1, 9), plant.ambient_pressure)
    lengths, _, rates = run(plant, hidden, state, pressure, step=5e-4, stride=100)
    model = Model(plant, hidden)
    kinetic = []
    for q, qd in zip(lengths, rates, strict=True):
        model.evaluate(q, qd, pressure[0], np.zeros((3, 3)))
        s = model.arc(qd)
        kinetic.append(0.5 * float(s @ model.work.matrix @ s))
    gained = [potential(plant, hidden, start, q) for q in lengths[[5, 12, 20]]]
    assert max(kinetic) > 0.05
    np.testing.assert_allclose([kinetic[k] for k in (5, 12, 20)], gained, atol=2e-5 * max(kinetic))


def test_velocity_products_are_those_of_the_changing_inertia_matrix() -> None:
    # x' = d/dt(M s') - dT/ds with M by itself differentiated numerically: independent of the closed-form accelerations.
    plant, hidden = undamped(distributed=0.4, payload=0.1, split=0.65)
    hidden.sections[1, S_TORSION] = 1.3
    model = Model(plant, hidden)
    rng = np.random.default_rng(3)
    q, qd = rng.uniform(0.12, 0.25, 9), rng.uniform(-0.4, 0.4, 9)
    still = np.full(9, plant.ambient_pressure), np.zeros((3, 3))

    def matrix(lengths: np.ndarray) -> np.ndarray:
        model.evaluate(lengths, np.zeros(9), *still)
        return model.to_arc.T @ model.work.matrix @ model.to_arc

    h = 1e-6
    slope = [(matrix(q + h * e) - matrix(q - h * e)) / (2 * h) for e in np.eye(9)]
    wanted = np.einsum("kij,k,j->i", slope, qd, qd) - 0.5 * np.einsum("kij,i,j->k", slope, qd, qd)
    model.evaluate(q, qd, *still)
    np.testing.assert_allclose(model.to_arc.T @ model.work.bias, wanted, atol=1e-7 * np.abs(wanted).max())


def test_slices_keep_the_mass_and_even_split_is_the_plain_arc() -> None:
    plant, hidden = undamped(distributed=0.5)
    lumped, _ = undamped()
    weight = np.full(9, 0.2), np.zeros(9), np.full(9, plant.ambient_pressure), np.zeros((3, 3))
    heavy, light = Model(plant, hidden), Model(lumped, hidden)
    heavy.evaluate(*weight)
    light.evaluate(*weight)
    # All sections grow together: translation of section 1's own slices aside, the same weight does the same work.
    mass = plant.sections[:, P_MASS].sum()
    assert light.work.force[2] - heavy.work.force[2] == pytest.approx(9.81 * 0.5 * 0.5 * plant.sections[0, P_MASS])
    assert mass == lumped.sections[:, P_MASS].sum()
    hidden.sections[:, S_SPLIT] = np.nextafter(0.5, 1.0)
    bent = np.array([0.20, 0.16, 0.15, 0.15, 0.19, 0.17, 0.16, 0.17, 0.20]), np.linspace(-0.2, 0.3, 9), *weight[2:]
    split = Model(lumped, hidden)
    split.evaluate(*bent)
    light = Model(lumped, no_hidden(3, hidden.whole[:3]))
    light.evaluate(*bent)
    np.testing.assert_allclose(split.work.matrix, light.work.matrix, atol=1e-12)
    np.testing.assert_allclose(split.work.bias, light.work.bias, atol=1e-12)


def test_lengths_and_arc_coordinates_are_inverse() -> None:
    rng = np.random.default_rng(0)
    radius, q = rng.uniform(0.05, 0.1, 3), rng.uniform(0.1, 0.3, 9)
    s, back = np.zeros(9), np.zeros(9)
    arc_coordinates(radius, q, s)
    bellows_lengths(radius, s, back)
    np.testing.assert_allclose(back, q, atol=1e-15)


def test_maxwell_slip_is_rate_independent_and_saturates() -> None:
    hidden = no_hidden(1, np.zeros(3))
    hidden.bellows[0, B_SLIP : B_SLIP + 2] = (5.0, 4e-3)
    forces = []
    for count in (200, 2000):
        memory = np.zeros((3, MEMORY))
        path = np.diff(np.concatenate([np.linspace(0, 0.03, count), np.linspace(0.03, 0.01, count)]))
        for dx in path:
            advance_memory(hidden.bellows, np.zeros(3), np.array([dx, 0.0, 0.0]), 1e-3, memory)
        forces.append(bellows_resistance(hidden.bellows, 0, 0.0, 0.0, 0.0, memory))
    assert forces[0] == pytest.approx(forces[1])
    limits = SLIP_YIELD * 4e-3
    assert forces[0] == pytest.approx(
        float(np.sum(5.0 * SLIP_SHARE * np.clip(limits - 0.02, -limits, limits) / limits))
    )


def test_creep_branch_relaxes_with_its_time_constant() -> None:
    hidden = no_hidden(1, np.zeros(3))
    hidden.bellows[0, B_CREEP : B_CREEP + 4] = (100.0, 0.5, 0.0, 1.0)
    memory = np.zeros((3, MEMORY))
    advance_memory(hidden.bellows, np.zeros(3), np.array([0.01, 0.0, 0.0]), 1e-6, memory)
    for _ in range(1000):
        advance_memory(hidden.bellows, np.zeros(3), np.zeros(3), 1e-3, memory)
    assert memory[0, 0] == pytest.approx(1.0 * np.exp(-2.0), rel=1e-5)


def test_a_run_out_of_range_says_when() -> None:
    plant, hidden = undamped()
    state = State.at_rest(plant, np.full(9, 0.17))
    with pytest.raises(DivergedError, match=r"left 0\.02 to 0\.5 m at 0\.\d+ s"):
        run(plant, hidden, state, np.full((4001, 9), 9e5), stride=20)


def test_parameter_file_survives_writing_and_perturbation_keeps_its_promise() -> None:
    arm = default_arm()
    assert parse_arm(format_arm(arm)) == arm
    changed = perturb_arm(arm, np.random.default_rng(5))
    for old, new in zip(arm.sections, changed.sections, strict=True):
        for key in ("mass", "damping", "rest_length"):
            ratio = getattr(new, key) / getattr(old, key)
            assert 1.10 <= max(ratio, 1 / ratio) <= 1.15
        assert new.terminal_area == old.terminal_area
        assert new.inertia[0] / old.inertia[0] == pytest.approx(new.mass / old.mass)
    assert no_hidden(3, np.zeros(3)).sections.shape == (3, S_COLUMNS)


@pytest.mark.parametrize("force_model", ["end_force", "work_conjugate"])
def test_split_and_slices_are_arcs_and_masses_of_the_core(force_model: str) -> None:
    """Two simulators, one arm: halves that bend unevenly, and a share of the mass on slices along both."""
    split, distributed = 0.65, 0.4
    arm = replace(default_arm(), force_model=force_model)
    plant = build_plant(arm, distributed=distributed)
    hidden = no_hidden(3, np.array(arm.gravity))
    hidden.sections[:, S_SPLIT] = split
    mapping = tomllib.loads(format_arm(arm))
    for section in mapping["section"]:
        mass = section["mass"]
        section["arcs"] = [{"length": 0.5, "bending": split}, {"length": 0.5, "bending": 1.0 - split}]
        section["masses"] = [
            {"share": 0.5 * (half + place), "mass": distributed * mass * share * 0.5}
            for half in (0, 1)
            for place, share in plant.slices
        ]
        section["mass"] = (1.0 - distributed) * mass
    core = bha.Arm(ArmParameters.from_mapping(mapping))
    model = Model(plant, hidden)
    rng = np.random.default_rng(5)
    for _ in range(10):
        q, qd = rng.uniform(0.1, 0.3, 9), rng.uniform(-0.4, 0.4, 9)
        p = rng.uniform(0.7e5, 2.2e5, 9)
        model.evaluate(q, qd, p, np.zeros((3, 3)))
        terms = core.dynamics_terms(q, qd, p)
        back = model.to_arc.T
        assert relative(back @ model.work.matrix @ model.to_arc, terms.inertia_matrix) < 1e-11
        assert relative(back @ model.work.bias, terms.coriolis_matrix @ qd) < 1e-10
        assert relative(back @ model.work.force, terms.actuation_force - terms.bias_force) < 1e-10
        assert relative(model.work.head[:, :3], core.forward_kinematics(q)[0]) < 1e-12
