"""Kinds beside those they are easily taken for: each is named for itself, with its number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bha

from .synthetic import make_logs, one_section, pressures, run_of

PRODUCT = one_section({"mass": 0.93, "stiffness": 1.1, "rest_length": 0.9, "damping": 1.12, "bending_stiffness": 1.1})
DURATIONS = (4.0, 4.0, 4.0)
CASES: list[tuple[str, str, str, float, tuple[str, ...]]] = [
    ("leak", "input p12", "drop", 3e3, ("leak", "pressure_gain", "pressure_offset", "weak_bellows")),
    ("wire_backlash", "bellows 13", "play", 2e-3, ("wire_backlash", "length_gain", "length_offset", "hysteresis")),
    ("delay", "input p11", "time", 0.03, ("delay", "pressure_lag", "valve_dead_band")),
    ("pressure_stiffness", "section 1", "bending", 1e-5, ("pressure_stiffness", "effective_area", "bending_nonlinear")),
]


@pytest.mark.parametrize(("kind", "where", "number", "value", "kinds"), CASES, ids=[case[0] for case in CASES])
def test_each_is_named_among_its_likes(
    kind: str, where: str, number: str, value: float, kinds: tuple[str, ...]
) -> None:
    hidden = {"kind": kind, "where": where, "parameters": {number: value}}
    logs = make_logs(one_section(), [hidden], seed=8, durations=DURATIONS)
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=kinds)
    assert [e.kind for e in found.effects] == [kind]
    assert found.effects[0].parameters[number].value == pytest.approx(value, rel=0.1)
    assert found.gap.after < 1.2 * found.gap.noise


def test_the_latency_of_a_camera_is_told_from_a_delay_where_lengths_are_measured_too() -> None:
    arm, late = one_section(), {"kind": "delay", "where": "heads", "parameters": {"time": 0.04}}
    logs = []
    for number in range(3):
        rng = np.random.default_rng([9, number])
        time = np.arange(801) * 5e-3
        p = pressures(time, "multisine" if number % 2 else "steps", rng)
        run = run_of(arm, time, p, [late])
        assert run.measured_head_positions is not None
        columns: dict[str, Any] = {"t [s]": time} | {f"p1{k + 1} [Pa]": p[:, k] for k in range(3)}
        noise = 2e-4 * rng.standard_normal((2, len(time), 3))
        columns |= {f"q1{k + 1} [m]": run.lengths[:, k] + noise[0, :, k] for k in range(3)}
        columns |= {f"{a}1 [m]": run.measured_head_positions[:, 0, k] + noise[1, :, k] for k, a in enumerate("xyz")}
        logs.append(bha.Log.from_arrays(columns))
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=("delay", "marker_offset", "pressure_lag"))
    assert [(e.kind, e.where) for e in found.effects] == [("delay", "heads")]
    assert found.effects[0].parameters["time"].value == pytest.approx(0.04, abs=2e-3)
