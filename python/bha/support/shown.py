"""How objects show themselves: in a line, as a table in notebooks, as a table of pandas."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from bha.support.extras import import_extra

T = TypeVar("T")

#: Rows of a table in a notebook; of more the number is told.
MOST_ROWS = 40
#: Numbers stand to the right, all else to the left.
_NUMBER, _TEXT = "text-align:right", "text-align:left"


def short_repr(cls: type[T]) -> type[T]:
    """Class decorator, above ``@dataclass``: its repr says of arrays their shapes, not their numbers.

    >>> @short_repr
    ... @dataclass
    ... class Pair:
    ...     name: str
    ...     values: Any
    >>> Pair("a", np.zeros((3, 2)))
    Pair(name='a', values=<array (3, 2)>)
    """

    def represent(self: Any) -> str:
        shown = [f"{field.name}={_brief(getattr(self, field.name))}" for field in fields(self) if field.repr]
        return f"{type(self).__qualname__}({', '.join(shown)})"

    represent.__doc__ = "Fields in a line; of arrays their shapes."
    cls.__repr__ = represent  # type: ignore[method-assign]
    return cls


def _brief(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"<array {value.shape}>"
    if isinstance(value, np.ndarray):
        return repr(value.tolist())
    return repr(value)


def html_table(
    title: str,
    headings: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    notes: Sequence[str] = (),
    most: int = MOST_ROWS,
) -> str:
    """A table for a notebook: plain HTML, everything escaped; floats by :func:`number`, None as nothing.

    Args:
        title: a line above it.
        headings: of the columns; none are shown if there are no rows.
        rows: cells, as many as headings.
        notes: lines below it.
        most: how many rows are shown; of more the number is told.
    """
    every = [tuple(row) for row in rows]
    parts = [f"<div><b>{html.escape(title)}</b>"]
    if every:
        head = "".join(f'<th style="{_TEXT}">{html.escape(heading)}</th>' for heading in headings)
        body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in every[:most])
        parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
    if len(every) > most:
        notes = [f"and {len(every) - most} more", *notes]
    parts += [f"<div>{html.escape(note)}</div>" for note in notes]
    return "".join(parts) + "</div>"


def _cell(value: object) -> str:
    if value is None:
        return "<td></td>"
    if isinstance(value, bool | np.bool_):
        return f'<td style="{_TEXT}">{"yes" if value else "no"}</td>'
    if isinstance(value, int | float | np.integer | np.floating):
        return f'<td style="{_NUMBER}">{html.escape(number(float(value)))}</td>'
    return f'<td style="{_TEXT}">{html.escape(str(value))}</td>'


def number(value: float) -> str:
    """A number with at most five digits that count; nothing for NaN."""
    return "" if math.isnan(value) else f"{value:.5g}"


def span(low: float, high: float, unit: str = "") -> str:
    """``0.1 to 0.3 m``."""
    return f"{number(low)} to {number(high)}{' ' if unit else ''}{unit}"


def frame(columns: Mapping[str, Any], index: str | None = None) -> Any:
    """A ``pandas.DataFrame`` of columns by name, one of them as index.

    Raises:
        MissingExtraError: pandas is not installed.
    """
    pandas = import_extra("pandas", extra="pandas", purpose="Making a DataFrame")
    made = pandas.DataFrame(dict(columns))
    return made if index is None else made.set_index(index)
