"""A real arm, motion by motion and day by day: what a fit predicts of what it has not seen, beside a black box.

Each motion of a day, and each day of January, is left out in turn; the rest is identified and the left-out logs are
predicted from their measured pressures (or from their commands). Beside it stands a ridge regression of the heads on
the same pressures with lags and plays, fitted to the same logs, and the arm's own repeatability. Folds that are done
stand in FOLDER's results and are not done again.

    python -m benches.real_arm --data FOLDER [--out FOLDER] [--model file --model ridge ...]

The logs are those that docs/explanation/estimation.md names; without them there is nothing to do.

Models: ``paper`` is the fit of examples/identify_real_arm.py (linear springs, bending stiffness and damping of each
section, elements that slip, strained as first poses tell), ``constant forces`` the same without these, ``defaults`` is
``bha.identify`` as it stands from a file of a tape measure (benches/tape_measured.py), ``ridge`` the black box, as it
is and shifted to each log's first pose, ``guess`` the shipped guess, ``mean`` the mean pose of the logs.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bha
from benches.ridge import Ridge, fitted_ridge
from benches.tape_measured import tape_measured
from bha.estimation.lags import with_lag
from bha.identification import FreeParameter, Record, identify, predict, record
from bha.recordings import PressureSort

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
import identify_real_arm as example
from real_arm import repeatability

Array = NDArray[np.float64]

#: Motions of a session, by their logs; days of January by theirs. At rest nothing is commanded: left aside.
MOTIONS = {
    "january 10": {
        "both": ("jan10_both_1", "jan10_both_2", "jan10_2_3"),
        "right": ("jan10_right_1", "jan10_right_2", "jan10_right_3", "jan10_5_1", "jan10_5_2"),
        "left": ("jan10_3_1",),
    },
    "april 4": {
        "right": ("apr4_right",),
        "left": ("apr4_left",),
        "section 1": ("apr4_seg1_all",),
        "all": ("apr4_all",),
        "S": ("apr4_4",),
        "section 2": ("apr4_7",),
    },
}
DAYS = {
    "january 4": ("jan4_1",),
    "january 5": ("jan5_3",),
    "january 10": tuple(name for names in MOTIONS["january 10"].values() for name in names),
}
AMBIENT = 101325.0
TIP = 2
#: The first second of a log tells its initial state.
START = 1.0


@dataclass(frozen=True)
class Fold:
    """What is left out of what."""

    group: str
    left_out: str
    fit: tuple[str, ...]
    held: tuple[str, ...]

    @property
    def name(self) -> str:
        """For people and files."""
        return f"{self.group}, {self.left_out} left out"


def folds() -> list[Fold]:
    """Each motion of a session left out of it, each day of January of January."""
    found = []
    for group, motions in (*MOTIONS.items(), ("january, days", DAYS)):
        for left_out, held in motions.items():
            fit = tuple(name for other, names in motions.items() if other != left_out for name in names)
            found.append(Fold(group, left_out, fit, held))
    return found


class Logs:
    """The logs of a folder, read when asked for."""

    def __init__(self, folder: Path) -> None:
        """``folder`` has them as .csv."""
        self._folder = folder
        self._read: dict[str, bha.Log] = {}

    def __getitem__(self, name: str) -> bha.Log:
        """A log by its name."""
        if name not in self._read:
            self._read[name] = bha.Log.read(self._folder / f"{name}.csv", ambient_pressure=AMBIENT)
        return self._read[name]


def tip_errors(arm: bha.Arm, logs: Logs, names: Sequence[str], pressures: PressureSort) -> dict[str, float]:
    """RMS distance of the tip, m, log by log, predicted from its first second; NaN where the simulation fails."""
    found = {}
    for name in names:
        found[name] = predict(arm, [_record(arm, logs, name, pressures).thinned(0.1)])[0]
    return {name: float(one.head_rms[TIP]) for name, one in found.items()}


def _record(arm: bha.Arm, logs: Logs, name: str, pressures: PressureSort) -> Record:
    """A log, all channels weighed alike."""
    return record(arm, logs[name], pressures=pressures, name=name, noise=np.full(6, example.MODEL_ERROR))


def of_the_paper(fold: Fold, logs: Logs, pressures: PressureSort) -> Callable[[str], float]:
    """The fit of the example; under commands with a lag of filling and one of venting."""
    return _of_the_example(fold, logs, pressures, slips=True)


def of_constant_forces(fold: Fold, logs: Logs, pressures: PressureSort) -> Callable[[str], float]:
    """The same without elements that slip: what holds the arm where a log begins holds it all along."""
    return _of_the_example(fold, logs, pressures, slips=False)


def _of_the_example(fold: Fold, logs: Logs, pressures: PressureSort, *, slips: bool) -> Callable[[str], float]:
    start = example.starting_arm("work_conjugate", swapped=False, slips=slips)
    free: list[FreeParameter] = example.free_parameters(start)
    if pressures == "commanded":
        start, lags = with_lag(start, [_record(start, logs, name, pressures) for name in fold.fit])
        free += lags
    records = [_record(start, logs, name, pressures) for name in fold.fit]
    return _of_arm(identify(start, records, free, settings=example.SETTINGS).arm(), logs, pressures)


def of_defaults(fold: Fold, logs: Logs, pressures: PressureSort) -> Callable[[str], float]:
    """``bha.identify`` as it stands, from a tape measure's file."""
    result = identify(tape_measured(), [logs[name] for name in fold.fit], pressures=pressures)
    return _of_arm(result.arm(), logs, pressures)


def of_guess(fold: Fold, logs: Logs, pressures: PressureSort) -> Callable[[str], float]:
    """The shipped guess."""
    return _of_arm(bha.robots.load("asu_two_section"), logs, pressures)


def of_ridge(fold: Fold, logs: Logs, pressures: PressureSort) -> Callable[[str], float]:
    """The black box."""
    model: Ridge = fitted_ridge([logs[name] for name in fold.fit], pressures)
    return lambda name: model.tip_error(logs[name], START)


def of_ridge_from_the_first_pose(fold: Fold, logs: Logs, pressures: PressureSort) -> Callable[[str], float]:
    """The black box, told where each log begins."""
    model: Ridge = fitted_ridge([logs[name] for name in fold.fit], pressures)
    return lambda name: model.tip_error(logs[name], START, from_first_pose=True)


def of_mean(fold: Fold, logs: Logs, pressures: PressureSort) -> Callable[[str], float]:
    """The mean pose."""
    heads = np.vstack([_tip(logs[name]) for name in fold.fit])
    middle = np.nanmean(heads, axis=0)
    return lambda name: float(np.sqrt(np.nanmean(np.sum((_tip(logs[name]) - middle) ** 2, axis=1))))


def _tip(log: bha.Log) -> Array:
    return np.column_stack([log[f"{axis}{TIP}"] for axis in "xyz"])


def _of_arm(arm: bha.Arm, logs: Logs, pressures: PressureSort) -> Callable[[str], float]:
    return lambda name: tip_errors(arm, logs, [name], pressures)[name]


MODELS: dict[str, Callable[[Fold, Logs, PressureSort], Callable[[str], float]]] = {
    "paper": of_the_paper,
    "constant forces": of_constant_forces,
    "defaults": of_defaults,
    "ridge": of_ridge,
    "ridge from the first pose": of_ridge_from_the_first_pose,
    "guess": of_guess,
    "mean": of_mean,
}


def run(fold: Fold, model: str, pressures: PressureSort, logs: Logs, results: Path) -> dict[str, float]:
    """Tip errors of a fold's left-out logs, m; out of ``results`` where they stand there."""
    path = results / f"{model}-{pressures}-{fold.group}-{fold.left_out}.json".replace(" ", "_").replace(",", "")
    if path.is_file():
        done: dict[str, float] = json.loads(path.read_text(encoding="utf-8"))["errors"]
        return done
    began = time.perf_counter()
    error_of = MODELS[model](fold, logs, pressures)
    errors = {name: error_of(name) for name in fold.held}
    seconds = time.perf_counter() - began
    results.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"fold": fold.name, "errors": errors, "seconds": seconds}), encoding="utf-8")
    return errors


def table(found: dict[tuple[str, str], dict[str, dict[str, float]]], models: Sequence[str]) -> str:
    """Median and worst tip error by group and left-out, mm, in Markdown; ``found`` by (group, left out) and model."""
    lines = [f"| | left out | logs | {' | '.join(models)} |", "|---|---|---|" + "---|" * len(models)]
    groups: dict[str, dict[str, list[float]]] = {}
    for (group, left_out), by_model in found.items():
        cells = []
        for model in models:
            values = list(by_model.get(model, {}).values())
            cells.append(_cell(values))
            groups.setdefault(group, {}).setdefault(model, []).extend(values)
        count = max(len(errors) for errors in by_model.values())
        lines.append(f"| {group} | {left_out} | {count} | {' | '.join(cells)} |")
    for group, by_model_values in groups.items():
        cells = [_cell(by_model_values[model]) for model in models]
        lines.append(f"| {group} | **all in turn** | | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(errors: Sequence[float]) -> str:
    """Median, and the worst where there are several, mm."""
    if not errors:
        return "-"
    if not np.all(np.isfinite(errors)):
        return "fails"
    median, worst = 1e3 * float(np.median(errors)), 1e3 * max(errors)
    return f"{median:.1f}" if len(errors) == 1 else f"{median:.1f}, {worst:.1f}"


def main() -> None:
    """Run what is not done yet and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=os.environ.get("BHA_REAL_ARM"), help="or BHA_REAL_ARM")
    parser.add_argument("--out", type=Path, default=Path("out") / "real_arm")
    parser.add_argument("--model", action="append", choices=MODELS, help="several; all if left out")
    parser.add_argument("--pressures", choices=("measured", "commanded"), default="measured")
    parser.add_argument(
        "--group", action="append", choices=[*MOTIONS, "january, days"], help="several; all if left out"
    )
    parser.add_argument("--left-out", action="append", metavar="MOTION", help="of these folds only; several")
    arguments = parser.parse_args()
    every = folds()
    names = {name for fold in every for name in (*fold.fit, *fold.held)}
    data = None if arguments.data is None else Path(arguments.data)
    missing = sorted(names) if data is None else sorted(n for n in names if not (data / f"{n}.csv").is_file())
    if data is None or missing:
        print(f"no logs {', '.join(missing)} in {data}; nothing to do")
        return
    logs, models = Logs(data), arguments.model or list(MODELS)
    spread = repeatability([logs[name] for name in example.REPEATS])
    found: dict[tuple[str, str], dict[str, dict[str, float]]] = {}
    for fold in every:
        if arguments.group and fold.group not in arguments.group:
            continue
        if arguments.left_out and fold.left_out not in arguments.left_out:
            continue
        for model in models:
            errors = run(fold, model, arguments.pressures, logs, arguments.out)
            found.setdefault((fold.group, fold.left_out), {})[model] = errors
            shown = ", ".join(f"{name} {1e3 * error:.1f}" for name, error in errors.items())
            print(f"{fold.name}, {model}: {shown} mm", flush=True)
    print(f"repeatability of the tip: {1e3 * min(spread):.1f} to {1e3 * max(spread):.1f} mm\n")
    print(table(found, models))


if __name__ == "__main__":
    main()
