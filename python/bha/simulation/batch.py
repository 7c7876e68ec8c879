"""Many simulations in one call: parameter sets, inputs, initial states, windows of a log."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arrays import floats
from bha.errors import BhaError, InputError, LogWarning
from bha.logs import Log
from bha.recordings import Recording
from bha.recordings.beginning import Beginning, preloaded
from bha.recordings.ranges import members_beyond
from bha.runs.input import Input, Interpolation
from bha.runs.options import Method, Options
from bha.runs.rows import check_room
from bha.simulation.single import as_input, beginning_of

if TYPE_CHECKING:
    from bha.arm import Arm

T = TypeVar("T")

InstructionSet = Literal["scalar", "neon", "avx2", "avx512"]


@dataclass(frozen=True, eq=False)
class Batch:
    """What a batch of simulations returned; a member that failed keeps its place.

    Attributes:
        time: times of the rows, s, shape (rows,) or (members, rows); NaN where a member has no row.
        lengths: m, shape (members, rows, 3n); NaN from a member's failure on.
        velocities: m/s, shape (members, rows, 3n), or None.
        head_positions: origins of the heads in the world, m, shape (members, rows, n, 3), or None.
        head_orientations: of the heads in the world, unit quaternions (w, x, y, z), w >= 0, shape (members,
            rows, n, 4), or None.
        failures: for each member None or the error that ended it (a :class:`bha.SimulationError` knows the time).
        statistics: steps, rejected steps and evaluations of each member, shape (members, 3).
    """

    time: NDArray[np.float64]
    lengths: NDArray[np.float64]
    velocities: NDArray[np.float64] | None
    head_positions: NDArray[np.float64] | None
    failures: tuple[BhaError | None, ...]
    statistics: NDArray[np.uint64]
    head_orientations: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        """Number of members."""
        return len(self.failures)

    def __repr__(self) -> str:
        """Members, failures, rows and sections in one line."""
        failed = sum(failure is not None for failure in self.failures)
        sections = self.lengths.shape[-1] // 3
        return f"<Batch: {len(self)} members, {failed} failed, {self.time.shape[-1]} rows, {sections} sections>"

    @property
    def succeeded(self) -> NDArray[np.bool_]:
        """Which members reached their last row, shape (members,)."""
        return np.array([failure is None for failure in self.failures], dtype=np.bool_)


def simulate_batch(
    arms: Arm | Sequence[Arm],
    inputs: Input | Log | Recording | Sequence[Input | Log | Recording],
    x0: ArrayLike | None = None,
    *,
    times: ArrayLike | None = None,
    start: ArrayLike | None = None,
    method: Method = "auto",
    step: float = 1e-3,
    rtol: float = 1e-6,
    atol: float = 1e-8,
    max_steps: int | None = None,
    interpolation: Interpolation | None = None,
    shared_steps: bool = False,
    velocities: bool = True,
    head_positions: bool = False,
    head_orientations: bool = False,
    measured: bool = False,
    threads: int | None = None,
    instruction_set: InstructionSet | None = None,
    progress: Callable[[float], None] | None = None,
    warn: bool = True,
) -> Batch:
    """Simulate many arms, inputs, initial states or windows of a log, over all cores.

    ``arms``, ``inputs``, ``x0``, ``start`` and ``times`` are each one for all members or one a member; the longest says
    how many members there are. A member may be a window: its own start, initial state and output times. The result does
    not depend on ``threads``. Members with the same output times after their start are computed abreast,
    in the lanes of the processor's vector registers. With a fixed step they agree with single simulations to rounding
    (1e-12). With an adaptive method members abreast take steps together, controlled by the one with the greatest error:
    they agree with single simulations to the tolerance. ``dopri5`` by name is run one by one, as alone.

    Differences between members, as for a Jacobian, need ``shared_steps``: then all members that can be abreast, however
    many, take the steps that the first of them takes alone, and no choice of steps shows in a difference. The error is
    controlled for the first, so the others should be close to it.

    Args:
        arms: the arms; all need the same number of sections and of inputs.
        inputs: what drives them; a :class:`bha.Log` stands for its pressures and external forces. Give the same object
            again, not a copy, where members share an input.
        x0: initial lengths and rates, shape (6n,) or (members, 6n), m and m/s; at rest under the pressures at the start
            if None: of a log that begins at rest an arm with the effect ``preload`` takes what held it there, as by
            :func:`bha.simulate`. Given, and with a later ``start``, pressures that lag begin as the input before has
            led to, but behind valves and chambers (``full``).
        times: times of the rows, s, on the clock of the input, shape (rows,) or (members, rows), ascending; NaN at a
            row's end where a member has fewer. The samples of the first input from the start on if None.
        start: when the members start, s, a number or (members,); the first sample of the input if None.
        method: as in :class:`bha.Options`; ``"auto"`` chooses one for all members, the implicit one if an arm is stiff.
        step: longest step of ``rk4`` and ``ros2``, s.
        rtol: relative tolerance of adaptive methods.
        atol: absolute tolerance of adaptive methods, m and m/s.
        max_steps: most steps of a member; None is no limit.
        interpolation: what holds between two samples, ``"linear"`` or ``"hold"``, in place of what the inputs say.
        shared_steps: whether members take the steps of the first, see above.
        velocities: whether to return the rates.
        head_positions: whether to return the heads' positions.
        head_orientations: whether to return the heads' orientations.
        measured: whether lengths and heads are to be those that the sensors have, where effects of an arm act on
            sensors (delay, offset, gain), in place of the true ones.
        threads: how many threads; as many as there are cores if None.
        instruction_set: what computes members abreast: ``"scalar"`` (one after the other), ``"neon"``, ``"avx2"`` (4)
            or ``"avx512"`` (8); the widest one of this processor if None.
        progress: called about 20 times a second with the fraction of members done.
        warn: whether to warn, once, of members whose lengths leave the ``length_range`` of their arm.

    Returns:
        The members' rows, NaN and a status for those that failed.

    Raises:
        InputError: arguments that do not fit together or are not allowed. Failures of single members raise nothing.

    Warns:
        LogWarning: lengths leave the ``length_range`` of an arm, with how many members do.
    """
    arm_list = [arms] if not isinstance(arms, Sequence) else list(arms)
    input_list = list(inputs) if isinstance(inputs, Sequence) else [inputs]
    if not arm_list or not input_list:
        raise InputError("arms and inputs: at least one of each is needed")
    state = None if x0 is None else floats(x0, "x0", (None,), (None, None))
    starts = None if start is None else floats(start, "start", (), (None,))
    rows = None if times is None else floats(times, "times", (None,), (None, None), finite=False)
    sizes = {"arms": len(arm_list), "inputs": len(input_list)}
    for name, array, single in (("x0", state, 1), ("start", starts, 0), ("times", rows, 1)):
        if array is not None:
            sizes[name] = len(array) if array.ndim > single else 1
    count = max(sizes.values())
    wrong = {name: size for name, size in sizes.items() if size not in (1, count)}
    if wrong:
        found = ", ".join(f"{name} {size}" for name, size in sizes.items())
        raise InputError(f"the numbers of members differ: {found}; each must be 1 or the greatest of them")

    arm_list, input_index, drives = _driven(arm_list, input_list, count, rest=state is None)
    arm_index, unique_arms = _unique(arm_list, count)
    arm_index, unique_arms = _without_pneumatics(arm_index, unique_arms, [drives[k].commanded for k in input_index])
    if starts is None:
        starts = np.array([_first(drives[index]) for index in input_index])
    starts = np.broadcast_to(starts, (count,))
    if rows is None:
        sample_times = floats(drives[0].time, "time", (None,))
        rows = sample_times[sample_times >= starts[0]]
    time_sets = [_without_padding(row) for row in np.atleast_2d(rows)]
    if state is not None:
        state = np.ascontiguousarray(np.broadcast_to(state, (count, state.shape[-1])))

    options = Options(method, step, rtol, atol, max_steps=max_steps, interpolation=interpolation)
    each = 3 * (1 + velocities + head_positions) + 4 * head_orientations
    columns = unique_arms[0].section_count * each
    check_room(float(count) * max(map(len, time_sets)), 8 * columns, "rows of members; fewer at a time are needed.")

    batch = run_members(
        unique_arms,
        [drive.in_core(interpolation, f"inputs[{k}].") for k, drive in enumerate(drives)],
        time_sets,
        [(arm_index[k], input_index[k], k if len(time_sets) > 1 else 0) for k in range(count)],
        starts,
        state,
        options,
        velocities=velocities,
        head_positions=head_positions,
        head_orientations=head_orientations,
        measured=measured,
        shared_steps=shared_steps,
        threads=threads,
        instruction_set=instruction_set,
        progress=progress,
    )
    if warn:
        # Those that failed say so themselves.
        text = members_beyond([unique_arms[k] for k in arm_index], batch.lengths, batch.succeeded)
        if text is not None:
            warnings.warn(text, LogWarning, stacklevel=2)
    return replace(batch, time=rows[..., : batch.lengths.shape[1]])


def run_members(
    arms: Sequence[_core.Arm],
    inputs: Sequence[_core.Input],
    times: Sequence[NDArray[np.float64]],
    members: Sequence[tuple[int, int, int]],
    start: NDArray[np.float64],
    state: NDArray[np.float64] | None,
    options: Options,
    *,
    moved: NDArray[np.float64] | None = None,
    velocities: bool = True,
    head_positions: bool = False,
    head_orientations: bool = False,
    measured: bool = False,
    shared_steps: bool = False,
    threads: int | None = None,
    instruction_set: InstructionSet | None = None,
    progress: Callable[[float], None] | None = None,
) -> Batch:
    """What :func:`simulate_batch` runs: members as they are, of arms that need no parameter file.

    Args:
        arms: the arms; pneumatics act on every input.
        inputs: what drives them.
        times: sets of output times, s, each ascending.
        members: for each member the places of its arm, its input and its times.
        start: when each starts, s, shape (members,).
        state: initial lengths and rates, shape (members, 6n); at rest under the pressures at the start if None.
        options: how to integrate; the interpolation is that of the inputs.
        moved: of each bellows, where between the ends of what effects remember of its motion and of its pressure these
            stand at the start, -1 to 1, shape (members, 3n); at rest if None.
        velocities: as in :func:`simulate_batch`, like all that follows.
        head_positions: see there.
        head_orientations: see there.
        measured: see there.
        shared_steps: see there.
        threads: see there.
        instruction_set: see there.
        progress: see there.

    Returns:
        The members' rows; ``time`` holds the output times of each set, NaN where it has fewer.

    Raises:
        InputError: arguments that do not fit together.
    """
    out = _core.simulate_batch(
        arms,
        inputs,
        times,
        members,
        start,
        state,
        moved,
        method=options.method,
        step=options.step,
        rtol=options.rtol,
        atol=options.atol,
        max_steps=options.max_steps,
        velocities=velocities,
        head_positions=head_positions,
        head_orientations=head_orientations,
        measured=measured,
        shared_steps=shared_steps,
        threads=_thread_count(threads),
        instruction_set=instruction_set,
        progress=progress,
    )
    padded = np.full((len(times), out.lengths.shape[1]), np.nan)
    for row, own in zip(padded, times, strict=True):
        row[: len(own)] = own[: padded.shape[1]]
    heads, orientations = out.head_positions, out.head_orientations
    return Batch(
        time=padded,
        lengths=out.lengths,
        velocities=out.velocities,
        head_positions=None if heads is None else heads.reshape(*heads.shape[:2], -1, 3),
        failures=tuple(out.failures),
        statistics=out.statistics,
        head_orientations=None if orientations is None else orientations.reshape(*orientations.shape[:2], -1, 4),
    )


def _driven(
    arms: list[Arm], inputs: list[Input | Log | Recording], count: int, *, rest: bool
) -> tuple[list[Arm], list[int], list[Input]]:
    """The arms, for each member the index of its drive, and the drives; each object once.

    Of a log that begins at rest an arm takes its preloads, where it starts at rest too (:class:`Beginning`). A log is
    another drive for arms in another ambient pressure, and for those that take preloads from it.
    """
    starts: dict[tuple[int, float, bool], tuple[int, Beginning]] = {}
    taken: dict[tuple[int, int], Arm] = {}
    members: list[Arm] = []
    index: list[int] = []
    drives: list[Input] = []
    for k in range(count):
        arm, given = arms[k % len(arms)], inputs[k % len(inputs)]
        ambient = arm.parameters.ambient_pressure if isinstance(given, Log) else 0.0
        takes = rest and bool(preloaded(arm.parameters))
        key = id(given), ambient, takes
        if key not in starts:
            start = beginning_of(arm, given) if takes else Beginning(None, (), as_input(arm, given))
            starts[key] = len(drives), start
            drives.append(start.drive)
        place, start = starts[key]
        index.append(place)
        if (id(arm), id(given)) not in taken:
            taken[id(arm), id(given)] = start.taken_by(arm)
        members.append(taken[id(arm), id(given)])
    return members, index, drives


def _unique(items: list[T], count: int) -> tuple[list[int], list[T]]:
    """For each of ``count`` members the index of its item, and the items, each object once."""
    found: dict[int, int] = {}
    unique: list[T] = []
    for item in items:
        if id(item) not in found:
            found[id(item)] = len(unique)
            unique.append(item)
    index = [found[id(item)] for item in items]
    return (index if len(index) == count else index * count), unique


def _without_pneumatics(index: list[int], arms: list[Arm], commanded: list[bool]) -> tuple[list[int], list[Arm]]:
    """Members under measured pressures: those stand in the chambers already, so their arms go without pneumatics."""
    index, arms, ideal = list(index), list(arms), dict[int, int]()
    for member, arm in enumerate(index):
        if commanded[member] or arms[arm].pneumatics_level == "ideal":
            continue
        if arm not in ideal:
            ideal[arm] = len(arms)
            arms.append(arms[arm].with_changes(pneumatics="ideal"))
        index[member] = ideal[arm]
    return index, arms


def _first(drive: Input) -> float:
    if len(drive.time) == 0:
        raise InputError("an input has no samples; at least one is needed")
    return float(drive.time[0])


def _without_padding(row: NDArray[np.float64]) -> NDArray[np.float64]:
    missing = np.isnan(row)
    end = int(np.argmax(missing)) if missing.any() else len(row)
    if not missing[end:].all():
        raise InputError("times: NaN is allowed at a row's end only")
    return np.ascontiguousarray(row[:end])


def _thread_count(threads: int | None) -> int:
    if threads is None:
        return 0
    if threads < 1:
        raise InputError(f"threads: {threads}; at least 1 is needed")
    return threads
