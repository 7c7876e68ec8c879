"""File formats of measured logs: CSV, plain or gzip, and Parquet, in bounded memory beside the columns.

Which of them a file is, is decided by its first bytes when reading and by its extension when writing.
"""

from __future__ import annotations

import csv
import gzip
import io
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.errors import InputError, LogError
from bha.extras import import_extra
from bha.files import written_whole
from bha.log_columns import FREE, SKIP, Column, check_values

Array = NDArray[np.float64]
# Called with the fraction that is done, from 0 to 1.
Progress = Callable[[float], None]
# The values of a column as the file has them; None if skipped; where and what, if it holds something else than numbers.
Found = Array | None | str

BLOCK_ROWS = 65_536


def is_parquet(path: Path) -> bool:
    """Whether a file begins like Parquet; False for one that cannot be opened."""
    try:
        with path.open("rb") as file:
            return file.read(4) == b"PAR1"
    except OSError:
        return False


def read_csv(
    path: Path, plan: Callable[[Sequence[str]], list[Column]], progress: Progress | None
) -> tuple[list[Column], list[Found], bool]:
    """Read a CSV file.

    Returns:
        The columns, what was found in each, and whether the last line has no line end.

    Raises:
        LogError: a fault, with line and column.
    """
    columns: list[Column] = []

    def core_plan(headings: list[str]) -> list[tuple[str, float, str]]:
        columns.extend(plan(headings))
        return [(column.used, column.least, column.hint) for column in columns]

    read, unterminated = _core.read_table(os.fspath(path), core_plan, progress)
    found = [f"line {entry[0]}: '{entry[1]}' is not a number" if isinstance(entry, tuple) else entry for entry in read]
    return columns, found, unterminated


def read_parquet(
    path: Path, plan: Callable[[Sequence[str]], list[Column]], progress: Progress | None
) -> tuple[list[Column], list[Found]]:
    """Read a Parquet file, column by column and block by block.

    Raises:
        LogError: a fault, with row and column.
        MissingExtraError: pyarrow is not installed.
    """
    pyarrow = import_extra("pyarrow", extra="parquet", purpose="Reading Parquet files")
    parquet = import_extra("pyarrow.parquet", extra="parquet", purpose="Reading Parquet files")
    try:
        with parquet.ParquetFile(path) as file:
            schema = file.schema_arrow
            columns = plan([str(name).strip() for name in schema.names])
            rows = file.metadata.num_rows
            if rows == 0:
                raise LogError(f"{path} has headings but no rows of numbers")
            wanted = [i for i, column in enumerate(columns) if column.used != SKIP]
            found: list[Found] = [None] * len(columns)
            if progress is not None:
                progress(0.0)
            for place, index in enumerate(wanted):
                watch = None if progress is None else _share(progress, place, len(wanted))
                found[index] = _read_column(pyarrow, file, columns[index], schema.field(index), path, watch)
            if progress is not None:
                progress(1.0)
            return columns, found
    except (pyarrow.ArrowException, OSError) as error:
        raise LogError(f"{path}: the Parquet data is damaged or cut off: {error}") from error


def _share(progress: Progress, part: int, parts: int) -> Progress:
    """The progress of one of several parts of equal work."""
    return lambda fraction: progress((part + fraction) / parts)


def _read_column(pyarrow: Any, file: Any, column: Column, field: Any, path: Path, progress: Progress | None) -> Found:
    """One column; its type is checked before its values, its values after it is whole."""
    kinds = pyarrow.types
    if not (kinds.is_integer(field.type) or kinds.is_floating(field.type) or kinds.is_decimal(field.type)):
        if column.used == FREE:
            return f"{field.type} is not a type of numbers"
        raise LogError(f"{path}, column '{column.heading}': holds {field.type}; expected numbers, best float64")
    values = np.empty(file.metadata.num_rows)
    row = 0
    for batch in file.iter_batches(batch_size=BLOCK_ROWS, columns=[field.name]):
        if progress is not None:
            progress(row / len(values))
        cells = batch.column(0)
        if cells.null_count and column.used != FREE:
            first = row + int(np.argmax(cells.is_null().to_numpy(zero_copy_only=False)))
            text = "the cell is empty; write the last known value, as a sensor that holds it would, or remove the row"
            raise LogError(f"{path}, row {first + 1}, column '{column.heading}': {text}")
        values[row : row + len(cells)] = cells.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
        row += len(cells)
    check_values(os.fspath(path), column, values)
    return values


def write(path: Path, columns: Mapping[str, Array], progress: Progress | None) -> None:
    """Write columns by heading to a file, whole or not at all; the extension chooses the format.

    Raises:
        InputError: unknown extension, or a folder that does not exist.
        MissingExtraError: Parquet without pyarrow.
    """
    name = path.name.lower()
    if name.endswith(".parquet"):
        writer = _write_parquet
        import_extra("pyarrow", extra="parquet", purpose="Writing Parquet files")
    elif name.endswith((".csv", ".csv.gz")):
        writer = _write_csv
    else:
        known = ".parquet, .csv or .csv.gz"
        raise InputError(f"{path}: unknown extension {path.suffix or '(none)'}; logs are written as {known}")
    rows = len(next(iter(columns.values())))
    with written_whole(path) as temporary:
        writer(temporary, columns, rows, progress)


def _blocks(columns: Mapping[str, Array], rows: int, progress: Progress | None) -> Any:
    for start in range(0, rows, BLOCK_ROWS):
        if progress is not None:
            progress(start / rows)
        yield [np.ascontiguousarray(values[start : start + BLOCK_ROWS]) for values in columns.values()]
    if progress is not None:
        progress(1.0)


def _write_csv(path: Path, columns: Mapping[str, Array], rows: int, progress: Progress | None) -> None:
    with ExitStack() as stack:
        binary: IO[bytes] = stack.enter_context(path.open("wb"))
        if path.name.lower().endswith(".gz"):
            # Neither name nor time of writing in the file: the same log gives the same bytes.
            packed = gzip.GzipFile(filename="", mode="wb", fileobj=binary, mtime=0, compresslevel=6)
            binary = cast("IO[bytes]", stack.enter_context(packed))
        headings = io.StringIO()
        csv.writer(headings, lineterminator="\n").writerow(columns)
        binary.write(headings.getvalue().encode())
        for block in _blocks(columns, rows, progress):
            binary.write(_core.format_table_rows(block))


def _write_parquet(path: Path, columns: Mapping[str, Array], rows: int, progress: Progress | None) -> None:
    pyarrow = import_extra("pyarrow", extra="parquet", purpose="Writing Parquet files")
    parquet = import_extra("pyarrow.parquet", extra="parquet", purpose="Writing Parquet files")
    schema = pyarrow.schema([(heading, pyarrow.float64()) for heading in columns])
    # Dictionaries do not pay for measured doubles; byte streams split by significance compress them better.
    options = {"compression": "zstd", "use_dictionary": False, "use_byte_stream_split": True}
    with parquet.ParquetWriter(path, schema, **options) as writer:
        for block in _blocks(columns, rows, progress):
            writer.write_table(pyarrow.table([pyarrow.array(values) for values in block], schema=schema))
