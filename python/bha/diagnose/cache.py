"""What a diagnosis has computed so far, on disk, so that an interrupted one goes on where it stopped.

The folder's name is the hash of everything the results depend on: the arm, the logs' numbers, the options, the version
of the package. Arrays only, no pickles: a file from elsewhere can at worst be refused.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bha import __version__
from bha.diagnose.records import Record
from bha.files import written_whole

#: Raise it when results change for the same inputs.
GENERATION = 1


def key_of(arm: str, records: Iterable[Record], options: Sequence[object]) -> str:
    """Hash of the inputs of a diagnosis."""
    digest = hashlib.sha256(f"{__version__} {GENERATION} {arm} {options!r}".encode())
    for record in records:
        digest.update(repr(record.channels).encode())
        for array in (record.time, record.pressures, record.outputs, record.forces):
            if array is not None:
                digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:24]


class Cache:
    """Arrays by name; without a folder it holds nothing."""

    def __init__(self, folder: Path | None, key: str) -> None:
        """Below ``folder``; results of other inputs that lie there are removed."""
        self.folder = None if folder is None else folder / key
        if folder is not None and folder.is_dir():
            for other in folder.iterdir():
                if other.name != key and other.is_dir():
                    shutil.rmtree(other, ignore_errors=True)

    def get(self, name: str) -> dict[str, NDArray[np.float64]] | None:
        """The arrays stored under ``name``; None if there are none or the file is damaged."""
        path = self._path(name)
        if path is None or not path.exists():
            return None
        try:
            with np.load(path, allow_pickle=False) as stored:
                return {key: stored[key] for key in stored.files}
        except (OSError, ValueError, EOFError, KeyError):
            return None

    def put(self, name: str, **arrays: NDArray[np.floating]) -> None:
        """Store arrays under ``name``."""
        path = self._path(name)
        if path is None:
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]  # its stub takes allow_pickle from the names

    def clear(self) -> None:
        """Remove everything: a finished diagnosis needs it no more."""
        if self.folder is not None:
            shutil.rmtree(self.folder.parent, ignore_errors=True)

    def _path(self, name: str) -> Path | None:
        return None if self.folder is None else self.folder / f"{hashlib.sha256(name.encode()).hexdigest()[:32]}.npz"
