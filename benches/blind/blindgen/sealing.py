"""Sealed answers: a commitment is public before the product sees a log, the answer stays elsewhere.

Commitment of a case: SHA-256 over 32 random bytes of salt and the bytes of ``answer.json``. The salt is drawn from
the operating system, not from the case's seed, so that nobody who knows the generator can try answers against the
commitment.
"""

import hashlib
import json
import os
import secrets
from pathlib import Path
from typing import Any

ANSWER, SALT = "answer.json", "salt.hex"


class SealError(ValueError):
    """An answer does not match its commitment."""


def write_whole(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    os.replace(temporary, path)


def digest(salt: bytes, answer: bytes) -> str:
    """The commitment."""
    return hashlib.sha256(salt + answer).hexdigest()


def seal(answer: dict[str, Any], case: str, sealed: Path, commitments: Path) -> str:
    """Publish the commitment, then lay the answer aside; returns the commitment."""
    text = json.dumps(answer, indent=1, sort_keys=True) + "\n"
    salt = secrets.token_bytes(32)
    commitment = digest(salt, text.encode())
    write_whole(commitments / f"{case}.sha256", f"{commitment}  {case}\n")
    folder = sealed / case
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    write_whole(folder / SALT, salt.hex() + "\n")
    write_whole(folder / ANSWER, text)
    return commitment


def write_list(commitments: Path, target: Path) -> int:
    """Gather the single commitments into one sorted list; returns their number."""
    lines = sorted(path.read_text(encoding="utf-8").strip() for path in commitments.glob("*.sha256"))
    write_whole(target, "\n".join(sorted(lines, key=lambda line: line.split()[1])) + "\n")
    return len(lines)


def unseal(case: str, sealed: Path, commitments: Path) -> dict[str, Any]:
    """Read an answer and check it against its commitment. Raises SealError."""
    text = (sealed / case / ANSWER).read_bytes()
    salt = bytes.fromhex((sealed / case / SALT).read_text(encoding="utf-8").strip())
    published = (commitments / f"{case}.sha256").read_text(encoding="utf-8").split()
    if published != [digest(salt, text), case]:
        raise SealError(
            f"{case}: the sealed answer does not match the published commitment; it was changed after sealing"
        )
    answer: dict[str, Any] = json.loads(text)
    return answer
