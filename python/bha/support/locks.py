"""One process at a time: locks of the operating system, which go however their holder ends, ``kill -9`` included."""

from __future__ import annotations

import os
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bha.errors import FileError, InputError, way_out

#: Not there on every system; links are then told by their status alone.
NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
_FLAGS = os.O_RDWR | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0) | NO_FOLLOW
# How often a lock file may vanish between its opening and its locking before something else is wrong.
_ATTEMPTS = 20


@contextmanager
def locked(path: Path, what: str) -> Iterator[None]:
    """Keep other processes (and other threads) out while the block runs; the file says who is in.

    The file stays where it is. Whoever holds the lock may remove it: others then start with a new one.

    Args:
        path: the lock file, in a folder that exists; made if it is not there.
        what: what runs, for the error of those that are kept out: ``"a sweep"``.

    Raises:
        InputError: another process is at it; the text names it. Or the file system knows no locks.
        FileError: the file cannot be opened.
    """
    descriptor = _acquired(path, what)
    try:
        since = time.strftime("%Y-%m-%d %H:%M:%S")
        with suppress(OSError):  # a full disk: the lock holds all the same
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()}, since {since}\n".encode())
        yield
    finally:
        unlock(descriptor)


def _acquired(path: Path, what: str) -> int:
    for _ in range(_ATTEMPTS):
        try:
            descriptor = os.open(path, _FLAGS | os.O_CREAT, 0o666)
        except OSError as error:
            raise FileError(f"{path}: cannot be opened: {way_out(error)}") from error
        try:
            free = try_lock(descriptor)
        except OSError as error:
            os.close(descriptor)
            raise InputError(
                f"{path}: the file system knows no locks ({error.strerror or error}), so two runs could mix there; "
                "name a folder on another disk"
            ) from error
        if not free:
            holder = os.read(descriptor, 200).decode(errors="replace").partition("\n")[0]
            os.close(descriptor)
            raise InputError(
                f"{path.parent}: another process is running {what} there ({holder or 'it has only begun'}); "
                "wait for it, end it, or name another folder"
            )
        if same_file(descriptor, path):
            return descriptor
        unlock(descriptor)  # its holder removed it in between
    raise InputError(f"{path}: is removed again and again by others; name another folder")


def try_lock(descriptor: int) -> bool:
    """Lock an open file for this process alone; False if another holds it.

    Raises:
        OSError: the file system knows no locks.
    """
    try:
        _lock(descriptor)
    except (BlockingIOError, PermissionError):
        return False
    return True


def same_file(descriptor: int, path: Path) -> bool:
    """Whether ``path`` still names the regular file that is open."""
    try:
        there = os.lstat(path)
    except OSError:
        return False
    return stat.S_ISREG(there.st_mode) and os.path.samestat(os.fstat(descriptor), there)


if os.name == "nt":
    import msvcrt

    # Beyond what the file holds, so that others may read who is in.
    _PLACE = 1 << 30

    def _lock(descriptor: int) -> None:
        os.lseek(descriptor, _PLACE, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        finally:
            os.lseek(descriptor, 0, os.SEEK_SET)

    def unlock(descriptor: int) -> None:
        """Give the lock back and close the file."""
        with suppress(OSError):
            os.lseek(descriptor, _PLACE, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_UNLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        os.close(descriptor)
else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def unlock(descriptor: int) -> None:
        """Give the lock back, from forked processes too, and close the file."""
        with suppress(OSError):  # where there are no locks there is none to give back
            fcntl.flock(descriptor, fcntl.LOCK_UN)
        os.close(descriptor)
