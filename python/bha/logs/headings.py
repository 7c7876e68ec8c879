"""Headings of a log's table: taken apart, and what to say where they are not what is needed."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

from bha import names
from bha.errors import LogError
from bha.logs.units import measures

# What people call the time, in small letters and without separators.
_TIME_WORDS = frozenset(
    ("t", "time", "times", "timesec", "timestamp", "timestamps", "seconds", "sec", "secs", "elapsed", "elapsedtime")
)
PARENTHESES = ("(", ")")
_SHOWN = 40
_MOST_NAMES_SHOWN = 30


def named(heading: str, brackets: tuple[str, str] = ("[", "]")) -> tuple[str, str | None]:
    """Name and unit of a heading, ``("p11", "kPa(g)")`` of ``p11 [kPa(g)]``; None for a unit that is not there."""
    opening, closing = brackets
    name, found, rest = heading.partition(opening)
    # Units have parentheses of their own, kPa(g), but no brackets.
    nested = opening == "[" and any(bracket in name + rest[:-1] for bracket in brackets)
    if not found or not rest.endswith(closing) or nested:
        return heading, None
    return name.rstrip(), rest[:-1].strip()


def heading_parts(heading: str) -> tuple[str, str | None]:
    """Name and unit of a heading of whatever brackets, ``("p11", "kPa")`` of ``p11 (kPa)`` too."""
    name, unit = named(heading)
    return (name, unit) if unit is not None else named(heading, PARENTHESES)


def shortened(text: str) -> str:
    """The beginning of a text that may be long."""
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."


def no_column(origin: str, name: object, available: Iterable[str]) -> str:
    """The text of an error: a column is not there; the nearest name that is."""
    return f"{origin}: there is no column '{name}'{_nearest(str(name), available)}"


def no_time(origin: str, headings: Sequence[str], available: Iterable[str]) -> str:
    """The text of an error: there is no column of time; the heading that seems to be meant for it."""
    text = f"{origin}: there is no column of time, '{names.column(names.TIME, 's')}'"
    for heading in headings:
        if proposal := as_time(heading):
            return f"{text}; column '{heading}' is not known; did you mean '{proposal}'? Rename it"
    return text + _nearest(names.TIME, available)


def refuse_other_layouts(origin: str, headings: Sequence[str], opening: Sequence[str]) -> None:
    """An error where the first line of a text holds no headings of a log but a line below it does, or not by commas.

    Raises:
        LogError: with the line that seems to hold the headings, or what separates them.
    """
    if not opening or not headings:
        return
    cells = _cells(headings[0]) if len(headings) == 1 else list(headings)
    if any(map(_is_known, cells)):
        if len(cells) > len(headings):
            separator = next((mark for mark in headings[0] if mark in ";\t"), None)
            text = f"the headings are separated by {separator!r}; expected commas, and points as decimal marks"
            if separator is None:
                text = "all headings stand in one pair of quotes, or a quote is not closed; remove it"
            raise LogError(f"{origin}, line 1: {text}")
        return
    first = next((number for number, line in enumerate(opening, start=1) if line.strip()), 1)
    found = f"{origin}, line {first} is no line of headings: found '{shortened(','.join(headings))}'"
    for number, line in enumerate(opening[first:], start=first + 1):
        if any(map(_is_known, _cells(line))):
            raise LogError(f"{found}; they seem to begin in line {number}: remove the lines above it")
    if all(map(_is_number, cells)):
        like = ", ".join(f"'{names.column(*each)}'" for each in ((names.TIME, "s"), ("p11", "kPa(g)"), ("q11", "mm")))
        raise LogError(f"{found}, which are numbers; write the columns' names and units above them, such as {like}")
    if headings[0].lower().startswith(("sep=", "#")):
        marked = headings[0].lstrip("#").strip()
        advice = "remove the '#'" if _is_known(marked) else "remove the lines above the headings"
        raise LogError(f"{found}; {advice}")


def _cells(line: str) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in re.split(r"[,;\t]", line)]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _is_known(heading: str) -> bool:
    """Whether a heading is that of a quantity or of a time, however it is spelt."""
    if not heading:
        return False
    name, _ = heading_parts(heading)
    return names.quantity(re.sub(r"[\s_.,:-]", "", name).lower()) is not None or as_time(heading) is not None


def as_time(heading: str) -> str | None:
    """The heading of a column of time that seems to be meant, ``t [ms]`` of ``Time (ms)``; None if none is."""
    name, unit = heading_parts(heading)
    if re.sub(r"[\s_.,:#-]", "", name).lower() not in _TIME_WORDS:
        return None
    spelt = next((other for other in (unit or "", (unit or "").lower()) if measures(other, "s")), "s")
    return names.column(names.TIME, "s" if spelt in ("seconds", "sec", "secs") else spelt)


def _nearest(name: str, available: Iterable[str]) -> str:
    available = [other for other in available if other]
    near = difflib.get_close_matches(name[:_SHOWN], available[:1000], n=1, cutoff=0.6)
    if near:
        return f"; nearest: '{near[0]}'"
    more = f", ... and {len(available) - _MOST_NAMES_SHOWN} more" if len(available) > _MOST_NAMES_SHOWN else ""
    return f"; the log has: {', '.join(available[:_MOST_NAMES_SHOWN]) or 'none'}{more}"
