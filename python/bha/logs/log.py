"""Measured logs: pressures, lengths, head positions and forces over time, read from files and checked.

A log is a table with one row per sample. Sample times may be irregular and may repeat, and a sensor may hold its last
value; that a value is not there is an error, unless the caller says that samples of measured outputs may be missing.
Columns are named with their unit, in any order (``bha.names``)::

    t [s], p11 [kPa(g)], p12 [kPa(g)], q11 [mm], x1 [m], y1 [m], z1 [m], fx1 [N]

Values are converted to SI and gauge pressures to absolute ones. Columns of other names are kept in their own unit.
"""

from __future__ import annotations

import functools
import os
import warnings
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import names
from bha.errors import InputError, LogError, LogWarning
from bha.logs import arrays, formats
from bha.logs.content import Content, of_columns, of_file
from bha.logs.foreign.mapping import mapping_given
from bha.logs.formats import Progress
from bha.logs.headings import no_column
from bha.support.shown import frame, html_table, span

STANDARD_ATMOSPHERE = 101325.0  # Pa

Array = NDArray[np.float64]


class Log:
    """A measured log of m rows. Arrays are float64, read-only and in SI units.

    Create one with :meth:`read`, :meth:`from_arrays` or :meth:`from_frame`. Logs are equal if their columns, units and
    ambient pressures are, wherever they come from.

    Attributes:
        time: time of each row, s, shape (m,), never decreasing.
        columns: names of all columns, in the order of the file.
        units: unit of each column's values: SI for the names of ``bha.names``, that of the file for others.
        headings: the heading of each column as it stands in the file.
        ignored: columns that hold something else than numbers, or no heading, with the reason.
        gauge_columns: names of the pressures that the file has as gauge pressure; here they are absolute.
        ambient_pressure: what gauge pressures were taken relative to, Pa.
        missing: whether samples of measured outputs may be missing; they are NaN.
        path: the file, or None.
        sha256: SHA-256 of the file, hexadecimal, or None; of a mapped one, of file and mapping together.
        notes: how the file was read where that does not go without saying: which times count, what was held.
    """

    def __init__(
        self,
        values: Mapping[str, Array],
        units: Mapping[str, str],
        *,
        ambient_pressure: float,
        gauge_columns: Collection[str] = (),
        ignored: Mapping[str, str] = MappingProxyType({}),
        headings: Mapping[str, str] = MappingProxyType({}),
        missing: bool = False,
        path: Path | None = None,
        sha256: str | None = None,
        notes: Collection[str] = (),
    ) -> None:
        """Hold columns that have been checked; use :meth:`read` or :meth:`from_arrays`."""
        self._values = dict(values)
        for array in self._values.values():
            array.flags.writeable = False
        self.units: Mapping[str, str] = MappingProxyType(dict(units))
        self.ignored: Mapping[str, str] = MappingProxyType(dict(ignored))
        self.headings: Mapping[str, str] = MappingProxyType(dict(headings))
        self.missing = missing
        self.gauge_columns = tuple(gauge_columns)
        self.ambient_pressure = ambient_pressure
        self.path = path
        self.sha256 = sha256
        self.notes = tuple(notes)

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        ambient_pressure: float = STANDARD_ATMOSPHERE,
        columns: Collection[str] | None = None,
        missing: bool = False,
        mapping: str | os.PathLike[str] | Mapping[str, Any] | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Read a log from a file of any known format; its first bytes decide which it is.

        CSV (plain or gzip) and Parquet; with a mapping, which says what is which column, also ROS bags and MCAP, MATLAB
        and HDF5. Memory needed is that of the columns, 8 bytes a value, and little more. What comes through a pipe is
        kept in a temporary file meanwhile.

        Args:
            path: the file.
            ambient_pressure: what gauge pressures are relative to, Pa: that of the arm.
            columns: names of the columns to read beside the time; all if None.
            missing: whether empty cells and NaN (also NA, null, -) are missing samples, NaN in the log. Time, pressures
                and forces can miss none.
            mapping: a mapping file, or what it amounts to; left out, one beside the log: ``FILE.columns.toml`` or, for
                formats that need one, ``columns.toml``.
            progress: called with the fraction done, from 0 to 1, about 20 times a second and at the end.

        Raises:
            LogError: the file cannot be read as a log; the text names file, line (row in Parquet) and column.
            MissingExtraError: Parquet without pyarrow, bags without rosbags, MATLAB without SciPy, HDF5 without h5py.

        Warns:
            LogWarning: the last line has no line end, so its last number may have been cut; a unit of a size that no
                arm is measured in, such as mPa; absolute pressures that start from vacuum.
        """
        _check_ambient(ambient_pressure)
        if isinstance(columns, str):
            raise InputError(f"columns: found the text '{columns}'; expected names, such as ['{columns}']")
        path = Path(path)
        content = of_file(
            path,
            ambient_pressure=ambient_pressure,
            columns=columns,
            missing=missing,
            progress=progress,
            mapping=mapping_given(mapping),
        )
        return cls._of(content, os.fspath(path), ambient_pressure, missing or content.gaps, path)

    @classmethod
    def from_arrays(
        cls,
        columns: Mapping[str, ArrayLike],
        *,
        ambient_pressure: float = STANDARD_ATMOSPHERE,
        missing: bool = False,
        origin: str = "<arrays>",
    ) -> Self:
        """A log of arrays in memory, by the same headings and with the same checks as a file; the arrays are copied.

        >>> log = Log.from_arrays({"t [s]": [0.0, 0.1], "p11 [bar(g)]": [0.0, 1.0]})
        >>> log["p11"].tolist()
        [101325.0, 201325.0]

        Args:
            columns: plain real numbers by heading, each of shape (m,); or a table, as for :meth:`from_frame`.
            ambient_pressure: as in :meth:`read`.
            missing: as in :meth:`read`; masked values and None are missing too.
            origin: what errors name as the file.

        Raises:
            LogError: as :meth:`read`, with the row and ``origin`` as the file; also for text, dates, complex numbers,
                switches and masked values, with the column.
        """
        _check_ambient(ambient_pressure)
        if arrays.is_frame(columns):
            return cls.from_frame(columns, ambient_pressure=ambient_pressure, missing=missing, origin=origin)
        if not isinstance(columns, Mapping):
            expected = "arrays by heading, as in {'t [s]': ..., 'p11 [Pa]': ...}, or a table"
            raise LogError(f"{origin}: found {type(columns).__name__}; expected {expected}")
        content = of_columns(
            columns.items(),
            functools.partial(arrays.numbers, masked=missing),
            origin,
            ambient_pressure=ambient_pressure,
            missing=missing,
            strict=True,
        )
        return cls._of(content, origin, ambient_pressure, missing)

    @classmethod
    def from_frame(
        cls,
        frame: Any,
        *,
        ambient_pressure: float = STANDARD_ATMOSPHERE,
        missing: bool = False,
        origin: str = "<table>",
    ) -> Self:
        """A log of a table of another library: a DataFrame of pandas or polars, or a table of Arrow.

        Its columns have the headings of a file, ``p11 [kPa(g)]``. The index of a pandas table counts as a column if it
        has a name. As in a file, columns of other names that hold no numbers are ignored.

        Raises:
            LogError: as :meth:`from_arrays`.
        """
        _check_ambient(ambient_pressure)
        if not arrays.is_frame(frame):
            found = type(frame).__name__
            expected = "a table with columns by name, such as a DataFrame (collect a lazy one first)"
            raise LogError(f"{origin}: found {found}; expected {expected}")
        try:
            columns = list(arrays.frame_columns(frame))
        except arrays.NotNumbersError as error:
            raise LogError(f"{origin}: {error}") from error
        content = of_columns(
            columns,
            arrays.frame_numbers,
            origin,
            ambient_pressure=ambient_pressure,
            missing=missing,
            strict=False,
        )
        return cls._of(content, origin, ambient_pressure, missing)

    @classmethod
    def _of(
        cls, content: Content, origin: str, ambient_pressure: float, missing: bool, path: Path | None = None
    ) -> Self:
        """The log of some content; warns the caller's caller of what is odd in it."""
        for text in content.doubts:
            warnings.warn(f"{origin}: {text}", LogWarning, stacklevel=3)
        return cls(
            content.values,
            content.units,
            ambient_pressure=ambient_pressure,
            gauge_columns=content.gauge_columns,
            ignored=content.ignored,
            headings=content.headings,
            missing=missing,
            path=path,
            sha256=content.sha256,
            notes=content.notes,
        )

    def __len__(self) -> int:
        """Number of rows, m."""
        return len(self.time)

    def __contains__(self, name: object) -> bool:
        """Whether there is a column of that name."""
        return name in self._values

    def __getitem__(self, name: str) -> Array:
        """One column by its name, shape (m,).

        Raises:
            LogError: there is none; the text names the nearest.
        """
        if name in self.ignored:
            raise LogError(f"{self._origin}: column '{name}' was not read: {self.ignored[name]}")
        if name not in self._values:
            raise LogError(no_column(self._origin, name, self._values))
        return self._values[name]

    def __repr__(self) -> str:
        """Rows, time and columns in one line."""
        span = f"{self.time[0]:g} to {self.time[-1]:g} s"
        more = ", ..." if len(self.columns) > 8 else ""
        return f"<Log {self._origin}: {len(self)} rows, {span}, {', '.join(self.columns[:8])}{more}>"

    def _repr_html_(self) -> str:
        """Its columns, for notebooks."""
        rows = []
        for name, values in self._values.items():
            there = values[np.isfinite(values)]
            ends = (there.min(), there.max()) if len(there) else (None, None)
            rows.append((name, self.units[name], *ends, len(values) - len(there) or None))
        notes = [f"not read: {name} ({reason})" for name, reason in self.ignored.items()]
        title = f"Log {self._origin}: {len(self)} rows, {span(self.time[0], self.time[-1], 's')}"
        return html_table(title, ("column", "unit", "least", "greatest", "missing"), rows, notes=notes)

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` of its columns by heading (``p11 [Pa]``), the time as index; arrays are copied.

        :meth:`from_frame` makes the same log of it, but for the file that it came from.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        return frame({self._heading(name): values for name, values in self._values.items()}, self._heading(names.TIME))

    def __eq__(self, other: object) -> bool:
        """Whether columns, units and ambient pressure are equal; missing samples equal each other."""
        if not isinstance(other, Log):
            return NotImplemented
        return (
            self.columns == other.columns
            and self.units == other.units
            and self.ambient_pressure == other.ambient_pressure
            and self.gauge_columns == other.gauge_columns
            and all(np.array_equal(self[name], other[name], equal_nan=True) for name in self.columns)
        )

    def __hash__(self) -> int:
        """Equal for equal logs."""
        return hash((self.columns, len(self), self.ambient_pressure, float(self.time[0]), float(self.time[-1])))

    def __getstate__(self) -> dict[str, Any]:
        """What a copy is made from."""
        return {
            name: dict(value) if isinstance(value, MappingProxyType) else value for name, value in vars(self).items()
        }

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """As it was, arrays read-only."""
        vars(self).update(state)
        for name in ("units", "ignored", "headings"):
            setattr(self, name, MappingProxyType(state[name]))
        for array in self._values.values():
            array.flags.writeable = False

    @property
    def _origin(self) -> str:
        return os.fspath(self.path) if self.path is not None else "<arrays>"

    @property
    def time(self) -> Array:
        """Time of each row, s, shape (m,)."""
        return self._values[names.TIME]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns, in the order of the file."""
        return tuple(self._values)

    def pressures(self, inputs: Sequence[str], *, commanded: bool = False) -> Array:
        """Absolute pressures of the given inputs, Pa, shape (m, k), in the order asked; a copy.

        Args:
            inputs: names of pressure inputs, for example ``arm.inputs``.
            commanded: the commanded instead of the measured ones, ``pc11`` for the input ``p11``.

        Raises:
            LogError: one of them is not in the log; the text names the nearest.
        """
        wanted = ["pc" + name.removeprefix("p") for name in inputs] if commanded else list(inputs)
        return _side_by_side([self[name] for name in wanted], len(self))

    @property
    def lengths(self) -> Array | None:
        """Bellows lengths, m, shape (m, 3n), n the last section with any; NaN where not measured; None if none is.

        Raises:
            LogError: a section has more than three; ``bha.Recording`` knows where an arm's bellows are.
        """
        return self._gathered("length", np.nan)

    @property
    def velocities(self) -> Array | None:
        """Time derivatives of the bellows lengths, m/s, like ``lengths``."""
        return self._gathered("velocity", np.nan)

    @property
    def coordinates(self) -> Array | None:
        """Coordinates (virtual lengths), m, shape (m, 3n), like ``lengths``."""
        return self._gathered("coordinate", np.nan)

    @property
    def coordinate_velocities(self) -> Array | None:
        """Time derivatives of the coordinates, m/s, like ``lengths``."""
        return self._gathered("coordinate_velocity", np.nan)

    @property
    def head_positions(self) -> Array | None:
        """Head positions as they were measured, m, shape (m, n, 3); NaN where not measured; None if none is."""
        return _by_axis(self._gathered("position", np.nan))

    @property
    def head_orientations(self) -> Array | None:
        """Measured head orientations, quaternions (w, x, y, z), shape (m, n, 4), like ``head_positions``."""
        gathered = self._gathered("orientation", np.nan, 4)
        return None if gathered is None else gathered.reshape(len(self), -1, 4)

    @property
    def forces(self) -> Array | None:
        """External forces in the world, N, shape (m, n, 3); zero without a column; None if there is no column."""
        return _by_axis(self._gathered("force", 0.0))

    def forces_on(self, section_count: int) -> Array | None:
        """``forces`` with zeros up to the last section of an arm, N, shape (m, section_count, 3).

        Raises:
            LogError: the log has a force on a section that the arm does not have.
        """
        forces = self.forces
        if forces is None or forces.shape[1] == section_count:
            return forces
        if forces.shape[1] > section_count:
            last = forces.shape[1]
            raise LogError(f"{self._origin}: has a force on section {last}; the arm has {section_count} sections")
        padded = np.pad(forces, ((0, 0), (0, section_count - forces.shape[1]), (0, 0)))
        padded.flags.writeable = False
        return padded

    def _gathered(self, kind: str, absent: float, count: int = 3) -> Array | None:
        """The ``count`` columns per section of one kind of quantity, side by side; a copy."""
        places = {}
        for name in self._values:
            quantity = names.quantity(name)
            if quantity is not None and quantity.kind == kind:
                if quantity.number > count:
                    raise LogError(
                        f"{self._origin}: column '{name}' is of bellows {quantity.number} of a section; a table of "
                        f"lengths has {count} a section. bha.Recording(arm, log) knows where the arm's bellows are"
                    )
                places[count * (quantity.section - 1) + quantity.number - 1] = self._values[name]
        if not places:
            return None
        width = count * (max(places) // count + 1)
        nothing = np.broadcast_to(absent, len(self))
        return _side_by_side([places.get(place, nothing) for place in range(width)], len(self))

    def between(self, start: float, end: float) -> Log:
        """The rows with ``start <= time <= end``, s, as views; path and hash stay those of the whole file.

        Raises:
            InputError: there is no such row.
        """
        first = int(np.searchsorted(self.time, start, side="left"))
        last = int(np.searchsorted(self.time, end, side="right"))
        if not first < last:
            span = f"{self.time[0]} to {self.time[-1]} s"
            raise InputError(f"{self._origin}: no row between {start} and {end} s; the log has {span}")
        return self._with({name: values[first:last] for name, values in self._values.items()}, self.ambient_pressure)

    def with_ambient_pressure(self, ambient_pressure: float) -> Log:
        """The same log with its gauge pressures taken relative to another ambient pressure, Pa; nothing else changes.

        Raises:
            InputError: not a finite pressure.
            LogError: a pressure would be below that of vacuum.
        """
        _check_ambient(ambient_pressure)
        change = ambient_pressure - self.ambient_pressure
        if change == 0.0 or not self.gauge_columns:
            return self._with(self._values, ambient_pressure)
        moved = {name: self._values[name] + change for name in self.gauge_columns}
        for name, values in moved.items():
            if values.min() < 0.0:
                least = f"{values.min()} Pa at an ambient pressure of {ambient_pressure} Pa"
                raise LogError(f"{self._origin}, column '{name}': {least} is below vacuum")
        return self._with({**self._values, **moved}, ambient_pressure)

    def restated(
        self,
        names: Mapping[str, str] = MappingProxyType({}),
        factors: Mapping[str, float] = MappingProxyType({}),
        gauge: Mapping[str, bool | None] = MappingProxyType({}),
    ) -> Log:
        """The log as it is with other headings: names, units, gauge or absolute. Path and hash stay those of the file.

        Args:
            names: new name of each column that gets one; two may exchange theirs.
            factors: what the values of a column are multiplied with, as its new unit over its old one; of gauge
                pressures the part above ambient.
            gauge: for pressures (by their old name) whether the file's numbers are gauge pressures; None leaves it.

        Raises:
            InputError: there is no such column, or two would have one name.
            LogError: a pressure would be below that of vacuum.
        """
        if unknown := {*names, *factors, *gauge} - set(self._values):
            raise InputError(no_column(self._origin, sorted(unknown)[0], self._values))
        named = [names.get(name, name) for name in self._values]
        if len(set(named)) < len(named):
            raise InputError(f"{self._origin}: names {', '.join(named)}; allowed: each name once")
        values, units, gauges, headings = {}, {}, [], {}
        for (old, column), name in zip(self._values.items(), named, strict=True):
            was = old in self.gauge_columns
            now = was if gauge.get(old) is None else bool(gauge[old])
            changed = column
            if old in factors or now is not was:
                read = column - (self.ambient_pressure if was else 0.0)
                changed = read * factors.get(old, 1.0) + (self.ambient_pressure if now else 0.0)
                if now is not was and float(changed.min()) < 0.0:
                    raise LogError(f"{self._origin}, column '{old}': {changed.min()} Pa is below vacuum")
            values[name], units[name] = changed, self.units[old]
            if old in self.headings:
                headings[name] = self.headings[old]
            if now:
                gauges.append(name)
        return self._with(values, self.ambient_pressure, units=units, gauge_columns=gauges, headings=headings)

    def _with(
        self,
        values: Mapping[str, Array],
        ambient_pressure: float,
        *,
        units: Mapping[str, str] | None = None,
        gauge_columns: Collection[str] | None = None,
        headings: Mapping[str, str] | None = None,
    ) -> Log:
        return Log(
            values,
            self.units if units is None else units,
            ambient_pressure=ambient_pressure,
            gauge_columns=self.gauge_columns if gauge_columns is None else gauge_columns,
            ignored=self.ignored,
            headings=self.headings if headings is None else headings,
            missing=self.missing,
            path=self.path,
            sha256=self.sha256,
            notes=self.notes,
        )

    def write(self, path: str | os.PathLike[str], *, progress: Progress | None = None) -> None:
        """Write the log to a ``.csv``, ``.csv.gz`` or ``.parquet`` file, whole or not at all; no digit is lost.

        Pressures are written as absolute ones, in Pa. Columns that were ignored are not written. ``progress`` is called
        with the fraction done, from 0 to 1.

        Raises:
            InputError: unknown extension, or a folder that does not exist.
            MissingExtraError: Parquet without pyarrow.
        """
        headings = {self._heading(name): values for name, values in self._values.items()}
        formats.write(Path(path), headings, progress)

    def _heading(self, name: str) -> str:
        """``p11 [Pa]``; the name alone where the unit is not known."""
        return names.column(name, self.units[name]) if self.units[name] else name


def _check_ambient(ambient_pressure: float) -> None:
    number = isinstance(ambient_pressure, int | float | np.number) and not isinstance(ambient_pressure, bool)
    if not (number and np.isfinite(ambient_pressure) and ambient_pressure >= 0):
        raise InputError(f"ambient_pressure: found {ambient_pressure}; allowed: a finite number >= 0 (Pa)")


def _side_by_side(columns: Sequence[Array], rows: int) -> Array:
    table = np.empty((rows, len(columns)))
    for place, column in enumerate(columns):
        table[:, place] = column
    table.flags.writeable = False
    return table


def _by_axis(table: Array | None) -> Array | None:
    return None if table is None else table.reshape(len(table), -1, 3)
