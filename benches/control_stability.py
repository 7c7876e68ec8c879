"""Two hundred random reachable references: no controller diverges or keeps swinging. ``python
benches/control_stability.py``.

Plants have every mass, stiffness and damping off by 10 % at random, full pneumatics and noisy sensors. Each reference
is a fast move between two random poses and a rest of 2 s; at its end the arm must be at rest but for the noise. The
table also says which references saturated some input and how these ended.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import bha
from bha.control import Limits, Reference, Sensors, point_to_point, simulate_closed_loop
from bha.control.cli import CONTROLLERS
from bha.errors import SimulationError

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from closed_loop import off_by

# At rest: no length moves faster than this in the last 0.2 s, m/s. Noise alone stirs up to a third of it.
REST = 0.03


def random_reference(arm: bha.Arm, rng: np.random.Generator) -> Reference:
    """A fast move between two random poses within two thirds of the lengths, and 2 s of rest."""
    limits = Limits.of(arm)
    middle, half = (limits.shortest + limits.longest) / 2, (limits.longest - limits.shortest) / 2
    start, end = middle - 0.15 * half + 0.5 * half * rng.uniform(-1, 1, (2, len(half)))
    return point_to_point(start, end, max_velocity=0.4, max_acceleration=4.0, max_jerk=80.0, rest=2.0)


@click.command(help=__doc__)
@click.option("--count", default=200, show_default=True)
@click.option("--controller", "names", multiple=True, type=click.Choice(list(CONTROLLERS)))
def main(count: int, names: tuple[str, ...]) -> None:
    model = bha.robots.load("bha_nominal").with_changes(pneumatics="full")
    out = Table(title=f"{count} random references on plants off by 10 %")
    headings = (
        "Controller",
        "diverged",
        "not at rest",
        "worst end [m/s]",
        "RMS [mm]",
        "saturated",
        "of these not at rest",
    )
    for heading in headings:
        out.add_column(heading, justify="left" if heading == "Controller" else "right")
    failures = 0
    for name in names or tuple(CONTROLLERS):
        rng = np.random.default_rng(20)
        diverged = swinging = saturated = both = 0
        ends, errors = [], []
        for seed in track(range(count), description=name, transient=True):
            plant, reference = off_by(model, 0.1, seed), random_reference(model, rng)
            sensors = Sensors(length_noise=1e-4, pressure_noise=100.0, seed=seed)
            try:
                run = simulate_closed_loop(plant, CONTROLLERS[name](model), reference, sensors=sensors)
            except SimulationError:
                diverged += 1
                continue
            end = float(np.abs(run.trajectory.velocities[-200:]).max())
            limited = bool(run.saturation())
            ends.append(end)
            errors.append(run.rms_tip_error())
            swinging += end > REST
            saturated += limited
            both += limited and end > REST
        failures += diverged + swinging
        rms = 1e3 * float(np.sqrt(np.mean(np.square(errors))))
        cells = (diverged, swinging, f"{max(ends):.4f}", f"{rms:.1f}", saturated, both)
        out.add_row(name, *map(str, cells))
    Console().print(out)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
