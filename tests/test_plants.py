"""Plants of others: what their scripts share, the made-up arm against its closed form, and the judge."""

import json
import math
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import bha

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from benches.plants import common, judge, mujoco_arm  # noqa: E402
from benches.plants.chain import GRAVITY, Chain  # noqa: E402

TRUE = common.Guess(
    0.5, 0.3, 0.028, 0.018, 2e-5, 50.0, 3.0, 0.05, tuple(0.5 * np.pi * k + 0.3 for k in range(4)), (0.0, 0.0, 9.81), 5e4
)


def load(text: str) -> bha.Arm:
    return bha.Arm(bha.parameters.ArmParameters.from_toml(text))


def test_tape_measure_files() -> None:
    masses, springs = [], []
    for seed in range(60):
        guess = common.guessed(np.random.default_rng(seed), TRUE)
        section = load(common.arm_file(guess, common.Setup(), "a")).parameters.sections[0]
        masses.append(section.mass / TRUE.mass)
        springs.append(section.stiffness[0] / TRUE.stiffness)
    assert 0.04 < np.abs(np.array(masses) - 1.0).max() <= 0.0501
    assert 2.0 < max(springs) <= 3.01
    assert 0.33 < min(springs) < 0.5
    right, wrong = (
        [x["angle_deg"] for x in tomllib.loads(common.arm_file(TRUE, setup, "a"))["section"][0]["bellows"]]
        for setup in (common.Setup(), common.Setup(azimuth_off=90.0, swapped=True))
    )
    assert np.deg2rad(right) == pytest.approx(np.array(TRUE.angles), abs=1e-3)
    turned = [(x + 90.0) % 360.0 for x in right]
    assert wrong == pytest.approx([turned[1], turned[0], *turned[2:]], abs=0.1)


def test_logs_are_what_the_camera_sees(tmp_path: Path) -> None:
    setup = common.Setup(camera=True, noise=0.0, pressure_noise=0.0)
    place, turn = common.camera_of(np.random.default_rng(1), setup)
    assert 8e-3 <= np.linalg.norm(place) <= 25e-3
    tip = np.array([[0.01, 0.02, 0.3], [0.0, -0.01, 0.31]])
    common.write_log(tmp_path / "log.csv", np.random.default_rng(2), setup, np.full((2, 4), 2e4), tip, (place, turn))
    log = bha.Log.read(tmp_path / "log.csv", ambient_pressure=common.AMBIENT)
    seen = np.stack([log["x1"], log["y1"], log["z1"]], axis=1)
    assert seen @ common.rotation(turn).T + place == pytest.approx(tip, abs=2e-6)
    assert log["p11"] == pytest.approx(common.AMBIENT + 2e4)
    still = common.camera_of(np.random.default_rng(1), common.Setup())
    assert not np.any(still)


def test_programmes_hold_and_stay_in_range() -> None:
    times = np.arange(6001) / common.RATE
    for number in range(len(common.NAMES)):
        share = common.programme(np.random.default_rng(number), number, times, 3)
        assert share.shape == (6001, 3)
        assert 0.0 <= share.min() < 0.2
        assert 0.8 < share.max() <= 1.0
    steps = common.held_steps(np.random.default_rng(0), times, 3)
    changes = times[1:][np.any(np.diff(steps, axis=0) != 0.0, axis=1)]
    assert np.diff(changes).min() > 1.4


def test_backbone_adds_to_stretch_alone() -> None:
    """Without gravity one arc decouples: l = L + A p / (3 k + backbone), psi = A r p / (1.5 k r^2 + k_bend)."""
    pytest.importorskip("numba")
    from benches.plants import stiff_arm  # noqa: PLC0415

    numbers = stiff_arm.draw_arm(np.random.default_rng(0))
    truth = stiff_arm.build(numbers)
    from blindgen.wide.integrate import Simulator  # noqa: PLC0415

    truth.arm.hidden.whole[:3] = 0.0
    gauge = 1e5
    state = Simulator(truth.arm).rest(common.AMBIENT + gauge * np.array([1.0, 0.0, 0.0]))
    k, r, push = numbers["stiffness"], numbers["radius"], numbers["area"] * gauge
    assert state.coordinates[2] - numbers["length"] == pytest.approx(push / (3.0 * k + numbers["backbone"]), rel=1e-6)
    bend = push * r / (1.5 * k * r**2 + numbers["bending"])
    assert np.hypot(*state.coordinates[:2]) == pytest.approx(bend, rel=1e-6)
    # A chamber pushes the tip away from itself.
    assert np.arctan2(*state.coordinates[1::-1]) % (2 * np.pi) == pytest.approx(
        (numbers["azimuth"] + np.pi) % (2 * np.pi)
    )


def test_truth_of_the_mujoco_arm_in_our_terms() -> None:
    """Levels in series against one arc, with the package's own static formulas; needs the package."""
    pytest.importorskip("soft_robotic_arm")
    cfg = mujoco_arm.draw_config(np.random.default_rng(3))
    arm, numbers = mujoco_arm.truth_of(cfg, 0.4)
    psi = mujoco_arm.PSI
    stretch = cfg.n_pouches * cfg.extension_gain * 4.0 / cfg.axial_stiffness
    assert 4.0 * arm.area * psi / (4.0 * arm.stiffness) == pytest.approx(stretch)
    bend = arm.area * psi * arm.radius / (2.0 * arm.stiffness * arm.radius**2 + arm.bending)
    assert bend == pytest.approx(6.0 * cfg.pressure_gain * cfg.moment_arm / cfg.base_stiffness)
    assert arm.bending > 0.0
    assert numbers["area_over_stiffness"] == pytest.approx(arm.area / arm.stiffness)


def test_judge_by_hand(tmp_path: Path) -> None:
    truth = {"arm": {"mass": 0.5}, "area_over_stiffness": 4e-7, "bending_over_stiffness": 1e-3}
    section = {"mass": 0.55, "stiffness": [50.0], "terminal_area": 2e-5, "bending_stiffness": [0.04]}
    assert judge.ratios_of(section, truth) == pytest.approx(
        {"mass": 1.1, "area_over_stiffness": 1.0, "bending_over_stiffness": 0.8}
    )
    held = [{"channels": ["x1", "y1", "z1"], "rms_after": [3e-3, 1e-3, 2e-3]}]
    assert judge.errors_of(held) == pytest.approx((math.sqrt(5.0) * 1e-3, 2e-3))
    folder = tmp_path / "case"
    folder.mkdir()
    (tmp_path / "case.sealed").mkdir()
    (tmp_path / "case.sealed" / "truth.json").write_text(
        json.dumps({**truth, "setup": {"commanded": True}}), encoding="utf-8"
    )
    (folder / "train_1.csv").write_text("t [s],pc11 [Pa],x1 [m]\n0,1,2\n", encoding="utf-8")
    script = tmp_path / "product.py"
    script.write_text(
        "import sys, json, pathlib\n"
        "assert '--pressures' not in sys.argv\n"
        "assert pathlib.Path(sys.argv[2]).read_text().startswith('t [s],p11')\n"
        "text = '[[section]]\\nmass = 0.5\\nstiffness = [50.0]\\nterminal_area = 2e-5\\n'\n"
        "text += 'bending_stiffness = [0.05]\\n'\n"
        "pathlib.Path(sys.argv[sys.argv.index('--out') + 1]).write_text(text)\n"
        "print(json.dumps({'converged': True, 'held_out': []}))\n",
        encoding="utf-8",
    )
    found = judge.judge(folder, f"{sys.executable} {script}", rename=True, timeout=60.0)
    assert found.converged
    assert found.ratios["mass"] == pytest.approx(1.0)
    failed = judge.judge(folder, f"{sys.executable} {script}", rename=False, timeout=60.0)
    assert failed.converged is None
    assert "AssertionError" in failed.problem


def test_a_chain_of_one_link_is_a_pendulum_on_a_spring() -> None:
    chain = Chain(1, 0.2, 0.05, ((0, 0.1, 0.4), (0, 0.25, 0.1)), stiffness=0.5, damping=0.3)
    weight = GRAVITY * (0.4 * 0.1 + 0.1 * 0.25)
    assert chain.across(2e-3) == pytest.approx(2e-3 * 0.25 / (0.5 + weight))
    assert chain.across(2e-3, weight=0.0) == pytest.approx(2e-3 * 0.25 / 0.5)
    assert chain.time() == pytest.approx(0.3 / (0.5 + weight))


def test_a_chain_of_many_links_without_weight_is_an_arc() -> None:
    count, length, moment, spring = 400, 0.3, 1e-3, 0.08
    chain = Chain(count, length / count, 0.0, (), stiffness=spring * count, damping=count * 0.02)
    assert chain.across(moment) == pytest.approx(0.5 * length * moment / spring, rel=5e-3)
    assert chain.shape() == pytest.approx(np.full(count, 1.0 / count))
    assert chain.time() == pytest.approx(0.02 / spring)


def test_responses_are_judged_with_weight_and_without() -> None:
    arm = load(common.arm_file(TRUE, common.Setup(), "a"))
    springs = 2.0 * TRUE.stiffness * TRUE.radius**2 + TRUE.bending
    middle = TRUE.length + 0.5 * TRUE.highest_pressure * TRUE.area / TRUE.stiffness
    across = 0.5 * middle * TRUE.area * TRUE.radius / springs
    truth = {
        "arm": {"highest_pressure": TRUE.highest_pressure},
        "across_per_pascal": 1.0,
        "weightless_per_pascal": across,
    }
    found = judge.responses_of(arm, truth)
    assert found["weightless_per_pascal"] == pytest.approx(1.0, rel=2e-3)
    assert found["across_per_pascal"] < 0.9 * across
    times = [{"across": 0.44, "along": 0.33, "lag": 0.31, "told": True}]
    known = {"lag": 0.3, "time_across": 0.1, "time_along": 0.03}
    assert judge.times_of(times, known) == pytest.approx({"time_across": 1.1, "time_along": 1.0, "lag": 0.31 / 0.3})
    assert "lag" not in judge.times_of([{**times[0], "told": False}], known)
