"""What a log holds: rates, held channels, grids, ranges, steps, steady stretches."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.checkup.finding import Explanation, Finding, Severity
from bha.checkup.layout import layout_of
from bha.recordings import ranges
from bha.support.spans import spans_of

if TYPE_CHECKING:
    from bha.recordings import ChannelFacts, Recording

Array = NDArray[np.float64]

#: A pressure has stepped if it moves by this share of its range within this time, s.
STEP_SHARE, STEP_TIME = 0.1, 0.5
#: A stretch is steady if for this long, s, no pressure moves by this share of its range and no output by this share of
#: its travel (or six noises).
STEADY_TIME, STEADY_PRESSURE, STEADY_OUTPUT = 1.0, 0.02, 0.02
MOST_LOOKS = 6000
#: Share of readings of a channel that may be lost without a word among the findings (the table has them all).
WORTH_SAYING = 0.005


@dataclass(frozen=True)
class Channel:
    """One channel of a log.

    Attributes:
        name: of the column.
        unit: SI unit.
        lowest: least reading.
        highest: greatest reading.
        rate: readings a second; that of the rows where it does not hold.
        held: share of rows that repeat the reading before.
        quantum: distance of neighbouring readings, 0 where they are not on a grid.
        noise: standard deviation from reading to reading.
        steps: how often it jumps (pressures only).
        lost: share of rows that do not count: frozen, dropped out, spikes, missing.
    """

    name: str
    unit: str
    lowest: float
    highest: float
    rate: float
    held: float
    quantum: float
    noise: float
    steps: int
    lost: float


@dataclass(frozen=True)
class LogFacts:
    """What one log holds.

    Attributes:
        name: of the log.
        duration: s.
        rows: number of rows.
        rate: rows a second.
        pressures: ``"measured"`` or ``"commanded"``, with why.
        channels: pressures, then outputs.
        steady: stretches (from, to), s, in which nothing moves.
        flaws: frozen, dropped out and jumping channels, in words.
        unused: what the recording says beside: columns that are used by nothing, choices.
    """

    name: str
    duration: float
    rows: int
    rate: float
    pressures: str
    channels: tuple[Channel, ...]
    steady: tuple[tuple[float, float], ...]
    flaws: tuple[str, ...]
    unused: tuple[str, ...]

    def to_mapping(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def findings(self) -> list[Finding]:
        """Flaws of the samples and columns that are used by nothing, as findings."""
        found = [Finding("note", "columns", self.name, text) for text in self.unused]
        worth = [c for c in self.channels if c.lost > WORTH_SAYING]
        if self.flaws and worth:
            worst = max((channel.lost for channel in self.channels), default=0.0)
            what = "some readings do not count: " + "; ".join(self.flaws[:4])
            repair = Explanation("left out of all that follows", "nothing, or a log without them")
            severity: Severity = "warning" if worst > 0.2 else "note"
            found.append(Finding(severity, "samples", self.name, what, "", {"lost": worst}, (repair,)))
        return found


def facts_of(recording: Recording) -> LogFacts:
    """What a recording's log holds."""
    clock = recording.clock
    rate = 1.0 / clock.interval if clock.interval > 0.0 else 0.0
    values = read_pressures(recording)
    all_rows = np.ones(len(values), dtype=np.bool_)
    least = STEP_SHARE * np.ptp(layout_of(recording.arm).pressure_range, axis=1)
    channels = []
    for k, fact in enumerate(recording.pressure_facts):
        steps = count_steps(recording.time, values[:, k], max(float(least[k]), 6.0 * fact.noise))
        channels.append(_channel(recording.time, fact, values[:, k], all_rows, rate, steps))
    channels += [
        _channel(recording.time, fact, recording.measured[:, k], recording.usable[:, k], rate, 0)
        for k, fact in enumerate(recording.facts)
    ]
    first = float(recording.time[0])
    flaws = [text for fact in (*recording.pressure_facts, *recording.facts) for text in _flaws(fact, first)]
    if clock.tick > 0.0:
        flaws.append(f"times lie on the grid of a {1e3 * clock.tick:.3g} ms timer, rows are even")
    flaws += [f"no rows {ranges.stretches(clock.gaps, first)}"] if clock.gaps else []
    choice = recording.pressures
    return LogFacts(
        name=recording.name,
        duration=clock.duration,
        rows=len(recording.time),
        rate=rate,
        pressures=f"{choice.sort} ({choice.chosen})",
        channels=tuple(channels),
        steady=steady_stretches(recording),
        flaws=tuple(_grouped(flaws)),
        # What is outside of a range is a finding of its own here, with what repairs it.
        unused=tuple(text for text in recording.findings if text not in ranges.outside(recording)),
    )


def read_pressures(recording: Recording) -> Array:
    """Pressures of the rows, Pa absolute, shape (m, J); straight lines where one was not read, and no curve beyond."""
    values = recording.drive.pressures[recording.drive_rows].copy()
    time = recording.time
    for k, fact in enumerate(recording.pressure_facts):
        for start, end in (*fact.frozen, *fact.dropouts):
            inside = (time > start) & (time < end)
            known = np.flatnonzero(~inside)
            if inside.any() and len(known) > 1:
                values[inside, k] = np.interp(time[inside], time[known], values[known, k])
    return values


def count_steps(time: Array, values: Array, least: float) -> int:
    """How often a pressure (m,) moves by ``least`` Pa or more within a short time."""
    if len(time) < 3:
        return 0
    before = np.searchsorted(time, time - STEP_TIME, side="left")
    moved = np.abs(values - values[before]) > least
    return int(np.sum(np.diff(moved.astype(np.int64)) > 0))


def steady_stretches(recording: Recording) -> tuple[tuple[float, float], ...]:
    """Stretches (from, to), s, in which neither pressures nor outputs move."""
    # Some thousand looks are enough to find stretches of a second.
    rows = slice(None, None, max(1, len(recording) // MOST_LOOKS))
    time = recording.time[rows]
    values = read_pressures(recording)[rows]
    least = STEADY_PRESSURE * float(np.min(np.ptp(layout_of(recording.arm).pressure_range, axis=1)))
    noise = np.array([fact.noise for fact in recording.pressure_facts])
    still = _still(time, values, np.maximum(least, 6.0 * noise))
    if recording.outputs:
        pairs = zip(recording.measured.T, recording.usable.T, strict=True)
        known = np.column_stack(
            [np.interp(time, recording.time[g], o[g]) if g.any() else np.zeros(len(time)) for o, g in pairs]
        )
        kinds = np.array([output.kind for output in recording.outputs])
        travel = np.array([np.max(np.ptp(known[:, kinds == kind], axis=0)) for kind in kinds])
        still &= _still(time, known, np.maximum(STEADY_OUTPUT * travel, 6.0 * recording.noise))
    spans: list[tuple[float, float]] = []
    for first, last in spans_of(still):
        # A row is still if nothing moves in the second that it begins.
        start, end = float(time[first]), min(float(time[last - 1]) + STEADY_TIME, float(time[-1]))
        if spans and start <= spans[-1][1]:
            start = spans.pop()[0]
        spans.append((start, end))
    return tuple(spans)


def _still(time: Array, table: Array, limit: Array) -> NDArray[np.bool_]:
    """Rows from which on for a while no column (m, k) moves by more than its limit."""
    still = time + STEADY_TIME <= time[-1]
    parts = STEADY_TIME * np.linspace(0.05, 1.0, 20)
    looks = [np.minimum(np.searchsorted(time, time + part), len(time) - 1) for part in parts]
    for k in range(table.shape[1]):
        column = table[:, k]
        # Coarse is enough: about 20 looks a second of stretch.
        low, high = column.copy(), column.copy()
        for at in looks:
            low, high = np.minimum(low, column[at]), np.maximum(high, column[at])
        still &= high - low <= limit[k]
    return np.asarray(still)


def _channel(
    time: Array, fact: ChannelFacts, values: Array, good: NDArray[np.bool_], rate: float, steps: int
) -> Channel:
    known = values[good & np.isfinite(values)]
    spans = [*fact.frozen, *fact.dropouts]
    lost = (
        sum(float(np.mean((time >= a) & (time <= b))) for a, b in spans)
        + fact.missing
        + len(fact.spikes) / max(len(values), 1)
    )
    return Channel(
        name=fact.name,
        unit=fact.unit,
        lowest=float(known.min()) if len(known) else float("nan"),
        highest=float(known.max()) if len(known) else float("nan"),
        rate=1.0 / fact.interval if fact.held > 0.0 and fact.interval > 0.0 else rate,
        held=fact.held,
        quantum=fact.quantum,
        noise=fact.noise,
        steps=steps,
        lost=min(1.0, lost),
    )


def _flaws(fact: ChannelFacts, first: float) -> list[str]:
    spans = (("is frozen", fact.frozen), ("stands still", fact.dropouts))
    said = [f"{fact.name} {what} {ranges.stretches(own, first)}" for what, own in spans if own]
    if fact.spikes:
        at = ranges.moment(fact.spikes[0], first)
        count = len(fact.spikes)
        said.append(
            f"{fact.name} jumps away and back once, at {at}"
            if count == 1
            else f"{fact.name} jumps away and back {count} times, first at {at}"
        )
    if fact.missing > 0.0:
        said.append(f"{fact.name} is missing in {100 * fact.missing:.3g} % of the rows")
    return said


def _grouped(flaws: list[str]) -> list[str]:
    """Flaws that differ in the channel only, said once."""
    groups: dict[str, list[str]] = {}
    for text in dict.fromkeys(flaws):
        name, _, rest = text.partition(" ")
        groups.setdefault(rest, []).append(name)
    return [
        f"{names[0]} {rest}" if len(names) == 1 else f"{', '.join(names)}: {rest}" for rest, names in groups.items()
    ]
