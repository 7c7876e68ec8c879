"""MATLAB files up to version 7 (``save -v7`` and older), read by SciPy; those of 7.3 are HDF5.

Objects (``timeseries``, ``Simulink.SimulationData.Dataset``, ``timetable``) are stored in a way that only MATLAB knows;
they are named, with what to do in MATLAB.
"""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bha.errors import LogError
from bha.logs.foreign.series import Said, named_faults
from bha.support.extras import import_extra

#: What to do with objects that only MATLAB can read.
OBJECTS = (
    "in MATLAB: s.time = ts.Time; s.data = ts.Data; save('run.mat', 's'), or let Simulink log as 'Structure with time'"
)


def tree(path: Path, origin: str, wanted: Sequence[str], said: Said) -> dict[str, Any]:
    """The variables of a file as mappings, lists and arrays.

    Args:
        path: the file.
        origin: what errors call it.
        wanted: sources of which the variables are loaded; all if there are none.
        said: gets the names of objects that cannot be read.

    Raises:
        LogError: damaged, cut off, or no MATLAB file.
        MissingExtraError: SciPy is not installed.
    """
    scipy_io = import_extra("scipy.io", extra="mat", purpose="Reading MATLAB files")
    names = {re.split(r"[.\[]", source)[0] for source in wanted}
    with named_faults(origin, "the MATLAB file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        listed = {name: kind for name, _, kind in scipy_io.whosmat(str(path))}
    for name in names - set(listed):
        near = difflib.get_close_matches(name, listed, n=1, cutoff=0.5)
        hint = f"nearest: '{near[0]}'" if near else f"the file has: {', '.join(listed) or 'none'}"
        raise LogError(f"{origin}: there is no array '{name}'; {hint}")
    with named_faults(origin, "the MATLAB file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        chosen = [name for name in listed if not names or name in names or name.lower() in _TIMES]
        loaded = scipy_io.loadmat(str(path), simplify_cells=True, variable_names=chosen or None)
    found: dict[str, Any] = {}
    for name, value in loaded.items():
        if name.startswith("__") or name not in listed:
            continue
        plain = _plain(value)
        if plain is None or listed[name] in ("opaque", "object", "function"):
            said.doubts.append(f"{name} is an object of MATLAB, which cannot be read; {OBJECTS}")
        else:
            found[name] = plain
    for name, kind in listed.items():
        if kind in ("opaque", "object") and name not in loaded:
            said.doubts.append(f"{name} is an object of MATLAB, which cannot be read; {OBJECTS}")
    return found


_TIMES = ("t", "time", "tout")


def _plain(value: Any) -> Any:  # noqa: PLR0911  (a table of cases)
    """Structs as mappings, struct arrays and cells as lists, arrays and texts as they are; None for objects."""
    if isinstance(value, dict):
        inner = {str(key): _plain(entry) for key, entry in value.items()}
        return {key: entry for key, entry in inner.items() if entry is not None}
    if isinstance(value, str):
        return value
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, bool | int | float | np.number):
        return np.asarray(value)
    if not isinstance(value, np.ndarray):
        return None
    if value.dtype.names is not None:
        return None
    if value.dtype.kind == "O":
        return [_plain(entry) for entry in value.reshape(-1).tolist()]
    if value.dtype.kind in "US":
        return [str(entry) for entry in value.reshape(-1).tolist()]
    return value
