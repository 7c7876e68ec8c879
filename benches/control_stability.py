"""Two hundred random reachable references: no controller diverges or keeps swinging. ``python
benches/control_stability.py``.

Plants have every mass, stiffness and damping off by 10 % at random, full pneumatics and noisy sensors. Each reference
is a fast move between two random poses and a rest of 4 s. A controller limit-cycles where the arm does not come to rest
and its swing in the last second is no smaller than two seconds before; a swing that dies out by the arm's own damping
(time constant 2 s) is counted by itself. The table also says how many references saturated some input, which inputs
these were, and how far from its reference the tip then ended.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.table import Table

import bha
from bha.cli.control import CONTROLLERS
from bha.control import Limits, Reference, Sensors, point_to_point, simulate_closed_loop
from bha.errors import SimulationError

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from closed_loop import off_by

# At rest: the root mean square of the lengths' rates in the last second is below this, m/s. What noise stirs up is.
REST = 0.01


def random_reference(arm: bha.Arm, rng: np.random.Generator) -> Reference:
    """A fast move between two random poses within two thirds of the lengths, and 4 s of rest."""
    limits = Limits.of(arm)
    middle, half = (limits.shortest + limits.longest) / 2, (limits.longest - limits.shortest) / 2
    start, end = middle - 0.15 * half + 0.5 * half * rng.uniform(-1, 1, (2, len(half)))
    return point_to_point(start, end, max_velocity=0.4, max_acceleration=4.0, max_jerk=80.0, rest=4.0)


@click.command(help=__doc__)
@click.option("--count", default=200, show_default=True)
@click.option("--controller", "names", multiple=True, type=click.Choice(list(CONTROLLERS)))
def main(count: int, names: tuple[str, ...]) -> None:
    model = bha.robots.load("bha_nominal").with_changes(pneumatics="full")
    out = Table(title=f"{count} random references on plants off by 10 %")
    headings = (
        "Controller",
        "diverged",
        "limit cycle",
        "dying out",
        "end, RMS [mm/s]",
        "worst",
        "tip, RMS [mm]",
        "saturated",
        "inputs",
        "tip at the end [mm]: saturated",
        "others",
    )
    for heading in map(escape, headings):
        out.add_column(heading, justify="left" if heading == "Controller" else "right")
    failures = 0
    for name in names or tuple(CONTROLLERS):
        rng = np.random.default_rng(20)
        diverged = cycles = decaying = 0
        ends: list[float] = []
        errors: list[float] = []
        last: dict[bool, list[float]] = {True: [], False: []}
        saturated: set[str] = set()
        for seed in track(range(count), description=name, transient=True):
            plant, reference = off_by(model, 0.1, seed), random_reference(model, rng)
            sensors = Sensors(length_noise=1e-4, pressure_noise=100.0, seed=seed)
            try:
                run = simulate_closed_loop(plant, CONTROLLERS[name](model), reference, sensors=sensors)
            except SimulationError:
                diverged += 1
                continue
            rates = run.trajectory.velocities
            end, before = root_mean_square(rates[-1000:]), root_mean_square(rates[-3000:-2000])
            moving = end > REST
            cycles += moving and end > 0.9 * before
            decaying += moving and end <= 0.9 * before
            ends.append(end)
            errors.append(run.rms_tip_error())
            saturated |= run.saturation().keys()
            last[bool(run.saturation())].append(root_mean_square(run.tip_error[-1000:]))
        failures += diverged + cycles
        tips = [f"{1e3 * root_mean_square(np.array(values)):.1f}" if values else "-" for values in last.values()]
        speeds = (f"{1e3 * root_mean_square(np.array(ends)):.1f}", f"{1e3 * max(ends):.1f}")
        rms = f"{1e3 * root_mean_square(np.array(errors)):.1f}"
        at_limits = (len(last[True]), names_of(saturated))
        out.add_row(name, *map(str, (diverged, cycles, decaying, *speeds, rms, *at_limits, *tips)))
    Console(width=160).print(out)
    sys.exit(1 if failures else 0)


def names_of(inputs: set[str]) -> str:
    return ", ".join(sorted(inputs)) or "-"


def root_mean_square(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


if __name__ == "__main__":
    main()
