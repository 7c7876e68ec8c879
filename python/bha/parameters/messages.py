"""What is wrong with a parameter file, in words: file, line, key, found, allowed."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from bha.parameters.base import GREATEST, LEAST, nearest
from bha.parameters.provenance import STATUS_ALLOWED, Provenance

MOST_FAULTS_SHOWN = 10
LONGEST_VALUE_SHOWN = 60
# Bits of a whole number that is shown digit by digit.
_LONGEST_INTEGER = 10_000

Location = tuple[str | int, ...]


def unreadable(path: str | os.PathLike[str], error: OSError | ValueError, what: str = "parameter file") -> str:
    """The file cannot be opened."""
    if isinstance(error, FileNotFoundError):
        return f"{os.fspath(path)}: there is no such file"
    if isinstance(error, IsADirectoryError):
        return f"{os.fspath(path)}: is a folder; name a {what} (.toml)"
    return f"{os.fspath(path)}: cannot be read: {error.strerror if isinstance(error, OSError) else error}"


def not_text(origin: str, error: UnicodeDecodeError) -> str:
    """The file is in another encoding, or no text."""
    return f"{origin}: not a TOML file: byte {error.start} is not UTF-8 text; save it as UTF-8"


def not_toml(origin: str, text: str, error: Exception) -> str:
    """The file is not TOML; a key given twice is named."""
    if isinstance(error, RecursionError):
        return f"{origin}: not a TOML file: nested too deeply"
    what = str(error)
    if "integer string conversion" in what:
        long = re.search(r"[0-9_]{4000,}", text)
        line_number = text.count("\n", 0, long.start()) + 1 if long else 1
        key = text.split("\n")[line_number - 1].partition("=")[0].strip()[:LONGEST_VALUE_SHOWN]
        return f"{origin}, line {line_number}: {key}: found a number of thousands of digits; allowed: a finite number"
    line = re.search(r"at line (\d+)", what)
    if line and "overwrite a value" in what:
        key = text.split("\n")[int(line[1]) - 1].partition("=")[0].strip()
        return f"{origin}, line {line[1]}: {key} is given twice; remove one of the two"
    elsewhere = (
        "" if origin.lower().endswith(".toml") or origin.startswith("<") else "; name a file that ends with .toml"
    )
    return f"{origin}: not a TOML file: {what}{elsewhere}"


def wrong_schema(origin: str, mapping: Mapping[str, Any], schema: str, what: str = "a parameter file of an arm") -> str:
    """The file is TOML but not ``what`` of this version."""
    if "schema" not in mapping:
        return f'{origin}: schema: missing; {what} begins with: schema = "{schema}"'
    return f'{origin}: schema: found {shown(mapping["schema"])}; allowed: "{schema}"'


def invalid(
    origin: str, error: ValidationError, model: type[BaseModel], mapping: Mapping[str, Any], text: str | None
) -> str:
    """Every fault that the check of a parameter file found, one a line."""
    lines = KeyLines(text or "")
    shown_faults: dict[str, None] = {}
    shown_places: set[Location] = set()
    more: set[Location] = set()
    found = error.errors(include_url=False)
    above = {fault["loc"][:depth] for fault in found for depth in range(len(fault["loc"]))}
    for fault in found:
        # Entries with faults are not counted as entries; that the list is then too short is no fault of its own.
        if fault["type"] == "too_short" and fault["loc"] in above:
            continue
        # The key itself, which pydantic names last, is in the text.
        way = fault["loc"][: -1 if fault["type"] == "invalid_key" else -2] if _is_of_key(fault) else fault["loc"]
        location, table, name = _locate(model, way + _blamed(fault))
        # Texts are costly, and a file may have thousands of faults.
        if len(shown_faults) >= MOST_FAULTS_SHOWN:
            if location not in shown_places:
                more.add(location)
            continue
        shown_places.add(location)
        where = _place(origin, lines, location)
        shown_faults[where + _fault_text(fault, location, table, name, mapping)] = None
    return "\n".join([*shown_faults, *([f"... and {len(more)} more"] if more else [])])


def at(origin: str, text: str | None, location: Location, message: str) -> str:
    """A fault at a key of a file that was found after the check of the file itself."""
    return _place(origin, KeyLines(text or ""), location) + message


def _place(origin: str, lines: KeyLines, location: Location) -> str:
    line = lines.of(location)
    return (f"{origin}, line {line}: " if line else f"{origin}: ") + _path_text(location)


def shown(value: Any) -> str:
    """A value as found, clipped to a readable length."""
    if isinstance(value, dict):
        text = "a table"
    elif isinstance(value, list | tuple) and any(isinstance(entry, dict) for entry in value):
        text = f"a list of {len(value)} tables"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, str):
        text = f'"{value}"'
    elif isinstance(value, int) and value.bit_length() > _LONGEST_INTEGER:
        # Python refuses to print thousands of digits.
        text = f"a number of about {math.ceil(value.bit_length() * math.log10(2))} digits"
    else:
        text = _repr(value)
    return _clipped(text)


def _clipped(text: str) -> str:
    return text if len(text) <= LONGEST_VALUE_SHOWN else text[: LONGEST_VALUE_SHOWN - 3] + "..."


def _repr(value: Any) -> str:
    try:
        return repr(value)
    except Exception:
        # Whole numbers of thousands of digits in a list, or whatever a caller's own class has in mind.
        return f"a {type(value).__name__} that cannot be shown"


def _blamed(fault: Any) -> Location:
    """The key that a check of a whole table blames."""
    key = fault.get("ctx", {}).get("key", "")
    if isinstance(key, tuple):
        return key
    parts = key.split(".") if key else ()
    return tuple(int(part) if part.isascii() and part.isdecimal() else part for part in parts)


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
    return text + (".".join(_clipped(str(part)) for part in rest) + ": " if rest else "")


def _fault_text(fault: Any, location: Location, table: type[BaseModel], name: str, mapping: Mapping[str, Any]) -> str:
    kind = fault["type"]
    if kind == "bha_table" or _is_of_key(fault):
        return str(fault["msg"]) if kind == "bha_table" else f"found the key {shown(fault['input'])}; keys are texts"
    if kind == "extra_forbidden":
        return "unknown key" + nearest(name, list(_fields(table)))
    if kind == "missing" and fault["loc"] and fault["loc"][-1] == name:
        return f"missing; allowed: {_fields(table)[name].description}"
    if not name:
        allowed = f"{STATUS_ALLOWED}, or a table with these as its status" if table is Provenance else "a table"
        return f"found {shown(_value_at(mapping, location, fault['input']))}; allowed: {allowed}"
    found = shown(_value_at(mapping, location, fault["input"])) + _beyond_size(fault)
    if kind == "bha_range":
        return f"found {found}: {fault['msg']}; allowed: {_fields(table)[name].description}"
    return f"found {found}; allowed: {_fields(table)[name].description}"


def _is_of_key(fault: Any) -> bool:
    """Whether a key itself is at fault: mappings may have keys that are no text, files cannot."""
    return fault["type"] == "invalid_key" or (fault["loc"][-1:] == ("[key]",) and not isinstance(fault["input"], str))


def _beyond_size(fault: Any) -> str:
    """Why a number is refused that only its size is wrong with."""
    limits = fault.get("ctx", {})
    if limits.get("le") == GREATEST or limits.get("ge") == -GREATEST:
        return f", too great to compute with (above {GREATEST:g})"
    if limits.get("ge") == LEAST and fault["input"] > 0:
        return f", too small to compute with (below {LEAST:g})"
    return ""


def _value_at(mapping: Any, location: Location, otherwise: Any) -> Any:
    """The value in the file; ``otherwise`` where the file has a short form that the location does not fit."""
    for part in location:
        try:
            mapping = mapping[part]
        except (KeyError, IndexError, TypeError):
            return otherwise
    return mapping


# No two quantifiers that can match the same character stand side by side, so that no line takes long.
_HEADER = re.compile(r"\s*(\[\[?)([A-Za-z0-9_.\- \t\"']*)\]")
_KEY = re.compile(r"\s*([A-Za-z0-9_-]+)\s*[=.]")


class KeyLines:
    """Lines of the keys of a TOML text, found once for all faults of a file.

    A hint for people, found by headers and keys at the start of lines; the parser itself does not keep positions.
    """

    def __init__(self, text: str) -> None:
        """Keep the text; nothing is looked for before the first question."""
        self._text = text
        self._tables: dict[Location, int] = {}
        self._keys: dict[Location, int] = {}
        self._read = False

    def of(self, location: Location) -> int | None:
        """Line of a key; that of its table where the key is not there; None where neither is found."""
        if not self._read:
            self._find()
            self._read = True
        for end in range(len(location), 0, -1):
            if line := self._keys.get(location[:end]) or self._tables.get(location[:end]):
                return line
        return None

    def _find(self) -> None:
        counts: dict[Location, int] = {}
        current: Location = ()
        for number, line in enumerate(self._text.split("\n"), start=1):
            if header := _header(line):
                current = ()
                opening, parts = header
                for depth, part in enumerate(parts):
                    path = (*current, part)
                    if opening == "[[" and depth == len(parts) - 1:
                        counts[path] = counts.get(path, -1) + 1
                    current = (*path, counts[path]) if path in counts else path
                self._tables.setdefault(current, number)
            elif key := _KEY.match(line):
                self._keys.setdefault((*current, key[1]), number)


def _header(line: str) -> tuple[str, list[str]] | None:
    """Opening bracket and parts of a header, ``[section.provenance]``; None for a line that is none."""
    found = _HEADER.match(line)
    if found is None or not found[2].strip():
        return None
    rest = line[found.end() :].removeprefix("]").lstrip()
    if rest and not rest.startswith("#"):
        return None
    return found[1], [part.strip().strip("\"'") for part in found[2].split(".")]
