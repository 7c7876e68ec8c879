"""The paper's tilt (Fig. 12) with the nominal arm, full model against reduced model.

First the pressure of bellows 1 of section 1 rises, then that of all of section 1; sections 2 and 3 are extended to
make the swinging inertia larger. The reduced model leaves out rotational energy and Coriolis forces. Writes the
trajectory of the full model and two figures, and prints how far the models are apart.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

import bha
from bha.plot import plot_errors, plot_trajectories, write_figure

INPUT = Path(__file__).with_name("tilt.csv")


@click.command(help=__doc__)
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("out"), show_default=True)
def main(out: Path) -> None:
    full = bha.robots.load("bha_nominal")
    reduced = full.with_changes(rotational_energy=False, coriolis_forces=False)
    log = bha.Log.read(INPUT)
    trajectories = {"full": bha.simulate(full, log, dt=0.005), "reduced": bha.simulate(reduced, log, dt=0.005)}
    difference = trajectories["reduced"].head_positions - trajectories["full"].head_positions

    table = Table(title="Tilt of section 1: reduced against full model")
    for heading in ("Head", r"Way \[mm]", r"RMS difference \[mm]", r"Greatest \[mm]"):
        table.add_column(heading, justify="right")
    for head in range(full.section_count):
        positions = trajectories["full"].head_positions[:, head]
        way = np.linalg.norm(positions - positions[0], axis=1).max()
        distance = np.linalg.norm(difference[:, head], axis=1)
        figures = (way, np.sqrt(np.mean(distance**2)), distance.max())
        table.add_row(str(head + 1), *(f"{1e3 * figure:.2f}" for figure in figures))

    out.mkdir(parents=True, exist_ok=True)
    written = [
        trajectories["full"].write(out / "tilt.parquet"),
        write_figure(plot_trajectories(trajectories, title="Tilt of section 1, nominal arm"), out / "tilt.png"),
        write_figure(
            plot_errors(
                trajectories["full"].time, {"reduced minus full": difference}, title="Reduced minus full model"
            ),
            out / "tilt_difference.png",
        ),
    ]
    console = Console()
    console.print(table)
    console.print("Written:", ", ".join(str(path) for path in written))


if __name__ == "__main__":
    main()
