"""``bha control``: controllers leading a plant along a reference, compared."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from bha import names
from bha.arm import Arm
from bha.cli.common import (
    arm_argument,
    console,
    json_option,
    load_arm,
    print_json,
    progress_bar,
    reports_errors,
    say,
)
from bha.cli.common import table as new_table
from bha.cli.logs import columns_option, missing_option
from bha.control.controller import Controller
from bha.control.controllers import (
    FeedbackLinearization,
    GravityPd,
    LinearQuadraticRegulator,
    Pid,
    StaticModel,
)
from bha.control.loop import ClosedLoopRun, Sensors, simulate_closed_loop
from bha.control.motions import there_and_back, tip_circle, tip_samples
from bha.control.reach import Reachability, reachability
from bha.control.reference import Reference
from bha.errors import BhaError, InputError, LogWarning, ReferenceWarning, SimulationError
from bha.logs import Log
from bha.parameters import PneumaticsLevel
from bha.recordings.compare import shown_by
from bha.support.files import check_target

CONTROLLERS: dict[str, Callable[[Arm], Controller]] = {
    "pid": Pid,
    "gravity_pd": GravityPd,
    "static": StaticModel,
    "reduced": lambda arm: FeedbackLinearization(arm, dynamics="reduced"),
    "full": FeedbackLinearization,
    "lqr": LinearQuadraticRegulator,
}


#: Inputs at a limit that the table names; ``--json`` has all.
_MOST_NAMED = 3


@click.command()
@arm_argument
@click.option("--plant", "plant_path", metavar="PLANT", help="The arm that moves; ARM itself if left out.")
@click.option("--reference", metavar="circle|move|FILE", default="circle", show_default=True,
              help="A circle of the tip, a fast move there and back, or a log with lengths (q11 ...) or positions of "
                   "the last head (x3 y3 z3), which are smoothed.")  # fmt: skip
@click.option("--radius", type=float,
              help="Radius of the circle [m]; if left out, what ARM can reach well.")  # fmt: skip
@click.option("--speed", type=float, default=0.4, show_default=True, help="Speed of the tip on the circle [m/s].")
@click.option("--controller", "names", multiple=True, type=click.Choice(list(CONTROLLERS)),
              help="May be given several times; all if left out.")  # fmt: skip
@click.option("--pneumatics", type=click.Choice(["ideal", "lag", "full"]),
              help="Level of both arms' pneumatics; what their files say if left out.")  # fmt: skip
@click.option("--length-noise", type=float, default=1e-4, show_default=True, help="Noise of measured lengths [m].")
@click.option("--pressure-noise", type=float, default=100.0, show_default=True, help="Noise of pressures [Pa].")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the noise.")
@click.option("--period", type=float, default=1e-3, show_default=True, help="Control period [s].")
@click.option("--out", metavar="TRAJ", type=click.Path(path_type=Path, dir_okay=False),
              help="Trajectory file of the plant: .parquet, .csv, .csv.gz or .npz; with several controllers one each, "
                   "its name added.")  # fmt: skip
@click.option("--plot", metavar="FIGURE", type=click.Path(path_type=Path, dir_okay=False),
              help="Figure of the tip's errors and paths: .pdf, .svg or .png.")  # fmt: skip
@missing_option
@columns_option
@json_option
@reports_errors
def control(
    arm: Arm,
    plant_path: str | None,
    reference: str,
    radius: float | None,
    speed: float,
    names: tuple[str, ...],
    pneumatics: PneumaticsLevel | None,
    length_noise: float,
    pressure_noise: float,
    seed: int,
    period: float,
    out: Path | None,
    plot: Path | None,
    missing: bool,
    mapping: Path | None,
    as_json: bool,
) -> None:
    """Let controllers whose model is ARM lead a plant along a reference, and compare how they follow.

    ARM and PLANT are parameter files or names of shipped arms. A part of the reference that ARM cannot reach with
    pressures within its pressure_range is named. A controller that fails, or under which the plant diverges, is
    reported with the reason beside the others, and the exit code is then 1.
    """
    check_target(out)  # before the work, lest it be lost
    check_target(plot)
    plant = arm if plant_path is None else load_arm(plant_path)
    if pneumatics is not None:
        arm, plant = (a.with_changes(pneumatics=pneumatics) for a in (arm, plant))
    sensors = Sensors(length_noise, pressure_noise, seed)
    chosen = tuple(dict.fromkeys(names)) or tuple(CONTROLLERS)
    runs: dict[str, ClosedLoopRun] = {}
    failures: dict[str, BhaError] = {}
    with progress_bar(hidden=as_json) as bar:
        task = bar.add_task("reference", total=float(len(chosen)))
        with warnings.catch_warnings():
            # Said below, in the report.
            warnings.simplefilter("ignore", ReferenceWarning)
            target = reference_of(arm, reference, radius, speed, period, missing=missing, mapping=mapping)
        reach = reachability(arm, target)
        for name in chosen:
            bar.update(task, description=name)
            try:
                runs[name] = simulate_closed_loop(plant, CONTROLLERS[name](arm), target, sensors=sensors)
            except BhaError as error:
                failures[name] = error
            bar.advance(task)
    if len(failures) == len(chosen) and all(isinstance(error, InputError) for error in failures.values()):
        # What is wrong is wrong for all.
        raise failures[chosen[0]]
    written = []
    if out is not None:
        several = len(chosen) > 1
        written = [run.trajectory.write(_beside(out, name) if several else out) for name, run in runs.items()]
    if plot is not None and runs:
        from bha.plot import plot_tracking, write_figure  # noqa: PLC0415  (an optional extra)

        written.append(write_figure(plot_tracking(runs, title=f"{plant.name}, led by the model {arm.name}"), plot))
    if as_json:
        print_json(_as_mapping(arm, plant, reach, target, runs, failures) | {"written": written})
    else:
        _report(reach, target, runs, failures, written)
    if failures:
        sys.exit(1)


def _beside(path: Path, name: str) -> Path:
    """``path`` with ``name`` before its extension, which may be double."""
    stem, dot, extension = path.name.partition(".")
    return path.with_name(f"{stem}_{name}{dot}{extension}")


def reference_of(
    arm: Arm,
    kind: str,
    radius: float | None,
    speed: float,
    period: float,
    *,
    missing: bool = False,
    mapping: Path | None = None,
) -> Reference:
    """The reference that the options ask for; of a log with missing samples, where they are allowed, straight lines.

    Raises:
        InputError: neither a kind of reference nor a file, or a file without lengths.
    """
    if kind == "circle":
        return tip_circle(arm, radius, max_velocity=speed, period=period)
    if kind == "move":
        return there_and_back(arm, period=period)
    path = Path(kind)
    if not path.exists():
        raise InputError(f"reference: {kind!r} is neither circle nor move nor a file")
    log = Log.read(path, ambient_pressure=arm.parameters.ambient_pressure, missing=missing, mapping=mapping)
    log = _with_coordinates(arm, log, str(path))
    lengths, heads = (_bridged(log.time, table) for table in shown_by(arm, log, str(path)))
    if np.all(np.isfinite(lengths)):
        return Reference.sampled(log.time, lengths, period=period)
    if np.all(np.isfinite(heads[:, -1])):
        return tip_samples(arm, log.time, heads[:, -1], period=period)
    count = arm.section_count
    raise InputError(
        f"{path}: a reference needs the lengths of all sections of {arm.name} (q11 to q{count}3, or qv11 ...) "
        f"or the positions of the last head (x{count}, y{count}, z{count}); found {', '.join(log.columns)}"
    )


def _bridged(time: NDArray[np.float64], table: NDArray[np.float64]) -> NDArray[np.float64]:
    """A table (m, ...) with straight lines where a column has no value for a while; columns without any stay so."""
    flat = table.reshape(len(table), -1).copy()
    for column in flat.T:
        known = np.isfinite(column)
        if known.any():
            column[~known] = np.interp(time[~known], time[known], column[known])
    return flat.reshape(table.shape)


def _with_coordinates(arm: Arm, log: Log, origin: str) -> Log:
    """A reference whose q11, q12, q13 are wanted coordinates of an arm of other bellows, with their names.

    Such a file cannot mean the lengths of all bellows, for it has three a section; where the arm's file says what its
    lengths are nothing is taken for granted.
    """
    sensors = arm.parameters.sensors
    if sensors is not None and "lengths" in sensors.model_fields_set:
        return log
    renamed: dict[str, str] = {}
    for number, section in enumerate(arm.parameters.sections, start=1):
        three = [names.length_name(number, k) for k in (1, 2, 3)]
        has = [name for k in range(1, 13) if (name := names.length_name(number, k)) in log]
        virtual = [names.coordinate_name(number, k) for k in (1, 2, 3)]
        if len(section.resolved_bellows(number)) > 3 and has == three and not any(name in log for name in virtual):
            renamed |= dict(zip(three, virtual, strict=True))
    if not renamed:
        return log
    warnings.warn(
        f"{origin}: {', '.join(renamed)} are read as the wanted coordinates of {arm.name}, lengths at 0, 120 and 240 "
        f"degrees, for its sections have more than three bellows; name them {', '.join(renamed.values())}",
        LogWarning,
        stacklevel=3,
    )
    columns = {names.column(renamed.get(name, name), log.units[name]): log[name] for name in log.columns}
    return Log.from_arrays(columns, ambient_pressure=arm.parameters.ambient_pressure, origin=origin)


def table(runs: dict[str, ClosedLoopRun], title: str) -> Table:
    """How well each run followed, a row each; at the end: the mean over the last 0.1 s at 1 kHz."""
    headings = ("Controller", "RMS", "Greatest", "At the end", "At a limit")
    out = new_table(*headings, title=f"{title}, mm", running=headings[-1:])
    for name, run in runs.items():
        error = 1e3 * run.tip_error
        cells = (1e3 * run.rms_tip_error(), error.max(), error[-100:].mean())
        shares = sorted(run.saturation().items(), key=lambda pair: -pair[1])
        limited = ", ".join(f"{k} {share:.1%}" for k, share in shares[:_MOST_NAMED])
        limited += f" and {len(shares) - _MOST_NAMED} more" if len(shares) > _MOST_NAMED else ""
        out.add_row(name, *(f"{value:.2f}" for value in cells), limited or "-")
    return out


def _as_mapping(
    arm: Arm,
    plant: Arm,
    reach: Reachability,
    reference: Reference,
    runs: dict[str, ClosedLoopRun],
    failures: dict[str, BhaError],
) -> dict[str, Any]:
    """Results for machines, SI."""
    results: dict[str, Any] = {
        name: {
            "tip_error_rms": run.rms_tip_error(),
            "tip_error_max": run.tip_error.max(),
            "tip_error_end": run.tip_error[-100:].mean(),
            "at_limit": run.saturation(),
        }
        for name, run in runs.items()
    }
    results |= {
        name: {"diverged" if _diverged(error) else "failed": _reason(error)} for name, error in failures.items()
    }
    distance = reach.distance[np.isfinite(reach.distance)]
    return {
        "model": arm.name,
        "plant": plant.name,
        "periods": len(reference),
        "period": reference.period,
        "reachable": float(np.mean(reach.reached)),
        "out_of_reach": None if reach.complete else str(reach),
        "too_fast": reach.too_fast,
        "farthest_at_rest": float(distance.max()) if len(distance) else None,
        "runs": results,
    }


def _diverged(error: BhaError) -> bool:
    """Whether it was the plant, and not the controller, that could not go on."""
    return isinstance(error.__cause__, SimulationError)


def _reason(error: BhaError) -> str:
    """The text without the name of the controller's class: that of the option stands before it."""
    return str(error.__cause__ or error)


def _report(
    reach: Reachability,
    reference: Reference,
    runs: dict[str, ClosedLoopRun],
    failures: dict[str, BhaError],
    written: list[Path],
) -> None:
    """Print the table for people."""
    for warning in (None if reach.complete else str(reach), reach.too_fast):
        if warning is not None:
            say(f"warning: {warning}")
    if runs:
        console().print(
            table(runs, f"Distance of the tip from its reference over {len(reference) * reference.period:.3g} s")
        )
    for name, error in failures.items():
        say(f"{name}: {'the plant diverged' if _diverged(error) else 'failed'}: {_reason(error)}")
    if written:
        say("Written: " + ", ".join(str(path) for path in written))
