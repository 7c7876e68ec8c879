"""Pressures that are read at 25 Hz and move meanwhile: what a curve through the readings misses is no gap."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bha

from .synthetic import SAMPLE_TIME, one_section, pressures, simulated
from .test_heads import OFF

KINDS = ("creep", "pressure_lag", "quadratic_damping")
CREEP = {"kind": "creep", "where": "all", "parameters": {"stiffness": 120.0, "tau": 1.5}}


def logs_of_slow_pressures(effects: list[dict[str, Any]], held: bool) -> list[bha.Log]:
    """Logs whose pressures are read at 25 Hz: held in rows at 100 Hz, or in rows of their own rate."""
    arm, logs = one_section(), []
    for number in range(3):
        rng = np.random.default_rng([1, number, 9])
        time = np.arange(1601) * SAMPLE_TIME
        p = pressures(time, "multisine" if number == 1 else "steps", np.random.default_rng([1, number]))
        q = simulated(arm, time, p, effects) + 2e-4 * rng.standard_normal((len(time), 3))
        read = (p + 50.0 * rng.standard_normal(p.shape))[np.arange(len(time)) // 8 * 8]
        rows = slice(None, None, 2 if held else 8)
        columns = {f"p1{k + 1} [Pa]": read[rows, k] for k in range(3)} | {
            f"q1{k + 1} [m]": q[rows, k] for k in range(3)
        }
        logs.append(bha.Log.from_arrays({"t [s]": time[rows], **columns}))
    return logs


@pytest.mark.parametrize("held", [True, False])
def test_what_readings_leave_open_is_equivalent(held: bool) -> None:
    logs = logs_of_slow_pressures([], held)
    found = bha.diagnose(one_section(OFF), logs[:2], logs[2:], kinds=KINDS)
    assert found.verdict == "equivalent"
    assert found.gap.before > 1.2 * 2e-4  # more than the sensors alone
    assert any("between their readings" in text for text in found.residual["notes"])


def test_creep_is_named_all_the_same() -> None:
    logs = logs_of_slow_pressures([CREEP], held=True)
    found = bha.diagnose(one_section(OFF), logs[:2], logs[2:], kinds=KINDS)
    assert [(e.kind, e.where) for e in found.effects] == [("creep", "all")]
