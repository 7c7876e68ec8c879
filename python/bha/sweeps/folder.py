"""The folder of a sweep: what it is a sweep of, its partitions, and who may write there.

``sweep.json`` says what the results follow from; ``part-000000.parquet`` and so on hold the runs, each whole or not
there. What is there and whole is never computed again, and nothing else is read back, so a sweep goes on from any end.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError

from bha.errors import FileError, FileWarning, InputError, way_out
from bha.support.files import UNFINISHED, make_folder, written_whole
from bha.support.locks import locked as process_locked
from bha.sweeps.group import columns
from bha.sweeps.partitions import DamagedError, check_partition, partition_path, partitions_in
from bha.sweeps.plan import Plan

MANIFEST = "sweep.json"
SCHEMA = "bha-sweep-run/1"
_LOCK = ".lock"
# What `written_whole` leaves where it is killed, this version's and those before it.
_LEFTOVER = re.compile(rf"(?:{re.escape(UNFINISHED)}[^.]*|\.[0-9a-f]{{8}})\.(?:sweep\.json|part-\d{{6,}}\.parquet)")

_Count = Annotated[int, Field(strict=True, ge=1)]


class _Column(BaseModel):
    model_config = ConfigDict(strict=True)

    unit: str
    meaning: str


class _Metrics(BaseModel):
    """Of the spec what a summary needs; the rest is for people."""

    model_config = ConfigDict(extra="allow", strict=True)

    metrics: list[str]


class Manifest(BaseModel):
    """What ``sweep.json`` says; ``checksum`` is that of all the rest."""

    model_config = ConfigDict(strict=True)

    schema_name: Literal["bha-sweep-run/1"] = Field(alias="schema")
    fingerprint: str
    parts: dict[str, str]
    runs: _Count
    partition_size: _Count
    partitions: _Count
    arm: str
    columns: dict[str, _Column]
    spec: _Metrics
    checksum: str = ""
    _whole: bool = PrivateAttr(default=False)

    @property
    def whole(self) -> bool:
        """Whether the checksum is right."""
        return self._whole


def manifest(folder: Path, *, checked: bool = True) -> Manifest:
    """What ``sweep.json`` says.

    Args:
        folder: of the sweep.
        checked: whether its checksum must be right. Whoever compares it with a plan needs none.

    Raises:
        InputError: there is none, it is none of this version, or it is damaged.
        FileError: it cannot be read.
    """
    path = folder / MANIFEST
    try:
        content = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InputError(f"{folder}: holds no sweep: there is no {MANIFEST}") from error
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {way_out(error)}") from error
    try:
        mapping = json.loads(content)
        if not isinstance(mapping, dict) or mapping.get("schema") != SCHEMA:
            raise InputError(f'{path}: schema: allowed: "{SCHEMA}"; {_MEND}')
        found = Manifest.model_validate(mapping)
        found._whole = found.checksum == _checksum(mapping)
    except ValidationError as error:
        fault = error.errors()[0]
        text = f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}"
        raise InputError(f"{path}: is damaged: {text}; {_MEND}") from error
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        text = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"{path}: is damaged: {text}; {_MEND}") from error
    if checked and not found.whole:
        raise InputError(f"{path}: is damaged (its checksum is wrong); {_MEND}")
    return found


_MEND = f"remove {MANIFEST}, and the same sweep goes on from its partitions, or name another folder"


def _checksum(mapping: Mapping[str, Any]) -> str:
    """Of everything but the checksum itself."""
    rest = {key: value for key, value in mapping.items() if key != "checksum"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def check_vacant(folder: Path) -> None:
    """Check that nothing but what sweeps write is in a folder; nothing is made or changed.

    Raises:
        InputError: something else is there.
        FileError: the folder cannot be read.
    """
    try:
        there = sorted(os.listdir(folder))
    except FileNotFoundError:
        return
    except NotADirectoryError as error:
        what = "is a file" if folder.exists() else "lies below a file"
        raise InputError(f"{folder}: {what}; name a folder") from error
    except OSError as error:
        raise FileError(f"{folder}: cannot be read: {way_out(error)}") from error
    if MANIFEST in there:
        return
    ours = {partition_path(folder, number).name for number in partitions_in(folder)} | {_LOCK}
    others = [name for name in there if name not in ours and not _LEFTOVER.fullmatch(name)]
    if others:
        raise InputError(f"{folder}: holds {others[0]} and no sweep; name a folder that is empty or new")


def prepare(folder: Path, plan: Plan) -> None:
    """Make the folder that of ``plan``, or check that it is already; call with the lock held.

    Raises:
        InputError: it is that of another sweep, or holds something else.
        FileError: it cannot be written.
    """
    check_vacant(folder)
    if (folder / MANIFEST).exists():
        found = manifest(folder, checked=False)
        if found.fingerprint != plan.fingerprint:
            raise InputError(_difference(folder, found.parts, plan.parts))
        if found.partition_size != plan.spec.partition_size:
            text = (
                f"{folder}: its partitions have {found.partition_size} runs, the spec wants {plan.spec.partition_size}"
            )
            raise InputError(f"{text}; set partition_size back, or name another folder")
        if found.whole:
            return
        text = f"{folder / MANIFEST}: is damaged (its checksum is wrong); it is written again"
        warnings.warn(text, FileWarning, stacklevel=2)
    with written_whole(folder / MANIFEST) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.write(json.dumps(_content(plan), indent=1) + "\n")
        # A file that has its name after a power failure has its content too.
        file.flush()
        os.fsync(file.fileno())


def _difference(folder: Path, found: Mapping[str, str], wanted: Mapping[str, str]) -> str:
    def shown(text: str | None) -> str:
        return "none" if text is None else text if len(text) < 32 else text[:12]

    differ = [
        f"{name} ({shown(found.get(name))} there, {shown(wanted.get(name))} here)"
        for name in dict.fromkeys([*found, *wanted])
        if found.get(name) != wanted.get(name)
    ] or ["the fingerprint"]
    return f"{folder}: holds another sweep; these differ: {', '.join(differ)}. Name another folder, or remove this one"


def _content(plan: Plan) -> dict[str, Any]:
    content = {
        "schema": SCHEMA,
        "fingerprint": plan.fingerprint,
        "parts": plan.parts,
        "runs": plan.runs,
        "partition_size": plan.spec.partition_size,
        "partitions": plan.partitions,
        "arm": plan.arm.name,
        "columns": {name: {"unit": unit, "meaning": meaning} for name, (_, unit, meaning) in columns(plan).items()},
        "spec": plan.spec.to_mapping(),
    }
    return content | {"checksum": _checksum(content)}


def checked_partitions(folder: Path, plan: Plan) -> set[int]:
    """The partitions that are there and whole, each looked at whether it is one of this sweep.

    What killed processes left is removed. Call with the lock held.

    Raises:
        InputError: a file that bears the name of a partition is not one of this sweep.
        FileError: one cannot be read.

    Warns:
        FileWarning: a partition is damaged and counts as not there.
    """
    with suppress(OSError):  # what cannot be removed does no harm
        for name in os.listdir(folder):
            if _LEFTOVER.fullmatch(name) and (folder / name).is_file() and not (folder / name).is_symlink():
                (folder / name).unlink()
    whole = set()
    for partition in partitions_in(folder):
        runs = len(plan.runs_of(partition)) if partition < plan.partitions else None
        try:
            check_partition(folder, partition, plan.fingerprint, runs)
        except DamagedError:
            path = partition_path(folder, partition)
            if runs is None:  # nobody would compute it again
                raise
            text = f"{path}: is damaged or cut off (its checksum is wrong); its runs are computed again"
            warnings.warn(text, FileWarning, stacklevel=2)
        else:
            whole.add(partition)
    return whole


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other sweeps out of a folder, which is made if it is not there.

    Raises:
        InputError: another process is at it, or something else is in the folder.
        FileError: the folder cannot be made or written to.
    """
    check_vacant(folder)
    make_folder(folder)
    with process_locked(folder / _LOCK, "a sweep"):
        yield
