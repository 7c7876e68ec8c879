"""HDF5 files and MATLAB files of version 7.3, read by h5py; arrays are loaded when they are mapped.

MATLAB stores arrays with their axes reversed, texts as numbers, and struct arrays and cells as references.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.logs.foreign.matlab import OBJECTS
from bha.logs.foreign.series import Said, named_faults
from bha.support.extras import import_extra

_DEEPEST = 12
_UNITS = ("units", "unit", "Units", "Unit")
_MATLAB = "MATLAB_class"


@dataclass(frozen=True)
class Lazy:
    """An array that is read when NumPy asks for it."""

    dataset: Any
    column: str | None
    reversed_axes: bool
    unit: str

    @property
    def shape(self) -> tuple[int, ...]:
        """Its shape, as MATLAB shows it where MATLAB wrote it."""
        shape = tuple(int(n) for n in self.dataset.shape)
        return shape[::-1] if self.reversed_axes else shape

    @property
    def dtype(self) -> Any:
        """Type of its entries."""
        return self.dataset.dtype if self.column is None else self.dataset.dtype[self.column]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Read it."""
        values = self.dataset[()] if self.column is None else self.dataset[self.column]
        array = np.asarray(values, dtype=dtype)
        return array.T if self.reversed_axes else array


@contextmanager
def opened(path: Path, origin: str, said: Said) -> Iterator[tuple[dict[str, Any], str]]:
    """The tree of a file while it is open, and what separates names in it.

    Raises:
        LogError: damaged or cut off.
        MissingExtraError: h5py is not installed.
    """
    h5py = import_extra("h5py", extra="hdf5", purpose="Reading HDF5 files and MATLAB files of version 7.3")
    with named_faults(origin, "the HDF5 file"):
        file = h5py.File(path, "r")
    try:
        with named_faults(origin, "the HDF5 file"):
            matlab = _is_matlab(path) or any(_MATLAB in item.attrs for item in file.values() if item is not None)
            reader = _Reader(h5py, file, matlab, said)
            tree = {name: reader.of(file.get(name), name, _DEEPEST) for name in file if not name.startswith("#")}
        yield {name: node for name, node in tree.items() if node is not None}, "." if matlab else "/"
    finally:
        file.close()


def _is_matlab(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(6) == b"MATLAB"


class _Reader:
    """Groups, datasets and references of one file as a tree."""

    def __init__(self, h5py: Any, file: Any, matlab: bool, said: Said) -> None:
        self._h5py, self._file, self._matlab, self._said = h5py, file, matlab, said

    def of(self, item: Any, name: str, depth: int) -> Any:  # noqa: PLR0911  (a table of cases)
        """A node; None for what is nothing that could be mapped (broken links, objects, texts in HDF5)."""
        if item is None or depth < 0:
            return None
        if isinstance(item, self._h5py.Group):
            return self._group(item, name, depth)
        if not isinstance(item, self._h5py.Dataset):
            return None
        kind = item.attrs.get(_MATLAB, b"")
        kind = kind.decode() if isinstance(kind, bytes) else str(kind)
        if self._h5py.check_ref_dtype(item.dtype) is not None:
            return [self._deref(reference, name, depth) for reference in np.ravel(item[()])]
        if self._matlab and kind == "char":
            return "".join(chr(int(code)) for code in np.ravel(item[()]))
        if self._matlab and kind not in ("", *_NUMBERS):
            self._said.doubts.append(f"{name} is an object of MATLAB ({kind}), which cannot be read; {OBJECTS}")
            return None
        if "MATLAB_empty" in item.attrs:
            return None
        unit = next((_text(item.attrs[key]) for key in _UNITS if key in item.attrs), "")
        if item.dtype.names is not None:
            inner = {column: Lazy(item, column, self._matlab, "") for column in item.dtype.names}
            return {column: node for column, node in inner.items() if node.dtype.kind in "iufb"}
        if item.shape is None or item.dtype.kind not in "iufb":
            return None
        return Lazy(item, None, self._matlab, unit)

    def _group(self, group: Any, name: str, depth: int) -> Any:
        if self._matlab and group and (size := self._references(group)):
            # A struct array: each of its fields is a row of references.
            return [
                {key: self._deref(np.ravel(group[key][()])[k], f"{name}.{key}", depth - 1) for key in group}
                for k in range(size)
            ]
        inner = {key: self.of(group.get(key), f"{name}.{key}", depth - 1) for key in group}
        return {key: node for key, node in inner.items() if node is not None}

    def _references(self, group: Any) -> int:
        """Number of entries of a struct array; 0 for a struct."""
        sizes = set()
        for key in group:
            item = group.get(key)
            if not isinstance(item, self._h5py.Dataset) or self._h5py.check_ref_dtype(item.dtype) is None:
                return 0
            if _MATLAB in item.attrs:  # a cell in a field of a struct
                return 0
            sizes.add(int(item.size))
        return sizes.pop() if len(sizes) == 1 else 0

    def _deref(self, reference: Any, name: str, depth: int) -> Any:
        return self.of(self._file[reference], name, depth - 1) if reference else None


_NUMBERS = (
    "double", "single", "logical", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
    "struct", "cell",
)  # fmt: skip


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value if isinstance(value, str) else ""
