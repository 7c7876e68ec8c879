"""Held-out logs that go where those of the fit have not been say nothing there, of any model."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis import extrapolation

from .synthetic import SAMPLE_TIME, one_section, pressures, simulated

ARM, STATED = one_section({"damping": 2.0}), one_section({"mass": 0.95, "damping": 2.1})


def log_of(reach: float, beyond: float, seed: int) -> bha.Log:
    """Eight seconds of slow steps, ``reach`` of a usual log's, in the last three ``beyond``."""
    rng = np.random.default_rng(seed)
    time = np.arange(1601) * SAMPLE_TIME
    scale = np.where(time < 5.0, reach, beyond)[:, None]
    p = 101325.0 + 1.5e4 + scale * (pressures(time, "steps", rng) - 101325.0 - 1.5e4)
    q = simulated(HARD, time, p, []) + 2e-4 * rng.standard_normal((len(time), 3))
    columns: dict[str, Any] = {"t [s]": time}
    columns |= {f"p1{k + 1} [Pa]": p[:, k] for k in range(3)}
    columns |= {f"q1{k + 1} [m]": q[:, k] for k in range(3)}
    return bha.Log.from_arrays(columns)


def hard() -> bha.Arm:
    """With two and a half times the springs' curvature that the file states."""
    mapping = ARM.parameters.to_mapping()
    stiffness = mapping["section"][0]["stiffness"]
    mapping["section"][0]["stiffness"] = [stiffness[0], 2.5 * stiffness[1], 2.5 * stiffness[2]]
    return bha.Arm(type(ARM.parameters).from_mapping(mapping))


HARD = hard()


def test_a_stretch_that_was_not_fitted_counts_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    logs = [log_of(0.25, 0.25, 1), log_of(0.25, 0.25, 2), log_of(0.25, 1.5, 3)]
    found = bha.diagnose(STATED, logs[:2], logs[2:], kinds=("quadratic_damping",))
    assert found.verdict == "equivalent"
    assert found.gap.before < 1.1 * found.gap.noise
    text = re.search(r"not counted, .* there: <arrays> from ([\d.]+) s to ([\d.]+) s", found.reason)
    assert text is not None
    assert [float(t) for t in text.groups()] == pytest.approx([5.0, 8.0], abs=0.5)
    # It was no small matter.
    monkeypatch.setattr(extrapolation, "OPEN", np.inf)
    whole = bha.diagnose(STATED, logs[:2], logs[2:], kinds=("quadratic_damping",))
    assert whole.gap.before > 2.0 * found.gap.before
    assert "not counted" not in whole.reason
