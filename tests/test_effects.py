"""Effects: their tables in parameter files, what is refused and how, and simulations against SciPy."""

import json
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import bha
from bha.errors import ParameterError
from bha.parameters import EFFECT_KINDS, ArmParameters, EffectParameters

ROOT = Path(__file__).parents[1]
NOMINAL = (ROOT / "python/bha/robots/bha_nominal.toml").read_text()
EFFECTS = """
[[effect]]            # creep of the second section
kind = "creep"
where = "section 2"
stiffness = 120.0
tau = 1.5

[effect.provenance]
tau = { status = "identified", ci95 = [1.3, 1.7] }

[[effect]]
kind = "creep"
where = "section 2"
stiffness = 60.0
tau = 20.0

[[effect]]
kind = "formula"
where = "bellows 13"
force = "-c * tanh(qd / v0)"
c = 0.4
v0 = 0.01

[[effect]]
kind = "payload"
where = "section 3"
mass = -0.05
"""


def read(effects: str) -> ArmParameters:
    return ArmParameters.from_toml(NOMINAL + effects, origin="arm.toml")


def fault(effects: str) -> str:
    with pytest.raises(ParameterError) as caught:
        read(effects)
    return str(caught.value)


def test_written_and_read_again_is_the_same(tmp_path: Path) -> None:
    parameters = read(EFFECTS)
    parameters.write(tmp_path / "arm.toml")
    assert (tmp_path / "arm.toml").read_text() == NOMINAL + EFFECTS
    assert ArmParameters.from_mapping(parameters.to_mapping()) == parameters
    assert ArmParameters.from_toml(ArmParameters.from_mapping(parameters.to_mapping()).to_toml()) == parameters
    arm = bha.Arm(parameters)
    assert pickle.loads(pickle.dumps(arm)) == arm
    assert hash(arm) != hash(arm.with_effects([]))
    assert arm.with_effects([]).parameters == ArmParameters.from_toml(NOMINAL)
    assert arm.with_effects(arm.parameters.effects) == arm


def test_core_json_has_every_number() -> None:
    effects = json.loads(read(EFFECTS).to_core_json())["effect"]
    assert effects[0] == {
        "kind": "creep",
        "where": "section 2",
        "parameters": {"stiffness": 120.0, "tau": 1.5, "strain": 0.0},
        "force": None,
    }
    assert effects[2]["force"] == "-c * tanh(qd / v0)"
    assert effects[3]["parameters"] == {"mass": -0.05, "x": 0.0, "y": 0.0, "z": 0.0}


def test_stated_values_name_their_effect() -> None:
    values = {(v.effect, v.key): v for v in read(EFFECTS).stated_values() if v.effect is not None}
    tau = values[(1, "tau")]
    assert (tau.section, tau.bellows, tau.value, tau.unit) == (2, None, 1.5, "s")
    assert tau.provenance.ci95 == (1.3, 1.7)
    assert (values[(3, "c")].section, values[(3, "c")].bellows) == (1, 3)


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ('kind = "crep"\nwhere = "all"', "effect 1: kind: found \"crep\"; nearest allowed: 'creep'"),
        ('where = "all"', "effect 1: kind: missing"),
        ('kind = 3\nwhere = "all"', "effect 1: kind: found 3"),
        ('kind = "creep"\nstiffness = 1.0\ntau = 1.0', "effect 1: where: missing"),
        (
            'kind = "creep"\nwhere = "input p11"\nstiffness = 1.0\ntau = 1.0',
            'where: found "input p11"; allowed for creep: "all" or',
        ),
        ('kind = "creep"\nwhere = "tip"\nstiffness = 1.0\ntau = 1.0', 'where: found "tip"; allowed for creep'),
        ('kind = "creep"\nwhere = "section 4"\nstiffness = 1.0\ntau = 1.0', "allowed: sections 1 to 3"),
        ('kind = "creep"\nwhere = "bellows 34"\nstiffness = 1.0\ntau = 1.0', "allowed: bellows 1 to 3 of section 3"),
        ('kind = "pressure_gain"\nwhere = "input p14"\ngain = 0.1', 'where: found "input p14"; nearest allowed: \'p'),
        (
            'kind = "creep"\nwhere = "all"\nstifness = 1.0\ntau = 1.0',
            "stifness: unknown key; nearest allowed: 'stiffness'",
        ),
        (
            'kind = "creep"\nwhere = "all"\ntau = 1.0',
            "stiffness: missing; allowed: a number from 0 to 1e+06 (N/m): stiffness k",
        ),
        (
            'kind = "creep"\nwhere = "all"\nstiffness = 1.0\ntau = 0.0',
            "tau: found 0.0; allowed: a number from 0.0001 to 1e+06 (s)",
        ),
        (
            'kind = "creep"\nwhere = "all"\nstiffness = true\ntau = 1.0',
            "stiffness: found true; allowed: a finite number",
        ),
        ('kind = "creep"\nwhere = "all"\nstiffness = inf\ntau = 1.0', "stiffness: found inf; allowed: a finite number"),
        ('kind = "creep"\nwhere = "all"\nstiffness = "1"\ntau = 1.0', 'stiffness: found "1"; allowed: a finite number'),
        ('kind = "creep"\nwhere = "all"\nstiffness = 1.0\ntau = 1.0\nforce = "-q"', 'force: only kind "formula"'),
        ('kind = "formula"\nwhere = "all"', "force: missing"),
        (
            'kind = "formula"\nwhere = "all"\nforce = "-c * qd"',
            'force: found "-c * qd": at character 2: "c" is not known',
        ),
        ('kind = "formula"\nwhere = "all"\nforce = "-qd ** 2"', "write pow(x, 2)"),
        ('kind = "formula"\nwhere = "all"\nforce = "__import__(q)"', "is not a function"),
        (
            'kind = "base_tilt"\nwhere = "all"\nabout_x = 0.1\nabout_y = 0.0\n[effect.provenance]\nabout_z = "assumed"',
            "provenance.about_z: there is no such value in this table; nearest allowed: 'about_",
        ),
    ],
)
def test_faults_are_named(table: str, expected: str) -> None:
    found = fault(f"\n[[effect]]\n{table}\n")
    assert expected in found
    assert re.match(r"arm\.toml, line \d+: ", found), found


def test_the_same_twice_is_refused() -> None:
    creep = '\n[[effect]]\nkind = "creep"\nwhere = "all"\nstiffness = 1.0\ntau = 1.0\n'
    assert 'effect 2: kind: "creep" at "all" is already effect 1' in fault(creep * 2)
    band = '\n[[effect]]\nkind = "valve_dead_band"\nwhere = "all"\nband = {}\n'
    assert "allowed: one" in fault(band.format(1.0) + band.format(2.0))
    assert len(read(band.format(1.0) + band.replace('"all"', '"input p11"').format(2.0)).effects) == 2
    assert "several with different numbers" in fault(creep * 2)
    # Stages in series may be alike.
    lag = '\n[[effect]]\nkind = "pressure_lag"\nwhere = "all"\nfill = {}\nvent = 1.0\n'
    assert len(read(lag.format(1.0) * 2).effects) == 2
    assert len(read(lag.format(1.0) + lag.format(2.0)).effects) == 2


def test_the_core_refuses_what_only_it_can_judge() -> None:
    arm = bha.robots.load("bha_nominal")
    with pytest.raises(ParameterError, match=r"effect 1 \(payload\).*the section's mass is 0.45 kg"):
        arm.with_effects([{"kind": "payload", "where": "section 3", "mass": -0.5}])


def test_the_docs_have_the_form_of_every_kind() -> None:
    text = (ROOT / "docs/reference/effects.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \| [^|]", text, re.MULTILINE) == list(EFFECT_KINDS)


# Numbers that need others to make sense.
SAMPLES: dict[str, dict[str, Any]] = {
    "contact": {"wall_z": 2.0, "normal_z": -1.0},
    "formula": {"force": "-c * qd", "c": 0.1},
}


@pytest.mark.parametrize("kind", list(EFFECT_KINDS))
def test_every_kind_simulates_in_every_place(kind: str) -> None:
    arm = bha.robots.load("bha_nominal")
    drive = bha.Input(np.array([0.0, 0.02, 0.06]), np.array([[1.1e5] * 9, [1.3e5] * 9, [1.2e5] * 9]))
    texts = {"section": "section 2", "bellows": "bellows 22", "input": "input p22"}
    for place in EFFECT_KINDS[kind].places:
        numbers = {p.name: 0.5 * (max(p.low, -0.01) + min(p.high, 0.01)) for p in EFFECT_KINDS[kind].parameters}
        numbers |= {p.name: p.low for p in EFFECT_KINDS[kind].parameters if p.low > 0.01}
        table = {"kind": kind, "where": texts.get(place, place), **numbers} | SAMPLES.get(kind, {})
        with_effect = arm.with_effects([table])
        trajectory = bha.simulate(with_effect, drive, dt=0.01)
        assert len(trajectory) == 7
        assert np.all(np.isfinite(trajectory.lengths))
        sensed = ("length_offset", "length_gain", "wire_backlash", "marker_offset")
        measured = kind in sensed or (kind == "delay" and place not in ("all", "input"))
        assert (trajectory.measured_lengths is not None) == measured
        assert (trajectory[2:5].measured_lengths is not None) == measured
        assert np.all(
            np.isfinite(with_effect.forward_dynamics(trajectory.lengths[3], trajectory.velocities[3], [1.2e5] * 9))
        )


def test_creep_and_lag_against_scipy() -> None:
    """The arm's own forces with the hidden states as further differential equations, integrated by SciPy."""
    arm = bha.robots.load("bha_nominal").with_changes(force_model="work_conjugate")
    low, high = np.full(9, 1.1e5), np.array([1.5e5, 1.1e5, 1.0e5, 1.2e5, 1.4e5, 1.1e5, 1.2e5, 1.2e5, 1.3e5])
    k, tau, fill, vent = 200.0, 0.15, 0.08, 0.2
    with_effects = arm.with_effects(
        [
            {"kind": "creep", "where": "all", "stiffness": k, "tau": tau},
            {"kind": "pressure_lag", "where": "all", "fill": fill, "vent": vent},
        ]
    )

    def slope(_: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        q, qd, z, p = np.split(x, 4)
        # Extra forces of the bellows act on their lengths: M^-1 of them adds to q''.
        qdd = arm.forward_dynamics(q, qd, p) - np.linalg.solve(arm.inertia_matrix(q), k * z)
        return np.concatenate([qd, qdd, qd - z / tau, (high - p) / np.where(high > p, fill, vent)])

    start = np.concatenate([arm.static_lengths(low), np.zeros(18), low])
    times = np.linspace(0.0, 0.6, 25)
    expected = solve_ivp(slope, (0.0, 0.6), start, t_eval=times, rtol=1e-9, atol=1e-11).y.T
    # The pressures jump at 10 ms; until then everything rests at the low ones.
    drive = bha.Input(np.array([0.0, 0.01, 0.01, 0.7]), np.vstack([low, low, high, high]))
    for options in (bha.Options(method="rk4", step=1e-3), bha.Options()):
        found = bha.Simulation(with_effects, drive, options).advance(0.01 + times)
        np.testing.assert_allclose(found.lengths, expected[:, :9], atol=2e-6)


def test_effects_on_one_state() -> None:
    arm = bha.robots.load("bha_nominal")
    q, p = np.linspace(0.15, 0.2, 9), np.linspace(1.1e5, 1.4e5, 9)
    still = np.zeros(9)
    shifted = arm.with_effects([{"kind": "pressure_offset", "where": "input p21", "offset": 500.0}])
    p_shifted = p + 500.0 * (np.arange(9) == 3)
    np.testing.assert_allclose(shifted.forward_dynamics(q, still, p), arm.forward_dynamics(q, still, p_shifted))
    np.testing.assert_allclose(shifted.static_lengths(p), arm.static_lengths(p_shifted), atol=1e-10)
    gained = arm.with_effects([{"kind": "pressure_gain", "where": "all", "gain": 0.02}])
    np.testing.assert_allclose(gained.actuation_matrix(q), 1.02 * arm.actuation_matrix(q), rtol=1e-9)
    damped = arm.with_effects([{"kind": "bending_damping", "where": "all", "damping": 0.1}])
    qd = np.linspace(-0.1, 0.2, 9)
    parts = damped.bias_force_parts(q, qd)
    np.testing.assert_allclose(sum(parts.values()), damped.bias_force(q, qd), atol=1e-12)
    assert np.dot(parts["effects"], qd) > 0


def test_numbers_of_the_model_are_those_of_the_table() -> None:
    effect = EffectParameters.model_validate({"kind": "friction", "where": "all", "coulomb_force": 1.0})
    assert effect.parameters == {
        "coulomb_force": 1.0,
        "presliding": 2e-4,
        "static_ratio": 1.0,
        "stribeck_velocity": 0.01,
    }
    assert effect.stated_numbers == {"coulomb_force": 1.0}
