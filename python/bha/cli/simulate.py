"""``bha simulate``: an arm driven by the pressures of a log, in bounded memory."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.cli.common import arm_argument, console, json_option, print_json, progress_bar, reports_errors, table
from bha.log import Log
from bha.simulation import CHUNK_ROWS, Input, Interpolation, Method, Options, Simulation, concatenate, output_times
from bha.trajectory import Trajectory, TrajectoryWriter

#: Rows that a figure gets at the most; more cannot be told apart.
FIGURE_ROWS = 4000


@click.command()
@arm_argument
@click.option("--input", "input_path", metavar="LOG", required=True, type=click.Path(path_type=Path),
              help="Log with pressures (CSV, CSV.gz or Parquet).")  # fmt: skip
@click.option("--out", metavar="TRAJ", type=click.Path(path_type=Path, dir_okay=False),
              help="Trajectory file: .parquet, .csv, .csv.gz or .npz.")  # fmt: skip
@click.option("--plot", is_flag=True, help="Write figures beside the trajectory (or the log's name).")
@click.option("--commanded", is_flag=True, help="Drive with the commanded pressures (pc..), not the measured ones.")
@click.option("--dt", type=float, help="Distance of the output rows [s]; the log's own times if left out.")
@click.option("--method", type=click.Choice(["dopri5", "rk4", "ros2"]), default="dopri5", show_default=True)
@click.option("--step", type=float, default=1e-3, show_default=True, help="Step of rk4 [s].")
@click.option("--rtol", type=float, default=1e-6, show_default=True, help="Relative tolerance of dopri5.")
@click.option("--atol", type=float, default=1e-8, show_default=True, help="Absolute tolerance of dopri5 [m, m/s].")
@click.option("--max-steps", type=int, help="Give up after this many steps.")
@click.option("--interpolation", type=click.Choice(["linear", "hold"]), default="linear", show_default=True,
              help="Pressures between two samples.")  # fmt: skip
@json_option
@reports_errors
def simulate(
    arm: Arm,
    input_path: Path,
    out: Path | None,
    plot: bool,
    commanded: bool,
    dt: float | None,
    method: Method,
    step: float,
    rtol: float,
    atol: float,
    max_steps: int | None,
    interpolation: Interpolation,
    as_json: bool,
) -> None:
    """Simulate ARM (a parameter file or the name of a shipped arm) from the pressures of a log.

    The arm starts at rest under the first pressures. Where the log has head positions, the error per head and axis is
    printed. A run that diverges ends with an error; the rows until then are in the file.
    """
    with progress_bar(hidden=as_json) as bar:
        task = bar.add_task("reading", total=1.0)
        log = Log.read(input_path, progress=lambda fraction: bar.update(task, completed=fraction))
        drive = Input.from_log(arm, log, commanded=commanded)
        times = output_times(drive, dt)
        run = Simulation(
            arm, drive, Options(method, step, rtol, atol, max_steps=max_steps, interpolation=interpolation)
        )
        errors = HeadErrors(log) if log.head_positions is not None else None
        stride = -(-len(times) // FIGURE_ROWS)
        kept: list[Trajectory] = []
        counts: dict[str, int] = {}
        rows = 0
        bar.reset(task, description="simulating", total=float(len(times)))
        with TrajectoryWriter(out, keep_partial=True) if out is not None else nullcontext() as writer:
            for piece in run.run(times, CHUNK_ROWS):
                if writer is not None:
                    writer.append(piece)
                if errors is not None:
                    errors.add(piece)
                if plot:
                    kept.append(piece[-rows % stride :: stride])
                rows += len(piece)
                counts = {key: counts.get(key, 0) + value for key, value in piece.statistics.items()}
                bar.update(task, completed=float(rows))
    written = [] if out is None else [out]
    if plot:
        written += _figures(arm, concatenate(kept), errors, out or input_path)
    _report(arm, times, counts, errors, written, as_json)


class HeadErrors:
    """Simulated minus measured head positions, summed up piece by piece."""

    def __init__(self, log: Log) -> None:
        """Compare with the head positions of ``log``, linear between its samples."""
        assert log.head_positions is not None
        self._time, self._measured = log.time, log.head_positions
        heads = self._measured.shape[1]
        self._squares, self._counts = np.zeros((heads, 3)), np.zeros((heads, 3))
        self.greatest = np.full((heads, 3), np.nan)

    def of(self, piece: Trajectory) -> NDArray[np.float64]:
        """Errors (m, heads, 3), m; positions where the log measured none are NaN."""
        heads = self._measured.shape[1]
        measured = np.empty((len(piece), heads, 3))
        for head in range(heads):
            for axis in range(3):
                measured[:, head, axis] = np.interp(piece.time, self._time, self._measured[:, head, axis])
        return np.asarray(piece.head_positions[:, :heads] - measured)

    def add(self, piece: Trajectory) -> None:
        """Take a piece into account."""
        errors = self.of(piece)
        self._counts += np.isfinite(errors).sum(axis=0)
        self._squares += np.nansum(errors**2, axis=0)
        self.greatest = np.fmax(self.greatest, np.fmax.reduce(np.abs(errors), axis=0, initial=np.nan))

    @property
    def root_mean_square(self) -> NDArray[np.float64]:
        """RMS error (heads, 3), m; NaN where nothing was measured."""
        counts = np.where(self._counts > 0, self._counts, np.nan)
        return np.asarray(np.sqrt(self._squares / counts))


def _figures(arm: Arm, shown: Trajectory, errors: HeadErrors | None, beside: Path) -> list[Path]:
    from bha.plot import plot_errors, plot_shape, plot_trajectories, write_figure  # noqa: PLC0415  (an optional extra)

    stem = beside.with_name(beside.name.split(".")[0])
    title = f"{arm.name}, simulated"
    poses = shown[:: max(1, -(-len(shown) // 12))]
    backbones = np.stack([arm.shape(q) for q in poses.lengths])
    hanging = arm.parameters.gravity[2] >= 0
    written = [
        write_figure(plot_trajectories({"full": shown}, title=title), Path(f"{stem}_trajectory.png")),
        write_figure(
            plot_shape(poses.time, backbones, poses.head_positions, hanging=hanging, title=title),
            Path(f"{stem}_shape.png"),
        ),
    ]
    if errors is not None:
        figure = plot_errors(shown.time, {"simulated minus measured": errors.of(shown)}, title=arm.name)
        written.append(write_figure(figure, Path(f"{stem}_errors.png")))
    return written


def _report(
    arm: Arm,
    times: NDArray[np.float64],
    counts: dict[str, int],
    errors: HeadErrors | None,
    written: list[Path],
    as_json: bool,
) -> None:
    if as_json:
        result: dict[str, Any] = {"arm": arm.name, "rows": len(times), "end": times[-1], **counts, "written": written}
        if errors is not None:
            result["head_error_rms"] = errors.root_mean_square
            result["head_error_max"] = errors.greatest
        print_json(result)
        return
    out = console()
    out.print(
        f"{arm.name}: {times[-1] - times[0]:.6g} s in {counts['steps']} steps ({counts['rejected_steps']} rejected), "
        f"{len(times)} rows",
        highlight=False,
    )
    if errors is not None:
        errors_table = table("Head", "x", "y", "z", "distance", title="Error, simulated minus measured, RMS [mm]")
        for head, row in enumerate(errors.root_mean_square):
            cells = [f"{1e3 * value:.2f}" for value in (*row, np.linalg.norm(row))]
            errors_table.add_row(str(head + 1), *cells)
        out.print(errors_table)
    if written:
        out.print("Written: " + ", ".join(str(path) for path in written), highlight=False, soft_wrap=True)
