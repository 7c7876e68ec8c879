"""Any arm by default settings: how fast and how exactly, beside what was done by hand; one core, in one process.

    python -m benches.stiff [seconds]

Logs of 100 Hz: slow sines of pressure with sensor noise. Every shipped arm, and a light one of one section with four
bellows, 0.43 kg, 50 N/m and 3 N s/m a bellows. Errors are the greatest difference of any length from a run whose
tolerance is 1,000 times tighter.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import bha
from bha.parameters import ArmParameters

LIGHT = {
    "schema": "bha-arm/1",
    "name": "light_four_column",
    "gravity": [0.0, 0.0, 9.81],
    "ambient_pressure": 101325.0,
    "section": [
        {
            "mass": 0.43,
            "center_of_mass": [0.0, 0.0, 0.0],
            "bellows_radius": 0.04,
            "bellows_outer_radius": 0.02,
            "terminal_area": 2.0e-4,
            "rest_length": 0.29,
            "stiffness": [50.0],
            "damping": 3.0,
            "bending_stiffness": [0.15],
            "length_range": [0.15, 0.6],
            "pressure_range": [101325.0, 131325.0],
            "bellows": [
                {"angle_deg": angle, "input": f"p1{k + 1}"} for k, angle in enumerate((0.0, 90.0, 180.0, 270.0))
            ],
        }
    ],
}


EFFECTS = [
    {"kind": "hysteresis", "where": "all", "amplitude": 3.0, "yield": 2e-3},
    {"kind": "creep", "where": "all", "stiffness": 120.0, "tau": 0.4},
    {"kind": "friction", "where": "all", "coulomb_force": 0.5},
    {"kind": "pressure_lag", "where": "all", "fill": 0.05, "vent": 0.1},
]


def arms() -> dict[str, bha.Arm]:
    """The shipped arms and the light one."""
    shipped = ("bha_nominal", "asu_two_section", "asu_two_section_january", "asu_two_section_april")
    return {name: bha.robots.load(name) for name in shipped} | {LIGHT["name"]: light()}


def light(level: str = "ideal") -> bha.Arm:
    """The light arm, with pneumatics of a level."""
    valves = bha.robots.parameters("bha_nominal").to_mapping()["pneumatics"]
    air = {} if level == "ideal" else {"pneumatics": {**valves, "level": level}}
    return bha.Arm(ArmParameters.from_mapping({**LIGHT, **air}))


def drive(arm: bha.Arm, duration: float) -> bha.Input:
    """Sines of 0.3 to 0.7 Hz with 100 Pa of noise."""
    t = np.arange(0.0, duration, 0.01)
    n = len(arm.inputs)
    span = 0.06 if arm.name == LIGHT["name"] else 0.4
    rate = 2.0 * np.pi * np.linspace(0.3, 0.7, n)
    clean = 101325.0 + 1e5 * span * (0.5 - 0.5 * np.cos(np.multiply.outer(t, rate)))
    return bha.Input(t, clean + np.random.default_rng(1).normal(0.0, 100.0, clean.shape).clip(-300, 300))


def timed(call: Callable[[], Any], rounds: int = 2) -> tuple[float, Any]:
    """Seconds of the processor, the least of some rounds, and the result."""
    best, result = np.inf, None
    for _ in range(rounds):
        begin = time.process_time()
        result = call()
        best = min(best, time.process_time() - begin)
    return best, result


def single(duration: float) -> Table:
    """Single runs with default settings, beside methods by name."""
    out = Table(
        "arm", "settings", "times real time", "steps/s", "error [um]", title=f"{duration:g} s at 100 Hz, one run"
    )
    for name, arm in arms().items():
        source = drive(arm, duration)
        short = bha.Input(source.time[:500], source.pressures[:500])
        exact = bha.simulate(arm, short, options=bha.Options("rodas4", rtol=1e-9, atol=1e-11))
        ratio = {}
        for settings in ({}, {"method": "dopri5"}, {"method": "rodas4"}, {"method": "ros2", "step": 1e-3}):
            # What is slow is measured over less.
            slow = settings.get("method") == "dopri5" and bha.Simulation(arm, source).method == "rodas4"
            part = short if slow else source
            seconds, run = timed(partial(bha.simulate, arm, part, **settings))
            reached = part.time[-1] / seconds
            rows = min(len(exact), len(run))
            error = np.abs(run.lengths[:rows] - exact.lengths[:rows])[: len(short.time) - 10].max()
            label = "default" if not settings else " ".join(map(str, settings.values()))
            ratio[label] = reached
            steps = run.statistics["steps"] / part.time[-1]
            out.add_row(name, label, f"{reached:.0f}", f"{steps:.0f}", f"{1e6 * error:.4f}")
        out.add_row(name, "default / dopri5", f"{ratio['default'] / ratio['dopri5']:.2f}")
    return out


def abreast(duration: float, count: int = 32) -> Table:
    """Batches on one core: members that differ a little, one sequence of steps."""
    out = Table(
        "arm", "pneumatics, effects", "settings", "times real time a core", "steps/s", title=f"{count} members abreast"
    )
    nominal = bha.robots.load("bha_nominal")
    cases = [(name, "ideal", arm) for name, arm in arms().items()]
    cases += [(LIGHT["name"], level, light(level)) for level in ("lag", "full")]
    january = bha.robots.load("asu_two_section_january")
    cases += [("asu_two_section_january", "effects", january.with_effects(EFFECTS))]
    cases += [("bha_nominal", "effects", nominal.with_effects(EFFECTS))]
    cases += [("bha_nominal", level, nominal.with_changes(pneumatics=level)) for level in ("lag", "full")]
    for name, level, arm in cases:
        source = drive(arm, duration)
        weight = arm.parameters.gravity[2]
        members = [arm.with_changes(gravity=[1e-3 * k * weight, 0.0, weight]) for k in range(count)]
        for settings in ({}, {"shared_steps": True}, {"method": "ros2", "step": 2e-3}):
            call = partial(bha.simulate_batch, members, source, threads=1, velocities=False, **settings)
            seconds, batch = timed(call)
            label = "default" if not settings else " ".join(map(str, settings.values()))
            label = "shared steps" if "shared_steps" in settings else label
            failed = sum(f is not None for f in batch.failures)
            speed = f"{count * source.time[-1] / seconds:.0f}" + (f" ({failed} failed)" if failed else "")
            out.add_row(name, level, label, speed, f"{batch.statistics[0, 0] / source.time[-1]:.0f}")
    return out


def main() -> None:
    """Print both tables."""
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 120.0
    console = Console(width=120)
    console.print(single(duration))
    console.print(abreast(duration / 4))


if __name__ == "__main__":
    main()
