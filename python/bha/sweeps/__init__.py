"""Sweeps: Monte Carlo and grids over parameters, inputs and initial states, to Parquet, beyond one machine.

>>> import bha.sweeps
>>> result = bha.sweep("sweep.toml", "out")  # doctest: +SKIP
>>> bha.sweeps.read("out").column("settling_time")  # doctest: +SKIP
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError, ParameterWarning
from bha.support.extras import import_extra
from bha.sweeps import folder as storage
from bha.sweeps.cluster import on_cluster
from bha.sweeps.execute import on_this_computer
from bha.sweeps.metrics import METRICS, Metric
from bha.sweeps.partitions import partitions_in, read_partition, write_partition
from bha.sweeps.plan import AnySpec, Plan, make_plan
from bha.sweeps.spec import SweepSpec
from bha.sweeps.summary import Summary, summarize

__all__ = ["METRICS", "Metric", "Plan", "Summary", "SweepSpec", "draw", "make_plan", "read", "summarize", "sweep"]


def draw(spec: AnySpec, first: int = 0, count: int = 10) -> NDArray[np.float64]:
    """What ``count`` runs from ``first`` on draw, shape (count, variables), without running them; of a log its place.

    Raises:
        ParameterError: the spec is not valid; the text names file, line, key, found, allowed.
        LogError: a log cannot be read.
        InputError: there are no such runs.
    """
    made = make_plan(spec)
    if not (first >= 0 and count >= 1 and first + count <= made.runs):
        raise InputError(f"runs {first} to {first + count - 1}: the sweep has runs 0 to {made.runs - 1}")
    return made.draws(first, count)


def sweep(
    spec: AnySpec,
    out: str | os.PathLike[str],
    *,
    threads: int | None = None,
    dask: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Summary:
    """Run a sweep, or what is missing of it, into a folder.

    What a run draws and what comes out does not depend on threads, workers, partitions or interruptions. Ctrl-C and
    kill leave the partitions that are finished; the same call goes on from there.

    Args:
        spec: a sweep file, the mapping it amounts to, or a :class:`SweepSpec`.
        out: folder for ``sweep.json`` and the partitions; made if it is not there.
        threads: how many threads; as many as there are processors if None. Not with ``dask``.
        dask: address of a Dask scheduler, ``tcp://host:8786``; runs there.
        progress: called with the runs that are done, those of earlier calls included, and the runs in all.

    Returns:
        What is now in the folder.

    Warns:
        FileWarning: a file in the folder is damaged and is made anew.

    Raises:
        ParameterError: the spec is not valid; the text names file, line, key, found, allowed.
        LogError: a log cannot be read.
        InputError: the folder holds something else, or another process writes there; ``threads`` and ``dask`` together.
        FileError: the folder or a file in it cannot be written.
        MissingExtraError: pyarrow, or with ``dask`` dask, is not installed.
    """
    if threads is not None and dask is not None:
        raise InputError("threads and dask: found both; allowed: one of them, for workers bring their own threads")
    import_extra("pyarrow.parquet", extra="sweep", purpose="A sweep")
    target = Path(out)
    storage.check_vacant(target)
    made = make_plan(spec, instruction_set=_instruction_set(target))
    with storage.locked(target), warnings.catch_warnings():
        # Once a run it warns nobody; the numbers that were drawn stand in the table.
        warnings.simplefilter("ignore", ParameterWarning)
        storage.prepare(target, made)
        there = storage.checked_partitions(target, made)
        missing = (partition for partition in range(made.partitions) if partition not in there)
        done = sum(len(made.runs_of(partition)) for partition in there)

        def tick(count: int) -> None:
            nonlocal done
            done += count
            if progress is not None:
                progress(done, made.runs)

        tick(0)
        for partition, table in _tables(made, missing, threads, dask, tick):
            write_partition(target, made, partition, table)
    return summarize(target)


def read(out: str | os.PathLike[str], columns: Sequence[str] | None = None) -> Any:
    """The runs that are in a sweep's folder as one ``pyarrow.Table``, in the order of their numbers.

    Args:
        out: the folder.
        columns: names of the columns to read; all if None.

    Raises:
        InputError: the folder holds no sweep, or no such column; a file in it is damaged.
        FileError: a file cannot be read.
        MissingExtraError: pyarrow is not installed.
    """
    arrow = import_extra("pyarrow", extra="sweep", purpose="A sweep")
    folder = Path(out)
    found = storage.manifest(folder)
    for name in columns or ():
        if name not in found.columns:
            raise InputError(f"{out}: no column {name!r}; allowed: {', '.join(found.columns)}")
    names = None if columns is None else list(columns)
    tables = [read_partition(folder, partition, found.fingerprint, names) for partition in partitions_in(folder)]
    if not tables:
        raise InputError(f"{out}: has no finished partition yet")
    return arrow.concat_tables([table.replace_schema_metadata(None) for table in tables])


def _instruction_set(folder: Path) -> str | None:
    """What the sweep in a folder was started with: another computer goes on with the same."""
    if not os.path.exists(folder / storage.MANIFEST):
        return None
    return storage.manifest(folder, checked=False).parts.get("instruction set")


def _tables(
    made: Plan, missing: Iterable[int], threads: int | None, dask: str | None, tick: Callable[[int], None]
) -> Iterator[tuple[int, dict[str, Any]]]:
    if dask is not None:
        yield from on_cluster(made, missing, dask, tick)
        return
    yield from on_this_computer(made, missing, threads, tick)
