"""The picture of the residual force: against length, rate, pressure and time of the bellows, with its 95 % band."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.figures import ACCENT, BEFORE, MEASURED, layout, plotly, subplots
from bha.diagnosis.force_law import inputs_of, tabled_force
from bha.diagnosis.force_summary import BAND, TOLD

if TYPE_CHECKING:
    from bha.diagnosis.force_summary import Unexplained

Array = NDArray[np.float64]

#: Most coordinates that are drawn, points of a cloud, and bins of its mean.
ROWS, POINTS, BINS = 3, 700, 12


def force_figure(unexplained: Unexplained) -> Any | None:
    """A row a coordinate, those with the greatest force; None where no force is known."""
    force, along = unexplained.force, unexplained.found.along
    if force is None or not any(line.told >= TOLD for line in along):
        return None
    go = plotly()
    told = [k for k in range(len(along)) if along[k].told >= TOLD]
    chosen = sorted(sorted(told, key=lambda k: -along[k].rms)[:ROWS])
    ambient = force.arm.parameters.ambient_pressure
    standard = force.arm.parameters.has_standard_bellows
    inputs = inputs_of(force.arm)
    titles = ["length, mm", "rate, mm/s", *(["pressure, kPa gauge"] if standard else []), "time, s"]
    figure = subplots(
        rows=len(chosen),
        cols=len(titles),
        shared_xaxes="columns",
        shared_yaxes="rows",
        subplot_titles=[escape(along[k].where) if c == 0 else "" for k in chosen for c in range(len(titles))],
        horizontal_spacing=0.03,
        vertical_spacing=0.5 / (1 + 2 * len(chosen)),
    )
    logs = range(len(force.names))
    # Of the time along the log whose force is greatest: logs one after the other would be no axis.
    shown = max(logs, key=lambda j: float(np.mean(force.of_log(force.force, j) ** 2)))
    tabled = np.full((sum(force.lasts), len(along)), np.nan)
    if unexplained.table is not None:
        tabled = np.concatenate([tabled_force(unexplained.table, force, j) for j in logs])
    for row, k in enumerate(chosen, start=1):
        values = [force.of_log(force.force, j)[:, k] for j in logs]
        wide = np.concatenate([BAND * force.of_log(force.deviation, j)[:, k] for j in logs])
        everywhere = np.concatenate(values)
        own = [
            1e3 * np.concatenate([force.of_log(force.lengths, j)[:, k] for j in logs]),
            1e3 * np.concatenate([force.of_log(force.rates, j)[:, k] for j in logs]),
        ]
        if standard:
            pressures = [force.of_log(force.pressures, j)[:, inputs[k]] for j in logs]
            own.append(1e-3 * (np.concatenate(pressures) - ambient))
        for column, at in enumerate(own, start=1):
            for trace in _cloud(go, at, (everywhere, wide, tabled[:, k]), legend=row == 1 and column == 1):
                figure.add_trace(trace, row=row, col=column)
        time, line = force.of_log(force.time, shown), values[shown]
        band = BAND * force.of_log(force.deviation, shown)[:, k]
        for trace in _line(go, time, line, band):
            figure.add_trace(trace, row=row, col=len(titles))
        figure.update_yaxes(title="force, N", row=row, col=1)
    for column, title in enumerate(titles, start=1):
        end = f" ({escape(force.names[shown])})" if column == len(titles) else ""
        figure.update_xaxes(title=f"{title}{end}", row=len(chosen), col=column)
    return layout(figure, 210 * len(chosen) + 90, titled=True)


def _rounded(values: Array) -> list[float]:
    return [float(f"{value:.4g}") for value in values]


def _cloud(go: Any, at: Array, found: tuple[Array, Array, Array], *, legend: bool) -> list[Any]:
    """Points, the mean of the force in bins with the band of a moment, and the mean of what the table gives there."""
    values, wide, tabled = found
    some = np.unique(np.linspace(0, len(at) - 1, POINTS).round().astype(int))
    edges = np.unique(np.quantile(at, np.linspace(0.0, 1.0, BINS + 1)))
    place = np.clip(np.searchsorted(edges, at, side="right") - 1, 0, max(len(edges) - 2, 0))
    bins = [place == b for b in np.unique(place)]
    x, y, given = (np.array([np.mean(table[own]) for own in bins]) for table in (at, values, tabled))
    half = np.array([np.sqrt(np.mean(wide[own] ** 2)) for own in bins])
    points = go.Scatter(
        x=_rounded(at[some]),
        y=_rounded(values[some]),
        mode="markers",
        marker={"size": 3, "color": BEFORE, "opacity": 0.3},
        name="force at a moment",
        showlegend=legend,
        hoverinfo="skip",
    )
    drawn = [points, *_line(go, x, y, half, name="mean, and 95 % band of a moment" if legend else "")]
    if np.all(np.isfinite(given)):
        colour = {"color": ACCENT, "width": 2}
        name = "mean of what the table gives"
        drawn.append(go.Scatter(x=_rounded(x), y=_rounded(given), line=colour, name=name, showlegend=legend))
    return drawn


def _line(go: Any, x: Array, y: Array, half: Array, name: str = "") -> list[Any]:
    band = go.Scatter(
        x=_rounded(np.concatenate([x, x[::-1]])),
        y=_rounded(np.concatenate([y - half, (y + half)[::-1]])),
        fill="toself",
        fillcolor="rgba(34,34,34,0.15)",
        line={"width": 0},
        hoverinfo="skip",
        showlegend=False,
    )
    line = go.Scatter(
        x=_rounded(x),
        y=_rounded(y),
        mode="lines",
        line={"color": MEASURED, "width": 1.5},
        name=name,
        showlegend=bool(name),
    )
    return [band, line]
