"""Files are written whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bha.errors import InputError


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file under a temporary name beside ``path`` and move it there when the block ends well.

    Whoever reads ``path`` meanwhile sees the old file or the new one, never a part of it. If the block raises, the
    temporary file is removed and ``path`` stays as it was.

    Yields:
        The temporary path to write to. It ends like ``path``, so that formats chosen by extension stay the same.

    Raises:
        InputError: the folder of ``path`` does not exist, or ``path`` is a folder.
    """
    # Resolved first, so that a link keeps pointing where it points and the move stays on one file system.
    target = Path(path).resolve()
    if not target.parent.is_dir():
        raise InputError(f"{target}: the folder {target.parent} does not exist; create it first")
    if target.is_dir():
        raise InputError(f"{target}: is a folder; name a file")
    temporary = target.with_name(f".{secrets.token_hex(4)}.{target.name}")
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
