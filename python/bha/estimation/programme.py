"""Programmes: pressures over time that move an arm in all its ways, within its ranges.

Three sorts of pieces follow each other, between which the arm rests at the middle of its pressures: steps that are
held, at every input alone and all together (stiffness, rest), a multisine of all inputs at once (everything), and
releases, fast falls of one side's pressures from a bent pose (damping where nobody pulls at the arm). All stay within
the pressure range of every section and within the lengths of the model's poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import ConvergenceError
from bha.logs import Log

Array = NDArray[np.float64]

#: The sorts of pieces that move an arm in all its ways; and with them all inputs together up and down (springs and
#: weight without bending) and a multisine of a tenth of the frequencies (what creeps).
KINDS = ("hold", "multisine", "release")
EVERY_KIND = (*KINDS, "even", "slow")
_SLOWER = 0.1
#: What a valve does to a commanded step, at the least: a ramp of this length, s.
RAMP = 0.1
_SINES = 12
#: How often the amplitude is lowered where the model would leave its lengths, and by which factor.
_LOWERINGS, _LOWER = 12, 0.8


@dataclass(frozen=True)
class Programme:
    """What is asked of pressures.

    Attributes:
        kinds: the pieces in their order, of :data:`EVERY_KIND`.
        amplitude: part of half the pressure range that is used, above 0 and up to 1.
        highest_frequency: of the multisine, Hz.
        duration: of the whole, s.
        rate: samples a second.
        seed: of phases and levels.
    """

    kinds: tuple[str, ...] = KINDS
    amplitude: float = 0.6
    highest_frequency: float = 3.0
    duration: float = 60.0
    rate: float = 200.0
    seed: int = 0


def bounded(arm: Arm, programme: Programme) -> tuple[Array, Array] | None:
    """Times, s, and pressures, Pa absolute, (m, inputs): the amplitude lowered until the model keeps its lengths.

    None where even small pressures about the middle of the range drive the model out of them.
    """
    for _ in range(_LOWERINGS):
        time, pressures = pressures_of(arm, programme)
        if _stays_within(arm, time, pressures):
            return time, pressures
        programme = replace(programme, amplitude=_LOWER * programme.amplitude)
    return None


def commands(time: Array, pressures: Array, inputs: Sequence[str], origin: str) -> Log:
    """Pressures, Pa absolute, as a log of commands (``pc11 [Pa]``, ...)."""
    columns = {f"pc{name.removeprefix('p')} [Pa]": p for name, p in zip(inputs, pressures.T, strict=True)}
    return Log.from_arrays({"t [s]": time, **columns}, origin=origin)


def pressures_of(arm: Arm, programme: Programme) -> tuple[Array, Array]:
    """Times, s, and pressures, Pa absolute, (m, inputs), of a programme as it is asked for."""
    random = np.random.default_rng(programme.seed)
    rate = programme.rate
    time = np.arange(round(programme.duration * rate) + 1) / rate
    low, high = _limits(arm)
    middle, reach = (low + high) / 2.0, programme.amplitude * (high - low) / 2.0
    unit = np.zeros((len(time), len(low)))
    edges = np.linspace(0, len(time), len(programme.kinds) + 1).astype(int)
    makers = {"hold": _holds, "even": _even, "release": _releases}
    for kind, first, last in zip(programme.kinds, edges[:-1], edges[1:], strict=True):
        if kind in ("multisine", "slow"):
            part = time[first:last] - time[first]
            highest = programme.highest_frequency * (_SLOWER if kind == "slow" else 1.0)
            unit[first:last] = _multisine(random, part, len(low), highest)
        else:
            unit[first:last] = makers[kind](random, last - first, len(low), rate)
    ramp = max(1, round(RAMP * rate))
    kernel = np.ones(ramp) / ramp
    # Smoothed from the past only, so that nothing moves before it is commanded.
    smooth = np.column_stack(
        [np.convolve(np.concatenate([np.full(ramp - 1, u[0]), u]), kernel, "valid") for u in unit.T]
    )
    return time, middle + reach * smooth


def _multisine(random: np.random.Generator, t: Array, inputs: int, highest: float) -> Array:
    """Sums of sines with random phases, others for every input, faded in and out, within -1 to 1."""
    lines = np.geomspace(min(max(1.0 / t[-1], 0.05), highest), highest, _SINES * inputs).reshape(_SINES, inputs)
    phases = random.uniform(0.0, 2.0 * np.pi, lines.shape)
    signal = np.zeros((len(t), inputs))
    for line, phase in zip(lines, phases, strict=True):
        signal += np.sin(2.0 * np.pi * line * t[:, None] + phase)
    fade = np.clip(np.minimum(t, t[-1] - t) / 1.0, 0.0, 1.0)[:, None]
    return np.asarray(fade * signal / np.abs(signal).max(axis=0))


def _holds(random: np.random.Generator, count: int, inputs: int, rate: float) -> Array:
    """Levels held for a while: all inputs together first, then each alone, in random order and of random height."""
    patterns = [np.full(inputs, level) for level in (0.8, -0.6)]
    patterns += [s * np.eye(inputs)[j] for j in random.permutation(inputs) for s in (1.0, -1.0)]
    each = max(1, count // len(patterns))
    unit = np.zeros((count, inputs))
    for k, pattern in enumerate(patterns):
        level = pattern * random.uniform(0.6, 1.0)
        # Held for two thirds, then back to the middle: steps of both signs.
        unit[k * each : k * each + (2 * each) // 3] = level
    return unit


def _even(random: np.random.Generator, count: int, inputs: int, rate: float) -> Array:
    """All inputs together at levels up and down, each held, in an order drawn at random."""
    levels = random.permutation(np.linspace(-1.0, 1.0, 6))
    unit = np.zeros((count, inputs))
    each = max(1, count // (len(levels) + 1))
    for k, level in enumerate(levels):
        unit[k * each : (k + 1) * each] = level
    return unit


def _releases(random: np.random.Generator, count: int, inputs: int, rate: float) -> Array:
    """One side up, held, then let go at once, with time to swing."""
    repeats = max(1, min(4, int(count / rate / 4.0)))
    each = count // repeats
    unit = np.zeros((count, inputs))
    for k in range(repeats):
        unit[k * each : k * each + each // 3] = np.where(random.random(inputs) < 0.5, 1.0, -0.7)
    return unit


def _limits(arm: Arm) -> tuple[Array, Array]:
    """Lowest and highest pressure of each input, Pa: the narrowest of the sections it feeds."""
    low, high = np.zeros(len(arm.inputs)), np.full(len(arm.inputs), np.inf)
    for number, section in enumerate(arm.parameters.sections, start=1):
        for bellows in section.resolved_bellows(number):
            j = arm.inputs.index(bellows.input)
            low[j] = max(low[j], section.pressure_range[0])
            high[j] = min(high[j], section.pressure_range[1])
    return low, high


def _stays_within(arm: Arm, time: Array, pressures: Array) -> bool:
    """Whether the poses that the pressures hold keep within the lengths of the arm, with a tenth to spare outside."""
    every = max(1, len(time) // 200)
    start: Array | None = None
    ranges = np.repeat([s.length_range for s in arm.parameters.sections], 3, axis=0)
    spare = 0.1 * (ranges[:, 1] - ranges[:, 0])
    for row in pressures[::every]:
        try:
            start = arm.static_lengths(row, start=start)
        except ConvergenceError:
            return False
        if np.any(start < ranges[:, 0] - spare) or np.any(start > ranges[:, 1] + spare):
            return False
    return True
