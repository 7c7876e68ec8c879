"""What a diagnosis has computed so far, on disk, so that an interrupted one goes on where it stopped.

All of it lies in one folder of its own, marked as such, in the folder of the results. A file's name begins with the
hash of everything that its numbers depend on: the arm, the logs' numbers, the options, the version of the package. A
lock in the folder keeps two diagnoses apart. Nothing is touched that a diagnosis did not write: files are removed one
by one, by their names, and only regular files in a real folder, never through links. Arrays only, no pickles, each file
with a checksum: one that is damaged counts as not there.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from bha._core import __version__
from bha.errors import FileError, FileWarning, InputError, way_out
from bha.estimation.records import Record
from bha.support.files import UNFINISHED, written_whole
from bha.support.locks import locked

#: Raise it when results change for the same inputs.
GENERATION = 5

#: The folder, in that of the results.
FOLDER = ".bha-diagnosis"
#: What makes it one of ours. Programs that make backups know a file of this name and beginning (bford.info/cachedir).
MARKER = "CACHEDIR.TAG"
_MARKER_TEXT = (
    "Signature: 8a477f597d28d172789f06886806bc55\n"
    "# What an unfinished bha diagnose goes on from. Remove the folder, and it starts anew.\n"
)
_LOCK = "lock"
_ENTRY = re.compile(rf"(?:{re.escape(UNFINISHED)}[^.]*\.)?[0-9a-f]{{24}}-[0-9a-f]{{32}}\.arrays")
_UNMARKED = re.compile(rf"{_LOCK}|(?:{re.escape(UNFINISHED)}[^.]*\.)?{re.escape(MARKER)}")
# A line of text before the arrays: what it is, and the checksum of what follows.
_MAGIC = b"bha-diagnosis/1 "
_HEADER = len(_MAGIC) + 64 + 1


def key_of(arm: str, records: Iterable[Record], options: Sequence[object]) -> str:
    """Hash of the inputs of a diagnosis."""
    digest = hashlib.sha256(f"{__version__} {GENERATION} {arm} {options!r}".encode())
    for record in records:
        digest.update(repr(record.channels).encode())
        for array in (record.drive.time, record.drive.pressures, record.measured, record.drive.forces):
            if array is not None:
                digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:24]


@contextmanager
def cache_folder(out: Path) -> Iterator[Path]:
    """The folder below ``out`` in which a diagnosis keeps what it has, for as long as the block runs.

    Raises:
        InputError: another diagnosis is at work there; or something of that name is there that none has made.
        FileError: it cannot be made.
    """
    folder = out / FOLDER
    _claim(folder)
    with locked(folder / _LOCK, "a diagnosis"):
        # Again: whoever held the lock until now may have taken the folder away with it.
        _claim(folder)
        if not (folder / MARKER).exists():
            with written_whole(folder / MARKER) as temporary:
                temporary.write_text(_MARKER_TEXT, encoding="ascii", newline="\n")
        try:
            yield folder
        finally:
            _give_up(folder)


def _claim(folder: Path) -> None:
    """Make the folder, or check that it is one of ours; one without marker is where only a lock or nothing is in it."""
    try:
        with suppress(FileExistsError):
            folder.mkdir()
        if not _is_folder(folder):
            raise InputError(
                f"{folder}: is a link or a file; bha diagnose needs that name for a folder of its own: "
                "move it away, or name another folder for the results"
            )
        strange = [] if _is_file(folder / MARKER) else [n for n in os.listdir(folder) if not _UNMARKED.fullmatch(n)]
    except OSError as error:
        raise FileError(f"{folder}: cannot be used: {way_out(error)}") from error
    if strange:
        raise InputError(
            f"{folder}: holds {min(strange)} and was not made by bha diagnose (there is no {MARKER}); "
            "move it away, or name another folder for the results"
        )


def _give_up(folder: Path) -> None:
    """Remove the folder if nothing but its marker and its lock is in it; what others put there stays, and it."""
    with suppress(OSError):
        if _is_folder(folder) and all(_UNMARKED.fullmatch(name) for name in os.listdir(folder)):
            for name in os.listdir(folder):
                if _is_file(folder / name):
                    (folder / name).unlink()
            folder.rmdir()


def _is_folder(path: Path) -> bool:
    """Whether a folder is there, no link to one."""
    try:
        return stat.S_ISDIR(os.lstat(path).st_mode)
    except OSError:
        return False


def _is_file(path: Path) -> bool:
    """Whether a regular file is there, no link to one."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except OSError:
        return False


class Cache:
    """Arrays by name; without a folder it holds nothing."""

    def __init__(self, folder: Path | None, key: str) -> None:
        """In ``folder``, from :func:`cache_folder`; what is there of other inputs is removed."""
        self.folder = folder
        self._key = key
        self._remove(lambda name: not name.startswith(f"{key}-"))

    def get(
        self, name: str, shapes: Mapping[str, tuple[int, ...]] | None = None
    ) -> dict[str, NDArray[np.float64]] | None:
        """The arrays stored under ``name``.

        Args:
            name: as given to :meth:`put`.
            shapes: of each array that is needed; if None all arrays, of any shape.

        Returns:
            The arrays; None if they are not there, or are damaged, of other shapes, no numbers or not finite.

        Warns:
            FileWarning: the file is damaged.
        """
        path = self._path(name)
        if path is None or not _is_file(path):
            return None
        try:
            with path.open("rb") as file:
                if not self._is_whole(file, name):
                    raise ValueError("checksum")
                with np.load(file, allow_pickle=False) as stored:
                    found = {key: stored[key] for key in (stored.files if shapes is None else shapes)}
        except Exception:  # a damaged file can raise anything: of zipfile, of zlib, of NumPy, MemoryError
            text = f"{path}: is damaged (its checksum is wrong); what it held is computed again"
            warnings.warn(text, FileWarning, stacklevel=2)
            return None
        fits = all(found[key].shape == shape for key, shape in (shapes or {}).items())
        numbers = all(array.dtype.kind == "f" and np.isfinite(array).all() for array in found.values())
        return found if fits and numbers else None

    def put(self, name: str, **arrays: NDArray[np.floating]) -> None:
        """Store arrays under ``name``.

        Warns:
            FileWarning: they cannot be stored, on a full disk for example; the diagnosis can do without.
        """
        path = self._path(name)
        if path is None:
            return
        try:
            with written_whole(path) as temporary, temporary.open("w+b") as file:
                file.write(bytes(_HEADER))
                np.savez(file, **arrays)  # type: ignore[arg-type]  # its stub takes allow_pickle from the names
                checksum = self._checksum(file, name)
                file.seek(0)
                file.write(_MAGIC + checksum + b"\n")
        except (FileError, InputError) as error:
            warnings.warn(f"{error}; if interrupted, the diagnosis begins anew", FileWarning, stacklevel=2)

    def clear(self) -> None:
        """Remove all of it: a finished diagnosis needs it no more."""
        self._remove(lambda _: True)

    def _remove(self, unwanted: Callable[[str], bool]) -> None:
        """Remove files of the cache, one by one, by names that only the cache gives."""
        if self.folder is None or not _is_folder(self.folder):
            return
        with suppress(OSError):  # a folder that cannot be listed, a file that cannot be removed: both do no harm
            for name in os.listdir(self.folder):
                if _ENTRY.fullmatch(name) and unwanted(name) and _is_file(self.folder / name):
                    (self.folder / name).unlink()

    def _is_whole(self, file: IO[bytes], name: str) -> bool:
        """Whether the checksum is right; leaves the file where its arrays begin."""
        header = file.read(_HEADER)
        whole = header == _MAGIC + self._checksum(file, name) + b"\n"
        file.seek(_HEADER)
        return whole

    def _checksum(self, file: IO[bytes], name: str) -> bytes:
        """Of what follows the header, and of what it is stored as: a file under another's name is not taken either."""
        file.seek(_HEADER)
        digest = hashlib.sha256(f"{self._key} {name}\n".encode())
        while block := file.read(1 << 20):
            digest.update(block)
        return digest.hexdigest().encode()

    def _path(self, name: str) -> Path | None:
        if self.folder is None:
            return None
        return self.folder / f"{self._key}-{hashlib.sha256(name.encode()).hexdigest()[:32]}.arrays"
