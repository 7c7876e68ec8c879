"""``bha sweep``: Monte Carlo or a grid over parameters, inputs and initial states, to Parquet, resumable."""

from __future__ import annotations

from pathlib import Path

import click

from bha.cli.common import INTERRUPTED, console, json_option, print_json, progress_bar, reports_errors, say, table
from bha.cli.logs import columns_option, missing_option
from bha.errors import FileError, InputError
from bha.sweeps import Summary, SweepSpec, summarize
from bha.sweeps import sweep as run_sweep


@click.command()
@click.argument("spec", metavar="SPEC", type=click.Path(path_type=Path))
@click.option("--out", metavar="DIR", type=click.Path(path_type=Path, file_okay=False),
              help="Folder for the results; in the current folder, named like SPEC, if left out.")  # fmt: skip
@click.option("--threads", type=click.IntRange(min=1), help="Number of threads; all processors if left out.")
@click.option("--dask", metavar="ADDRESS", help="Run on the Dask cluster of this scheduler, tcp://host:8786.")
@missing_option
@columns_option
@json_option
@reports_errors
def sweep(
    spec: Path,
    out: Path | None,
    threads: int | None,
    dask: str | None,
    missing: bool,
    mapping: Path | None,
    as_json: bool,
) -> None:
    """Run the sweep that the file SPEC says (schema bha-sweep/1), or what is missing of it.

    The folder gets sweep.json and part-000000.parquet and so on, each partition whole or not at all. After Ctrl-C or
    kill the same command goes on from the partitions that are there.
    """
    folder = Path(spec.stem) if out is None else out
    try:
        with progress_bar(hidden=as_json, rate_of="runs") as bar:
            task = bar.add_task("reading", total=None)
            started = False

            def tell(done: int, runs: int) -> None:
                nonlocal started
                if not started:  # what was there before must not count for the rate
                    bar.reset(task, description="sweeping", total=runs, completed=done)
                    started = True
                bar.update(task, completed=done)

            read = SweepSpec.read(spec)
            read = read.with_missing() if missing else read
            read = read if mapping is None else read.with_columns(mapping)
            found = run_sweep(read, folder, threads=threads, dask=dask, progress=tell)
    except KeyboardInterrupt:
        _interrupted(folder)
    if as_json:
        print_json(found.to_mapping())
    else:
        _print(found)


def _interrupted(folder: Path) -> None:
    try:
        found = summarize(folder)
    except (InputError, FileError):
        text = "nothing is written yet"
    else:
        text = f"{found.finished} of {found.partitions} partitions are in {folder}; the same command goes on from there"
    click.echo(f"interrupted: {text}", err=True)
    raise SystemExit(INTERRUPTED)


def _print(found: Summary) -> None:
    shown = table("Metric", "Mean", "Deviation", "Least", "Greatest", "Unit", "Runs")
    for name, (unit, moments) in found.metrics.items():
        numbers = (moments.mean, moments.standard_deviation, moments.low, moments.high)
        shown.add_row(name, *(f"{number:.4g}" for number in numbers), unit, str(moments.count))
    console().print(shown)
    counts = ", ".join(f"{count} {status}" for status, count in found.statuses.items() if count)
    say(f"{found.done} of {found.runs} runs: {counts}")
    say(f"{found.finished} partitions in {found.folder}")
