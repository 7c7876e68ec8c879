"""Held-out logs of another day: what sets whole logs apart is no gap, and hides none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis.holdout import at_the_mean

from .synthetic import make_logs, one_section, record_of

#: By how much each bellows of another day is longer, m.
ANOTHER_DAY = np.array([3e-3, 2e-3, 4e-3])


def of_another_day(log: bha.Log) -> bha.Log:
    """The log with all lengths beside where they were."""
    columns: dict[str, Any] = {"t [s]": log.time}
    columns |= {f"p1{k + 1} [Pa]": log[f"p1{k + 1}"] for k in range(3)}
    columns |= {f"q1{k + 1} [m]": log[f"q1{k + 1}"] + ANOTHER_DAY[k] for k in range(3)}
    return bha.Log.from_arrays(columns)


@pytest.mark.parametrize("change", [0.0, -0.3])
def test_a_log_of_another_day_is_compared_about_its_mean(change: float) -> None:
    effects = [{"kind": "weak_bellows", "where": "bellows 12", "parameters": {"change": change}}]
    logs = make_logs(one_section(), effects if change else [])
    start = one_section({"mass": 0.93, "stiffness": 1.1, "damping": 1.12})
    found = bha.diagnose(start, logs[:2], [of_another_day(logs[2])], kinds=("creep", "weak_bellows"))
    assert any("sessions that differ" in note for note in found.residual["notes"])
    if not change:
        # Another day, or a law that does not hold there: one log does not tell, and the file misses it.
        assert found.verdict == "unexplained"
        assert "stand 3.1 mm (RMS) beside" in found.reason
        assert found.gap.before == pytest.approx(np.sqrt(np.mean(ANOTHER_DAY**2)), rel=0.05)
        return
    assert [(e.kind, e.where) for e in found.missing] == [("weak_bellows", "bellows 12")]
    assert found.missing[0].parameters["change"].value == pytest.approx(change, abs=0.03)
    assert found.gap.after < 1.2 * found.gap.noise


def test_outputs_are_moved_by_the_mean_of_their_errors_before_a_model_runs_away() -> None:
    time = 0.1 * np.arange(40)
    rng = np.random.default_rng(2)
    measured = rng.standard_normal((40, 3))
    record = record_of(time, measured, np.full((40, 3), 1e5))
    shown = measured - ANOTHER_DAY
    shown[30:] += 1e3
    moved = at_the_mean(record, shown, 2.95)
    assert moved[:30] == pytest.approx(measured[:30], abs=1e-12)
    assert moved[30:] - shown[30:] == pytest.approx(np.tile(ANOTHER_DAY, (10, 1)), abs=1e-9)
