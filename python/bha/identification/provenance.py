"""How well numbers of a parameter file are known, written beside them: interval, standard error, the logs' hashes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bha.estimation.records import Record
from bha.parameters import ArmParameters
from bha.parameters.tables import table_of


@dataclass(frozen=True)
class Mark:
    """What is known of one number.

    Attributes:
        path: where it stands.
        interval: 95 % interval; None where it is not known.
        standard_error: its standard error; None likewise.
        told: whether logs tell it; if not it counts as assumed.
        note: what a reader must know besides, or nothing.
        logs: the logs that it rests on.
    """

    path: str
    interval: tuple[float, float] | None
    standard_error: float | None
    told: bool = True
    note: str = ""
    logs: tuple[Record, ...] = ()

    @classmethod
    def of_error(cls, path: str, value: float, standard_error: float, logs: Sequence[Record]) -> Mark:
        """A number that was found, with a normal error."""
        reach = 1.96 * standard_error
        return cls(path, (value - reach, value + reach), standard_error, logs=tuple(logs))


def marked(parameters: ArmParameters, marks: Iterable[Mark]) -> ArmParameters:
    """The parameters with the provenance of some numbers; of a list, what else is in it counts as it stands."""
    mapping = parameters.to_mapping()
    done: dict[int, set[str]] = {}
    for mark in marks:
        table, key, place = table_of(mapping, mark.path)
        interval, error = None if mark.interval is None else list(mark.interval), mark.standard_error
        references = [{"name": Path(r.name).name, "sha256": r.sha256} for r in mark.logs if r.sha256 is not None]
        entry = table.setdefault("provenance", {})
        old = entry.get(key)
        fresh = key not in done.setdefault(id(table), set())
        done[id(table)].add(key)
        if place is None:
            entry[key] = _entry(mark.told, interval, error, references, mark.note)
            continue
        if interval is None:
            entry[key] = _entry(False, None, None, references, _joined(old, mark.note, fresh))
            continue
        values = table[key]
        if fresh or not isinstance(old, dict):
            old = _entry(mark.told, [[v, v] for v in values], [0.0] * len(values), references, mark.note)
        elif mark.note:
            old = {**old, "source": _joined(old, mark.note, fresh)}
        if mark.told:
            old["status"] = "identified"
        old["ci95"][place] = interval
        old["standard_error"][place] = error
        entry[key] = old
    return parameters.updated(mapping)


def _joined(old: Any, note: str, fresh: bool) -> str:
    """The notes on a list so far, and one more."""
    before = old.get("source", "") if isinstance(old, dict) and not fresh else ""
    return "; ".join(filter(None, [before, note]))


def _entry(identified: bool, interval: Any, error: Any, references: list[dict[str, Any]], note: str) -> dict[str, Any]:
    entry: dict[str, Any] = {"status": "identified" if identified else "assumed"}
    if note:
        entry["source"] = note
    if interval is not None:
        entry |= {"ci95": interval, "standard_error": error}
    if references:
        entry["logs"] = references
    return entry
