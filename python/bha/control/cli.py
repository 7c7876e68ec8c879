"""``bha control``: controllers leading a plant along a reference, compared."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.table import Table

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
from bha.control.controllers import (
    Controller,
    FeedbackLinearization,
    GravityPd,
    LinearQuadraticRegulator,
    Pid,
    StaticModel,
)
from bha.control.limits import Limits
from bha.control.loop import ClosedLoopRun, Sensors, simulate_closed_loop
from bha.control.references import Reference, point_to_point, tip_circle, tip_samples
from bha.errors import InputError, SimulationError
from bha.files import check_target
from bha.parameters import PneumaticsLevel

CONTROLLERS: dict[str, Callable[[Arm], Controller]] = {
    "pid": Pid,
    "gravity_pd": GravityPd,
    "static": StaticModel,
    "reduced": lambda arm: FeedbackLinearization(arm, dynamics="reduced"),
    "full": FeedbackLinearization,
    "lqr": LinearQuadraticRegulator,
}


@click.command()
@arm_argument
@click.option("--plant", "plant_path", metavar="PLANT", help="The arm that moves; ARM itself if left out.")
@click.option("--reference", metavar="circle|move|FILE", default="circle", show_default=True,
              help="A circle of the tip, a fast move there and back, or a log with lengths (q11 ...) or positions of "
                   "the last head (x3 y3 z3), which are smoothed.")  # fmt: skip
@click.option("--radius", type=float, default=0.12, show_default=True, help="Radius of the circle [m].")
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
              help="Figure of the tip errors: .pdf, .svg or .png.")  # fmt: skip
@json_option
@reports_errors
def control(
    arm: Arm,
    plant_path: str | None,
    reference: str,
    radius: float,
    speed: float,
    names: tuple[str, ...],
    pneumatics: PneumaticsLevel | None,
    length_noise: float,
    pressure_noise: float,
    seed: int,
    period: float,
    out: Path | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Let controllers whose model is ARM lead a plant along a reference, and compare how they follow.

    ARM and PLANT are parameter files or names of shipped arms. A controller under which the plant diverges is reported,
    and the exit code is then 1.
    """
    check_target(out)  # before the work, lest it be lost
    check_target(plot)
    plant = arm if plant_path is None else load_arm(plant_path)
    if pneumatics is not None:
        arm, plant = (a.with_changes(pneumatics=pneumatics) for a in (arm, plant))
    sensors = Sensors(length_noise, pressure_noise, seed)
    chosen = tuple(dict.fromkeys(names)) or tuple(CONTROLLERS)
    runs: dict[str, ClosedLoopRun] = {}
    failures: dict[str, str] = {}
    with progress_bar(hidden=as_json) as bar:
        task = bar.add_task("reference", total=float(len(chosen)))
        target = reference_of(arm, reference, radius, speed, period)
        for name in chosen:
            bar.update(task, description=name)
            try:
                runs[name] = simulate_closed_loop(plant, CONTROLLERS[name](arm), target, sensors=sensors)
            except SimulationError as error:
                failures[name] = str(error)
            bar.advance(task)
    written = []
    if out is not None:
        several = len(chosen) > 1
        written = [run.trajectory.write(_beside(out, name) if several else out) for name, run in runs.items()]
    if plot is not None and runs:
        from bha.plot import plot_tracking, write_figure  # noqa: PLC0415  (an optional extra)

        written.append(write_figure(plot_tracking(runs, title=f"{plant.name}, led by the model {arm.name}"), plot))
    if as_json:
        print_json(_as_mapping(arm, plant, target, runs, failures) | {"written": written})
    else:
        _report(target, runs, failures, written)
    if failures:
        sys.exit(1)


def _beside(path: Path, name: str) -> Path:
    """``path`` with ``name`` before its extension, which may be double."""
    stem, dot, extension = path.name.partition(".")
    return path.with_name(f"{stem}_{name}{dot}{extension}")


def reference_of(arm: Arm, kind: str, radius: float, speed: float, period: float) -> Reference:
    """The reference that the options ask for.

    Raises:
        InputError: neither a kind of reference nor a file, or a file without lengths.
    """
    if kind == "circle":
        return tip_circle(arm, radius, max_velocity=speed, period=period)
    if kind == "move":
        limits = Limits.of(arm)
        middle, half = (limits.shortest + limits.longest) / 2, (limits.longest - limits.shortest) / 2
        bend = np.tile([-0.3, 0.15, 0.15], arm.section_count)
        fast = {"max_velocity": 0.4, "max_acceleration": 4.0, "max_jerk": 80.0}
        start, end = middle - 0.1 * half, middle + (bend - 0.1) * half
        there = point_to_point(start, end, period=period, **fast)
        return there.followed_by(point_to_point(end, start, period=period, **fast))
    path = Path(kind)
    if not path.exists():
        raise InputError(f"reference: {kind!r} is neither circle nor move nor a file")
    from bha.log import Log  # noqa: PLC0415  (units are only loaded where a log is used)

    log = Log.read(path)
    lengths, heads, count = log.lengths, log.head_positions, arm.section_count
    if lengths is not None:
        if lengths.shape[1] != 3 * count:
            raise InputError(
                f"{path}: has lengths of {lengths.shape[1] // 3} sections, {arm.name} has {count}; a reference needs "
                f"those of all, q11 to q{count}3"
            )
        return Reference.sampled(log.time, lengths, period=period)
    if heads is not None and heads.shape[1] == count:
        return tip_samples(arm, log.time, heads[:, -1], period=period)
    raise InputError(
        f"{path}: a reference needs the lengths of all sections (q11 to q{count}3) or the positions of the last head "
        f"(x{count}, y{count}, z{count}); found {', '.join(log.columns)}"
    )


def table(runs: dict[str, ClosedLoopRun], title: str) -> Table:
    """How well each run followed, a row each; at the end: the mean over the last 0.1 s at 1 kHz."""
    headings = ("Controller", "RMS", "Greatest", "At the end", "At a limit")
    out = new_table(*headings, title=f"{title}, mm", running=headings[-1:])
    for name, run in runs.items():
        error = 1e3 * run.tip_error
        cells = (1e3 * run.rms_tip_error(), error.max(), error[-100:].mean())
        limited = ", ".join(f"{k} {share:.1%}" for k, share in run.saturation().items())
        out.add_row(name, *(f"{value:.2f}" for value in cells), limited or "-")
    return out


def _as_mapping(
    arm: Arm, plant: Arm, reference: Reference, runs: dict[str, ClosedLoopRun], failures: dict[str, str]
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
    results |= {name: {"diverged": reason} for name, reason in failures.items()}
    return {
        "model": arm.name,
        "plant": plant.name,
        "periods": len(reference),
        "period": reference.period,
        "runs": results,
    }


def _report(
    reference: Reference, runs: dict[str, ClosedLoopRun], failures: dict[str, str], written: list[Path]
) -> None:
    """Print the table for people."""
    console().print(
        table(runs, f"Distance of the tip from its reference over {len(reference) * reference.period:.3g} s")
    )
    for name, reason in failures.items():
        say(f"{name}: the plant diverged: {reason}")
    if written:
        say("Written: " + ", ".join(str(path) for path in written))
