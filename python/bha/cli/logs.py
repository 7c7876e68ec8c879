"""How commands take logs: the same options and the same reading for all of them, through one door."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import click

from bha.arm import Arm
from bha.recordings import PressureSort, Recording, recordings

#: Which pressures of a log drive the arm.
pressures_option = click.option(
    "--pressures",
    type=click.Choice(get_args(PressureSort)),
    help="Drive with the measured (p11 ...) or the commanded (pc11 ...) pressures of a log; if left out with the "
    "measured ones where it has them.",
)
#: Whether cells without a number are missing samples.
missing_option = click.option(
    "--missing", is_flag=True, help="Take NaN and empty cells of measured outputs as missing samples."
)
#: Which part of a file of another format is which column.
columns_option = click.option(
    "--columns",
    "mapping",
    metavar="MAP.toml",
    type=click.Path(path_type=Path),
    help="Mapping file: which part of a log of another format (ROS bag, MATLAB, HDF5 ...) is which column. Left out: "
    "LOG.columns.toml or columns.toml beside the log.",
)

#: Whether faults of the setup are mended first.
repair_option = click.option(
    "--repair",
    is_flag=True,
    help="Mend first what bha check calls a fault and a machine can mend (exchanged tubes, "
    "azimuth, camera, gauge, units), in memory: files stay as they are.",
)


def read_logs(
    arm: Arm, paths: Sequence[Path], pressures: PressureSort | None, missing: bool, mapping: Path | None
) -> list[Recording]:
    """Recordings of some files by one arm; all with the pressures of the first where none are asked for.

    What is to be warned of is said when they are checked.
    """
    return recordings(arm, paths, pressures=pressures, missing=missing, mapping=mapping, warn=False)
