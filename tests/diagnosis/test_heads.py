"""The workflow where only head positions are measured: an arm that swings, and one so damped that it creeps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import bha

from .synthetic import one_section, pressures, run_of

Array = NDArray[np.float64]
OFF = {"mass": 0.93, "stiffness": 1.1, "rest_length": 0.95, "damping": 1.12, "bending_stiffness": 1.1}
KINDS = ("pressure_lag", "weak_bellows", "quadratic_damping")


def log_of_heads(
    arm: bha.Arm, time: Array, p: Array, run: bha.Trajectory, seed: int, noise: float, prefix: str = "p"
) -> bha.Log:
    """A log of head positions with noise, and of the pressures ``p``, which have noise too unless they are commands."""
    rng = np.random.default_rng([seed, 9])
    if prefix == "p":
        p = p + 100.0 * rng.standard_normal(p.shape)
    heads = run.head_positions + noise * rng.standard_normal(run.head_positions.shape)
    columns: dict[str, Any] = {"t [s]": time}
    columns |= {f"{prefix}{name.removeprefix('p')} [Pa]": p[:, k] for k, name in enumerate(arm.inputs)}
    columns |= {f"{a}{i + 1} [m]": heads[:, i, k] for i in range(heads.shape[1]) for k, a in enumerate("xyz")}
    return bha.Log.from_arrays(columns)


def test_a_hidden_lag_is_named_from_heads_alone() -> None:
    arm = one_section()
    hidden = {"kind": "pressure_lag", "where": "all", "parameters": {"fill": 0.12, "vent": 0.25}}
    logs = []
    for number in range(3):
        time = np.arange(801) * 5e-3
        kind = "multisine" if number == 1 else "steps"
        p = pressures(time, kind, np.random.default_rng([4, number]), len(arm.inputs))
        run = run_of(arm, time, p, [hidden])
        logs.append(log_of_heads(arm, time, p, run, number, 2e-4))
    found = bha.diagnose(one_section(OFF), logs[:2], logs[2:], kinds=KINDS)
    assert found.verdict == "named"
    assert [(e.kind, e.where) for e in found.effects] == [("pressure_lag", "all")]
    assert found.effects[0].parameters["fill"].value == pytest.approx(0.12, rel=0.1)
    assert found.effects[0].parameters["vent"].value == pytest.approx(0.25, rel=0.1)
    assert found.gap.after < 0.2 * found.gap.before


def test_a_lag_between_command_and_chamber_is_told_in_an_arm_that_creeps() -> None:
    # Damped a hundred times as much as it weighs, and its file knows the damping to a factor of twenty only. The first
    # step of every log comes with its first row, so that the chambers begin elsewhere than the commands.
    arm = one_section({"damping": 100.0})
    hidden = {"kind": "pressure_lag", "where": "all", "parameters": {"fill": 0.5, "vent": 1.5}}
    rng = np.random.default_rng(2)
    logs = []
    for number in range(3):
        time = np.arange(961) * 0.025
        levels = 101325.0 + np.array([[5e3] * 3, *rng.uniform(1e4, 6e4, (3, 3))])
        levels[2] = levels[0]
        # Ten seconds before the log begins are there for the arm alone.
        before = np.arange(401) * 0.025
        whole = np.concatenate([before, 10.0 + time[1:]])
        p = levels[np.minimum(np.searchsorted([10.0, 18.0, 26.0], whole, side="right"), 3)]
        run = run_of(arm, whole, p, [hidden], bha.Options(method="ros2", step=5e-3, interpolation="hold"))
        logs.append(cut(log_of_heads(arm, whole, p, run, number, 1e-4, prefix="pc"), 10.0))
    product = one_section({**OFF, "damping": 5.0})
    found = bha.diagnose(product, logs[:2], logs[2:], kinds=KINDS, pressures="commanded")
    # Three times as long one way as the other is a finding; on an arm that does not swing it is the class.
    assert found.verdict == "one_of"
    assert [(e.kind, e.where, e.plain) for e in found.effects] == [("pressure_lag", "all", False)]
    assert found.effects[0].parameters["fill"].value == pytest.approx(0.5, rel=0.1)
    assert found.effects[0].parameters["vent"].value == pytest.approx(1.5, rel=0.1)
    assert found.gap.after < 1.1 * found.gap.noise < found.gap.before
    assert any("rests under its commands" in note for note in found.residual["notes"])


def cut(log: bha.Log, start: float) -> bha.Log:
    """The log from ``start`` on."""
    return log.between(start, float(log.time[-1]))
