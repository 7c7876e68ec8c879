"""Gymnasium environments: the checker of Gymnasium, one against many, seeds, threads, what ends an episode."""

import numpy as np
import pytest

import bha

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
    with pytest.raises(bha.InputError, match='method: "euler"; "rk4" and "symplectic_euler" are allowed'):
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
