"""Excitations: steps, multisine, releases, and mixtures of steps, ramps and chirp for the held-out logs.

Wanted lengths are drawn and turned into pressures by the springs alone (the arm then does what it does). The chamber
pressure follows its command through two first-order stages of 25 ms, so that samples at 200 Hz with straight lines in
between describe it well. A tip force is linear between samples; when it lets go, it falls to zero from one sample to
the next.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .armfile import ArmFile
from .integrate import STEP
from .jit import compiled
from .truth import SAMPLE_TIME, Excitation

Array = NDArray[np.float64]

CHAMBER_TAU = 0.025
SHORT, LONG = 0.11, 0.27
DURATION = {"steps": 25.0, "multisine": 15.0, "release": 20.0, "holdout_1": 20.0, "holdout_2": 20.0}
LOG_NAMES = ("steps", "multisine", "release", "holdout_1", "holdout_2")


def spring_pressure(arm: ArmFile, lengths: Array) -> Array:
    """Absolute pressure (samples, 3n) that balances the springs alone at the wanted lengths, within the range of
    each section.
    """
    columns = []
    for j in range(lengths.shape[1]):
        s = arm.sections[j // 3]
        x = lengths[:, j] - s.rest_length
        force = np.zeros_like(x)
        for m, k in enumerate(s.stiffness):
            force += k * x ** (m + 1)
        lowest, highest = s.pressure_range
        columns.append(np.clip(arm.ambient_pressure + force / s.terminal_area, lowest, highest))
    return np.stack(columns, axis=1)


@compiled
def _chamber(command: Any, per: int, decay: float, out: Any) -> None:
    """Two first-order stages on the fine grid, command held between its samples."""
    for j in range(command.shape[1]):
        first = command[0, j]
        second = command[0, j]
        for k in range(out.shape[0]):
            row = min(k // per, command.shape[0] - 1)
            out[k, j] = second
            first = command[row, j] + (first - command[row, j]) * decay
            second = first + (second - first) * decay


def _pose(arm: ArmFile, rng: np.random.Generator, section: int) -> Array:
    """Wanted lengths of one section: a mean, and a bend of limited size."""
    spread = 0.42 * arm.sections[section].bellows_radius
    mean = rng.uniform(0.14, 0.23)
    return np.clip(mean + rng.uniform(-spread, spread, 3), SHORT, LONG)


def _steps(arm: ArmFile, rng: np.random.Generator, times: Array) -> Array:
    """Every section changes its pose at its own moments: jumps and ramps, some long holds, some of one bellows only."""
    n = len(arm.sections)
    wanted = np.empty((times.shape[0], 3 * n))
    for i in range(n):
        pose = _pose(arm, rng, i)
        cols = slice(3 * i, 3 * i + 3)
        wanted[:, cols] = pose
        t = rng.uniform(0.3, 1.5)
        while t < times[-1]:
            target = _pose(arm, rng, i)
            if rng.random() < 0.4:
                only = rng.integers(3)
                target = np.where(np.arange(3) == only, target, pose)
            ramp = 0.0 if rng.random() < 0.5 else rng.uniform(0.3, 1.5)
            share = np.clip((times - t) / max(ramp, 1e-9), 0.0, 1.0)[:, None]
            wanted[:, cols] += share * (target - pose)
            pose = target
            t += ramp + (rng.uniform(4.0, 6.0) if rng.random() < 0.2 else rng.uniform(1.2, 3.0))
    return wanted


def _multisine(arm: ArmFile, rng: np.random.Generator, times: Array) -> Array:
    """Fourteen lines from 0.1 to 8 Hz per bellows, amplitude falling with the root of the frequency."""
    n = len(arm.sections)
    wanted = np.empty((times.shape[0], 3 * n))
    for i in range(n):
        mean = rng.uniform(0.17, 0.20)
        for k in range(3):
            lines = np.geomspace(0.1, 8.0, 14) * rng.uniform(0.85, 1.18, 14)
            size = 1.0 / np.sqrt(lines)
            size *= 0.23 * arm.sections[i].bellows_radius / np.sqrt(0.5 * np.sum(size**2))
            phases = rng.uniform(0.0, 2.0 * np.pi, 14)
            wave = np.sum(size * np.sin(2.0 * np.pi * times[:, None] * lines + phases), axis=1)
            wanted[:, 3 * i + k] = mean + wave
    return np.clip(wanted, SHORT - 0.01, LONG)


def _chirp(arm: ArmFile, rng: np.random.Generator, times: Array) -> Array:
    """A sweep per bellows, each with its own start, end and phase, over a fixed pose."""
    n = len(arm.sections)
    span = times[-1] - times[0]
    wanted = np.empty((times.shape[0], 3 * n))
    for i in range(n):
        mean = rng.uniform(0.165, 0.205)
        for k in range(3):
            low, high = rng.uniform(0.1, 0.4), rng.uniform(2.0, 5.0)
            if rng.random() < 0.3:
                low, high = high, low
            x = (times - times[0]) / span
            phase = rng.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi * span * (low * x + 0.5 * (high - low) * x * x)
            wanted[:, 3 * i + k] = mean + 0.26 * arm.sections[i].bellows_radius * np.sin(phase)
    return np.clip(wanted, SHORT, LONG)


def _pulls(rng: np.random.Generator, times: Array, first: float, count: int, every: float) -> Array:
    """Tip force: rise over 1 s, hold, let go between two samples."""
    force = np.zeros((times.shape[0], 3))
    for m in range(count):
        begin = first + m * every
        end = begin + 1.0 + rng.uniform(0.5, 0.9)
        angle = rng.uniform(0.0, 2.0 * np.pi)
        size = rng.uniform(4.0, 9.0)
        vector = size * np.array([np.cos(angle), np.sin(angle), rng.uniform(-0.4, 0.4)])
        shape = np.where(times < end, 0.5 - 0.5 * np.cos(np.pi * np.clip(times - begin, 0.0, 1.0)), 0.0)
        force += shape[:, None] * vector
    return force


def make_excitation(
    arm: ArmFile, rng: np.random.Generator, name: str, duration: float | None = None
) -> tuple[Excitation, dict[str, object]]:
    """Excitation of one log and a note of how it starts.

    ``name`` is one of LOG_NAMES. A release log always starts in the swing after a pull that let go before its first
    sample; five in six hold more pulls, whose forces are logged; the others jump between poses. Other logs start at
    rest or in motion, evenly. No unlogged force acts during a log.
    """
    duration = DURATION[name] if duration is None else duration
    release = name == "release"
    moving = release or bool(rng.random() < 0.5)
    lead = 3.0 if moving else 0.5
    times: Array = np.arange(round((lead + duration) / SAMPLE_TIME) + 1, dtype=np.float64) * SAMPLE_TIME - lead
    logged = times >= 0.0
    force = np.zeros((times.shape[0], 3))
    pulls = 0
    if release:
        wanted = np.empty((times.shape[0], 3 * len(arm.sections)))
        pulls = 0 if rng.random() < 1 / 6 else max(1, round(duration / 7.0))
        every = duration / max(pulls, 1)
        poses = [np.concatenate([_pose(arm, rng, i) for i in range(len(arm.sections))]) for _ in range(4)]
        wanted[:] = poses[0]
        for m in range(1, max(pulls, 3)):
            start = m * duration / max(pulls, 3)
            rise = 0.8 if pulls else SAMPLE_TIME
            wanted += np.clip((times - start) / rise, 0.0, 1.0)[:, None] * (poses[m % 4] - poses[(m - 1) % 4])
        before = 1.5 * _pulls(rng, times, -2.0, 1, 1.0)
        force += before
        if pulls:
            force += _pulls(rng, times, 0.30 * every, pulls, every)
    else:
        make = {"steps": _steps, "multisine": _multisine}.get(name)
        if make is not None:
            wanted = make(arm, rng, times - times[0])
        else:
            cut = duration * rng.uniform(0.4, 0.6)
            early, late = (_steps, _chirp) if name == "holdout_1" else (_chirp, _steps)
            head = times < cut
            wanted = np.concatenate([early(arm, rng, times[head] - times[0]), late(arm, rng, times[~head] - cut)])
        if moving:
            # A push just before the log begins, so that it starts in motion.
            kick = times < -rng.uniform(0.3, 1.0)
            other = np.concatenate([_pose(arm, rng, i) for i in range(len(arm.sections))])
            wanted = np.where(kick[:, None], other, wanted)
        else:
            first = int(np.argmax(logged))
            fade = np.clip(times / 0.5, 0.0, 1.0)[:, None]
            wanted = wanted[first] + fade * (wanted - wanted[first])
            wanted[:first] = wanted[first]
    command = np.ascontiguousarray(spring_pressure(arm, wanted))
    per = round(2 * SAMPLE_TIME / STEP)
    rows = (times.shape[0] - 1) * per + 1
    pressure = np.empty((rows, command.shape[1]))
    _chamber(command, per, float(np.exp(-0.5 * STEP / CHAMBER_TAU)), pressure)
    fine = np.arange(rows) / per
    grid = np.arange(times.shape[0])
    fine_force = np.stack([np.interp(fine, grid, force[:, k]) for k in range(3)], axis=1)
    note: dict[str, object] = {
        "starts": "swinging" if release else ("moving" if moving else "at rest"),
        "logged_pulls": pulls,
    }
    return Excitation(pressure, fine_force, lead), note
