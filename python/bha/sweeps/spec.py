"""The file that says what a sweep is: TOML, schema ``bha-sweep/1``, checked like a parameter file.

Relative paths in it start at its own folder.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from bha.errors import InputError, ParameterError
from bha.parameters import messages
from bha.parameters.base import NotNegative, Number, Positive, Table, key, nearest, table_error
from bha.recordings import PressureSort
from bha.runs.input import Interpolation
from bha.runs.options import Method
from bha.simulation.batch import InstructionSet
from bha.sweeps.draws import check_variable, levels
from bha.sweeps.metrics import METRICS
from bha.sweeps.variable import Count, Variable

SCHEMA = "bha-sweep/1"
#: Partitions begin and end at multiples of this many runs, so that what is simulated in one call never depends on them.
GROUP = 64
#: A partition is in memory as a whole.
LARGEST_PARTITION = 1 << 20


class InputTable(Table):
    """The ``[input]`` table: what drives the arm."""

    logs: tuple[Annotated[str, Field(strict=True)], ...] | None = key(
        "a list of log files, each once", "what drives the arm; give logs or pressures", default=None, min_length=1
    )
    pressures: tuple[NotNegative, ...] | None = key(
        "a list of numbers >= 0 (Pa, absolute), one an input",
        "constant pressures; give logs or pressures",
        unit="Pa",
        default=None,
        min_length=1,
    )
    log_pressures: PressureSort | None = key(
        '"measured" or "commanded"',
        "which pressures of the logs drive the arm",
        left_out="measured ones where there are any",
        default=None,
    )
    log_missing: Annotated[bool, Field(strict=True)] = key(
        "true or false",
        "take NaN and empty cells of measured outputs of the logs as missing samples, as with --missing",
        default=False,
    )
    log_columns: Annotated[str, Field(strict=True)] | None = key(
        "a mapping file",
        "which part of a log of another format is which column, as with --columns",
        left_out="LOG.columns.toml or columns.toml beside the log",
        default=None,
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.logs is None) == (self.pressures is None):
            found = "neither" if self.logs is None else "both"
            raise table_error(f"found {found} of logs and pressures; allowed: exactly one of them")
        if self.logs is not None and len(set(self.logs)) < len(self.logs):
            raise table_error(f"found {list(self.logs)}; allowed: each log once", "logs")
        if self.logs is None and self.log_pressures is not None:
            raise table_error(f'found "{self.log_pressures}"; allowed: only with logs', "log_pressures")
        if self.logs is None and self.log_missing:
            raise table_error("found true; allowed: only with logs", "log_missing")
        if self.logs is None and self.log_columns is not None:
            raise table_error(f'found "{self.log_columns}"; allowed: only with logs', "log_columns")
        return self


class InitialTable(Table):
    """The ``[initial]`` table: where every run starts; at rest under its first pressures if left out."""

    pressures: tuple[NotNegative, ...] | None = key(
        "a list of numbers >= 0 (Pa, absolute), one an input",
        "at rest under these: the run begins with a step",
        left_out="the run's first pressures",
        unit="Pa",
        default=None,
        min_length=1,
    )
    lengths: tuple[Positive, ...] | None = key(
        "a list of numbers > 0 (m), three a section",
        "where the run starts",
        left_out="at rest",
        unit="m",
        default=None,
        min_length=3,
    )
    velocities: tuple[Number, ...] | None = key(
        "a list of numbers (m/s), three a section",
        "how fast it starts",
        left_out="0",
        unit="m/s",
        default=None,
        min_length=3,
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.pressures is not None and self.lengths is not None:
            raise table_error("found both pressures and lengths; allowed: at most one of them")
        return self


class SimulationTable(Table):
    """The ``[simulation]`` table: how long and how exactly."""

    duration: Positive | None = key(
        "a number > 0 (s)",
        "from the start of the log; needed without a log",
        left_out="the whole log",
        unit="s",
        default=None,
    )
    dt: Positive = key("a number > 0 (s)", "distance of the rows that metrics see", unit="s", default=0.005)
    method: Method = key('"auto", "dopri5", "rodas4", "rk4" or "ros2"', "as for bha.simulate", default="auto")
    step: Positive = key("a number > 0 (s)", "longest step of rk4 and ros2", unit="s", default=1e-3)
    rtol: Positive = key("a number > 0", "relative tolerance of dopri5 and rodas4", default=1e-6)
    atol: Positive = key("a number > 0 (m and m/s)", "absolute tolerance of dopri5 and rodas4", default=1e-8)
    max_steps: Count = key("a whole number >= 1", "a run that needs more steps has diverged", default=1_000_000)
    interpolation: Interpolation | None = key(
        '"linear" or "hold"', "what holds between samples", left_out="as the input says", default=None
    )
    instruction_set: InstructionSet | None = key(
        ", ".join(f'"{name}"' for name in get_args(InstructionSet)),
        "what computes runs abreast: all methods but dopri5",
        left_out="the widest one of the computer that starts the sweep",
        default=None,
    )


class SweepSpec(Table):
    """What a sweep file says. Read one with :meth:`read` or make one with :meth:`from_mapping`."""

    schema_name: Literal["bha-sweep/1"] = key(f'"{SCHEMA}"', "what the file is", alias="schema")
    arm: str = key(
        "a parameter file, or the name of an arm that ships with the package",
        "the arm; paths start at this file",
        strict=True,
        min_length=1,
    )
    kind: Literal["monte_carlo", "grid"] = key(
        '"monte_carlo" or "grid"',
        "runs that are drawn, or one for every combination, the last variable changing fastest",
    )
    runs: Count | None = key(
        "a whole number >= 1", "number of runs of Monte Carlo", left_out='not with kind "grid"', default=None
    )
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**63)] = key(
        "a whole number from 0 to 2^63 - 1", "of Monte Carlo: seed and number of a run decide what it draws", default=0
    )
    partition_size: Annotated[int, Field(strict=True, ge=1, le=LARGEST_PARTITION)] = key(
        f"a multiple of {GROUP}, at most {LARGEST_PARTITION}", "runs a file; moves no result", default=1024
    )
    metrics: tuple[str, ...] = key(
        "a list of " + ", ".join(f'"{name}"' for name in METRICS),
        "what each run is reduced to",
        default=("final_tip_displacement", "max_tip_displacement", "settling_time", "peak_rate"),
        min_length=1,
    )
    settling_band: Annotated[Number, Field(gt=0, lt=1)] = key(
        "a number between 0 and 1",
        "band of settling_time, as a share of the tip's largest distance from its end",
        default=0.05,
    )
    input: InputTable = key("an [input] table", "what drives the arm")
    initial: InitialTable = key("an [initial] table", "where every run starts", default=InitialTable())
    simulation: SimulationTable = key("a [simulation] table", "how long and how exactly", default=SimulationTable())
    variables: tuple[Variable, ...] = key(
        "[[vary]] tables, in double brackets", "one for each thing that varies", alias="vary", min_length=1
    )

    # Where it was read from, for errors that are found later, and what relative paths start from.
    _origin: str = PrivateAttr(default="<mapping>")
    _text: str | None = PrivateAttr(default=None)
    _folder: Path = PrivateAttr(default_factory=Path)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.partition_size % GROUP:
            raise table_error(f"found {self.partition_size}; allowed: a multiple of {GROUP}", "partition_size")
        for number, name in enumerate(self.metrics):
            if name not in METRICS:
                raise table_error(f'found "{name}"{nearest(name, list(METRICS))}', "metrics")
            if name in self.metrics[:number]:
                raise table_error(f'found "{name}" twice; allowed: each once', "metrics")
        if self.input.logs is None and self.simulation.duration is None:
            raise table_error("duration: missing; needed with [input] pressures", "simulation")
        self._check_variables()
        return self

    def _check_variables(self) -> None:
        if self.kind == "monte_carlo" and self.runs is None:
            raise table_error('missing; allowed: a whole number >= 1, with kind "monte_carlo"', "runs")
        for name in ("runs", "seed") if self.kind == "grid" else ():
            if name in self.model_fields_set:
                raise table_error("a grid has one run for each combination and draws nothing; remove it", name)
        for number, variable in enumerate(self.variables):
            if fault := check_variable(variable, self.kind):
                raise table_error(fault[1], f"vary.{number}.{fault[0]}")
            if any(variable.what == other.what for other in self.variables[:number]):
                raise table_error(f'found "{variable.what}" twice; allowed: each once', f"vary.{number}.what")
        if self.run_count > 10**12:
            raise table_error(f"found {self.run_count} combinations; allowed: at most 10^12", "vary")

    @property
    def run_count(self) -> int:
        """Number of runs."""
        if self.kind == "monte_carlo":
            assert self.runs is not None
            return self.runs
        count = 1
        for variable in self.variables:
            count *= len(self.input.logs or ()) if variable.values is None and variable.is_text else levels(variable)
        return count

    def with_missing(self) -> Self:
        """The same sweep with missing samples allowed in the outputs of its logs.

        Raises:
            InputError: it has no logs.
        """
        if self.input.logs is None:
            raise InputError("missing samples are those of logs; the sweep has none")
        return self.model_copy(update={"input": self.input.model_copy(update={"log_missing": True})})

    def with_columns(self, mapping: str | os.PathLike[str]) -> Self:
        """The same sweep with a mapping file for its logs; a relative path starts at the current folder.

        Raises:
            InputError: it has no logs.
        """
        if self.input.logs is None:
            raise InputError("a mapping file is that of logs; the sweep has none")
        columns = os.path.abspath(mapping)
        return self.model_copy(update={"input": self.input.model_copy(update={"log_columns": columns})})

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read a sweep file.

        Raises:
            ParameterError: the file is missing, not TOML or not valid; each fault with file, line, key, found, allowed.
        """
        origin = os.fspath(path)
        try:
            text = Path(path).read_bytes().decode()
        except OSError as error:
            raise ParameterError(messages.unreadable(path, error, "sweep file")) from error
        except UnicodeDecodeError as error:
            raise ParameterError(messages.not_text(origin, error)) from error
        text = text.removeprefix("\ufeff").replace("\r\n", "\n")
        try:
            mapping = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # a whole number of 5000 digits is a ValueError too
            raise ParameterError(messages.not_toml(origin, text, error)) from error
        return cls.from_mapping(mapping, origin=origin, text=text, folder=Path(path).parent)

    @classmethod
    def from_mapping(
        cls,
        mapping: Mapping[str, Any],
        *,
        origin: str = "<mapping>",
        text: str | None = None,
        folder: str | os.PathLike[str] = ".",
    ) -> Self:
        """Build from the nested mapping that a sweep file amounts to.

        Args:
            mapping: keys as in the file.
            origin: what errors name as the file.
            text: the file's text, so that errors can name lines.
            folder: where relative paths start.

        Raises:
            ParameterError: as :meth:`read`.
        """
        if mapping.get("schema") != SCHEMA:
            raise ParameterError(messages.wrong_schema(origin, mapping, SCHEMA, "a sweep file"))
        try:
            spec = cls.model_validate(mapping)
        except ValidationError as error:
            raise ParameterError(messages.invalid(origin, error, cls, mapping, text)) from error
        spec._origin, spec._text, spec._folder = origin, text, Path(folder)
        return spec

    @property
    def folder(self) -> Path:
        """Where relative paths start."""
        return self._folder

    def fault(self, location: tuple[str | int, ...], message: str) -> ParameterError:
        """An error at a key of the file, found after reading: ``("vary", 0, "what")``."""
        return ParameterError(messages.at(self._origin, self._text, location, message))

    def to_mapping(self) -> dict[str, Any]:
        """Everything it says, defaults filled in."""
        return self.model_dump(mode="json", by_alias=True)
