"""Held-out logs of another day: what sets whole logs apart is no gap, and hides none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

import bha
from bha.diagnosis.days import day_of, on_days
from bha.diagnosis.decide import GapTest
from bha.diagnosis.fit import Fit
from bha.diagnosis.holdout import in_its_session
from bha.diagnosis.rules import MATERIAL
from bha.diagnosis.sessions import excused, leaves_noise
from bha.estimation.engine import Model
from bha.estimation.free import resolve
from bha.estimation.integration import by
from bha.estimation.records import Window, record

from .synthetic import make_logs, one_section, record_of

if TYPE_CHECKING:
    from bha.diagnosis.refit import Trial

#: By how much each bellows of another day is longer, m.
ANOTHER_DAY = np.array([3e-3, 2e-3, 4e-3])


def of_another_day(log: bha.Log, longer: np.ndarray = ANOTHER_DAY) -> bha.Log:
    """The log with all lengths beside where they were."""
    columns: dict[str, Any] = {"t [s]": log.time}
    columns |= {f"p1{k + 1} [Pa]": log[f"p1{k + 1}"] for k in range(3)}
    columns |= {f"q1{k + 1} [m]": log[f"q1{k + 1}"] + longer[k] for k in range(3)}
    return bha.Log.from_arrays(columns)


@pytest.mark.parametrize("change", [0.0, -0.3])
def test_a_log_of_another_day_is_compared_as_one_of_that_day(change: float) -> None:
    effects = [{"kind": "weak_bellows", "where": "bellows 12", "parameters": {"change": change}}]
    logs = make_logs(one_section(), effects if change else [])
    start = one_section({"mass": 0.93, "stiffness": 1.1, "damping": 1.12})
    found = bha.diagnose(start, logs[:2], [of_another_day(logs[2])], kinds=("creep", "weak_bellows"))
    assert any("sessions that differ" in note for note in found.residual["notes"])
    assert "stand 3.1 mm (RMS) beside" in found.reason or change
    if not change:
        # Bent otherwise than before: another day, or a memory, or a law that does not hold there.
        assert found.verdict == "unexplained"
        assert found.gap.before == pytest.approx(np.sqrt(np.mean(ANOTHER_DAY**2)), rel=0.05)
        # Longer than before: another day.
        longer = of_another_day(logs[2], np.full(3, 3e-3))
        found = bha.diagnose(start, logs[:2], [longer], kinds=("creep", "weak_bellows"))
        assert found.verdict == "equivalent"
        assert "stand 3 mm (RMS) beside" in found.reason
        assert found.gap.before < 1.1 * found.gap.noise
        return
    assert [(e.kind, e.where) for e in found.missing] == [("weak_bellows", "bellows 12")]
    assert found.missing[0].parameters["change"].value == pytest.approx(change, abs=0.03)
    assert found.gap.after < 1.2 * found.gap.noise


@pytest.mark.parametrize(("motion", "off", "known"), [(1.0, 5e-3, True), (0.2, 5e-3, False), (1.0, 0.1, False)])
def test_logs_that_hardly_move_or_stand_far_off_are_excused_by_no_other_day(
    motion: float, off: float, known: bool
) -> None:
    time = 0.1 * np.arange(300)
    swing = 0.01 * np.sin(time)[:, None] + np.full((300, 3), 0.2)
    held = record_of(time, 0.2 + motion * (swing - 0.2) + off, np.full((300, 3), 1e5))
    section = {"bellows": [{"rest_length": 0.2}]}
    trial = SimpleNamespace(
        fit=SimpleNamespace(model=SimpleNamespace(core={"section": [section]})),
        holdout=SimpleNamespace(problem=SimpleNamespace(records=(held,))),
        prediction=SimpleNamespace(outputs=(held.measured - off,)),
    )
    assert excused(cast("Trial", trial), [record_of(time, swing, np.full((300, 3), 1e5))]) == known


def test_outputs_are_as_of_their_day_before_a_model_runs_away() -> None:
    time = 0.1 * np.arange(40)
    rng = np.random.default_rng(2)
    measured = rng.standard_normal((40, 3))
    record = record_of(time, measured, np.full((40, 3), 1e5))
    longer = rng.standard_normal((40, 3, 1))
    shown = measured - ANOTHER_DAY - 2e-3 * longer[..., 0]
    shown[30:] += 1e3
    session = np.concatenate([np.tile(np.eye(3), (40, 1, 1)), longer], axis=2)
    moved = in_its_session(record, shown, 2.95, session)
    assert moved[:30] == pytest.approx(measured[:30], abs=1e-12)
    assert moved[30:] - measured[30:] == pytest.approx(np.full((10, 3), 1e3), abs=1e-9)


def test_the_day_of_a_log_is_found_by_simulating_it() -> None:
    arm = one_section({"damping": 0.3})
    rest = "section.1.rest_length"
    values = {rest: arm.parameters.sections[0].rest_length + 4e-3, "ambient_pressure": 101325.0 - 900.0}
    # Absolute pressures as of every day.
    (log,) = make_logs(arm.with_values(values), [], durations=(8.0,), pressure_noise=0.0)
    seen = record(arm, log)
    model = by(Model(arm.parameters, resolve(arm.parameters, [rest]), (seen,)), step=2.5e-3)
    window = Window(0, 0, len(seen))
    (state,) = model.guesses(np.zeros(1), [window])
    nothing = np.zeros(0)
    day = day_of(Fit(model, np.zeros(1), (state,), (), nothing, 0.0), seen, state)
    assert model.plain[0].value(day.shift[0]) == pytest.approx(values[rest], abs=3e-4)
    assert 2e3 * day.shift[1] == pytest.approx(-900.0, abs=300.0)
    assert "section.1.rest_length +4" in day.text
    # To the first order an arm that swings is another one.
    left = [np.std(seen.measured - shown) for shown in on_days(model, np.zeros(1), [day.state], [day])]
    assert left == pytest.approx([2e-4], rel=0.1)


@pytest.mark.parametrize(
    ("mean_square", "training", "noise"),
    [(1.1, 1.0, True), (1.23, 1.0, False), (1.23, 1.35, True), (1.75, 3.0, False)],
)
def test_a_log_on_its_day_may_be_as_far_from_noise_as_those_of_the_fit(
    mean_square: float, training: float, noise: bool
) -> None:
    gap = GapTest(mean_square, 1.0, 1.12, 1.1, significant=False)
    assert leaves_noise(gap, training, MATERIAL) is noise
    assert not leaves_noise(replace(gap, significant=True), training, MATERIAL)
