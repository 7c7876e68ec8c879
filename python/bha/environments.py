"""Gymnasium environments (extra ``gym``): ``bha/Reach-v0``, one arm or thousands abreast.

The task: bring the tip (head of the last section) to a random reachable point and keep it there.

- Action, float32 (inputs,) in -1 to 1: commanded pressure of each input over its ``pressure_range``.
- Observation, float32 (6n + inputs + 6,): measured lengths (0 at the middle, -1 and 1 at the ends of ``length_range``;
  effects on sensors included), rates (m/s times 2), pressures in the chambers (like the action), tip position and way
  from the tip to the target (m).
- Reward: minus the distance to the target, m, for each step.
- An episode ends (terminated) only if the motion leaves what the model describes: a mean length that is not positive,
  more than one and a half turns. Pressures that jump over their whole range at random can make a lightly damped arm
  with ideal pneumatics do so, with symplectic Euler at its longest step more often than with RK4
  (docs/guides/control.md). It is cut (truncated) after ``max_episode_steps``.
- Method and step of the integration are chosen for the arm: RK4, or for stiff arms a linearly implicit method
  (:func:`bha.control.stepper.plan_steps`). A step given with an explicit method that is not stable with it is an
  ``InputError``.

Environments pickle, copy (``copy.deepcopy`` for planning ahead) and survive a fork, hidden states included.

Importing this module makes them known to Gymnasium: then ``gymnasium.make("bha/Reach-v0")`` and
``gymnasium.make_vec("bha/Reach-v0", num_envs=4096, vectorization_mode="vector_entry_point")`` work.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bha import _core, robots
from bha.arm import Arm
from bha.control.limits import Limits
from bha.control.stepper import plan_steps
from bha.errors import InputError
from bha.support.extras import import_extra

gymnasium = import_extra("gymnasium", extra="gym", purpose="Environments")
import_extra("gymnasium.vector", extra="gym", purpose="Environments")

ENVIRONMENT = "bha/Reach-v0"
#: Steps of an episode where ``gymnasium.make`` is not told otherwise.
EPISODE_STEPS = 200
#: Longest step of the integration where none is given, s.
USUAL_STEP = 5e-3
# Targets are tips of poses within this part of the lengths' range around its middle.
_REACH = 0.6
_RATE_SCALE = 2.0

Floats = NDArray[np.float64]
#: How environments are integrated.
Method = Literal["rk4", "symplectic_euler", "ros2"]
_METHODS = ("rk4", "symplectic_euler", "ros2")


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

    def __init__(self, arm: Arm | str | None, period: float) -> None:
        self.arm = robots.load(arm or "bha_nominal") if arm is None or isinstance(arm, str) else arm
        if not (np.isfinite(period) and period > 0):
            raise InputError(f"period: {period}; a positive number of seconds is needed")
        self.period = float(period)
        self.limits = Limits.of(self.arm)
        found = self.limits
        self.pressure_middle, self.pressure_half = (found.low + found.high) / 2, (found.high - found.low) / 2
        self.length_middle = found.middle
        self.length_half = (found.longest - found.shortest) / 2
        rest = found.rest_near(self.arm, self.length_middle)
        self.start_pressures, self.start_lengths = rest.pressures, rest.lengths
        #: Length of the straight arm with all lengths at their longest, m: no tip is farther away.
        self.span = float(np.linalg.norm(self._from_base(self.arm.forward_kinematics(found.longest)[0][-1])))
        inputs, lengths = len(found.low), len(found.shortest)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (inputs,), np.float32)
        size = 2 * lengths + inputs + 6
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)

    def fleet(self, count: int, step: float | None, threads: int, method: Method | None = None) -> _Fleet:
        """Plants at rest."""
        if method is not None and method not in _METHODS:
            raise InputError(f"method: {method!r}; {', '.join(map(repr, _METHODS))} or None are allowed")
        if threads < 0:
            raise InputError(f"threads: {threads}; a number from 0 on is needed, 0 for as many as there are cores")
        plan = plan_steps(self.arm, method=method, step=step, usual=USUAL_STEP)
        return _Fleet(self.arm, count, (self.start_lengths, self.start_pressures), plan, threads)

    def pressures(self, actions: Any, shape: tuple[int, ...] | None = None) -> Floats:
        """Commanded pressures, Pa absolute, of actions (..., inputs), of a shape if one is given."""
        try:
            given = np.asarray(actions, dtype=np.float64)
        except (TypeError, ValueError):
            given = np.full((), np.nan)
        shape = given.shape if shape is None else shape
        if given.shape != shape or not np.all(np.isfinite(given)):
            what = f"shape {given.shape}" if given.shape != shape else "some that are not"
            raise InputError(f"action: finite numbers of shape {shape} are needed, found {what}")
        return np.asarray(self.pressure_middle + self.pressure_half * np.clip(given, -1.0, 1.0))

    def options(self, given: Any, known: tuple[str, ...]) -> dict[str, Any]:
        """Options of a reset, checked for names."""
        options = dict(given or {})
        for name in options:
            if name not in known:
                raise InputError(f"options: there is no {name!r}; {', '.join(known)} are allowed")
        return options

    def given_target(self, value: Any, shapes: tuple[tuple[int, ...], ...]) -> Floats:
        """A target that a user sets, m, of one of the shapes; it must lie within what the arm's length can span."""
        try:
            target = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            target = np.full((), np.nan)
        if target.shape not in shapes or not np.all(np.isfinite(target)):
            allowed = " or ".join(map(str, shapes))
            raise InputError(f"options: target: finite numbers of shape {allowed} are needed, found {value!r}")
        far = float(np.linalg.norm(self._from_base(target), axis=-1).max())
        if far > self.span:
            raise InputError(
                f"options: target: {far:.3g} m from the base, {self.arm.name} is at most {self.span:.3g} m long; "
                "choose one within reach"
            )
        return target

    def _from_base(self, positions: Floats) -> Floats:
        """Positions of the world (..., 3), m, as the base sees them."""
        return self.arm.parameters.base_pose.from_world(positions)

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


class _Fleet(_core.Fleet):
    """Plants of the core that pickle and copy as they stand."""

    __slots__ = ("_made",)
    _made: tuple[Any, ...]

    def __new__(
        cls,
        arm: Arm,
        count: int,
        start: tuple[Floats, Floats],
        plan: tuple[str, float],
        threads: int,
        state: Floats | None = None,
    ) -> _Fleet:
        """``count`` plants of ``arm`` at a start (lengths, pressures), stepped by a plan (method, step)."""
        self = super().__new__(cls, arm, count, *start, plan[1], threads, plan[0])
        self._made = (arm, count, start, plan, threads)
        if state is not None:
            self._resume(state)
        return self

    @property
    def plan(self) -> tuple[str, float]:
        """Method and longest step, s."""
        found: tuple[str, float] = self._made[3]
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle with hidden states; what goes on from there is the same to the last digit on a like processor."""
        return (type(self), (*self._made, self._state))


class ReachEnv(gymnasium.Env):  # type: ignore[misc,name-defined]
    """One arm; see the module."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  (Gymnasium's own convention)

    def __init__(
        self,
        arm: Arm | str | None = None,
        *,
        period: float = 0.02,
        step: float | None = None,
        method: Method | None = None,
        render_mode: str | None = None,
    ) -> None:
        """An environment of ``arm``, an arm or the name of one that comes with the package.

        Args:
            arm: ``"bha_nominal"`` if None; its pneumatics take part.
            period: time between two actions, s.
            step: longest step of the integration within it, s; None: 5 ms, or less where the method needs it.
            method: ``"rk4"``, ``"ros2"`` (linearly implicit, for stiff arms), or ``"symplectic_euler"``: of first
                order, but four times as cheap; None: RK4, or ``"ros2"`` where that costs less since the arm is stiff.
            render_mode: None; there is nothing to see.

        Raises:
            InputError: a step with which the explicit method asked for is not stable, or another argument out of range.
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
        given = task.options(options, ("target",)).get("target")
        self._target = task.target(self.np_random) if given is None else task.given_target(given, ((3,),))
        states = self._fleet.reset([0], task.start_lengths[None], task.start_pressures[None])
        return task.observe(states[0], self._target), {"target": self._target.copy()}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold the action's pressures for a period."""
        task = self._task
        pressures = task.pressures(action, self.action_space.shape)
        states, failed = self._fleet.step(pressures[None], task.period)
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
        arm: Arm | str | None = None,
        *,
        period: float = 0.02,
        step: float | None = None,
        method: Method | None = None,
        max_episode_steps: int = EPISODE_STEPS,
        threads: int = 0,
        render_mode: str | None = None,
    ) -> None:
        """``num_envs`` environments of ``arm``; the rest as for :class:`ReachEnv`.

        Args:
            num_envs: how many.
            arm: ``"bha_nominal"`` if None.
            period: time between two actions, s.
            step: longest step of the integration within it, s; None: 5 ms, or less where the method needs it.
            method: ``"rk4"``, ``"ros2"`` (linearly implicit, for stiff arms), or ``"symplectic_euler"``: of first
                order, but four times as cheap; None: RK4, or ``"ros2"`` where that costs less since the arm is stiff.
            max_episode_steps: steps after which an episode is cut.
            threads: how many work; 0: as many as there are cores.
            render_mode: None; there is nothing to see.
        """
        if num_envs < 1:
            raise InputError(f"num_envs: {num_envs}; at least 1 is needed")
        if max_episode_steps < 1:
            raise InputError(f"max_episode_steps: {max_episode_steps}; at least 1 is needed")
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
        self._generators: list[np.random.Generator | None] = [None] * num_envs

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Rest at the middle of the lengths and new targets.

        Args:
            seed: of the one generator that all targets come from; or one number (or None) an environment, which then
                has a generator of its own, as a :class:`ReachEnv` reset with it: the targets are the same.
            options: ``"target"``: a target for all, (3,), or one each, (num_envs, 3), m; ``"reset_mask"``: which
                environments are reset, booleans (num_envs,), the others go on (Gymnasium's partial reset).

        Raises:
            InputError: an option that there is not, or a shape or value that does not fit.
        """
        task, count = self._task, self.num_envs
        given = task.options(options, ("target", "reset_mask"))
        mask = np.ones(count, np.bool_) if given.get("reset_mask") is None else np.asarray(given["reset_mask"])
        if mask.shape != (count,) or mask.dtype != np.bool_ or not mask.any():
            raise InputError(
                f"options: reset_mask: {count} booleans are needed, one of them true, found {given['reset_mask']!r}"
            )
        target = given.get("target")
        if target is not None:
            target = np.broadcast_to(task.given_target(target, ((3,), (count, 3))), (count, 3))
        if seed is None or isinstance(seed, (int, np.integer)):
            super().reset(seed=None if seed is None else int(seed))
            if seed is not None:
                self._generators = [None] * count
        else:
            self._seed_each(list(seed))
        which = np.flatnonzero(mask)
        self._renew(which, target)
        self._ended[which] = False
        return task.observe(self._states, self._targets), self._info(which)

    def _seed_each(self, seeds: list[int | None]) -> None:
        if len(seeds) != self.num_envs:
            raise InputError(f"seed: {self.num_envs} numbers are needed, one an environment, found {len(seeds)}")
        for k, seed in enumerate(seeds):
            if seed is None:
                continue
            if not isinstance(seed, (int, np.integer)) or seed < 0:
                raise InputError(f"seed: entry {k} is {seed!r}; whole numbers from 0 on or None are needed")
            self._generators[k] = gymnasium.utils.seeding.np_random(int(seed))[0]

    def step(
        self, actions: Any
    ) -> tuple[NDArray[np.float32], Floats, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Hold each action's pressures for a period; where an episode had ended, begin a new one instead."""
        task = self._task
        renewed = np.flatnonzero(self._ended)
        self._states, failed = self._fleet.step(task.pressures(actions, self.action_space.shape), task.period)
        self._steps += 1
        if len(renewed):
            self._renew(renewed)
            failed[renewed] = False
        distance = task.distance(self._states, self._targets)
        rewards = -distance
        rewards[renewed] = 0.0
        truncated = self._steps >= self._most_steps
        self._ended = failed | truncated
        begun = np.zeros(self.num_envs, np.bool_)
        begun[renewed] = True
        info: dict[str, Any] = {"distance": np.where(begun, 0.0, distance), "_distance": ~begun}
        if len(renewed):
            info |= self._info(renewed)
        return task.observe(self._states, self._targets), rewards, failed, truncated, info

    def _info(self, which: NDArray[np.intp]) -> dict[str, Any]:
        """What the single environment's reset says, of those that were reset; ``_target`` says which these are."""
        mask = np.zeros(self.num_envs, np.bool_)
        mask[which] = True
        return {"target": np.where(mask[:, None], self._targets, 0.0), "_target": mask}

    def _renew(self, which: NDArray[np.intp], targets: Floats | None = None) -> None:
        task, count = self._task, len(which)
        for k in which:
            generator = self._generators[k] or self.np_random
            self._targets[k] = task.target(generator) if targets is None else targets[k]
        lengths = np.tile(task.start_lengths, (count, 1))
        self._states = self._fleet.reset(which.tolist(), lengths, np.tile(task.start_pressures, (count, 1)))
        self._steps[which] = 0


register()
