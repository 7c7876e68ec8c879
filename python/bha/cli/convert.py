"""``bha convert``: logs of other formats as CSV or Parquet, and what a file has to be mapped."""

from __future__ import annotations

from pathlib import Path

import click

from bha.cli.common import json_option, print_json, progress_bar, reports_errors, say
from bha.cli.logs import columns_option, missing_option
from bha.errors import InputError
from bha.logs.conversion import Converted, listed
from bha.logs.conversion import convert as convert_log
from bha.support.files import check_target, make_folder


@click.command()
@click.argument("logs", metavar="IN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", metavar="OUT", type=click.Path(path_type=Path),
              help="The new file (.csv, .csv.gz, .parquet); of several logs a folder for a .csv of each.")  # fmt: skip
@columns_option
@click.option("--list", "as_list", is_flag=True, help="Print what the file has as a mapping file to be edited.")
@missing_option
@json_option
@reports_errors
def convert(
    logs: tuple[Path, ...], out: Path | None, mapping: Path | None, as_list: bool, missing: bool, as_json: bool
) -> None:
    """Convert logs of other formats: ROS bags, MCAP, MATLAB, HDF5, exports of LabVIEW and dSPACE, Parquet.

    A mapping file says which part of a log is which column; --list writes one to be edited. Units and gauge pressures
    stay as they are. All other commands read the same files with the same mapping.
    """
    if as_list:
        if out is not None or len(logs) != 1 or as_json:
            raise InputError("--list prints what one file has; found more files, --out or --json")
        click.echo(listed(logs[0]), nl=False)
        return
    if out is None:
        raise InputError("--out: not given; name the new file, or --list what the log has")
    targets = [out]
    if len(logs) > 1:
        folder = make_folder(out)
        targets = [folder / f"{path.name.removesuffix('.gz').rpartition('.')[0] or path.name}.csv" for path in logs]
        twice = next((target for target in targets if targets.count(target) > 1), None)
        if twice is not None:
            raise InputError(f"{twice}: two of the logs would become this file; convert them one by one")
    for target in targets:
        check_target(target, keep=logs)
    written: list[Converted] = []
    with progress_bar(hidden=as_json) as bar:
        for path, target in zip(logs, targets, strict=True):
            task = bar.add_task(path.name, total=1.0)
            written.append(
                convert_log(
                    path,
                    target,
                    mapping=mapping,
                    missing=missing,
                    progress=lambda fraction, task=task: bar.update(task, completed=fraction),  # type: ignore[misc]
                )
            )
    if as_json:
        print_json({"written": [{**vars(one), "headings": list(one.headings)} for one in written]})
        return
    for one in written:
        _say(one)


def _say(one: Converted) -> None:
    more = " ..." if len(one.headings) > 12 else ""
    say(f"Written: {one.path}: {one.rows} rows, {', '.join(one.headings[:12])}{more}")
    for note in one.notes:
        say(f"  {note}")
    for heading, reason in one.ignored.items():
        say(f"  left out: {heading}: {reason}")
    if one.gaps:
        say("  Samples are missing in it: read it with --missing (in Python missing=True).")
