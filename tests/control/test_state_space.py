"""The linear system beside the arm's own statics and simulation, near the working point."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import bha
from bha.control import state_space
from bha.errors import InputError, MissingExtraError

control = pytest.importorskip("control", reason="python-control is not installed")

NAMES = ("bha_nominal", "asu_two_section")


def working_point(name: str) -> tuple[bha.Arm, np.ndarray]:  # type: ignore[type-arg]
    arm = bha.robots.load(name)
    return arm, np.linspace(1.2e5, 1.5e5, len(arm.inputs))


@pytest.mark.parametrize("name", NAMES)
def test_what_it_comes_to_in_the_end_is_the_change_of_the_rest(name: str) -> None:
    arm, p = working_point(name)
    system = state_space(arm, p)
    gain = np.real(system.dcgain())
    step = 20.0  # Pa
    for k in range(len(p)):
        change = step * np.eye(len(p))[k]
        below, above = (arm.static_lengths(p + sign * change) for sign in (-0.5, 0.5))
        heads = [arm.forward_kinematics(q)[0].ravel() for q in (below, above)]
        expected = np.concatenate([above - below, heads[1] - heads[0]]) / step
        np.testing.assert_allclose(gain[:, k], expected, rtol=1e-3, atol=1e-4 * np.abs(gain).max())


@pytest.mark.parametrize("name", NAMES)
def test_its_step_is_that_of_the_simulated_arm(name: str) -> None:
    arm, p = working_point(name)
    system = state_space(arm, p)
    time = np.linspace(0.0, 0.5, 251)
    small = 100.0 * np.cos(np.arange(len(p)))
    drive = bha.Input(np.array([0.0, 1.0]), np.stack([p + small] * 2), commanded=False)
    rest = arm.static_lengths(p)
    run = bha.simulate(arm, drive, times=time, q0=rest, options=bha.Options(rtol=1e-9, atol=1e-12))
    answer = control.forced_response(system, time, np.tile(small[:, None], len(time)))
    heads = run.head_positions.reshape(len(time), -1)
    moved = np.hstack([run.lengths - rest, heads - heads[0]])
    np.testing.assert_allclose(answer.outputs.T, moved, atol=5e-3 * np.abs(moved).max())
    assert np.abs(moved).max() > 1e-5


def test_signals_have_the_names_of_logs() -> None:
    arm, p = working_point("bha_nominal")
    system = state_space(arm, p)
    assert system.input_labels == list(arm.inputs)
    assert system.state_labels[:3] + system.state_labels[9:12] == ["q11", "q12", "q13", "qd11", "qd12", "qd13"]
    assert system.output_labels[:2] + system.output_labels[9:12] == ["q11", "q12", "x1", "y1", "z1"]
    assert (system.name, system.dt) == ("bha_nominal", 0)
    assert state_space(*working_point("asu_two_section"), name="mine").state_labels[0] == "qv11"
    np.testing.assert_allclose(system["x3", "p11"].dcgain(), np.real(system.dcgain())[15, 0])


def test_with_a_period_it_is_that_from_sample_to_sample() -> None:
    arm, p = working_point("bha_nominal")
    held = control.c2d(state_space(arm, p), 0.01, method="zoh")
    system = state_space(arm, p, period=0.01)
    assert system.dt == 0.01
    np.testing.assert_allclose(system.A, held.A, atol=1e-9 * np.abs(held.A).max())
    np.testing.assert_allclose(system.B, held.B, atol=1e-9 * np.abs(held.B).max())


def test_what_is_wrong_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, p = working_point("bha_nominal")
    with pytest.raises(InputError, match="p: expected shape"):
        state_space(arm, p[:3])
    with pytest.raises(InputError, match="q: element 0 is NaN"):
        state_space(arm, p, q=np.full(9, np.nan))
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(MissingExtraError, match=r"bha\[control\]"):
        state_space(arm, p)
