"""What does the model of a real arm lack? Once with the commanded pressures alone, once with the measured ones.

The two-section arm of identify_real_arm.py. With the commands alone the diagnosis does not see the chambers' pressures;
it has to find that they lag, and how: the measured ones, fitted here beside it, tell. With the measured pressures
it says what is missing beyond. Heads' positions are all that is compared; the model starts from the shipped guess, with
a rest length for each chamber as in identify_real_arm.py. January logs only: the arm was taken apart before April.

FOLDER holds the logs of github.com/ASU-RISE-Lab/4-chamber-softarm-control, converted as
docs/reference/logs.md describes.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from scipy.optimize import least_squares

import bha
from bha.diagnosis import Investigation, Rules, Trial, run
from bha.parameters import ArmParameters

Array = NDArray[np.float64]

TRAIN = ("jan10_both_1", "jan10_right_1", "jan10_right_2")
HELD_OUT = ("jan10_both_2", "jan10_right_3")
AMBIENT = 101325.0
#: Rows come every 1 to 110 ms, and the arm creeps for seconds: means over this time lose nothing and are regular.
INTERVAL = 0.1
#: Fewer effects than usual: every refit of an arm that creeps takes long, and the fourth would be no cause.
RULES = Rules(most=3, tried=(4, 2))


def starting_arm() -> bha.Arm:
    """The shipped guess with the force model that conserves energy and a rest length for each chamber."""
    mapping = bha.robots.parameters("asu_two_section").to_mapping()
    mapping["force_model"] = "work_conjugate"
    for section in mapping["section"]:
        for bellows in section["bellows"]:
            bellows["rest_length"] = section["rest_length"]
    return bha.Arm(ArmParameters.from_mapping(mapping))


def read(arm: bha.Arm, folder: Path, name: str, out: Path, *, commanded: bool) -> bha.Log:
    """Means of a log over ``INTERVAL``: heads and either the commanded or the measured pressures; kept in ``out``."""
    log = bha.Log.read(folder / f"{name}.csv", ambient_pressure=AMBIENT)
    place = np.floor((log.time - log.time[0]) / INTERVAL).astype(np.int64)
    counts = np.bincount(place)
    wanted = [f"pc{p.removeprefix('p')}" if commanded else p for p in arm.inputs]
    heads = [f"{axis}{k}" for k in range(1, arm.section_count + 1) for axis in "xyz"]
    columns = {"t [s]": (np.flatnonzero(counts) + 0.5) * INTERVAL}
    for column in (*wanted, *heads):
        unit = "m" if column in heads else "Pa"
        columns[f"{column} [{unit}]"] = np.bincount(place, log[column])[counts > 0] / counts[counts > 0]
    path = out / f"{name}.csv"
    bha.Log.from_arrays(columns).write(path)
    return bha.Log.read(path)


def measured_lag(arm: bha.Arm, folder: Path) -> tuple[float, float]:
    """Time constants with which the measured pressures follow the commands, s; an offset a sensor, least squares."""
    pairs = []
    for name in (*TRAIN, *HELD_OUT):
        log = bha.Log.read(folder / f"{name}.csv", ambient_pressure=AMBIENT)
        recording = bha.Recording(arm, log, pressures="commanded", warn=False)
        command = recording.drive.pressures.copy()
        # Before the log begins the chambers hold what they hold at its end: nothing but the least pressure.
        command[0] = command[-1]
        pairs.append((recording.drive.time, command, recording.drive_rows, log.pressures(arm.inputs)))

    def errors(z: Array) -> Array:
        parts = []
        fill, vent = np.exp(z)
        for when, command, rows, measured in pairs:
            rest = measured - lagged(when, command, fill, vent)[rows]
            parts.append((rest - rest.mean(axis=0)).ravel())
        return np.concatenate(parts)

    fill, vent = np.exp(least_squares(errors, np.log([0.5, 1.5]), diff_step=1e-3).x)
    return float(fill), float(vent)


def lagged(when: Array, command: Array, fill: float, vent: float) -> Array:
    """Pressures (m, inputs) behind commands that are linear between samples: p' = (u - p) / tau, fill or vent."""
    out = command.copy()
    for row in range(1, len(when)):
        h = when[row] - when[row - 1]
        if h <= 0.0:  # a jump of the command moves nothing yet
            out[row] = out[row - 1]
            continue
        tau = np.where(command[row] > out[row - 1], fill, vent)
        keep, slope = np.exp(-h / tau), (command[row] - command[row - 1]) / h
        out[row] = command[row] - (command[row - 1] - out[row - 1]) * keep - slope * tau * (1.0 - keep)
    return out


def tip_errors(outcome: Investigation, trial: Trial) -> str:
    """RMS error of the tip's position on each held-out log, mm."""
    parts = []
    for name, record, y in zip(HELD_OUT, outcome.holdout.problem.records, trial.prediction.outputs, strict=True):
        distance = np.linalg.norm((y - record.measured)[:, -3:], axis=1)
        parts.append(f"{name} {1e3 * np.sqrt(np.mean(distance**2)):.1f}")
    return ", ".join(parts)


def tell(console: Console, outcome: Investigation) -> None:
    """Verdict, effects, held-out errors, decisions."""
    found = outcome.diagnosis
    console.print(f"verdict: {found.verdict}. {found.reason}")
    best = outcome.best.fit.model.values(outcome.best.fit.x)
    for kind, where in outcome.best.key:
        numbers = [f"{k.split(': ')[1]} {v:.3g}" for k, v in best.items() if k.startswith(f"{kind} at {where}: ")]
        console.print(f"  {kind} at {where}: {', '.join(numbers)}")
    for effect in found.effects:
        for name, n in effect.parameters.items():
            console.print(f"  95 % of {effect.kind} at {effect.where}, {name}: {n.ci95} {n.unit}")
    console.print(
        f"  tip, held out, mm: plain {tip_errors(outcome, outcome.plain)}; best {tip_errors(outcome, outcome.best)}"
    )
    for line in found.candidates[:6]:
        console.print(f"  candidate {line.kind} at {line.where}: score {line.score:.2f}, criterion {line.bic}")
    for note in found.residual["notes"]:
        console.print(f"  {note}")


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--pressures", "chosen", type=click.Choice(["commanded", "measured"]), multiple=True)
@click.option("--threads", type=int, default=None, help="Threads; all cores if left out.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("out"), show_default=True)
def main(folder: Path, chosen: tuple[str, ...], threads: int | None, out: Path) -> None:
    console = Console(width=150, markup=False, highlight=False)
    missing = [name for name in (*TRAIN, *HELD_OUT) if not (folder / f"{name}.csv").is_file()]
    if missing:
        console.print(f"{folder}: no logs {', '.join(missing)}; nothing to do")
        sys.exit(0)
    arm = starting_arm()
    fill, vent = measured_lag(arm, folder)
    console.print(f"measured pressures follow the commands: fill {fill:.2f} s, vent {vent:.2f} s")
    for which in chosen or ("commanded", "measured"):
        commanded = which == "commanded"
        results = out / f"asu_{which}"
        results.mkdir(parents=True, exist_ok=True)
        logs = {name: read(arm, folder, name, results, commanded=commanded) for name in (*TRAIN, *HELD_OUT)}
        begin, last = time.perf_counter(), ""

        def progress(stage: str, share: float | None, begin: float = begin) -> None:
            nonlocal last
            if stage != last:
                console.print(f"  [{time.perf_counter() - begin:4.0f} s] {stage}")
                last = stage

        console.print(f"{which} pressures; training {', '.join(TRAIN)}; held out {', '.join(HELD_OUT)}")
        outcome = run(
            [bha.Recording(arm, logs[name], pressures=which) for name in TRAIN],
            [bha.Recording(arm, logs[name], pressures=which) for name in HELD_OUT],
            threads=threads,
            rules=RULES,
            progress=progress,
        )
        tell(console, outcome)
        outcome.diagnosis.write(results / "diagnosis.json")


if __name__ == "__main__":
    main()
