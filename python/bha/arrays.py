"""Whatever stands for numbers, as a plain array: the one door for arrays from outside, in Python and in the core.

Plain real numbers come in, in any layout: lists, strided, reversed, unaligned and read-only arrays, other byte orders,
integers, other precisions. What is no plain real number is refused by the argument's name rather than turned into one:
masked values, complex numbers, dates, texts, truth values, objects, values that are not finite.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError

#: What an array of another kind holds, by NumPy's letter for it.
_KINDS = {
    "b": "truth values",
    "c": "complex numbers",
    "m": "spans of time",
    "M": "dates",
    "O": "objects",
    "S": "texts",
    "T": "texts",
    "U": "texts",
    "V": "records",
}
Shape = tuple[int | None, ...]


def floats(value: Any, name: str, *shapes: Shape, finite: bool = True) -> NDArray[np.float64]:
    """``value`` as a contiguous, aligned float64 array in the machine's byte order; the same array where it is one.

    Args:
        value: anything that NumPy makes an array of.
        name: of the argument, for errors.
        shapes: the shapes that are allowed, None for any extent; any shape if there are none.
        finite: whether NaN and infinity are refused.

    Raises:
        InputError: it is not an array of plain real numbers, or of another shape, or a value is not finite.
    """
    general = _general(value, name, shapes)
    if general.dtype.kind not in "fiu":
        raise InputError(
            f"{name}: {_wanted(shapes)} is needed; found "
            f"{_KINDS.get(general.dtype.kind, 'something else')} (dtype {general.dtype})"
        )
    if shapes and not any(_fits(general.shape, shape) for shape in shapes):
        raise InputError(f"{name}: expected{_of_shape(shapes, ' shape ')}, found {list(general.shape)}")
    with np.errstate(over="ignore"):  # a wider float beyond the range becomes infinite, which is refused below
        array = np.require(general, dtype=np.float64, requirements=["C_CONTIGUOUS", "ALIGNED"])
    if finite and not np.isfinite(array).all():
        k = int(np.argmin(np.isfinite(array.reshape(-1))))
        found = _text(array.reshape(-1)[k])
        if array.ndim == 0:
            raise InputError(f"{name}: {found}; a finite number is needed")
        raise InputError(f"{name}: element {k} is {found}; finite numbers are needed")
    return array


def _general(value: Any, name: str, shapes: tuple[Shape, ...]) -> NDArray[Any]:
    """``value`` as an array of whatever kind; nothing in it is masked."""
    parts = value if isinstance(value, list | tuple) else (value,)
    if any(isinstance(part, np.ma.MaskedArray) and np.ma.is_masked(part) for part in parts):
        raise InputError(f"{name}: some of its values are masked; fill them in, or leave out the rows that have them")
    try:
        general = np.asarray(value)
    except MemoryError:
        raise
    except Exception as error:  # an object's own conversion may raise anything
        raise InputError(f"{name}: {_wanted(shapes)} is needed; {error}") from error
    return general


def _fits(found: tuple[int, ...], shape: Shape) -> bool:
    return len(found) == len(shape) and all(w is None or w == f for f, w in zip(found, shape, strict=True))


def _wanted(shapes: tuple[Shape, ...]) -> str:
    return "a number" if shapes == ((),) else f"an array of floats{_of_shape(shapes)}"


def _of_shape(shapes: Iterable[Shape], before: str = " of shape ") -> str:
    texts = []
    for shape in shapes:
        parts = ", ".join("any" if extent is None else str(extent) for extent in shape)
        texts.append(f"({parts}{',' if len(shape) == 1 else ''})")
    return before + " or ".join(texts) if texts else ""


def _text(value: float) -> str:
    """As the core writes it: NaN, inf, -inf."""
    return "NaN" if np.isnan(value) else str(value)
