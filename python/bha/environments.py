"""Gymnasium environments (extra ``gym``): ``bha/Reach-v0``, one arm or thousands abreast.

The task: bring the tip (head of the last section) to a random reachable point and keep it there.

- Action, float32 (inputs,) in -1 to 1: commanded pressure of each input over its ``pressure_range``.
- Observation, float32 (6n + inputs + 6,): lengths (0 at the middle, -1 and 1 at the ends of ``length_range``), rates
  (m/s times 2), pressures in the chambers (like the action), tip position and way from the tip to the target (m).
- Reward: minus the distance to the target, m, for each step.
- An episode ends (terminated) only if the arm diverges, which no pressure within the range makes it do; it is cut
  (truncated) after ``max_episode_steps``.

Importing this module makes them known to Gymnasium: then ``gymnasium.make("bha/Reach-v0")`` and
``gymnasium.make_vec("bha/Reach-v0", num_envs=4096, vectorization_mode="vector_entry_point")`` work.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import bha
from bha import _core
from bha.control.limits import Limits
from bha.errors import InputError
from bha.extras import import_extra

gymnasium = import_extra("gymnasium", extra="gym", purpose="Environments")
import_extra("gymnasium.vector", extra="gym", purpose="Environments")

ENVIRONMENT = "bha/Reach-v0"
#: Steps of an episode where ``gymnasium.make`` is not told otherwise.
EPISODE_STEPS = 200
# Targets are tips of poses within this part of the lengths' range around its middle.
_REACH = 0.6
_RATE_SCALE = 2.0

Floats = NDArray[np.float64]
#: How environments are integrated.
Method = Literal["rk4", "symplectic_euler"]


def register() -> None:
    """Make the environments known to Gymnasium; importing this module does it, and again is harmless."""
    if ENVIRONMENT not in gymnasium.registry:
        gymnasium.register(
            id=ENVIRONMENT,
            entry_point="bha.environments:ReachEnv",
            vector_entry_point="bha.environments:ReachVectorEnv",
            max_episode_steps=EPISODE_STEPS,
        )


class _Task:
    """What one environment and many have in common: spaces, observations, targets."""

    def __init__(self, arm: bha.Arm | str | None, period: float) -> None:
        self.arm = bha.robots.load(arm or "bha_nominal") if arm is None or isinstance(arm, str) else arm
        if not (np.isfinite(period) and period > 0):
            raise InputError(f"period: {period}; a positive number of seconds is needed")
        self.period = float(period)
        self.limits = Limits.of(self.arm)
        found = self.limits
        self.pressure_middle, self.pressure_half = (found.low + found.high) / 2, (found.high - found.low) / 2
        self.length_middle = (found.shortest + found.longest) / 2
        self.length_half = (found.longest - found.shortest) / 2
        self.start_pressures, self.start_lengths = _core.rest_near(
            self.arm, self.length_middle, found.low, found.high, found.preferred
        )
        inputs, lengths = len(found.low), len(found.shortest)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (inputs,), np.float32)
        size = 2 * lengths + inputs + 6
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)

    def fleet(self, count: int, step: float, threads: int, method: Method = "rk4") -> _core.Fleet:
        """Plants at rest."""
        return _core.Fleet(self.arm, count, self.start_lengths, self.start_pressures, step, threads, method)

    def pressures(self, actions: Any) -> Floats:
        """Commanded pressures, Pa absolute, of actions (..., inputs)."""
        clipped = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)
        return np.asarray(self.pressure_middle + self.pressure_half * clipped)

    def target(self, rng: np.random.Generator) -> Floats:
        """A random reachable target (3,), m."""
        pose = self.length_middle + _REACH * self.length_half * rng.uniform(-1, 1, len(self.length_middle))
        return np.asarray(self.arm.forward_kinematics(pose)[0][-1])

    def observe(self, states: Floats, targets: Floats) -> NDArray[np.float32]:
        """Observations of states (..., 6n + inputs + 3): lengths, rates, pressures, tip."""
        m, inputs = len(self.length_middle), len(self.pressure_middle)
        out = np.empty((*states.shape[:-1], 2 * m + inputs + 6), np.float32)
        out[..., :m] = (states[..., :m] - self.length_middle) / self.length_half
        out[..., m : 2 * m] = states[..., m : 2 * m] * _RATE_SCALE
        p = slice(2 * m, 2 * m + inputs)
        out[..., p] = (states[..., p] - self.pressure_middle) / self.pressure_half
        tip = states[..., -3:]
        out[..., -6:-3] = tip
        out[..., -3:] = targets - tip
        return out

    def distance(self, states: Floats, targets: Floats) -> Floats:
        """Distance of the tip from the target, m."""
        return np.asarray(np.sqrt(np.sum((states[..., -3:] - targets) ** 2, axis=-1)))


class ReachEnv(gymnasium.Env):  # type: ignore[misc,name-defined]
    """One arm; see the module."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  (Gymnasium's own convention)

    def __init__(
        self,
        arm: bha.Arm | str | None = None,
        *,
        period: float = 0.02,
        step: float = 5e-3,
        method: Method = "rk4",
        render_mode: str | None = None,
    ) -> None:
        """An environment of ``arm``, an arm or the name of one that comes with the package.

        Args:
            arm: ``"bha_nominal"`` if None; its pneumatics take part.
            period: time between two actions, s.
            step: longest step of the integration within it, s.
            method: ``"rk4"``, or ``"symplectic_euler"``: of first order, but four times as cheap.
            render_mode: None; there is nothing to see.
        """
        self._task = _Task(arm, period)
        self._fleet = self._task.fleet(1, step, 1, method)
        self.action_space = self._task.action_space
        self.observation_space = self._task.observation_space
        self.render_mode = render_mode
        self._target = np.zeros(3)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Rest at the middle of the lengths and a new target; ``options={"target": (x, y, z)}`` sets it."""
        super().reset(seed=seed)
        task = self._task
        given = (options or {}).get("target")
        self._target = task.target(self.np_random) if given is None else np.asarray(given, dtype=np.float64)
        states = self._fleet.reset([0], task.start_lengths[None], task.start_pressures[None])
        return task.observe(states[0], self._target), {"target": self._target.copy()}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold the action's pressures for a period."""
        task = self._task
        states, failed = self._fleet.step(task.pressures(action)[None], task.period)
        distance = float(task.distance(states[0], self._target))
        return task.observe(states[0], self._target), -distance, bool(failed[0]), False, {"distance": distance}


class ReachVectorEnv(gymnasium.vector.VectorEnv):  # type: ignore[misc,name-defined]
    """Many arms abreast, in the lanes of the processor and over its cores; see the module.

    Each episode's target comes from one generator in the order of the environments, so that a seed gives the same run
    on any number of threads. An environment whose episode has ended is reset in the next step (Gymnasium's
    ``NEXT_STEP``).
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (Gymnasium's own convention)
        "render_modes": [],
        "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        arm: bha.Arm | str | None = None,
        *,
        period: float = 0.02,
        step: float = 5e-3,
        method: Method = "rk4",
        max_episode_steps: int = EPISODE_STEPS,
        threads: int = 0,
        render_mode: str | None = None,
    ) -> None:
        """``num_envs`` environments of ``arm``; the rest as for :class:`ReachEnv`.

        Args:
            num_envs: how many.
            arm: ``"bha_nominal"`` if None.
            period: time between two actions, s.
            step: longest step of the integration within it, s.
            method: ``"rk4"``, or ``"symplectic_euler"``: of first order, but four times as cheap.
            max_episode_steps: steps after which an episode is cut.
            threads: how many work; 0: as many as there are cores.
            render_mode: None; there is nothing to see.
        """
        if num_envs < 1:
            raise InputError(f"num_envs: {num_envs}; at least 1 is needed")
        self._task = _Task(arm, period)
        self._fleet = self._task.fleet(num_envs, step, threads, method)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_action_space = self._task.action_space
        self.single_observation_space = self._task.observation_space
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, num_envs)
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, num_envs)
        self._most_steps = max_episode_steps
        self._steps = np.zeros(num_envs, np.int64)
        self._ended = np.zeros(num_envs, np.bool_)
        self._targets = np.zeros((num_envs, 3))
        self._states: Floats = np.zeros((num_envs, 0))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Rest at the middle of the lengths and new targets, everywhere."""
        super().reset(seed=seed)
        self._renew(np.arange(self.num_envs))
        return self._task.observe(self._states, self._targets), {}

    def step(
        self, actions: Any
    ) -> tuple[NDArray[np.float32], Floats, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Hold each action's pressures for a period; where an episode had ended, begin a new one instead."""
        task = self._task
        renewed = np.flatnonzero(self._ended)
        self._states, failed = self._fleet.step(task.pressures(actions), task.period)
        self._steps += 1
        if len(renewed):
            self._renew(renewed)
            failed[renewed] = False
        rewards = -task.distance(self._states, self._targets)
        rewards[renewed] = 0.0
        truncated = self._steps >= self._most_steps
        self._ended = failed | truncated
        return task.observe(self._states, self._targets), rewards, failed, truncated, {}

    def _renew(self, which: NDArray[np.intp]) -> None:
        task, count = self._task, len(which)
        for k in which:
            self._targets[k] = task.target(self.np_random)
        lengths = np.tile(task.start_lengths, (count, 1))
        self._states = self._fleet.reset(which.tolist(), lengths, np.tile(task.start_pressures, (count, 1)))
        self._steps[which] = 0


register()
