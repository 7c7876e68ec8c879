"""File formats of trajectories: Parquet, CSV (plain or gzip) and NumPy's npz, each written chunk by chunk."""

from __future__ import annotations

import csv
import gzip
import io
import json
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError
from bha.support.extras import import_extra

# Attributes of a trajectory that hold one entry for each row; the optional ones may be None.
ARRAYS = ("time", "lengths", "velocities", "pressures", "head_positions")
# Files hold what is true, not what an effect makes sensors say.
NOT_WRITTEN = ("measured_lengths", "measured_head_positions", "measured_head_orientations")
OPTIONAL_ARRAYS = ("head_orientations", *NOT_WRITTEN)
# Rows written at a time, and rows of a Parquet row group: 16 MB for 30 columns, enough to compress well.
BLOCK_ROWS = 65_536


class Written(Protocol):
    """What files hold of a :class:`bha.Trajectory`, beside its arrays by name."""

    def __len__(self) -> int:
        """Number of rows."""

    @property
    def arm_name(self) -> str:
        """Name of the arm."""

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the pressure inputs."""

    @property
    def virtual_lengths(self) -> bool:
        """Whether lengths are no bellows' own."""

    @property
    def head_orientations(self) -> NDArray[np.float64] | None:
        """Orientations of the heads, or None."""

    def columns(self) -> list[str]:
        """Headings of a table."""

    def table(self) -> NDArray[np.float64]:
        """The columns side by side."""


def written_arrays(trajectory: Written) -> tuple[str, ...]:
    """The attributes of a trajectory, an entry a row each, that a file of it holds."""
    return ARRAYS if trajectory.head_orientations is None else (*ARRAYS, "head_orientations")


class Sink(Protocol):
    """An open file that takes chunks of a trajectory."""

    def write(self, chunk: Written) -> None:
        """Add the rows of a chunk of at most BLOCK_ROWS rows."""

    def finish(self, statistics: Mapping[str, int]) -> None:
        """Write what belongs at the end of the file."""

    def close(self) -> None:
        """Close the file, finished or not."""


def open_sink(path: Path) -> Callable[[Path, Written], Sink]:
    """Choose the format for a path by its extension; returns what opens such a file.

    The returned function takes the path to write to and a trajectory that has the columns of all chunks to come.

    Raises:
        InputError: unknown extension.
        MissingExtraError: Parquet without pyarrow.
    """
    name = path.name.lower()
    if name.endswith(".parquet"):
        import_extra("pyarrow", extra="parquet", purpose="Writing Parquet files")
        return _ParquetSink
    if name.endswith((".csv", ".csv.gz")):
        return _CsvSink
    if name.endswith(".npz"):
        return _NpzSink
    raise InputError(
        f"{path}: unknown extension {path.suffix or '(none)'}; "
        "trajectories are written as .parquet, .csv, .csv.gz or .npz"
    )


class _ParquetSink:
    """Compressed row groups of at most BLOCK_ROWS rows; arm, inputs and statistics as metadata of the file."""

    def __init__(self, path: Path, like: Written) -> None:
        self._pyarrow = import_extra("pyarrow", extra="parquet", purpose="Writing Parquet files")
        parquet = import_extra("pyarrow.parquet", extra="parquet", purpose="Writing Parquet files")
        metadata = {"bha.arm_name": like.arm_name, "bha.input_names": json.dumps(like.input_names)}
        double = self._pyarrow.float64()
        self._schema = self._pyarrow.schema([(name, double) for name in like.columns()], metadata=metadata)
        # Dictionaries do not pay for measured doubles; byte streams split by significance compress them better.
        self._writer = parquet.ParquetWriter(
            path, self._schema, compression="zstd", use_dictionary=False, use_byte_stream_split=True
        )
        self._waiting: list[Any] = []
        self._waiting_rows = 0

    def write(self, chunk: Written) -> None:
        columns = [self._pyarrow.array(column) for column in chunk.table().T]
        self._waiting.append(self._pyarrow.table(columns, schema=self._schema))
        self._waiting_rows += len(chunk)
        if self._waiting_rows >= BLOCK_ROWS:
            self._flush()

    def finish(self, statistics: Mapping[str, int]) -> None:
        self._flush()
        self._writer.add_key_value_metadata({"bha.statistics": json.dumps(dict(statistics))})

    def close(self) -> None:
        self._writer.close()

    def _flush(self) -> None:
        if self._waiting:
            self._writer.write_table(self._pyarrow.concat_tables(self._waiting), row_group_size=BLOCK_ROWS)
        self._waiting, self._waiting_rows = [], 0


class _CsvSink:
    """A heading line and one line per row; every number in the fewest digits that read back to the same number."""

    def __init__(self, path: Path, like: Written) -> None:
        self._stack = ExitStack()
        binary: IO[bytes] = self._stack.enter_context(path.open("wb"))
        if path.name.lower().endswith(".gz"):
            # Neither name nor time of writing in the file: the same trajectory gives the same bytes.
            packed = gzip.GzipFile(filename="", mode="wb", fileobj=binary, mtime=0, compresslevel=6)
            binary = cast("IO[bytes]", self._stack.enter_context(packed))
        text = self._stack.enter_context(io.TextIOWrapper(binary, encoding="utf-8", newline=""))
        self._writer = csv.writer(text, lineterminator="\n")
        self._writer.writerow(like.columns())

    def write(self, chunk: Written) -> None:
        self._writer.writerows(chunk.table().tolist())

    def finish(self, statistics: Mapping[str, int]) -> None:
        """Nothing: a comment would be one more thing that readers of CSV stumble over."""

    def close(self) -> None:
        self._stack.close()


class _NpzSink:
    """The arrays of a trajectory under the names of its attributes; statistics as JSON text.

    The header of an npy member says how many rows follow, so the rows wait in temporary files until they are counted.
    """

    def __init__(self, path: Path, like: Written) -> None:
        self._path = path
        self._like = like
        self._rows = 0
        self._stack = ExitStack()
        # Beside the file, not in the system's folder for temporary files, which may be small or in memory.
        self._raw: dict[str, IO[bytes]] = {
            name: self._stack.enter_context(tempfile.TemporaryFile(dir=path.parent))  # noqa: SIM115
            for name in written_arrays(like)
        }

    def write(self, chunk: Written) -> None:
        for name, file in self._raw.items():
            file.write(np.ascontiguousarray(getattr(chunk, name), dtype="<f8").data)
        self._rows += len(chunk)

    def finish(self, statistics: Mapping[str, int]) -> None:
        with zipfile.ZipFile(self._path, "w", compression=zipfile.ZIP_STORED) as archive:
            for name, file in self._raw.items():
                header = {
                    "descr": "<f8",
                    "fortran_order": False,
                    "shape": (self._rows, *getattr(self._like, name).shape[1:]),
                }
                file.seek(0)
                with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                    np.lib.format.write_array_header_1_0(member, header)
                    shutil.copyfileobj(file, member)
            texts = {
                "input_names": np.array(self._like.input_names, dtype=np.str_),
                "arm_name": np.array(self._like.arm_name, dtype=np.str_),
                "statistics": np.array(json.dumps(dict(statistics)), dtype=np.str_),
                "virtual_lengths": np.array(self._like.virtual_lengths),
            }
            for name, array in texts.items():
                with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as member:
                    np.lib.format.write_array(member, array, allow_pickle=False)

    def close(self) -> None:
        self._stack.close()
