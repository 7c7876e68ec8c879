"""What is wrong with a parameter file, in words: file, line, key, found, allowed."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from bha.parameters.base import nearest
from bha.parameters.provenance import STATUS_ALLOWED, Provenance

MOST_FAULTS_SHOWN = 10
LONGEST_VALUE_SHOWN = 60

Location = tuple[str | int, ...]


def unreadable(path: str | os.PathLike[str], error: OSError, what: str = "parameter file") -> str:
    """The file cannot be opened."""
    if isinstance(error, FileNotFoundError):
        return f"{os.fspath(path)}: there is no such file"
    if isinstance(error, IsADirectoryError):
        return f"{os.fspath(path)}: is a folder; name a {what} (.toml)"
    return f"{os.fspath(path)}: cannot be read: {error.strerror}"


def not_toml(origin: str, text: str, error: Exception) -> str:
    """The file is not TOML; a key given twice is named."""
    if isinstance(error, RecursionError):
        return f"{origin}: not a TOML file: nested too deeply"
    what = str(error)
    line = re.search(r"at line (\d+)", what)
    if line and "overwrite a value" in what:
        key = text.split("\n")[int(line[1]) - 1].partition("=")[0].strip()
        return f"{origin}, line {line[1]}: {key} is given twice; remove one of the two"
    return f"{origin}: not a TOML file: {what}"


def wrong_schema(origin: str, mapping: Mapping[str, Any], schema: str, what: str = "a parameter file of an arm") -> str:
    """The file is TOML but not ``what`` of this version."""
    if "schema" not in mapping:
        return f'{origin}: schema: missing; {what} begins with: schema = "{schema}"'
    return f'{origin}: schema: found {shown(mapping["schema"])}; allowed: "{schema}"'


def invalid(
    origin: str, error: ValidationError, model: type[BaseModel], mapping: Mapping[str, Any], text: str | None
) -> str:
    """Every fault that the check of a parameter file found, one a line."""
    faults: dict[str, None] = {}
    found = error.errors()
    for fault in found:
        # Entries with faults are not counted as entries; that the list is then too short is no fault of its own.
        depth = len(fault["loc"])
        if fault["type"] == "too_short" and any(f["loc"][:depth] == fault["loc"] != f["loc"] for f in found):
            continue
        location, table, name = _locate(model, fault["loc"] + _blamed(fault))
        line = key_line(text, location) if text is not None else None
        where = f"{origin}, line {line}: " if line else f"{origin}: "
        faults[where + _path_text(location) + _fault_text(fault, location, table, name, mapping)] = None
    lines = list(faults)
    more = len(lines) - MOST_FAULTS_SHOWN
    return "\n".join(lines[:MOST_FAULTS_SHOWN] + ([f"... and {more} more"] if more > 0 else []))


def at(origin: str, text: str | None, location: Location, message: str) -> str:
    """A fault at a key of a file that was found after the check of the file itself."""
    line = key_line(text, location) if text is not None else None
    return (f"{origin}, line {line}: " if line else f"{origin}: ") + _path_text(location) + message


def shown(value: Any) -> str:
    """A value as found, clipped to a readable length."""
    text = str(value).lower() if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) else repr(value)
    if isinstance(value, dict):
        text = "a table"
    elif isinstance(value, list | tuple) and any(isinstance(entry, dict) for entry in value):
        text = f"a list of {len(value)} tables"
    return text if len(text) <= LONGEST_VALUE_SHOWN else text[: LONGEST_VALUE_SHOWN - 3] + "..."


def _blamed(fault: Any) -> Location:
    """The key that a check of a whole table blames."""
    key = fault.get("ctx", {}).get("key", "")
    return tuple(int(part) if part.isdigit() else part for part in key.split(".")) if key else ()


def _locate(model: type[BaseModel], loc: Location) -> tuple[Location, type[BaseModel], str]:
    """The part of pydantic's location that is a path in the file, its innermost table and the key in it.

    Pydantic adds positions within lists and names of union members; the fault is that of the whole value.
    """
    table, name = model, ""
    path: list[str | int] = []
    for part in loc:
        if isinstance(part, int):
            if name and _table_of(table, name) is not None:
                table, name = _table_of(table, name) or table, ""
                path.append(part)
                continue
            break
        if name == "provenance":
            table, name = Provenance, ""
            path.append(part)
            continue
        if name:
            inner = _table_of(table, name)
            if inner is None:
                break
            table = inner
        name = part
        path.append(part)
    return tuple(path), table, name


def _table_of(table: type[BaseModel], key: str) -> type[BaseModel] | None:
    """The model of the tables that stand under a key, if tables stand there."""
    field = _fields(table).get(key)
    pending = [field.annotation] if field is not None else []
    while pending:
        annotation = pending.pop()
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            return annotation
        pending.extend(get_args(annotation))
    return None


def _fields(table: type[BaseModel]) -> dict[str, Any]:
    return {field.alias or name: field for name, field in table.model_fields.items()}


def _path_text(location: Location) -> str:
    """``section 2, bellows 3: stiffness: ``, counting from 1 as people do."""
    tables, rest = [], list(location)
    while len(rest) >= 2 and isinstance(rest[1], int):
        tables.append(f"{rest[0]} {rest[1] + 1}")
        rest = rest[2:]
    text = ", ".join(tables) + ": " if tables else ""
    return text + (".".join(str(part) for part in rest) + ": " if rest else "")


def _fault_text(fault: Any, location: Location, table: type[BaseModel], name: str, mapping: Mapping[str, Any]) -> str:
    kind = fault["type"]
    if kind == "bha_table":
        return str(fault["msg"])
    if kind == "extra_forbidden":
        return "unknown key" + nearest(name, list(_fields(table)))
    if kind == "missing" and fault["loc"] and fault["loc"][-1] == name:
        return f"missing; allowed: {_fields(table)[name].description}"
    if not name:
        allowed = f"{STATUS_ALLOWED}, or a table with these as its status" if table is Provenance else "a table"
        return f"found {shown(_value_at(mapping, location, fault['input']))}; allowed: {allowed}"
    found = shown(_value_at(mapping, location, fault["input"]))
    if kind == "bha_range":
        return f"found {found}: {fault['msg']}; allowed: {_fields(table)[name].description}"
    return f"found {found}; allowed: {_fields(table)[name].description}"


def _value_at(mapping: Any, location: Location, otherwise: Any) -> Any:
    """The value in the file; ``otherwise`` where the file has a short form that the location does not fit."""
    for part in location:
        if not isinstance(mapping, dict | list | tuple):
            return otherwise
        mapping = mapping[part]  # type: ignore[index]  # pydantic's location has an int for a list, a key for a table
    return mapping


_HEADER = re.compile(r"^\s*(\[\[?)\s*([A-Za-z0-9_.\- ]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"^\s*([A-Za-z0-9_-]+)\s*[=.]")


def key_line(text: str, location: Location) -> int | None:
    """Line of a key in a TOML text; that of its table where the key is not there; None where neither is found.

    A hint for people, found by headers and keys at the start of lines; the parser itself does not keep positions.
    """
    tables: dict[Location, int] = {}
    keys: dict[Location, int] = {}
    counts: dict[Location, int] = {}
    current: Location = ()
    for number, line in enumerate(text.split("\n"), start=1):
        if header := _HEADER.match(line):
            current = ()
            parts = [part.strip() for part in header[2].split(".")]
            for depth, part in enumerate(parts):
                path = (*current, part)
                if header[1] == "[[" and depth == len(parts) - 1:
                    counts[path] = counts.get(path, -1) + 1
                current = (*path, counts[path]) if path in counts else path
            tables.setdefault(current, number)
        elif key := _KEY.match(line):
            keys.setdefault((*current, key[1]), number)
    for end in range(len(location), 0, -1):
        if line_number := keys.get(location[:end]) or tables.get(location[:end]):
            return line_number
    return None
