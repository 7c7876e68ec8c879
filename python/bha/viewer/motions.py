"""What is shown over time: motions of arms, and where heads were measured meanwhile."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bha import names
from bha.errors import InputError, LogError
from bha.logs import Log
from bha.recordings import PressureSort, Recording
from bha.recordings.compare import shown_by
from bha.runs import Trajectory
from bha.simulation import simulate
from bha.support.shown import short_repr

if TYPE_CHECKING:
    from bha.arm import Arm

Array = NDArray[np.float64]
#: What can be shown: a log drives a simulation, a trajectory is shown as it is; of a file its columns say which it is.
Source: TypeAlias = "Trajectory | Log | Recording | str | os.PathLike[str]"

#: Distance of the rows of a simulation that is shown, s: the rate of screens.
ROW_DISTANCE = 1.0 / 60.0


@short_repr
@dataclass(frozen=True, eq=False)
class Moment:
    """What is shown at one time; NaN where it is not known.

    Attributes:
        lengths: the arm's coordinates, m, shape (3n,).
        pressures: Pa absolute, shape (inputs,), in the order of the arm's inputs.
        heads: positions of the heads as sensors would have them, in the world, m, shape (n, 3).
        measured: measured positions of the heads in the world, m, shape (n, 3).
    """

    lengths: Array
    pressures: Array
    heads: Array
    measured: Array

    @property
    def gap(self) -> Array:
        """Measured minus shown positions of the heads, m, shape (n, 3)."""
        return self.measured - self.heads


@dataclass(frozen=True, eq=False)
class Measured:
    """Where heads were measured.

    Attributes:
        time: s, shape (r,).
        heads: positions in the world, m, shape (r, n, 3); NaN where not measured.
    """

    time: Array
    heads: Array


@short_repr
@dataclass(frozen=True, eq=False)
class Motion:
    """One arm over time.

    Attributes:
        label: what it is called.
        time: s, shape (m,), not decreasing.
        lengths: the arm's coordinates, m, shape (m, 3n).
        pressures: Pa absolute, shape (m, inputs).
        heads: positions of the heads as sensors would have them, m, shape (m, n, 3).
        measured: where they were measured, or None.
    """

    label: str
    time: Array
    lengths: Array
    pressures: Array
    heads: Array
    measured: Measured | None = None

    def at(self, time: float) -> Moment:
        """What is shown at a time, s: between rows the straight line, before the first and after the last these."""
        measured = np.full(self.heads.shape[1:], np.nan)
        if self.measured is not None and self.measured.time[0] <= time <= self.measured.time[-1]:
            measured = _between(self.measured.time, self.measured.heads, time)
        return Moment(
            lengths=_between(self.time, self.lengths, time),
            pressures=_between(self.time, self.pressures, time),
            heads=_between(self.time, self.heads, time),
            measured=measured,
        )

    def gaps(self) -> Array | None:
        """Distances between shown and measured heads at the measured rows, m, shape (r, n); None without any."""
        if self.measured is None:
            return None
        shown = np.empty_like(self.measured.heads)
        for place in np.ndindex(shown.shape[1:]):
            shown[:, *place] = np.interp(self.measured.time, self.time, self.heads[:, *place])
        return np.asarray(np.linalg.norm(self.measured.heads - shown, axis=-1))


#: How many times as long as they are gaps may be drawn.
MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100)
#: How long a typical gap is drawn, over the arm's reach, where it would else be too short to be seen.
_SEEN = 0.05


def drawn_gap(times: float) -> str:
    """How the gap is drawn, in words."""
    return "gap to scale" if times == 1.0 else f"gap drawn {times:g} times"


def magnification(motions: Sequence[Motion], reach: float) -> int:
    """How many times as long as it is the gap of the first motion is best drawn on an arm of this length, m."""
    gaps = motions[0].gaps() if motions else None
    if gaps is None or not np.isfinite(gaps).any():
        return 1
    typical = float(np.sqrt(np.nanmean(gaps**2)))
    return max((m for m in MAGNIFICATIONS if m * typical <= _SEEN * reach), default=1)


def _between(time: Array, rows: Array, at: float) -> Array:
    after = int(np.clip(np.searchsorted(time, at, side="right"), 1, max(len(time) - 1, 1)))
    if len(time) == 1:
        return np.array(rows[0])
    before, span = after - 1, time[after] - time[after - 1]
    share = float(np.clip((at - time[before]) / span, 0.0, 1.0)) if span > 0.0 else 1.0
    # At a row that row itself: the one beside it may be missing.
    if share in (0.0, 1.0):
        return np.array(rows[after if share else before])
    return np.asarray((1.0 - share) * rows[before] + share * rows[after])


def motions_of(
    arm: Arm, sources: Sequence[Source], *, pressures: PressureSort | None = None, missing: bool = False
) -> tuple[Motion, ...]:
    """What some logs, trajectories and files show of an arm.

    Args:
        arm: the arm.
        sources: see :data:`Source`. A file with the rates of all lengths (``qd11`` ...), as ``bha simulate`` writes
            it, and ``.npz`` are trajectories; other files are logs.
        pressures: which pressures of logs drive the arm, as :class:`bha.Recording` has it.
        missing: whether samples of logs that are files may be missing.

    Raises:
        InputError: a trajectory of another arm, without rows, or at other times than the first source.
        LogError: a file cannot be read, or a log lacks a pressure of the arm.
        SimulationError: the simulation of a log could not go on.

    Warns:
        LogWarning: what :class:`bha.Recording` finds odd in a log.
    """
    found = [_motion(arm, source, pressures, missing) for source in sources]
    for motion in found[1:]:
        first = found[0]
        if motion.time[0] > first.time[-1] or motion.time[-1] < first.time[0]:
            raise InputError(
                f"{motion.label}: from {motion.time[0]:g} to {motion.time[-1]:g} s, {first.label} from "
                f"{first.time[0]:g} to {first.time[-1]:g} s; show together what happened at the same time"
            )
    return tuple(found)


def _motion(arm: Arm, source: Source, pressures: PressureSort | None, missing: bool) -> Motion:
    if isinstance(source, Trajectory):
        return of_trajectory(arm, source, "trajectory")
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        if path.suffix.lower() == ".npz":
            return of_trajectory(arm, _stored(path), path.name)
        log = Log.read(path, ambient_pressure=arm.parameters.ambient_pressure, missing=missing)
        if has_all_rates(arm, log):
            return _of_written(arm, log, path.name)
        return of_recording(Recording(arm, log, pressures=pressures))
    if isinstance(source, Log):
        return of_recording(Recording(arm, source, pressures=pressures))
    if isinstance(source, Recording):
        if source.arm != arm:
            raise InputError(f"{source.name}: a recording of {source.arm.name}, not of {arm.name}")
        return of_recording(source)
    raise InputError(f"{type(source).__name__} is shown by nothing; give logs, trajectories or paths of files")


def part(motions: Sequence[Motion], start: float | None = None, end: float | None = None) -> tuple[Motion, ...]:
    """What motions show from ``start`` to ``end``, s after the start of the first; all that there is where None.

    Raises:
        InputError: nothing happens then.
    """
    if not motions or (start is None and end is None):
        return tuple(motions)
    zero = float(motions[0].time[0])
    low = zero if start is None else zero + start
    high = float(motions[0].time[-1]) if end is None else zero + end
    if not low <= high or low > motions[0].time[-1] or high < zero:
        span = f"from {low - zero:g} to {high - zero:g} s"
        raise InputError(f"{motions[0].label}: nothing {span}; it lasts {motions[0].time[-1] - zero:g} s")
    return tuple(_cut(motion, low, high) for motion in motions)


def _cut(motion: Motion, low: float, high: float) -> Motion:
    """A motion from one time to another, both ends with a row; measurements as they are."""
    inside = motion.time[(motion.time > low) & (motion.time < high)]
    times = np.unique(np.clip(np.concatenate([[low], inside, [high]]), motion.time[0], motion.time[-1]))
    rows: dict[str, Any] = {
        name: np.stack([_between(motion.time, getattr(motion, name), float(t)) for t in times])
        for name in ("lengths", "pressures", "heads")
    }
    measured = motion.measured
    if measured is not None:
        kept = (measured.time >= low) & (measured.time <= high)
        measured = Measured(measured.time[kept], measured.heads[kept]) if kept.any() else None
    return replace(motion, time=times, measured=measured, **rows)


def of_trajectory(arm: Arm, trajectory: Trajectory, label: str) -> Motion:
    """A trajectory as it is.

    Raises:
        InputError: it has no rows, or is of an arm with other sections or inputs.
    """
    if len(trajectory) == 0:
        raise InputError(f"{label}: has no rows to show")
    if trajectory.section_count != arm.section_count:
        many = f"{trajectory.section_count} sections, {arm.name} has {arm.section_count}"
        raise InputError(f"{label}: is of an arm with {many}")
    lacking = [name for name in arm.inputs if name not in trajectory.input_names]
    if lacking:
        raise InputError(f"{label}: has no pressures {', '.join(lacking)}; {arm.name} has {', '.join(arm.inputs)}")
    order = [trajectory.input_names.index(name) for name in arm.inputs]
    heads = trajectory.measured_head_positions
    return Motion(
        label=label,
        time=trajectory.time,
        lengths=trajectory.lengths,
        pressures=trajectory.pressures[:, order],
        heads=trajectory.head_positions if heads is None else heads,
    )


def of_recording(recording: Recording) -> Motion:
    """The arm under a log's pressures, simulated, beside the heads that the log has measured.

    Raises:
        SimulationError: the simulation could not go on.
    """
    arm, start, end = recording.arm, float(recording.drive.time[0]), float(recording.drive.time[-1])
    rows = np.append(np.arange(start, end, ROW_DISTANCE), end)
    simulated = of_trajectory(arm, simulate(arm, recording, times=rows), f"{recording.name}, simulated")
    measured = None
    if any(output.kind == "position" for output in recording.outputs):
        shown = recording.as_trajectory()
        measured = Measured(shown.time, shown.head_positions) if len(shown) else None
    return Motion(**{**simulated.__dict__, "measured": measured})


def has_all_rates(arm: Arm, log: Log) -> bool:
    """Whether a log has the rates of all three lengths of each section, which simulations write and no sensor has."""
    sections = range(1, arm.section_count + 1)
    return any(
        all(name(section, number) in log for section in sections for number in (1, 2, 3))
        for name in (names.velocity_name, names.coordinate_velocity_name)
    )


def _of_written(arm: Arm, log: Log, label: str) -> Motion:
    """A trajectory that was written as a table."""
    lengths, heads = shown_by(arm, log, label)
    if not np.isfinite(lengths).any():
        raise LogError(f"{label}: has rates, but not the lengths of all sections; write it with bha simulate --out")
    acting = [log[name] if name in log else np.full(len(log), np.nan) for name in arm.inputs]
    return Motion(label, log.time, lengths, np.stack(acting, axis=-1), heads)


def _stored(path: Path) -> Trajectory:
    """A trajectory that was written as ``.npz``."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return Trajectory(
                **{name: stored[name] for name in ("time", "lengths", "velocities", "pressures", "head_positions")},
                input_names=tuple(map(str, stored["input_names"])),
                arm_name=str(stored["arm_name"]),
            )
    except FileNotFoundError:
        raise LogError(f"{path}: there is no such file") from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise LogError(f"{path}: no trajectory that bha wrote ({error}); write one with bha simulate --out") from error
