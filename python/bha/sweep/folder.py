"""The folder of a sweep: what it is a sweep of, its partitions, and who may write there.

``sweep.json`` says what the results follow from; ``part-000000.parquet`` and so on hold the runs, each whole or not
there. What is there is never computed again, and nothing else is read back, so a sweep goes on from any end.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from bha.errors import InputError
from bha.extras import import_extra
from bha.files import written_whole
from bha.sweep.group import columns
from bha.sweep.plan import Plan

MANIFEST = "sweep.json"
SCHEMA = "bha-sweep-run/1"
_PARTITION = re.compile(r"part-(\d{6,})\.parquet")
# What `written_whole` leaves where it is killed.
_LEFTOVER = re.compile(r"\.[0-9a-f]{8}\.(sweep\.json|part-\d{6,}\.parquet)")
_LOCK = ".lock"


def partition_path(folder: Path, partition: int) -> Path:
    """The file of a partition."""
    return folder / f"part-{partition:06d}.parquet"


def manifest(folder: Path) -> dict[str, Any]:
    """What ``sweep.json`` says.

    Raises:
        InputError: there is none, or it is none of this version.
    """
    path = folder / MANIFEST
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{folder}: holds no sweep: there is no {MANIFEST}") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    if not isinstance(found, dict) or found.get("schema") != SCHEMA:
        raise InputError(f'{path}: schema: allowed: "{SCHEMA}"; the folder was written by another version of bha')
    return found


def prepare(folder: Path, plan: Plan) -> None:
    """Make the folder that of ``plan``, or check that it is already; call with the lock held.

    Raises:
        InputError: it is that of another sweep, or holds something else.
    """
    for path in folder.iterdir():
        if _LEFTOVER.fullmatch(path.name):
            path.unlink()
    if not (folder / MANIFEST).exists():
        others = sorted(path.name for path in folder.iterdir() if path.name != _LOCK)
        if others:
            raise InputError(f"{folder}: holds {others[0]} and no sweep; name a folder that is empty or new")
        _write_manifest(folder, plan)
        return
    found = manifest(folder)
    if found["fingerprint"] != plan.fingerprint:
        raise InputError(_difference(folder, found["parts"], plan.parts))
    if found["partition_size"] != plan.spec.partition_size:
        raise InputError(
            f"{folder}: its partitions have {found['partition_size']} runs, the spec wants {plan.spec.partition_size}; "
            "set partition_size back, or name another folder"
        )


def _difference(folder: Path, found: Mapping[str, str], wanted: Mapping[str, str]) -> str:
    def shown(text: str | None) -> str:
        return "none" if text is None else text if len(text) < 32 else text[:12]

    differ = [
        f"{name} ({shown(found.get(name))} there, {shown(wanted.get(name))} here)"
        for name in dict.fromkeys([*found, *wanted])
        if found.get(name) != wanted.get(name)
    ]
    return f"{folder}: holds another sweep; these differ: {', '.join(differ)}. Name another folder, or remove this one"


def _write_manifest(folder: Path, plan: Plan) -> None:
    content = {
        "schema": SCHEMA,
        "fingerprint": plan.fingerprint,
        "parts": plan.parts,
        "runs": plan.runs,
        "partition_size": plan.spec.partition_size,
        "partitions": plan.partitions,
        "arm": plan.arm.name,
        "columns": {name: {"unit": unit, "meaning": meaning} for name, (_, unit, meaning) in columns(plan).items()},
        "spec": plan.spec.to_mapping(),
    }
    with written_whole(folder / MANIFEST) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8", newline="\n")
        _to_disk(temporary)


def _to_disk(path: Path) -> None:
    """A file that has its name after a power failure has its content too."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def write_partition(folder: Path, plan: Plan, partition: int, table: Mapping[str, Any]) -> None:
    """Write the runs of a partition, whole or not at all."""
    arrow = import_extra("pyarrow", extra="sweep", purpose="A sweep")
    parquet = import_extra("pyarrow.parquet", extra="sweep", purpose="A sweep")
    types = {int: arrow.int64(), float: arrow.float64(), str: arrow.string()}
    fields = [
        arrow.field(name, types[kind], metadata={"unit": unit, "meaning": meaning})
        for name, (kind, unit, meaning) in columns(plan).items()
    ]
    schema = arrow.schema(fields, metadata={"bha.fingerprint": plan.fingerprint, "bha.partition": str(partition)})
    arrays = [arrow.array(table[field.name], field.type, from_pandas=False) for field in schema]
    with written_whole(partition_path(folder, partition)) as temporary:
        parquet.write_table(arrow.Table.from_arrays(arrays, schema=schema), temporary, compression="zstd")
        _to_disk(temporary)


def checked_partitions(folder: Path, plan: Plan) -> set[int]:
    """The partitions that are there, each looked at whether it is one of this sweep.

    Raises:
        InputError: a file that bears the name of a partition is not one of this sweep.
    """
    there = set(partitions(folder))
    for partition in there:
        path = partition_path(folder, partition)
        rows, metadata = _footer(path)
        runs = len(plan.runs_of(partition)) if partition < plan.partitions else None
        expected = {b"bha.fingerprint": plan.fingerprint.encode(), b"bha.partition": str(partition).encode()}
        if runs != rows or any(metadata.get(key) != value for key, value in expected.items()):
            raise InputError(f"{path}: is no partition of this sweep; remove it, and its runs are computed again")
    return there


def partitions(folder: Path) -> list[int]:
    """The partitions that are there, in order."""
    found = (_PARTITION.fullmatch(path.name) for path in folder.iterdir())
    return sorted(int(name[1]) for name in found if name)


def _footer(path: Path) -> tuple[int, dict[bytes, bytes]]:
    parquet = import_extra("pyarrow.parquet", extra="sweep", purpose="A sweep")
    try:
        metadata = parquet.read_metadata(path)
    except (OSError, ValueError) as error:  # pyarrow's own errors are subclasses of these
        raise InputError(f"{path}: cannot be read; remove it, and its runs are computed again") from error
    return int(metadata.num_rows), dict(metadata.metadata or {})


def read_partition(folder: Path, partition: int, names: list[str] | None = None) -> Any:
    """A partition as a ``pyarrow.Table``, or some of its columns."""
    parquet = import_extra("pyarrow.parquet", extra="sweep", purpose="A sweep")
    return parquet.read_table(partition_path(folder, partition), columns=names, partitioning=None)


def numbers(table: Any, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A column of numbers of a ``pyarrow.Table``."""
    return np.asarray(table.column(name).to_numpy(), dtype=np.float64)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other sweeps out of a folder; the system lets go of it however this process ends.

    Raises:
        InputError: another process is at it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / _LOCK).open("a+b") as file:
        try:
            _lock(file.fileno())
        except OSError as error:
            raise InputError(f"{folder}: another process is running a sweep there; wait for it or end it") from error
        yield


if os.name == "nt":
    import msvcrt

    def _lock(descriptor: int) -> None:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
