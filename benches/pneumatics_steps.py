"""Pneumatics at control periods of 1 ms: linearly implicit sub-steps in the core against explicit Runge-Kutta steps.

``python benches/pneumatics_steps.py``. The pressure of one bellows of the nominal arm goes up and down a staircase of
commands. Both are compared with an independent implementation of the same equations (``tests/control``), integrated by
LSODA to tight tolerances along the arm's own motion. The valves: the shipped one, and ones of ten and a hundred times
its conductance and a tenth and a hundredth of its spool time, which are stiffer.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import bha
from bha.parameters import ArmParameters

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "control"))
from independent_pneumatics import OneInput

STAIRS = (1.2e5, 2.0e5, 0.8e5, 1.4e5)
SECONDS_A_STAIR = 0.1


def arm_with_valve(factor: float) -> bha.Arm:
    """The nominal arm with a valve that is ``factor`` times as fast."""
    mapping = bha.robots.parameters("bha_nominal").to_mapping()
    air = mapping["pneumatics"]
    mapping["pneumatics"] = air | {
        "level": "full",
        "sonic_conductance": factor * air["sonic_conductance"],
        "spool_time": air["spool_time"] / factor,
    }
    return bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))


def run(arm: bha.Arm, drive: bha.Input, step: float) -> bha.Trajectory:
    return bha.simulate(arm, drive, dt=1e-3, options=bha.Options(method="rk4", step=step, interpolation="hold"))


def errors(arm: bha.Arm) -> tuple[float, float, float, float]:
    """Greatest errors: core at 1 ms (Pa, Pa RMS, m of the lengths), explicit steps of 1 ms (Pa)."""
    times = np.arange(round(len(STAIRS) * SECONDS_A_STAIR / 1e-3) + 1) * 1e-3
    commands = np.array([STAIRS[min(int(t / SECONDS_A_STAIR + 1e-9), len(STAIRS) - 1)] for t in times])
    drive = bha.Input(times, np.repeat(commands[:, None], len(arm.inputs), axis=1))
    coarse, fine = run(arm, drive, 1e-3), run(arm, drive, 2e-5)
    section = arm.parameters.sections[0]
    table = arm.parameters.to_mapping()["pneumatics"]
    alone = OneInput(table, arm.parameters.ambient_pressure, section.terminal_area * sum(section.length_range) / 2)

    def volume(t: float) -> float:
        length = float(np.interp(t, fine.time, fine.lengths[:, 0]))
        return float(table["dead_volume"]) + section.terminal_area * length

    exact = alone.pressures(times, volume, commands, STAIRS[0])
    explicit = alone.explicit_pressures(times, volume, commands, STAIRS[0])
    off: NDArray[np.float64] = coarse.pressures[:, 0] - exact
    lengths = float(np.abs(coarse.lengths - fine.lengths).max())
    by_explicit = float(np.abs(explicit - exact).max()) if np.all(np.isfinite(explicit)) else np.inf
    return float(np.abs(off).max()), float(np.sqrt(np.mean(off**2))), lengths, by_explicit


@click.command(help=__doc__)
def main() -> None:
    table = Table("Valve", title="Greatest errors at a control period of 1 ms")
    for heading in ("core [Pa]", "core, RMS [Pa]", "lengths [µm]", "explicit RK4, 1 ms [Pa]"):
        table.add_column(heading, justify="right")
    for factor in (1, 10, 100):
        worst, rms, lengths, explicit = errors(arm_with_valve(factor))
        by_explicit = f"{explicit:.0f}" if np.isfinite(explicit) else "diverges"
        table.add_row(f"{factor} times as fast", f"{worst:.0f}", f"{rms:.0f}", f"{1e6 * lengths:.0f}", by_explicit)
    Console().print(table)


if __name__ == "__main__":
    main()
