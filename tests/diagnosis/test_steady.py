"""Noise where pressures stand still: coloured noise at any rate, and what is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha.estimation.records import Record
from bha.estimation.steady import start_scatter, steady_noise, still

from .synthetic import one_section, record_of, run_of
from .test_heads import OFF

Array = NDArray[np.float64]
RATE, HOLD, COUNT = 10.0, 4.0, 12
TIME = np.arange(int(HOLD * COUNT * RATE)) / RATE
LEVELS = 1.013e5 + np.random.default_rng(5).uniform(0.0, 6e4, (COUNT, 3))
HELD = LEVELS[(TIME / HOLD).astype(int)]


def coloured(rng: np.random.Generator, rows: int, time: float, size: float = 1.0) -> Array:
    """First-order noise of three channels."""
    keep = np.exp(-1.0 / RATE / time)
    noise = rng.standard_normal((rows, 3))
    for row in range(1, rows):
        noise[row] = keep * noise[row - 1] + np.sqrt(1.0 - keep**2) * noise[row]
    return size * noise


def held_logs(count: int = 3) -> list[Record]:
    rng = np.random.default_rng(1)
    made = []
    for _ in range(count):
        pressures = HELD + 100.0 * rng.standard_normal(HELD.shape)
        made.append(record_of(TIME, np.zeros((len(TIME), 3)), pressures, 1e-3, 100.0))
    return made


def test_stillness_comes_a_while_after_the_last_step() -> None:
    quiet = still(held_logs(1)[0])
    since = TIME % HOLD
    assert np.all(quiet[(since > 1.15) & (TIME > HOLD)])
    assert not np.any(quiet[(since < 0.95) & (TIME > HOLD)])


@pytest.mark.parametrize("time", [0.1, 0.3])
def test_coloured_noise_is_seen_at_ten_hertz(time: float) -> None:
    rng = np.random.default_rng(2)
    found = steady_noise(held_logs(), [coloured(rng, len(TIME), time, 1e-3) for _ in range(3)], np.full(3, 1e-3))
    assert found is not None
    assert found.deviation == pytest.approx(1.0, rel=0.15)
    assert found.share * found.time == pytest.approx(time, rel=0.5)


def test_what_is_no_coloured_noise_is_left_as_it_is() -> None:
    rng = np.random.default_rng(3)
    white = [1e-3 * rng.standard_normal((len(TIME), 3)) for _ in range(3)]
    deviations = np.full(3, 1e-3)
    assert steady_noise(held_logs(), white, deviations) is None
    # A vibration, and what dies out after each step: physics, to be named.
    shaken = [w + 2e-3 * np.sin(2.0 * np.pi * 1.3 * TIME + 1.0)[:, None] for w in white]
    assert steady_noise(held_logs(), shaken, deviations) is None
    dying = [w + 2e-2 * np.exp(-(TIME % HOLD) / 0.8)[:, None] * np.sin(9.0 * TIME)[:, None] for w in white]
    assert steady_noise(held_logs(), dying, deviations) is None
    creeping = [w + 5e-3 * np.exp(-(TIME % HOLD) / 1.5)[:, None] for w in white]
    assert steady_noise(held_logs(), creeping, deviations) is None


def test_logs_that_begin_alike_in_different_poses() -> None:
    rng = np.random.default_rng(4)
    shifts = 1e-3 * rng.standard_normal((8, 3))
    logs = [replace(r, measured=r.measured + shift + 1e-4) for r, shift in zip(held_logs(8), shifts, strict=True)]
    found = start_scatter(logs)
    assert found is not None
    expected = np.sqrt(np.mean(np.var(shifts, axis=0, ddof=1)))
    assert found == pytest.approx(np.full(3, expected), rel=0.1)
    assert start_scatter(logs[:2]) is None
    others = [replace(r, drive=r.driven_by(r.drive.pressures + 1e4 * k)) for k, r in enumerate(logs)]
    assert start_scatter(others) is None


@pytest.mark.parametrize("hidden", [False, True])
def test_at_ten_hertz_coloured_noise_is_equivalent_and_creep_is_one(hidden: bool) -> None:
    arm, logs = one_section(), []
    creep = [{"kind": "creep", "where": "all", "parameters": {"stiffness": 250.0, "tau": 1.5}}] if hidden else []
    for number in range(3):
        rng = np.random.default_rng([7, number])
        levels = 1.013e5 + rng.uniform(1e4, 6e4, (COUNT, 3))
        fine = np.arange(int(HOLD * COUNT * 100)) / 100.0
        edge = np.clip((fine % HOLD) / 0.3, 0.0, 1.0)[:, None]
        place = (fine / HOLD).astype(int)
        p = levels[np.maximum(place - 1, 0)] * (1.0 - edge) + levels[place] * edge
        run = run_of(arm, fine, p, creep)
        rows = slice(None, None, 10)
        heads = run.head_positions[rows, 0] + coloured(rng, len(fine[rows]), 0.1, 1e-3)
        columns = {f"p1{k + 1} [Pa]": p[rows, k] + 100.0 * rng.standard_normal(len(heads)) for k in range(3)}
        columns |= {f"{axis}1 [m]": heads[:, k] for k, axis in enumerate("xyz")}
        logs.append(bha.Log.from_arrays({"t [s]": fine[rows], **columns}))
    found = bha.diagnose(one_section(OFF), logs[:2], logs[2:], kinds=("creep", "pressure_offset", "quadratic_damping"))
    if hidden:
        assert [e.kind for e in found.effects] == ["creep"]
    else:
        assert found.verdict == "equivalent"
        assert found.gap.noise == pytest.approx(1e-3, rel=0.2)
