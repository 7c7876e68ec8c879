"""What logs hold, section by section, and which way each pressure bends each section, by the file and by the logs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.checkup.facts import read_pressures
from bha.errors import InputError
from bha.plot.settings import GRID
from bha.plot.style import COLORS, DASHED, MILLIMETRES_PER_METRE, SOLID, draw, figure_of_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bha.checkup import Checkup
    from bha.recordings import Recording

Array = NDArray[np.float64]

PASCAL_PER_KILOPASCAL = 1e3
#: Marks of readings that do not count, and shading of steady stretches.
LOST, STEADY = "#D55E00", "#E8E8E8"
#: Between two logs on the common axis of time, as a share of all of it.
_GAP = 0.02


def plot_checkup(checkup: Checkup, *, title: str | None = None) -> Figure:
    """Draw what the logs of a check hold, a column of panels for each section.

    Top: absolute pressures of the section's inputs, kPa, with the permitted range. Then lengths, mm, with theirs, and
    the position of the section's head, mm, where measured. Grey: steady stretches. Ticks at the lower edge: readings
    that do not count. Bottom: which way each pressure bends the section, dashed by the arm's file, solid by the logs.
    Several logs stand one after the other.

    Args:
        checkup: what :func:`bha.check` returned.
        title: a line above the figure; arm and number of faults if None.

    Raises:
        InputError: the check has no logs.
        MissingExtraError: matplotlib is not installed.
    """
    recordings = checkup.recordings
    if not recordings:
        raise InputError("the check has no logs to draw")
    arm = recordings[0].arm
    sections = arm.section_count
    kinds = [kind for kind in ("length", "position") if any(o.kind == kind for r in recordings for o in r.outputs)]
    compass = checkup.evidence is not None and bool(checkup.evidence.blocks)
    rows = 1 + len(kinds) + compass
    starts = _starts(recordings)
    if title is None:
        count = len(checkup.faults)
        logs = f"{len(recordings)} log{'s' * (len(recordings) != 1)}"
        title = f"{arm.name}: {count or 'no'} fault{'s' * (count != 1)} in {logs}"
    heights = [1.0] * (1 + len(kinds)) + [1.5] * compass
    with figure_of_size(max(4.2, 2.5 * sections), 0.7 + 1.35 * sum(heights)) as figure:
        grid = figure.add_gridspec(rows, sections, height_ratios=heights)
        above: list[Axes] = []
        for i in range(sections):
            axes = figure.add_subplot(grid[0, i], sharey=above[0] if above else None)
            above.append(axes)
            _pressures(axes, checkup, i, starts)
            axes.set_title(f"Section {i + 1}", loc="left", fontweight="bold")
        above[0].set_ylabel("Pressure [kPa]")
        for row, kind in enumerate(kinds, start=1):
            own: list[Axes] = []
            for i in range(sections):
                axes = figure.add_subplot(
                    grid[row, i], sharex=above[i], sharey=own[0] if own and kind == "length" else None
                )
                own.append(axes)
                _outputs(axes, recordings, kind, i, starts)
            own[0].set_ylabel("Length [mm]" if kind == "length" else "Head position [mm]")
            above = own
        for axes in above:
            axes.set_xlabel("Time [s]" if len(recordings) == 1 else "Time, logs in turn [s]")
        if compass:
            for i in range(sections):
                _compass(figure.add_subplot(grid[rows - 1, i]), checkup, i)
        figure.suptitle(title, x=0.01, ha="left", fontsize=9)
    return figure


def _starts(recordings: tuple[Recording, ...]) -> list[float]:
    """What is added to each log's times so that logs stand one after the other; the first begins at 0."""
    gap = _GAP * sum(r.clock.duration for r in recordings)
    starts, at = [], 0.0
    for recording in recordings:
        starts.append(at - float(recording.time[0]))
        at += recording.clock.duration + gap
    return starts


def _pressures(axes: Axes, checkup: Checkup, section: int, starts: list[float]) -> None:
    recordings = checkup.recordings
    arm = recordings[0].arm
    parameters = arm.parameters.sections[section]
    own = list(dict.fromkeys(arm.inputs.index(b.input) for b in parameters.resolved_bellows(section + 1)))
    for number, (recording, start) in enumerate(zip(recordings, starts, strict=True)):
        pressures = read_pressures(recording)
        for place, j in enumerate(own):
            label = recording.pressures.columns[j] if number == 0 else None
            values = pressures[:, j] / PASCAL_PER_KILOPASCAL
            draw(axes, recording.time + start, values, color=COLORS[place % len(COLORS)], label=label, linewidth=0.9)
            fact = recording.pressure_facts[j]
            for a, b in (*fact.frozen, *fact.dropouts):
                axes.axvspan(a + start, b + start, ymin=0.0, ymax=0.05, color=LOST, linewidth=0)
        for a, b in checkup.logs[number].steady:
            axes.axvspan(a + start, b + start, color=STEADY, linewidth=0, zorder=0.5)
    _range(axes, np.array(parameters.pressure_range) / PASCAL_PER_KILOPASCAL)
    _separate(axes, recordings, starts)
    _legend(axes)


def _outputs(axes: Axes, recordings: tuple[Recording, ...], kind: str, section: int, starts: list[float]) -> None:
    drawn = False
    for number, (recording, start) in enumerate(zip(recordings, starts, strict=True)):
        own = [k for k, o in enumerate(recording.outputs) if o.kind == kind and o.section == section + 1]
        for place, k in enumerate(own):
            values = np.where(recording.usable[:, k], recording.measured[:, k], np.nan) * MILLIMETRES_PER_METRE
            known = np.isfinite(values)
            color = COLORS[place % len(COLORS)]
            label = recording.outputs[k].name if number == 0 else None
            draw(axes, recording.time[known] + start, values[known], color=color, label=label, linewidth=0.9)
            fact = recording.facts[k]
            for a, b in (*fact.frozen, *fact.dropouts):
                axes.axvspan(a + start, b + start, ymin=0.0, ymax=0.05, color=LOST, linewidth=0)
            if fact.spikes:
                at = np.array(fact.spikes) + start
                axes.plot(
                    at, np.full(len(at), 0.03), "|", color=LOST, markersize=5, transform=axes.get_xaxis_transform()
                )
            drawn = True
    if kind == "length":
        limits = recordings[0].arm.parameters.sections[section].length_range
        _range(axes, np.array(limits) * MILLIMETRES_PER_METRE)
    _separate(axes, recordings, starts)
    if drawn:
        _legend(axes)
    else:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", va="center", color="#666666")


def _legend(axes: Axes) -> None:
    """Names above the panel, where no line runs."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=6, fontsize=6, handlelength=1.0, columnspacing=0.8,
        borderpad=0.1, borderaxespad=0.0,
    )  # fmt: skip


def _range(axes: Axes, limits: Array) -> None:
    for limit in limits:
        axes.axhline(limit, color="#666666", linewidth=0.7, linestyle=DASHED, zorder=1.5)


def _separate(axes: Axes, recordings: tuple[Recording, ...], starts: list[float]) -> None:
    for recording, start in zip(recordings[1:], starts[1:], strict=True):
        axes.axvline(float(recording.time[0]) + start, color="#666666", linewidth=0.5, linestyle=(0, (1, 2)))
    axes.set_xlim(0.0, float(recordings[-1].time[-1]) + starts[-1])


def _compass(axes: Axes, checkup: Checkup, section: int) -> None:
    """Arrows of bending: by the file dashed and of unit length, by the logs solid, the longest of unit length."""
    from bha.checkup.wiring import as_filed, seen_drive  # noqa: PLC0415  (plots are an extra; checks need none)

    found = checkup.evidence
    assert found is not None
    axes.set_aspect("equal")
    axes.set_xlim(-1.45, 1.45)
    axes.set_ylim(-1.45, 1.45)
    axes.set_xticks([-1, 0, 1], ["−x", "", "+x"])
    axes.set_yticks([-1, 0, 1], ["−y", "", "+y"])
    circle = np.linspace(0.0, 2.0 * np.pi, 100)
    axes.plot(np.cos(circle), np.sin(circle), color=GRID, linewidth=0.8, zorder=1.2)
    group = next((g for g in ("heads", "lengths") if (g, section, "bending") in found.informative), None)
    inputs = found.layout.inputs_of(section)
    filed = seen_drive(found.layout, as_filed(found.layout), "")[0][section]
    largest = max((abs(filed[j]) for j in inputs), default=0.0)
    measured = np.zeros(len(filed), dtype=np.complex128)
    moved = [j for j in inputs if found.moved[j]]
    if group is not None and moved:
        pp, yp, _ = found.blocks[group, section, "bending"].total()
        own = pp[np.ix_(moved, moved)]
        measured[moved] = np.linalg.lstsq(own, yp[moved], rcond=1e-2)[0]
        measured /= max(float(np.abs(measured).max()), 1e-300)
    columns = checkup.recordings[0].pressures.columns
    for place, j in enumerate(inputs):
        color = COLORS[place % len(COLORS)]
        if largest > 0.0 and abs(filed[j]) > 1e-3 * largest:
            direction = filed[j] / abs(filed[j])
            _arrow(axes, direction, color, DASHED, 0.9)
            axes.text(
                1.22 * direction.real,
                1.22 * direction.imag,
                columns[j],
                ha="center",
                va="center",
                fontsize=6.5,
                color=color,
            )
        if abs(measured[j]) > 0.05:
            _arrow(axes, complex(measured[j]), color, SOLID, 1.8)
    by = {"heads": "by heads", "lengths": "by lengths", None: "not told"}[group]
    axes.set_title(f"Bending. Dashed: file, solid: {by}", loc="left", fontsize=6.5)


def _arrow(axes: Axes, to: complex, color: str, style: Any, width: float) -> None:
    axes.plot([0.0, to.real], [0.0, to.imag], color=color, linestyle=style, linewidth=width, zorder=2.5)
    turn = to / abs(to) * 0.13
    for side in (1.0, -1.0):
        back = to - turn * np.exp(1j * side * 0.45)
        axes.plot([to.real, back.real], [to.imag, back.imag], color=color, linewidth=width, zorder=2.5)
