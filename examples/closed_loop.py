"""Six controllers lead an arm they do not know exactly: a circle of the tip and a fast move.

The plant is the nominal arm with every mass, stiffness, bending stiffness and damping off by 10 % (up or down at
random), full pneumatics, noisy sensors, and creep, which the paper names and leaves out. The controllers' model is the
nominal arm; "with creep" means that the effect, once diagnosed, is in the model too, while the 10 % stay wrong; "all
known": a model without any error, which shows what pneumatics and noise leave. Prints a table and writes a figure for
each reference.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

import bha
from bha.control import (
    ClosedLoopRun,
    Controller,
    FeedbackLinearization,
    GravityPd,
    Pid,
    Reference,
    Sensors,
    StaticModel,
    there_and_back,
    tip_circle,
)
from bha.parameters import ArmParameters
from bha.plot import plot_tracking, write_figure

CREEP = [
    {"kind": "creep", "where": f"section {section}", "stiffness": stiffness, "tau": 0.8}
    for section, stiffness in ((1, 260.0), (2, 210.0), (3, 150.0))
]


def off_by(arm: bha.Arm, share: float, seed: int) -> bha.Arm:
    """The arm with masses, stiffnesses and dampings off by a share, each up or down at random."""
    rng = np.random.default_rng(seed)
    mapping = arm.parameters.to_mapping()
    for section in mapping["section"]:
        for name in ("mass", "stiffness", "damping", "bending_stiffness"):
            factor = 1 + share * rng.choice([-1, 1])
            value = section[name]
            section[name] = [factor * v for v in value] if isinstance(value, list) else factor * value
    return bha.Arm.from_parameters(ArmParameters.from_mapping(mapping))


def controllers(model: bha.Arm, creeping: bha.Arm, truth: bha.Arm) -> dict[str, Controller]:
    return {
        # The best of a scan on this very plant: more of any swings. The others have the gains they come with.
        "PID": Pid(model, proportional=1.0, integral=10.0, derivative=0.04),
        "PD + gravity": GravityPd(model),
        "PD + gravity, with creep": GravityPd(creeping),
        "static model": StaticModel(model),
        "static model, with creep": StaticModel(creeping),
        "reduced model": FeedbackLinearization(model, dynamics="reduced"),
        "reduced model, with creep": FeedbackLinearization(creeping, dynamics="reduced"),
        "full model": FeedbackLinearization(model),
        "full model, with creep": FeedbackLinearization(creeping),
        "full model, all known": FeedbackLinearization(truth),
    }


def compare(plant: bha.Arm, laws: dict[str, Controller], reference: Reference) -> dict[str, ClosedLoopRun]:
    sensors = Sensors(length_noise=1e-4, pressure_noise=100.0, seed=1)
    return {name: bha.simulate_closed_loop(plant, law, reference, sensors=sensors) for name, law in laws.items()}


def table(runs: dict[str, ClosedLoopRun], title: str) -> Table:
    """Distance of the tip from its reference, a row a run."""
    out = Table("Controller", "RMS", "Greatest", "At the end", title=f"{title}, mm")
    for name, run in runs.items():
        error = 1e3 * run.tip_error
        out.add_row(name, *(f"{value:.2f}" for value in (1e3 * run.rms_tip_error(), error.max(), error[-100:].mean())))
    return out


@click.command(help=__doc__)
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("out"), show_default=True)
def main(out: Path) -> None:
    model = bha.robots.load("bha_nominal").with_changes(pneumatics="full")
    plant = off_by(model, 0.1, seed=7).with_effects(CREEP)
    laws = controllers(model, model.with_effects(CREEP), plant)
    out.mkdir(parents=True, exist_ok=True)
    console = Console()
    circle = tip_circle(model, 0.12, max_velocity=0.4)
    for kind, title, reference in (
        ("circle", "Circle of the tip, 0.4 m/s", circle),
        ("move", "Fast move there and back", there_and_back(model)),
    ):
        runs = compare(plant, laws, reference)
        console.print(table(runs, title))
        path = write_figure(plot_tracking(runs, title=title), out / f"closed_loop_{kind}.png")
        console.print(f"Written: {path}")


if __name__ == "__main__":
    main()
