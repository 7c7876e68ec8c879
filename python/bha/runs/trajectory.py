"""Trajectories: what a simulation returns, in memory and as a file that reads back as a measured log."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.arm.geometry import camera_frame
from bha.errors import InputError
from bha.parameters import SensorsParameters
from bha.runs.formats import ARRAYS, BLOCK_ROWS, NOT_WRITTEN, OPTIONAL_ARRAYS, Sink, open_sink, written_arrays
from bha.support.files import written_whole
from bha.support.shown import frame, html_table, span


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """States of an arm over time; m rows, n sections. Arrays are float64 and read-only.

    Trajectories are equal if their arrays, inputs and arm names are; how many steps it took does not matter.

    Attributes:
        time: time of each row, s, shape (m,), never decreasing.
        lengths: bellows lengths q, m, shape (m, 3n), section by section.
        velocities: their time derivatives, m/s, shape (m, 3n).
        pressures: absolute pressure of each input, Pa, shape (m, inputs).
        head_positions: position of each section's head in the world, m, shape (m, n, 3).
        input_names: names of the pressure inputs, one for each column of ``pressures``.
        statistics: counts of the integrator: ``steps``, ``rejected_steps``, ``evaluations``.
        arm_name: name of the arm.
        measured_lengths: lengths as their sensors have them, m, shape (m, 3n), where effects of the arm act on sensors
            (delay, offset, gain); else None. ``lengths`` are always the true ones; files hold those.
        head_orientations: orientation of each section's head in the world, shape (m, n, 4), or None: unit
            quaternions (w, x, y, z), of the two that mean the same rotation the one with w >= 0.
        measured_head_positions: head positions as they are measured, m, shape (m, n, 3), where an effect of the arm
            delays them; else None. Files hold the true ones.
        measured_head_orientations: orientations likewise, shape (m, n, 4), or None.
        sensors: what the arm's file says of its sensors: files hold heads in the camera's frame, as a log of the arm
            does; here they are in the world.
        virtual_lengths: whether ``lengths`` are no bellows' own, because the arm's bellows are not the standard three
            (at 0, 120 and 240 degrees, at ``bellows_radius``), but those of the three coordinates there: files name
            them ``qv11`` then.

    Raises:
        InputError: shapes do not fit together, time is not finite or runs backwards, or input names are not unique.
    """

    time: NDArray[np.float64]
    lengths: NDArray[np.float64]
    velocities: NDArray[np.float64]
    pressures: NDArray[np.float64]
    head_positions: NDArray[np.float64]
    input_names: tuple[str, ...]
    statistics: Mapping[str, int] = field(default_factory=dict, compare=False)
    arm_name: str = ""
    measured_lengths: NDArray[np.float64] | None = None
    head_orientations: NDArray[np.float64] | None = None
    measured_head_positions: NDArray[np.float64] | None = None
    measured_head_orientations: NDArray[np.float64] | None = None
    virtual_lengths: bool = False
    sensors: SensorsParameters | None = None

    def __post_init__(self) -> None:
        """Check what was given and make it read-only, without copying it."""
        time = np.asarray(self.time, dtype=np.float64)
        if time.ndim != 1:
            raise InputError(f"time: expected shape (m,), found {time.shape}")
        if not np.isfinite(time).all():
            row = int(np.argmin(np.isfinite(time)))
            raise InputError(f"time: found {time[row]} at row {row}; expected finite numbers, s")
        if np.any(np.diff(time) < 0):
            row = int(np.argmax(np.diff(time) < 0)) + 1
            raise InputError(f"time: must not decrease, found {time[row - 1]} s then {time[row]} s at row {row}")
        rows, columns = len(time), np.shape(self.lengths)[-1] if np.ndim(self.lengths) == 2 else 0
        if columns == 0 or columns % 3:
            raise InputError(f"lengths: expected shape (m, 3n) with n >= 1, found {np.shape(self.lengths)}")
        expected = {
            "time": (rows,),
            "lengths": (rows, columns),
            "velocities": (rows, columns),
            "pressures": (rows, len(self.input_names)),
            "head_positions": (rows, columns // 3, 3),
        }
        optional = {
            "measured_lengths": expected["lengths"],
            "head_orientations": (rows, columns // 3, 4),
            "measured_head_positions": expected["head_positions"],
            "measured_head_orientations": (rows, columns // 3, 4),
        }
        expected |= {name: shape for name, shape in optional.items() if getattr(self, name) is not None}
        for name, shape in expected.items():
            array = np.asarray(getattr(self, name), dtype=np.float64).view()
            if array.shape != shape:
                raise InputError(f"{name}: expected shape {shape}, found {array.shape}")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        object.__setattr__(self, "input_names", tuple(self.input_names))
        object.__setattr__(self, "statistics", dict(self.statistics))
        twice = [name for name, count in Counter(self.columns()).items() if count > 1]
        if twice:
            raise InputError(f"input_names: {', '.join(twice)} would stand twice in a file; names must be unique")

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time)

    def __repr__(self) -> str:
        """Arm, rows, time, sections and inputs in one line."""
        span = f", {self.time[0]:g} to {self.time[-1]:g} s" if len(self) else ""
        counts = f"{self.section_count} sections, {len(self.input_names)} inputs"
        return f"<Trajectory of {self.arm_name or 'an arm'}: {len(self)} rows{span}, {counts}>"

    def _repr_html_(self) -> str:
        """What its columns do, for notebooks."""
        rows: list[tuple[object, ...]] = []
        if len(self):
            for heading, values in zip(self.columns()[1:], self.table().T[1:], strict=True):
                there = values[np.isfinite(values)]
                ends = (there.min(), there.max()) if len(there) else (None, None)
                rows.append((heading, values[0], *ends, values[-1]))
        time = f", {span(self.time[0], self.time[-1], 's')}" if len(self) else ""
        title = f"Trajectory of {self.arm_name or 'an arm'}: {len(self)} rows{time}"
        steps = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in self.statistics.items())
        headings = ("column", "first", "least", "greatest", "last")
        return html_table(title, headings, rows, notes=[steps] if steps else ())

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` of its columns by heading (:meth:`columns`), the time as index; arrays are copied.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        headings = self.columns()
        return frame(dict(zip(headings, self.table().T, strict=True)), headings[0])

    def __eq__(self, other: object) -> bool:
        """Whether all arrays and names are equal, to the last bit."""
        if not isinstance(other, Trajectory):
            return NotImplemented
        return all(_equal(getattr(self, f.name), getattr(other, f.name)) for f in fields(self) if f.compare)

    def __hash__(self) -> int:
        """Equal for equal trajectories."""
        return hash((self.arm_name, self.input_names, self.lengths.shape, tuple(self.time[:1].tolist())))

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """A copy or an unpickled trajectory: its arrays are read-only like those of the first one."""
        vars(self).update(state)
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __getitem__(self, rows: slice) -> Trajectory:
        """Some of the rows, as views: ``trajectory[100:200]``, ``trajectory[::10]``; the rest stays as it is."""
        arrays = {name: getattr(self, name) for name in (*ARRAYS, *OPTIONAL_ARRAYS)}
        return replace(self, **{name: array[rows] for name, array in arrays.items() if array is not None})

    @property
    def section_count(self) -> int:
        """Number of sections n."""
        return int(self.head_positions.shape[1])

    def columns(self) -> list[str]:
        """Headings of the columns in a file: ``t [s]``, ``q11 [m]``, ``qd11 [m/s]``, ``p11 [Pa]``, ``x1 [m]``, ...

        Lengths that are no bellows' own are ``qv11 [m]``, their rates ``qvd11 [m/s]``.
        """
        sections = range(1, self.section_count + 1)
        bellows = [(section, number) for section in sections for number in (1, 2, 3)]
        length = names.coordinate_name if self.virtual_lengths else names.length_name
        velocity = names.coordinate_velocity_name if self.virtual_lengths else names.velocity_name
        headings = [
            names.column(names.TIME, "s"),
            *(names.column(length(*pair), "m") for pair in bellows),
            *(names.column(velocity(*pair), "m/s") for pair in bellows),
            *(names.column(name, "Pa") for name in self.input_names),
            *(names.column(name, "m") for section in sections for name in names.position_names(section)),
        ]
        if self.head_orientations is not None:
            headings += (names.column(name, "1") for section in sections for name in names.orientation_names(section))
        return headings

    def table(self) -> NDArray[np.float64]:
        """All columns side by side in the order of ``columns()``, shape (m, number of columns); a copy."""
        camera = camera_frame(self.sensors)
        heads = [camera.positions(self.head_positions)]
        if self.head_orientations is not None:
            heads.append(camera.orientations(self.head_orientations))
        heads = [table.reshape(len(self), -1) for table in heads]
        return np.column_stack([self.time, self.lengths, self.velocities, self.pressures, *heads])

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the trajectory to a file, whole or not at all; the extension chooses the format.

        ``.parquet`` (extra ``parquet``), ``.csv`` and ``.csv.gz`` hold the columns of ``columns()`` and read back with
        ``bha.Log.read``. ``.npz`` holds the arrays under the names of this class's attributes. Numbers lose no digit.

        Returns:
            The path that was written.

        Raises:
            InputError: unknown extension, or a folder that does not exist.
            MissingExtraError: Parquet without pyarrow.
        """
        with TrajectoryWriter(path) as writer:
            writer.append(self)
        return Path(path)


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) != isinstance(other, np.ndarray):
        return False
    return np.array_equal(one, other, equal_nan=True) if isinstance(one, np.ndarray) else bool(one == other)


class TrajectoryWriter:
    """Writes a trajectory that arrives in chunks, in bounded memory; the extension chooses the format.

    A context manager. The file appears when the block ends well. If the block raises, nothing is left, unless
    ``keep_partial`` is set: then the file is finished with the rows that came before the error, and the error goes on.
    A block that ends without a chunk writes nothing.

    >>> with TrajectoryWriter("out.parquet", keep_partial=True) as writer:  # doctest: +SKIP
    ...     for chunk in chunks:
    ...         writer.append(chunk)
    """

    def __init__(self, path: str | os.PathLike[str], *, keep_partial: bool = False) -> None:
        """Name the file; nothing is opened before the first chunk.

        Raises:
            InputError: unknown extension.
            MissingExtraError: Parquet without pyarrow.
        """
        self.path = Path(path)
        self.keep_partial = keep_partial
        self.rows = 0
        self._open_sink = open_sink(self.path)
        self._sink: Sink | None = None
        self._stack = ExitStack()
        self._first: Trajectory | None = None
        self._last_time = -np.inf
        self._statistics: Counter[str] = Counter()

    def append(self, chunk: Trajectory) -> None:
        """Add rows. Statistics add up; arm, sections and inputs must be those of the first chunk.

        Raises:
            InputError: the chunk is of another arm, starts before the end of the last one, or the folder is missing.
        """
        if self._first is not None and chunk.columns() != self._first.columns():
            raise InputError(
                f"{self.path}: a chunk has the columns {', '.join(chunk.columns())}; "
                f"the chunks before had {', '.join(self._first.columns())}"
            )
        if len(chunk) and chunk.time[0] < self._last_time:
            raise InputError(
                f"{self.path}: a chunk starts at {chunk.time[0]} s, before the end of the last one, {self._last_time} s"
            )
        if self._sink is None:
            # Of the first chunk only the headings are needed later; its rows must not stay in memory, so no views.
            empty: dict[str, Any] = {name: getattr(chunk, name)[:0].copy() for name in written_arrays(chunk)}
            empty |= dict.fromkeys(NOT_WRITTEN)
            self._first = replace(chunk, **empty)
            self._sink = self._open_sink(self._stack.enter_context(written_whole(self.path)), self._first)
        for start in range(0, len(chunk), BLOCK_ROWS):
            self._sink.write(chunk[start : start + BLOCK_ROWS])
        if len(chunk):
            self.rows += len(chunk)
            self._last_time = float(chunk.time[-1])
        self._statistics.update(chunk.statistics)

    def __enter__(self) -> Self:
        """Begin; returns the writer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Finish the file, or remove what there is of it."""
        if self._sink is None:
            return
        sink, self._sink = self._sink, None
        if kind is None or (self.keep_partial and self.rows):
            with self._stack:
                try:
                    sink.finish(dict(self._statistics))
                finally:
                    sink.close()
        else:
            # Hand the error to the block that owns the temporary file, so that it is removed and not moved.
            try:
                sink.close()
            finally:
                self._stack.__exit__(kind, error, traceback)
