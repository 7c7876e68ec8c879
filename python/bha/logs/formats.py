"""File formats of measured logs: CSV, plain or gzip, and Parquet, in bounded memory beside the columns.

Which of them a file is, is decided by its first bytes when reading and by its extension when writing. What comes from a
pipe is kept in a temporary file while it is read.
"""

from __future__ import annotations

import csv
import gzip
import hashlib
import io
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.errors import InputError, LogError
from bha.logs.columns import FREE, SKIP, Column, check_values
from bha.logs.layout import Layout, layout_of
from bha.support.extras import import_extra
from bha.support.files import written_whole

Array = NDArray[np.float64]
# Called with the fraction that is done, from 0 to 1.
Progress = Callable[[float], None]
# The values of a column as the file has them; None if skipped; where and what, if it holds something else than numbers.
Found = Array | None | str
# What to do with each column, by the headings and, of a text file, its first lines.
Plan = Callable[[Sequence[str], Sequence[str]], list[Column]]

BLOCK_ROWS = 65_536


@contextmanager
def rereadable(path: Path) -> Iterator[Path]:
    """A path from which a log can be read from its beginning, as often as needed.

    That is the path itself for a file, and a temporary file with what came out of it for a pipe.

    Raises:
        LogError: a device, or a pipe that cannot be read or kept.
    """
    try:
        kind = path.stat().st_mode
    except (OSError, ValueError):
        # The reader says what is wrong with it.
        kind = stat.S_IFREG
    if stat.S_ISCHR(kind) or stat.S_ISBLK(kind):
        raise LogError(f"{path}: is a device; a log is a file, or comes through a pipe")
    if not stat.S_ISFIFO(kind) and not stat.S_ISSOCK(kind):
        yield path
        return
    with tempfile.NamedTemporaryFile(prefix="bha-log-") as kept:
        try:
            with path.open("rb") as pipe:
                shutil.copyfileobj(pipe, kept, 1 << 20)
            kept.flush()
        except OSError as error:
            raise LogError(f"{path}: cannot be read from this pipe: {error.strerror}; write it to a file") from error
        yield Path(kept.name)


def sha256(path: Path, origin: str) -> str:
    """SHA-256 of a file, hexadecimal.

    Raises:
        LogError: the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise LogError(f"{origin}: cannot be read: {error.strerror}") from error


def sha256_of(path: Path, origin: str, mapping: str) -> str:
    """SHA-256 of a log: of its file, of all files of a folder, and of the mapping by which it is read.

    Raises:
        LogError: a file cannot be read.
    """
    if path.is_dir():
        files = sorted(entry for entry in path.iterdir() if entry.is_file())
        digest = hashlib.sha256("".join(f"{f.name} {sha256(f, origin)}\n" for f in files).encode()).hexdigest()
    else:
        digest = sha256(path, origin)
    return hashlib.sha256(f"{digest}\n{mapping}".encode()).hexdigest() if mapping else digest


def is_parquet(path: Path) -> bool:
    """Whether a file begins like Parquet; False for one that cannot be opened."""
    try:
        with path.open("rb") as file:
            return file.read(4) == b"PAR1"
    except (OSError, ValueError):
        return False


@dataclass(frozen=True)
class TextTable:
    """A table of text as it was read.

    Attributes:
        columns: what was planned.
        found: what was found in each.
        unterminated: whether the last line has no line end.
        layout: how it is laid out where it is no plain CSV, else None.
    """

    columns: list[Column]
    found: list[Found]
    unterminated: bool
    layout: Layout | None


def read_text(path: Path, origin: str, plan: Plan, progress: Progress | None) -> TextTable:
    """Read a table of text: CSV, or laid out as its first lines tell; errors call it ``origin``.

    Raises:
        LogError: a fault, with line and column.
    """
    columns: list[Column] = []
    layout = layout_of(path)

    def core_plan(headings: list[str], opening: list[str]) -> list[_core.TableColumn]:
        columns.extend(plan(headings, opening) if layout is None else plan(layout.headings(headings), ()))
        return [_core.TableColumn(c.used, c.least, c.hint, c.missing, c.absent) for c in columns]

    how = {} if layout is None else {"layout": layout.for_core}
    table = _core.read_table(os.fspath(path), core_plan, progress, origin, **how)
    found = [
        f"line {entry.line}: '{entry.text}' is not a number" if isinstance(entry, _core.TextFound) else entry
        for entry in table.columns
    ]
    return TextTable(columns, found, table.unterminated, layout)


def read_parquet(path: Path, origin: str, plan: Plan, progress: Progress | None) -> tuple[list[Column], list[Found]]:
    """Read a Parquet file, column by column and block by block; errors call it ``origin``.

    Raises:
        LogError: a fault, with row and column.
        MissingExtraError: pyarrow is not installed.
    """
    pyarrow = import_extra("pyarrow", extra="parquet", purpose="Reading Parquet files")
    parquet = import_extra("pyarrow.parquet", extra="parquet", purpose="Reading Parquet files")
    with ExitStack() as stack:
        with _named_faults(pyarrow, origin):
            file = stack.enter_context(parquet.ParquetFile(path))
            fields = list(file.schema_arrow)
            rows = file.metadata.num_rows
            headings = [str(field.name).strip() for field in fields]
        columns = plan(headings, ())
        if rows <= 0:
            raise LogError(f"{origin} has headings but no rows of numbers")
        wanted = [i for i, column in enumerate(columns) if column.used != SKIP]
        found: list[Found] = [None] * len(columns)
        if progress is not None:
            progress(0.0)
        for place, index in enumerate(wanted):
            watch = None if progress is None else _share(progress, place, len(wanted))
            found[index] = _read_column(pyarrow, file, columns[index], fields[index], origin, watch)
        if progress is not None:
            progress(1.0)
        return columns, found


@contextmanager
def _named_faults(pyarrow: Any, origin: str) -> Iterator[None]:
    """What pyarrow raises at a damaged file, as the package's own error."""
    try:
        yield
    except UnicodeDecodeError as error:
        raise LogError(f"{origin}: a column's name is not UTF-8 text; rename it") from error
    except (pyarrow.ArrowException, OSError, ValueError, MemoryError) as error:
        raise LogError(f"{origin}: the Parquet data is damaged or cut off: {error}") from error


def _share(progress: Progress, part: int, parts: int) -> Progress:
    """The progress of one of several parts of equal work."""
    return lambda fraction: progress((part + fraction) / parts)


def _read_column(pyarrow: Any, file: Any, column: Column, field: Any, origin: str, progress: Progress | None) -> Found:
    """One column; its type is checked before its values, its values after it is whole."""
    kinds = pyarrow.types
    if not (kinds.is_integer(field.type) or kinds.is_floating(field.type) or kinds.is_decimal(field.type)):
        if column.used == FREE:
            return f"{field.type} is not a type of numbers"
        raise LogError(f"{origin}, column '{column.heading}': holds {field.type}; expected numbers, best float64")
    with _named_faults(pyarrow, origin):
        rows = file.metadata.num_rows
        values = np.empty(rows)
        batches = file.iter_batches(batch_size=BLOCK_ROWS, columns=[field.name])
    row = 0
    while True:
        if progress is not None:
            progress(row / rows)
        with _named_faults(pyarrow, origin):
            batch = next(batches, None)
            if batch is None:
                break
            # By its place: the name "pose.x" stands for the column of that name and for a part of a column "pose" too.
            cells = batch.column(batch.schema.names.index(field.name))
            if row + len(cells) > rows:
                raise LogError(f"{origin}: the Parquet data is damaged: more rows than the file says, {rows}")
            absent = cells.is_null().to_numpy(zero_copy_only=False) if cells.null_count else None
            values[row : row + len(cells)] = cells.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
        if absent is not None and not column.missing:
            text = f"the cell is empty; {column.absent}"
            raise LogError(f"{origin}, row {row + int(np.argmax(absent)) + 1}, column '{column.heading}': {text}")
        row += len(cells)
    if row != rows:
        raise LogError(f"{origin}: the Parquet data is damaged or cut off: {row} rows of {rows}")
    return check_values(origin, column, values) or values


def write(path: Path, columns: Mapping[str, Array], progress: Progress | None) -> None:
    """Write columns by heading to a file, whole or not at all; the extension chooses the format.

    Raises:
        InputError: unknown extension, or a folder that does not exist.
        MissingExtraError: Parquet without pyarrow.
    """
    check_extension(path)
    writer = _write_parquet if path.name.lower().endswith(".parquet") else _write_csv
    rows = len(next(iter(columns.values())))
    with written_whole(path) as temporary:
        writer(temporary, columns, rows, progress)


def check_extension(path: Path) -> None:
    """Check that a log can be written under this name, before the work whose result it is to hold.

    Raises:
        InputError: unknown extension.
        MissingExtraError: Parquet without pyarrow.
    """
    name = path.name.lower()
    if name.endswith(".parquet"):
        import_extra("pyarrow", extra="parquet", purpose="Writing Parquet files")
    elif not name.endswith((".csv", ".csv.gz")):
        known = ".parquet, .csv or .csv.gz"
        raise InputError(f"{path}: unknown extension {path.suffix or '(none)'}; logs are written as {known}")


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
