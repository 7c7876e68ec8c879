"""Programmes: what somebody who wants to know their arm makes it do.

``rich``: steps of all chambers, a multisine, releases; other mixtures in the logs held out. ``single``: steps of one
chamber at a time. ``cycle``: each log one slow cycle. ``proposed``: the four pieces that ``bha excite`` proposes
(levels held at each input alone and at all, a multisine, a release), with rests between. Where only commands are
logged, they are held for 0.5 to 3 s. Logs start at rest; one in three starts in motion, after an unlogged push.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arms import TrueArm

Array = NDArray[np.float64]

PROGRAMMES = ("rich", "single", "cycle", "proposed")
GRID = 0.01
LEAD = 2.0
USED = 0.85  # share of the range of pressures


@dataclass(frozen=True)
class Timetable:
    """Names, lengths in seconds and starts of the logs of a case; the last ``holdout`` of them are held out."""

    durations: tuple[float, ...]
    holdout: int
    moving: tuple[bool, ...]
    dwell: float  # of held commands, s; 0: not held

    @property
    def names(self) -> tuple[str, ...]:
        """File names without ending."""
        train = len(self.durations) - self.holdout
        return (
            *(f"train_{k + 1}" for k in range(train)),
            *(f"holdout_{k + 1}" for k in range(self.holdout)),
        )


def draw_timetable(rng: np.random.Generator, logs: int, total: float, commanded: bool) -> Timetable:
    """``logs`` logs of 20 to 120 s that last ``total`` seconds together, at whole seconds."""
    spare = total - 20.0 * logs
    shares = rng.dirichlet(np.full(logs, 3.0))
    durations = tuple(float(min(120.0, round(20.0 + spare * x))) for x in shares)
    moving = tuple(bool(rng.random() < 1 / 3) for _ in range(logs))
    dwell = round(float(rng.uniform(0.5, 3.0)), 1) if commanded else 0.0
    return Timetable(durations, 2 if logs >= 4 else 1, moving, dwell)


def _ranges(arm: TrueArm) -> tuple[Array, Array]:
    """Lowest and highest pressure that is used at each input."""
    low, high = [], []
    for name in arm.inputs:
        least, most = arm.sections[int(name[1]) - 1].pressure_range
        low.append(least)
        high.append(least + USED * (most - least))
    return np.array(low), np.array(high)


def _steps(rng: np.random.Generator, times: Array, inputs: int, dwell: tuple[float, float]) -> Array:
    """Levels from 0 to 1: all inputs change together, at jumps or ramps, some changes of one input only."""
    out = np.empty((times.shape[0], inputs))
    level = rng.uniform(0.0, 1.0, inputs)
    out[:] = level
    t = float(rng.uniform(0.2, 1.0))
    while t < times[-1]:
        target = rng.uniform(0.0, 1.0, inputs)
        if rng.random() < 0.4:
            target = np.where(np.arange(inputs) == rng.integers(inputs), target, level)
        ramp = GRID if rng.random() < 0.6 else float(rng.uniform(0.2, 1.0))
        out += np.clip((times - t) / ramp, 0.0, 1.0)[:, None] * (target - level)
        level = target
        t += ramp + float(rng.uniform(*dwell))
    return out


def _multisine(rng: np.random.Generator, times: Array, inputs: int, highest: float) -> Array:
    lines = np.geomspace(0.05, highest, 12) * rng.uniform(0.85, 1.15, (inputs, 12))
    size = lines**-0.5
    phases = rng.uniform(0.0, 2.0 * np.pi, (inputs, 12))
    waves = np.stack(
        [np.sin(2.0 * np.pi * times[:, None] * lines[j] + phases[j]) @ size[j] for j in range(inputs)], axis=1
    )
    return np.asarray(np.clip(0.5 + 0.17 * waves / np.std(waves, axis=0), 0.0, 1.0))


def _releases(rng: np.random.Generator, times: Array, inputs: int) -> Array:
    """Some inputs rise over a second, hold, and fall at once; again and again."""
    out = np.full((times.shape[0], inputs), 0.15)
    t = 0.5
    while t < times[-1]:
        chosen = rng.random(inputs) < 0.4
        chosen[rng.integers(inputs)] = True
        hold = float(rng.uniform(1.0, 2.0))
        shape = np.clip((times - t) / 1.0, 0.0, 1.0) * (times < t + 1.0 + hold)
        out += shape[:, None] * np.where(chosen, rng.uniform(0.5, 0.8, inputs), 0.0)
        t += 1.0 + hold + float(rng.uniform(1.5, 3.5))
    return out


def _single(rng: np.random.Generator, times: Array, inputs: int) -> Array:
    out = np.full((times.shape[0], inputs), 0.05)
    t, j = float(rng.uniform(0.3, 1.0)), int(rng.integers(inputs))
    while t < times[-1]:
        on, off = float(rng.uniform(1.5, 4.0)), float(rng.uniform(1.0, 3.0))
        out[(times >= t) & (times < t + on), j % inputs] = rng.uniform(0.3, 1.0)
        t += on + off
        j += 1
    return out


def _cycle(rng: np.random.Generator, times: Array, inputs: int) -> Array:
    phase = rng.uniform(0.0, 2.0 * np.pi, inputs)
    size = rng.uniform(0.3, 0.5, inputs)
    turn = 2.0 * np.pi * times[:, None] / times[-1]
    return np.asarray(0.5 + size * np.sin(turn + phase))


def _proposed(rng: np.random.Generator, times: Array, inputs: int, highest: float) -> Array:
    parts = []
    middle = np.full(inputs, 0.5)
    for k in range(4):
        part = times[(times >= times[-1] * k / 4) & (times < times[-1] * (k + 1) / 4 + (k == 3))]
        local = part - part[0]
        if k < 2:
            count = inputs if k == 0 else 6
            levels = np.tile(middle, (count, 1))
            for m in range(count):
                size = float(rng.uniform(0.2, 0.45) * rng.choice([-1.0, 1.0]))
                levels[m, slice(None) if k else m] += size * (rng.choice([-1.0, 1.0], inputs) if k else 1.0)
            place = np.minimum((local / max(local[-1], GRID) * 2 * count).astype(int), 2 * count - 1)
            out = np.where((place % 2 == 0)[:, None], levels[place // 2], middle)
        elif k == 2:
            out = _multisine(rng, local, inputs, highest)
        else:
            out = _releases(rng, local, inputs)
        parts.append(out)
    return np.concatenate(parts)


def commands(
    rng: np.random.Generator, arm: TrueArm, programme: str, table: Timetable, number: int
) -> tuple[Array, Array]:
    """Times from -LEAD on and commanded absolute pressures (rows, inputs) of one log, on a grid of GRID seconds.

    The command of a row holds until the next one.
    """
    duration = table.durations[number]
    times = np.arange(round((LEAD + duration) / GRID) + 1) * GRID
    inputs = len(arm.inputs)
    highest = 3.0 if arm.regime == "ringing" else 1.0
    held_out = number >= len(table.durations) - table.holdout
    if programme == "single":
        share = _single(rng, times, inputs)
    elif programme == "cycle":
        share = _cycle(rng, times, inputs)
    elif programme == "proposed":
        share = _proposed(rng, times, inputs, highest)
    elif held_out:
        cut = round(times.shape[0] * rng.uniform(0.35, 0.65))
        early = _steps(rng, times[:cut], inputs, (0.8, 2.5))
        share = np.concatenate([early, _multisine(rng, times[cut:] - times[cut], inputs, highest)])
    else:
        share = (
            _steps(rng, times, inputs, (0.8, 3.5)),
            _multisine(rng, times, inputs, highest),
            _releases(rng, times, inputs),
        )[number % 3]
    if table.dwell:
        every = round(table.dwell / GRID)
        # Changes fall on whole tenths of a second of the log, so that no rate of logging misses their time.
        first = round(LEAD / GRID) % every
        index = np.maximum((np.arange(times.shape[0]) - first) // every * every + first, 0)
        share = share[index]
    begin = round(LEAD / GRID)
    if table.moving[number]:
        other = rng.uniform(0.0, 1.0, inputs)
        share[: begin - round(rng.uniform(0.2, 0.8) / GRID)] = other
    else:
        share[:begin] = share[begin]
    low, high = _ranges(arm)
    return times - LEAD, low + share * (high - low)
