"""What kind of file a log is, by its first bytes; a folder by what lies in it."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

Kind = Literal["bag", "matlab", "hdf5"]

_HDF5 = b"\x89HDF\r\n\x1a\n"


def kind_of(path: Path) -> Kind | None:
    """The kind of a foreign file; None for tables of text, Parquet, what comes through a pipe or cannot be opened."""
    try:
        if path.is_dir():
            return "bag" if (path / "metadata.yaml").is_file() else None
        if not path.is_file():  # a pipe can be read once
            return None
        with path.open("rb") as file:
            start = file.read(1024)
    except (OSError, ValueError):
        return None
    # A table of text is one whatever its name ends with.
    return _by_content(path, start) or (None if _is_text(start) else _by_name(path))


def _by_content(path: Path, start: bytes) -> Kind | None:
    if start.startswith((b"#ROSBAG V", b"\x89MCAP")) or (start.startswith(b"SQLite format 3") and _ends(path, ".db3")):
        return "bag"
    # MATLAB 7.3 puts a text of 512 bytes before what is HDF5.
    if _HDF5 in (start[:8], start[512:520]):
        return "hdf5"
    if start.startswith(b"MATLAB") or (_ends(path, ".mat") and b"\0" in start[:20]):
        return "matlab"
    return None


def _is_text(start: bytes) -> bool:
    """Whether the first bytes are at least one line of plain text."""
    printable = set(range(0x20, 0x100)) | set(b"\t\r\n")
    return b"\n" in start and printable.issuperset(start)


def _by_name(path: Path) -> Kind | None:
    """What a file claims to be that is cut off within its first bytes, or damaged there: its reader says so."""
    if _ends(path, ".bag", ".mcap", ".db3"):
        return "bag"
    if _ends(path, ".mat"):
        return "matlab"
    return "hdf5" if _ends(path, ".h5", ".hdf5", ".hdf") else None


def _ends(path: Path, *endings: str) -> bool:
    return path.name.lower().endswith(endings)
