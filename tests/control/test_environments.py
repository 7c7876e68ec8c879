"""Gymnasium environments: the checker of Gymnasium, one against many, seeds, threads, what ends an episode."""

import copy
import os
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from stiff_arm import stiff_arm

import bha
from bha.control import Stepper

gymnasium = pytest.importorskip("gymnasium")
environments = pytest.importorskip("bha.environments")

FULL = bha.robots.load("bha_nominal").with_changes(pneumatics="full")


@pytest.mark.filterwarnings("ignore")
def test_passes_the_checker_of_gymnasium() -> None:
    from gymnasium.utils.env_checker import check_env  # noqa: PLC0415

    check_env(gymnasium.make("bha/Reach-v0").unwrapped, skip_render_check=True)
    check_env(environments.ReachEnv(FULL), skip_render_check=True)


def test_make_cuts_episodes() -> None:
    env = gymnasium.make("bha/Reach-v0", max_episode_steps=3)
    env.reset(seed=1)
    cut = [env.step(np.zeros(9, np.float32))[3] for _ in range(3)]
    assert cut == [False, False, True]


@pytest.mark.parametrize("arm", [None, FULL], ids=["ideal", "full"])
def test_many_are_each_like_one(arm: bha.Arm | None) -> None:
    """Thirteen abreast (lanes are left over) against one by itself; resets of single ones disturb nobody."""
    many = environments.ReachVectorEnv(13, arm, max_episode_steps=20)
    first, _ = many.reset(seed=4)
    targets = many._targets.copy()
    rng = np.random.default_rng(2)
    actions = rng.uniform(-0.3, 0.3, (20, 13, 9)).astype(np.float32)
    rows = [many.step(action) for action in actions]
    for k in (0, 7, 12):
        one = environments.ReachEnv(arm)
        start, _ = one.reset(options={"target": targets[k]})
        assert first[k] == pytest.approx(start, abs=1e-6)
        for action, (observation, reward, terminated, _, _) in zip(actions, rows, strict=True):
            expected, expected_reward, *_ = one.step(action[k])
            assert observation[k] == pytest.approx(expected, abs=2e-5)
            assert reward[k] == pytest.approx(expected_reward, abs=1e-6)
            assert not terminated[k]
    assert rows[-1][3].all()
    renewed, rewards, _, _, _ = many.step(actions[0])
    assert renewed[:, :24] == pytest.approx(first[:, :24], abs=1e-6)
    assert np.all(rewards == 0)
    assert not np.allclose(many._targets, targets)


def test_symplectic_euler_converges_to_the_runge_kutta_method_at_first_order() -> None:
    """Tips after half a second of random pressures; and of ten arms abreast each is like one."""
    actions = np.random.default_rng(3).uniform(-0.5, 0.5, (25, 10, 9)).astype(np.float32)

    def tips(method: str, step: float) -> np.ndarray:
        many = environments.ReachVectorEnv(10, FULL, method=method, step=step, max_episode_steps=100)
        many.reset(seed=1)
        return np.array([many.step(action)[0][:, -6:-3] for action in actions], dtype=np.float64)

    exact = tips("rk4", 2.5e-4)
    coarse, fine = (np.abs(tips("symplectic_euler", step) - exact).max() for step in (2e-3, 1e-3))
    assert fine < 0.02
    assert 1.6 < coarse / fine < 2.5
    with pytest.raises(bha.InputError, match="method: 'euler'; 'rk4', 'symplectic_euler', 'ros2' or None are allowed"):
        environments.ReachVectorEnv(10, method="euler")


def test_a_seed_gives_the_same_run_on_any_number_of_threads() -> None:
    rows = []
    for threads in (1, 2):
        many = environments.ReachVectorEnv(50, threads=threads, max_episode_steps=7)
        many.reset(seed=11)
        rng = np.random.default_rng(5)
        rows.append([many.step(rng.uniform(-0.5, 0.5, (50, 9)).astype(np.float32))[0] for _ in range(20)])
    assert np.array_equal(rows[0], rows[1])


def test_one_reset_leaves_the_others_alone() -> None:
    fleets = [environments.ReachVectorEnv(9, FULL)._task.fleet(9, 5e-3, 1) for _ in range(2)]
    task = environments.ReachVectorEnv(9, FULL)._task
    p = np.tile(task.start_pressures + 1e4, (9, 1))
    for fleet in fleets:
        fleet.step(p, 0.02)
    fleets[1].reset([4], task.start_lengths[None], task.start_pressures[None])
    (plain, _), (reset, _) = (fleet.step(p, 0.02) for fleet in fleets)
    others = np.arange(9) != 4
    assert np.array_equal(plain[others], reset[others])
    assert not np.allclose(plain[4], reset[4])
    fresh = task.fleet(1, 5e-3, 1).step(p[:1], 0.02)[0][0]
    assert reset[4] == pytest.approx(fresh, rel=1e-9, abs=1e-9)


def test_what_diverges_is_reported_and_put_back() -> None:
    task = environments.ReachVectorEnv(3)._task
    fleet = task.fleet(10, 5e-3, 2)
    p = np.tile(task.start_pressures, (10, 1))
    p[6] = 1e9
    for _ in range(5):
        states, failed = fleet.step(p, 0.05)
        if failed.any():
            break
    assert failed.tolist() == [k == 6 for k in range(10)]
    assert np.isfinite(states).all()
    assert states[6, :9] == pytest.approx(task.start_lengths)
    assert states[5, :9] == pytest.approx(task.start_lengths, abs=1e-6)


@pytest.mark.parametrize("dt", [0.1, 0.6])
def test_what_leaves_the_model_within_a_step_is_reported_as_one_plant_alone_is(dt: float) -> None:
    """Let go far outside, an arm passes lengths below zero and may be back inside when the step ends."""
    task = environments.ReachVectorEnv(3)._task
    arm, p = task.arm, np.full(9, task.arm.parameters.ambient_pressure)
    starts = np.repeat([[0.2], [0.4], [0.6], [0.8], [1.0]], 9, axis=1)
    fleet = task.fleet(len(starts), 1e-3, 1)
    fleet.reset(list(range(len(starts))), starts, np.tile(p, (len(starts), 1)))
    states, failed = fleet.step(np.tile(p, (len(starts), 1)), dt)
    assert failed.tolist() == [False, True, True, True, True]
    for start, state, lost in zip(starts, states, failed, strict=True):
        alone = Stepper(arm, 1e-3, method="rk4")
        alone.reset(p, start)
        if lost:
            assert state[:9] == pytest.approx(start)
            with pytest.raises(bha.SimulationError):
                alone.step(p, dt)
        else:
            assert state[:9] == pytest.approx(alone.step(p, dt)[:9], abs=1e-9)


def test_what_environments_refuse() -> None:
    with pytest.raises(bha.InputError, match="num_envs: 0"):
        environments.ReachVectorEnv(0)
    with pytest.raises(bha.InputError, match="period: -1"):
        environments.ReachEnv(period=-1.0)
    lagging = bha.robots.load("bha_nominal").with_effects(
        [{"kind": "pressure_lag", "where": "all", "fill": 0.1, "vent": 0.1}]
    )
    with pytest.raises(bha.InputError, match="effects on pressures"):
        environments.ReachEnv(lagging)


def any_arm(name: str) -> bha.Arm:
    return {"full": FULL, "made": stiff_arm()}.get(name) or bha.robots.load(name)


@pytest.mark.parametrize("name", [*bha.robots.names(), "full", "made"])
def test_random_pressures_end_no_episode(name: str) -> None:
    """Over the whole range; over half of it for the nominal arms, whose bellows jumping pressures may invert."""
    many = environments.ReachVectorEnv(16, any_arm(name), max_episode_steps=1000, threads=1)
    many.reset(seed=0)
    rng = np.random.default_rng(0)
    size = 0.5 if name in ("bha_nominal", "bha_hand") else 1.0
    for _ in range(100):
        observation, _, terminated, _, _ = many.step(rng.uniform(-size, size, many.action_space.shape))
        assert not terminated.any()
        assert np.all(np.isfinite(observation))


@pytest.mark.parametrize("name", ["asu_two_section_january", "asu_two_section", "full"])
def test_the_step_chosen_follows_the_motion(name: str) -> None:
    """Against a plant that is stepped by itself, ten times as fine."""
    arm = any_arm(name)
    env = environments.ReachEnv(arm)
    env.reset(seed=1)
    task = env._task
    plant = Stepper(arm, 5e-4, method="ros2")
    plant.reset(task.start_pressures, task.start_lengths)
    rng = np.random.default_rng(3)
    for _ in range(25):
        action = rng.uniform(-1, 1, len(arm.inputs))
        observation = env.step(action)[0]
        plant.step(task.pressures(action, action.shape), 0.02)
    found = observation[: 3 * arm.section_count] * task.length_half + task.length_middle
    travelled = np.abs(plant.lengths - task.start_lengths).max()
    assert travelled > 2e-3
    assert np.abs(found - plant.lengths).max() < 0.02 * travelled


@pytest.mark.parametrize(("method", "step"), [("rk4", 5e-3), ("rk4", 1e-4), ("symplectic_euler", 1e-4)])
def test_a_step_that_is_not_stable_is_refused(method: Any, step: float) -> None:
    with pytest.raises(
        bha.InputError, match=rf'step: .* s; {method} is stable with this arm for steps up to .* "ros2"'
    ):
        environments.ReachEnv(stiff_arm(), method=method, step=step)
    env = environments.ReachVectorEnv(3, stiff_arm(), method=method)
    assert env._fleet.plan[0] == method
    assert env._fleet.plan[1] < 5e-5
    assert environments.ReachEnv(stiff_arm())._fleet.plan == ("ros2", 2.5e-3)
    assert environments.ReachEnv()._fleet.plan == ("rk4", 5e-3)


def test_options_of_many_are_those_of_one() -> None:
    many = environments.ReachVectorEnv(3)
    target = (0.1, 0.1, 0.5)
    first, info = many.reset(seed=0, options={"target": target})
    assert first[:, -3:] + first[:, -6:-3] == pytest.approx(np.tile(target, (3, 1)), abs=1e-6)
    assert info["target"] == pytest.approx(np.tile(target, (3, 1)))
    assert info["_target"].all()
    each = np.array([[0.1, 0.0, 0.5], [0.0, 0.1, 0.5], [0.1, 0.1, 0.45]])
    first, _ = many.reset(options={"target": each})
    assert first[:, -3:] + first[:, -6:-3] == pytest.approx(each, abs=1e-6)
    _, rewards, _, _, info = many.step(np.zeros((3, 9), np.float32))
    assert info["distance"] == pytest.approx(-rewards)
    assert info["_distance"].all()


def test_a_seed_each_is_that_of_one() -> None:
    many = environments.ReachVectorEnv(3)
    seeds = [5, 6, 5]
    first, info = many.reset(seed=seeds)
    for k, seed in enumerate(seeds):
        start, said = environments.ReachEnv().reset(seed=seed)
        assert first[k] == pytest.approx(start, abs=1e-6)
        assert info["target"][k] == pytest.approx(said["target"])
    again, _ = many.reset(seed=[None, 6, None])
    assert np.array_equal(again[1], first[1])
    assert not np.allclose(again[0], first[0])
    plain = [many.reset(seed=3)[0] for _ in range(2)]
    assert np.array_equal(*plain)
    assert not np.allclose(plain[0][0, -3:], plain[0][1, -3:])


def test_a_mask_resets_some() -> None:
    many = environments.ReachVectorEnv(4, FULL, max_episode_steps=5)
    start, _ = many.reset(seed=2)
    for _ in range(3):
        before, *_ = many.step(np.full((4, 9), 0.4, np.float32))
    mask = np.array([False, True, False, True])
    after, info = many.reset(options={"reset_mask": mask, "target": (0.05, 0.0, 0.55)})
    assert np.array_equal(after[~mask], before[~mask])
    assert after[mask, :27] == pytest.approx(start[mask, :27], abs=1e-6)
    assert np.array_equal(info["_target"], mask)
    cut = [many.step(np.zeros((4, 9), np.float32))[3] for _ in range(2)][1]
    assert np.array_equal(cut, ~mask)


@pytest.mark.parametrize(
    ("make", "options", "expected"),
    [
        (environments.ReachEnv, {"target": (0.1, np.nan, 0.5)}, "target: finite numbers"),
        (environments.ReachEnv, {"target": (0.1, 0.5)}, r"target: finite numbers of shape \(3,\)"),
        (environments.ReachEnv, {"target": "here"}, "target: finite numbers"),
        (environments.ReachEnv, {"target": (0.0, 0.0, 15.0)}, "15 m from the base, bha_nominal is at most"),
        (environments.ReachEnv, {"reset_mask": [True]}, "there is no 'reset_mask'; target are allowed"),
        (environments.ReachEnv, {"aim": 1}, "there is no 'aim'"),
        (lambda: environments.ReachVectorEnv(3), {"aim": 1}, "there is no 'aim'; target, reset_mask are allowed"),
        (lambda: environments.ReachVectorEnv(3), {"target": np.zeros((2, 3))}, r"\(3,\) or \(3, 3\)"),
        (lambda: environments.ReachVectorEnv(3), {"target": [[0, 0, np.inf]] * 3}, "finite numbers"),
        (lambda: environments.ReachVectorEnv(3), {"reset_mask": np.zeros(3, bool)}, "3 booleans are needed"),
        (lambda: environments.ReachVectorEnv(3), {"reset_mask": np.ones(2, bool)}, "3 booleans are needed"),
        (lambda: environments.ReachVectorEnv(3), {"reset_mask": np.ones(3)}, "3 booleans are needed"),
    ],
)
def test_options_that_are_none(make: Any, options: dict[str, Any], expected: str) -> None:
    env = make()
    with pytest.raises(bha.InputError, match=expected):
        env.reset(options=options)


@pytest.mark.parametrize("action", [0.1, np.zeros(3), np.zeros((9, 9)), np.full(9, np.nan), "up", None])
def test_actions_that_are_none(action: Any) -> None:
    env = environments.ReachEnv()
    env.reset(seed=0)
    with pytest.raises(bha.InputError, match=r"action: finite numbers of shape \(9,\) are needed"):
        env.step(action)
    many = environments.ReachVectorEnv(2)
    many.reset(seed=0)
    with pytest.raises(bha.InputError, match=r"action: finite numbers of shape \(2, 9\) are needed"):
        many.step(action)


@pytest.mark.parametrize("seed", [[1, 2], [1, 2, -3], [1, 2, "a"], [1.5, 2, 3]])
def test_seeds_that_are_none(seed: Any) -> None:
    with pytest.raises(bha.InputError, match="seed: "):
        environments.ReachVectorEnv(3).reset(seed=seed)


@pytest.mark.parametrize("options", [{"threads": -1}, {"max_episode_steps": 0}, {"step": -1.0}])
def test_arguments_that_are_none(options: dict[str, Any]) -> None:
    with pytest.raises(bha.InputError, match=next(iter(options))):
        environments.ReachVectorEnv(3, **options)


SENSORS = FULL.with_effects(
    [
        {"kind": "creep", "where": "all", "stiffness": 200.0, "tau": 0.8},
        {"kind": "delay", "where": "sensors", "time": 0.033},
        {"kind": "length_offset", "where": "bellows 12", "offset": 0.01},
    ]
)


@pytest.mark.parametrize("method", ["rk4", "ros2", "symplectic_euler"])
def test_observations_are_measured(method: Any) -> None:
    """Delayed and shifted lengths, as the single plant has them; one that is reset was at rest since ever."""
    many = environments.ReachVectorEnv(10, SENSORS, method=method, step=1e-3)
    many.reset(seed=0)
    task = many._task
    plant = Stepper(SENSORS, 1e-3, method="ros2")
    first = plant.reset(task.start_pressures, task.start_lengths)
    rng = np.random.default_rng(0)
    lengths = lambda rows: rows[..., :9] * task.length_half + task.length_middle  # noqa: E731
    for k in range(12):
        action = rng.uniform(-0.5, 0.5, 9)
        rows = many.step(np.tile(action, (10, 1)).astype(np.float32))[0]
        y = plant.step(task.pressures(action, (9,)), 0.02)
        assert lengths(rows[3]) == pytest.approx(y[:9], abs=2e-3 if method == "symplectic_euler" else 1e-4)
        if k == 6:
            mask = np.arange(10) == 7
            rows = many.reset(options={"reset_mask": mask})[0]
            assert lengths(rows[7]) == pytest.approx(first[:9], abs=1e-6)
            after = many.step(np.full((10, 9), 0.5, np.float32))[0]
            # 33 ms of delay: nothing of the step that was held for 20 ms is seen yet.
            assert lengths(after[7]) == pytest.approx(first[:9], abs=1e-6)
            plant.step(task.pressures(np.full(9, 0.5), (9,)), 0.02)
    assert np.abs(y[:9] - plant.lengths).max() > 5e-3


def test_the_tip_observed_is_the_one_that_targets_are_made_of() -> None:
    tilted = bha.robots.load("bha_nominal").with_effects([{"kind": "torsion", "where": "section 1", "stiffness": 20.0}])
    env = environments.ReachEnv(tilted)
    observation, _ = env.reset(seed=0)
    lengths = observation[:9] * env._task.length_half + env._task.length_middle
    assert observation[-6:-3] == pytest.approx(tilted.forward_kinematics(lengths)[0][-1], abs=1e-6)


@pytest.mark.parametrize("arm", [None, SENSORS, stiff_arm()], ids=["nominal", "hidden", "stiff"])
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_environments_copy_as_they_stand(arm: bha.Arm | None, copied: Any) -> None:
    rng = np.random.default_rng(1)
    size = len((arm or bha.robots.load("bha_nominal")).inputs)
    one, many = environments.ReachEnv(arm), environments.ReachVectorEnv(11, arm, max_episode_steps=12)
    for env, shape in ((one, (size,)), (many, (11, size))):
        env.reset(seed=3)
        for _ in range(6):
            env.step(rng.uniform(-0.5, 0.5, shape).astype(np.float32))
        twin = copied(env)
        # Over the end of an episode: targets come from the same generator.
        for _ in range(9):
            action = rng.uniform(-0.5, 0.5, shape).astype(np.float32)
            mine, its = env.step(action), twin.step(action)
            assert np.array_equal(mine[0], its[0])
            assert np.array_equal(mine[1], its[1])
    with pytest.raises(bha.InputError, match="state: it does not fit"):
        many._fleet._resume(np.zeros(17))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize(("count", "threads"), [(1, 1), (200, 2), (200, 0)])
def test_environments_survive_a_fork(
    count: int, threads: int, in_child: Callable[[Callable[[], bytes]], bytes]
) -> None:
    many = environments.ReachVectorEnv(count, threads=threads)
    many.reset(seed=0)
    action = np.full((count, 9), 0.2, np.float32)
    many.step(action)
    held = [many]

    def stepped() -> bytes:
        rows: np.ndarray = held[0].step(action)[0]
        return rows[0, :9].tobytes()

    def stepped_and_dropped() -> bytes:
        found = stepped()
        held.clear()
        return found

    del many
    assert in_child(stepped_and_dropped) == stepped()
