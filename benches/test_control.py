"""Speed of control: a closed loop in the core, what a Python controller costs more, environments abreast.

Targets: 10 s at 1 kHz with RK4 and observer within 150 ms; a Python controller at most 3 microseconds a step more;
4,096 environments at a million steps of 5 ms a second on two cores. ``python benches/test_control.py`` prints the
processor time of the shortest of some runs, over all threads, which other work on the machine disturbs least.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import bha
from bha.control import FeedbackLinearization, GravityPd, Pid, Reference, Sensors, simulate_closed_loop, tip_circle

ARM = bha.robots.load("bha_nominal")
SENSORS = Sensors(length_noise=1e-4, pressure_noise=100.0)
STEPS = 10_000


def circles() -> Reference:
    """Ten seconds of circles of the tip at 0.4 m/s."""
    found = tip_circle(ARM, 0.12, turns=6.0)
    return Reference(1e-3, found.lengths[:STEPS], found.velocities[:STEPS], found.accelerations[:STEPS])


REFERENCE = circles()


@pytest.mark.parametrize("pneumatics", ["ideal", "full"])
@pytest.mark.parametrize("law", [Pid, GravityPd, FeedbackLinearization])
def test_ten_seconds_at_one_kilohertz(benchmark: Any, law: Any, pneumatics: Any) -> None:
    arm = ARM.with_changes(pneumatics=pneumatics)
    row = f"{law.__name__}, {pneumatics} pneumatics"
    benchmark.extra_info.update(table="10 s closed loop at 1 kHz", row=row, side="core")
    controller = law(arm)
    run = lambda: simulate_closed_loop(arm, controller, REFERENCE, sensors=SENSORS, decimation=10)  # noqa: E731
    benchmark.pedantic(run, rounds=5, warmup_rounds=1)


@pytest.mark.parametrize("who", ["plant alone", "p constant, asked in Python"])
def test_a_controller_in_python(benchmark: Any, who: str) -> None:
    """One that returns at once: less the plant alone, what is left is the price of asking Python, step by step."""
    p0 = np.full(9, 1.2e5)
    q0 = ARM.static_lengths(p0)
    benchmark.extra_info.update(
        table="10 s closed loop at 1 kHz", row=who, side="python" if "Python" in who else "core"
    )

    def controller(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        return p0

    drive = bha.Input.constant(p0, STEPS * 1e-3)

    def run() -> object:
        if who == "plant alone":
            return bha.simulate(ARM, drive, dt=1e-2, method="rk4", step=1e-3, q0=q0)
        return simulate_closed_loop(ARM, controller, REFERENCE, p0=p0, q0=q0, decimation=10)

    benchmark.pedantic(run, rounds=5, warmup_rounds=1)


@pytest.mark.parametrize("pneumatics", ["ideal", "full"])
@pytest.mark.parametrize("method", ["rk4", "symplectic_euler"])
@pytest.mark.parametrize("what", ["fleet", "environments"])
def test_environments_abreast(benchmark: Any, what: str, method: Any, pneumatics: Any) -> None:
    environments = pytest.importorskip("bha.environments")
    count, arm = 4096, ARM.with_changes(pneumatics=pneumatics)
    many = environments.ReachVectorEnv(count, arm, period=5e-3, step=5e-3, method=method)
    many.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.2, 0.2, (count, 9)).astype(np.float32)
    pressures = many._task.pressures(actions)
    step = (lambda: many._fleet.step(pressures, 5e-3)) if what == "fleet" else (lambda: many.step(actions))
    row = f"{what}, {method}, {pneumatics} pneumatics"
    benchmark.extra_info.update(table="4,096 environments, one step of 5 ms each", row=row, side="core")
    benchmark.pedantic(step, rounds=100, warmup_rounds=20)


if __name__ == "__main__":

    class Shortest:
        """Stands in for the fixture of pytest-benchmark."""

        def __init__(self) -> None:
            self.extra_info: dict[str, Any] = {}

        def pedantic(self, run: Any, rounds: int, warmup_rounds: int) -> None:
            for _ in range(min(warmup_rounds, 1)):
                run()
            times = []
            for _ in range(min(rounds, 20)):
                start = time.process_time()
                run()
                times.append(time.process_time() - start)
            print(f"{self.extra_info['row']:55s} {1e3 * min(times):9.3f} ms")

    for level in ("ideal", "full"):
        for kind in (Pid, GravityPd, FeedbackLinearization):
            test_ten_seconds_at_one_kilohertz(Shortest(), kind, level)
    for asked in ("plant alone", "p constant, asked in Python"):
        test_a_controller_in_python(Shortest(), asked)
    for level in ("ideal", "full"):
        for integration in ("rk4", "symplectic_euler"):
            for subject in ("fleet", "environments"):
                test_environments_abreast(Shortest(), subject, integration, level)
