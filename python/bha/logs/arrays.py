"""Columns of a log from arrays in memory: plain real numbers as float64, everything else refused or named.

Tables of other libraries (pandas, polars, Arrow) are taken by what they can do, not by what they are, so that none of
these libraries is needed: a table has ``columns`` (or ``column_names``) and gives a column by its name; a column gives
its values by ``to_numpy`` and says by ``isna`` or ``is_null`` where there is none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_KINDS = {
    "b": "true or false",
    "c": "complex numbers",
    "M": "dates",
    "m": "durations",
    "U": "text",
    "S": "text",
    "T": "text",
    "V": "records",
}
_ADVICE = {
    "b": "write 0 and 1",
    "c": "give real and imaginary part in columns of their own",
    "M": "give seconds since some moment, as in (t - t[0]) / np.timedelta64(1, 's')",
    "m": "divide them by np.timedelta64(1, 's')",
}


class NotNumbersError(ValueError):
    """An array holds something else than plain real numbers. The text says what, and what to do."""


def numbers(given: Any, *, masked: bool = False) -> Array:
    """A new float64 array of plain real numbers; NaN where there is no value: None, or masked where ``masked`` allows.

    Arrays may be strided, unaligned, read-only or of the other byte order.

    Raises:
        NotNumbersError: text, dates, complex numbers, switches, masked values, numbers beyond the range of float64,
            ragged lists.
    """
    absent = np.ma.getmaskarray(given) if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given) else None
    if absent is not None and not masked:
        raise NotNumbersError(
            "holds masked values; missing=True takes them as missing samples, .filled(...) fills them"
        )
    try:
        array = np.asarray(np.ma.getdata(given) if isinstance(given, np.ma.MaskedArray) else given)
    except (ValueError, TypeError, OverflowError) as error:
        raise NotNumbersError(f"not an array of numbers: {str(error).partition('. ')[0]}") from error
    if array.dtype.kind == "O":
        values = _of_objects(array, absent)
    elif array.dtype.kind in "iuf":
        with np.errstate(over="ignore", invalid="ignore"):
            values = np.array(array, dtype=np.float64)
    else:
        raise _refusal(array.dtype.kind)
    if absent is not None:
        values[absent] = np.nan
    return values


def _of_objects(array: NDArray[Any], absent: NDArray[np.bool_] | None) -> Array:
    values = np.full(array.shape, np.nan)
    flat, masked = values.reshape(-1), None if absent is None else absent.reshape(-1)
    for place, entry in enumerate(array.reshape(-1).tolist()):
        if entry is None or (masked is not None and masked[place]):
            continue
        kind = "b" if isinstance(entry, bool | np.bool_) else "c" if isinstance(entry, complex) else ""
        kind = kind or ("U" if isinstance(entry, str | bytes) else "")
        if kind:
            raise _refusal(kind)
        if not isinstance(entry, Real | Decimal):
            raise NotNumbersError(f"holds {type(entry).__name__}; expected plain real numbers, best float64")
        try:
            flat[place] = float(entry)
        except (OverflowError, ValueError) as error:
            raise NotNumbersError("holds a number beyond the range of float64") from error
    return values


def _refusal(kind: str) -> NotNumbersError:
    advice = f"; {_ADVICE[kind]}" if kind in _ADVICE else ""
    return NotNumbersError(f"holds {_KINDS.get(kind, 'no numbers')}; expected plain real numbers, best float64{advice}")


def is_frame(given: object) -> bool:
    """Whether ``given`` looks like a table of another library: not a mapping, columns by name."""
    return not isinstance(given, Mapping) and _labels(given) is not None and hasattr(given, "__getitem__")


def frame_columns(frame: Any) -> Iterator[tuple[object, Any]]:
    """The columns of a table of another library, by heading; the index of a pandas table first, if it has a name.

    Raises:
        NotNumbersError: the table gives no columns.
    """
    labels = _labels(frame) or []
    index = getattr(frame, "index", None)
    name = getattr(index, "name", None)
    if index is not None and hasattr(index, "to_numpy") and isinstance(name, str) and name not in labels:
        yield name, index
    for label in labels:
        try:
            column = frame[label]
        except TypeError as error:
            raise NotNumbersError(f"a {type(frame).__name__} gives no column {label!r}: {error}") from error
        yield label, column


def frame_numbers(column: Any) -> Array:
    """As :func:`numbers`, of a column of a table of another library; NaN where it says that there is no value.

    Raises:
        NotNumbersError: as :func:`numbers`.
    """
    if not hasattr(column, "to_numpy"):
        return numbers(column)
    values = column.to_numpy()
    for question in ("isna", "is_null"):
        if hasattr(column, question):
            absent = np.asarray(getattr(column, question)(), dtype=bool)
            if absent.any() and values.dtype.kind == "O":
                values = np.where(absent, None, values)
            break
    return numbers(values)


def _labels(frame: Any) -> list[object] | None:
    """The names of a table's columns; None for what is no table, or one that has yet to be collected."""
    if hasattr(type(frame), "collect"):
        return None
    for attribute in ("column_names", "columns"):
        labels = getattr(frame, attribute, None)
        if labels is not None and not callable(labels) and isinstance(labels, Iterable):
            return list(labels)
    return None
