"""Signals during long calls: answered, never lost; and other threads that write to an array while the core computes."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import bha
from bha import _core
from bha.control import Stepper
from bha.errors import SimulationError

ARM = bha.robots.load("bha_nominal")
P = np.full(9, 1.2e5)
Q = np.full(9, 0.19)
X0 = np.r_[Q, 0.0 * Q]

# Each call takes minutes to weeks (or seconds, where memory bounds it) if nothing stops it.
SCRIPT = """
import json, signal, sys
import numpy as np
import bha
import bha.experiments.virtual_arm
from bha import _core
from bha.control import Pid, Stepper, hold, simulate_closed_loop

arm = bha.robots.load("bha_nominal")
P, Q = np.full(9, 1.2e5), np.full(9, 0.19)
X0 = np.r_[Q, 0.0 * Q]
still, ends = np.tile(np.r_[Q, 0.0 * Q, 0.0 * Q], (2, 1)), np.array([0.0, 1e5])
stepper = Stepper(arm, 1e-3)
stepper.reset(P)
fleet = {m: _core.Fleet(arm, 3, Q, P, threads=1, method=m) for m in ("rk4", "symplectic_euler")}
core = json.loads(arm.parameters.to_core_json())
core["section"] = core["section"] * 80
tall = _core.Arm(json.dumps(core))
forever = bha.Input.constant(P, 1e6)
generator = np.random.default_rng(0)
states = 0.9 * np.eye(700) + 1e-3 * generator.random((700, 700))
tip = arm.forward_kinematics(Q)[0][-1]
virtual = bha.experiments.virtual_arm.VirtualArm(arm)._core
calls = {
    "stepper": lambda: stepper.step(P, 1e5),
    "fleet": lambda: fleet["rk4"].step(np.tile(P, (3, 1)), 1e6),
    "fleet, Euler": lambda: fleet["symplectic_euler"].step(np.tile(P, (3, 1)), 1e6),
    "closed loop": lambda: _core.closed_loop(stepper, Pid(arm).build(1e-3), still, 1e5),
    "closed loop of many periods": lambda: simulate_closed_loop(arm, Pid(arm), hold(Q, 200.0)),
    "closed loop in Python": lambda: _core.closed_loop(stepper, lambda t, y: P, still, 1e5),
    "simulation": lambda: bha.simulate(arm, forever, dt=1e5, options=bha.Options(method="rk4")),
    "batch": lambda: bha.simulate_batch([arm] * 3, forever, X0, times=[0.0, 1e6], threads=1),
    "sensitivities": lambda: bha.sensitivities(arm, forever, X0, times=[0.0, 1e6], parameters=["section.1.mass"]),
    "regulator": lambda: _core.linear_quadratic_gain(states, np.ones((700, 9)), np.eye(700), np.eye(9)),
    "rest": lambda: [tall.static_lengths(np.full(9, 1.2e5), start=np.full(720, 0.19)) for _ in range(100)],
    "kinematics": lambda: [arm.forward_kinematics(np.tile(Q, (10**5, 1))) for _ in range(1000)],
    "resolved motion": lambda: _core.resolved_motion(
        arm, np.tile(tip, (10**6, 1)), None, Q, np.full(9, 0.1), np.full(9, 0.3)
    ),
    "virtual arm": lambda: virtual.run(
        _core.Input(ends, np.vstack([P, P])), ends, virtual.rest(P), 0.0 * Q, np.zeros(virtual.creep_states), 1e-3
    ),
}

class Came(Exception): ...

def came(*_):
    raise Came

signal.signal(signal.SIGALRM, came)
for name, call in calls.items():
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    try:
        call()
    except Came:
        print(name, "answered", flush=True)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
stepper.reset(P)
print("stepped", stepper.step(P, 1e-3).shape)
"""


def _run(script: str) -> str:
    command = [sys.executable, "-c", textwrap.dedent(script)]
    ran = subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers as on Unix")
def test_every_long_call_answers_a_signal() -> None:
    lines = _run(SCRIPT).splitlines()
    assert lines[-1] == "stepped (18,)"
    assert len(lines) == 15
    assert all(line.endswith(" answered") for line in lines[:-1]), lines


def test_a_long_call_in_a_thread_leaves_the_interpreter_to_the_others() -> None:
    """The main thread, which Ctrl-C interrupts, goes on while another one steps a plant for weeks."""
    said = _run(
        """
        import os, threading
        import numpy as np, bha
        from bha.control import Stepper
        stepper = Stepper(bha.robots.load("bha_nominal"), 1e-3)
        P = np.full(9, 1.2e5)
        threading.Thread(target=lambda: stepper.step(P, 1e6), daemon=True).start()
        threading.Event().wait(0.1)
        print("here", flush=True)
        os._exit(0)
        """
    )
    assert said == "here\n"


def test_threads_take_turns_with_a_plant() -> None:
    said = _run(
        """
        import threading
        import numpy as np, bha
        from bha.control import Stepper
        stepper = Stepper(bha.robots.load("bha_nominal"), 1e-3)
        P = np.full(9, 1.2e5)
        stepper.reset(P)
        faults = []
        def work(dt):
            try:
                for _ in range(10):
                    stepper.step(P, dt)
                    assert stepper.lengths.shape == (9,)
            except BaseException as error:
                faults.append(error)
        threads = [threading.Thread(target=work, args=(dt,)) for dt in (1e-3, 1.0, 1e-3, 1.0)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        print(faults, round(stepper.time, 9))
        """
    )
    assert said == "[] 20.02\n"


def test_ctrl_c_while_failures_become_exceptions_goes_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """It must not be handed back as the failure of a member."""
    made = SimulationError.__init__

    def interrupted(self: SimulationError, *arguments: Any, **options: Any) -> None:
        made(self, *arguments, **options)
        raise KeyboardInterrupt

    impossible = np.r_[-Q, 0.0 * Q]
    batch = bha.simulate_batch([ARM] * 2, bha.Input.constant(P, 0.1), impossible, times=[0.0, 0.1])
    assert all(isinstance(failure, SimulationError) for failure in batch.failures)
    run = bha.Simulation(ARM, bha.Input.constant(P, 0.1), q0=-Q)
    monkeypatch.setattr(SimulationError, "__init__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        bha.simulate_batch([ARM] * 2, bha.Input.constant(P, 0.1), impossible, times=[0.0, 0.1])
    with pytest.raises(KeyboardInterrupt):
        run.advance([0.1])


@contextmanager
def _spoilt(array: np.ndarray) -> Iterator[list[bool]]:
    """A signal that comes while the core computes, and whose handler writes NaN into ``array``."""
    came: list[bool] = []

    def write(*_: Any) -> None:
        array.fill(np.nan)
        came.append(True)

    before = signal.signal(signal.SIGALRM, write)
    signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
    try:
        yield came
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers as on Unix")
def test_arrays_may_change_while_the_core_computes() -> None:
    """The core has its own copies: another thread's writing changes nothing."""
    drive = bha.Input.constant(P, 5.0)

    def batch(x0: np.ndarray) -> np.ndarray:
        return bha.simulate_batch(ARM, drive, x0, times=[0.0, 5.0], threads=1).lengths

    def sensitive(x0: np.ndarray) -> np.ndarray:
        options = bha.Options(method="rk4", step=1e-3)
        return bha.sensitivities(ARM, drive, x0, times=[0.0, 2.0], initial_state=False, options=options).states

    def fleet(p: np.ndarray) -> np.ndarray:
        plants = _core.Fleet(ARM, len(p), Q, P, step=1e-3, threads=1)
        return plants.step(p, 3.0)[0]

    def stepped(p: np.ndarray) -> np.ndarray:
        plant = Stepper(ARM, 1e-4)
        plant.reset(P)
        return plant.step(p, 5.0)

    for call, good in (
        (batch, np.tile(X0, (16, 1))),
        (sensitive, X0),
        (fleet, np.tile(P, (16, 1))),
        (stepped, P),
    ):
        expected = call(good.copy())
        assert np.isfinite(expected).all()
        given = good.copy()
        with _spoilt(given) as came:
            found = call(given)
            while not came:
                signal.pause()
        assert np.isnan(given).all()
        np.testing.assert_array_equal(found, expected, err_msg=call.__name__)
