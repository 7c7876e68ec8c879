"""Writing TOML back: values change, the user's comments, order and spelling of unchanged numbers stay."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, InlineTable, Item


def merged_toml(mapping: Mapping[str, Any], text: str | None) -> str:
    """The TOML of ``mapping``; laid out like ``text``, the file it came from, if there is one."""
    if text is not None:
        try:
            document = tomlkit.parse(text)
            _merge(document, mapping)
            merged = tomlkit.dumps(document)
            # A layout that the editor cannot keep is given up rather than written wrong.
            if tomllib.loads(merged) == mapping:
                return merged
        except (TOMLKitError, tomllib.TOMLDecodeError):
            pass
    document = tomlkit.document()
    for name, value in mapping.items():
        document.add(name, _item(name, value))
    return tomlkit.dumps(document)


def _merge(table: Any, mapping: Mapping[str, Any]) -> None:
    for name in [name for name in table if name not in mapping]:
        del table[name]
    for name, value in mapping.items():
        old = table.get(name)
        if isinstance(old, dict) and isinstance(value, dict) and not isinstance(old, InlineTable):
            _merge(old, value)
        elif isinstance(old, AoT) and isinstance(value, list) and len(old) == len(value):
            for old_entry, entry in zip(old, value, strict=True):
                _merge(old_entry, entry)
        elif old is None or old.unwrap() != value:
            table[name] = _item(name, value)
            if old is not None:
                _said_of(table[name], old)


# A comment that begins with a unit says what the value is, not where it comes from: it holds for any value.
_OF_ANY_VALUE = re.compile(r"#\s*(kg|K|m|N|Pa|rad|s|1/s)\b")
_SAID_OF = re.compile(r"\(said of [^()]*\)$")


def _said_of(item: Item, old: Any) -> None:
    """Lets the comment beside a changed value say of which value it was written."""
    comment = item.trivia.comment
    if comment and not _OF_ANY_VALUE.match(comment) and not _SAID_OF.search(comment):
        value = old.unwrap()
        text = old.as_string() if isinstance(value, int | float | str) else "another value"
        item.trivia.comment = f"{comment} (said of {text})"


def _item(name: str, value: Any) -> Item:
    if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
        tables = tomlkit.aot()
        for entry in value:
            tables.append(_table(entry))
        return tables
    if isinstance(value, dict):
        table: Item = _table(value, inline_entries=name == "provenance")
        return table
    item: Item = tomlkit.item(value)
    return item


def _table(mapping: Mapping[str, Any], *, inline_entries: bool = False) -> Any:
    table = tomlkit.table()
    for name, value in mapping.items():
        table.add(name, _inline(value) if inline_entries and isinstance(value, dict) else _item(name, value))
    return table


def _inline(mapping: Mapping[str, Any]) -> InlineTable:
    """One line per value: ``damping = { status = "identified", ... }``."""
    table = tomlkit.inline_table()
    for name, value in mapping.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            array = tomlkit.array()
            for entry in value:
                array.append(_inline(entry))
            table.append(name, array)
        else:
            table.append(name, value)
    return table
