"""A real two-section arm identified: parameters from nine measured logs, tested on four that took no part.

January (three days) and April are identified each on its own, since the arm was taken apart in between. Free are the
springs, rest length, bending stiffness and damping of each section, how its areas change with length and how much of
its force slips: few numbers carry over to motions that were not fitted, many do not. What holds the arm where a log
begins is told by the log's first pose, for logs that take no part as for the others: in April elements that slip are as
strained as that pose says, and give way once the arm moves on; in January constant forces carry over as well. Prints
the error of each head and axis before and after beside the arm's repeatability, and writes a parameter file for each
session. Takes about two minutes.

FOLDER holds the logs of github.com/ASU-RISE-Lab/4-chamber-softarm-control, converted as
docs/reference/logs.md describes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from real_arm import repeatability
from rich.console import Console
from rich.table import Table

import bha
from bha.identification import FreeParameter, Identification, Record, Settings, identify, record, with_preloads
from bha.parameters import ArmParameters


@dataclass(frozen=True)
class Session:
    """Logs of one day, and whether what holds the arm where they begin gives way: which of both carries over better."""

    fit: tuple[str, ...]
    held_out: tuple[str, ...]
    slips: bool


SESSIONS = {
    "january": Session(
        ("jan4_1", "jan5_3", "jan10_both_1", "jan10_right_1", "jan10_3_1"), ("jan10_both_2", "jan10_right_3"), False
    ),
    "april": Session(("apr4_right", "apr4_all", "apr4_4", "apr4_7"), ("apr4_left", "apr4_seg1_all"), True),
}
REPEATS = ("jan10_right_1", "jan10_right_2", "jan10_right_3")

#: What every channel is taken to be wrong by, m: the model's error, not the cameras'. It weighs all channels alike.
#: 15 mm that last for 1.6 s weigh in rows 0.1 s apart as 60 mm that are others each time.
MODEL_ERROR = 0.06
#: The arm creeps for seconds: rows every 0.1 s and steps of 0.05 s lose nothing (below 0.1 mm against 2.5 ms).
SETTINGS = Settings(
    windows=(None,),
    interval=0.1,
    method="ros2",
    step=0.05,
    huber=float("inf"),
    state_deviation=(1e-3, 5e-3),
    draws=0,
    max_iterations=20,
)


#: Yields of the elements that slip in each bellows, m: less and more than a bend or a stretch.
YIELDS = (4e-3, 15e-3)


def starting_arm(force_model: str, swapped: bool, *, slips: bool = True) -> bha.Arm:
    """The shipped guess with a preload in each section, elements that slip, the damping of something that creeps."""
    mapping = bha.robots.parameters("asu_two_section").to_mapping()
    mapping["force_model"] = force_model
    for section in mapping["section"]:
        section["damping"] = 1000.0
        section["provenance"].pop("damping", None)
        if swapped:
            for bellows in section["bellows"]:
                bellows["input"] = {"p1": "p2", "p2": "p1"}[bellows["input"][:2]] + bellows["input"][2:]
    mapping["effect"] = [{"kind": "effective_area", "where": f"section {k}", "by_length": 0.0} for k in (1, 2)]
    if slips:
        element = {"kind": "hysteresis", "amplitude": 3.0, "sharpness": 1.0}
        mapping["effect"] += [{**element, "where": f"section {k}", "yield": y} for y in YIELDS for k in (1, 2)]
    return bha.Arm(with_preloads(ArmParameters.from_mapping(mapping)))


def free_parameters(arm: bha.Arm) -> list[FreeParameter]:
    """Springs, bending stiffness, areas, what slips, and damping far above that of a metal bellows.

    Damping has a bound: where it may, it makes up for what the arm remembers and is wrong in every other motion.
    """
    free = []
    for section in ("section.1", "section.2"):
        free += [FreeParameter(f"{section}.stiffness.1"), FreeParameter(f"{section}.bending_stiffness.1", lower=1e-3)]
        free += [FreeParameter(f"{section}.damping", upper=3e3)]
    # A chamber of fabric pushes with less area the longer it is.
    slope = {"prior": (0.0, 15.0), "logarithmic": False, "scale": 5.0}
    free += [FreeParameter(f"effect.{k}.by_length", **slope) for k in (1, 2)]
    slipping = [k for k, effect in enumerate(arm.parameters.effects, start=1) if effect.kind == "hysteresis"]
    # Of a stiff section ten times as much slips as of a soft one.
    wide = {"lower": 0.05, "prior": (3.0, 6.0), "logarithmic": True}
    free += [FreeParameter(f"effect.{k}.amplitude", **wide) for k in slipping]
    if slipping:
        # Constant forces hold the arm at its first pose whatever its rest lengths are; what gives way does not.
        rests = [section.rest_length for section in arm.parameters.sections]
        free += [FreeParameter(f"section.{k}.rest_length", prior=(own, 0.02)) for k, own in enumerate(rests, start=1)]
    return free


def read(arm: bha.Arm, folder: Path, names: tuple[str, ...]) -> list[Record]:
    """Records of logs, all channels weighed alike."""
    logs = [(name, bha.Log.read(folder / f"{name}.csv", ambient_pressure=101325.0)) for name in names]
    return [record(arm, log, name=f"{name}.csv", noise=np.full(6, MODEL_ERROR)) for name, log in logs]


def identified(start: bha.Arm, folder: Path, session: Session, console: Console) -> Identification:
    """The arm of one session."""

    def tell(text: str, done: float) -> None:
        console.print(f"  {100 * done:3.0f} % {text}", highlight=False)

    fit, held = read(start, folder, session.fit), read(start, folder, session.held_out)
    return identify(start, fit, free_parameters(start), holdout=held, settings=SETTINGS, progress=tell)


def errors(result: Identification) -> Table:
    """RMS error of each head and axis on the held-out logs, mm."""
    table = Table(title="Held-out logs, RMS error in mm, guess -> identified")
    for heading in ("log", *(f"{axis}{head}" for head in (1, 2) for axis in "xyz"), "head 1", "tip"):
        table.add_column(heading)
    for held in result.held_out:
        pairs = [*zip(held.before.rms, held.after.rms, strict=True)]
        pairs += [(held.before.head_rms[k], held.after.head_rms[k]) for k in (1, 2)]
        table.add_row(held.after.record.name, *(f"{1e3 * a:.1f} -> {1e3 * b:.1f}" for a, b in pairs))
    return table


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--session", "chosen", type=click.Choice(list(SESSIONS)), multiple=True, default=tuple(SESSIONS))
@click.option("--force-model", type=click.Choice(["work_conjugate", "end_force"]), default="work_conjugate")
@click.option("--swap-inputs", is_flag=True, help="Feed section 1 by p11 to p13, as the columns' names suggest.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("out"), show_default=True)
def main(folder: Path, chosen: tuple[str, ...], force_model: str, swap_inputs: bool, out: Path) -> None:
    console = Console(width=150)
    wanted = {name for s in chosen for name in (*SESSIONS[s].fit, *SESSIONS[s].held_out)} | set(REPEATS)
    missing = sorted(name for name in wanted if not (folder / f"{name}.csv").is_file())
    if missing:
        console.print(f"{folder}: no logs {', '.join(missing)}; nothing to do")
        sys.exit(0)
    out.mkdir(parents=True, exist_ok=True)
    floor = repeatability([bha.Log.read(folder / f"{name}.csv") for name in REPEATS])
    spread = f"{1e3 * min(floor):.1f} to {1e3 * max(floor):.1f} mm RMS"
    console.print(f"repeatability of the tip: {spread} ({', '.join(REPEATS)})")
    for name in chosen:
        console.print(f"{name}: {', '.join(SESSIONS[name].fit)}")
        start = starting_arm(force_model, swap_inputs, slips=SESSIONS[name].slips)
        result = identified(start, folder, SESSIONS[name], console)
        outcome = result.refinement.outcome
        console.print(f"{outcome.message} after {outcome.iterations} steps, {result.refinement.seconds:.0f} s")
        console.print(errors(result))
        for warning in result.warnings:
            console.print(f"warning: {warning}", markup=False, highlight=False)
        parameters = result.parameters()
        renamed = parameters.updated({**parameters.to_mapping(), "name": f"asu_two_section_{name}"})
        path = out / f"asu_two_section_{name}.toml"
        renamed.write(path)
        console.print(f"written: {path}")


if __name__ == "__main__":
    main()
