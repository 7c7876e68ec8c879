"""Files are written whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bha.errors import FileError, InputError, way_out
from bha.support.locks import NO_FOLLOW, same_file, try_lock, unlock

#: How the names of files begin that are not whole yet. What a killed process left of one goes when it is written again.
UNFINISHED = ".bha-tmp"
# Names may have 255 bytes; of longer ones the temporary name has the end, for formats are chosen by extension.
_LONGEST_NAME = 200


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file under a temporary name beside ``path`` and move it there when the block ends well.

    Whoever reads ``path`` meanwhile sees the old file or the new one, never a part of it. If the block raises, the
    temporary file is removed and ``path`` stays as it was. A file that is overwritten keeps its permissions.

    Yields:
        The temporary path to write to. It ends like ``path``, so that formats chosen by extension stay the same.

    Raises:
        InputError: the folder of ``path`` does not exist, or ``path`` is a folder, a device or a pipe.
        FileError: the system refuses the file: a full disk, no permission, a name too long.
    """
    target, before = _target(path)
    try:
        temporary, descriptor = _created(target, before)
    except OSError as error:
        raise FileError(f"{target}: cannot be written: {way_out(error)}") from error
    held = True
    try:
        yield temporary
        if before is not None:
            _take_over(temporary, before)
        if os.name == "nt":  # which moves no open file
            held = False
            unlock(descriptor)
        os.replace(temporary, target)
    except OSError as error:
        # Other files that the block works on have their own names in their errors; a pipe is none of ours, and what has
        # no number does not come from the system.
        if (
            isinstance(error, FileError)
            or error.errno in (None, errno.EPIPE)
            or error.filename not in (None, str(temporary))
        ):
            raise
        raise FileError(f"{target}: cannot be written: {way_out(error)}") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if held:
            unlock(descriptor)


def check_target(path: str | os.PathLike[str] | None, *, keep: Iterable[str | os.PathLike[str]] = ()) -> None:
    """Check that a file could be written, before the work whose result it is to hold; nothing is made. None is fine.

    Args:
        path: of the file.
        keep: files that it must not be: what was measured is there once.

    Raises:
        InputError, FileError: as :func:`written_whole`.
    """
    if path is None:
        return
    target, before = _target(path)
    if before is not None and any(_is(before, other) for other in keep):
        raise InputError(f"{os.fspath(path)}: is a log that is read, and logs stay as they are; choose another name")
    if not os.access(target.parent, os.W_OK):
        error = OSError(errno.EACCES, os.strerror(errno.EACCES))
        raise FileError(f"{target}: cannot be written: {way_out(error)}")


def _is(status: os.stat_result, path: str | os.PathLike[str]) -> bool:
    """Whether a path is that of a file with this status; not so for one that cannot be asked."""
    try:
        return os.path.samestat(status, os.stat(path))
    except (OSError, ValueError):
        return False


def _target(path: str | os.PathLike[str]) -> tuple[Path, os.stat_result | None]:
    """The file that a path stands for, and its status where it is there."""
    if "\0" in os.fspath(path):
        raise InputError(f"{os.fspath(path)!r}: a path has no zero character")
    try:
        # Resolved first, so that a link keeps pointing where it points and the move stays on one file system.
        target = Path(path).resolve()
        before = _status(target)
        if before is None and not target.parent.is_dir():
            raise InputError(f"{target}: the folder {target.parent} does not exist; create it first")
    except (OSError, RuntimeError) as error:  # a circle of links is one of these, whatever the version of Python
        raise FileError(f"{os.fspath(path)}: cannot be written: {_said(error)}") from error
    if before is not None and stat.S_ISDIR(before.st_mode):
        raise InputError(f"{target}: is a folder; name a file")
    if before is not None and not stat.S_ISREG(before.st_mode):
        raise InputError(f"{target}: is a device or a pipe, which cannot be written whole; name a file")
    return target, before


def make_folder(path: str | os.PathLike[str]) -> Path:
    """The folder of that name, made with those above it if it is not there.

    Raises:
        InputError: something else is there.
        FileError: the system refuses it.
    """
    folder = Path(path)
    if "\0" in os.fspath(path):
        raise InputError(f"{os.fspath(path)!r}: a path has no zero character")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise InputError(f"{folder}: is a file; name a folder") from error
    except OSError as error:
        raise FileError(f"{folder}: cannot be a folder for results: {way_out(error)}") from error
    return folder


def _said(error: OSError | RuntimeError) -> str:
    return way_out(error) if isinstance(error, OSError) else str(error)


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return None


def _created(target: Path, before: os.stat_result | None) -> tuple[Path, int]:
    """A new empty file beside ``target``, open and locked for as long as it is written.

    Its name is always the same, so that one that a killed process left behind is found: it is locked by nobody. Where
    another process writes ``target`` just now, the name is a free one.
    """
    name = target.name if len(os.fsencode(target.name)) <= _LONGEST_NAME else target.name[-_LONGEST_NAME // 5 :]
    mode = 0o666 if before is None else stat.S_IMODE(before.st_mode) | stat.S_IRUSR | stat.S_IWUSR
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | NO_FOLLOW | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    temporary = target.with_name(f"{UNFINISHED}.{name}")
    while True:
        try:
            descriptor = os.open(temporary, flags, mode)
        except FileExistsError:
            if not remove_abandoned(temporary):
                temporary = target.with_name(f"{UNFINISHED}-{secrets.token_hex(4)}.{name}")
            continue
        try:
            # Without locks nothing is ever taken for abandoned, and all else is as with them.
            mine = try_lock(descriptor)
        except OSError:
            return temporary, descriptor
        if mine and same_file(descriptor, temporary):
            return temporary, descriptor
        os.close(descriptor)
        temporary = target.with_name(f"{UNFINISHED}-{secrets.token_hex(4)}.{name}")


def remove_abandoned(temporary: Path) -> bool:
    """Remove the temporary file of a process that is no more; whether it is gone."""
    try:
        descriptor = os.open(temporary, os.O_RDWR | NO_FOLLOW | getattr(os, "O_NONBLOCK", 0))
    except FileNotFoundError:
        return True
    except OSError:
        return False
    try:
        if not (try_lock(descriptor) and same_file(descriptor, temporary)):
            os.close(descriptor)
            return False
    except OSError:
        os.close(descriptor)
        return False
    try:
        if os.name == "nt":
            unlock(descriptor)
            descriptor = -1
        temporary.unlink()
    except OSError:
        return False
    finally:
        if descriptor >= 0:
            unlock(descriptor)
    return True


def _take_over(temporary: Path, before: os.stat_result) -> None:
    """Give a file the owner and the permissions of the one that it replaces."""
    if hasattr(os, "chown"):
        now = temporary.stat()
        if (now.st_uid, now.st_gid) != (before.st_uid, before.st_gid):
            with suppress(OSError):  # only the superuser may give files away
                os.chown(temporary, before.st_uid, before.st_gid)
    temporary.chmod(stat.S_IMODE(before.st_mode))
