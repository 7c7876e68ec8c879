"""``bha simulate``: an arm driven by the pressures of a log, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, get_args

import click
import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.cli.common import arm_argument, console, json_option, print_json, progress_bar, reports_errors, say, table
from bha.cli.logs import columns_option, missing_option, pressures_option
from bha.logs import Log
from bha.recordings import PressureSort, Recording
from bha.recordings.beginning import TAKEN, begins
from bha.recordings.ranges import LengthExtremes
from bha.runs.input import Interpolation
from bha.runs.options import Method, Options
from bha.runs.rows import output_times
from bha.runs.simulation import CHUNK_ROWS, Simulation, concatenate
from bha.runs.trajectory import Trajectory, TrajectoryWriter
from bha.support.files import check_target

#: Rows that a figure gets at the most; more cannot be told apart.
FIGURE_ROWS = 4000


@click.command()
@arm_argument
@click.option("--input", "input_path", metavar="LOG", required=True, type=click.Path(path_type=Path),
              help="Log with pressures (CSV, CSV.gz or Parquet).")  # fmt: skip
@click.option("--out", metavar="TRAJ", type=click.Path(path_type=Path, dir_okay=False),
              help="Trajectory file: .parquet, .csv, .csv.gz or .npz.")  # fmt: skip
@click.option("--plot", is_flag=True, help="Write figures beside the trajectory (or the log's name).")
@pressures_option
@missing_option
@columns_option
@click.option("--dt", type=float,
              help="Distance of the output rows [s]; left out: the log's samples, at least 100 Hz.")  # fmt: skip
@click.option("--method", type=click.Choice(get_args(Method)), default="auto", show_default=True,
              help="auto: rodas4 (implicit) for stiff arms, dopri5 (explicit) for others; rk4 (explicit) and ros2 "
              "(implicit) take fixed steps.")  # fmt: skip
@click.option("--step", type=float, default=1e-3, show_default=True, help="Longest step of rk4 and ros2 [s].")
@click.option("--rtol", type=float, default=1e-6, show_default=True, help="Relative tolerance of dopri5 and rodas4.")
@click.option("--atol", type=float, default=1e-8, show_default=True,
              help="Absolute tolerance of dopri5 and rodas4 [m, m/s].")  # fmt: skip
@click.option("--max-steps", type=int, help="Give up after this many steps (at least 1).")
@click.option("--residual", "residual_path", metavar="FILE", type=click.Path(path_type=Path, dir_okay=False),
              help="Residual force table of bha diagnose (residual_table.toml), carried after all effects: "
              "empirical, no cause.")  # fmt: skip
@click.option("--interpolation", type=click.Choice(["linear", "hold"]),
              help="Pressures between two samples; as the log's pressures ask for if left out.")  # fmt: skip
@json_option
@reports_errors
def simulate(
    arm: Arm,
    input_path: Path,
    out: Path | None,
    plot: bool,
    pressures: PressureSort | None,
    missing: bool,
    mapping: Path | None,
    dt: float | None,
    method: Method,
    step: float,
    rtol: float,
    atol: float,
    max_steps: int | None,
    residual_path: Path | None,
    interpolation: Interpolation | None,
    as_json: bool,
) -> None:
    """Simulate ARM (a parameter file or the name of a shipped arm) from the pressures of a log.

    The arm starts at rest under the first pressures; an arm with preloads takes them from the pose at which the log
    begins, where it begins at rest. What the log measures of the arm (lengths, heads) is compared with
    what the sensors would have had: the error of each output is printed. A run that diverges ends with an error; the
    rows until then are in the file.
    """
    check_target(out, keep=[input_path])  # before the work, lest it be lost
    notes: list[str] = []
    if residual_path is not None:
        from bha.diagnosis.force_table import ResidualTable  # noqa: PLC0415  (needs an optional extra)

        residual = ResidualTable.read(residual_path)
        arm, notes = residual.carried(arm), [residual.in_words()]
    with progress_bar(hidden=as_json) as bar:
        task = bar.add_task("reading", total=1.0)
        log = Log.read(
            input_path,
            ambient_pressure=arm.parameters.ambient_pressure,
            missing=missing,
            mapping=mapping,
            progress=lambda fraction: bar.update(task, completed=fraction),
        )
        recording = Recording(arm, log, pressures=pressures)
        start = begins(arm, recording)
        arm, drive = start.taken_by(arm), start.drive
        notes += [] if start.stands is None else [TAKEN]
        times = output_times(drive, dt)
        run = Simulation(
            arm, drive, Options(method, step, rtol, atol, max_steps=max_steps, interpolation=interpolation)
        )
        errors = OutputErrors(recording) if recording.outputs else None
        stride = -(-len(times) // FIGURE_ROWS)
        kept: list[Trajectory] = []
        lengths = LengthExtremes(arm)
        counts: dict[str, int] = {}
        rows = 0
        bar.reset(task, description="simulating", total=float(len(times)))
        with _said_what_is_kept(out), TrajectoryWriter(out, keep_partial=True) if out else nullcontext() as writer:
            for piece in run.run(times, CHUNK_ROWS):
                if writer is not None:
                    writer.append(piece)
                lengths.add(piece.time, piece.lengths)
                if errors is not None:
                    errors.add(piece)
                if plot:
                    kept.append(piece[-rows % stride :: stride])
                rows += len(piece)
                counts = {key: counts.get(key, 0) + value for key, value in piece.statistics.items()}
                bar.update(task, completed=float(rows))
    lengths.warn(stacklevel=2)
    written = [] if out is None else [out]
    if plot:
        written += _figures(arm, concatenate(kept), recording, out or input_path)
    _report(arm, times, (run.method, recording.pressures.sort), counts, errors, written, as_json, notes)


@contextmanager
def _said_what_is_kept(out: Path | None) -> Iterator[None]:
    """After Ctrl-C it is said that the file holds a part of the run."""
    try:
        yield
    except KeyboardInterrupt:
        if out is not None and out.exists():
            click.echo(f"{out} holds the rows until then", err=True)
        raise


class OutputErrors:
    """Simulated minus measured outputs, summed up piece by piece."""

    def __init__(self, recording: Recording) -> None:
        """Compare with what ``recording`` has measured, linear between its readings."""
        self.recording = recording
        count = len(recording.outputs)
        self._squares, self._counts = np.zeros(count), np.zeros(count)
        self.greatest = np.full(count, np.nan)

    def add(self, piece: Trajectory) -> None:
        """Take a piece into account."""
        errors = self.recording.errors(piece)
        self._counts += np.isfinite(errors).sum(axis=0)
        self._squares += np.nansum(errors**2, axis=0)
        self.greatest = np.fmax(self.greatest, np.fmax.reduce(np.abs(errors), axis=0, initial=np.nan))

    @property
    def root_mean_square(self) -> NDArray[np.float64]:
        """RMS error of each output, in its unit, shape (C,); NaN where nothing was measured."""
        counts = np.where(self._counts > 0, self._counts, np.nan)
        return np.asarray(np.sqrt(self._squares / counts))

    def by_head(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of the outputs that are positions, by head and axis of the camera, shape (n, 3); NaN elsewhere."""
        table = np.full((self.recording.arm.section_count, 3), np.nan)
        for output, value in zip(self.recording.outputs, values, strict=True):
            if output.kind == "position":
                table[output.section - 1, output.number - 1] = value
        return table


def _figures(arm: Arm, shown: Trajectory, recording: Recording, beside: Path) -> list[Path]:
    from bha.plot import plot_errors, plot_poses, plot_trajectories, write_figure  # noqa: PLC0415  (an optional extra)

    stem = beside.with_name(beside.name.split(".")[0])
    title = f"{arm.name}, simulated"
    measured = recording.as_trajectory()
    lines = {"measured": measured[:: max(1, -(-len(measured) // FIGURE_ROWS))]} if recording.outputs else {}
    written = [
        write_figure(plot_trajectories({**lines, "full": shown}, title=title), Path(f"{stem}_trajectory.png")),
        write_figure(plot_poses(arm, shown, title=title), Path(f"{stem}_shape.png")),
    ]
    places = [k for k, output in enumerate(recording.outputs) if output.kind == "position"]
    if places:
        table = np.full((len(shown), arm.section_count, 3), np.nan)
        errors = recording.errors(shown)
        for k in places:
            table[:, recording.outputs[k].section - 1, recording.outputs[k].number - 1] = errors[:, k]
        heads = sorted({recording.outputs[k].section - 1 for k in places})
        figure = plot_errors(shown.time, {"simulated minus measured": table[:, heads]}, title=arm.name)
        written.append(write_figure(figure, Path(f"{stem}_errors.png")))
    return written


def _report(
    arm: Arm,
    times: NDArray[np.float64],
    method_and_sort: tuple[str, str],
    counts: dict[str, int],
    errors: OutputErrors | None,
    written: list[Path],
    as_json: bool,
    notes: Sequence[str],
) -> None:
    method, sort = method_and_sort
    if as_json:
        result: dict[str, Any] = {"arm": arm.name, "rows": len(times), "end": times[-1], "method": method}
        result["notes"] = list(notes)
        result |= {**counts, "written": written}
        if errors is not None:
            rms = errors.root_mean_square
            result["recording"] = errors.recording.to_mapping()
            result["head_error_rms"] = errors.by_head(rms)
            result["head_error_max"] = errors.by_head(errors.greatest)
            result["output_error_rms"] = dict(zip(errors.recording.channels, rms.tolist(), strict=True))
            result["output_error_max"] = dict(zip(errors.recording.channels, errors.greatest.tolist(), strict=True))
        print_json(result)
        return
    say(
        f"{arm.name}: {times[-1] - times[0]:.6g} s of {sort} pressures in {counts['steps']} steps of {method} "
        f"({counts['rejected_steps']} rejected), {len(times)} rows"
    )
    for note in notes:
        say(note)
    if errors is not None:
        _print_errors(errors)
    if written:
        say("Written: " + ", ".join(str(path) for path in written))


def _print_errors(errors: OutputErrors) -> None:
    """A table of the outputs: lengths and axes of heads in mm, orientations in degrees."""
    rms = errors.root_mean_square
    if not np.isfinite(rms).any():
        say("nothing is compared: no reading of an output lies within the times that were simulated")
        return
    shown = table("Output", "RMS", "Greatest", "Unit", "Where", title="Error, simulated minus measured")
    for output, value, greatest in zip(errors.recording.outputs, rms, errors.greatest, strict=True):
        # A component of a quaternion is half an angle.
        factor, unit = (np.degrees(2.0), "deg") if output.kind == "orientation" else (1e3, "mm")
        where = output.place or f"head {output.section}"
        shown.add_row(output.name, f"{factor * value:.2f}", f"{factor * greatest:.2f}", unit, where)
    console().print(shown)
    for head, row in enumerate(errors.by_head(rms), start=1):
        if np.all(np.isfinite(row)):
            say(f"head {head}: distance {1e3 * np.linalg.norm(row):.2f} mm RMS")
