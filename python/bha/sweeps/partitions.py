"""The partitions of a sweep: Parquet files, each whole or not there, each with a checksum over all its bytes.

The checksum stands in the file's own metadata, so that it goes where the file goes. It is that of the file with zeros
in its place; a flipped bit anywhere, in the numbers or in what describes them, is found before anything is read.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bha.errors import FileError, InputError, way_out
from bha.support.extras import import_extra
from bha.support.files import written_whole
from bha.sweeps.group import columns
from bha.sweeps.plan import Plan

FINGERPRINT, PARTITION, CHECKSUM = "bha.fingerprint", "bha.partition", "bha.sha256"
_NAME = re.compile(r"part-(\d{6,})\.parquet")
# In the metadata a text stands behind its type and its length, 64, in one byte each.
_SEALED = re.compile(re.escape(CHECKSUM.encode()) + rb"\x18\x40([0-9a-f]{64})")
_MAGIC = b"PAR1"
_MEND = "run the sweep again, or remove the file: its runs are then computed again"


class DamagedError(InputError):
    """A partition is not what was written."""


def partition_path(folder: Path, partition: int) -> Path:
    """The file of a partition."""
    return folder / f"part-{partition:06d}.parquet"


def partitions_in(folder: Path) -> list[int]:
    """The partitions that are there, in order.

    Raises:
        FileError: the folder cannot be read.
    """
    try:
        found = (_NAME.fullmatch(name) for name in os.listdir(folder))
    except OSError as error:
        raise FileError(f"{folder}: cannot be read: {way_out(error)}") from error
    return sorted({int(name[1]) for name in found if name and name[0] == partition_path(folder, int(name[1])).name})


def write_partition(folder: Path, plan: Plan, partition: int, table: Mapping[str, Any]) -> None:
    """Write the runs of a partition, whole or not at all.

    Raises:
        FileError: it cannot be written.
    """
    arrow = import_extra("pyarrow", extra="sweep", purpose="A sweep")
    parquet = import_extra("pyarrow.parquet", extra="sweep", purpose="A sweep")
    types = {int: arrow.int64(), float: arrow.float64(), str: arrow.string()}
    fields = [
        arrow.field(name, types[kind], metadata={"unit": unit, "meaning": meaning})
        for name, (kind, unit, meaning) in columns(plan).items()
    ]
    schema = arrow.schema(fields, metadata={FINGERPRINT: plan.fingerprint, PARTITION: str(partition)})
    arrays = [arrow.array(table[field.name], field.type, from_pandas=False) for field in schema]
    with written_whole(partition_path(folder, partition)) as temporary:
        with parquet.ParquetWriter(temporary, schema, compression="zstd") as writer:
            writer.write_table(arrow.Table.from_arrays(arrays, schema=schema))
            writer.add_key_value_metadata({CHECKSUM: "0" * 64})
        _seal(temporary)


def _seal(path: Path) -> None:
    """Put the checksum into a file that has zeros for it; what has its name after a power failure has its content."""
    with path.open("rb+") as file:
        content = bytearray(file.read())
        place = _place(content)
        assert place is not None, "pyarrow writes texts of metadata otherwise than expected"
        file.seek(place.start)
        file.write(_checksum(content, place))
        file.flush()
        os.fsync(file.fileno())


def _place(content: bytes | bytearray) -> slice | None:
    """Where the checksum stands in the metadata at the end of the file; None if it does not stand there once."""
    length = int.from_bytes(content[-8:-4], "little")
    if len(content) < 12 or content[:4] != _MAGIC or content[-4:] != _MAGIC or length > len(content) - 12:
        return None
    found = list(_SEALED.finditer(content, len(content) - 8 - length))
    return slice(*found[0].span(1)) if len(found) == 1 else None


def _checksum(content: bytes | bytearray, place: slice) -> bytes:
    digest = hashlib.sha256(memoryview(content)[: place.start])
    digest.update(b"0" * (place.stop - place.start))
    digest.update(memoryview(content)[place.stop :])
    return digest.hexdigest().encode()


def _whole(path: Path) -> bytes:
    """The bytes of a partition.

    Raises:
        DamagedError: they are not those that were written.
        FileError: they cannot be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {way_out(error)}") from error
    place = _place(content)
    if place is None or _checksum(content, place) != content[place]:
        raise DamagedError(f"{path}: is damaged or cut off (its checksum is wrong); {_MEND}")
    return content


def check_partition(folder: Path, partition: int, fingerprint: str, rows: int | None) -> None:
    """Check that a partition is whole and one of a sweep.

    Raises:
        DamagedError: it is damaged.
        InputError: it is that of another sweep, or has not ``rows`` runs.
        FileError: it cannot be read.
    """
    path = partition_path(folder, partition)
    try:
        content = _whole(path)
    except DamagedError:
        # One of another sweep, or of the user, is not to be written over, damaged or not.
        try:
            _own(path, path.read_bytes(), partition, fingerprint)
        except DamagedError:
            raise
        except InputError as foreign:
            raise foreign from None
        raise
    file = _own(path, content, partition, fingerprint)
    if file.metadata.num_rows != rows:
        raise InputError(_foreign(path))


def _own(path: Path, content: bytes, partition: int, fingerprint: str) -> Any:
    """The opened file, if it says that it is this partition of this sweep."""
    arrow = import_extra("pyarrow", extra="sweep", purpose="A sweep")
    parquet = import_extra("pyarrow.parquet", extra="sweep", purpose="A sweep")
    try:
        file = parquet.ParquetFile(arrow.BufferReader(content))
        said = dict(file.metadata.metadata or {})
    except Exception as error:  # whatever pyarrow makes of bytes that are no Parquet
        raise DamagedError(f"{path}: cannot be read; {_MEND}") from error
    if said.get(FINGERPRINT.encode()) != fingerprint.encode() or said.get(PARTITION.encode()) != b"%d" % partition:
        raise InputError(_foreign(path))
    return file


def _foreign(path: Path) -> str:
    return f"{path}: is no partition of this sweep; remove it, and its runs are computed again"


def read_partition(folder: Path, partition: int, fingerprint: str, names: list[str] | None = None) -> Any:
    """A partition as a ``pyarrow.Table``, or some of its columns.

    Raises:
        InputError: it is damaged, that of another sweep, or lacks a column.
        FileError: it cannot be read.
    """
    path = partition_path(folder, partition)
    file = _own(path, _whole(path), partition, fingerprint)
    missing = [name for name in names or () if name not in file.schema_arrow.names]
    if missing:
        raise InputError(f"{path}: has no column {missing[0]!r}; allowed: {', '.join(file.schema_arrow.names)}")
    try:
        return file.read(columns=names)
    except Exception as error:  # a checksum that is right over bytes that pyarrow cannot read: those of another version
        raise DamagedError(f"{path}: cannot be read: {error}; {_MEND}") from error


def numbers(table: Any, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A column of numbers of a ``pyarrow.Table``."""
    return np.asarray(table.column(name).to_numpy(), dtype=np.float64)
