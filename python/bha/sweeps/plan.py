"""A sweep with everything that its file names read and checked: all that a run needs. Goes to workers as it is."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha import _core, robots
from bha.arm import Arm
from bha.parameters import ArmParameters
from bha.parameters.messages import shown
from bha.recordings import Recording, recordings
from bha.recordings.beginning import NUMBERS, Beginning, begins, preloaded
from bha.runs.input import Input
from bha.sweeps.draws import grid_rows, grid_values, levels, monte_carlo_rows
from bha.sweeps.spec import GROUP, SweepSpec
from bha.sweeps.targets import Target, target_of
from bha.sweeps.variable import Variable

Array = NDArray[np.float64]

AnySpec = SweepSpec | str | os.PathLike[str] | Mapping[str, Any]

#: Memory that the rows and inputs of runs simulated in one call may take, bytes.
GROUP_BYTES = 32 << 20
#: Memory that the rows of one run may take, bytes.
RUN_BYTES = 1 << 29


@dataclass(frozen=True)
class Plan:
    """A sweep that can be run.

    Attributes:
        spec: what the file says.
        variables: the ``[[vary]]`` tables; a choice of a log has its logs filled in.
        targets: what each acts on.
        arm: the arm of the file, without provenance.
        beginnings: what drives it and how that begins, one a log, each cut to the duration: where runs start at rest,
            the arm takes what held it there.
        input_names: names of the logs as the file has them.
        runs: how many.
        instruction_set: what computes runs abreast.
        parts: what the results follow from, each as a hash or text by its name, for people to tell sweeps apart.
    """

    spec: SweepSpec
    variables: tuple[Variable, ...]
    targets: tuple[Target, ...]
    arm: Arm
    beginnings: tuple[Beginning, ...]
    input_names: tuple[str, ...]
    runs: int
    instruction_set: Any
    parts: dict[str, str]

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of everything that the results follow from, hexadecimal."""
        return _digest(json.dumps(self.parts, sort_keys=True))

    @cached_property
    def inputs(self) -> tuple[Input, ...]:
        """What drives the arm, one a log."""
        return tuple(begun.drive for begun in self.beginnings)

    @cached_property
    def standing(self) -> tuple[Arm, ...]:
        """The arm of the file as it stands where each input begins."""
        return tuple(begun.taken_by(self.arm) for begun in self.beginnings)

    @property
    def partitions(self) -> int:
        """Number of partitions."""
        return -(-self.runs // self.spec.partition_size)

    def runs_of(self, partition: int) -> range:
        """The runs of a partition."""
        first = partition * self.spec.partition_size
        return range(first, min(first + self.spec.partition_size, self.runs))

    @cached_property
    def times(self) -> tuple[Array, ...]:
        """For each input the times of the rows, s, on its clock."""
        return tuple(_rows(drive, self.spec.simulation.dt) for drive in self.inputs)

    @cached_property
    def group(self) -> int:
        """Number of runs that are simulated in one call: a power of two up to 64, fewer where they need much memory.

        It follows from the spec alone. Vector registers agree with single runs to rounding only, so results to the last
        digit need calls that are the same whatever the partitions, threads and workers.
        """
        rows = max(len(times) for times in self.times)
        numbers = rows * _numbers_a_row(self.arm)
        if any(target.kind in ("amplitude", "offset") for target in self.targets):
            numbers += max(drive.pressures.size for drive in self.inputs)
        size = GROUP
        while size > 1 and size * numbers * 8 > GROUP_BYTES:
            size //= 2
        return size

    def draws(self, first: int, count: int) -> Array:
        """What ``count`` runs from ``first`` on draw, shape (count, variables); of a log its place."""
        if self.spec.kind == "monte_carlo":
            rows = monte_carlo_rows(self.variables, self.spec.seed, first, count)
            for column, variable in enumerate(self.variables):
                if variable.distribution == "choice":
                    rows[:, column] = self._values(column, rows[:, column].astype(np.intp))
            return rows
        places = grid_rows([levels(variable) for variable in self.variables], first, count)
        return np.column_stack([self._values(column, places[:, column]) for column in range(len(self.variables))])

    def _values(self, column: int, places: NDArray[np.integer]) -> Array:
        variable = self.variables[column]
        if variable.is_text:
            order = [float(self.input_names.index(str(name))) for name in variable.values or ()]
            return np.array([order[place] for place in places])
        return grid_values(variable, places)


def make_plan(spec: AnySpec, *, instruction_set: str | None = None) -> Plan:
    """Read what a spec names and check that it fits together; nothing is run.

    Args:
        spec: a sweep file, the mapping it amounts to, or a :class:`SweepSpec`.
        instruction_set: what computes runs abreast where the spec leaves it open; the widest one of this computer
            if None.

    Raises:
        ParameterError: the spec is not valid, or asks for something that the arm or the logs do not have.
        LogError: a log cannot be read.
    """
    if not isinstance(spec, SweepSpec):
        spec = SweepSpec.from_mapping(spec) if isinstance(spec, Mapping) else SweepSpec.read(spec)
    arm = _arm(spec)
    recorded = _recordings(spec, arm)
    beginnings, hashes = _beginnings(spec, arm, recorded)
    arm = recorded[0].acting if recorded else arm  # measured pressures act as they are
    logs = spec.input.logs or ()
    arm = Arm(_bare(arm.parameters))
    variables = tuple(
        v.model_copy(update={"values": logs}) if v.is_text and v.values is None else v for v in spec.variables
    )
    targets = tuple(target_of(spec, arm, number, variable) for number, variable in enumerate(variables))
    gauge = [recording.name for recording in recorded if recording.pressures.gauge]
    for number, variable in enumerate(spec.variables):
        if gauge and variable.what == "ambient_pressure":
            text = f"found ambient_pressure, but {gauge[0]} has gauge pressures, which move with it; allowed: logs of "
            raise spec.fault(("vary", number, "what"), text + "absolute pressures")
    _check_initial(spec, arm, targets)
    chosen = spec.simulation.instruction_set or instruction_set or _core.instruction_sets()[-1]
    mapping = spec.to_mapping()
    # Neither moves a result: the one only cuts the output, the other stands among the parts as what it came to.
    del mapping["partition_size"]
    mapping["arm"], mapping["simulation"]["instruction_set"] = "", None
    parts = {
        "spec": _digest(json.dumps(mapping, sort_keys=True)),
        "arm": _digest(arm.parameters.to_core_json()),
        **{f"log {name}": digest for name, digest in zip(logs, hashes, strict=True)},
        "package version": _core.__version__,
        "instruction set": chosen,
    }
    for number, begun in enumerate(beginnings):
        _check_rows(spec, arm, begun.drive, _name(logs, number))
    if _starts_elsewhere(spec, arm, targets):
        beginnings = tuple(Beginning(None, (), begun.drive) for begun in beginnings)
    return Plan(spec, variables, targets, arm, beginnings, logs, spec.run_count, chosen, parts)


def _starts_elsewhere(spec: SweepSpec, arm: Arm, targets: tuple[Target, ...]) -> bool:
    """Whether runs start from what the spec says, or with preloads that it draws, in place of a log's first pose."""
    own = {f"effect.{number}.{name}" for number in preloaded(arm.parameters) for name in NUMBERS}
    drawn = any(str(path) in own for target in targets if target.kind == "parameter" for path in target.places)
    return drawn or spec.initial.lengths is not None or spec.initial.pressures is not None


def _check_rows(spec: SweepSpec, arm: Arm, drive: Input, name: str) -> None:
    """Check that a run has rows, and no more than memory holds; before there are any."""
    dt, most = spec.simulation.dt, RUN_BYTES // (8 * _numbers_a_row(arm))
    span = float(drive.time[-1] - drive.time[0])
    key = ("simulation", "dt")
    if not span / dt + 1.0 <= most:
        raise spec.fault(
            key,
            f"found {dt}: a run of {span:g} s under {name} would have {span / dt:.3g} rows; "
            f"allowed: at most {most}; make dt longer or the duration shorter",
        )
    if len(_rows(drive, dt)) < 2:
        raise spec.fault(key, f"found {dt}; allowed: at most the duration of {name}")


def _numbers_a_row(arm: Arm) -> int:
    """Numbers in a row of a run while it is simulated: lengths, rates, positions."""
    return 3 * 3 * arm.section_count


def _arm(spec: SweepSpec) -> Arm:
    path = spec.folder / spec.arm
    if os.path.exists(path):
        return Arm.load(path)
    if spec.arm in robots.names():
        return robots.load(spec.arm)
    ships = ", ".join(robots.names())
    raise spec.fault(("arm",), f"found {shown(spec.arm)}; allowed: a file that exists (from {spec.folder}), or {ships}")


def _bare(parameters: ArmParameters) -> ArmParameters:
    """Without provenance: no result follows from it, and every run would have it checked again."""
    mapping = parameters.to_mapping()
    tables = [mapping, mapping.get("pneumatics", {}), *mapping["section"], *mapping.get("effect", ())]
    tables += [bellows for section in mapping["section"] for bellows in section.get("bellows", ())]
    for table in tables:
        table.pop("provenance", None)
    return ArmParameters.from_mapping(mapping, origin=parameters.name)


def _recordings(spec: SweepSpec, arm: Arm) -> list[Recording]:
    """The logs as the arm sees them, all with the same sort of pressures."""
    paths = [spec.folder / name for name in spec.input.logs or ()]
    for name, path in zip(spec.input.logs or (), paths, strict=True):
        if not os.path.exists(path):
            raise spec.fault(("input", "logs"), f"found {shown(name)}; allowed: files that exist (from {spec.folder})")
    given = spec.input
    mapping = None if given.log_columns is None else spec.folder / given.log_columns
    return recordings(arm, paths, pressures=given.log_pressures, missing=given.log_missing, mapping=mapping)


def _beginnings(spec: SweepSpec, arm: Arm, recorded: Sequence[Recording]) -> tuple[tuple[Beginning, ...], list[str]]:
    duration = spec.simulation.duration
    if spec.input.pressures is not None:
        assert duration is not None
        _check_length(spec, ("input", "pressures"), spec.input.pressures, len(arm.inputs), "inputs")
        return (Beginning(None, (), Input.constant(spec.input.pressures, duration)),), []
    found, hashes = [], []
    for number, recording in enumerate(recorded):
        begun = begins(arm, recording)
        drive = begun.drive
        if duration is not None:
            if drive.time[0] + duration > drive.time[-1] + 1e-9 * duration:
                span = f"{_name(spec.input.logs or (), number)} has {drive.time[-1] - drive.time[0]:g} s"
                raise spec.fault(("simulation", "duration"), f"found {duration}; {span}; allowed: at most that")
            begun = replace(begun, drive=_cut(drive, drive.time[0] + duration))
        found.append(begun)
        hashes.append(str(recording.log.sha256))
    return tuple(found), hashes


def _cut(drive: Input, end: float) -> Input:
    """The input up to the first sample at or after ``end``."""
    rows = slice(0, int(np.searchsorted(drive.time, end, side="left")) + 1)
    forces = None if drive.forces is None else np.ascontiguousarray(drive.forces[rows])
    return replace(drive, time=drive.time[rows].copy(), pressures=drive.pressures[rows].copy(), forces=forces)


def _rows(drive: Input, dt: float) -> Array:
    count = int(np.floor((drive.time[-1] - drive.time[0]) / dt + 1e-9)) + 1
    return np.asarray(drive.time[0] + dt * np.arange(count), dtype=np.float64)


def _check_initial(spec: SweepSpec, arm: Arm, targets: tuple[Target, ...]) -> None:
    initial, columns = spec.initial, 3 * arm.section_count
    for name, values, count, what in (
        ("pressures", initial.pressures, len(arm.inputs), "inputs"),
        ("lengths", initial.lengths, columns, "bellows lengths"),
        ("velocities", initial.velocities, columns, "bellows lengths"),
    ):
        if values is not None:
            _check_length(spec, ("initial", name), values, count, what)
    for number, target in enumerate(targets):
        if target.kind == "initial_pressure" and initial.lengths is not None:
            text = "found initial pressures, but [initial] gives lengths; allowed: one of them"
            raise spec.fault(("vary", number, "what"), text)


def _check_length(spec: SweepSpec, key: tuple[str, ...], values: tuple[float, ...], count: int, what: str) -> None:
    if len(values) != count:
        raise spec.fault(key, f"found {len(values)} numbers; allowed: {count}, one for each of the arm's {what}")


def _name(logs: tuple[str, ...], number: int) -> str:
    return f'"{logs[number]}"' if logs else "the input"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
