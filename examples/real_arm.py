"""A real two-section arm, replayed: simulate its logs from the measured pressures and compare the head positions.

Prints the error per head and axis beside the arm's repeatability (how far repeats of the same commands differ) and
writes a figure for each log. The logs are those of github.com/ASU-RISE-Lab/4-chamber-softarm-control, converted as
docs/reference/logs.md describes. The arm file is geometry and guesses: what identification has to improve.
"""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import bha
from bha.plot import plot_errors, write_figure

Array = NDArray[np.float64]


def replay(arm: bha.Arm, log: bha.Log) -> Array:
    """Simulated minus measured head positions (m, heads, 3), m."""
    measured = log.head_positions
    assert measured is not None
    return np.asarray(bha.simulate(arm, log, times=log.time).head_positions - measured)


def distance(a: tuple[Array, Array], b: tuple[Array, Array], shift: float) -> float:
    """RMS distance of two tracks (time, positions), m, where they overlap with ``b`` moved by ``shift`` s."""
    time = b[0] + shift
    common = a[0][(a[0] >= time[0]) & (a[0] <= time[-1])]
    if len(common) < len(a[0]) / 2:
        return float("inf")
    squares = sum((np.interp(common, a[0], a[1][:, k]) - np.interp(common, time, b[1][:, k])) ** 2 for k in range(3))
    return float(np.sqrt(np.mean(squares)))


def repeatability(logs: list[bha.Log]) -> list[float]:
    """RMS distance of the last head between each two repeats, m. Their clocks are shifted to fit, as starts differ."""
    tracks = []
    for log in logs:
        assert log.head_positions is not None
        tracks.append((log.time, log.head_positions[:, -1]))
    shifts = np.arange(-15.0, 15.0, 0.05)
    return [min(distance(a, b, shift) for shift in shifts) for a, b in combinations(tracks, 2)]


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("--arm", "arm_file", default=None, help="Parameter file; the shipped asu_two_section if left out.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("out"), show_default=True)
def main(folder: Path, arm_file: str | None, out: Path) -> None:
    arm = bha.Arm.load(arm_file) if arm_file else bha.robots.load("asu_two_section")
    logs = {path.stem: bha.Log.read(path) for path in sorted(folder.glob("*.csv"))}
    repeats = [log for name, log in logs.items() if name.startswith("jan10_right")]
    floor = repeatability(repeats)

    table = Table("Log", "Head", "x", "y", "z", "distance", title=r"Simulated minus measured, RMS \[mm]")
    out.mkdir(parents=True, exist_ok=True)
    for name, log in logs.items():
        errors = replay(arm, log)
        for head in range(errors.shape[1]):
            rms = np.sqrt(np.mean(errors[:, head] ** 2, axis=0))
            cells = [f"{1e3 * value:.1f}" for value in (*rms, np.linalg.norm(rms))]
            table.add_row(name if head == 0 else "", str(head + 1), *cells)
        figure = plot_errors(log.time, {"simulated minus measured": errors}, repeatability=max(floor), title=name)
        write_figure(figure, out / f"{name}_errors.png")
    console = Console()
    console.print(table)
    console.print(f"Repeatability of the last head: {', '.join(f'{1e3 * value:.1f}' for value in floor)} mm RMS")


if __name__ == "__main__":
    main()
